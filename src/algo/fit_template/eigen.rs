//! Eigenvectors of small symmetric matrices.

/// Rounds of rotations; a matrix of four rows needs a handful.
const ROUNDS: usize = 30;

/// Eigenvalues and eigenvectors (in columns) of a symmetric matrix, by cyclic Jacobi rotations.
pub(super) fn eigen<const N: usize>(mut matrix: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut vectors = [[0.0; N]; N];
    (0..N).for_each(|i| vectors[i][i] = 1.0);
    for _ in 0..ROUNDS {
        for p in 0..N - 1 {
            for q in p + 1..N {
                if matrix[p][q].abs() < 1e-300 {
                    continue;
                }
                let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * matrix[p][q]);
                let sign = if theta == 0.0 { 1.0 } else { theta.signum() };
                let tangent = sign / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
                let sine = tangent * cosine;
                let turned = |a: f64, b: f64| (cosine * a - sine * b, sine * a + cosine * b);
                for row in &mut matrix {
                    (row[p], row[q]) = turned(row[p], row[q]);
                }
                let (a, b) = (matrix[p], matrix[q]);
                for k in 0..N {
                    (matrix[p][k], matrix[q][k]) = turned(a[k], b[k]);
                }
                for row in &mut vectors {
                    (row[p], row[q]) = turned(row[p], row[q]);
                }
            }
        }
    }
    (std::array::from_fn(|i| matrix[i][i]), vectors)
}
