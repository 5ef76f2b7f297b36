//! The reverse foot.

use bevy::math::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    solve::foot::{FootControls, FootPivots, FootPose},
};

use super::{HARD, angle, is_unit};

/// A left foot looking along +Z, its outer edge towards +X.
const LEFT: FootPivots = FootPivots {
    heel: Vec3::new(0.1, 0.0, -0.08),
    toe: Vec3::new(0.1, 0.0, 0.2),
    ball: Vec3::new(0.1, 0.02, 0.1),
    inner: Vec3::new(0.06, 0.0, 0.1),
    outer: Vec3::new(0.15, 0.0, 0.1),
    ankle: Vec3::new(0.1, 0.1, 0.0),
    up: Vec3::Y,
};

fn mirrored(foot: FootPivots) -> FootPivots {
    let mirror = |p: Vec3| Vec3::new(-p.x, p.y, p.z);
    FootPivots {
        heel: mirror(foot.heel),
        toe: mirror(foot.toe),
        ball: mirror(foot.ball),
        inner: mirror(foot.inner),
        outer: mirror(foot.outer),
        ankle: mirror(foot.ankle),
        up: foot.up,
    }
}

/// Where a point that rests on the foot goes with a part that rests at `pivot`.
fn carried(part: &Trs, pivot: Vec3, point: Vec3) -> Vec3 {
    part.translation + part.rotation * (point - pivot)
}

fn parts(pose: &FootPose) -> [Trs; 7] {
    [pose.heel, pose.toe_tip, pose.outer, pose.inner, pose.ball, pose.toes, pose.ankle]
}

#[test]
fn a_foot_without_roll_rests() {
    for foot in [LEFT, mirrored(LEFT)] {
        let pose = foot.solve(&FootControls::default());
        let rest = [foot.heel, foot.toe, foot.outer, foot.inner, foot.ball, foot.ball, foot.ankle];
        for (part, rest) in parts(&pose).iter().zip(rest) {
            assert!(part.translation.distance(rest) < 1e-6 && angle(part.rotation, Quat::IDENTITY) < 1e-6);
        }
    }
}

#[test]
fn a_foot_rolls_over_heel_ball_and_toe() {
    for foot in [LEFT, mirrored(LEFT)] {
        let roll = |roll: f32| foot.solve(&FootControls { roll, ..FootControls::default() });
        // Back: the heel stays, toes and ankle turn up as one.
        let back = roll(-20.0);
        assert!(carried(&back.ankle, foot.ankle, foot.heel).distance(foot.heel) < 1e-6);
        assert!(back.toes.translation.y > foot.ball.y + 0.03);
        // Up to the break angle the ball and the toes stay on the ground and the heel lifts.
        for degrees in [5.0, 20.0, 35.0] {
            let pose = roll(degrees);
            assert!(
                pose.toes.translation.distance(foot.ball) < 1e-6 && angle(pose.toes.rotation, Quat::IDENTITY) < 1e-6
            );
            assert!(carried(&pose.ankle, foot.ankle, foot.ball).distance(foot.ball) < 1e-6);
            let heel = carried(&pose.ankle, foot.ankle, foot.heel);
            assert!(heel.y > 0.18 * degrees.to_radians().sin() - 0.02, "heel at {heel}");
            assert!((angle(pose.ankle.rotation, Quat::IDENTITY).to_degrees() - degrees).abs() < 1e-2);
        }
        // Past it the toe tip stays and the ball lifts; at the straight angle the foot is straight.
        for degrees in [40.0, 55.0, 70.0, 90.0] {
            let pose = roll(degrees);
            assert!(carried(&pose.toes, foot.ball, foot.toe).distance(foot.toe) < 1e-6);
            assert!(pose.toes.translation.y > foot.ball.y);
            assert!((angle(pose.ankle.rotation, Quat::IDENTITY).to_degrees() - degrees).abs() < 1e-2);
            let broken = angle(pose.toes.rotation, pose.ankle.rotation).to_degrees();
            assert!(if degrees >= 70.0 { broken < 1e-2 } else { broken > 1.0 }, "{degrees}: {broken}");
        }
        // No pop anywhere.
        let mut before = roll(-40.0);
        for i in 1..=1400 {
            let now = roll(-40.0 + 0.1 * i as f32);
            for (a, b) in parts(&before).iter().zip(parts(&now)) {
                assert!(a.translation.distance(b.translation) < 2e-3 && angle(a.rotation, b.rotation) < 6e-3);
            }
            before = now;
        }
    }
}

#[test]
fn a_foot_tips_and_turns_about_its_pivots() {
    for foot in [LEFT, mirrored(LEFT)] {
        let outwards = (foot.outer - foot.inner).normalize();
        let with = |controls: FootControls| foot.solve(&controls);
        let tipped = with(FootControls { bank: 30.0, ..FootControls::default() });
        assert!(carried(&tipped.ankle, foot.ankle, foot.outer).distance(foot.outer) < 1e-6);
        assert!((tipped.ankle.rotation * Vec3::Y).dot(outwards) > 0.45);
        assert!(carried(&tipped.ankle, foot.ankle, foot.inner).y > 0.01);
        let tipped = with(FootControls { bank: -30.0, ..FootControls::default() });
        assert!(carried(&tipped.ankle, foot.ankle, foot.inner).distance(foot.inner) < 1e-6);
        assert!((tipped.ankle.rotation * Vec3::Y).dot(outwards) < -0.45);
        let turns = [
            (FootControls { heel_twist: 25.0, ..FootControls::default() }, foot.heel),
            (FootControls { ball_twist: 25.0, ..FootControls::default() }, foot.ball),
            (FootControls { toe_twist: 25.0, ..FootControls::default() }, foot.toe),
        ];
        for (controls, pivot) in turns {
            let pose = with(controls);
            assert!(carried(&pose.ankle, foot.ankle, pivot).distance(pivot) < 1e-6);
            assert!(angle(pose.ankle.rotation, Quat::from_rotation_y(25_f32.to_radians())) < 1e-3);
        }
        let bent = with(FootControls { toe_bend: 30.0, ..FootControls::default() });
        assert!(
            carried(&bent.toes, foot.ball, foot.toe).y > 0.02 && bent.ankle.translation.distance(foot.ankle) < 1e-6
        );
        let lifted = with(FootControls { ball_lift: 30.0, ..FootControls::default() });
        assert!(
            carried(&lifted.ankle, foot.ankle, foot.heel).y > 0.05
                && angle(lifted.toes.rotation, Quat::IDENTITY) < 1e-6
        );
        let tiptoe = with(FootControls { toe_lift: 30.0, ..FootControls::default() });
        assert!(tiptoe.toes.translation.y > 0.04);
    }
    // Mirrored feet do mirrored things.
    let controls = FootControls { roll: 50.0, bank: 12.0, toe_bend: 5.0, ..FootControls::default() };
    let (left, right) = (LEFT.solve(&controls), mirrored(LEFT).solve(&controls));
    for (l, r) in parts(&left).iter().zip(parts(&right)) {
        assert!((l.translation * Vec3::new(-1.0, 1.0, 1.0)).distance(r.translation) < 1e-6);
        let mirrored = Quat::from_xyzw(l.rotation.x, -l.rotation.y, -l.rotation.z, l.rotation.w);
        assert!(angle(mirrored, r.rotation) < 1e-3);
    }
}

#[test]
fn a_foot_answers_anything_with_numbers() {
    let flat = FootPivots {
        heel: Vec3::ZERO,
        toe: Vec3::ZERO,
        ball: Vec3::ZERO,
        inner: Vec3::ZERO,
        outer: Vec3::ZERO,
        ankle: Vec3::ZERO,
        up: Vec3::ZERO,
    };
    for foot in [LEFT, flat, FootPivots { up: Vec3::NAN, ..LEFT }, FootPivots { up: Vec3::Z, ..LEFT }] {
        for a in HARD {
            for b in HARD {
                for controls in [
                    FootControls { roll: a, break_angle: b, ..FootControls::default() },
                    FootControls { roll: 50.0, break_angle: a, straight_angle: b, ..FootControls::default() },
                    FootControls { bank: a, toe_lift: b, ..FootControls::default() },
                    FootControls { ball_lift: a, heel_twist: b, toe_bend: b, ..FootControls::default() },
                ] {
                    for part in parts(&foot.solve(&controls)) {
                        assert!(
                            part.translation.is_finite() && is_unit(part.rotation),
                            "{foot:?}, {controls:?}: {part:?}"
                        );
                    }
                }
            }
        }
    }
}
