//! Weights of bodies below hair, hoods and shoes, and of what small pieces of a limb and things in a fist are.

use std::f32::consts::TAU;

use super::{
    gear::{add_sheet, body, figure, heights},
    *,
};

/// Adds a round hose along x through some places along it with radii, and returns its points.
fn add_hose(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>, rings: &[[f32; 2]]) -> Range<usize> {
    const SIDES: u32 = 16;
    let ring = |[x, radius]: [f32; 2]| {
        let angle = |side: u32| (side % SIDES) as f32 * TAU / SIDES as f32;
        (0..=SIDES).map(|side| Vec3::new(x, radius * angle(side).cos(), radius * angle(side).sin())).collect()
    };
    let rows: Vec<Vec<Vec3>> = rings.iter().copied().map(ring).collect();
    add_sheet(points, triangles, &rows)
}

/// Places from one to another, a tenth apart, with one radius.
fn straight(from: f32, to: f32, radius: f32) -> Vec<[f32; 2]> {
    heights(from.min(to), from.max(to))
        .into_iter()
        .map(|x| [if from < to { x } else { from + to - x }, radius])
        .collect()
}

/// Joints of a tube with a neck before the last joint.
fn neck() -> Vec<WeightJoint> {
    vec![joint([0.1, 0.0, 0.0], None), joint([2.0, 0.0, 0.0], Some(0)), joint([2.8, 0.0, 0.0], Some(1))]
}

/// A head below a hood and long hair is held by its bones as it is without them.
#[test]
fn bodies_are_bound_as_without_what_they_wear() {
    let (mut points, mut triangles) = tube();
    let naked = bind(&points, &triangles, &neck()).0;
    let count = points.len();
    let mut hood = straight(1.4, 3.9, 0.8);
    hood.extend([[3.95, 0.5], [3.95, 0.0]]);
    add_hose(&mut points, &mut triangles, &hood);
    // Hair around the back of the head and down along it.
    let strand = |x: f32| -> Vec<Vec3> {
        let angle = |side: usize| (side as f32 / 16.0 - 0.5) * 0.7 * TAU;
        (0..=16).map(|side| Vec3::new(x, -0.45 * angle(side).cos(), 0.45 * angle(side).sin())).collect()
    };
    let rows: Vec<Vec<Vec3>> = heights(1.0, 3.9).into_iter().map(strand).collect();
    add_sheet(&mut points, &mut triangles, &rows);
    let dressed = bind(&points, &triangles, &neck()).0;
    for (point, place) in points.iter().enumerate().take(count) {
        for joint in 0..3 {
            let [without, with] = [&naked, &dressed].map(|weights| weight(weights, point, joint));
            assert!((without - with).abs() < 0.02, "point {point} at {place}: {without} {with}");
        }
    }
}

/// A last joint near the skin stays in the flesh below hair that covers most of the head, whichever way the sheet of hair faces.
#[test]
fn joints_below_hair_stay_in_the_flesh() {
    let mut joints = neck();
    joints[2].head.y = -0.2;
    let (points, triangles) = tube();
    let naked = bind(&points, &triangles, &joints).0;
    for faces_in in [false, true] {
        let (mut points, mut triangles) = (points.clone(), triangles.clone());
        let first = triangles.len();
        let strand = |x: f32| -> Vec<Vec3> {
            let angle = |side: usize| (side as f32 / 24.0 - 0.5) * 0.85 * TAU;
            (0..=24).map(|side| Vec3::new(x, -0.45 * angle(side).cos(), 0.45 * angle(side).sin())).collect()
        };
        let rows: Vec<Vec<Vec3>> = heights(1.5, 4.5).into_iter().map(strand).collect();
        let hair = add_sheet(&mut points, &mut triangles, &rows);
        if faces_in {
            triangles[first..].iter_mut().for_each(|triangle| triangle.swap(0, 1));
        }
        let weights = bind(&points, &triangles, &joints).0;
        for (point, place) in points.iter().enumerate().take(hair.start) {
            let [without, with] = [&naked, &weights].map(|weights| weight(weights, point, 2));
            assert!((without - with).abs() < 0.02, "point {point} at {place}: {without} {with}");
        }
    }
}

/// A shoe so tight that most of its tip is hidden behind its own folds belongs to the toes inside of it.
#[test]
fn skin_that_hides_itself_is_held_by_what_is_inside() {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let foot = [&[[0.0, 0.0]], &straight(0.0, 3.8, 0.2)[..], &[[3.8, 0.0]]].concat();
    add_hose(&mut points, &mut triangles, &foot);
    let mut rings = straight(0.0, 3.9, 0.3);
    for (from, to, radius) in [(3.8, 3.0, 0.29), (3.0, 3.8, 0.28), (3.8, 3.0, 0.27), (3.0, 3.8, 0.26), (3.8, 3.0, 0.25)]
    {
        rings.extend(straight(from, to, radius));
    }
    let shoe = add_hose(&mut points, &mut triangles, &rings);
    let mut joints = tube_joints();
    joints[2].head.x = 2.9;
    let weights = bind(&points, &triangles, &joints).0;
    let tip = shoe.filter(|point| points[*point].x > 3.4);
    let least = tip.map(|point| weight(&weights, point, 2)).fold(1.0, f32::min);
    assert!(least > 0.5, "{least}");
}

/// Fingers that are curled around a sword run along inside of it; it goes with the hand all the same, and the fingers end where their
/// flesh does.
#[test]
fn swords_around_curled_fingers_go_with_the_hand() {
    let (mut points, mut triangles) = tube();
    // Skin between the fingers, which hangs on the end of the tube.
    let end = points.len() as u32;
    points.extend([[3.1, -0.29], [3.95, -0.29], [3.95, 0.29], [3.1, 0.29]].map(|[x, z]| Vec3::new(x, 0.0, z)));
    triangles.extend([[end, end + 1, end + 2], [end, end + 2, end + 3], [end - 1, end + 1, end + 2]]);
    let mut joints =
        vec![joint([0.1, 0.0, 0.0], None), joint([1.5, 0.0, 0.0], Some(0)), joint([2.6, 0.0, 0.0], Some(1))];
    for finger in [-0.05, 0.05] {
        for z in [-0.2, 0.0, 0.15] {
            let parent = if z < -0.1 { 2 } else { joints.len() - 1 };
            joints.push(joint([3.4, finger, z], Some(parent)));
        }
    }
    let around =
        |z: f32| [[3.3, -0.1], [3.5, -0.1], [3.5, 0.1], [3.3, 0.1], [3.3, -0.1]].map(|[x, y]| Vec3::new(x, y, z));
    let mut rows: Vec<Vec<Vec3>> = heights(-0.6, 6.0).into_iter().map(|z| around(z).into()).collect();
    rows.insert(0, vec![Vec3::new(3.4, 0.0, -0.6); 5]);
    rows.push(vec![Vec3::new(3.4, 0.0, 6.0); 5]);
    let sword = add_sheet(&mut points, &mut triangles, &rows);
    let weights = bind(&points, &triangles, &joints).0;
    for point in sword {
        assert_eq!(weights.of(point).collect::<Vec<_>>(), [(2, 1.0)], "{}", points[point]);
    }
}

/// A hand that is a small piece of its own bends with its fingers; a button of that size is stiff.
#[test]
fn small_limbs_bend_with_their_bones() {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    add_hose(&mut points, &mut triangles, &straight(0.0, 3.5, 0.2));
    let hand: Vec<[f32; 2]> = (0..=12).map(|ring| [3.5 + 0.03 * ring as f32, 0.1]).collect();
    let hand = [&[[3.5, 0.0]], &hand[..], &[[3.86, 0.0]]].concat();
    let limb = add_hose(&mut points, &mut triangles, &hand);
    let button: Vec<[f32; 2]> = hand.iter().map(|[x, radius]| [x - 2.0, *radius]).collect();
    let button = add_hose(&mut points, &mut triangles, &button);
    points[button.clone()].iter_mut().for_each(|point| point.y += 0.4);
    let joints = vec![
        joint([0.1, 0.0, 0.0], None),
        joint([2.0, 0.0, 0.0], Some(0)),
        joint([3.52, 0.0, 0.0], Some(1)),
        joint([3.66, 0.0, 0.0], Some(2)),
        joint([3.8, 0.0, 0.0], Some(3)),
    ];
    let (weights, report) = bind(&points, &triangles, &joints);
    assert_eq!(report.stiff, button.len());
    let [first, last] = [limb.start, limb.end - 1];
    assert!(weight(&weights, first, 2) > 0.5, "{:?}", weights.of(first).collect::<Vec<_>>());
    assert!(weight(&weights, last, 4) > 0.5, "{:?}", weights.of(last).collect::<Vec<_>>());
}

/// A joint on the ground below the hips holds nothing of a robe, which is around the way up from it as around the legs.
#[test]
fn joints_on_the_ground_hold_nothing_of_robes() {
    let (mut points, mut triangles) = body();
    let mut joints: Vec<WeightJoint> =
        figure().into_iter().map(|joint| WeightJoint { parent: joint.parent.or(Some(10)), ..joint }).collect();
    joints.push(joint([0.0, -1.5, 0.0], None));
    let weights = bind(&points, &triangles, &joints).0;
    let held = (0..points.len()).map(|point| weight(&weights, point, 10)).fold(0f32, f32::max);
    assert_eq!(held, 0.0);
    // Without legs it stands in the flesh, as the foot of a column.
    for leg in [4, 5, 6, 7, 8, 9] {
        joints[leg].parent = Some(10);
    }
    (points, triangles) = body();
    let weights = bind(&points, &triangles, &joints).0;
    assert!((0..points.len()).any(|point| weight(&weights, point, 10) > 0.5));
}

/// A bust whose arms hang as far down as the lowest joint has no legs: that joint holds the foot of the bust.
#[test]
fn arms_that_hang_are_no_legs() {
    let (points, triangles) = body();
    let mut joints = vec![
        joint([0.0, -1.5, 0.0], None),
        joint([0.0, 0.0, 0.0], Some(0)),
        joint([0.0, 0.7, 0.0], Some(1)),
        joint([0.0, 1.6, 0.0], Some(2)),
    ];
    for side in [-0.3, 0.3] {
        let first = joints.len();
        joints.push(joint([side, 1.1, 0.0], Some(2)));
        joints.push(joint([side, 0.0, 0.0], Some(first)));
        joints.push(joint([side, -1.3, 0.0], Some(first + 1)));
    }
    let weights = bind(&points, &triangles, &joints).0;
    assert!((0..points.len()).any(|point| weight(&weights, point, 0) > 0.5));
}
