//! Sample points spread evenly over the visible skin of the facial mask.

use glam::Vec3;

use super::map::{FaceMap, Part};

/// The triangles of one side of one part, for sampling.
#[derive(Debug, Clone, Default)]
pub(crate) struct Patch {
    /// Corners of each triangle.
    pub corners: Vec<[Vec3; 3]>,
    /// Mass of each triangle.
    pub masses: Vec<f64>,
    /// Points without triangles, where there is no area.
    pub points: Vec<Vec3>,
}

impl Patch {
    /// The whole mass.
    pub fn mass(&self) -> f64 {
        self.masses.iter().sum()
    }

    /// Returns `true` without triangles and points.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty() && self.points.is_empty()
    }

    /// Sample of about `count` points, evenly by mass, the same every time.
    pub fn sample(&self, count: usize) -> Vec<Vec3> {
        let total = self.mass();
        if !(total > 0.0 && total.is_finite()) {
            return self.points.clone();
        }
        let step = total / count.max(1) as f64;
        let mut samples = Vec::with_capacity(count + 1);
        let (mut sum, mut next) = (0.0, 0.5 * step);
        // The additive sequence of the plastic number fills triangles evenly.
        let (mut u, mut v) = (0.5f32, 0.5f32);
        for (c, mass) in self.corners.iter().zip(&self.masses) {
            sum += mass;
            while next < sum {
                let (s, t) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                samples.push(c[0] + (c[1] - c[0]) * s + (c[2] - c[0]) * t);
                u = (u + 0.754_877_7) % 1.0;
                v = (v + 0.569_840_3) % 1.0;
                next += step;
            }
        }
        samples
    }
}

/// Cuts the visible mask into patches by part and side; `[part group][side]`, side 0 = left and middle.
pub(crate) fn patches(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    seen: &[bool],
    map: &FaceMap,
    group_of: impl Fn(Part) -> usize,
    count: usize,
) -> Vec<[Patch; 2]> {
    let mut patches = vec![<[Patch; 2]>::default(); count];
    let mut area = 0.0;
    for t in triangles {
        let c = t.map(|i| i as usize);
        if !c.iter().all(|&i| seen.get(i).copied().unwrap_or(false)) {
            continue;
        }
        let c = c.map(|i| points[i]);
        let middle = (c[0] + c[1] + c[2]) / 3.0;
        let mass = 0.5 * f64::from((c[1] - c[0]).cross(c[2] - c[0]).length());
        if !(mass > 0.0 && mass.is_finite()) {
            continue;
        }
        let part = map.part(middle);
        let patch = &mut patches[group_of(part)][usize::from(middle.x < map.middle)];
        patch.corners.push(c);
        patch.masses.push(mass * density(part, map.restless(middle)));
        area += mass;
    }
    if area <= 0.0 {
        for (&p, _) in points.iter().zip(seen).filter(|(_, seen)| **seen) {
            patches[group_of(map.part(p))][usize::from(p.x < map.middle)].points.push(p);
        }
    }
    patches
}

/// Density of samples relative to plain skin, for the mobility of a part of the face; `near` is 1 beside eyes, nose and
/// mouth, 0 far from them.
fn density(part: Part, near: f32) -> f64 {
    let own = match part {
        Part::Nose => 1.3,
        Part::Forehead => 0.8,
        Part::Temple => 0.5,
        // Cheeks are wide and follow the mouth, the nose and the lids at once.
        Part::Cheek => 1.5,
        Part::Jaw => 1.0,
        _ => return 1.0,
    };
    own * (0.25 + f64::from(near))
}
