//! Weights of trunks whose limbs are parts of their own, of flesh beside last joints, and of limbs that are folded at rest.

use std::f32::consts::TAU;

use super::*;

/// Sides of a column.
const SIDES: u32 = 12;

/// Adds an upright, closed column with a ring of points every tenth, and returns its points.
fn add_column(
    points: &mut Vec<Vec3>,
    triangles: &mut Vec<[u32; 3]>,
    center: f32,
    radius: f32,
    heights: Range<f32>,
) -> Range<usize> {
    let first = points.len() as u32;
    let rings = ((heights.end - heights.start) * 10.0).round() as u32 + 1;
    for ring in 0..rings {
        for side in 0..SIDES {
            let turn = glam::Quat::from_rotation_y(side as f32 * TAU / SIDES as f32);
            points.push(turn * Vec3::X * radius + Vec3::new(center, heights.start + 0.1 * ring as f32, 0.0));
        }
    }
    let at = |ring: u32, side: u32| first + ring * SIDES + side % SIDES;
    for side in 0..SIDES {
        for ring in 0..rings - 1 {
            let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let [bottom, top] = [points.len() as u32, points.len() as u32 + 1];
    points.extend([heights.start, heights.end].map(|height| Vec3::new(center, height, 0.0)));
    triangles.extend((0..SIDES).map(|side| [bottom, at(0, side + 1), at(0, side)]));
    triangles.extend((0..SIDES).map(|side| [top, at(rings - 1, side), at(rings - 1, side + 1)]));
    first as usize..points.len()
}

/// Sum of the weights of some joints at a point.
fn sum(weights: &Weights, point: usize, joints: Range<u32>) -> f32 {
    joints.map(|joint| weight(weights, point, joint)).sum()
}

/// A robe over legs that are parts of their own: the bones from the hips to the thighs end beside its waist, which the spine
/// holds all the same.
#[test]
fn waists_of_robes_belong_to_the_spine() {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let robe = add_column(&mut points, &mut triangles, 0.0, 0.9, 1.4..4.0);
    let legs = [0.5, -0.5].map(|center| add_column(&mut points, &mut triangles, center, 0.2, 0.0..2.2));
    let joints = [
        joint([0.0, 1.9, 0.0], None),
        joint([0.0, 2.3, 0.0], Some(0)),
        joint([0.0, 3.2, 0.0], Some(1)),
        joint([0.0, 3.8, 0.0], Some(2)),
        joint([0.5, 2.1, 0.0], Some(0)),
        joint([0.5, 1.0, 0.0], Some(4)),
        joint([0.5, 0.2, 0.0], Some(5)),
        joint([-0.5, 2.1, 0.0], Some(0)),
        joint([-0.5, 1.0, 0.0], Some(7)),
        joint([-0.5, 0.2, 0.0], Some(8)),
    ];
    let (weights, _) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
    for mut leg in legs {
        assert!(leg.all(|point| sum(&weights, point, 4..10) > 0.99));
    }
    let waist = robe.clone().filter(|point| points[*point].x.abs() > 0.85 && (2.65..2.85).contains(&points[*point].y));
    let spine: Vec<f32> = waist.map(|point| weight(&weights, point, 1)).collect();
    assert!(spine.len() == 4 && spine.iter().all(|spine| *spine > 0.6), "{spine:?} of the waist");
    let hem = robe.filter(|point| points[*point].x.abs() > 0.85 && points[*point].y < 1.55);
    let hips: Vec<f32> = hem.map(|point| weight(&weights, point, 0)).collect();
    assert!(hips.len() == 4 && hips.iter().all(|hips| *hips > 0.6), "{hips:?} of the hem");
}

/// A head of its own that begins in the collar leaves the collar to the chest; under a hat, a head that is one piece with the
/// trunk keeps its flesh.
#[test]
fn heads_of_their_own_leave_the_collar_and_heads_below_hats_keep_theirs() {
    let joints = [
        joint([0.0, 0.3, 0.0], None),
        joint([0.0, 1.4, 0.0], Some(0)),
        joint([0.0, 2.4, 0.0], Some(1)),
        joint([0.0, 3.7, 0.0], Some(2)),
    ];
    let figure = |trunk: f32, cover: Range<f32>| {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        let trunk = add_column(&mut points, &mut triangles, 0.0, 0.8, 0.0..trunk);
        let mut cover = add_column(&mut points, &mut triangles, 0.0, 1.2, cover);
        let weights = bind(&points, &triangles, &joints).0;
        check_sound(&weights, points.len(), &joints, 8);
        assert!(cover.all(|point| weight(&weights, point, 3) > 0.99), "the joint holds what is around it");
        (points, trunk, weights)
    };
    let (_, mut trunk, weights) = figure(4.0, 3.5..6.0);
    assert!(trunk.all(|point| weight(&weights, point, 3) == 0.0), "the chest holds the collar");
    let (points, mut trunk, weights) = figure(5.6, 3.5..6.0);
    assert!(trunk.all(|point| points[point].y < 5.0 || weight(&weights, point, 3) > 0.9), "the head holds its flesh");
}

/// A last joint that goes out of the flesh through the skin: as long as it lies just outside, it holds the end of its limb all
/// around, and no small step of it changes much.
#[test]
fn last_joints_beside_the_skin_hold_the_flesh_on_all_sides() {
    const STEP: f32 = 0.006;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let limb = add_column(&mut points, &mut triangles, 0.0, 0.3, 0.0..4.0);
    let bound = |gap: f32| {
        let last = joint([0.3 + gap, 3.2, 0.0], Some(1));
        let joints = [joint([0.0, 0.1, 0.0], None), joint([0.0, 2.0, 0.0], Some(0)), last];
        let weights = bind(&points, &triangles, &joints).0;
        check_sound(&weights, points.len(), &joints, 8);
        weights
    };
    // The bone that leads to the joint is 1.2 long and the flesh 0.6 thick: from a little inside to 0.14 of the bone outside,
    // past the depths of 0.06 and 0.12 of the thickness.
    let sweep: Vec<Weights> = (-3..=28).map(|step| bound(step as f32 * STEP)).collect();
    for (number, weights) in sweep.iter().enumerate() {
        for point in limb.clone().filter(|point| points[*point].y > 3.65) {
            let held = weight(weights, point, 2);
            assert!(held > 0.9, "step {number}: {held} of the end at {}", points[point]);
        }
    }
    for (number, pair) in sweep.windows(2).enumerate() {
        for point in limb.clone() {
            let [before, after] = [&pair[0], &pair[1]].map(|weights| weight(weights, point, 2));
            assert!((before - after).abs() < 0.2, "step {number}: {before} becomes {after} at {}", points[point]);
        }
    }
    // Farther away than 0.15 of the bone the joint stays where it is, and the weights are sound all the same.
    for gap in [0.19, 0.3, 0.9] {
        bound(gap);
    }
}

/// A limb that is folded at rest, as the fingers of a fist: the skin of both bones on the inside of the fold lies in one place, and
/// each bone holds most of its own, whichever way the triangles face.
#[test]
fn bones_of_a_fold_hold_most_of_their_own_skin_inside_of_it() {
    const KNUCKLE: f32 = 2.05;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let limb = add_column(&mut points, &mut triangles, 0.0, 0.3, 0.0..4.0);
    let heights: Vec<f32> = points.iter().map(|point| point.y).collect();
    let knuckle = Vec3::new(0.0, KNUCKLE, 0.0);
    let turn = glam::Quat::from_rotation_z(75f32.to_radians());
    let folded = |point: Vec3| if point.y > KNUCKLE { knuckle + turn * (point - knuckle) } else { point };
    points.iter_mut().for_each(|point| *point = folded(*point));
    let last = folded(Vec3::new(0.0, 3.0, 0.0));
    let joints = [
        joint([0.0, 0.1, 0.0], None),
        joint([0.0, 1.0, 0.0], Some(0)),
        joint(knuckle.to_array(), Some(1)),
        joint(last.to_array(), Some(2)),
    ];
    for flipped in [false, true] {
        if flipped {
            triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
        }
        let weights = bind(&points, &triangles, &joints).0;
        check_sound(&weights, points.len(), &joints, 8);
        let is_wrong = |point: &usize| {
            let above = sum(&weights, *point, 2..4);
            if heights[*point] > KNUCKLE { above < 0.5 } else { above > 0.5 }
        };
        let wrong: Vec<Vec3> = limb.clone().filter(is_wrong).map(|point| points[point]).collect();
        // By distance alone there are twelve; the rest is within a ring or two of the knuckle, where the bones share.
        assert!(wrong.len() < 10, "{} points: {wrong:?}", wrong.len());
    }
}
