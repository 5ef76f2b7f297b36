//! Alignment: the similarity that brings one set of points nearest to another (Horn 1987), and a stretch along axes.

use glam::{DMat3, DQuat, DVec3, Mat3, Quat, Vec3};

use super::eigen::eigen;

/// A rotation, a scale and an offset: `rotation * (scale * p) + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Similarity {
    pub(super) rotation: Quat,
    pub(super) scale: f32,
    pub(super) offset: Vec3,
}

impl Similarity {
    /// Alignment with another rotation about the middle of the pairs that it was made from.
    pub(super) fn turned(self, rotation: Quat, pairs: &Pairs) -> Self {
        let weight = pairs.iter().map(|pair| pair.2).sum::<f32>().max(1e-9);
        let (from, to) = pairs
            .iter()
            .fold((Vec3::ZERO, Vec3::ZERO), |(from, to), pair| (from + pair.0 * pair.2, to + pair.1 * pair.2));
        let offset = (to - rotation * (from * self.scale)) / weight;
        Self { rotation, offset, ..self }
    }
}

/// Pairs of points with weights: (from, to, weight).
pub(super) type Pairs = [(Vec3, Vec3, f32)];

/// The best similarity from the first to the second points, and the root mean square of what remains.
pub(super) fn similarity(pairs: &Pairs) -> Option<(Similarity, f32)> {
    let weight: f64 = pairs.iter().map(|p| f64::from(p.2)).sum();
    if pairs.len() < 3 || weight.is_nan() || weight <= 0.0 {
        return None;
    }
    let mean = |pick: &dyn Fn(&(Vec3, Vec3, f32)) -> Vec3| {
        pairs.iter().map(|p| pick(p).as_dvec3() * f64::from(p.2)).sum::<DVec3>() / weight
    };
    let (a0, b0) = (mean(&|p| p.0), mean(&|p| p.1));
    let mut cross = DMat3::ZERO;
    let (mut va, mut vb) = (0.0, 0.0);
    for &(a, b, w) in pairs {
        let (a, b, w) = (a.as_dvec3() - a0, b.as_dvec3() - b0, f64::from(w));
        cross += DMat3::from_cols(a * b.x * w, a * b.y * w, a * b.z * w);
        va += w * a.length_squared();
        vb += w * b.length_squared();
    }
    if va.is_nan() || va <= 0.0 || vb.is_nan() || vb <= 0.0 {
        return None;
    }
    let rotation = best_rotation(cross);
    let turn = DMat3::from_quat(rotation);
    let gain: f64 =
        pairs.iter().map(|&(a, b, w)| (turn * (a.as_dvec3() - a0)).dot(b.as_dvec3() - b0) * f64::from(w)).sum();
    let scale = (gain / va).max(1e-6);
    let offset = b0 - turn * a0 * scale;
    let rest = (vb - 2.0 * scale * gain + scale * scale * va).max(0.0) / weight;
    let found = Similarity { rotation: rotation.as_quat(), scale: scale as f32, offset: offset.as_vec3() };
    Some((found, rest.sqrt() as f32))
}

/// The rotation that maximises the trace with a matrix of products, `cross = Σ a bᵀ` (columns by `b`).
pub(super) fn best_rotation(cross: DMat3) -> DQuat {
    let m = |i: usize, j: usize| cross.col(j)[i];
    let n = [
        [m(0, 0) + m(1, 1) + m(2, 2), m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0)],
        [m(1, 2) - m(2, 1), m(0, 0) - m(1, 1) - m(2, 2), m(0, 1) + m(1, 0), m(2, 0) + m(0, 2)],
        [m(2, 0) - m(0, 2), m(0, 1) + m(1, 0), m(1, 1) - m(0, 0) - m(2, 2), m(1, 2) + m(2, 1)],
        [m(0, 1) - m(1, 0), m(2, 0) + m(0, 2), m(1, 2) + m(2, 1), m(2, 2) - m(0, 0) - m(1, 1)],
    ];
    let (values, vectors) = eigen(n);
    let best = (0..4).fold(0, |best, i| if values[i] > values[best] { i } else { best });
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| vectors[k][best]);
    DQuat::from_xyzw(x, y, z, w).normalize()
}

/// A similarity with a stretch along the three axes of the points that are mapped.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    rotation: Quat,
    scale: Vec3,
    offset: Vec3,
}

impl Stretch {
    /// Fits the stretch to pairs, drawn towards the similarity where an axis has little extent.
    pub(super) fn fit(pairs: &Pairs, similarity: &Similarity) -> Self {
        let back = Mat3::from_quat(similarity.rotation).transpose();
        let weight: f32 = pairs.iter().map(|p| p.2).sum::<f32>().max(1e-9);
        let a0 = pairs.iter().map(|p| p.0 * p.2).sum::<Vec3>() / weight;
        let b0 = pairs.iter().map(|p| (back * p.1) * p.2).sum::<Vec3>() / weight;
        let spread = pairs.iter().map(|p| (p.0 - a0).length_squared() * p.2).sum::<f32>().max(1e-12);
        let hold = 0.08 * spread;
        let mut scale = [0.0f32; 3];
        for (axis, scale) in scale.iter_mut().enumerate() {
            let (mut top, mut bottom) = (hold * similarity.scale, hold);
            for &(a, b, w) in pairs {
                let (x, y) = ((a - a0)[axis], (back * b - b0)[axis]);
                top += w * x * y;
                bottom += w * x * x;
            }
            *scale = (top / bottom).clamp(0.4 * similarity.scale, 2.5 * similarity.scale);
        }
        let scale = Vec3::from_array(scale);
        Self { rotation: similarity.rotation, scale, offset: similarity.rotation * (b0 - a0 * scale) }
    }

    pub(super) fn apply(&self, p: Vec3) -> Vec3 {
        self.rotation * (p * self.scale) + self.offset
    }

    /// Maps a difference of positions.
    pub(super) fn turn(&self, v: Vec3) -> Vec3 {
        self.rotation * (v * self.scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn similarity_finds_turn_scale_and_offset() {
        let turn = Quat::from_xyzw(0.2, -0.4, 0.1, 0.7).normalize();
        let points = [Vec3::X, Vec3::Y * 2.0, Vec3::Z * 3.0, Vec3::new(1.0, -1.0, 0.5), Vec3::NEG_X];
        let pairs: Vec<_> = points.iter().map(|&p| (p, turn * (p * 1.7) + Vec3::new(3.0, 2.0, 1.0), 1.0)).collect();
        let (found, rest) = similarity(&pairs).unwrap();
        assert!(found.rotation.angle_between(turn) < 1e-3, "{found:?}");
        assert!((found.scale - 1.7).abs() < 1e-4 && rest < 1e-3, "{found:?} {rest}");
        assert!(similarity(&pairs[..2]).is_none());
    }
}
