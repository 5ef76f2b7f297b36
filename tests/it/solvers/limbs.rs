//! Two-bone limbs.

use bevy::math::{Quat, Vec3};
use rigsmith::solve::two_bone::{TwoBone, TwoBoneSolution};

use super::{HARD, Random, angle, is_unit};

fn limb(root: Vec3, mid: Vec3, end: Vec3) -> TwoBone {
    TwoBone {
        root,
        mid,
        end,
        root_rotation: Quat::IDENTITY,
        mid_rotation: Quat::IDENTITY,
        goal: end,
        pole: None,
        preferred: Vec3::Z,
        soft: 0.0,
        stretch: 0.0,
        max_stretch: f32::INFINITY,
        pin: 0.0,
    }
}

/// Middle and end as they come out by turning the posed bones with their joints.
fn turned(limb: &TwoBone, solved: &TwoBoneSolution) -> [Vec3; 2] {
    let upper = solved.root_rotation * limb.root_rotation.inverse() * (limb.mid - limb.root);
    let lower = solved.mid_rotation * limb.mid_rotation.inverse() * (limb.end - limb.mid);
    let mid = limb.root + upper * solved.stretch;
    [mid, mid + lower * solved.stretch]
}

#[test]
fn two_bone_reaches_every_goal_within_reach() {
    let mut random = Random(1);
    let mut worst = 0.0_f32;
    for case in 0..300 {
        let scale = 10_f32.powf(random.between(-3.0, 3.0));
        let root = random.point() * scale;
        let (a, b) = (random.between(0.3, 1.0) * scale, random.between(0.3, 1.0) * scale);
        let b = if case % 3 == 0 { a } else { b };
        let first = random.direction();
        // Straight, folded and bent limbs.
        let second = match case % 5 {
            0 => first,
            1 => -first,
            _ => random.direction(),
        };
        let mut limb = limb(root, root + first * a, root + first * a + second * b);
        (limb.root_rotation, limb.mid_rotation) = (random.rotation(), random.rotation());
        limb.preferred = random.direction();
        let (a, b) = (limb.mid.distance(root), limb.end.distance(limb.mid));
        let (near, far) = ((a - b).abs(), a + b);
        for step in 0..=200 {
            // Dense where it is hard: almost folded and almost straight.
            let t = step as f32 / 200.0;
            let t = t * t * (3.0 - 2.0 * t);
            limb.goal = root + random.direction() * (near + (far - near) * t);
            limb.pole = (step % 2 == 0).then(|| root + random.direction() * scale);
            let solved = limb.solve();
            let [mid, end] = turned(&limb, &solved);
            // A rounded goal may lie a hair outside of reach.
            let miss = end.distance(limb.goal) / far;
            worst = worst.max(miss);
            assert!(miss <= 1e-5, "case {case} step {step}: missed by {miss} of the length");
            assert!(mid.distance(solved.mid) <= 1e-5 * far && end.distance(solved.end) <= 1e-5 * far);
            assert_eq!(solved.stretch, 1.0);
        }
    }
    println!("two-bone misses by at most {worst:e} of the limb's length");
}

#[test]
fn two_bone_bends_towards_its_pole_or_as_it_was_posed() {
    let mut random = Random(2);
    for _ in 0..500 {
        let root = random.point();
        let mut limb = limb(root, root + random.direction(), Vec3::ZERO);
        limb.end = limb.mid + random.direction() * 0.8;
        limb.goal = root + random.direction() * random.between(0.4, 1.7);
        let pole = root + random.direction() * 3.0;
        limb.pole = Some(pole);
        let line = (limb.goal - root).normalize();
        let side = |v: Vec3| (v - line * v.dot(line)).normalize();
        if line.cross((pole - root).normalize()).length() > 0.1 {
            let bend = side(limb.solve().mid - root);
            assert!(bend.dot(side(pole - root)) > 0.9999, "{bend} against {}", side(pole - root));
        }
        // As it was: a goal on the posed end changes nothing, pole or preferred direction notwithstanding.
        limb.pole = None;
        limb.goal = limb.end;
        limb.preferred = random.direction();
        if (limb.mid - root).cross(limb.end - limb.mid).length() > 0.01 {
            let solved = limb.solve();
            assert!(angle(solved.root_rotation, limb.root_rotation) < 1e-3, "{solved:?}");
            assert!(angle(solved.mid_rotation, limb.mid_rotation) < 1e-3);
        }
    }
}

#[test]
fn a_straight_limb_bends_towards_its_preferred_side() {
    for preferred in [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::new(1.0, 5.0, 1.0)] {
        let mut leg = limb(Vec3::ZERO, Vec3::NEG_Y, Vec3::NEG_Y * 2.0);
        leg.preferred = preferred;
        leg.goal = Vec3::new(0.0, -1.5, 0.0);
        let knee = leg.solve().mid;
        let side = (preferred * Vec3::new(1.0, 0.0, 1.0)).normalize();
        assert!(knee.dot(side) > 0.6, "knee at {knee} for {preferred}");
        // A knee is a hinge: the bend axis of both bones stays put.
        let axis = Vec3::NEG_Y.cross(side);
        let solved = leg.solve();
        for rotation in [solved.root_rotation, solved.mid_rotation] {
            assert!((rotation * axis).dot(axis) > 0.9999, "{rotation}");
        }
    }
    let mut leg = limb(Vec3::ZERO, Vec3::NEG_Y, Vec3::NEG_Y * 2.0);
    leg.preferred = Vec3::ZERO;
    leg.goal = Vec3::new(0.0, -1.5, 0.0);
    assert!((leg.solve().end - leg.goal).length() < 1e-5);
}

/// Rotations and positions along goals that leave reach in small steps.
fn sweep(limb: &TwoBone, steps: usize) -> Vec<TwoBoneSolution> {
    let way = Vec3::new(0.6, -0.7, 0.3).normalize();
    let mut limb = *limb;
    (0..=steps)
        .map(|i| {
            limb.goal = limb.root + way * (1.2 + 1.6 * i as f32 / steps as f32);
            limb.solve()
        })
        .collect()
}

#[test]
fn two_bone_is_continuous_at_full_stretch() {
    let mut arm = limb(Vec3::ZERO, Vec3::new(1.0, 0.0, -0.1), Vec3::new(2.0, 0.0, 0.0));
    arm.pole = Some(Vec3::new(0.0, 0.0, -3.0));
    for (soft, stretch) in [(0.0, 0.0), (0.0, 1.0), (0.1, 0.0), (0.3, 0.5), (0.2, 1.0), (1.0, 0.0)] {
        (arm.soft, arm.stretch) = (soft, stretch);
        let mut largest = Vec::new();
        for steps in [1000, 4000, 16000] {
            let path = sweep(&arm, steps);
            let leap = path.windows(2).map(|pair| {
                let [a, b] = [pair[0], pair[1]];
                angle(a.root_rotation, b.root_rotation)
                    .max(angle(a.mid_rotation, b.mid_rotation))
                    .max(a.end.distance(b.end))
            });
            largest.push(leap.fold(0.0, f32::max));
        }
        // Without softness the elbow's angle goes with the root of the distance that is left, so steps of a 16th shrink
        // the leap to about a quarter (the last step is a part of one); with it, to about a 16th.
        let shrink = if soft == 0.0 { 0.45 } else { 0.12 };
        let [first, .., last] = largest[..] else { unreachable!() };
        assert!(last <= shrink * first + 2e-4, "soft {soft}, stretch {stretch}: leaps {largest:?}");
        if soft > 0.0 {
            // No pop: nowhere more than a few radians a unit of the goal's way.
            assert!(largest[0] < 8.0 * 1.6 / 1000.0, "soft {soft}: {largest:?}");
        }
    }
}

#[test]
fn a_limb_without_pole_follows_its_goal_without_a_pop() {
    let mut random = Random(4);
    for _ in 0..40 {
        let mut limb = limb(Vec3::ZERO, random.direction(), Vec3::ZERO);
        limb.end = limb.mid + random.direction() * 0.7;
        let line = limb.end.normalize();
        // Any way that keeps off the direction opposite to the posed limb.
        let (a, b) = (random.direction(), random.direction());
        let goal = |t: f32| {
            let way = (line + 0.8 * (a * (6.0 * t).sin() + b * (9.0 * t).cos())).normalize_or(line);
            way * (1.0 + 0.6 * (5.0 * t).sin())
        };
        let mut before: Option<TwoBoneSolution> = None;
        for i in 0..4000 {
            let t = i as f32 / 4000.0;
            limb.goal = goal(t);
            let now = limb.solve();
            assert_eq!(now, limb.solve(), "the same input gives another answer");
            if line.dot(limb.goal.normalize()) < -0.9 {
                before = None;
                continue;
            }
            if let Some(before) = before {
                let leap = angle(before.root_rotation, now.root_rotation);
                let leap = leap.max(angle(before.mid_rotation, now.mid_rotation));
                // The reach ends at 1.7, where the elbow straightens with a root.
                assert!(leap < 0.1, "a leap of {leap} at {t}");
            }
            before = Some(now);
        }
    }
}

#[test]
fn softness_is_smooth_and_stretch_makes_up_for_it() {
    let mut arm = limb(Vec3::ZERO, Vec3::new(1.0, 0.0, -0.1), Vec3::new(2.0, 0.0, 0.0));
    let length = 2.0 * arm.mid.length();
    let reach = |arm: &TwoBone, distance: f32| {
        let mut arm = *arm;
        arm.goal = Vec3::X * distance;
        arm.solve()
    };
    arm.soft = 0.2;
    // Equal until softness sets in, then less, never all; the slope has no leap.
    let start = 0.8 * length;
    assert!((reach(&arm, start).end.x - start).abs() < 1e-5);
    let slope = |at: f32| (reach(&arm, at + 5e-3).end.x - reach(&arm, at - 5e-3).end.x) / 1e-2;
    assert!((slope(start - 0.02) - 1.0).abs() < 0.01);
    assert!((slope(start + 0.02) - 1.0).abs() < 0.08, "{}", slope(start + 0.02));
    let far = reach(&arm, 3.0 * length).end.x;
    assert!(far < length && far > 0.99 * length, "{far}");
    // With stretch the end is on the goal at any distance, up to the greatest factor.
    arm.stretch = 1.0;
    for i in 1..100 {
        let distance = 0.05 * i as f32;
        let solved = reach(&arm, distance);
        assert!((solved.end - Vec3::X * distance).length() < 1e-5 * length.max(distance), "{distance}: {solved:?}");
    }
    arm.max_stretch = 1.25;
    let solved = reach(&arm, 10.0 * length);
    assert!((solved.end.x - 1.25 * length).abs() < 1e-3 && solved.stretch == 1.25);
    arm.stretch = 0.5;
    arm.soft = 0.0;
    arm.max_stretch = f32::INFINITY;
    assert!((reach(&arm, 2.0 * length).stretch - 1.5).abs() < 1e-5);
}

#[test]
fn two_bone_answers_anything_with_numbers() {
    let mut random = Random(3);
    for i in 0..20_000 {
        let pick = |random: &mut Random| {
            let hard = HARD[(random.unit() * 8.999) as usize];
            if random.unit() < 0.5 { random.between(-1.0, 1.0) } else { hard }
        };
        let point = |random: &mut Random| Vec3::new(pick(random), pick(random), pick(random));
        let root = if i % 2 == 0 { Vec3::ZERO } else { point(&mut random) };
        let limb = TwoBone {
            root,
            mid: point(&mut random),
            end: point(&mut random),
            root_rotation: random.rotation(),
            mid_rotation: random.rotation(),
            goal: if i % 3 == 0 { root } else { point(&mut random) },
            pole: (i % 5 == 0).then(|| point(&mut random)),
            preferred: point(&mut random),
            soft: HARD[i % 9],
            stretch: HARD[i / 9 % 9],
            max_stretch: HARD[i / 81 % 9],
            pin: HARD[i / 729 % 9],
        };
        let solved = limb.solve();
        assert!(is_unit(solved.root_rotation) && is_unit(solved.mid_rotation), "{limb:?}: {solved:?}");
        assert!(solved.mid.is_finite() && solved.end.is_finite(), "{limb:?}: {solved:?}");
        assert!(solved.stretch >= 1.0 && solved.stretch.is_finite(), "{limb:?}: {solved:?}");
    }
}
