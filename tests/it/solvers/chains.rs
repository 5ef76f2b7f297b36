//! Chains: FABRIK, CCD, splines.

use bevy::math::{Quat, Vec3};
use rigsmith::solve::{
    ccd::{CcdChain, CcdJoint, ccd},
    fabrik::{IterationSettings, fabrik, rotations_from_points},
    limit::{Bounds, JointLimit},
    rotate::EulerOrder,
    spline::{ArcTable, Spline, SplineIk, SplineKind},
    twist::{swing_twist, twist_angle},
};

use super::{HARD, Random, angle, is_unit};

fn chain(random: &mut Random, bones: usize) -> (Vec<Vec3>, Vec<f32>) {
    let mut points = vec![random.point()];
    let mut way = random.direction();
    for _ in 0..bones {
        way = (way + random.direction() * 0.8).normalize();
        points.push(points[points.len() - 1] + way * random.between(0.2, 1.0));
    }
    let lengths = points.windows(2).map(|pair| pair[0].distance(pair[1])).collect();
    (points, lengths)
}

const HARD_WORK: IterationSettings = IterationSettings { tolerance: 1e-4, iterations: 400, bend: Vec3::Z };

#[test]
fn fabrik_reaches_and_keeps_lengths() {
    let mut random = Random(5);
    for case in 0..300 {
        let bones = 2 + case % 9;
        let (before, lengths) = chain(&mut random, bones);
        let total: f32 = lengths.iter().sum();
        let longest = lengths.iter().copied().fold(0.0, f32::max);
        // Nearer than the longest bone reaches beyond all others, no chain gets.
        let least = (2.0 * longest - total).max(0.0);
        let goal = before[0] + random.direction() * random.between(least + 0.05 * total, 0.95 * total);
        let mut points = before.clone();
        let outcome = fabrik(&mut points, &lengths, goal, &HARD_WORK);
        assert!(outcome.distance <= HARD_WORK.tolerance, "case {case}: {outcome:?} of {total}");
        assert_eq!(points[0], before[0]);
        for (pair, length) in points.windows(2).zip(&lengths) {
            assert!((pair[0].distance(pair[1]) - length).abs() < 1e-5 * total);
        }
        let again = {
            let mut again = before.clone();
            fabrik(&mut again, &lengths, goal, &HARD_WORK);
            again
        };
        assert_eq!(points, again);
        // Turned joints carry their bones onto the points.
        let rest: Vec<Quat> = before.iter().map(|_| random.rotation()).collect();
        let mut rotations = rest.clone();
        rotations_from_points(&before, &points, &mut rotations);
        for i in 0..bones {
            let bone = rotations[i] * rest[i].inverse() * (before[i + 1] - before[i]);
            assert!(bone.distance(points[i + 1] - points[i]) < 1e-5 * total);
        }
    }
}

#[test]
fn a_chain_goes_straight_for_what_it_cannot_reach() {
    let mut random = Random(6);
    for bones in 1..10 {
        let (mut points, lengths) = chain(&mut random, bones);
        let (root, total) = (points[0], lengths.iter().sum::<f32>());
        let way = random.direction();
        let outcome = fabrik(&mut points, &lengths, root + way * (total + 1.0), &IterationSettings::default());
        assert!(points[bones].distance(root + way * total) < 1e-5 * total);
        assert!((outcome.distance - 1.0).abs() < 1e-4);
    }
}

#[test]
fn a_straight_chain_in_line_with_its_goal_bends_as_told() {
    for bones in 2..8 {
        for bend in [Vec3::Z, Vec3::NEG_X, Vec3::ZERO, Vec3::Y] {
            let lengths = vec![1.0; bones];
            let mut points: Vec<Vec3> = (0..=bones).map(|i| Vec3::Y * i as f32).collect();
            let goal = Vec3::Y * (0.6 * bones as f32);
            let settings = IterationSettings { bend, ..HARD_WORK };
            let outcome = fabrik(&mut points, &lengths, goal, &settings);
            assert!(outcome.distance <= settings.tolerance, "{bones} bones, {bend}: {outcome:?}");
            if bend.y == 0.0 && bend != Vec3::ZERO {
                assert!(points[1].dot(bend) > 0.1, "{bones} bones, {bend}: {points:?}");
            }

            let joint = CcdJoint { offset: Vec3::Y, rest: Quat::IDENTITY, limit: JointLimit::Free };
            let mut joints = vec![joint; bones];
            joints[0].offset = Vec3::ZERO;
            let chain = CcdChain { joints: &joints, end: Vec3::Y, position: Vec3::ZERO, rotation: Quat::IDENTITY };
            let mut rotations = vec![Quat::IDENTITY; bones];
            let mut posed = vec![(Vec3::ZERO, Quat::IDENTITY); bones];
            let outcome = ccd(&chain, goal, &settings, &mut rotations, &mut posed);
            assert!(outcome.distance <= settings.tolerance, "{bones} bones, {bend}: {outcome:?}");
            if bend.y == 0.0 && bend != Vec3::ZERO {
                assert!(posed[1].0.dot(bend) > 0.01, "{bones} bones, {bend}: {posed:?}");
            }
        }
    }
}

/// The end of a chain by its local rotations.
fn end_of(chain: &CcdChain, rotations: &[Quat]) -> Vec3 {
    let (mut position, mut rotation) = (chain.position, chain.rotation);
    for (joint, local) in chain.joints.iter().zip(rotations) {
        position += rotation * joint.offset;
        rotation *= *local;
    }
    position + rotation * chain.end
}

#[test]
fn ccd_reaches_within_limits() {
    let mut random = Random(7);
    let degrees = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * std::f32::consts::PI / 180.0;
    let mut reached = 0;
    let cases = 200;
    for case in 0..cases {
        let count = 2 + case % 6;
        let joints: Vec<CcdJoint> = (0..count)
            .map(|i| CcdJoint {
                offset: if i == 0 { random.point() } else { Vec3::Y * random.between(0.3, 1.0) },
                rest: random.rotation(),
                limit: match (case + i) % 3 {
                    0 => JointLimit::Free,
                    1 => JointLimit::Cone { axis: Vec3::Y, swing: 1.2, twist_min: -0.4, twist_max: 0.6 },
                    _ => JointLimit::Euler {
                        order: EulerOrder::Zxy,
                        bounds: Bounds { min: degrees(-10.0, -20.0, -5.0), max: degrees(150.0, 20.0, 5.0) },
                    },
                },
            })
            .collect();
        let chain = CcdChain { joints: &joints, end: Vec3::Y, position: random.point(), rotation: random.rotation() };
        // Goals that some allowed pose reaches.
        let within = |random: &mut Random| -> Vec<Quat> {
            joints.iter().map(|joint| joint.rest * joint.limit.clamp(random.rotation())).collect()
        };
        let goal = end_of(&chain, &within(&mut random));
        let mut rotations = within(&mut random);
        let mut posed = vec![(Vec3::ZERO, Quat::IDENTITY); count];
        let before = end_of(&chain, &rotations).distance(goal);
        let outcome = ccd(
            &chain,
            goal,
            &IterationSettings { tolerance: 1e-3, iterations: 200, bend: Vec3::Z },
            &mut rotations,
            &mut posed,
        );
        assert!((end_of(&chain, &rotations).distance(goal) - outcome.distance).abs() < 1e-4);
        assert!(outcome.distance <= before + 1e-3, "case {case}: from {before} to {}", outcome.distance);
        reached += usize::from(outcome.distance <= 1e-3);
        for (joint, local) in joints.iter().zip(&rotations) {
            let relative = joint.rest.inverse() * *local;
            match joint.limit {
                JointLimit::Free => {}
                JointLimit::Cone { axis, swing, twist_min, twist_max } => {
                    let (swung, _) = swing_twist(relative, axis);
                    assert!(angle(swung, Quat::IDENTITY) <= swing + 1e-4);
                    let twist = twist_angle(relative, axis);
                    assert!(twist >= twist_min - 1e-4 && twist <= twist_max + 1e-4, "twist {twist}");
                }
                JointLimit::Euler { order, bounds } => {
                    assert!(angle(bounds.clamp_rotation(relative, order), relative) < 1e-3);
                }
            }
        }
    }
    // The descent can end in a corner of its limits; most do not.
    println!("CCD reached {reached} of {cases} reachable goals within random limits");
    assert!(reached * 10 >= cases * 6, "{reached} of {cases}");
}

#[test]
fn ccd_without_limits_reaches() {
    let mut random = Random(2);
    for case in 0..200 {
        let count = 2 + case % 8;
        let joint = CcdJoint { offset: Vec3::Y, rest: Quat::IDENTITY, limit: JointLimit::Free };
        let joints = vec![joint; count];
        let chain = CcdChain { joints: &joints, end: Vec3::Y, position: random.point(), rotation: random.rotation() };
        let root = chain.position + chain.rotation * Vec3::Y;
        let goal = root + random.direction() * random.between(0.1, 0.9) * count as f32;
        let mut rotations: Vec<Quat> = (0..count).map(|_| random.rotation()).collect();
        let mut posed = vec![(Vec3::ZERO, Quat::IDENTITY); count];
        let outcome = ccd(&chain, goal, &HARD_WORK, &mut rotations, &mut posed);
        assert!(outcome.distance <= HARD_WORK.tolerance, "case {case}, {count} joints: {outcome:?}");
        assert!(end_of(&chain, &rotations).distance(goal) < 2e-4);
    }
}

#[test]
fn splines_begin_and_end_on_their_points_and_are_measured() {
    let mut random = Random(9);
    for kind in [SplineKind::Through, SplineKind::Near] {
        for count in 2..8 {
            let points: Vec<Vec3> = (0..count).map(|i| Vec3::Y * i as f32 + random.point() * 0.4).collect();
            let spline = Spline { kind, points: &points };
            assert!(spline.point(0.0).distance(points[0]) < 1e-5);
            assert!(spline.point(1.0).distance(points[count - 1]) < 1e-5);
            if kind == SplineKind::Through {
                for (i, point) in points.iter().enumerate() {
                    assert!(spline.point(i as f32 / (count - 1) as f32).distance(*point) < 1e-4);
                }
            }
            let table = ArcTable::new(&spline);
            let steps = 20_000;
            let mut length = 0.0_f64;
            let mut before = spline.point(0.0);
            for i in 1..=steps {
                let t = i as f32 / steps as f32;
                let point = spline.point(t);
                length += f64::from(point.distance(before));
                before = point;
                if i % 500 == 0 {
                    let off = (f64::from(table.parameter(length as f32)) - f64::from(t)).abs();
                    assert!(off < 2e-3, "{kind:?}, {count} points: parameter {t} off by {off}");
                }
            }
            let off = (f64::from(table.length()) - length).abs() / length;
            assert!(off < 1e-3, "{kind:?}, {count} points: length off by {off}");
            // The derivative is that of the curve.
            for i in 1..50 {
                let t = i as f32 / 50.0 - 0.005;
                let slope = (spline.point(t + 1e-3) - spline.point(t - 1e-3)) / 2e-3;
                assert!(slope.distance(spline.derivative(t)) < 0.05 * (1.0 + slope.length()), "{kind:?} at {t}");
            }
        }
    }
}

#[test]
fn spline_ik_keeps_lengths_or_shares_the_curve() {
    let controls = [
        Vec3::ZERO,
        Vec3::new(0.5, 1.0, 0.2),
        Vec3::new(-0.3, 2.0, 0.6),
        Vec3::new(0.4, 3.0, -0.2),
        Vec3::new(0.0, 4.0, 0.3),
    ];
    for kind in [SplineKind::Through, SplineKind::Near] {
        let spline = Spline { kind, points: &controls };
        let table = ArcTable::new(&spline);
        for total in [0.5, 1.0, 1.3] {
            let lengths: Vec<f32> = [1.0, 2.0, 1.5, 0.5, 1.0, 1.0].map(|l| l / 7.0 * total * table.length()).to_vec();
            let mut positions = vec![Vec3::ZERO; 7];
            let mut rotations = vec![Quat::IDENTITY; 7];
            let mut ik = SplineIk { up: Vec3::Z, ..SplineIk::default() };
            ik.solve(&spline, &table, &lengths, &mut positions, &mut rotations);
            for i in 0..6 {
                let bone = positions[i + 1] - positions[i];
                assert!((bone.length() - lengths[i]).abs() < 1e-5, "bone {i}: {} of {}", bone.length(), lengths[i]);
                assert!((rotations[i] * Vec3::Y).dot(bone.normalize()) > 0.9999);
            }
            if total < 1.0 {
                for position in &positions {
                    let near = (0..2000).map(|i| spline.point(i as f32 / 2000.0).distance(*position));
                    assert!(near.fold(f32::MAX, f32::min) < 5e-3, "{position} is off the curve");
                }
            }
            ik.stretch = 1.0;
            ik.solve(&spline, &table, &lengths, &mut positions, &mut rotations);
            assert!(positions[0].distance(controls[0]) < 1e-5);
            assert!(positions[6].distance(controls[4]) < 1e-4, "{}", positions[6]);
            // Twist is shared by length and turns about the bones.
            let plain = rotations.clone();
            (ik.twist_start, ik.twist_end) = (0.3, 0.3 + 1.4);
            ik.solve(&spline, &table, &lengths, &mut positions, &mut rotations);
            let mut along = 0.0;
            for i in 0..7 {
                let twist = twist_angle(plain[i].inverse() * rotations[i], Vec3::Y);
                let wanted = 0.3 + 1.4 * along / lengths.iter().sum::<f32>();
                assert!((twist - wanted).abs() < 1e-3, "joint {i}: {twist} for {wanted}");
                along += lengths.get(i).copied().unwrap_or(0.0);
            }
        }
    }
}

#[test]
fn spline_frames_do_not_flip() {
    // A curve that goes through every direction of a half circle and past the up direction.
    let controls: Vec<Vec3> =
        (0..9).map(|i| (i as f32 / 8.0 * std::f32::consts::PI).sin_cos()).map(|(s, c)| Vec3::new(0.0, s, c)).collect();
    let spline = Spline { kind: SplineKind::Near, points: &controls };
    let table = ArcTable::new(&spline);
    let lengths = vec![table.length() / 40.0; 39];
    let mut positions = vec![Vec3::ZERO; 40];
    let mut rotations = vec![Quat::IDENTITY; 40];
    SplineIk { up: Vec3::Y, ..SplineIk::default() }.solve(&spline, &table, &lengths, &mut positions, &mut rotations);
    for pair in rotations.windows(2) {
        assert!(angle(pair[0], pair[1]) < 0.15);
    }
}

#[test]
fn chains_answer_anything_with_numbers() {
    let mut random = Random(10);
    let hard = |random: &mut Random| {
        let mut one = || {
            let hard = HARD[(random.unit() * 8.999) as usize];
            if random.unit() < 0.6 { random.between(-1.0, 1.0) } else { hard }
        };
        Vec3::new(one(), one(), one())
    };
    for case in 0..3000 {
        let count = case % 6;
        // Points must be numbers for the answer to be; goals and all else may be anything.
        let size = [0.0, 1.0, 1e-20, 1e15][case % 4];
        let mut points: Vec<Vec3> = (0..count).map(|_| random.point() * size).collect();
        let lengths: Vec<f32> = points.windows(2).map(|pair| pair[0].distance(pair[1])).collect();
        let settings = IterationSettings { bend: hard(&mut random), ..IterationSettings::default() };
        let goal = if case % 5 == 0 { points.first().copied().unwrap_or(Vec3::ZERO) } else { hard(&mut random) };
        let before = points.clone();
        fabrik(&mut points, &lengths, goal, &settings);
        assert!(points.iter().all(|point| point.is_finite()), "{before:?} to {goal}: {points:?}");
        let mut rotations = vec![Quat::IDENTITY; count];
        rotations_from_points(&before, &points, &mut rotations);
        assert!(rotations.iter().all(|rotation| is_unit(*rotation)));

        let joints: Vec<CcdJoint> = before
            .iter()
            .map(|point| CcdJoint {
                offset: *point,
                rest: random.rotation(),
                limit: JointLimit::Cone { axis: hard(&mut random), swing: 1.0, twist_min: -1.0, twist_max: f32::NAN },
            })
            .collect();
        let chain = CcdChain { joints: &joints, end: Vec3::ZERO, position: Vec3::ZERO, rotation: Quat::IDENTITY };
        let mut posed = vec![(Vec3::ZERO, Quat::IDENTITY); count];
        ccd(&chain, goal, &settings, &mut rotations, &mut posed);
        assert!(rotations.iter().all(|rotation| is_unit(*rotation)), "{chain:?} to {goal}: {rotations:?}");

        let spline = Spline { kind: SplineKind::Through, points: &before };
        let table = ArcTable::new(&spline);
        let ik = SplineIk {
            up: hard(&mut random),
            axis: hard(&mut random),
            stretch: HARD[case % 9],
            twist_end: HARD[case / 9 % 9],
            ..SplineIk::default()
        };
        let mut positions = vec![Vec3::ZERO; 4];
        let mut rotations = vec![Quat::IDENTITY; 4];
        ik.solve(&spline, &table, &[1.0, 0.0, f32::NAN], &mut positions, &mut rotations);
        assert!(positions.iter().all(|position| position.is_finite()), "{before:?}, {ik:?}: {positions:?}");
        assert!(rotations.iter().all(|rotation| is_unit(*rotation)), "{before:?}, {ik:?}: {rotations:?}");
    }
}
