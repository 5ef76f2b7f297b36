//! Construction of the hierarchy: top down, by binned surface area heuristic (Wald, "On fast Construction of SAH-based
//! Bounding Volume Hierarchies", 2007), eight children at a time.
//!
//! Clustering bottom up (PLOC) is faster on good meshes, but takes quadratic time where each box is nearest to a
//! smaller neighbour, as in a fan of growing triangles, or where many boxes are equal. Depth and time of this
//! construction are bounded for any input. Only minima, maxima and whole numbers are combined across threads, so the
//! number of threads changes nothing.

use std::ops::Range;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::crossing::usable;
use super::node::{Bounds, WIDTH};
use super::packet::{LANES, Quad};

/// Bins along an axis; planes between them are candidates.
const BINS: usize = 16;
/// Bins for parts of few primitives.
const FEW_BINS: usize = 8;
/// Largest number of primitives that get [`FEW_BINS`].
const FEW: usize = 24;
/// Depth from which ranges are halved instead, so that the depth stays below `tree::DEPTH`.
const PATIENCE: usize = 20;
/// Largest number of triangles in a leaf.
const MOST: usize = 2 * LANES;
/// Primitives in a unit of parallel work.
const CHUNK: usize = 1 << 14;

/// Single triangle, or two in sequence that fill one box well (mostly the halves of a quad).
#[derive(Debug, Clone, Copy)]
pub(super) struct Primitive {
    /// Lower bounds; the last is the upper half of the triangle's index.
    low: Vec4,
    /// Upper bounds; the last is the lower half of the index, twice, plus one if there are two triangles.
    high: Vec4,
}

impl Primitive {
    fn new(bounds: Bounds, triangle: u32, two: bool) -> Self {
        Self {
            low: bounds.low.extend((triangle >> 16) as f32),
            high: bounds.high.extend(((triangle & 0xffff) * 2 + u32::from(two)) as f32),
        }
    }

    /// The triangles of the primitive.
    pub fn triangles(&self) -> Range<u32> {
        let low = self.high.w as u32;
        let first = (self.low.w as u32) << 16 | low >> 1;
        first..first + self.count()
    }

    fn count(&self) -> u32 {
        1 + (self.high.w as u32 & 1)
    }
}

/// A box whose last lanes are unused.
#[derive(Debug, Clone, Copy)]
struct Box4 {
    low: Vec4,
    high: Vec4,
}

impl Box4 {
    const EMPTY: Self = Self { low: Vec4::INFINITY, high: Vec4::NEG_INFINITY };

    #[inline(always)]
    fn add(&mut self, low: Vec4, high: Vec4) {
        self.low = self.low.min(low);
        self.high = self.high.max(high);
    }

    fn union(mut self, other: Self) -> Self {
        self.add(other.low, other.high);
        self
    }

    fn half_area(&self) -> f32 {
        let size = (self.high - self.low).max(Vec4::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// Consecutive primitives that become one child.
#[derive(Debug, Clone)]
pub(super) struct Part {
    /// Indices of the primitives.
    pub range: Range<usize>,
    /// Number of packets if the primitives are a leaf (one or two), else zero.
    pub packets: usize,
    triangles: usize,
    bounds: Box4,
    /// Bounds of the doubled centres of the primitives' boxes.
    centers: Box4,
}

impl Part {
    fn new(start: usize, primitives: &[Primitive]) -> Self {
        let empty = Self { range: start..start, packets: 0, triangles: 0, bounds: Box4::EMPTY, centers: Box4::EMPTY };
        let mut part = primitives
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut part = empty.clone();
                chunk.iter().for_each(|primitive| part.add(primitive));
                part
            })
            .reduce(|| empty.clone(), Self::union);
        part.range = start..start + primitives.len();
        part
    }

    #[inline(always)]
    fn add(&mut self, primitive: &Primitive) {
        let center = primitive.low + primitive.high;
        self.bounds.add(primitive.low, primitive.high);
        self.centers.add(center, center);
        self.triangles += primitive.count() as usize;
    }

    fn union(self, other: Self) -> Self {
        Self {
            range: self.range,
            packets: 0,
            triangles: self.triangles + other.triangles,
            bounds: self.bounds.union(other.bounds),
            centers: self.centers.union(other.centers),
        }
    }

    /// Counts the packets that the part needs, if these are few enough for a leaf.
    fn settle(mut self, primitives: &[Primitive], triangles: &[[u32; 3]]) -> Self {
        if self.triangles <= MOST {
            let packets = quads(primitives, triangles).len.div_ceil(2);
            self.packets = if packets <= 2 { packets } else { 0 };
        }
        self
    }
}

/// Quads of a leaf.
#[derive(Debug)]
pub(super) struct Quads {
    quads: [Quad; MOST],
    len: usize,
}

impl Quads {
    pub fn as_slice(&self) -> &[Quad] {
        &self.quads[..self.len]
    }

    fn push(&mut self, quad: Quad) {
        if let Some(place) = self.quads.get_mut(self.len) {
            *place = quad;
            self.len += 1;
        }
    }
}

/// Pairs triangles that share an edge, in their order; takes at most [`MOST`] triangles.
pub(super) fn quads(primitives: &[Primitive], triangles: &[[u32; 3]]) -> Quads {
    let mut quads = Quads { quads: [Quad::one(0, [0; 3]); MOST], len: 0 };
    let mut alone = [0; MOST];
    let mut count = 0;
    for primitive in primitives {
        let own = primitive.triangles();
        let pair = [own.start, own.start + 1];
        if own.len() == 2
            && let Some(quad) = Quad::two(pair, triangles[pair[0] as usize], triangles[pair[1] as usize])
        {
            quads.push(quad);
            continue;
        }
        for triangle in own {
            if count < MOST {
                alone[count] = triangle;
                count += 1;
            }
        }
    }
    let mut alone = &mut alone[..count];
    while let Some((&mut first, rest)) = std::mem::take(&mut alone).split_first_mut() {
        let found = rest.iter().enumerate().find_map(|(i, &second)| {
            Some((i, Quad::two([first, second], triangles[first as usize], triangles[second as usize])?))
        });
        alone = rest;
        match found {
            Some((i, quad)) => {
                quads.push(quad);
                alone.swap(0, i);
                alone = &mut std::mem::take(&mut alone)[1..];
            }
            None => quads.push(Quad::one(first, triangles[first as usize])),
        }
    }
    quads
}

/// The boxes and counts of one bin.
#[derive(Debug, Clone, Copy)]
struct Bin {
    bounds: Box4,
    triangles: usize,
}

/// Mapping from a primitive's centre to its bin along an axis.
#[derive(Debug, Clone, Copy)]
struct Binning {
    axis: usize,
    base: f32,
    scale: f32,
}

impl Binning {
    #[inline(always)]
    fn bin(&self, primitive: &Primitive) -> usize {
        let center = (primitive.low + primitive.high)[self.axis];
        ((center - self.base) * self.scale) as usize
    }

    fn fill<const N: usize>(&self, primitives: &[Primitive]) -> [Bin; N] {
        if primitives.len() > 4 * CHUNK {
            let (left, right) = primitives.split_at(primitives.len() / 2);
            let (mut bins, others) = rayon::join(|| self.fill::<N>(left), || self.fill::<N>(right));
            for (bin, other) in bins.iter_mut().zip(others) {
                bin.bounds = bin.bounds.union(other.bounds);
                bin.triangles += other.triangles;
            }
            return bins;
        }
        let mut bins = [Bin { bounds: Box4::EMPTY, triangles: 0 }; N];
        for primitive in primitives {
            let bin = &mut bins[self.bin(primitive).min(N - 1)];
            bin.bounds.add(primitive.low, primitive.high);
            bin.triangles += primitive.count() as usize;
        }
        bins
    }
}

/// The primitives of all usable triangles, in their order, and the number of these triangles.
pub(super) fn primitives(points: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<Primitive>, usize) {
    let bounds_of = |triangle: &[u32; 3]| -> Option<Bounds> {
        let [a, b, c] = triangle.map(|corner| points.get(corner as usize).copied().filter(|&point| usable(point)));
        Some(Bounds::of([a?, b?, c?]))
    };
    let chunks: Vec<(Vec<Primitive>, usize)> = triangles
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, part)| {
            let start = chunk * CHUNK;
            let mut out = Vec::with_capacity(part.len().div_ceil(2) + part.len() / 8);
            let mut count = 0;
            let mut waiting: Option<(Bounds, u32)> = None;
            for (i, triangle) in part.iter().enumerate() {
                let Some(bounds) = bounds_of(triangle) else {
                    out.extend(waiting.take().map(|(bounds, first)| Primitive::new(bounds, first, false)));
                    continue;
                };
                count += 1;
                match waiting.take() {
                    Some((before, first)) => {
                        let both = before.union(bounds);
                        if both.half_area() <= 0.7 * (before.half_area() + bounds.half_area()) {
                            out.push(Primitive::new(both, first, true));
                        } else {
                            out.push(Primitive::new(before, first, false));
                            waiting = Some((bounds, (start + i) as u32));
                        }
                    }
                    None => waiting = Some((bounds, (start + i) as u32)),
                }
            }
            out.extend(waiting.map(|(bounds, first)| Primitive::new(bounds, first, false)));
            (out, count)
        })
        .collect();
    let count = chunks.iter().map(|(_, count)| count).sum();
    let mut out = Vec::with_capacity(chunks.iter().map(|(part, _)| part.len()).sum());
    chunks.iter().for_each(|(part, _)| out.extend_from_slice(part));
    (out, count)
}

/// Part with all primitives, not a leaf.
pub(super) fn whole(primitives: &[Primitive]) -> Part {
    Part::new(0, primitives)
}

/// Splits a part into as many children as a node has, at `level` below the root; reorders its `primitives`.
pub(super) fn children(primitives: &mut [Primitive], part: &Part, triangles: &[[u32; 3]], level: usize) -> Vec<Part> {
    let mut parts = Vec::with_capacity(WIDTH);
    let offset = part.range.start;
    // No part but the root can fit a leaf at this point.
    parts.push(part.clone().settle(primitives, triangles));
    // Parts too large for a leaf are split first, then parts too large for a packet.
    for packets in [0, 2] {
        while parts.len() < WIDTH {
            // The largest box is the likeliest to be hit.
            let mut widest: Option<(usize, f32)> = None;
            for (i, part) in parts.iter().enumerate().filter(|(_, part)| part.packets == packets) {
                let area = if level < PATIENCE { part.bounds.half_area() } else { part.triangles as f32 };
                if widest.is_none_or(|(_, widest)| area > widest) {
                    widest = Some((i, area));
                }
            }
            let Some((i, _)) = widest else { break };
            let range = parts[i].range.clone();
            let own = &mut primitives[range.start - offset..range.end - offset];
            let (left, right) = split(own, &parts[i], level < PATIENCE);
            let (own, other) = own.split_at(left.range.len());
            parts[i] = left.settle(own, triangles);
            parts.insert(i + 1, right.settle(other, triangles));
        }
    }
    parts
}

/// Splits a part in two, neither empty.
fn split(primitives: &mut [Primitive], part: &Part, by_area: bool) -> (Part, Part) {
    let plane = match primitives.len() {
        _ if !by_area => None,
        ..FEW => best_plane::<FEW_BINS>(primitives, part),
        _ => best_plane::<BINS>(primitives, part),
    };
    if let Some((binning, plane)) = plane {
        let (left, right) = partition(primitives, part.range.start, |primitive| binning.bin(primitive) < plane);
        if !left.range.is_empty() && !right.range.is_empty() {
            return (left, right);
        }
    }
    let (left, right) = primitives.split_at(primitives.len() / 2);
    let start = part.range.start;
    (Part::new(start, left), Part::new(start + left.len(), right))
}

/// The plane with the least expected cost: area times packets on both sides.
fn best_plane<const N: usize>(primitives: &[Primitive], part: &Part) -> Option<(Binning, usize)> {
    let size = (part.centers.high - part.centers.low).truncate();
    let axis = size.max_position();
    if size[axis] <= 0.0 {
        return None;
    }
    let binning = Binning { axis, base: part.centers.low[axis], scale: N as f32 * 0.999_99 / size[axis] };
    let bins = binning.fill::<N>(primitives);
    let cost = |bounds: &Box4, triangles: usize| bounds.half_area() * triangles.div_ceil(LANES) as f32;
    let mut right = [0.0; N];
    let (mut bounds, mut count) = (Box4::EMPTY, 0);
    for i in (1..N).rev() {
        bounds = bounds.union(bins[i].bounds);
        count += bins[i].triangles;
        right[i] = cost(&bounds, count);
    }
    let mut best: Option<(usize, f32)> = None;
    (bounds, count) = (Box4::EMPTY, 0);
    for i in 1..N {
        bounds = bounds.union(bins[i - 1].bounds);
        count += bins[i - 1].triangles;
        let total = cost(&bounds, count) + right[i];
        if count > 0 && count < part.triangles && best.is_none_or(|(_, best)| total < best) {
            best = Some((i, total));
        }
    }
    best.map(|(plane, _)| (binning, plane))
}

/// Reorders `primitives` so that those on the left come first.
fn partition(primitives: &mut [Primitive], start: usize, is_left: impl Fn(&Primitive) -> bool) -> (Part, Part) {
    let empty = Part { range: start..start, packets: 0, triangles: 0, bounds: Box4::EMPTY, centers: Box4::EMPTY };
    let (mut left, mut right) = (empty.clone(), empty);
    let (mut low, mut high) = (0, primitives.len());
    while low < high {
        let primitive = primitives[low];
        if is_left(&primitive) {
            left.add(&primitive);
            low += 1;
        } else {
            right.add(&primitive);
            high -= 1;
            primitives.swap(low, high);
        }
    }
    left.range = start..start + low;
    right.range = start + low..start + primitives.len();
    (left, right)
}
