//! The left hand: a palm, five fingers, and the joints inside them.
//!
//! Hand space has its origin in the wrist, X towards the fingers, Y out of the back of the hand and Z towards the
//! thumb; lengths are those of an adult's hand, 19 cm from the wrist to the tip of the middle finger.

use glam::{DMat3, DVec3, dvec3};

use crate::{
    field::{
        Frame, Loft, cone, cut, ease, ellipsoid, ellipsoid_in, intersect, path, section, turn_x, turn_y, turn_z, union,
    },
    rig::Rig,
};

/// Names of the fingers, thumb first.
pub const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "pinky"];

/// Root of each finger: the thumb at its root in the wrist, the others at their knuckles.
const ROOTS: [DVec3; 5] = [
    dvec3(0.018, -0.008, 0.022),
    dvec3(0.089, 0.001, 0.0275),
    dvec3(0.093, 0.003, 0.005),
    dvec3(0.088, 0.001, -0.0165),
    dvec3(0.079, -0.003, -0.0355),
];

/// Roots of the metacarpals of the four fingers.
const CARPALS: [DVec3; 4] =
    [dvec3(0.020, 0.002, 0.013), dvec3(0.021, 0.003, 0.004), dvec3(0.020, 0.002, -0.006), dvec3(0.019, 0.0, -0.015)];

/// Lengths of the three bones of each finger.
const LENGTHS: [[f64; 3]; 5] = [
    [0.045, 0.036, 0.026],
    [0.043, 0.026, 0.0175],
    [0.047, 0.030, 0.018],
    [0.044, 0.028, 0.018],
    [0.034, 0.020, 0.0165],
];

/// Radii at the three joints and at the tip.
const RADII: [[f64; 4]; 5] = [
    [0.0150, 0.0120, 0.0108, 0.0086],
    [0.0104, 0.0090, 0.0079, 0.0066],
    [0.0106, 0.0092, 0.0081, 0.0068],
    [0.0101, 0.0087, 0.0076, 0.0064],
    [0.0088, 0.0076, 0.0067, 0.0057],
];

/// Angles of the fingers in degrees.
#[derive(Debug, Clone, Copy)]
pub struct HandPose {
    /// Angle by which each finger leans towards the thumb's side.
    pub spread: [f64; 5],
    /// Angle by which each joint bends towards the palm.
    pub curl: [[f64; 3]; 5],
}

/// A posed hand.
#[derive(Debug, Clone)]
pub struct Hand {
    /// The frames of each finger's joints and of its tip; X along the bone, Y out of its back.
    pub fingers: [[Frame; 4]; 5],
    palm: Loft,
    /// True for a hand with nails, tendons and creases.
    detailed: bool,
}

impl Hand {
    /// A hand in hand space.
    pub fn new(pose: &HandPose, detailed: bool) -> Self {
        let fingers = std::array::from_fn(|f| {
            let lean = turn_y(-pose.spread[f]);
            let mut axes = if f == 0 {
                lean * turn_z(-15.0) * turn_x(52.0)
            } else {
                lean * turn_x([0.0, 2.0, 0.0, -4.0, -8.0][f])
            };
            let mut at = ROOTS[f];
            let mut frames = [Frame::WORLD; 4];
            for j in 0..3 {
                axes *= turn_z(-pose.curl[f][j]);
                frames[j] = Frame { at, axes };
                at += axes.x_axis * LENGTHS[f][j];
            }
            frames[3] = Frame { at, axes };
            frames
        });
        let palm = Loft::new(
            &[
                section(-0.080, [-0.0275, 0.0290], [-0.0205, 0.0205]),
                section(-0.030, [-0.0275, 0.0287], [-0.0198, 0.0198]),
                section(-0.005, [-0.0300, 0.0312], [-0.0187, 0.0187]),
                section(0.018, [-0.0348, 0.0345], [-0.0185, 0.0170]),
                section(0.050, [-0.0405, 0.0370], [-0.0160, 0.0155]),
                section(0.074, [-0.0430, 0.0385], [-0.0130, 0.0140]),
                section(0.084, [-0.0425, 0.0378], [-0.0110, 0.0120]),
            ],
            0.45,
        );
        Self { fingers, palm, detailed }
    }

    /// Distance of a point of hand space.
    pub fn distance(&self, p: DVec3) -> f64 {
        let mut palm = self.palm.distance(p.x, p.z, p.y);
        palm = union(palm, ellipsoid(p, dvec3(0.042, -0.012, -0.027), dvec3(0.036, 0.012, 0.014)), 0.018);
        let thenar = Frame { at: dvec3(0.041, -0.013, 0.030), axes: turn_y(-28.0) };
        palm = union(palm, ellipsoid_in(p, &thenar, dvec3(0.032, 0.014, 0.017)), 0.018);
        let web = cone(p, dvec3(0.046, -0.009, 0.041), dvec3(0.076, -0.003, 0.030), 0.008, 0.006);
        palm = union(palm, web, 0.018);
        for f in 1..5 {
            let knuckle = ROOTS[f] + dvec3(-0.003, 0.0030, 0.0);
            palm = union(palm, ellipsoid(p, knuckle, dvec3(0.012, RADII[f][0] * 0.90, RADII[f][0] * 0.88)), 0.010);
            if self.detailed {
                let tendon = cone(p, knuckle, dvec3(0.012, 0.0105, knuckle.z * 0.35), 0.0058, 0.0020);
                palm = union(palm, tendon, 0.006);
            }
        }
        let mut fingers = f64::MAX;
        for f in 1..5 {
            fingers = fingers.min(self.finger(f, p));
        }
        let hand = union(palm, fingers, 0.009);
        let thumb = self.finger(0, p);
        let root = ease(0.036, 0.060, self.fingers[0][0].local(p).x);
        union(hand, thumb, 0.020 - 0.014 * root)
    }

    fn finger(&self, f: usize, p: DVec3) -> f64 {
        let frames = &self.fingers[f];
        let r = RADII[f];
        let mut d = path(p, &[(frames[0].at, r[0]), (frames[1].at, r[1]), (frames[2].at, r[2]), (frames[3].at, r[3])]);
        // Flesh of the first two bones and the pad on the palm's side, bone heads on the back.
        for j in 0..2 {
            let flesh = frames[j].child(dvec3(LENGTHS[f][j] * 0.5, -r[j] * 0.20, 0.0), DMat3::IDENTITY);
            d = union(d, ellipsoid_in(p, &flesh, dvec3(LENGTHS[f][j] * 0.50, r[j] * 0.86, r[j] * 0.95)), 0.006);
        }
        let pad = frames[2].child(dvec3(LENGTHS[f][2] * 0.62, -r[3] * 0.30, 0.0), DMat3::IDENTITY);
        d = union(d, ellipsoid_in(p, &pad, dvec3(LENGTHS[f][2] * 0.60, r[3] * 0.92, r[3] * 1.06)), 0.004);
        for j in 1..3 {
            let bend = frames[j].child(dvec3(-0.001, r[j] * 0.25, 0.0), DMat3::IDENTITY);
            d = union(d, ellipsoid_in(p, &bend, dvec3(r[j] * 1.20, r[j] * 0.76, r[j] * 0.95)), 0.005);
        }
        if self.detailed {
            let size = r[3] / 0.0066;
            let nail = frames[2].child(dvec3(LENGTHS[f][2] * 0.86, r[3] * 0.70, 0.0), turn_z(-7.0));
            let q = nail.local(p);
            let outline = ellipsoid(q, DVec3::ZERO, dvec3(0.0078, 0.0060, 0.0058) * size);
            let plate = ellipsoid(q, dvec3(-0.001, -0.0041, 0.0) * size, dvec3(0.018, 0.0075, 0.0072) * size);
            d = cut(d, intersect(outline, -plate - 0.0003, 0.0006), 0.0008);
            d = union(d, intersect(outline, plate, 0.0008), 0.0008);
        }
        d
    }

    /// Target of a point near this hand when the hand takes the pose of another.
    pub fn carry(&self, to: &Self, p: DVec3) -> DVec3 {
        let chain = |f: usize| {
            let n = &self.fingers[f].map(|x| x.at);
            (0..3).map(|j| cone(p, n[j], n[j + 1], RADII[f][j], RADII[f][j + 1])).fold(f64::MAX, f64::min)
        };
        let distances: [f64; 5] = std::array::from_fn(chain);
        let near = (0..5).fold(0, |best, f| if distances[f] < distances[best] { f } else { best });
        let mut moved = p;
        for ((from, goal), radius) in self.fingers[near].iter().zip(&to.fingers[near]).zip(RADII[near]).take(3) {
            let local = from.local(p);
            let soft = radius * 0.9;
            moved = moved.lerp(goal.out(local), ease(-soft, soft, local.x));
        }
        moved
    }

    /// Adds the finger joints under the joint `parent`, labels ending in `side`; `space` is where the hand is.
    pub fn add_joints(&self, rig: &mut Rig, parent: usize, space: &Frame, side: &str, metacarpals: bool) {
        for f in 0..5 {
            let mut under = parent;
            if metacarpals && f > 0 {
                under = rig.add(under as i64, space.out(CARPALS[f - 1]), format!("{}_00{side}", FINGERS[f]));
            }
            for j in 0..3 {
                under =
                    rig.add(under as i64, space.out(self.fingers[f][j].at), format!("{}_0{}{side}", FINGERS[f], j + 1));
            }
        }
    }
}

/// Straight fingers, well apart: the pose that is sampled.
pub const OPEN: HandPose =
    HandPose { spread: [38.0, 11.0, 2.5, -7.0, -18.0], curl: [[0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]] };

/// Hand at rest: fingers slightly bent, more towards the little finger.
pub const RELAXED: HandPose = HandPose {
    spread: [34.0, 5.0, 0.5, -4.0, -9.5],
    curl: [[4.0, 12.0, 14.0], [12.0, 17.0, 10.0], [15.0, 20.0, 11.0], [17.0, 22.0, 12.0], [18.0, 22.0, 12.0]],
};

/// Slightly spread and nearly straight: the pose of the single hand.
pub const SPREAD: HandPose = HandPose {
    spread: [33.0, 8.0, 1.0, -6.0, -14.0],
    curl: [[0.0, 6.0, 8.0], [4.0, 7.0, 5.0], [4.0, 8.0, 5.0], [5.0, 8.0, 5.0], [6.0, 8.0, 6.0]],
};

/// The single hand with a piece of forearm, in hand space.
pub struct HandModel {
    /// The hand.
    pub hand: Hand,
    forearm: Loft,
}

/// Length of the piece of forearm.
pub const STUB: f64 = 0.10;

impl HandModel {
    /// The hand in a pose.
    pub fn new(pose: &HandPose) -> Self {
        let forearm = Loft::new(
            &[
                section(-0.180, [-0.0420, 0.0470], [-0.0370, 0.0380]),
                section(-0.110, [-0.0365, 0.0400], [-0.0320, 0.0325]),
                section(-0.065, [-0.0315, 0.0340], [-0.0262, 0.0262]),
                section(-0.035, [-0.0290, 0.0305], [-0.0220, 0.0220]),
                section(0.000, [-0.0294, 0.0306], [-0.0190, 0.0190]),
                section(0.050, [-0.0282, 0.0292], [-0.0190, 0.0190]),
            ],
            0.25,
        );
        Self { hand: Hand::new(pose, true), forearm }
    }

    /// Distance of a point of hand space.
    pub fn distance(&self, p: DVec3) -> f64 {
        let mut arm = self.forearm.distance(p.x, p.z, p.y);
        arm = union(arm, ellipsoid(p, dvec3(-0.012, 0.011, -0.019), dvec3(0.013, 0.010, 0.010)), 0.008);
        for z in [0.007, -0.003] {
            arm = union(arm, cone(p, dvec3(0.0, -0.0155, z), dvec3(-0.09, -0.022, z * 1.6), 0.0042, 0.006), 0.006);
        }
        let share = ease(-0.050, 0.014, p.x);
        let all = arm + (self.hand.distance(p) - arm) * share;
        intersect(all, -(p.x + STUB), 0.012)
    }
}
