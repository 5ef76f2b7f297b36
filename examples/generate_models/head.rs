//! The head: skull, face, ears and neck.
//!
//! Head space has its origin below the chin in the middle of the head, Y up, Z forward; lengths are those of an adult.

use glam::{DVec3, dvec3};

use crate::{
    field::{
        Frame, Loft, cone, cut, ease, ellipsoid, ellipsoid_in, intersect, lens, path, section, turn_x, turn_y, turn_z,
        union,
    },
    surface_nets::Quads,
};

/// Centre of the character's left eyeball.
pub const EYE: DVec3 = dvec3(0.0315, 0.1165, 0.0735);

/// Radius of an eyeball.
pub const EYE_RADIUS: f64 = 0.0125;

/// A head.
pub struct Head {
    face: Loft,
    neck: Loft,
    ear: Frame,
    /// True for open eyes, nostrils and lips; otherwise the calm face of a mannequin.
    detailed: bool,
}

impl Head {
    /// The head; see [`Head::distance`].
    pub fn new(detailed: bool) -> Self {
        let face = Loft::new(
            &[
                section(0.000, [-0.020, 0.020], [0.030, 0.080]),
                section(0.012, [-0.034, 0.034], [0.010, 0.0895]),
                section(0.030, [-0.0465, 0.0465], [-0.010, 0.0900]),
                section(0.050, [-0.0575, 0.0575], [-0.028, 0.0915]),
                section(0.075, [-0.0625, 0.0625], [-0.045, 0.0915]),
                section(0.100, [-0.0655, 0.0655], [-0.055, 0.090]),
                section(0.130, [-0.0675, 0.0675], [-0.060, 0.091]),
                section(0.150, [-0.062, 0.062], [-0.055, 0.087]),
                section(0.190, [-0.030, 0.030], [-0.030, 0.055]),
            ],
            0.12,
        )
        .with_middle(0.5, 0.38)
        .with_closing(6.0);
        let neck = Loft::new(
            &[
                section(-0.130, [-0.085, 0.085], [-0.105, 0.030]),
                section(-0.100, [-0.076, 0.076], [-0.102, 0.022]),
                section(-0.070, [-0.064, 0.064], [-0.096, 0.018]),
                section(-0.040, [-0.0545, 0.0545], [-0.086, 0.020]),
                section(-0.010, [-0.0520, 0.0520], [-0.078, 0.030]),
                section(0.025, [-0.0510, 0.0510], [-0.070, 0.034]),
                section(0.060, [-0.0500, 0.0500], [-0.062, 0.030]),
                section(0.090, [-0.0440, 0.0440], [-0.046, 0.020]),
            ],
            0.0,
        );
        let ear = Frame { at: dvec3(0.0730, 0.1030, -0.0130), axes: turn_y(-24.0) * turn_x(-10.0) * turn_z(-6.0) };
        Self { face, neck, ear, detailed }
    }

    /// Distance of a point of head space; even in X.
    pub fn distance(&self, p: DVec3) -> f64 {
        let q = dvec3(p.x.abs(), p.y, p.z);
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let skull = union(
            ellipsoid(q, at(0.0, 0.142, -0.010), at(0.0745, 0.0845, 0.0900)),
            ellipsoid(q, at(0.0, 0.146, 0.030), at(0.0640, 0.0660, 0.0640)),
            0.03,
        );
        let mut d = union(skull, self.face.distance(q.y, q.x, q.z), 0.022);
        // Jaw, chin, cheeks, brow.
        let jaw = path(
            q,
            &[(at(0.0490, 0.070, 0.010), 0.011), (at(0.0430, 0.036, 0.022), 0.012), (at(0.015, 0.0145, 0.074), 0.013)],
        );
        d = union(d, jaw, 0.030);
        d = union(d, ellipsoid(q, at(0.0, 0.0135, 0.0850), at(0.0170, 0.0140, 0.0125)), 0.016);
        let cheek = Frame { at: at(0.0455, 0.0900, 0.0600), axes: turn_y(38.0) * turn_z(-14.0) };
        d = union(d, ellipsoid_in(q, &cheek, at(0.0240, 0.0140, 0.0160)), 0.030);
        d = union(d, ellipsoid(q, at(0.0310, 0.0660, 0.0700), at(0.0260, 0.0280, 0.0200)), 0.028);
        let brow = path(
            q,
            &[
                (at(0.0, 0.1330, 0.0860), 0.0070),
                (at(0.022, 0.1360, 0.0835), 0.0078),
                (at(0.046, 0.1320, 0.0660), 0.0070),
            ],
        );
        d = union(d, brow, 0.020);
        // Eye sockets, then lids over the eyeballs.
        let socket = Frame { at: at(0.0330, 0.1160, 0.0960), axes: turn_y(18.0) };
        d = cut(d, ellipsoid_in(q, &socket, at(0.0215, 0.0140, 0.0140)), 0.016);
        d = self.eyes(q, d);
        d = self.nose(q, d);
        d = self.mouth(q, d);
        d = self.ears(q, d);
        union(d, self.throat(q), 0.044)
    }

    fn eyes(&self, q: DVec3, d: f64) -> f64 {
        let r = q - EYE;
        let lids = union(d, ellipsoid(q, EYE, dvec3(0.0160, 0.0152, 0.0150)), 0.010);
        if !self.detailed {
            return lids;
        }
        // The opening is a lens of two circles; behind it the surface follows the eyeball from inside.
        let tilt = turn_z(4.0).transpose() * r;
        let arc = |center: f64, radius: f64| {
            let (x, y) = (tilt.x - 0.0012, tilt.y - center);
            (x * x + y * y).sqrt() - radius
        };
        let upper = arc(-0.0135, 0.0201);
        let lower = arc(0.0180, 0.0232);
        let lens = intersect(upper, lower, 0.002).max(-r.z);
        let behind = (EYE_RADIUS - 0.0018 - r.length()).max(0.0060 - r.z);
        let opening = intersect(lens, behind, 0.0004);
        cut(lids, opening, 0.0050)
    }

    fn nose(&self, q: DVec3, d: f64) -> f64 {
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let bridge = path(
            q,
            &[(at(0.0, 0.1270, 0.0865), 0.0070), (at(0.0, 0.1060, 0.0960), 0.0072), (at(0.0, 0.0850, 0.1060), 0.0085)],
        );
        let mut d = union(d, bridge, 0.014);
        d = union(d, ellipsoid(q, at(0.0, 0.0815, 0.1080), at(0.0100, 0.0088, 0.0098)), 0.010);
        d = union(d, ellipsoid(q, at(0.0108, 0.0775, 0.0985), at(0.0068, 0.0066, 0.0090)), 0.009);
        if self.detailed {
            let nostril = Frame { at: at(0.0062, 0.0712, 0.1025), axes: turn_y(-18.0) * turn_x(-20.0) };
            d = cut(d, ellipsoid_in(q, &nostril, at(0.0034, 0.0044, 0.0056)), 0.0045);
        }
        d
    }

    fn mouth(&self, q: DVec3, d: f64) -> f64 {
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let mut d = union(d, ellipsoid(q, at(0.0, 0.0480, 0.0770), at(0.0300, 0.0270, 0.0195)), 0.016);
        let corner = at(0.0248, 0.0467, 0.0866);
        let upper = path(
            q,
            &[
                (at(0.0, 0.0508, 0.0982), 0.0043),
                (at(0.0065, 0.0519, 0.0979), 0.0047),
                (at(0.0165, 0.0503, 0.0925), 0.0039),
                (corner, 0.0022),
            ],
        );
        let lower = path(
            q,
            &[
                (at(0.0, 0.0411, 0.0966), 0.0057),
                (at(0.0085, 0.0413, 0.0948), 0.0054),
                (at(0.0172, 0.0431, 0.0898), 0.0040),
                (corner, 0.0022),
            ],
        );
        d = union(d, union(upper, lower, if self.detailed { 0.0008 } else { 0.0020 }), 0.0042);
        if !self.detailed {
            return d;
        }
        let line = path(
            q,
            &[
                (at(0.0, 0.0464, 0.1012), 0.0010),
                (at(0.0080, 0.0470, 0.0998), 0.0010),
                (at(0.0145, 0.0468, 0.0974), 0.0008),
                (at(0.0195, 0.0467, 0.0953), 0.0004),
            ],
        );
        d = cut(d, line, 0.004);
        // The groove from nose to lip.
        cut(d, cone(q, at(0.0, 0.0690, 0.1010), at(0.0, 0.0580, 0.1025), 0.0030, 0.0036), 0.006)
    }

    fn ears(&self, q: DVec3, d: f64) -> f64 {
        let e = self.ear.local(q);
        if e.length() > 0.06 {
            return d;
        }
        // In ear space X points out, Y up and Z forward.
        if !self.detailed {
            return union(d, ellipsoid(e, dvec3(0.001, 0.001, -0.001), dvec3(0.0100, 0.0310, 0.0185)), 0.006);
        }
        let disc = ellipsoid(e, dvec3(0.0, 0.004, 0.0), dvec3(0.0062, 0.0300, 0.0175));
        let lobe = ellipsoid(e, dvec3(-0.001, -0.0220, 0.0055), dvec3(0.0052, 0.0105, 0.0085));
        let mut ear = union(disc, lobe, 0.008);
        let rim = path(
            e,
            &[
                (dvec3(0.0005, 0.0060, 0.0115), 0.0030),
                (dvec3(0.0025, 0.0200, 0.0125), 0.0036),
                (dvec3(0.0038, 0.0285, 0.0060), 0.0040),
                (dvec3(0.0042, 0.0285, -0.0040), 0.0042),
                (dvec3(0.0042, 0.0215, -0.0115), 0.0042),
                (dvec3(0.0038, 0.0090, -0.0145), 0.0040),
                (dvec3(0.0028, -0.0060, -0.0115), 0.0038),
                (dvec3(0.0010, -0.0180, -0.0030), 0.0038),
            ],
        );
        ear = union(ear, rim, 0.005);
        let bowl = ellipsoid(e, dvec3(0.0085, -0.0020, 0.0030), dvec3(0.0070, 0.0125, 0.0085));
        ear = cut(ear, bowl, 0.006);
        ear = union(ear, ellipsoid(e, dvec3(0.0030, -0.0050, 0.0120), dvec3(0.0032, 0.0055, 0.0040)), 0.004);
        union(d, ear, 0.006)
    }

    /// The neck alone, down to where shoulders begin.
    pub fn throat(&self, q: DVec3) -> f64 {
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let mut d = self.neck.distance(q.y, q.x, q.z);
        let strap = path(
            q,
            &[(at(0.044, 0.060, -0.026), 0.012), (at(0.038, -0.020, -0.004), 0.011), (at(0.013, -0.090, 0.016), 0.009)],
        );
        d = union(d, strap, 0.026);
        if self.detailed {
            d = union(d, ellipsoid(q, at(0.0, -0.028, 0.0180), at(0.0080, 0.0110, 0.0080)), 0.024);
        }
        d
    }
}

/// Draws a grid together where the face and the ears have their details. Even in X.
pub fn focus(p: DVec3) -> DVec3 {
    let side = if p.x < 0.0 { -1.0 } else { 1.0 };
    let mut q = dvec3(p.x.abs(), p.y, p.z);
    q = lens(q, dvec3(0.0, 0.0850, 0.0900), 0.112, 0.365, 0.40);
    q = lens(q, dvec3(0.0760, 0.1050, -0.0130), 0.035, 0.0755, 0.42);
    dvec3(q.x * side, q.y, q.z)
}

/// The head with its neck as a model of its own, standing on its cut neck at `y = -FOOT`.
pub struct HeadModel {
    head: Head,
    shoulders: Loft,
}

/// Depth of the cut below the chin.
pub const FOOT: f64 = 0.115;

impl HeadModel {
    /// The model.
    pub fn new() -> Self {
        let shoulders = Loft::new(
            &[
                section(-0.180, [-0.105, 0.105], [-0.120, 0.045]),
                section(-0.115, [-0.086, 0.086], [-0.108, 0.030]),
                section(-0.085, [-0.064, 0.064], [-0.100, 0.016]),
                section(-0.060, [-0.050, 0.050], [-0.085, 0.005]),
            ],
            0.0,
        );
        Self { head: Head::new(true), shoulders }
    }

    /// Distance of a point of head space; even in X.
    pub fn distance(&self, p: DVec3) -> f64 {
        let q = dvec3(p.x.abs(), p.y, p.z);
        let d = union(self.head.distance(p), self.shoulders.distance(q.y, q.x, q.z), 0.03);
        intersect(d, -(p.y + FOOT), 0.035)
    }
}

/// An eyeball of quads: a cube blown up to a sphere, with a slight bulge where the cornea is.
pub fn eyeball(center: DVec3, cells: usize) -> Quads {
    let mut quads = Quads::default();
    let mut index = std::collections::BTreeMap::new();
    let n = cells as i64;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    for axis in 0..3 {
        for side in [-1i64, 1] {
            for b in 0..n {
                for c in 0..n {
                    let mut face = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(ob, oc)| {
                        let mut key = [0i64; 3];
                        key[axis] = side * n;
                        key[(axis + 1) % 3] = 2 * (b + ob) - n;
                        key[(axis + 2) % 3] = 2 * (c + oc) - n;
                        *index.entry(key).or_insert_with(|| {
                            // x + x^3/4 spreads the cells more evenly than x alone.
                            let spread = |k: i64| {
                                let x = k as f64 / n as f64;
                                x * 0.8 + x * x * x * 0.2
                            };
                            let cube: DVec3 = (0..3).map(|a| axes[a] * spread(key[a])).sum();
                            let unit = cube.normalize();
                            let cornea = 0.0008 * ease(0.86, 1.0, unit.z);
                            quads.points.push(center + unit * (EYE_RADIUS + cornea));
                            quads.on_plane.push(false);
                            quads.points.len() as u32 - 1
                        })
                    });
                    if side < 0 {
                        face.reverse();
                    }
                    quads.faces.push(face);
                }
            }
        }
    }
    quads
}
