//! Bodies with their true bones, and the lines of section centroids along their limbs.

use std::{collections::BTreeMap, path::Path};

use glam::{Vec2, Vec3};
use rigsmith::{
    algo::view::{View, ViewPlane},
    mesh::surface::Surface,
};
use serde_json::Value;

/// A mesh with its true bones.
pub struct Body {
    pub name: &'static str,
    pub points: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    bones: Value,
    pub surface: Surface,
    bounds: [Vec3; 2],
}

impl Body {
    pub fn load(folder: &Path, name: &'static str) -> Option<Self> {
        let text = std::fs::read_to_string(folder.join("body.obj")).ok()?;
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => {
                    let c: Vec<f32> = words.filter_map(|w| w.parse().ok()).collect();
                    points.push(Vec3::new(c[0], c[1], c[2]));
                }
                Some("f") => {
                    let c: Vec<u32> = words.filter_map(|w| w.split('/').next()?.parse::<u32>().ok()).collect();
                    triangles.extend((1..c.len() - 1).map(|k| [c[0] - 1, c[k] - 1, c[k + 1] - 1]));
                }
                _ => {}
            }
        }
        let joints: Value = serde_json::from_str(&std::fs::read_to_string(folder.join("joints.json")).ok()?).ok()?;
        let bounds = points.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[l, h], &p| [l.min(p), h.max(p)]);
        let surface = Surface::build(&points, &triangles);
        Some(Self { name, bones: joints["default163"].clone(), points, triangles, surface, bounds })
    }

    pub fn head(&self, bone: &str) -> Vec3 {
        let c = |i: usize| self.bones[bone]["head"][i].as_f64().unwrap_or(0.0) as f32;
        Vec3::new(c(0), c(1), c(2))
    }

    pub fn plane(&self, view: View) -> ViewPlane {
        ViewPlane::orthographic(view, self.bounds)
    }
}

/// The line of section centroids along one bone.
pub struct Line {
    from: Vec3,
    to: Vec3,
    /// Fraction along the bone, centroid, radius; only where the section is the limb's own.
    sections: Vec<(f32, Vec3, f32)>,
}

impl Line {
    pub fn new(body: &Body, from: Vec3, to: Vec3) -> Self {
        let normal = (to - from).normalize();
        let mut sections: Vec<(f32, Vec3, f32)> = (0..=40)
            .filter_map(|i| {
                let t = i as f32 / 40.0;
                let (centroid, area) = cut(body, from.lerp(to, t), normal)?;
                Some((t, centroid, (area / std::f32::consts::PI).sqrt()))
            })
            .collect();
        let mut middle: Vec<f32> = sections.iter().filter(|s| (0.4..=0.9).contains(&s.0)).map(|s| s.2).collect();
        middle.sort_by(f32::total_cmp);
        let usual = middle[middle.len() / 2];
        sections.retain(|s| s.2 < 1.5 * usual);
        Self { from, to, sections }
    }

    /// Distance of `p` from the line in local radii, and whether the line was extended to reach it.
    pub fn distance(&self, p: Vec3) -> (f32, bool) {
        let n = self.sections.len();
        let extend = |end: usize, inner: usize| {
            let (a, b) = (self.sections[end].1, self.sections[inner].1);
            a + (a - b).normalize() * self.from.distance(self.to)
        };
        let step = (n / 4).max(1);
        let mut best = (f32::INFINITY, self.sections[0].2, false);
        let mut piece = |a: Vec3, b: Vec3, radius: f32, extended: bool| {
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            let d = p.distance(a.lerp(b, t));
            if d < best.0 {
                best = (d, radius, extended);
            }
        };
        for w in self.sections.windows(2) {
            piece(w[0].1, w[1].1, 0.5 * (w[0].2 + w[1].2), false);
        }
        piece(extend(0, step), self.sections[0].1, self.sections[0].2, true);
        piece(self.sections[n - 1].1, extend(n - 1, n - 1 - step), self.sections[n - 1].2, true);
        (best.0 / best.1, best.2)
    }

    pub fn radius(&self) -> f32 {
        let mut radii: Vec<f32> = self.sections.iter().map(|s| s.2).collect();
        radii.sort_by(f32::total_cmp);
        radii[radii.len() / 2]
    }
}

/// Centroid and area of the loop around `at` where the plane through it cuts the mesh.
fn cut(body: &Body, at: Vec3, normal: Vec3) -> Option<(Vec3, f32)> {
    let (u, v) = normal.any_orthonormal_pair();
    let side: Vec<f32> = body.points.iter().map(|&p| (p - at).dot(normal)).collect();
    let mut places: BTreeMap<(u32, u32), Vec2> = BTreeMap::new();
    let mut next: BTreeMap<(u32, u32), Vec<(u32, u32)>> = BTreeMap::new();
    for t in &body.triangles {
        let mut ends = Vec::new();
        for (i, j) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (side[i as usize], side[j as usize]);
            if (a > 0.0) != (b > 0.0) {
                let p = body.points[i as usize].lerp(body.points[j as usize], a / (a - b)) - at;
                places.insert((i.min(j), i.max(j)), Vec2::new(p.dot(u), p.dot(v)));
                ends.push((i.min(j), i.max(j)));
            }
        }
        if let [a, b] = ends[..] {
            next.entry(a).or_default().push(b);
            next.entry(b).or_default().push(a);
        }
    }
    let mut best: Option<(bool, f32, Vec2, f32)> = None;
    while let Some((&start, _)) = next.first_key_value() {
        let mut edge = start;
        let mut polygon = Vec::new();
        while let Some(around) = next.remove(&edge) {
            polygon.push(places[&edge]);
            match around.into_iter().find(|e| next.contains_key(e)) {
                Some(e) => edge = e,
                None => break,
            }
        }
        let (mut area, mut moment, mut turn) = (0.0, Vec2::ZERO, 0.0);
        for i in 0..polygon.len() {
            let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            area += a.perp_dot(b);
            moment += (a + b) * a.perp_dot(b);
            turn += a.angle_to(b);
        }
        if area.abs() < 1e-9 {
            continue;
        }
        let centre = moment / (3.0 * area);
        let outside = turn.abs() < 3.0;
        let key = (outside, centre.length());
        if best.is_none_or(|b| key < (b.0, b.1)) {
            best = Some((key.0, key.1, centre, 0.5 * area.abs()));
        }
    }
    best.map(|(_, _, c, area)| (at + u * c.x + v * c.y, area))
}
