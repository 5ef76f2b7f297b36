//! Prior of the landmark search: mean landmarks and the mean relief of adult heads.
//!
//! Normalised face coordinates: the origin half way between the outer eye corners at the height and depth of the four
//! eye corners, the unit is the distance of the outer eye corners, axes as in head space. Means over measured heads,
//! rounded; single heads differ from them by 1 to 5 % of the unit.

use glam::Vec3;

use super::mirrored;

/// The mean landmarks; the left half is the right half mirrored.
pub(super) fn mean_landmarks() -> [Vec3; 68] {
    let mut all = [Vec3::ZERO; 68];
    for &(index, place) in &HALF {
        let place = Vec3::from_array(place);
        if let Some(slot) = all.get_mut(index) {
            *slot = place;
        }
        if let Some(slot) = all.get_mut(mirrored(index)) {
            *slot = Vec3::new(-place.x, place.y, place.z);
        }
    }
    all
}

/// Landmarks of the right half and the middle (x of the character's right is negative).
const HALF: [(usize, [f32; 3]); 39] = [
    (0, [-0.820, 0.048, -0.587]),
    (1, [-0.811, -0.200, -0.557]),
    (2, [-0.782, -0.425, -0.490]),
    (3, [-0.750, -0.645, -0.420]),
    (4, [-0.660, -0.894, -0.316]),
    (5, [-0.499, -1.098, -0.178]),
    (6, [-0.356, -1.181, -0.012]),
    (7, [-0.181, -1.224, 0.169]),
    (8, [0.0, -1.263, 0.186]),
    (17, [-0.662, 0.212, -0.097]),
    (18, [-0.556, 0.300, 0.026]),
    (19, [-0.424, 0.328, 0.114]),
    (20, [-0.270, 0.321, 0.186]),
    (21, [-0.132, 0.293, 0.216]),
    (27, [0.0, 0.054, 0.240]),
    (28, [0.0, -0.070, 0.328]),
    (29, [0.0, -0.188, 0.419]),
    (30, [0.0, -0.331, 0.514]),
    (31, [-0.139, -0.510, 0.237]),
    (32, [-0.067, -0.509, 0.307]),
    (33, [0.0, -0.518, 0.325]),
    (36, [-0.500, 0.010, -0.032]),
    (37, [-0.433, 0.058, 0.060]),
    (38, [-0.310, 0.064, 0.077]),
    (39, [-0.204, -0.010, 0.032]),
    (40, [-0.299, -0.033, 0.059]),
    (41, [-0.428, -0.036, 0.041]),
    (48, [-0.292, -0.786, 0.151]),
    (49, [-0.196, -0.701, 0.284]),
    (50, [-0.084, -0.660, 0.344]),
    (51, [0.0, -0.671, 0.355]),
    (57, [0.0, -0.884, 0.312]),
    (58, [-0.119, -0.877, 0.299]),
    (59, [-0.209, -0.846, 0.244]),
    (60, [-0.259, -0.784, 0.149]),
    (61, [-0.112, -0.762, 0.265]),
    (62, [0.0, -0.766, 0.284]),
    (66, [0.0, -0.770, 0.281]),
    (67, [-0.122, -0.767, 0.257]),
];

/// The step of [`RELIEF`] in both directions.
pub(super) const RELIEF_STEP: f32 = 0.1;
/// The height of [`RELIEF`]'s first row.
pub(super) const RELIEF_TOP: f32 = 0.5;

/// Mean depth of one half of a face, rows from the forehead down, columns from the middle out.
pub(super) const RELIEF: [[f32; 6]; 17] = [
    [0.16, 0.15, 0.13, 0.10, 0.05, -0.02],
    [0.19, 0.19, 0.18, 0.15, 0.09, 0.02],
    [0.22, 0.22, 0.21, 0.18, 0.14, 0.08],
    [0.23, 0.21, 0.20, 0.16, 0.13, 0.09],
    [0.23, 0.18, 0.09, 0.09, 0.09, 0.03],
    [0.27, 0.16, 0.04, 0.06, 0.06, -0.02],
    [0.35, 0.26, 0.08, 0.06, 0.05, -0.01],
    [0.43, 0.35, 0.16, 0.09, 0.06, 0.02],
    [0.50, 0.44, 0.19, 0.13, 0.09, 0.05],
    [0.51, 0.45, 0.30, 0.15, 0.12, 0.06],
    [0.37, 0.28, 0.21, 0.15, 0.12, 0.06],
    [0.32, 0.32, 0.24, 0.17, 0.11, 0.03],
    [0.35, 0.33, 0.27, 0.19, 0.11, 0.01],
    [0.31, 0.30, 0.24, 0.15, 0.09, -0.01],
    [0.29, 0.28, 0.23, 0.14, 0.06, -0.04],
    [0.24, 0.23, 0.19, 0.12, 0.03, -0.10],
    [0.26, 0.24, 0.19, 0.11, -0.02, -0.15],
];
