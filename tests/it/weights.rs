//! Automatic skin weights: what holds of every result, and what bodies, damage, locks and bad input give.

mod attachments;
mod gear;
mod inputs;
mod layers;
mod pieces;
mod trunks;

use std::ops::Range;

use glam::Vec3;
use proptest::prelude::*;
use rigsmith::{
    algo::weights::{
        IdleJoint, IdleReason, Locks, Method, StiffPiece, TwistBone, WeightError, WeightJoint, WeightReport,
        WeightSettings, skin_weights,
    },
    mesh::model::Weights,
};

fn joint(head: [f32; 3], parent: Option<usize>) -> WeightJoint {
    WeightJoint { head: head.into(), parent, tail: None, deforms: true, twist: None, halves: None }
}

/// A tube along x from 0 to 4 with four sides and a cap at either end.
fn tube() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let rings = 41;
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for [y, z] in [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]] {
            points.push(Vec3::new(ring as f32 * 0.1, y, z));
        }
    }
    for ring in 0..rings - 1 {
        for side in 0..4 {
            let (a, b) = (ring * 4 + side, ring * 4 + (side + 1) % 4);
            triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
    let last = (rings - 1) * 4;
    triangles.extend([[0, 2, 1], [0, 3, 2], [last, last + 1, last + 2], [last, last + 2, last + 3]]);
    (points, triangles)
}

/// Two bones that meet in the middle of the tube.
fn tube_joints() -> Vec<WeightJoint> {
    vec![joint([0.1, 0.0, 0.0], None), joint([2.0, 0.0, 0.0], Some(0)), joint([3.8, 0.0, 0.0], Some(1))]
}

fn bind(points: &[Vec3], triangles: &[[u32; 3]], joints: &[WeightJoint]) -> (Weights, WeightReport) {
    skin_weights(points, triangles, joints, &[], None, &WeightSettings::default(), &|_| true).unwrap()
}

/// The weight of a joint at a point.
fn weight(weights: &Weights, point: usize, joint: u32) -> f32 {
    weights.of(point).find(|e| e.0 == joint).map_or(0.0, |e| e.1)
}

/// Demands on every result.
fn check_sound(weights: &Weights, points: usize, joints: &[WeightJoint], most: usize) {
    assert_eq!(weights.len(), points);
    let any = joints.iter().any(|j| j.deforms);
    for point in 0..points {
        let row: Vec<(u32, f32)> = weights.of(point).collect();
        assert!(!row.is_empty() && row.len() <= most, "point {point} has {} influences", row.len());
        assert!(row.iter().all(|e| e.1.is_finite() && e.1 > 0.0), "point {point}: {row:?}");
        assert!((row.iter().map(|e| e.1).sum::<f32>() - 1.0).abs() < 1e-5, "point {point}: {row:?}");
        assert!(row.windows(2).all(|w| w[0].1 >= w[1].1), "point {point} is not sorted: {row:?}");
        assert!(
            row.iter().all(|e| !any || joints[e.0 as usize].deforms),
            "point {point} hangs on a joint that must not deform"
        );
        let mut names: Vec<u32> = row.iter().map(|e| e.0).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), row.len(), "point {point} names a joint twice: {row:?}");
    }
}

#[test]
fn blends_across_a_joint_and_nowhere_else() {
    let (points, triangles) = tube();
    let joints = tube_joints();
    let (weights, report) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
    assert_eq!((report.by_surface, report.points), (points.len(), points.len()));
    for (x, low, high) in [(0.0, 0.99, 1.0), (1.0, 0.97, 1.0), (2.0, 0.35, 0.65), (3.0, 0.0, 0.03), (4.0, 0.0, 0.01)] {
        let ring = (x * 10.0) as usize * 4;
        for point in ring..ring + 4 {
            let w = weight(&weights, point, 0);
            assert!((low..=high).contains(&w), "at x = {x} the first joint has {w}, not {low} to {high}");
        }
    }
    let along: Vec<f32> = (0..41).map(|ring| weight(&weights, ring * 4, 0)).collect();
    assert!(along.windows(2).all(|w| w[0] >= w[1] - 1e-4), "the blend is not monotone: {along:?}");
}

#[test]
fn smoothing_widens_the_blend() {
    let (points, triangles) = tube();
    let width = |smoothing: f32| {
        let settings = WeightSettings { smoothing, ..WeightSettings::default() };
        let (weights, _) = skin_weights(&points, &triangles, &tube_joints(), &[], None, &settings, &|_| true).unwrap();
        (0..points.len()).map(|p| (weight(&weights, p, 0) * (1.0 - weight(&weights, p, 0))).min(0.25)).sum::<f32>()
    };
    assert!(width(0.25) < width(1.0) && width(1.0) < width(4.0));
}

#[test]
fn unit_scale_and_place_do_not_matter() {
    let (points, triangles) = tube();
    let joints = tube_joints();
    let (expected, _) = bind(&points, &triangles, &joints);
    for scale in [0.001, 1000.0, 1e-20, 1e20] {
        let moved: Vec<Vec3> = points.iter().map(|&p| p * scale).collect();
        let joints: Vec<WeightJoint> = joints.iter().map(|&j| WeightJoint { head: j.head * scale, ..j }).collect();
        let (weights, _) = bind(&moved, &triangles, &joints);
        for point in 0..points.len() {
            let (a, b) = (weight(&expected, point, 0), weight(&weights, point, 0));
            assert!((a - b).abs() < 0.01, "point {point} at scale {scale}: {a} became {b}");
        }
    }
}

#[test]
fn damage_changes_little() {
    let (points, triangles) = tube();
    let joints = tube_joints();
    let (expected, _) = bind(&points, &triangles, &joints);
    let unwelded: Vec<Vec3> = triangles.iter().flatten().map(|&p| points[p as usize]).collect();
    let loose: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let origin: Vec<usize> = triangles.iter().flatten().map(|&p| p as usize).collect();
    let same: Vec<usize> = (0..points.len()).collect();
    let flipped: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let holes: Vec<[u32; 3]> =
        triangles.iter().copied().enumerate().filter(|(i, _)| i % 3 != 1).map(|(_, t)| t).collect();
    let doubled: Vec<[u32; 3]> = triangles.iter().flat_map(|&t| [t, t, [t[0], t[0], t[1]]]).collect();
    for (name, points, triangles, origin) in [
        ("unwelded", &unwelded, &loose, &origin),
        ("flipped", &points, &flipped, &same),
        ("holes", &points, &holes, &same),
        ("doubled faces", &points, &doubled, &same),
    ] {
        let (weights, _) = bind(points, triangles, &joints);
        check_sound(&weights, points.len(), &joints, 8);
        let error: f32 =
            origin.iter().enumerate().map(|(p, &o)| (weight(&weights, p, 0) - weight(&expected, o, 0)).abs()).sum();
        assert!(error / (origin.len() as f32) < 0.03, "{name}: mean change {}", error / origin.len() as f32);
    }
}

#[test]
fn specks_and_loose_points_follow_the_body() {
    let (mut points, mut triangles) = tube();
    let joints = tube_joints();
    let speck = points.len();
    for corner in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
        points.push(Vec3::new(0.5, 0.4, 0.0) + corner * 0.01);
    }
    points.push(Vec3::new(3.5, 0.0, 0.5));
    let base = speck as u32;
    triangles.extend([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|f: [u32; 3]| f.map(|c| base + c)));
    let (weights, report) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
    assert!((speck..speck + 4).all(|p| weight(&weights, p, 0) > 0.9));
    assert!(weight(&weights, speck + 4, 1) + weight(&weights, speck + 4, 2) > 0.9);
    assert_eq!(report.by_surface + report.by_voxels + report.by_fill + report.by_nearest + report.given, points.len());
    assert_eq!(report.by_surface, speck);
}

#[test]
fn every_method_covers_everything() {
    let (points, triangles) = tube();
    for method in [Method::Auto, Method::Heat, Method::Voxel] {
        let settings = WeightSettings { method, voxel_resolution: 48, max_influences: 2, ..WeightSettings::default() };
        let (weights, report) =
            skin_weights(&points, &triangles, &tube_joints(), &[], None, &settings, &|_| true).unwrap();
        check_sound(&weights, points.len(), &tube_joints(), 2);
        assert_eq!(report.by_voxels > 0, method == Method::Voxel);
        assert!(weight(&weights, 0, 0) > 0.9 && weight(&weights, 160, 0) < 0.1);
    }
}

#[test]
fn a_root_below_the_body_holds_nothing() {
    let (points, triangles) = tube();
    let mut joints = vec![joint([-3.0, -1.0, 0.0], None)];
    joints.extend(tube_joints().iter().map(|j| WeightJoint { parent: Some(j.parent.map_or(0, |p| p + 1)), ..*j }));
    let (weights, _) = bind(&points, &triangles, &joints);
    assert!((0..points.len()).all(|p| weight(&weights, p, 0) == 0.0));
}

#[test]
fn children_behind_a_joint_do_not_take_the_flesh_before_it() {
    let (points, triangles) = tube();
    let mut joints = tube_joints();
    joints.push(joint([0.9, 0.25, 0.25], Some(1)));
    let (weights, _) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
    // The corner of the section beside which a bone from the middle back to that child would run.
    assert!(weight(&weights, 15 * 4 + 2, 1) < 0.15, "{}", weight(&weights, 15 * 4 + 2, 1));
}

#[test]
fn joints_that_do_not_deform_pass_their_flesh_up() {
    let (points, triangles) = tube();
    let mut joints = tube_joints();
    joints[1].deforms = false;
    joints[2].deforms = false;
    joints.push(joint([0.2, 0.0, 0.0], Some(0)));
    let (weights, _) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
    assert!(weight(&weights, 160, 0) > 0.9, "the end of the tube belongs to the first joint");
    for joint in &mut joints {
        joint.deforms = false;
    }
    let (weights, _) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
}

/// The tube's joints, and a twist joint at each of some shares of the first bone.
fn twisted(shares: &[f32]) -> Vec<WeightJoint> {
    let mut joints = tube_joints();
    let (start, end) = (joints[0].head, joints[1].head);
    for share in shares {
        let twist = Some(TwistBone { joint: 0, end });
        joints.push(WeightJoint {
            head: start.lerp(end, *share),
            parent: Some(0),
            tail: None,
            deforms: true,
            twist,
            halves: None,
        });
    }
    joints
}

#[test]
fn twist_joints_share_their_bone_linearly_and_nothing_else() {
    let (points, triangles) = tube();
    let (plain, _) = bind(&points, &triangles, &tube_joints());
    // Without a twist joint at its start the bone's own joint stands there, else at its end.
    let tables: [(&[f32], &[(f32, u32)]); 3] = [
        (&[0.25, 0.5, 0.75], &[(0.0, 0), (0.25, 3), (0.5, 4), (0.75, 5), (1.0, 5)]),
        (&[0.0, 0.25, 0.5, 0.75], &[(0.0, 3), (0.25, 4), (0.5, 5), (0.75, 6), (1.0, 0)]),
        (&[0.5], &[(0.0, 0), (0.5, 3), (1.0, 3)]),
    ];
    for (shares, stations) in tables {
        let joints = twisted(shares);
        let (weights, _) = bind(&points, &triangles, &joints);
        check_sound(&weights, points.len(), &joints, 8);
        for (point, place) in points.iter().enumerate() {
            let held: f32 =
                (0..joints.len() as u32).filter(|j| *j != 1 && *j != 2).map(|j| weight(&weights, point, j)).sum();
            assert!((held - weight(&plain, point, 0)).abs() < 0.01, "{shares:?}: other bones hold what they held");
            let at = ((place.x - 0.1) / 1.9).clamp(0.0, 1.0);
            let next = stations.iter().position(|station| station.0 >= at).unwrap().max(1);
            let ((from, before), (to, after)) = (stations[next - 1], stations[next]);
            let share = (at - from) / (to - from);
            let wanted = |joint: u32| {
                let of = |station: u32, share: f32| if station == joint { share } else { 0.0 };
                held * (of(before, 1.0 - share) + of(after, share))
            };
            for joint in [0, 3, 4, 5, 6].into_iter().filter(|joint| (*joint as usize) < joints.len()) {
                let (is, wanted) = (weight(&weights, point, joint), wanted(joint));
                assert!((is - wanted).abs() < 0.01, "{shares:?}: joint {joint} has {is} at {at}, not {wanted}");
            }
        }
    }
}

#[test]
fn locked_twist_joints_leave_the_bone_to_the_others() {
    let (points, triangles) = tube();
    let joints = twisted(&[0.5]);
    let mut present = Weights::default();
    (0..points.len()).for_each(|_| present.push([(1, 1.0)]));
    for locked in [0, 3] {
        let mut flags = [false; 4];
        flags[locked] = true;
        let locks = Locks { weights: &present, joints: &flags };
        let (weights, _) =
            skin_weights(&points, &triangles, &joints, &[], Some(locks), &WeightSettings::default(), &|_| true)
                .unwrap();
        check_sound(&weights, points.len(), &joints, 8);
        assert!((0..points.len()).all(|p| weight(&weights, p, locked as u32) == 0.0));
        assert!(weight(&weights, 0, 3 - locked as u32) > 0.9);
    }
}

#[test]
fn one_joint_takes_all() {
    let (points, triangles) = tube();
    let (weights, report) = bind(&points, &triangles, &[joint([9.0, 9.0, 9.0], None)]);
    assert!((0..points.len()).all(|p| weights.of(p).eq([(0, 1.0)])));
    assert_eq!(report, WeightReport { given: points.len(), points: points.len(), ..WeightReport::default() });
}

#[test]
fn locked_joints_keep_their_weights() {
    let (points, triangles) = tube();
    let joints = tube_joints();
    let mut present = Weights::default();
    for point in 0..points.len() {
        // Half of the first quarter, and all of the last point.
        let held = if point + 1 == points.len() {
            1.0
        } else if point < 40 {
            0.5
        } else {
            0.0
        };
        present.push([(2, held), (0, 1.0 - held)].into_iter().filter(|e| e.1 > 0.0));
    }
    let locks = Locks { weights: &present, joints: &[false, false, true] };
    let (weights, _) =
        skin_weights(&points, &triangles, &joints, &[], Some(locks), &WeightSettings::default(), &|_| true).unwrap();
    check_sound(&weights, points.len(), &joints, 8);
    for point in 0..points.len() {
        assert!((weight(&weights, point, 2) - weight(&present, point, 2)).abs() < 1e-5, "point {point}");
    }
    let locks = Locks { weights: &present, joints: &[true, true, true] };
    let (weights, _) =
        skin_weights(&points, &triangles, &joints, &[], Some(locks), &WeightSettings::default(), &|_| true).unwrap();
    assert!((0..points.len()).all(|p| (weight(&weights, p, 0) - weight(&present, p, 0)).abs() < 1e-5));
}

#[test]
fn threads_do_not_change_a_bit() {
    let (points, triangles) = tube();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bind(&points, &triangles, &tube_joints()))
    };
    let (one, four) = (run(1), run(4));
    assert_eq!(one, four);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever the mesh and the rig, every point is weighted soundly, and again in the same way.
    #[test]
    fn junk_is_weighted_soundly(
        points in prop::collection::vec(prop::array::uniform3(-4i8..5), 0..60),
        corners in prop::collection::vec(prop::array::uniform3(0usize..1000), 0..120),
        heads in prop::collection::vec((prop::array::uniform3(-5i8..6), 0usize..100, prop::bool::weighted(0.8), prop::bool::weighted(0.2), prop::bool::weighted(0.3)), 1..12),
        method in prop::sample::select(vec![Method::Auto, Method::Heat, Method::Voxel]),
        most in 1usize..6,
        exponent in -6i32..7,
    ) {
        let scale = 10f32.powi(exponent);
        let place = |p: &[i8; 3]| Vec3::from(p.map(f32::from)) * scale;
        let points: Vec<Vec3> = points.iter().map(place).collect();
        let triangles: Vec<[u32; 3]> =
            if points.is_empty() { Vec::new() } else { corners.iter().map(|t| t.map(|c| (c % points.len()) as u32)).collect() };
        let joints: Vec<WeightJoint> = heads
            .iter()
            .enumerate()
            .map(|(i, (head, parent, deforms, tail, twist))| WeightJoint {
                head: place(head),
                parent: (i > 0 && parent % 7 != 0).then(|| parent % i),
                tail: tail.then(|| place(head) + Vec3::X * scale),
                deforms: *deforms,
                twist: (i > 0 && *twist).then(|| TwistBone { joint: 0, end: place(head) + Vec3::Y * scale }),
                halves: (i > 0 && !*twist && parent % 5 == 0).then_some(0),
            })
            .collect();
        let settings = WeightSettings { max_influences: most, method, voxel_resolution: 16, ..WeightSettings::default() };
        let run = || skin_weights(&points, &triangles, &joints, &[], None, &settings, &|_| true).unwrap();
        let (weights, report) = run();
        check_sound(&weights, points.len(), &joints, most);
        prop_assert_eq!(report.by_surface + report.by_voxels + report.by_fill + report.by_nearest + report.given, points.len());
        prop_assert_eq!(run(), (weights, report));
    }
}

#[test]
fn half_joints_alone_are_bound_like_others() {
    let joint =
        |parent, deforms, halves| WeightJoint { head: Vec3::ZERO, parent, tail: None, deforms, twist: None, halves };
    let joints = [joint(None, false, None), joint(Some(0), true, Some(0))];
    for method in [Method::Auto, Method::Heat, Method::Voxel] {
        let settings = WeightSettings { method, ..WeightSettings::default() };
        let (weights, _) = skin_weights(&[Vec3::ZERO], &[], &joints, &[], None, &settings, &|_| true).unwrap();
        assert_eq!(weights.of(0).collect::<Vec<_>>(), [(1, 1.0)], "{method:?}");
    }
}

/// Half joints take what both sides of a bend hold in common, and nothing else changes. At a hip the blend stays as it
/// is, and the half joint's share has no corner; at a knee the blend is drawn out, and the middle is the half joint's.
#[test]
fn half_joints_hold_what_both_sides_share() {
    let (points, triangles) = tube();
    // The bone above is far shorter than the one below, or as long.
    for (start, is_hinge, peak) in [(1.2, false, 0.5), (0.1, true, 1.0)] {
        let mut plain = tube_joints();
        plain[0].head.x = start;
        let mut joints = plain.clone();
        joints.push(WeightJoint { parent: Some(1), halves: Some(1), ..plain[1] });
        let (without, with) = (bind(&points, &triangles, &plain).0, bind(&points, &triangles, &joints).0);
        let mut most = 0.0_f32;
        for point in 0..points.len() {
            let (upper, lower) = (weight(&without, point, 0), weight(&without, point, 1));
            if upper < 0.01 || lower < 0.01 {
                continue;
            }
            // Near the end of the tube the last joint holds a share, too.
            let both = upper + lower;
            let contrast = if is_hinge { 0.5 } else { 1.0 };
            let below = 1.0 / (1.0 + (upper / lower).powf(contrast));
            let taken = both * if is_hinge { 2.0 * below.min(1.0 - below) } else { 2.0 * below * (1.0 - below) };
            let held = weight(&with, point, 3);
            most = most.max(held);
            assert!((held - taken).abs() < 0.02, "{held} of {upper} and {lower}");
            assert!((weight(&with, point, 0) - (both * (1.0 - below) - 0.5 * taken)).abs() < 0.02);
            assert!((weight(&with, point, 1) - (both * below - 0.5 * taken)).abs() < 0.02);
        }
        assert!(most > 0.9 * peak, "the half joint holds most in the middle of the bend: {most}");
    }
}
