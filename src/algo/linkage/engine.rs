//! Rounds of merges: find the nearest cluster of each, merge all pairs that are each other's nearest, again.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    Dendrogram, LinkageError, Progress,
    boxes::Boxes,
    dense,
    history::History,
    kd::{self, Site},
    pair::{Points, Span},
    search::{Room, Scene},
};

/// A cluster. Its slot in the list may change, its node does not.
#[derive(Clone, Copy)]
pub(super) struct Cluster {
    pub(super) mean: [f64; 3],
    /// Mean squared distance of its points from their mean.
    pub(super) variance: f64,
    pub(super) span: Span,
    /// Number of the cluster in the history.
    pub(super) node: u32,
    /// Slot of the nearest cluster, or [`NONE`].
    nearest: u32,
    distance: f64,
}

const NONE: u32 = u32::MAX;
/// Marks a cluster that was merged into another.
const DEAD: u32 = u32::MAX;
/// Largest number of searches on one thread.
const ALONE: usize = 64;
/// Number of searches in a task.
const RUN: usize = 128;

impl Cluster {
    /// The mean squared distance of two clusters.
    pub(super) fn square_distance(&self, other: &Self) -> f64 {
        let apart = |axis: usize| self.mean[axis] - other.mean[axis];
        let square = apart(0) * apart(0) + apart(1) * apart(1) + apart(2) * apart(2);
        square + (self.variance + other.variance)
    }

    fn is_alive(&self) -> bool {
        self.node != DEAD
    }
}

struct Engine {
    clusters: Vec<Cluster>,
    points: Points,
    boxes: Boxes,
    history: History,
    /// Linked lists by slot: the first slot that has it as nearest, and the next slot with the same nearest.
    asked_by: Vec<u32>,
    next_asker: Vec<u32>,
    /// Number of clusters left.
    alive: usize,
    /// Number of clusters when the boxes were built.
    built_with: usize,
    middle: [f64; 3],
    slack: f32,
}

/// Clusters finite points, at least one.
pub(super) fn run<const SQUARE: bool>(points: &[Vec3], progress: Progress) -> Result<Dendrogram, LinkageError> {
    let count = points.len();
    let report = |alive: usize| {
        if progress(1.0 - alive as f32 / count as f32) { Ok(()) } else { Err(LinkageError::Cancelled) }
    };
    report(count)?;
    let frame = Frame::of(points);
    let mut engine = Engine::new(points, &frame);
    let mut work: Vec<u32> = (0..engine.alive as u32).collect();
    let last = if SQUARE { 1 } else { dense::clusters(count) };
    while engine.alive > last {
        engine.round::<SQUARE>(&mut work);
        let worn = engine.alive < engine.built_with - engine.built_with / 5;
        if worn || engine.points.len() > 2 * count + 64 {
            engine.rebuild(&mut work);
            report(engine.alive)?;
        }
    }
    if engine.alive > 1 {
        engine.rebuild(&mut work);
        dense::finish(&engine.clusters, &engine.points, &mut engine.history, &report)?;
    }
    report(0)?;
    let unit = if SQUARE { frame.unit * frame.unit } else { frame.unit };
    Ok(engine.history.finish(unit))
}

/// A place with all points that lie there.
struct Place {
    /// Index of one of the points.
    first: u32,
    node: u32,
    size: u32,
}

/// Merges points that coincide; they are each other's nearest in any case, and searches would meet all of them as ties.
fn merge_equal(points: &[Vec3], history: &mut History) -> Vec<Place> {
    let bits = |at: u32| (points[at as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<(u64, u32)> = (0..points.len() as u32).map(|at| (mix(bits(at)), at)).collect();
    order.par_sort_unstable();
    let mut places: Vec<Place> = Vec::with_capacity(points.len());
    for run in order.chunk_by(|a, b| a.0 == b.0) {
        // Places that only share their key are separated.
        let start = places.len();
        for &(_, at) in run {
            match places[start..].iter_mut().find(|place| bits(place.first) == bits(at)) {
                Some(place) => {
                    place.size += 1;
                    place.node = history.join(place.node, at, 0.0, place.size);
                }
                None => places.push(Place { first: at, node: at, size: 1 }),
            }
        }
    }
    places.sort_unstable_by_key(|place| place.first);
    places
}

fn mix([x, y, z]: [u32; 3]) -> u64 {
    let mut key = (u64::from(x) << 32 | u64::from(y)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    key = (key ^ key >> 29 ^ u64::from(z)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    key ^ key >> 32
}

/// Position and scale of the points: inside, they span one unit, so that no square overflows or underflows.
struct Frame {
    middle: [f64; 3],
    /// Scale, a power of two, so that nothing is rounded.
    unit: f64,
}

impl Frame {
    fn of(points: &[Vec3]) -> Self {
        let first = points.first().copied().unwrap_or_default();
        let (low, high) = points.iter().fold((first, first), |(low, high), point| (low.min(*point), high.max(*point)));
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let largest = low.abs().max_element().max(high.abs().max_element());
        let mut unit = 1.0_f64;
        while unit < largest {
            unit *= 2.0;
        }
        while unit * 0.5 >= largest && unit > f64::from(f32::MIN_POSITIVE) {
            unit *= 0.5;
        }
        Self { middle: ((low + high) * (0.5 / unit)).to_array(), unit }
    }
}

impl Engine {
    fn new(points: &[Vec3], frame: &Frame) -> Self {
        let count = points.len();
        let mut history = History::new(count);
        let places = merge_equal(points, &mut history);
        let mut sites: Vec<Site> = places
            .iter()
            .enumerate()
            .map(|(at, place)| Site { at: points[place.first as usize].to_array(), index: at as u32 })
            .collect();
        kd::order(&mut sites);
        let scale = 1.0 / frame.unit;
        let mut own = Points::with_capacity(2 * count + 128);
        let clusters: Vec<Cluster> = sites
            .iter()
            .map(|site| {
                let Place { node, size, .. } = places[site.index as usize];
                // Scaling by a power of two is exact.
                let place = site.at.map(|value| (f64::from(value) * scale) as f32);
                let start = own.len() as u32;
                for _ in 0..size {
                    own.push(place);
                }
                Cluster {
                    mean: place.map(f64::from),
                    variance: 0.0,
                    span: Span { start, size },
                    node,
                    nearest: NONE,
                    distance: f64::INFINITY,
                }
            })
            .collect();
        let count = clusters.len();
        let mut engine = Self {
            clusters,
            points: own,
            boxes: Boxes::default(),
            history,
            asked_by: vec![NONE; count],
            next_asker: vec![NONE; count],
            alive: count,
            built_with: count,
            middle: frame.middle,
            slack: 4e-7,
        };
        engine.build_boxes();
        engine
    }

    fn build_boxes(&mut self) {
        let middle = self.middle;
        self.boxes.build(self.clusters.iter().map(|cluster| (local(cluster, middle), cluster.variance as f32)));
    }

    /// Runs one round. `work` holds the slots whose nearest cluster is not known, in order, before and after.
    fn round<const SQUARE: bool>(&mut self, work: &mut Vec<u32>) {
        let scene = Scene { clusters: &self.clusters, boxes: &self.boxes, points: &self.points, slack: self.slack };
        let found: Vec<Option<(u32, f64)>> = if work.len() <= ALONE {
            let mut room = Room::default();
            work.iter().map(|&slot| scene.nearest::<SQUARE>(slot, &mut room)).collect()
        } else {
            let search = |room: &mut Room, &slot: &u32| scene.nearest::<SQUARE>(slot, room);
            work.par_iter().with_min_len(RUN).map_init(Room::default, search).collect()
        };
        for (&slot, found) in work.iter().zip(found) {
            let (nearest, distance) = found.unwrap_or((NONE, f64::INFINITY));
            let cluster = &mut self.clusters[slot as usize];
            (cluster.nearest, cluster.distance) = (nearest, distance);
            if nearest != NONE {
                self.next_asker[slot as usize] = self.asked_by[nearest as usize];
                self.asked_by[nearest as usize] = slot;
            }
        }
        // A pair whose clusters were both searched appears twice: the second time it has merged already.
        let searched = std::mem::take(work);
        for &slot in &searched {
            let cluster = &self.clusters[slot as usize];
            let nearest = cluster.nearest;
            if cluster.is_alive() && nearest != NONE && self.clusters[nearest as usize].nearest == slot {
                self.merge(slot.min(nearest), slot.max(nearest), work);
            }
        }
        if work.is_empty() {
            self.merge_least(work);
        }
        work.retain(|&slot| self.clusters[slot as usize].is_alive());
        work.sort_unstable();
        work.dedup();
    }

    /// Merges the nearest pair of all. Rounding may leave a ring of ties in which no two clusters are each other's
    /// nearest.
    fn merge_least(&mut self, work: &mut Vec<u32>) {
        let known =
            self.clusters.iter().enumerate().filter(|(_, cluster)| cluster.is_alive() && cluster.nearest != NONE);
        let least = known.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance).then(a.0.cmp(&b.0)));
        if let Some((slot, cluster)) = least {
            let (a, b) = (slot as u32, cluster.nearest);
            self.merge(a.min(b), a.max(b), work);
        }
    }

    /// Merges `second` into `first`, and adds the merged cluster and all clusters that had one of them as nearest to
    /// `work`.
    fn merge(&mut self, first: u32, second: u32, work: &mut Vec<u32>) {
        let (i, j) = (first as usize, second as usize);
        let (a, b) = (self.clusters[i], self.clusters[j]);
        let distance = if a.nearest == second { a.distance } else { b.distance };
        let size = a.span.size + b.span.size;
        let (part_a, part_b) = (f64::from(a.span.size) / f64::from(size), f64::from(b.span.size) / f64::from(size));
        let mut mean = [0.0; 3];
        let mut apart = 0.0;
        for ((mean, a), b) in mean.iter_mut().zip(a.mean).zip(b.mean) {
            *mean = part_a * a + part_b * b;
            apart += (a - b) * (a - b);
        }
        let start = self.points.len() as u32;
        self.points.repeat(a.span);
        self.points.repeat(b.span);
        self.clusters[i] = Cluster {
            mean,
            variance: part_a * a.variance + part_b * b.variance + part_a * part_b * apart,
            span: Span { start, size },
            node: self.history.join(a.node, b.node, distance, size),
            nearest: NONE,
            distance: f64::INFINITY,
        };
        self.clusters[j].node = DEAD;
        self.clusters[j].nearest = NONE;
        self.boxes.remove(j);
        self.boxes.put(i, local(&self.clusters[i], self.middle), self.clusters[i].variance as f32);
        self.alive -= 1;
        work.push(first);
        for gone in [i, j] {
            let mut asker = std::mem::replace(&mut self.asked_by[gone], NONE);
            while asker != NONE {
                let next = std::mem::replace(&mut self.next_asker[asker as usize], NONE);
                let cluster = &mut self.clusters[asker as usize];
                if cluster.nearest as usize == gone {
                    cluster.nearest = NONE;
                    work.push(asker);
                }
                asker = next;
            }
        }
    }

    /// Closes the gaps that merges left, stores each cluster's points contiguously and rebuilds the boxes.
    fn rebuild(&mut self, work: &mut [u32]) {
        let mut moved = vec![NONE; self.clusters.len()];
        let mut points = Points::with_capacity(self.points.x.capacity());
        let mut kept: Vec<Cluster> = Vec::with_capacity(self.alive);
        for (slot, cluster) in self.clusters.iter().enumerate().filter(|(_, cluster)| cluster.is_alive()) {
            moved[slot] = kept.len() as u32;
            let start = points.len() as u32;
            points.append(&self.points, cluster.span);
            kept.push(Cluster { span: Span { start, ..cluster.span }, ..*cluster });
        }
        self.asked_by.clear();
        self.asked_by.resize(kept.len(), NONE);
        self.next_asker.clear();
        self.next_asker.resize(kept.len(), NONE);
        for (slot, cluster) in kept.iter_mut().enumerate().filter(|(_, cluster)| cluster.nearest != NONE) {
            cluster.nearest = moved[cluster.nearest as usize];
            self.next_asker[slot] = self.asked_by[cluster.nearest as usize];
            self.asked_by[cluster.nearest as usize] = slot as u32;
        }
        for slot in work {
            *slot = moved[*slot as usize];
        }
        self.points = points;
        self.clusters = kept;
        self.built_with = self.alive;
        self.build_boxes();
    }
}

/// A cluster's mean relative to `middle`, in single precision.
fn local(cluster: &Cluster, middle: [f64; 3]) -> [f32; 3] {
    let mean = cluster.mean;
    [(mean[0] - middle[0]) as f32, (mean[1] - middle[1]) as f32, (mean[2] - middle[2]) as f32]
}
