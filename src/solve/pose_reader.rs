//! Readers of poses: numbers that say how near a direction or a rotation is to given ones, for corrective shapes.
//!
//! Several poses are interpolated by radial basis functions (Sloan, Rose and Cohen 2001): each pose has a bell over the
//! angle to it, and the weights of the bells are solved once so that every pose has its own number at 1 and the others
//! at 0.

use bevy::math::{Quat, Vec3, ops};

use crate::solve::rotate::{direction, unit};

/// Largest number of poses of one reader.
pub const MOST_POSES: usize = 32;

/// A cone about a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Half the opening within which the value is 1, in radians.
    pub inner: f32,
    /// Half the opening outside of which the value is 0, in radians.
    pub outer: f32,
}

impl Cone {
    /// Value of a direction: 1 within the inner cone about `towards`, 0 outside of the outer one, smooth between. 0 for
    /// a direction without length.
    pub fn read(&self, towards: Vec3, looks: Vec3) -> f32 {
        let (Some(towards), Some(looks)) = (direction(towards), direction(looks)) else { return 0.0 };
        let angle = ops::atan2(towards.cross(looks).length(), towards.dot(looks));
        let span = self.outer - self.inner;
        let share = if span > 0.0 { (self.outer - angle) / span } else { f32::from(angle <= self.inner) };
        let share = share.clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }
}

/// Poses that a rotation is compared with, ready to be read.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseReader {
    poses: Vec<Quat>,
    /// Angle over which the bell of a pose fades, in radians.
    radius: f32,
    /// Weight of each bell (columns) in the number of each pose (rows).
    weights: Vec<f32>,
}

/// Poses that cannot be told apart.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PoseReaderError {
    /// A number of poses out of range.
    #[error("there are {0} poses; give 1 to {MOST_POSES}")]
    Count(usize),
    /// A radius that is not above zero.
    #[error("the radius is {0} radians; it must be above zero")]
    Radius(f32),
    /// Two poses with nearly the same rotation.
    #[error("poses {0} and {1} have nearly the same rotation; move one of them, or leave it out")]
    Alike(usize, usize),
}

impl PoseReader {
    /// Prepares rotations to be compared with; `O(poses³)`.
    ///
    /// # Errors
    /// No poses or too many, a radius that is not above zero, two poses with nearly the same rotation.
    pub fn new(poses: &[Quat], radius: f32) -> Result<Self, PoseReaderError> {
        let count = poses.len();
        if count == 0 || count > MOST_POSES {
            return Err(PoseReaderError::Count(count));
        }
        let poses: Vec<Quat> = poses.iter().map(|pose| unit(*pose)).collect();
        let is_radius = radius > 0.0 && radius.is_finite();
        // Poses that are alike come first: a radius that follows from them is no better.
        let least = 0.02 * if is_radius { radius.min(1.0) } else { 1.0 };
        for (number, first) in poses.iter().enumerate() {
            let alike = poses[..number].iter().position(|second| angle(*first, *second) < least);
            if let Some(other) = alike {
                return Err(PoseReaderError::Alike(other + 1, number + 1));
            }
        }
        if !is_radius {
            return Err(PoseReaderError::Radius(radius));
        }
        let mut matrix = vec![0.0_f64; count * 2 * count];
        let width = 2 * count;
        for (row, first) in poses.iter().enumerate() {
            for (column, second) in poses.iter().enumerate() {
                matrix[row * width + column] = f64::from(bell(angle(*first, *second), radius));
            }
            matrix[row * width + count + row] = 1.0;
        }
        let Some(weights) = inverted(matrix, count) else { return Err(PoseReaderError::Alike(1, count)) };
        Ok(Self { poses, radius, weights })
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Returns `true` without poses.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Number of one pose at a rotation, 0 to 1.
    pub fn read(&self, pose: usize, rotation: Quat) -> f32 {
        let (rotation, count) = (unit(rotation), self.poses.len());
        let row = &self.weights[pose * count..(pose + 1) * count];
        let bells = self.poses.iter().zip(row).map(|(at, weight)| bell(angle(*at, rotation), self.radius) * weight);
        bells.sum::<f32>().clamp(0.0, 1.0)
    }
}

/// Angle between two rotations, 0 to half a turn.
fn angle(a: Quat, b: Quat) -> f32 {
    let between = a.conjugate() * b;
    2.0 * ops::atan2(between.xyz().length(), between.w.abs())
}

fn bell(angle: f32, radius: f32) -> f32 {
    let share = angle / radius;
    ops::exp(-share * share)
}

/// The right half of a matrix beside the identity, once the left half is the identity; `None` for one that is singular.
fn inverted(mut matrix: Vec<f64>, count: usize) -> Option<Vec<f32>> {
    let width = 2 * count;
    for pivot in 0..count {
        let size = |row: &usize| matrix[row * width + pivot].abs();
        let best = (pivot..count).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        if matrix[best * width + pivot].abs() < 1e-9 {
            return None;
        }
        for column in 0..width {
            matrix.swap(pivot * width + column, best * width + column);
        }
        let scale = matrix[pivot * width + pivot];
        matrix[pivot * width..(pivot + 1) * width].iter_mut().for_each(|value| *value /= scale);
        for row in (0..count).filter(|row| *row != pivot) {
            let factor = matrix[row * width + pivot];
            for column in 0..width {
                matrix[row * width + column] -= factor * matrix[pivot * width + column];
            }
        }
    }
    Some(matrix.chunks(width).flat_map(|row| row[count..].iter().map(|value| *value as f32)).collect())
}
