//! Which vertex a corner is: a list of the vertices at each point.

use std::collections::HashMap;

use super::NONE;

/// Vertices by point and a key for everything else. Points have few vertices, and corners come in the order of a mesh,
/// so a short list a point is much faster than a hash of all.
#[derive(Debug, Default)]
pub(super) struct CornerTable {
    heads: Vec<u32>,
    keys: Vec<u64>,
    next: Vec<u32>,
    /// Vertices of points that have too many for a list.
    overflow: HashMap<(u32, u64), u32>,
}

/// The longest list.
const LONGEST: usize = 32;

impl CornerTable {
    pub fn new(points: usize) -> Self {
        Self { heads: vec![NONE; points], ..Self::default() }
    }

    /// Vertices so far.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    pub fn key(&self, vertex: usize) -> u64 {
        self.keys[vertex]
    }

    /// Forgets all vertices; `points` are theirs.
    pub fn clear(&mut self, points: &[u32]) {
        for point in points {
            self.heads[*point as usize] = NONE;
        }
        self.keys.clear();
        self.next.clear();
        self.overflow.clear();
    }

    /// The vertex of this point and key, and whether it was there.
    #[inline]
    pub fn vertex(&mut self, point: u32, key: u64) -> (u32, bool) {
        let head = self.heads[point as usize];
        let mut vertex = head;
        for _ in 0..LONGEST {
            if vertex == NONE {
                self.heads[point as usize] = self.keys.len() as u32;
                return (self.push(key, head), false);
            }
            if self.keys[vertex as usize] == key {
                return (vertex, true);
            }
            vertex = self.next[vertex as usize];
        }
        if let Some(vertex) = self.overflow.get(&(point, key)) {
            return (*vertex, true);
        }
        let vertex = self.push(key, NONE);
        self.overflow.insert((point, key), vertex);
        (vertex, false)
    }

    /// A vertex that no other corner shares.
    pub fn push(&mut self, key: u64, next: u32) -> u32 {
        self.keys.push(key);
        self.next.push(next);
        self.keys.len() as u32 - 1
    }
}
