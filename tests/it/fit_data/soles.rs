//! Feet of animals on all fours: a long one is a sole, and the heel stands on the ground; over a paw the hock stays high.

use bevy::math::Vec3;

use super::{FittedSkeleton, fitted, labels};

/// Place of the heels along the body.
const HEEL: f32 = -0.24;
/// Least and greatest corner of the parts of an animal, without its legs.
const TRUNK: [[[f32; 3]; 2]; 4] = [
    [[-0.09, 0.34, -0.28], [0.09, 0.52, 0.22]],
    [[-0.05, 0.45, 0.16], [0.05, 0.62, 0.28]],
    [[-0.05, 0.54, 0.22], [0.05, 0.66, 0.42]],
    [[-0.02, 0.42, -0.55], [0.02, 0.46, -0.25]],
];
/// Length of soles and of a paw: about a half and a quarter of the height of the hips.
const SOLE: f32 = 0.24;
const SHORT_SOLE: f32 = 0.2;
const PAW: f32 = 0.1;

/// The fit of an animal of boxes with straight legs, whose hind feet have a length, and their heels so far behind the leg.
fn animal(foot: f32, heel: f32) -> FittedSkeleton {
    let mut boxes = TRUNK.to_vec();
    for (left, right) in [(0.04, 0.09), (-0.09, -0.04)] {
        for (back, foot, heel) in [(0.1, PAW, 0.0), (HEEL, foot, heel)] {
            boxes.push([[left, 0.0, back + heel], [right, 0.4, back + heel + 0.06]]);
            boxes.push([[left, 0.0, back], [right, 0.04, back + foot]]);
        }
    }
    let model = crate::gestures::boxes(&boxes);
    fitted(&model.points, &model.point_triangles(), "quadruped").unwrap()
}

fn place(fit: &FittedSkeleton, label: &str) -> Vec3 {
    let joint = labels("quadruped").iter().position(|known| known == label).unwrap();
    fit.joints[joint].position
}

/// Ankle, ball and toes of a sole lie one before the other over the ground, at their shares of its length. By the proportions of an
/// animal that walks on its toes, the ankle lies further back, and the ball over the heel.
#[test]
fn heels_of_soles_stand_on_the_ground() {
    check_sole(SOLE, 0.0);
}

/// A heel that juts out behind the leg is part of the sole.
#[test]
fn heels_behind_legs_are_of_the_sole() {
    check_sole(SHORT_SOLE, 0.06);
    check_sole(SOLE, 0.06);
}

#[track_caller]
fn check_sole(length: f32, heel: f32) {
    let fit = animal(length, heel);
    for side in ["l", "r"] {
        let [ankle, ball, toes] = ["metatarsus", "foot", "toes"].map(|name| place(&fit, &format!("{name}_{side}")));
        println!("{side}: ankle {ankle}, ball {ball}, toes {toes}");
        for (joint, along) in [(ankle, 0.25), (ball, 0.6), (toes, 0.85)] {
            let off = joint.z - (HEEL + along * length);
            assert!(off.abs() < 0.1 * length, "{side}: {off} along the sole, {along} of its length");
        }
        assert!((0.0..0.09).contains(&ankle.y) && ball.y < ankle.y && toes.y < ball.y, "{side}: {ankle} {ball} {toes}");
        // The knee lies between the hip and the ankle.
        let (hip, knee) = (place(&fit, &format!("thigh_{side}")), place(&fit, &format!("shin_{side}")));
        assert!(ankle.y + 0.1 < knee.y && knee.y + 0.1 < hip.y, "{side}: hip {hip}, knee {knee}, ankle {ankle}");
    }
}

/// A short foot is a paw: the joint behind it is a hock, a third of the leg high.
#[test]
fn hocks_over_paws_stay_high() {
    let fit = animal(PAW, 0.0);
    for side in ["l", "r"] {
        let hock = place(&fit, &format!("metatarsus_{side}"));
        println!("{side}: hock {hock}");
        assert!((0.13..0.22).contains(&hock.y), "{side}: {hock}");
    }
}
