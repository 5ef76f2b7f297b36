//! The mesh under a brush: which points lie within its radius, and how far from its middle.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
};

use glam::Vec3;

use super::{BrushReach, Mirror};
use crate::{algo::weights::fill::Graph, mesh::surface::Surface};

/// Largest distance of a point from the mirror image of another that is its partner, as a share of the radius.
const SAME: f32 = 0.01;
/// Least share of points with a partner where a mesh counts as its own mirror image.
const MIRRORED: f32 = 0.9;

/// A mesh at rest, prepared for brushes. Points at one place count as one, so that seams stay closed.
pub struct Canvas {
    graph: Graph,
    surface: Surface,
    triangles: Vec<[u32; 3]>,
    /// Number of points of the mesh.
    count: usize,
    /// Points of each node, one node after the other.
    points: Vec<u32>,
    starts: Vec<u32>,
    /// Nodes by their first coordinate.
    order: Vec<u32>,
}

/// A place on a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// The place.
    pub place: Vec3,
    /// The triangle on which it lies.
    pub triangle: u32,
}

impl Canvas {
    /// Prepares a mesh. Points that are not finite cannot be painted; triangles with corners out of range are ignored.
    /// O(n log n), for a background task.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let graph = Graph::new(points, triangles);
        let node_of = |point: usize| graph.node(point);
        let mut starts = vec![0; graph.len() + 1];
        (0..points.len()).filter_map(node_of).for_each(|node| starts[node + 1] += 1);
        for node in 0..graph.len() {
            starts[node + 1] += starts[node];
        }
        let mut places: Vec<u32> = starts.clone();
        let mut listed = vec![0; starts[graph.len()] as usize];
        for point in 0..points.len() {
            if let Some(node) = node_of(point) {
                listed[places[node] as usize] = point as u32;
                places[node] += 1;
            }
        }
        let mut order: Vec<u32> = (0..graph.len() as u32).collect();
        let x = |node: u32| graph.place(node as usize).x;
        order.sort_unstable_by(|a, b| x(*a).total_cmp(&x(*b)).then(a.cmp(b)));
        Self {
            surface: Surface::build(points, triangles),
            triangles: triangles.to_vec(),
            count: points.len(),
            graph,
            points: listed,
            starts,
            order,
        }
    }

    /// The place of the mesh nearest to a position; `None` for a mesh without triangles, or a position that is not finite.
    pub fn nearest(&self, position: Vec3) -> Option<Spot> {
        let found = self.surface.closest_point(position)?;
        Some(Spot { place: found.point, triangle: found.triangle })
    }

    /// The place of a triangle with these barycentric coordinates; `None` for a triangle that the mesh does not have.
    pub fn spot(&self, triangle: u32, barycentric: Vec3) -> Option<Spot> {
        let nodes = self.corners(triangle)?;
        let shares = barycentric.to_array();
        let place: Vec3 = nodes.iter().zip(shares).map(|(node, share)| self.graph.place(*node) * share).sum();
        place.is_finite().then_some(Spot { place, triangle })
    }

    /// The point at the corner of a spot's triangle that is nearest to it.
    pub fn point_at(&self, spot: &Spot) -> Option<u32> {
        let corners = self.triangles.get(spot.triangle as usize)?;
        let far = |point: u32| {
            let node = self.node(point)?;
            Some((self.graph.place(node).distance_squared(spot.place), point))
        };
        let nearest = corners.iter().filter_map(|point| far(*point)).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, point)| point)
    }

    /// Points within a radius of a spot, rising, each with its distance.
    pub fn within(&self, spot: &Spot, radius: f32, reach: BrushReach) -> Vec<(u32, f32)> {
        let nodes = self.nodes_within(spot, radius, reach);
        let mut points: Vec<(u32, f32)> =
            nodes.into_iter().flat_map(|(node, far)| self.points_of(node).iter().map(move |p| (*p, far))).collect();
        points.sort_by_key(|(point, _)| *point);
        points
    }

    /// Nodes within a radius of a spot, rising, each with its distance.
    pub(super) fn nodes_within(&self, spot: &Spot, radius: f32, reach: BrushReach) -> Vec<(u32, f32)> {
        match reach {
            BrushReach::Volume => self.in_ball(spot.place, radius),
            BrushReach::Surface => self.along_edges(spot, radius),
        }
    }

    /// Nodes within a radius of the mirror image of a spot, rising, each with its distance. `near` are those of the spot.
    ///
    /// Where the mesh is its own mirror image, distances are those of the nodes on this side, so that both sides get the
    /// same even if their triangles run across other diagonals.
    pub(super) fn images(
        &self,
        near: &[(u32, f32)],
        spot: &Spot,
        mirror: &Mirror,
        radius: f32,
        reach: BrushReach,
    ) -> Vec<(u32, f32)> {
        let mut images: BTreeMap<u32, f32> = BTreeMap::new();
        let mut found = 0;
        for (node, far) in near {
            let image = mirror.image(self.graph.place(*node as usize));
            let there = self.in_ball(image, radius * SAME).into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((other, _)) = there {
                found += 1;
                images.entry(other).and_modify(|known| *known = known.min(*far)).or_insert(*far);
            }
        }
        if found as f32 >= MIRRORED * near.len() as f32 {
            return images.into_iter().collect();
        }
        let image = mirror.image(spot.place);
        match self.nearest(image).filter(|found| found.place.distance(image) < radius) {
            Some(there) => self.nodes_within(&there, radius, reach),
            None => Vec::new(),
        }
    }

    /// Points of a node, rising.
    pub(super) fn points_of(&self, node: u32) -> &[u32] {
        let node = node as usize;
        &self.points[self.starts[node] as usize..self.starts[node + 1] as usize]
    }

    /// Nodes that share an edge with a node, rising.
    pub(super) fn neighbours(&self, node: u32) -> &[u32] {
        self.graph.neighbours(node as usize)
    }

    /// The node of a point; `None` for a point that the mesh does not have, or that is not finite.
    fn node(&self, point: u32) -> Option<usize> {
        if (point as usize) < self.count { self.graph.node(point as usize) } else { None }
    }

    fn corners(&self, triangle: u32) -> Option<[usize; 3]> {
        let [a, b, c] = *self.triangles.get(triangle as usize)?;
        Some([self.node(a)?, self.node(b)?, self.node(c)?])
    }

    fn in_ball(&self, middle: Vec3, radius: f32) -> Vec<(u32, f32)> {
        let place = |node: &u32| self.graph.place(*node as usize);
        let first = self.order.partition_point(|node| place(node).x < middle.x - radius);
        let last = self.order.partition_point(|node| place(node).x <= middle.x + radius);
        let near = self.order[first..last.max(first)].iter().map(|node| (*node, place(node).distance(middle)));
        let mut near: Vec<(u32, f32)> = near.filter(|(_, far)| *far < radius).collect();
        near.sort_unstable_by_key(|(node, _)| *node);
        near
    }

    /// Ways along edges (Dijkstra's algorithm), from the corners of the spot's triangle outwards.
    fn along_edges(&self, spot: &Spot, radius: f32) -> Vec<(u32, f32)> {
        let Some(corners) = self.corners(spot.triangle) else { return Vec::new() };
        let mut known: BTreeMap<u32, f32> = BTreeMap::new();
        // Bits of numbers that are not negative are in the order of the numbers.
        let mut open: BinaryHeap<Reverse<(u32, u32)>> = BinaryHeap::new();
        let mut reach = |open: &mut BinaryHeap<Reverse<(u32, u32)>>, node: u32, far: f32| {
            if far < radius && known.get(&node).is_none_or(|before| far < *before) {
                known.insert(node, far);
                open.push(Reverse((far.to_bits(), node)));
            }
        };
        for node in corners {
            reach(&mut open, node as u32, self.graph.place(node).distance(spot.place));
        }
        let mut done: BTreeMap<u32, f32> = BTreeMap::new();
        while let Some(Reverse((bits, node))) = open.pop() {
            let far = f32::from_bits(bits);
            if done.contains_key(&node) {
                continue;
            }
            done.insert(node, far);
            let place = self.graph.place(node as usize);
            for next in self.graph.neighbours(node as usize) {
                reach(&mut open, *next, far + self.graph.place(*next as usize).distance(place));
            }
        }
        done.into_iter().collect()
    }
}
