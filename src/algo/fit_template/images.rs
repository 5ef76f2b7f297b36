//! Images: the point that lies across the plane of symmetry from each point of a mesh.
//!
//! A mesh that was modelled on one side and mirrored tells on the other side which faces are missing from the first. Points
//! stay where faces are missing, so their principal axes tell the plane. Turned files hold images with rounding.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::clean::principal_axes;

/// Share of the points that have an image where the mesh has a plane of symmetry.
const SYMMETRIC: f64 = 0.8;
/// Largest distances from an image, as shares of the mesh's size, in the rounds in which the plane is moved to the middle between
/// points and their images.
const ROUNDS: [f64; 2] = [5e-3, 5e-4];
/// Points that are looked at in those rounds, about.
const SAMPLES: usize = 600;
/// Largest distance of a point from the image that it is.
const EXACT: f64 = 5e-5;
/// Most points that are looked at for the image of each point, beyond what bodies need: a point far away makes all others level.
const LOOKS: usize = 4096;
/// Shares of the principal axes, the longest first, in the direction along which points are sorted: points in a plane across an
/// axis, such as a flat side, lie at many different places of it.
const ALONG: [f64; 3] = [0.8, 0.48, 0.36];

/// The plane between points and their images, and the points along a direction.
struct Mirror<'a> {
    points: &'a [Vec3],
    middle: DVec3,
    normal: DVec3,
    along: DVec3,
    /// Points with how far they lie along the direction, in that order.
    order: &'a [(f64, u32)],
    /// Number of points that are looked at for an image.
    looks: usize,
}

impl Mirror<'_> {
    /// The point that is nearest to the image of another one, within a distance.
    fn image(&self, point: Vec3, within: f64) -> Option<u32> {
        let point = point.as_dvec3();
        let image = point - self.normal * (2.0 * (point - self.middle).dot(self.normal));
        let away = |number: u32| self.points[number as usize].as_dvec3().distance_squared(image);
        let near = self.level_with(image, within).map(|number| (away(number), number));
        let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (nearest.0 <= within * within).then_some(nearest.1)
    }

    /// Points that lie as far along the direction as a place, within a distance.
    fn level_with(&self, place: DVec3, within: f64) -> impl Iterator<Item = u32> {
        let at = place.dot(self.along);
        let first = self.order.partition_point(|(along, _)| *along < at - within);
        let near = self.order[first..].iter().take_while(move |(along, _)| *along <= at + within);
        near.take(self.looks).map(|(_, number)| *number)
    }
}

/// Direction along which points with these principal axes are sorted.
fn direction([a, b, c]: [DVec3; 3]) -> DVec3 {
    a * ALONG[0] + b * ALONG[1] + c * ALONG[2]
}

/// Points with how far they lie along a direction, in that order.
fn in_order(points: &[Vec3], along: DVec3) -> Vec<(f64, u32)> {
    let places = points.iter().map(|point| point.as_dvec3().dot(along));
    let mut order: Vec<(f64, u32)> = places.zip(0..).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    order
}

/// The number of the image of each point, `u32::MAX` for points without one; `None` if the mesh has no plane of symmetry. Work:
/// sorting the points, and looking at those that are level with each.
pub(super) fn images(points: &[Vec3]) -> Option<Vec<u32>> {
    let count = points.len() as f64;
    let middle = points.iter().map(|point| point.as_dvec3()).sum::<DVec3>() / count.max(1.0);
    let size = points.iter().map(|point| point.as_dvec3().distance(middle)).fold(0.0, f64::max);
    if size.is_nan() || size <= 0.0 {
        return None;
    }
    let mut moments = [[0.0f64; 3]; 3];
    for point in points {
        let away = ((point.as_dvec3() - middle) / size).to_array();
        for (row, a) in moments.iter_mut().zip(away) {
            row.iter_mut().zip(away).for_each(|(moment, b)| *moment += a * b);
        }
    }
    let axes = principal_axes(moments);
    let every = (points.len() / SAMPLES).max(1);
    let along = direction(axes);
    let order = in_order(points, along);
    axes.into_iter().find_map(|axis| {
        let (mut middle, mut normal) = (middle, axis);
        for within in ROUNDS {
            let mirror = Mirror { points, middle, normal, along, order: &order, looks: points.len() };
            let (mut sum, mut way, mut met, mut all) = (DVec3::ZERO, DVec3::ZERO, 0.0, 0.0);
            for point in points.iter().step_by(every) {
                all += 1.0;
                if let Some(image) = mirror.image(*point, within * size) {
                    let (point, image) = (point.as_dvec3(), points[image as usize].as_dvec3());
                    let apart = point - image;
                    way += apart * apart.dot(normal).signum();
                    sum += (point + image) * 0.5;
                    met += 1.0;
                }
            }
            if met < SYMMETRIC * all {
                return None;
            }
            (middle, normal) = (sum / met, way.try_normalize()?);
        }
        let mirror = Mirror { points, middle, normal, along, order: &order, looks: LOOKS };
        let mut images: Vec<u32> =
            points.par_iter().map(|point| mirror.image(*point, EXACT * size).unwrap_or(u32::MAX)).collect();
        let back = images.clone();
        for (image, point) in images.iter_mut().zip(0..) {
            if back.get(*image as usize) != Some(&point) {
                *image = u32::MAX;
            }
        }
        let found = images.iter().filter(|image| **image != u32::MAX).count() as f64;
        (found >= SYMMETRIC * count).then_some(images)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_points_are_level_with_one_of_a_flat_side() {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let side = |right: Vec3, up: Vec3| -> Vec<Vec3> {
            (0..10_000).map(|number| right * (number % 100) as f32 + up * (number / 100) as f32).collect()
        };
        for points in [side(Vec3::X, Vec3::Y), side(Vec3::Y, Vec3::Z), side(Vec3::Z, Vec3::X)] {
            let along = direction(axes);
            let order = in_order(&points, along);
            let (middle, normal, looks) = (DVec3::ZERO, DVec3::X, usize::MAX);
            let mirror = Mirror { points: &points, middle, normal, along, order: &order, looks };
            let level = |point: &Vec3| mirror.level_with(point.as_dvec3(), 100.0 * EXACT).count();
            let all: usize = points.iter().map(level).sum();
            assert!(all < 30 * points.len(), "{all} looks for {} points", points.len());
            let few = Mirror { looks: 3, ..mirror };
            assert!(points.iter().all(|point| few.level_with(point.as_dvec3(), 1e3).count() == 3));
        }
    }
}
