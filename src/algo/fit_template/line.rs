//! Centre lines of branches, measured from the end on the surface.

use glam::Vec3;

use super::{branches::Branches, volume::VoxelGraph};

/// Rounds of smoothing.
const SMOOTHING: usize = 4;

/// A polyline from a limb's end to the centre of the body, with radii.
#[derive(Debug, Clone, Default)]
pub(super) struct CentreLine {
    pub(super) points: Vec<Vec3>,
    pub(super) radii: Vec<f32>,
    /// Largest depth under the surface around each point, in cells.
    pub(super) depths: Vec<f32>,
    /// Length from the end to each point.
    pub(super) lengths: Vec<f32>,
    /// Length from the end to where the limb joins another or the trunk.
    pub(super) free: f32,
    /// Number of points up to there.
    pub(super) free_count: usize,
    /// The arcs that the line follows, with the number of points up to the end of each.
    ends: Vec<(usize, usize)>,
}

impl CentreLine {
    /// The line of a leaf of `branches`.
    pub(super) fn new(graph: &VoxelGraph, branches: &Branches, leaf: usize) -> Self {
        let slices = branches.line(leaf);
        let mut depths = vec![0.0];
        depths.extend(slices.iter().map(|s| s.depth));
        let own = branches.arcs[leaf].slices.len();
        let mut points: Vec<Vec3> = slices.iter().map(|s| s.centre).collect();
        let radii: Vec<f32> = slices.iter().map(|s| s.radius).collect();
        for _ in 0..SMOOTHING {
            let before = points.clone();
            for i in 1..points.len().saturating_sub(1) {
                points[i] = (before[i - 1] + before[i] * 2.0 + before[i + 1]) * 0.25;
            }
        }
        // The end of the volume's nodes lies about half a cell under the surface.
        let tip = graph.centres[branches.arcs[leaf].tip as usize];
        let towards = points.get(2).or(points.last()).map_or(Vec3::ZERO, |p| (tip - *p).normalize_or_zero());
        points.insert(0, tip + towards * 0.75 * graph.cell);
        let mut all = vec![0.0];
        all.extend(radii);
        let mut lengths = vec![0.0f32];
        for pair in points.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]));
        }
        let free_count = (own + 1).min(points.len());
        let mut count = 1;
        let ends = branches
            .path(leaf)
            .into_iter()
            .map(|arc| {
                count += branches.arcs[arc].slices.len();
                (arc, count)
            })
            .collect();
        Self { free: lengths[free_count - 1], points, radii: all, depths, lengths, free_count, ends }
    }

    /// The line with its free part up to where it meets another of the taken leaves: over the ears of a head, or over
    /// fingers that are branches of their own.
    pub(super) fn among(&self, branches: &Branches, taken: &[Option<usize>]) -> Self {
        let leaf = self.ends.first().map_or(0, |end| end.0);
        let others: Vec<Vec<usize>> =
            taken.iter().flatten().filter(|&&other| other != leaf).map(|&other| branches.path(other)).collect();
        let mut line = self.clone();
        for &(arc, count) in &self.ends {
            let shared = others.iter().any(|path| path.contains(&arc));
            if shared || branches.arcs[arc].parent.is_none() {
                break;
            }
            line.free_count = count.min(self.points.len());
            line.free = self.lengths[line.free_count - 1];
        }
        line
    }

    /// The line over other points, one for each of its own.
    pub(super) fn along(mut self, points: Vec<Vec3>) -> Self {
        self.points = points;
        self.lengths = vec![0.0];
        for pair in self.points.windows(2) {
            self.lengths.push(self.lengths[self.lengths.len() - 1] + pair[0].distance(pair[1]));
        }
        self.free = self.lengths.get(self.free_count.saturating_sub(1)).copied().unwrap_or(0.0);
        self
    }

    /// The place at a length from the end; beyond the last point, the last point.
    pub(super) fn at(&self, length: f32) -> Vec3 {
        let after = self.lengths.partition_point(|&l| l < length).clamp(1, self.points.len().max(2) - 1);
        let Some(&b) = self.points.get(after) else { return self.points.first().copied().unwrap_or_default() };
        let (a, la, lb) = (self.points[after - 1], self.lengths[after - 1], self.lengths[after]);
        let share = if lb > la { ((length - la) / (lb - la)).clamp(0.0, 1.0) } else { 0.0 };
        a.lerp(b, share)
    }

    /// Mean radius of the middle of the free part.
    pub(super) fn mean_radius(&self) -> f32 {
        let (from, to) = (self.free_count / 5, (self.free_count * 4 / 5).max(self.free_count / 5 + 1));
        let part = &self.radii[from.min(self.radii.len() - 1)..to.min(self.radii.len()).max(1)];
        part.iter().sum::<f32>() / part.len().max(1) as f32
    }

    /// Largest depth under the surface of the free part, in cells: a head is thick, a tail or an ear is not.
    pub(super) fn thickness(&self) -> f32 {
        self.depths[..self.free_count].iter().fold(1.0, |most, &d| most.max(d))
    }

    /// Radius of the middle of the free part against its depth under the surface: one for what is round, more for what is flat.
    pub(super) fn flatness(&self, cell: f32) -> f32 {
        let (from, to) = (self.free_count / 5, (self.free_count * 4 / 5).max(self.free_count / 5 + 1));
        let part = &self.depths[from.min(self.depths.len() - 1)..to.min(self.depths.len()).max(1)];
        let depth = part.iter().map(|depth| depth.max(1.0)).sum::<f32>() / part.len().max(1) as f32;
        self.mean_radius() / (depth * cell).max(1e-9)
    }

    /// Distance from a position to the free part.
    pub(super) fn distance(&self, position: Vec3) -> f32 {
        self.nearest(position).1
    }

    /// Mean radius of a share of the free part, from its end.
    pub(super) fn radius_within(&self, share: f32) -> f32 {
        let count = self.lengths[..self.free_count].partition_point(|&length| length <= share * self.free).max(2);
        let part = self.radii.get(1..count.min(self.radii.len())).unwrap_or_default();
        part.iter().sum::<f32>() / part.len().max(1) as f32
    }

    /// Radius of the branch about the place of the free part that is nearest to a position.
    pub(super) fn radius_at(&self, position: Vec3) -> f32 {
        let along = self.nearest(position).0;
        let at = self.lengths.partition_point(|&length| length < along);
        self.radii.get(at).or(self.radii.last()).copied().unwrap_or(0.0)
    }

    /// Length from the end of the nearest place on the free part, and its distance.
    pub(super) fn nearest(&self, position: Vec3) -> (f32, f32) {
        let mut best = (0.0, f32::INFINITY);
        for i in 1..self.free_count {
            let (a, b) = (self.points[i - 1], self.points[i]);
            let way = b - a;
            let share = ((position - a).dot(way) / way.length_squared().max(1e-20)).clamp(0.0, 1.0);
            let distance = position.distance(a + way * share);
            if distance < best.1 {
                best = (self.lengths[i - 1] + way.length() * share, distance);
            }
        }
        best
    }
}
