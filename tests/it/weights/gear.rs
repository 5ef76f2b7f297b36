//! Weights of gear on a body: belts, capes, things in a hand, and what is strapped around bones that twist joints share.

use std::f32::consts::TAU;

use rigsmith::algo::weights::{held_pieces, late_shares};

use super::*;

/// Columns of a band.
const COLUMNS: u32 = 24;

/// Adds an upright band around the y axis, open at both ends, with rows at some heights, and returns its points.
pub(super) fn add_band(
    points: &mut Vec<Vec3>,
    triangles: &mut Vec<[u32; 3]>,
    [wide, deep]: [f32; 2],
    heights: &[f32],
) -> Range<usize> {
    let rows: Vec<Vec<Vec3>> = heights
        .iter()
        .map(|height| {
            let angle = |column: u32| (column % COLUMNS) as f32 * TAU / COLUMNS as f32;
            (0..=COLUMNS)
                .map(|column| Vec3::new(wide * angle(column).sin(), *height, deep * angle(column).cos()))
                .collect()
        })
        .collect();
    add_sheet(points, triangles, &rows)
}

/// Adds a sheet of rows of points, and returns its points.
pub(super) fn add_sheet(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>, rows: &[Vec<Vec3>]) -> Range<usize> {
    let (first, width) = (points.len() as u32, rows[0].len() as u32);
    rows.iter().for_each(|row| points.extend(row));
    for row in 0..rows.len() as u32 - 1 {
        for column in 0..width - 1 {
            let at = first + row * width + column;
            triangles.extend([[at, at + 1, at + width + 1], [at, at + width + 1, at + width]]);
        }
    }
    first as usize..points.len()
}

/// Heights from one to another, a tenth apart.
pub(super) fn heights(from: f32, to: f32) -> Vec<f32> {
    let count = ((to - from) * 10.0).round() as usize;
    (0..=count).map(|step| from + (to - from) * step as f32 / count as f32).collect()
}

/// Hips below a spine that leans back, and two legs.
pub(super) fn figure() -> Vec<WeightJoint> {
    vec![
        joint([0.0, 0.0, 0.0], None),
        joint([0.0, 0.6, -0.35], Some(0)),
        joint([0.0, 1.2, -0.1], Some(1)),
        joint([0.0, 1.9, 0.0], Some(2)),
        joint([0.25, -0.1, 0.0], Some(0)),
        joint([0.28, -0.8, 0.0], Some(4)),
        joint([0.28, -1.5, 0.0], Some(5)),
        joint([-0.25, -0.1, 0.0], Some(0)),
        joint([-0.28, -0.8, 0.0], Some(7)),
        joint([-0.28, -1.5, 0.0], Some(8)),
    ]
}

/// A body around the figure, of one piece.
pub(super) fn body() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    add_band(&mut points, &mut triangles, [0.5, 0.45], &heights(-1.6, 2.0));
    (points, triangles)
}

/// Sum of the weights of a joint over some points.
fn sum(weights: &Weights, points: Range<usize>, joint: u32) -> f32 {
    points.map(|point| weight(weights, point, joint)).sum()
}

/// An oval belt around hips from which the spine leans back and the thighs go aside. It goes with the hips, not with the thigh of
/// which more is seen through it; and where it bends, it does so on both sides alike.
#[test]
fn belts_lie_on_the_hips() {
    let (mut points, mut triangles) = body();
    let belt = add_band(&mut points, &mut triangles, [0.68, 0.5], &[-0.19, -0.05, 0.05, 0.19]);
    let joints = figure();
    let (weights, report) = bind(&points, &triangles, &joints);
    assert_eq!(report.stiff, belt.len());
    for point in belt.clone() {
        assert_eq!(weights.of(point).collect::<Vec<_>>(), [(0, 1.0)]);
    }
    let settings = WeightSettings { stiff_parts: false, ..WeightSettings::default() };
    let bent = skin_weights(&points, &triangles, &joints, &[], None, &settings, &|_| true).unwrap().0;
    let [hips, left, right] = [0, 4, 7].map(|joint| sum(&bent, belt.clone(), joint));
    assert!(hips > left && hips > right && (left - right).abs() < 0.1 * hips, "{hips} {left} {right}");
}

/// A cape behind a back hangs from the chest above and follows the legs below, though its sheet covers nearly half of what can be
/// seen from a joint of the spine.
#[test]
fn capes_hang_from_all_that_they_hang_behind() {
    let (mut points, mut triangles) = body();
    let back = |height: f32| (0..=16).map(|side| Vec3::new(0.15 * (side as f32 - 8.0), height, -0.6)).collect();
    let rows: Vec<Vec<Vec3>> = heights(-1.3, 1.9).into_iter().map(back).collect();
    let cape = add_sheet(&mut points, &mut triangles, &rows);
    let (weights, report) = bind(&points, &triangles, &figure());
    assert_eq!(report.stiff, 0);
    // The middle of the lowest and of the highest row.
    let [low, high] = [cape.start + rows[0].len() / 2, cape.end - rows[0].len() / 2 - 1];
    let of = |point: usize, joints: &[u32]| joints.iter().map(|joint| weight(&weights, point, *joint)).sum::<f32>();
    assert!(of(high, &[2, 3]) > 0.8, "{:?}", weights.of(high).collect::<Vec<_>>());
    assert!(of(low, &[4, 5, 6, 7, 8, 9]) > 0.8, "{:?}", weights.of(low).collect::<Vec<_>>());
}

/// A staff in a fist goes with the hand, of which single fingers are nearest to it; a glove bends with the fingers.
#[test]
fn things_in_a_hand_go_with_the_hand() {
    let (mut points, mut triangles) = tube();
    let mut joints =
        vec![joint([0.1, 0.0, 0.0], None), joint([1.5, 0.0, 0.0], Some(0)), joint([2.6, 0.0, 0.0], Some(1))];
    for finger in [-0.15, 0.15] {
        joints.push(joint([3.0, 0.0, finger], Some(2)));
        joints.push(joint([3.4, 0.0, finger], Some(joints.len() - 1)));
        joints.push(joint([3.9, 0.0, finger], Some(joints.len() - 1)));
    }
    let rows: Vec<Vec<Vec3>> = heights(-3.0, 3.0)
        .into_iter()
        .map(|height| {
            [[3.3, 0.4], [3.5, 0.4], [3.5, 0.6], [3.3, 0.6], [3.3, 0.4]].map(|[x, z]| Vec3::new(x, height, z)).into()
        })
        .collect();
    let staff = add_sheet(&mut points, &mut triangles, &rows);
    let around = [[-0.36, -0.36], [0.36, -0.36], [0.36, 0.36], [-0.36, 0.36], [-0.36, -0.36]];
    let rows: Vec<Vec<Vec3>> =
        (0..=12).map(|step| around.map(|[y, z]| Vec3::new(2.8 + 0.1 * step as f32, y, z)).into()).collect();
    let glove = add_sheet(&mut points, &mut triangles, &rows);
    let (weights, report) = bind(&points, &triangles, &joints);
    for point in staff.clone() {
        assert_eq!(weights.of(point).collect::<Vec<_>>(), [(2, 1.0)], "{}", points[point]);
    }
    assert_eq!(report.stiff, staff.len());
    assert!(weight(&weights, glove.start, 3) > 0.7 && weight(&weights, glove.end - 1, 3) < 0.2);
}

/// The joints of a tube, of which the second bone is shared by twist joints along it.
fn twisted_joints() -> Vec<WeightJoint> {
    let mut joints = tube_joints();
    for x in [2.0, 2.6, 3.2] {
        let twist = Some(TwistBone { joint: 1, end: Vec3::new(3.8, 0.0, 0.0) });
        joints.push(WeightJoint { twist, ..joint([x, 0.0, 0.0], Some(1)) });
    }
    joints
}

/// Adds a greave around the second bone of the tube.
fn add_greave(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) -> Range<usize> {
    let first = points.len();
    add_band(points, triangles, [0.5, 0.5], &heights(2.2, 3.2));
    points[first..].iter_mut().for_each(|point| *point = Vec3::new(point.y, point.x, point.z));
    first..points.len()
}

/// A greave on a shin that twist joints share goes with one of them: it would shear between several.
#[test]
fn stiff_parts_go_with_one_twist_joint() {
    let (mut points, mut triangles) = tube();
    let tube = points.len();
    let greave = add_greave(&mut points, &mut triangles);
    let (weights, report) = bind(&points, &triangles, &twisted_joints());
    assert_eq!(report.stiff, greave.len());
    let row: Vec<(u32, f32)> = weights.of(greave.start).collect();
    assert_eq!(row, [(4, 1.0)], "the middle of the greave is nearest to the second twist joint");
    assert!(greave.clone().all(|point| weights.of(point).eq(row.iter().copied())));
    // The skin below is shared.
    let shared = (0..tube).filter(|point| weights.of(*point).filter(|(joint, _)| *joint > 2).count() > 1);
    assert!(shared.count() > 20);
}

/// The same where twist joints are built after the mesh was bound, unless a person has said that the greave bends.
#[test]
fn stiff_parts_go_with_one_twist_joint_that_comes_later() {
    let (mut points, mut triangles) = tube();
    let greave = add_greave(&mut points, &mut triangles);
    let before = bind(&points, &triangles, &tube_joints()).0;
    let joints = twisted_joints();
    let is_late: Vec<bool> = joints.iter().map(|joint| joint.twist.is_some()).collect();
    let distinct = |bending: &[Range<u32>]| {
        let middles = held_pieces(&points, &triangles, &before, bending);
        assert_eq!(middles.iter().flatten().count(), if bending.is_empty() { greave.len() } else { 0 });
        let after = late_shares(&points, &joints, &is_late, &before, &middles, |_| false, 4);
        let rows: Vec<Vec<(u32, f32)>> = greave.clone().map(|point| after.of(point).collect()).collect();
        (rows[0].clone(), rows.iter().any(|row| *row != rows[0]))
    };
    assert_eq!(distinct(&[]), (vec![(4, 1.0)], false));
    let one = greave.start as u32..greave.start as u32 + 1;
    assert!(distinct(&[one]).1);
}
