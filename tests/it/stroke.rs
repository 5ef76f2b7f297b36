//! Strokes: where a chain's joints go, and what a stroke over a rig means.

use glam::{Vec2, Vec3};
use rigsmith::{
    algo::{
        placement::PlaceSettings,
        stroke::{
            ChainChoice, MAX_JOINTS, StrokeChain, StrokeError, StrokeKind, StrokeNote, StrokeSettings, classify,
            stroke_chain,
        },
        view::{View, ViewPlane},
    },
    mesh::surface::Surface,
};

/// A closed tube of 24 sides around a polyline, rings every few hundredths.
fn tube(line: &[Vec3], radius: f32, points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) {
    const SIDES: u32 = 24;
    let mut rings = Vec::new();
    for w in line.windows(2) {
        rings.extend((0..30).map(|i| w[0].lerp(w[1], i as f32 / 30.0)));
    }
    rings.push(line[line.len() - 1]);
    let first = points.len() as u32;
    let mut u = (line[1] - line[0]).any_orthonormal_vector();
    for i in 0..rings.len() {
        let along = (rings[(i + 1).min(rings.len() - 1)] - rings[i.saturating_sub(1)]).normalize();
        // Carried on from ring to ring, so that the tube does not twist.
        u = u.reject_from_normalized(along).normalize();
        let v = along.cross(u);
        points.extend((0..SIDES).map(|k| {
            let angle = std::f32::consts::TAU * k as f32 / SIDES as f32;
            rings[i] + radius * (u * angle.cos() + v * angle.sin())
        }));
    }
    for i in 0..rings.len() as u32 - 1 {
        for k in 0..SIDES {
            let (a, b) = (first + i * SIDES + k, first + i * SIDES + (k + 1) % SIDES);
            triangles.extend([[a, b, b + SIDES], [a, b + SIDES, a + SIDES]]);
        }
    }
    let last = first + (rings.len() as u32 - 1) * SIDES;
    for k in 1..SIDES - 1 {
        triangles.extend([[first, first + k + 1, first + k], [last, last + k, last + k + 1]]);
    }
}

fn tubes(lines: &[(&[Vec3], f32)]) -> Surface {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for (line, radius) in lines {
        tube(line, *radius, &mut points, &mut triangles);
    }
    Surface::build(&points, &triangles)
}

fn plane(surface: &Surface, view: View) -> ViewPlane {
    let (low, high) = surface.bounds().expect("not empty");
    ViewPlane::orthographic(view, [low, high])
}

fn dense(corners: &[Vec2], count: usize) -> Vec<Vec2> {
    let mut points = Vec::new();
    for w in corners.windows(2) {
        points.extend((0..count).map(|i| w[0].lerp(w[1], i as f32 / count as f32)));
    }
    points.push(corners[corners.len() - 1]);
    points
}

/// A slab so large that no section closes and nothing is recentred away.
fn slab() -> Surface {
    tubes(&[(&[Vec3::new(0.0, 0.0, -0.1), Vec3::new(0.0, 0.0, 0.1)], 20.0)])
}

fn chain(surface: &Surface, view: View, stroke: &[Vec2], settings: StrokeSettings, choice: ChainChoice) -> StrokeChain {
    stroke_chain(surface, &plane(surface, view), stroke, settings, choice).expect("a chain")
}

const RAW: StrokeSettings = StrokeSettings { place: PlaceSettings { depth: 0.5, volume: None }, recentre: false };

#[test]
fn thresholds_split_on_either_side() {
    let surface = slab();
    let check = |corners: &[(f32, f32)], threshold: f32, expected: &[(f32, f32)]| {
        let corners: Vec<Vec2> = corners.iter().map(|&(x, y)| Vec2::new(x, y)).collect();
        let chain = chain(&surface, View::Front, &dense(&corners, 20), RAW, ChainChoice::Threshold(threshold));
        let found: Vec<(f32, f32)> = chain
            .joints
            .iter()
            .map(|j| ((j.position.x * 1e3).round() / 1e3, (j.position.y * 1e3).round() / 1e3))
            .collect();
        assert_eq!(found, expected, "{corners:?} {threshold}");
        assert!(chain.joints.iter().all(|j| j.position.z.abs() < 1e-4 && j.hits == 2), "midway between the hits");
    };
    let bend = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)];
    check(&[(0.0, 0.0), (4.0, 0.0)], 0.1, &[(0.0, 0.0), (4.0, 0.0)]);
    check(&bend, 0.1, &bend);
    check(&bend, 1.5, &[(0.0, 0.0), (2.0, 0.0)]);
    // One on either side of the line between the ends, found at once.
    let wave = [(0.0, 0.0), (1.0, 1.0), (3.0, -1.0), (4.0, 0.0)];
    check(&wave, 0.5, &wave);
    // Beyond an end of the line, in line with it.
    check(&[(0.0, 0.0), (5.0, 0.0), (3.0, 0.0)], 0.5, &[(0.0, 0.0), (5.0, 0.0), (3.0, 0.0)]);
    let closed = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)];
    check(&closed, 0.5, &closed);
}

#[test]
fn no_point_stays_further_than_the_threshold() {
    let surface = slab();
    let stroke: Vec<Vec2> =
        (0..400).map(|i| i as f32 * 0.02).map(|t| Vec2::new(t, (t * 1.7).sin() + 0.3 * (t * 9.0).cos())).collect();
    let mut before = usize::MAX;
    for threshold in [0.05, 0.2, 0.5, 2.0] {
        let joints: Vec<Vec2> = chain(&surface, View::Front, &stroke, RAW, ChainChoice::Threshold(threshold))
            .joints
            .iter()
            .map(|j| j.source)
            .collect();
        let far = |p: Vec2| {
            joints
                .windows(2)
                .map(|w| {
                    let t = ((p - w[0]).dot(w[1] - w[0]) / (w[1] - w[0]).length_squared()).clamp(0.0, 1.0);
                    p.distance(w[0].lerp(w[1], t))
                })
                .fold(f32::INFINITY, f32::min)
        };
        assert!(stroke.iter().all(|&p| far(p) <= threshold * 1.001), "{threshold}");
        assert!(joints.len() < before, "a larger threshold makes fewer joints");
        before = joints.len();
    }
}

/// Tens of thousands of points, each of them a bend, make as many joints as a stroke may have, the largest bend among them.
#[test]
fn a_stroke_of_very_many_bends_has_so_many_joints() {
    let surface = slab();
    let point = |i: usize| {
        let height = if i == 10_001 { 0.5 } else { 0.001 * (i % 2) as f32 };
        Vec2::new(i as f32 * 5e-5, height)
    };
    let stroke: Vec<Vec2> = (0..20_000).map(point).collect();
    for threshold in [0.0, f32::NAN] {
        let joints = chain(&surface, View::Front, &stroke, RAW, ChainChoice::Threshold(threshold)).joints;
        assert!((900..=MAX_JOINTS).contains(&joints.len()), "{} joints", joints.len());
        let nearest = joints.iter().map(|joint| joint.source.distance(stroke[10_001])).fold(f32::INFINITY, f32::min);
        assert!(nearest < 1e-3, "{nearest}");
    }
}

#[test]
fn poor_strokes_are_cleaned_or_refused() {
    let surface = slab();
    let view = plane(&surface, View::Front);
    let (nan, a, b) = (Vec2::NAN, Vec2::ZERO, Vec2::X);
    let check = |points: &[Vec2], expected: Result<usize, StrokeError>| {
        let found = stroke_chain(&surface, &view, points, RAW, ChainChoice::Threshold(0.1)).map(|c| c.joints.len());
        assert_eq!(found, expected, "{points:?}");
    };
    check(&[], Err(StrokeError::TooShort { given: 0, finite: 0 }));
    check(&[a], Err(StrokeError::TooShort { given: 1, finite: 1 }));
    check(&[a, a, nan, a], Err(StrokeError::TooShort { given: 4, finite: 1 }));
    check(&[nan, nan], Err(StrokeError::TooShort { given: 2, finite: 0 }));
    check(&[a, b], Ok(2));
    check(&[nan, a, a, nan, Vec2::INFINITY, b, b, nan], Ok(2));
    check(&[a + 100.0, b + 100.0], Err(StrokeError::Misses));
    let empty = stroke_chain(&Surface::default(), &view, &[a, b], RAW, ChainChoice::Joints(3));
    assert_eq!(empty, Err(StrokeError::Misses));
    let huge = stroke_chain(&surface, &view, &[Vec2::splat(-3e38), Vec2::splat(3e38)], RAW, ChainChoice::Joints(3));
    assert!(huge.is_err() || huge.is_ok_and(|c| c.joints.iter().all(|j| j.position.is_finite())));
}

const ARM: [Vec3; 2] = [Vec3::new(0.2, 1.4, 0.0), Vec3::new(0.6, 1.0, 0.2)];

#[test]
fn joints_are_as_many_as_wanted() {
    let surface = tubes(&[(&ARM, 0.04)]);
    let stroke = dense(&[ARM[0].lerp(ARM[1], 0.1).truncate(), ARM[0].lerp(ARM[1], 0.9).truncate()], 50);
    for (wanted, expected) in [(0, 2), (1, 2), (2, 2), (3, 3), (4, 4), (7, 7), (20, 20), (60, 60)] {
        let joints =
            chain(&surface, View::Front, &stroke, StrokeSettings::default(), ChainChoice::Joints(wanted)).joints;
        assert_eq!(joints.len(), expected);
        let along: Vec<f32> = joints.iter().map(|j| (j.position - ARM[0]).dot((ARM[1] - ARM[0]).normalize())).collect();
        assert!(along.windows(2).all(|w| w[0] < w[1]), "in the stroke's order");
        // A straight limb is cut into even pieces.
        let even = (along[expected - 1] - along[0]) / (expected - 1) as f32;
        assert!(along.windows(2).all(|w| (w[1] - w[0] - even).abs() < 0.3 * even), "{wanted}: {along:?}");
    }
}

#[test]
fn recentring_finds_the_axis() {
    for scale in [1.0, 1e-3, 1e3] {
        let arm = ARM.map(|p| p * scale);
        let surface = tubes(&[(&arm, 0.04 * scale)]);
        for view in [View::Front, View::Left, View::Top, View::Orbit(30.0, 20.0)] {
            let view_plane = plane(&surface, view);
            let seen = [0.15, 0.85].map(|t| view_plane.project(arm[0].lerp(arm[1], t)).expect("seen"));
            let shift = (seen[1] - seen[0]).perp().normalize() * 0.012 * scale;
            let stroke = dense(&seen.map(|p| p + shift), 30);
            let far = |settings| {
                let joints = chain(&surface, view, &stroke, settings, ChainChoice::Joints(4)).joints;
                let axis = (arm[1] - arm[0]).normalize();
                joints.iter().map(|j| (j.position - arm[0]).reject_from_normalized(axis).length()).fold(0.0, f32::max)
                    / (0.04 * scale)
            };
            let (on, off) = (far(StrokeSettings::default()), far(RAW));
            assert!(on < 0.03 && off > 0.1, "{view:?} {scale}: {on} with, {off} without");
        }
    }
}

#[test]
fn a_chosen_depth_is_kept() {
    let surface = tubes(&[(&[Vec3::NEG_X, Vec3::X], 0.1)]);
    let stroke = dense(&[Vec2::new(-0.6, 0.04), Vec2::new(0.6, 0.04)], 30);
    for (depth, z) in [(0.0, 0.1), (0.25, 0.05), (1.0, -0.1)] {
        let settings = StrokeSettings { place: PlaceSettings { depth, volume: None }, recentre: true };
        for joint in chain(&surface, View::Front, &stroke, settings, ChainChoice::Joints(3)).joints {
            assert!(
                (joint.position.z - z).abs() < 3e-3 && joint.position.y.abs() < 3e-3,
                "{depth}: {}",
                joint.position
            );
        }
    }
}

#[test]
fn strokes_stay_in_their_volume() {
    // Seen from the left: two legs under a wide pelvis, one behind the other.
    let legs = |x: f32| [Vec3::new(x, 1.0, 0.0), Vec3::new(x, 0.0, 0.0)];
    let surface = tubes(&[
        (&legs(0.15), 0.08),
        (&legs(-0.15), 0.08),
        (&[Vec3::new(-0.25, 1.1, 0.0), Vec3::new(0.25, 1.1, 0.0)], 0.16),
    ]);
    let check = |stroke: [Vec2; 2], volume: Option<u32>, x: f32| {
        let settings = StrokeSettings { place: PlaceSettings { depth: 0.5, volume }, recentre: true };
        let chain = chain(&surface, View::Left, &dense(&stroke, 40), settings, ChainChoice::Joints(4));
        for joint in &chain.joints[1..3] {
            assert!((joint.position.x - x).abs() < 0.01, "{stroke:?} {volume:?}: {}", joint.position);
        }
        chain.notes
    };
    let (down, up) = ([Vec2::new(0.02, 0.8), Vec2::new(-0.02, 0.1)], [Vec2::new(0.0, 0.1), Vec2::new(0.0, 0.8)]);
    assert_eq!(check(down, None, 0.15), [StrokeNote::VolumeChosen { volume: 1, of: 2 }]);
    check(up, None, 0.15);
    check(up, Some(1), 0.15);
    check(up, Some(2), -0.15);
    check(up, Some(3), 0.15);
    // From inside the pelvis, where there is one volume, down a leg.
    check([Vec2::new(0.0, 1.1), Vec2::new(0.0, 0.1)], None, 0.15);
    check([Vec2::new(0.0, 1.1), Vec2::new(0.0, 0.1)], Some(2), -0.15);
}

#[test]
fn the_torso_between_two_arms() {
    let column = |x: f32| [Vec3::new(x, 0.0, 0.0), Vec3::new(x, 1.0, 0.0)];
    let surface = tubes(&[(&column(0.4), 0.05), (&column(0.0), 0.2), (&column(-0.4), 0.05)]);
    let stroke = dense(&[Vec2::new(0.0, 0.2), Vec2::new(0.0, 0.8)], 30);
    for (volume, x) in [(None, 0.0), (Some(1), 0.4), (Some(2), 0.0), (Some(3), -0.4)] {
        let settings = StrokeSettings { place: PlaceSettings { depth: 0.5, volume }, recentre: true };
        for joint in chain(&surface, View::Left, &stroke, settings, ChainChoice::Threshold(0.1)).joints {
            assert!((joint.position.x - x).abs() < 0.01, "{volume:?}: {}", joint.position);
        }
    }
}

#[test]
fn ends_beside_the_mesh_move_onto_it() {
    let surface = tubes(&[(&[Vec3::NEG_X, Vec3::X], 0.1)]);
    let check = |from: f32, to: f32, choice: ChainChoice, notes: &[StrokeNote]| {
        let stroke = dense(&[Vec2::new(from, 0.01), Vec2::new(to, 0.01)], 100);
        let chain = chain(&surface, View::Front, &stroke, StrokeSettings::default(), choice);
        assert_eq!(chain.notes, notes);
        let x = |i: usize| chain.joints[i].position.x;
        let last = chain.joints.len() - 1;
        assert!((x(0) - from.max(-1.0)).abs() < 0.04 && (x(last) - to.min(1.0)).abs() < 0.04, "{} {}", x(0), x(last));
    };
    let (start, end) = (StrokeNote::EndMoved { start: true }, StrokeNote::EndMoved { start: false });
    for choice in [ChainChoice::Joints(3), ChainChoice::Threshold(0.1)] {
        check(-0.9, 0.9, choice, &[]);
        check(-1.2, 0.9, choice, &[start]);
        check(-0.9, 1.2, choice, &[end]);
        check(-1.2, 1.2, choice, &[start, end]);
    }
}

#[test]
fn the_corner_of_a_bent_limb() {
    // Bent in depth only: nothing of it shows in the stroke.
    for (bend, at) in [(0.15, 0.4), (0.3, 0.5), (0.3, 0.6)] {
        let line = [Vec3::ZERO, Vec3::new(at, 0.0, bend), Vec3::X];
        let surface = tubes(&[(&line, 0.05)]);
        let stroke = dense(&[Vec2::new(0.05, 0.01), Vec2::new(0.95, -0.01)], 50);
        let joints = chain(&surface, View::Front, &stroke, StrokeSettings::default(), ChainChoice::Joints(3)).joints;
        assert!((joints[1].position.x - at).abs() < 0.08, "{bend} {at}: {}", joints[1].position);
    }
}

#[test]
fn same_stroke_same_joints() {
    let surface = tubes(&[(&ARM, 0.04)]);
    let stroke = dense(&[ARM[0].truncate(), ARM[1].truncate()], 70);
    let run = || chain(&surface, View::Front, &stroke, StrokeSettings::default(), ChainChoice::Joints(5));
    assert_eq!(run(), run());
}

/// A rig to draw over: a spine up the middle and an arm to the right, 1 from 0, and so on.
fn rig() -> Vec<(Vec2, Option<usize>)> {
    vec![
        (Vec2::new(0.0, 0.0), None),
        (Vec2::new(0.0, 1.0), Some(0)),
        (Vec2::new(1.0, 1.0), Some(1)),
        (Vec2::new(2.0, 1.0), Some(2)),
    ]
}

#[test]
fn what_a_stroke_means() {
    let chain = |start, end| StrokeKind::Chain { start, end };
    let check = |what: &str, corners: &[(f32, f32)], expected: StrokeKind| {
        let corners: Vec<Vec2> = corners.iter().map(|&(x, y)| Vec2::new(x, y)).collect();
        let found = classify(&dense(&corners, 15), &rig(), 0.05);
        match (&found, &expected) {
            (StrokeKind::Insert { bone, t }, StrokeKind::Insert { bone: b, t: u }) => {
                assert!(bone == b && (t - u).abs() < 1e-3, "{what}: {found:?}");
            }
            _ => assert_eq!(found, expected, "{what}"),
        }
    };
    check("a chain beside the rig", &[(3.0, 0.0), (3.0, 1.0)], chain(None, None));
    check("from a joint on", &[(2.02, 1.02), (3.0, 1.0)], chain(Some(3), None));
    check("onto a joint", &[(1.0, -1.0), (0.02, 0.02)], chain(None, Some(0)));
    check("from joint to joint", &[(0.0, 0.0), (1.0, 0.5), (1.0, 1.0)], chain(Some(0), Some(2)));
    check("back to where it started", &[(0.0, 0.0), (1.0, 0.5), (0.0, 0.01)], chain(Some(0), None));
    check("a tick across the upper arm", &[(0.4, 1.2), (0.4, 0.8)], StrokeKind::Insert { bone: 2, t: 0.4 });
    check("a tick the other way, slanted", &[(0.5, 0.7), (0.7, 1.3)], StrokeKind::Insert { bone: 2, t: 0.6 });
    check("a tick across the spine", &[(-0.2, 0.5), (0.3, 0.5)], StrokeKind::Insert { bone: 1, t: 0.5 });
    check("longer than the bone", &[(0.4, 2.0), (0.4, 0.2)], chain(None, None));
    check("too flat", &[(0.2, 1.1), (0.8, 0.9)], chain(None, None));
    check("too near a joint", &[(0.05, 1.2), (0.05, 0.8)], chain(None, None));
    check("bent", &[(0.3, 1.2), (0.5, 1.0), (0.3, 0.8)], chain(None, None));
    check("across two bones", &[(-0.2, 0.6), (0.5, 1.2)], chain(None, None));
    check("from a joint across a bone", &[(0.0, 0.0), (0.5, 1.3)], chain(Some(0), None));
    check("along a bone", &[(0.1, 1.01), (0.9, 1.01)], chain(None, None));
    let zigzag = [(0.8, 0.8), (1.2, 0.9), (0.8, 1.0), (1.2, 1.1), (0.8, 1.2), (1.2, 1.2)];
    check("a scribble over the elbow", &zigzag, StrokeKind::Erase { joints: vec![2] });
    let wide = [(0.9, 0.8), (2.1, 0.9), (0.9, 1.0), (2.1, 1.1), (0.9, 1.2), (2.1, 1.2)];
    check("a scribble over elbow and wrist", &wide, StrokeKind::Erase { joints: vec![2, 3] });
    let beside = zigzag.map(|(x, y)| (x + 4.0, y));
    check("a scribble over nothing", &beside, chain(None, None));
    check("there and back once", &[(0.8, 1.0), (1.2, 1.0), (0.8, 1.01)], chain(None, None));
    check("a wave over a joint", &[(0.5, 0.9), (0.8, 1.1), (1.2, 0.9), (1.5, 1.1)], chain(None, None));
}

#[test]
fn an_unsteady_hand_erases_nothing() {
    // Jitter of three tenths of a limb's radius along and across a stroke over a whole chain.
    let joints: Vec<(Vec2, Option<usize>)> =
        (0..5).map(|i| (Vec2::new(i as f32 * 0.1, 0.0), (i as usize).checked_sub(1))).collect();
    let mut state = 9_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    for _ in 0..200 {
        let stroke: Vec<Vec2> =
            (0..200).map(|i| Vec2::new(-0.05 + i as f32 * 0.0025 + 0.015 * random(), 0.015 * random())).collect();
        assert!(matches!(classify(&stroke, &joints, 0.01), StrokeKind::Chain { .. }));
    }
}

#[test]
fn odd_rigs_and_strokes_are_survived() {
    let odd = [(Vec2::NAN, Some(0)), (Vec2::ZERO, Some(99)), (Vec2::X, Some(2)), (Vec2::Y, Some(0))];
    for stroke in [vec![], vec![Vec2::NAN], vec![Vec2::ZERO], vec![Vec2::ZERO; 50], vec![Vec2::INFINITY, Vec2::ONE]] {
        for tolerance in [0.1, 0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(classify(&stroke, &odd, tolerance), StrokeKind::Chain { .. }), "{stroke:?} {tolerance}");
        }
    }
}

#[test]
fn elbows_of_real_bodies() {
    let Some(data) = crate::prerequisites::test_data() else { return };
    for body in ["female_young", "male_young"] {
        let folder = data.join("bodies").join(body);
        let text = std::fs::read_to_string(folder.join("body.obj")).expect("the body");
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.first() {
                Some(&"v") => points.push(Vec3::from_array([1, 2, 3].map(|i| words[i].parse().expect("a number")))),
                Some(&"f") => {
                    let corners: Vec<u32> = words[1..]
                        .iter()
                        .map(|w| w.split('/').next().and_then(|w| w.parse::<u32>().ok()).expect("an index") - 1)
                        .collect();
                    triangles.extend((1..corners.len() - 1).map(|k| [corners[0], corners[k], corners[k + 1]]));
                }
                _ => {}
            }
        }
        let joints: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(folder.join("joints.json")).expect("joints")).expect("JSON");
        let head = |bone: &str| {
            Vec3::from_array(
                [0, 1, 2].map(|i| joints["default163"][bone]["head"][i].as_f64().expect("a number") as f32),
            )
        };
        let surface = Surface::build(&points, &triangles);
        for side in ["L", "R"] {
            let [a, b, c] = ["upperarm01", "lowerarm01", "wrist"].map(|bone| head(&format!("{bone}.{side}")));
            for view in [View::Front, View::Orbit(20.0, 10.0)] {
                let view_plane = plane(&surface, view);
                let stroke = dense(&[a, b, c].map(|p| view_plane.project(p).expect("seen")), 30);
                let joints = chain(&surface, view, &stroke, StrokeSettings::default(), ChainChoice::Joints(3)).joints;
                let along = (joints[1].position - a).dot((c - a).normalize());
                let off = (along - (b - a).dot((c - a).normalize())) / a.distance(c);
                assert!(off.abs() < 0.08, "{body} {side} {view:?}: {off}");
            }
        }
    }
}
