//! Vertices of corners: a list of the vertices at each point.

use std::hash::{DefaultHasher, Hasher};

use super::NONE;

/// Vertices by point and a key for all other attributes. Points have few vertices, and corners come in the order of a
/// mesh, so a short list for each point is much faster than one hash table.
#[derive(Debug, Default)]
pub(super) struct CornerTable {
    heads: Vec<u32>,
    keys: Vec<u64>,
    next: Vec<u32>,
    crowd: OverflowTable,
}

/// Longest list of a point.
const LONGEST: usize = 32;

/// Vertices of points that have too many for a list, in a hash table: open addressing with linear steps.
#[derive(Debug, Default)]
struct OverflowTable {
    /// Points and vertices.
    members: Vec<[u32; 2]>,
    /// Indices of members; [`NONE`] is free.
    slots: Vec<u32>,
}

impl CornerTable {
    pub fn new(points: usize) -> Self {
        Self { heads: vec![NONE; points], ..Self::default() }
    }

    /// Number of vertices so far.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    pub fn key(&self, vertex: usize) -> u64 {
        self.keys[vertex]
    }

    /// Removes all vertices; `points` are their points.
    pub fn clear(&mut self, points: &[u32]) {
        for point in points {
            self.heads[*point as usize] = NONE;
        }
        self.keys.clear();
        self.next.clear();
        self.crowd.members.clear();
        self.crowd.slots.clear();
    }

    /// The vertex of this point and key, if it exists.
    pub fn find(&self, point: u32, key: u64) -> Option<u32> {
        let mut vertex = self.heads[point as usize];
        for _ in 0..LONGEST {
            if vertex == NONE {
                return None;
            }
            if self.keys[vertex as usize] == key {
                return Some(vertex);
            }
            vertex = self.next[vertex as usize];
        }
        self.crowd.find(point, key, &self.keys)
    }

    /// The vertex of this point and key, and whether it existed.
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
        if let Some(vertex) = self.crowd.find(point, key, &self.keys) {
            return (vertex, true);
        }
        let vertex = self.push(key, NONE);
        self.crowd.insert(point, vertex, &self.keys);
        (vertex, false)
    }

    /// Appends a vertex that no other corner shares.
    pub fn push(&mut self, key: u64, next: u32) -> u32 {
        self.keys.push(key);
        self.next.push(next);
        self.keys.len() as u32 - 1
    }
}

impl OverflowTable {
    fn find(&self, point: u32, key: u64, keys: &[u64]) -> Option<u32> {
        if self.slots.is_empty() {
            return None;
        }
        let member = *self.slots.get(self.slot(point, key, keys))?;
        self.members.get(member as usize).map(|[_, vertex]| *vertex)
    }

    /// Adds a vertex that is not in the table yet.
    fn insert(&mut self, point: u32, vertex: u32, keys: &[u64]) {
        self.members.push([point, vertex]);
        if self.members.len() * 2 > self.slots.len() {
            self.slots = vec![NONE; (self.slots.len() * 2).max(64)];
            for member in 0..self.members.len() as u32 {
                let [point, vertex] = self.members[member as usize];
                let slot = self.slot(point, keys[vertex as usize], keys);
                self.slots[slot] = member;
            }
        } else {
            let slot = self.slot(point, keys[vertex as usize], keys);
            self.slots[slot] = self.members.len() as u32 - 1;
        }
    }

    /// Slot of the member, or the free slot for it.
    fn slot(&self, point: u32, key: u64, keys: &[u64]) -> usize {
        // The standard hasher with its fixed key: the same on every run, and not easily made to collide.
        let mut hasher = DefaultHasher::new();
        hasher.write_u32(point);
        hasher.write_u64(key);
        let mask = self.slots.len() - 1;
        let mut slot = hasher.finish() as usize & mask;
        while let Some([other, vertex]) = self.members.get(self.slots[slot] as usize) {
            if *other == point && keys[*vertex as usize] == key {
                break;
            }
            slot = (slot + 1) & mask;
        }
        slot
    }
}
