//! Points in the space of k-means: ordered so that neighbours are near, centred, and scaled to one unit.

use glam::{DVec3, Vec3};

use super::{KMeans, lloyd::State};
use crate::algo::linkage::kd::{self, Site};

/// Largest number of points whose integer sums cannot overflow.
pub(super) const MAX_POINTS: usize = 1 << 28;
/// Number of points in a block.
pub(super) const BLOCK: usize = 32;
/// Number of neighbours merged into one coarse point; in the order of points they form a box.
const COARSE: usize = 8;
/// Least number of points for a coarse grouping.
const MANY: usize = 1 << 15;
/// Least number of coarse points per group.
const EACH: usize = 16;
/// Number of integer parts of a unit.
const PARTS: f64 = (1_u64 << 34) as f64;

/// A place, in units.
pub(super) type Place = [f32; 3];

pub(super) struct Space {
    pub(super) points: Vec<Place>,
    /// Index of each point in the input.
    pub(super) index: Vec<u32>,
    pub(super) fixed: Vec<Place>,
    /// The box of each block of points.
    pub(super) boxes: Vec<(Place, Place)>,
    middle: DVec3,
    unit: f64,
}

impl Space {
    pub(super) fn new(points: &[Vec3], fixed: &[Vec3]) -> Self {
        let first = points.first().copied().unwrap_or_default();
        let (low, high) =
            points.iter().chain(fixed).fold((first, first), |(low, high), point| (low.min(*point), high.max(*point)));
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let middle = (low + high) * 0.5;
        let half = ((high - low) * 0.5).max_element();
        let mut unit = 1.0_f64;
        while unit < half {
            unit *= 2.0;
        }
        while half > 0.0 && unit * 0.5 >= half {
            unit *= 0.5;
        }
        let local = |point: &Vec3| ((point.as_dvec3() - middle) / unit).as_vec3().to_array();
        let mut sites: Vec<Site> =
            points.iter().enumerate().map(|(at, point)| Site { at: local(point), index: at as u32 }).collect();
        kd::order(&mut sites);
        let points: Vec<Place> = sites.iter().map(|site| site.at).collect();
        let boxes = boxes(&points);
        let index = sites.iter().map(|site| site.index).collect();
        Self { points, index, fixed: fixed.iter().map(local).collect(), boxes, middle, unit }
    }

    /// Means of neighbours that stand for the points; `None` for few points.
    pub(super) fn coarse(&self, groups: usize) -> Option<Self> {
        let count = self.points.len();
        if count < MANY || count / COARSE < groups * EACH {
            return None;
        }
        let mean = |places: &[Place]| {
            let sum =
                places.iter().fold([0.0; 3], |sum, place| [0, 1, 2].map(|axis| sum[axis] + f64::from(place[axis])));
            sum.map(|sum: f64| (sum / places.len() as f64) as f32)
        };
        let points: Vec<Place> = self.points.chunks(COARSE).map(mean).collect();
        let index = (0..points.len() as u32).collect();
        let boxes = boxes(&points);
        Some(Self { points, index, fixed: self.fixed.clone(), boxes, middle: self.middle, unit: self.unit })
    }

    pub(super) fn answer(&self, state: State, fixed: &[Vec3]) -> KMeans {
        let mut labels = vec![0; self.points.len()];
        for (&index, &label) in self.index.iter().zip(&state.labels) {
            labels[index as usize] = label;
        }
        let world = |place: &Place| (Vec3::from_array(*place).as_dvec3() * self.unit + self.middle).as_vec3();
        let free = state.centroids.iter().skip(fixed.len()).map(world);
        KMeans {
            centroids: fixed.iter().copied().chain(free).collect(),
            labels,
            square_error: state.square_error * self.unit * self.unit,
            rounds: state.rounds,
        }
    }
}

/// The box of each block.
fn boxes(points: &[Place]) -> Vec<(Place, Place)> {
    let around = |block: &[Place]| {
        let first = block.first().copied().unwrap_or_default();
        block.iter().fold((first, first), |(low, high), place| {
            let pick = |f: fn(f32, f32) -> f32, a: Place| [0, 1, 2].map(|axis| f(a[axis], place[axis]));
            (pick(f32::min, low), pick(f32::max, high))
        })
    };
    points.chunks(BLOCK).map(around).collect()
}

/// A sum of places in integers, exact in any order.
#[derive(Clone, Copy, Default)]
pub(super) struct Sum {
    parts: [i64; 3],
    pub(super) count: i64,
}

impl Sum {
    pub(super) fn add(&mut self, place: Place, times: i64) {
        for (sum, value) in self.parts.iter_mut().zip(place) {
            *sum += (f64::from(value) * PARTS) as i64 * times;
        }
        self.count += times;
    }

    pub(super) fn mean(&self) -> Place {
        self.parts.map(|sum| (sum as f64 / (PARTS * self.count as f64)) as f32)
    }
}
