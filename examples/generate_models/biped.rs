//! The biped: an adult of 1.75 m in a relaxed A-pose, on the ground, facing +Z.
//!
//! The body is shaped twice from the same numbers, in a T-pose with straight fingers and in the A-pose. The first is
//! sampled, so that rings of quads run around the limbs and fingers stand apart; its vertices are carried into the
//! second and settle on that surface.

use glam::{DVec3, dvec3};

use crate::{
    field::{
        Frame, Loft, cone, ease, ellipsoid, ellipsoid_in, intersect, lens, path, section, turn_x, turn_y, turn_z, union,
    },
    hand::{Hand, HandPose, OPEN, RELAXED},
    head::Head,
    rig::Rig,
};

/// Origin of head space.
pub const HEAD: DVec3 = dvec3(0.0, 1.5225, 0.022);

/// Centre of the shoulder joint of the T-pose and the A-pose.
const SHOULDER: DVec3 = dvec3(0.171, 1.402, -0.016);

/// Lengths of upper arm and forearm.
const UPPER: f64 = 0.282;
const FORE: f64 = 0.252;

const HIP: DVec3 = dvec3(0.090, 0.925, -0.004);
const KNEE: DVec3 = dvec3(0.112, 0.498, 0.004);
const ANKLE: DVec3 = dvec3(0.124, 0.080, -0.018);

/// Angle by which the feet point outwards, degrees.
const TOE_OUT: f64 = 7.0;

/// The pose of arms and hands; degrees.
pub struct ArmPose {
    down: f64,
    elbow: f64,
    twist: f64,
    hand: HandPose,
}

/// Arms level, everything straight: the pose that is sampled.
pub const SAMPLED: ArmPose = ArmPose { down: 0.0, elbow: 0.0, twist: 0.0, hand: OPEN };

/// The pose of the model.
pub const REST: ArmPose = ArmPose { down: 46.0, elbow: 16.0, twist: 12.0, hand: RELAXED };

/// The body in a pose.
pub struct Biped {
    upper: Frame,
    fore: Frame,
    wrist: Frame,
    hand: Hand,
    head: Head,
    torso: Loft,
    leg: Loft,
    upper_arm: Loft,
    forearm: Loft,
    foot: Loft,
    foot_frame: Frame,
}

impl Biped {
    /// The body with its arms in a pose.
    pub fn new(pose: &ArmPose) -> Self {
        let upper = Frame { at: SHOULDER, axes: turn_z(-pose.down) };
        let fore = upper.child(DVec3::X * UPPER, turn_y(-pose.elbow));
        let wrist = fore.child(DVec3::X * FORE, turn_x(pose.twist));
        let torso = Loft::new(
            &[
                section(0.815, [-0.060, 0.060], [-0.040, 0.045]),
                section(0.845, [-0.120, 0.120], [-0.076, 0.078]),
                section(0.890, [-0.158, 0.158], [-0.098, 0.094]),
                section(0.940, [-0.164, 0.164], [-0.104, 0.100]),
                section(0.990, [-0.156, 0.156], [-0.094, 0.102]),
                section(1.040, [-0.143, 0.143], [-0.077, 0.100]),
                section(1.090, [-0.134, 0.134], [-0.067, 0.097]),
                section(1.140, [-0.132, 0.132], [-0.067, 0.098]),
                section(1.200, [-0.139, 0.139], [-0.077, 0.104]),
                section(1.260, [-0.149, 0.149], [-0.090, 0.108]),
                section(1.320, [-0.155, 0.155], [-0.099, 0.104]),
                section(1.370, [-0.152, 0.152], [-0.101, 0.090]),
                section(1.420, [-0.128, 0.128], [-0.092, 0.062]),
                section(1.455, [-0.085, 0.085], [-0.078, 0.040]),
                section(1.490, [-0.045, 0.045], [-0.060, 0.025]),
            ],
            0.22,
        )
        .with_middle(0.5, 0.47);
        let leg = Loft::new(
            &[
                section(0.055, [0.097, 0.151], [-0.050, 0.040]),
                section(0.100, [0.0985, 0.1505], [-0.052, 0.026]),
                section(0.150, [0.0955, 0.1525], [-0.053, 0.022]),
                section(0.200, [0.0905, 0.1570], [-0.059, 0.023]),
                section(0.270, [0.0810, 0.1640], [-0.073, 0.028]),
                section(0.330, [0.0735, 0.1670], [-0.082, 0.032]),
                section(0.380, [0.0700, 0.1655], [-0.080, 0.037]),
                section(0.430, [0.0695, 0.1600], [-0.067, 0.044]),
                section(0.470, [0.0695, 0.1570], [-0.057, 0.050]),
                section(0.510, [0.0675, 0.1570], [-0.053, 0.055]),
                section(0.560, [0.0610, 0.1600], [-0.054, 0.061]),
                section(0.630, [0.0455, 0.1680], [-0.061, 0.074]),
                section(0.710, [0.0260, 0.1755], [-0.071, 0.086]),
                section(0.790, [0.0105, 0.1800], [-0.080, 0.091]),
                section(0.860, [0.0080, 0.1720], [-0.080, 0.084]),
                section(0.930, [0.0300, 0.1450], [-0.060, 0.064]),
            ],
            0.10,
        )
        .with_middle(0.5, 0.52);
        let upper_arm = Loft::new(
            &[
                section(-0.030, [-0.046, 0.046], [-0.044, 0.044]),
                section(0.030, [-0.050, 0.050], [-0.049, 0.048]),
                section(0.080, [-0.046, 0.047], [-0.050, 0.047]),
                section(0.130, [-0.042, 0.041], [-0.049, 0.046]),
                section(0.180, [-0.039, 0.037], [-0.045, 0.044]),
                section(0.230, [-0.036, 0.035], [-0.041, 0.038]),
                section(0.275, [-0.036, 0.036], [-0.038, 0.035]),
                section(0.350, [-0.036, 0.036], [-0.038, 0.036]),
            ],
            0.08,
        );
        let forearm = Loft::new(
            &[
                section(-0.080, [-0.034, 0.034], [-0.038, 0.036]),
                section(-0.035, [-0.035, 0.035], [-0.038, 0.036]),
                section(0.010, [-0.037, 0.037], [-0.038, 0.038]),
                section(0.050, [-0.039, 0.039], [-0.038, 0.043]),
                section(0.090, [-0.036, 0.037], [-0.036, 0.042]),
                section(0.140, [-0.030, 0.031], [-0.033, 0.037]),
                section(0.190, [-0.024, 0.025], [-0.030, 0.033]),
                section(0.230, [-0.0205, 0.0208], [-0.0282, 0.0300]),
                section(0.262, [-0.0188, 0.0188], [-0.0280, 0.0290]),
                section(0.320, [-0.0188, 0.0188], [-0.0280, 0.0290]),
            ],
            0.12,
        );
        let foot = Loft::new(
            &[
                section(-0.048, [-0.021, 0.021], [0.004, 0.052]),
                section(-0.030, [-0.029, 0.029], [-0.004, 0.066]),
                section(0.010, [-0.031, 0.032], [-0.004, 0.078]),
                section(0.050, [-0.034, 0.036], [-0.002, 0.072]),
                section(0.090, [-0.040, 0.040], [-0.003, 0.053]),
                section(0.125, [-0.045, 0.043], [-0.004, 0.038]),
                section(0.150, [-0.045, 0.041], [-0.003, 0.029]),
            ],
            0.25,
        )
        .with_middle(0.45, 0.35);
        let foot_frame = Frame { at: dvec3(ANKLE.x, 0.0, ANKLE.z), axes: turn_y(TOE_OUT) };
        Self {
            upper,
            fore,
            wrist,
            hand: Hand::new(&pose.hand, false),
            head: Head::new(false),
            torso,
            leg,
            upper_arm,
            forearm,
            foot,
            foot_frame,
        }
    }

    /// Distance of a point; even in X.
    pub fn distance(&self, p: DVec3) -> f64 {
        let q = dvec3(p.x.abs(), p.y, p.z);
        let mut d = self.trunk(q);
        if q.y < 1.1 {
            let mut legs = self.legs(q);
            if q.x < 0.06 && q.y > 0.6 {
                legs = union(legs, self.legs(dvec3(-q.x, q.y, q.z)), 0.020);
            }
            d = union(d, legs, 0.035);
            d = union(d, ellipsoid(q, dvec3(0.076, 0.893, -0.052), dvec3(0.078, 0.083, 0.066)), 0.030);
        }
        if q.y > 0.55 && q.x > 0.05 {
            d = union(d, self.arm(q), 0.030);
        }
        if q.y > 1.36 && q.x < 0.25 {
            d = union(d, self.head.distance(q - HEAD), 0.030);
        }
        d
    }

    fn trunk(&self, q: DVec3) -> f64 {
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let mut d = self.torso.distance(q.y, q.x, q.z);
        if q.y < 0.7 {
            return d;
        }
        let arm = |x: f64, y: f64, z: f64| self.upper.out(dvec3(x, y, z));
        // Chest: a pectoral from the breastbone to the arm, ribs and abdomen below.
        let pec = Frame { at: at(0.074, 1.318, 0.066), axes: turn_y(20.0) * turn_z(12.0) };
        d = union(d, ellipsoid_in(q, &pec, at(0.078, 0.056, 0.040)), 0.028);
        d = union(d, cone(q, at(0.110, 1.345, 0.058), arm(0.045, -0.005, 0.018), 0.032, 0.026), 0.030);
        d = union(d, ellipsoid(q, at(0.034, 1.110, 0.066), at(0.032, 0.130, 0.034)), 0.030);
        d = union(d, ellipsoid(q, at(0.095, 1.040, 0.012), at(0.042, 0.095, 0.066)), 0.060);
        d = union(d, ellipsoid(q, at(0.0, 0.930, 0.060), at(0.090, 0.060, 0.040)), 0.040);
        // Shoulder girdle, filled between collar bone and shoulder blade.
        d = union(d, cone(q, at(0.060, 1.395, -0.016), arm(0.010, 0.000, 0.0), 0.058, 0.046), 0.030);
        d = union(d, cone(q, at(0.070, 1.400, 0.014), arm(0.015, 0.002, 0.016), 0.046, 0.040), 0.030);
        // Back: latissimus, shoulder blade, the long muscles beside the spine.
        let lat = path(
            q,
            &[
                (at(0.085, 1.120, -0.026), 0.030),
                (at(0.116, 1.260, -0.040), 0.042),
                (arm(0.012, -0.030, -0.016), 0.034),
            ],
        );
        d = union(d, lat, 0.045);
        let blade = Frame { at: at(0.088, 1.350, -0.082), axes: turn_z(-14.0) };
        d = union(d, ellipsoid_in(q, &blade, at(0.050, 0.068, 0.028)), 0.025);
        d = union(d, cone(q, at(0.088, 1.372, -0.088), arm(0.020, 0.010, -0.026), 0.024, 0.028), 0.030);
        d = union(
            d,
            path(
                q,
                &[
                    (at(0.034, 0.990, -0.058), 0.024),
                    (at(0.031, 1.110, -0.038), 0.028),
                    (at(0.034, 1.280, -0.066), 0.026),
                ],
            ),
            0.030,
        );
        // Trapezius and collar bone.
        let trapezius = path(
            q,
            &[(at(0.022, 1.545, -0.026), 0.026), (at(0.060, 1.468, -0.032), 0.032), (at(0.150, 1.428, -0.024), 0.024)],
        );
        d = union(d, trapezius, 0.035);
        d = union(d, cone(q, at(0.030, 1.420, -0.055), at(0.060, 1.330, -0.075), 0.030, 0.026), 0.030);
        union(
            d,
            path(
                q,
                &[
                    (at(0.014, 1.428, 0.040), 0.009),
                    (at(0.080, 1.440, 0.030), 0.007),
                    (at(0.155, 1.438, -0.004), 0.009),
                ],
            ),
            0.016,
        )
    }

    fn arm(&self, p: DVec3) -> f64 {
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let u = self.upper.local(p);
        let mut d = self.upper_arm.distance(u.x, u.y, u.z);
        d = union(d, ellipsoid(u, at(0.040, 0.008, 0.0), at(0.082, 0.052, 0.057)), 0.028);
        d = union(d, ellipsoid(u, at(0.150, -0.004, 0.020), at(0.078, 0.031, 0.031)), 0.020);
        d = union(d, ellipsoid(u, at(0.130, 0.002, -0.022), at(0.090, 0.034, 0.031)), 0.020);
        let f = self.fore.local(p);
        let mut fore = self.forearm.distance(f.x, f.y, f.z);
        fore = union(fore, ellipsoid(f, at(0.050, 0.012, 0.016), at(0.070, 0.028, 0.030)), 0.020);
        fore = union(fore, ellipsoid(f, at(0.060, -0.014, -0.004), at(0.070, 0.026, 0.030)), 0.020);
        d += (fore - d) * ease(-0.045, 0.040, f.x);
        d = union(d, ellipsoid(f, at(0.002, 0.0, -0.028), at(0.022, 0.018, 0.015)), 0.016);
        let w = self.wrist.local(p);
        let far = (w - at(0.09, -0.01, 0.005)).length() - 0.125;
        if far > 0.04 {
            return d.min(far);
        }
        d = union(d, ellipsoid(w, at(-0.012, 0.010, -0.018), at(0.014, 0.011, 0.011)), 0.010);
        d + (self.hand.distance(w) - d) * ease(-0.045, 0.014, w.x)
    }

    fn legs(&self, q: DVec3) -> f64 {
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let mut d = self.leg.distance(q.y, q.x, q.z);
        if q.y > 0.40 {
            d = union(d, ellipsoid(q, at(0.1120, 0.502, 0.0400), at(0.0230, 0.0300, 0.0185)), 0.026);
            d = union(d, ellipsoid(q, at(0.0870, 0.572, 0.0360), at(0.0260, 0.0500, 0.0290)), 0.034);
            d = union(d, ellipsoid(q, at(0.1400, 0.620, 0.0320), at(0.0290, 0.0900, 0.0380)), 0.034);
            d = union(d, ellipsoid(q, at(0.1020, 0.720, 0.0480), at(0.0420, 0.1500, 0.0470)), 0.036);
            d = union(d, ellipsoid(q, at(0.1280, 0.900, -0.0080), at(0.0400, 0.1100, 0.0600)), 0.045);
        }
        if q.y < 0.60 {
            d = union(d, ellipsoid(q, at(0.0960, 0.352, -0.0460), at(0.0260, 0.0740, 0.0350)), 0.026);
            d = union(d, ellipsoid(q, at(0.1390, 0.372, -0.0440), at(0.0250, 0.0660, 0.0320)), 0.026);
            d = union(d, ellipsoid(q, at(0.1120, 0.432, 0.0340), at(0.0150, 0.0260, 0.0120)), 0.026);
        }
        if q.y < 0.25 {
            d = union(d, ellipsoid(q, at(0.0980, 0.088, -0.0100), at(0.0120, 0.0150, 0.0130)), 0.014);
            d = union(d, ellipsoid(q, at(0.1510, 0.076, -0.0180), at(0.0120, 0.0150, 0.0120)), 0.014);
            d = union(d, self.foot(q), 0.026);
            d = intersect(d, -q.y, 0.008);
        }
        d
    }

    fn foot(&self, q: DVec3) -> f64 {
        let at = |x: f64, y: f64, z: f64| dvec3(x, y, z);
        let f = self.foot_frame.local(q);
        let mut d = self.foot.distance(f.z, f.x, f.y);
        d = union(d, ellipsoid(f, at(0.0, 0.030, -0.032), at(0.0310, 0.0340, 0.0320)), 0.016);
        let mut toes = path(f, &[(at(-0.027, 0.016, 0.135), 0.0165), (at(-0.023, 0.0145, 0.190), 0.0140)]);
        for (x, z, r) in
            [(-0.0035, 0.186, 0.0108), (0.0130, 0.176, 0.0104), (0.0275, 0.164, 0.0100), (0.0400, 0.149, 0.0096)]
        {
            toes = union(toes, path(f, &[(at(x + 0.002, 0.016, z - 0.040), r * 1.1), (at(x, 0.0105, z), r)]), 0.005);
        }
        union(d, toes, 0.014)
    }

    /// Target of a point near this body when the body takes the pose of another.
    pub fn carry(&self, to: &Self, p: DVec3) -> DVec3 {
        let share = ease(0.125, 0.215, p.x) * ease(1.20, 1.28, p.y);
        if share == 0.0 {
            return p;
        }
        let mut moved = p.lerp(to.upper.out(self.upper.local(p)), share);
        let f = self.fore.local(p);
        moved = moved.lerp(to.fore.out(f), ease(-0.035, 0.035, f.x));
        let w = self.wrist.local(p);
        moved.lerp(to.wrist.out(self.hand.carry(&to.hand, w)), ease(-0.10, 0.0, w.x))
    }

    /// The joints of the body.
    pub fn rig(&self) -> Rig {
        let mut rig = Rig::default();
        let hips = rig.add(-1, dvec3(0.0, 0.955, -0.006), "hips");
        let spine = rig.add(hips as i64, dvec3(0.0, 1.050, 0.004), "spine");
        let spine_1 = rig.add(spine as i64, dvec3(0.0, 1.155, 0.004), "spine_1");
        let chest = rig.add(spine_1 as i64, dvec3(0.0, 1.270, -0.006), "chest");
        let neck = rig.add(chest as i64, dvec3(0.0, 1.460, -0.026), "neck");
        rig.add(neck as i64, HEAD + dvec3(0.0, 0.055, -0.018), "head");
        let clavicle = rig.add(chest as i64, dvec3(0.026, 1.405, 0.010), "clavicle_l");
        let upper = rig.add(clavicle as i64, self.upper.at, "upper_arm_l");
        let fore = rig.add(upper as i64, self.fore.at, "forearm_l");
        let hand = rig.add(fore as i64, self.wrist.at, "hand_l");
        self.hand.add_joints(&mut rig, hand, &self.wrist, "_l", false);
        let thigh = rig.add(hips as i64, HIP, "thigh_l");
        let shin = rig.add(thigh as i64, KNEE, "shin_l");
        let foot = rig.add(shin as i64, ANKLE, "foot_l");
        rig.add(foot as i64, self.foot_frame.out(dvec3(-0.002, 0.018, 0.132)), "toe_l");
        rig.mirror();
        rig
    }
}

/// Position of a node of the grid: small cells around the head, the hands and the feet.
pub fn warp(u: DVec3) -> DVec3 {
    // Along the arm, up the neck and down the shin the cross-section shrinks about the limb's axis.
    let arm = 1.0 - 0.30 * ease(0.24, 0.40, u.x) - 0.43 * ease(0.56, 0.69, u.x);
    let head = 1.0 - 0.42 * ease(1.42, 1.56, u.y) * ease(0.26, 0.17, u.x);
    let foot = 1.0 - 0.34 * ease(0.17, 0.07, u.y);
    let x = ANKLE.x + (u.x * head - ANKLE.x) * foot;
    let z = HEAD.z + (u.z - HEAD.z) * head;
    let p = dvec3(x, SHOULDER.y + (u.y - SHOULDER.y) * arm, SHOULDER.z + (z - SHOULDER.z) * arm);
    lens(p, HEAD + dvec3(0.0, 0.080, 0.085), 0.090, 0.260, 0.52)
}
