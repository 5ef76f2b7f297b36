//! The hierarchy in memory: laid out depth first, so that nodes near in space are near in memory.

use glam::Vec3;
use rayon::prelude::*;

use super::build::{self, Part, Primitive};
use super::node::{Bounds, Boxes, Node, WIDTH};
use super::packet::Packet;

/// Bound on the levels of nodes: the builder halves ranges long before it.
pub(super) const DEPTH: usize = 40;
/// A subtree with more nodes is refitted in parallel.
const SEQUENTIAL: usize = 512;

/// Nodes over packets of triangles.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    /// The root, then its children, then the subtree of the first of them, and so on.
    pub nodes: Vec<Node>,
    /// Packets in the same order.
    pub packets: Vec<Packet>,
    /// The points of each packet.
    sources: Vec<[u32; 8]>,
    /// Box around all triangles.
    pub bounds: Bounds,
}

/// A node during construction: drafts are in order of levels and know their children.
struct Draft {
    node: Node,
    leaves: Vec<Part>,
    /// Index of the first child among the drafts.
    first: usize,
    /// Numbers of nodes and packets below the draft.
    below: [u32; 2],
}

impl Tree {
    /// Builds the hierarchy over the usable triangles; returns it and their number.
    pub fn build(points: &[Vec3], triangles: &[[u32; 3]]) -> (Self, usize) {
        let (mut primitives, count) = build::primitives(points, triangles);
        let mut tree = Self::default();
        if primitives.is_empty() {
            return (tree, 0);
        }
        let mut drafts = draft(&mut primitives, triangles);
        tree.nodes = arrange(&mut drafts).into_iter().map(|i| drafts[i].node).collect();
        let [_, packets] = drafts[0].below;
        let (empty, _) = Packet::new(&[]);
        tree.packets = vec![empty; packets as usize];
        tree.sources = vec![[0; 8]; packets as usize];
        // The packets of each draft's leaves are consecutive, and drafts follow each other.
        let (mut packets, mut sources) = (&mut tree.packets[..], &mut tree.sources[..]);
        let mut work = Vec::with_capacity(drafts.len());
        let mut by_packet: Vec<&Draft> = drafts.iter().filter(|draft| !draft.leaves.is_empty()).collect();
        by_packet.sort_unstable_by_key(|draft| draft.node.first_packet);
        for draft in by_packet {
            let own;
            let own_sources;
            (own, packets) = std::mem::take(&mut packets).split_at_mut(draft.node.packets());
            (own_sources, sources) = std::mem::take(&mut sources).split_at_mut(draft.node.packets());
            work.push((&draft.leaves, own, own_sources));
        }
        work.into_par_iter().with_min_len(64).for_each(|(leaves, packets, sources)| {
            let mut places = packets.iter_mut().zip(sources);
            for leaf in leaves {
                let quads = build::quads(&primitives[leaf.range.clone()], triangles);
                for pair in quads.as_slice().chunks(2) {
                    if let Some((packet, source)) = places.next() {
                        (*packet, *source) = Packet::new(pair);
                    }
                }
            }
        });
        tree.refit(points);
        (tree, count)
    }

    /// Indices of the points that triangles use; some appear several times.
    pub fn points(&self) -> impl Iterator<Item = usize> {
        self.sources.iter().flatten().map(|&point| point as usize)
    }

    /// Refits all boxes to new positions of the same points.
    pub fn refit(&mut self, points: &[Vec3]) {
        self.bounds = match self.nodes.split_first_mut() {
            Some((root, below)) => {
                Region { first: 1, nodes: below, packets: &mut self.packets, sources: &self.sources }
                    .refit(root, points)
            }
            None => Bounds::EMPTY,
        };
    }
}

/// Splits all primitives level by level.
fn draft(primitives: &mut [Primitive], triangles: &[[u32; 3]]) -> Vec<Draft> {
    let mut drafts: Vec<Draft> = Vec::new();
    let mut level = vec![build::whole(primitives)];
    let mut depth = 0;
    while !level.is_empty() {
        let split: Vec<Vec<Part>> = slices(primitives, &level)
            .into_par_iter()
            .zip(&level)
            .map(|(own, part)| build::children(own, part, triangles, depth))
            .collect();
        let mut first = drafts.len() + level.len();
        let mut below = Vec::with_capacity(level.len() * 4);
        for parts in split {
            let (leaves, inner): (Vec<Part>, Vec<Part>) = parts.into_iter().partition(|part| part.packets > 0);
            let node = Node::new(inner.len(), leaves.iter().map(|leaf| leaf.packets));
            drafts.push(Draft { node, leaves, first, below: [0; 2] });
            first += inner.len();
            below.extend(inner);
        }
        level = below;
        depth += 1;
    }
    drafts
}

/// Assigns each node the place of its children; returns the index of the draft at each place.
fn arrange(drafts: &mut [Draft]) -> Vec<usize> {
    for i in (0..drafts.len()).rev() {
        let (first, inner) = (drafts[i].first, drafts[i].node.inner());
        let [mut nodes, mut packets] = [inner as u32, drafts[i].node.packets() as u32];
        for child in &drafts[first..first + inner] {
            nodes += child.below[0];
            packets += child.below[1];
        }
        drafts[i].below = [nodes, packets];
    }
    let mut order = vec![0; drafts.len()];
    let mut waiting = vec![(0, 1, 0)];
    while let Some((i, first_node, first_packet)) = waiting.pop() {
        let draft = &mut drafts[i];
        (draft.node.first_node, draft.node.first_packet) = (first_node, first_packet);
        let (first, inner) = (draft.first, draft.node.inner());
        let mut node = first_node + inner as u32;
        let mut packet = first_packet + draft.node.packets() as u32;
        for child in first..first + inner {
            order[first_node as usize + child - first] = child;
            waiting.push((child, node, packet));
            node += drafts[child].below[0];
            packet += drafts[child].below[1];
        }
    }
    order
}

/// The nodes and packets below a node.
struct Region<'a> {
    /// Index of the first of `nodes`.
    first: usize,
    nodes: &'a mut [Node],
    packets: &'a mut [Packet],
    sources: &'a [[u32; 8]],
}

impl<'a> Region<'a> {
    /// Refits the subtree of `node` and the node itself; returns the box around it.
    fn refit(self, node: &mut Node, points: &[Vec3]) -> Bounds {
        let mut boxes = Boxes::EMPTY;
        let inner = node.inner();
        let (leaves, mut packets) = self.packets.split_at_mut(node.packets());
        let (leaf_sources, mut sources) = self.sources.split_at(leaves.len());
        let mut places = leaves.iter_mut().zip(leaf_sources);
        for i in inner..node.len() {
            let mut bounds = Bounds::EMPTY;
            for (packet, source) in places.by_ref().take(node.packets_of(i)) {
                bounds = bounds.union(packet.place(points, source));
            }
            boxes.set(i, &bounds);
        }
        let parallel = self.nodes.len() > SEQUENTIAL;
        let (children, mut nodes) = self.nodes.split_at_mut(inner);
        let first_packet = node.first_packet as usize + leaves.len();
        let mut first = self.first + inner;
        let mut regions: [Option<(&mut Node, Region)>; WIDTH] = Default::default();
        let ends: [(usize, usize); WIDTH] = std::array::from_fn(|i| {
            children
                .get(i + 1)
                .map_or((usize::MAX, usize::MAX), |next| (next.first_node as usize, next.first_packet as usize))
        });
        let mut packet = first_packet;
        for (i, child) in children.iter_mut().enumerate() {
            let below = (ends[i].0 - first).min(nodes.len());
            let own = (ends[i].1 - packet).min(packets.len());
            let region;
            (region, nodes) = std::mem::take(&mut nodes).split_at_mut(below);
            let region_packets;
            (region_packets, packets) = std::mem::take(&mut packets).split_at_mut(own);
            let region_sources;
            (region_sources, sources) = sources.split_at(own);
            let region = Region { first, nodes: region, packets: region_packets, sources: region_sources };
            if parallel {
                regions[i] = Some((child, region));
            } else {
                boxes.set(i, &region.refit(child, points));
            }
            first += below;
            packet += own;
        }
        if parallel {
            let refitted: Vec<Option<Bounds>> = regions
                .into_par_iter()
                .map(|region| region.map(|(child, region)| region.refit(child, points)))
                .collect();
            for (i, bounds) in refitted.iter().enumerate() {
                bounds.iter().for_each(|bounds| boxes.set(i, bounds));
            }
        }
        node.fit(&boxes)
    }
}

/// The primitives of each part; parts are in order and do not overlap.
fn slices<'a>(mut primitives: &'a mut [Primitive], parts: &[Part]) -> Vec<&'a mut [Primitive]> {
    let mut at = 0;
    parts
        .iter()
        .map(|part| {
            let (_, rest) = std::mem::take(&mut primitives).split_at_mut(part.range.start - at);
            let (own, rest) = rest.split_at_mut(part.range.len());
            at = part.range.end;
            primitives = rest;
            own
        })
        .collect()
}
