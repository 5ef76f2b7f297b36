//! The rotation nearest to a matrix.

use glam::{DMat3, DMat4, DQuat, DVec3};

/// The rotation `R` that maximises `Σ R[k][a] m[a][k]`, that is, turns points onto targets best, where `m` is the sum
/// of point times transposed target. `near` is the start of the search.
///
/// Newton's method on rotations; if it does not converge to a maximum, the quaternion of the largest eigenvalue (Horn
/// 1987, "Closed-form solution of absolute orientation using unit quaternions"). For a zero matrix: `near`.
pub(super) fn best_rotation(m: [DVec3; 3], near: DMat3) -> DMat3 {
    let scale = m.iter().map(|row| row.length()).sum::<f64>();
    if !(scale > 0.0 && scale.is_finite()) {
        return near;
    }
    let mut rotation = near;
    for _ in 0..4 {
        // t[a] is the turned axis a, m[a] its target.
        let turned = [rotation.x_axis, rotation.y_axis, rotation.z_axis];
        let mut gradient = DVec3::ZERO;
        let mut sum = DMat3::ZERO;
        for (turned, wanted) in turned.into_iter().zip(m) {
            gradient += turned.cross(wanted);
            sum += outer(turned, wanted);
        }
        let sym = (sum + sum.transpose()) * 0.5;
        let trace = sym.x_axis.x + sym.y_axis.y + sym.z_axis.z;
        let hessian = DMat3::from_diagonal(DVec3::splat(trace)) - sym;
        if !is_positive(hessian, scale) {
            break;
        }
        let step = hessian.inverse() * gradient;
        if step.length() > 0.8 {
            break;
        }
        rotation = turn(step) * rotation;
        if step.length() < 1e-7 {
            return orthonormal(rotation);
        }
    }
    horn(m, near)
}

/// A small turn about `axis`, whose length is approximately the angle: exactly a rotation, without trigonometry.
pub(super) fn turn(axis: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_xyzw(axis.x * 0.5, axis.y * 0.5, axis.z * 0.5, 1.0).normalize())
}

/// The matrix with rounding errors removed.
pub(super) fn orthonormal(matrix: DMat3) -> DMat3 {
    let x = matrix.x_axis.normalize_or(DVec3::X);
    let y = (matrix.y_axis - x * x.dot(matrix.y_axis)).normalize_or(x.any_orthonormal_vector());
    DMat3::from_cols(x, y, x.cross(y))
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

fn is_positive(m: DMat3, scale: f64) -> bool {
    let tiny = 1e-9 * scale;
    let minor = m.x_axis.x * m.y_axis.y - m.y_axis.x * m.x_axis.y;
    m.x_axis.x > tiny && minor > tiny * tiny && m.determinant() > tiny * tiny * tiny
}

/// The eigenvector of the largest eigenvalue of Horn's matrix, by Jacobi's method.
#[expect(clippy::needless_range_loop, reason = "indices are those of the matrix")]
fn horn(m: [DVec3; 3], near: DMat3) -> DMat3 {
    let s = |a: usize, k: usize| m[a][k];
    let mut n = [
        [s(0, 0) + s(1, 1) + s(2, 2), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0)],
        [0.0, s(0, 0) - s(1, 1) - s(2, 2), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2)],
        [0.0, 0.0, s(1, 1) - s(0, 0) - s(2, 2), s(1, 2) + s(2, 1)],
        [0.0, 0.0, 0.0, s(2, 2) - s(0, 0) - s(1, 1)],
    ];
    for i in 0..4 {
        for j in 0..i {
            n[i][j] = n[j][i];
        }
    }
    let mut vectors = DMat4::IDENTITY.to_cols_array_2d();
    for _ in 0..24 {
        for p in 0..3 {
            for q in p + 1..4 {
                if n[p][q] == 0.0 {
                    continue;
                }
                let theta = (n[q][q] - n[p][p]) / (2.0 * n[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in &mut n {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                for k in 0..4 {
                    (n[p][k], n[q][k]) = (c * n[p][k] - s * n[q][k], s * n[p][k] + c * n[q][k]);
                }
                for row in &mut vectors {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
    }
    let best = (1..4).fold(0, |best, k| if n[k][k] > n[best][best] { k } else { best });
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| vectors[k][best]);
    let quat = DQuat::from_xyzw(x, y, z, w);
    if quat.is_finite() && quat.length_squared() > 0.5 { DMat3::from_quat(quat.normalize()) } else { near }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_rotation_from_near_and_far() {
        let points = [DVec3::new(1.0, 0.2, 0.0), DVec3::new(-0.3, 1.0, 0.5), DVec3::new(0.1, -0.4, 0.9)];
        for (axis, angle) in [(DVec3::X, 0.1), (DVec3::new(0.6, 0.0, 0.8), 3.0), (DVec3::Y, 1.4), (DVec3::Z, 0.0)] {
            let truth = DMat3::from_axis_angle(axis, angle);
            let m = [0, 1, 2].map(|a| points.iter().map(|p| (truth * *p) * p[a]).sum());
            let found = best_rotation(m, DMat3::IDENTITY);
            assert!((0..3).all(|k| (found.col(k) - truth.col(k)).length() < 1e-6), "{axis} {angle}: {found}");
        }
        // A mirror image still gives a rotation.
        let m = [DVec3::X, DVec3::Y, -DVec3::Z * 0.5];
        assert!((best_rotation(m, DMat3::IDENTITY).determinant() - 1.0).abs() < 1e-9);
        assert_eq!(best_rotation([DVec3::ZERO; 3], DMat3::IDENTITY), DMat3::IDENTITY);
    }
}
