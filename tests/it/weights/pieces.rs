//! Weights of the pieces of a mesh: rigid and stiff ones, and idle joints.

use super::*;

/// Adds a box to a mesh and returns its points.
fn add_box(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>, low: Vec3, high: Vec3) -> Range<usize> {
    let first = points.len() as u32;
    points.extend((0..8).map(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] };
        Vec3::new(pick(0), pick(1), pick(2))
    }));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let split = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    triangles.extend(quads.into_iter().flat_map(split).map(|t| t.map(|corner| first + corner)));
    first as usize..points.len()
}

#[test]
fn rigid_parts_hang_on_their_joint() {
    let (points, triangles) = tube();
    let (weights, report) =
        skin_weights(&points, &triangles, &tube_joints(), &[(0..40, 2)], None, &WeightSettings::default(), &|_| true)
            .unwrap();
    assert!((0..40).all(|p| weights.of(p).eq([(2, 1.0)])));
    assert_eq!(report.given, 40);
    assert!(weight(&weights, 60, 0) > 0.5);
}

/// A helmet, the head inside of it and a cape over the shoulders, each a piece of its own.
#[test]
fn parts_belong_to_the_bones_inside_of_them() {
    let (mut points, mut triangles) = tube();
    let (body, soft) = (points.len(), triangles.clone());
    // A box around the end of the tube, wide enough for the last bone, and a small one that floats beside the first.
    let helmet = add_box(&mut points, &mut triangles, Vec3::new(3.2, -0.8, -0.8), Vec3::new(4.4, 0.8, 0.8));
    let mut joints = tube_joints();
    joints[2].head.x = 3.3;
    joints.push(joint([4.2, 0.0, 0.0], Some(2)));
    let (weights, report) = bind(&points, &triangles, &joints);
    for point in helmet.clone() {
        assert!(
            weight(&weights, point, 2) + weight(&weights, point, 3) > 0.99,
            "{:?}",
            weights.of(point).collect::<Vec<_>>()
        );
    }
    let first: Vec<(u32, f32)> = weights.of(helmet.start).collect();
    assert!(helmet.clone().all(|point| weights.of(point).eq(first.iter().copied())) == (report.stiff > 0));
    // A pouch on the first bone moves as one, unless a person says that it bends.
    let pouch = add_box(&mut points, &mut triangles, Vec3::new(0.4, 1.2, -0.2), Vec3::new(0.6, 1.4, 0.2));
    let stiff = bind(&points, &triangles, &joints).1.stiff - report.stiff;
    assert_eq!(stiff, pouch.len());
    let bending = std::iter::once(pouch.start as u32..pouch.start as u32 + 1).collect();
    let settings = WeightSettings { bending, ..WeightSettings::default() };
    let bent = skin_weights(&points, &triangles, &joints, &[], None, &settings, &|_| true).unwrap().1;
    assert_eq!(bent.stiff, report.stiff);
    // The tube is bound as without the helmet.
    let alone = bind(&points[..body], &soft, &joints).0;
    for point in 0..body {
        for joint in 0..2 {
            assert!((weight(&weights, point, joint) - weight(&alone, point, joint)).abs() < 0.1, "point {point}");
        }
    }
}

/// A hat on a trunk, to which alone the last bone is nearest: the girth of that bone is the hat's, and the trunk below is held by its
/// own bone up to its rim.
#[test]
fn bones_of_hats_hold_nothing_of_the_trunk_below() {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let trunk = add_box(&mut points, &mut triangles, Vec3::new(-0.2, 0.0, -0.2), Vec3::new(0.2, 1.0, 0.2));
    let hat = add_box(&mut points, &mut triangles, Vec3::new(-0.1, 1.05, -0.1), Vec3::new(0.1, 1.2, 0.1));
    let joints = [joint([0.0; 3], None), joint([0.0, 1.0, 0.0], Some(0))];
    let weights = bind(&points, &triangles, &joints).0;
    let held =
        |points: Range<usize>, joint: u32| points.map(|point| weight(&weights, point, joint)).fold(1.0, f32::min);
    assert!(held(trunk.clone(), 0) > 0.99, "{}", held(trunk, 0));
    assert!(held(hat.clone(), 1) > 0.5, "{}", held(hat, 1));
}

/// A pouch that floats beside the second bone is told with its joint, and a joint that hangs far outside with its distance.
#[test]
fn stiff_pieces_and_idle_joints_are_told() {
    let (mut points, mut triangles) = tube();
    let pouch = add_box(&mut points, &mut triangles, Vec3::new(2.8, 0.5, -0.1), Vec3::new(3.1, 0.7, 0.1));
    let mut joints = tube_joints();
    joints[2].deforms = false;
    joints.push(joint([2.0, 9.0, 0.0], Some(0)));
    let (weights, report) = bind(&points, &triangles, &joints);
    let first = pouch.start as u32;
    assert_eq!(report.stiff_pieces, [StiffPiece { first, points: 8, joint: 1, share: 1.0 }]);
    assert_eq!(report.stiff, 8);
    assert!(pouch.clone().all(|point| weights.of(point).eq([(1, 1.0)])));
    let [ends, far] = report.idle_joints[..] else { panic!("{:?}", report.idle_joints) };
    assert_eq!(ends, IdleJoint { joint: 2, reason: IdleReason::NotDeforming });
    assert!(matches!(far.reason, IdleReason::Outside { distance } if (distance - 8.338).abs() < 0.01), "{far:?}");
    assert_eq!(far.joint, 3);
    // A piece that bends is told no more, and a joint that is locked has another reason.
    let settings = WeightSettings { bending: std::iter::once(first..first + 1).collect(), ..WeightSettings::default() };
    let bent = skin_weights(&points, &triangles, &joints, &[], None, &settings, &|_| true).unwrap().1;
    assert_eq!((bent.stiff, bent.stiff_pieces.len()), (0, 0));
    let mut present = Weights::default();
    (0..points.len()).for_each(|_| present.push([(0, 1.0)]));
    let locks = Locks { weights: &present, joints: &[false, false, false, true] };
    let locked =
        skin_weights(&points, &triangles, &joints, &[], Some(locks), &WeightSettings::default(), &|_| true).unwrap().1;
    assert_eq!(locked.idle_joints[1], IdleJoint { joint: 3, reason: IdleReason::Locked });
}

/// A joint beside a thing that floats above the tube holds the thing if it claims skin, and only then.
#[test]
fn claims_let_idle_joints_hold_what_is_nearest_to_them() {
    let (mut points, mut triangles) = tube();
    let body = points.len();
    let thing = add_box(&mut points, &mut triangles, Vec3::new(1.6, 2.2, -0.4), Vec3::new(2.4, 2.8, 0.4));
    let mut joints = tube_joints();
    joints.push(joint([2.0, 3.4, 0.0], Some(0)));
    let with = |claims: Vec<usize>, joints: &[WeightJoint]| {
        let settings = WeightSettings { claims, ..WeightSettings::default() };
        skin_weights(&points, &triangles, joints, &[], None, &settings, &|_| true)
    };
    let (weights, report) = with(Vec::new(), &joints).unwrap();
    assert!(thing.clone().all(|point| weight(&weights, point, 3) == 0.0));
    let [far] = report.idle_joints[..] else { panic!("{:?}", report.idle_joints) };
    assert!(matches!(far.reason, IdleReason::Outside { distance } if (distance - 0.6).abs() < 0.01), "{far:?}");
    let (claimed, report) = with(vec![3], &joints).unwrap();
    check_sound(&claimed, points.len(), &joints, 8);
    assert!(thing.clone().all(|point| weight(&claimed, point, 3) > 0.99));
    assert!(report.idle_joints.is_empty(), "{:?}", report.idle_joints);
    // The tube is held as it is without the thing, whoever holds that.
    let (points_of_tube, triangles_of_tube) = tube();
    let (alone, _) = bind(&points_of_tube, &triangles_of_tube, &joints[..3]);
    for point in 0..body {
        for held in [&weights, &claimed] {
            assert!((weight(&alone, point, 0) - weight(held, point, 0)).abs() < 1e-3, "point {point} of the tube");
        }
    }
    // A joint that does not deform holds skin, too; one that is far from all of it stays idle.
    joints[2].deforms = false;
    joints[3].head.y = 50.0;
    let (claimed, report) = with(vec![2, 3], &joints).unwrap();
    assert!((0..body).any(|point| weight(&claimed, point, 2) > 0.1));
    assert_eq!(report.idle_joints.iter().map(|idle| idle.joint).collect::<Vec<_>>(), [3]);
    assert_eq!(with(vec![9], &joints).unwrap_err(), WeightError::Claim { joint: 9, joints: 4 });
}

/// A slot in the flesh holds none of it, but a thing that is around it, as a sword in a hand, and what is given to it.
#[test]
fn slots_hold_things_and_no_flesh() {
    let (mut points, mut triangles) = tube();
    let body = points.len();
    let thing = add_box(&mut points, &mut triangles, Vec3::new(3.6, -0.1, -1.4), Vec3::new(4.0, 0.1, 1.4));
    let mut joints = tube_joints();
    joints[2].head.x = 3.2;
    joints.push(joint([3.8, 0.0, 0.0], Some(2)));
    let with = |slots: Vec<usize>, claims: Vec<usize>, rigid: &[(Range<u32>, u32)]| {
        let settings = WeightSettings { slots, claims, ..WeightSettings::default() };
        skin_weights(&points, &triangles, &joints, rigid, None, &settings, &|_| true).unwrap()
    };
    let held = |weights: &Weights| (0..body).filter(|point| weight(weights, *point, 3) > 0.0).count();
    let plain = with(Vec::new(), Vec::new(), &[]).0;
    assert!(held(&plain) > 10);
    let (weights, report) = with(vec![3], Vec::new(), &[]);
    check_sound(&weights, points.len(), &joints, 8);
    assert_eq!(held(&weights), 0);
    assert!(thing.clone().all(|point| weights.of(point).eq([(3, 1.0)])), "the thing moves as one");
    assert!(report.idle_joints.is_empty(), "{:?}", report.idle_joints);
    // What is given to a slot is no skin: it is told.
    let given = [(thing.start as u32..thing.end as u32, 3)];
    let (weights, report) = with(vec![3], Vec::new(), &given);
    assert_eq!(held(&weights), 0);
    assert!(thing.clone().all(|point| weights.of(point).eq([(3, 1.0)])));
    assert_eq!(report.idle_joints, [IdleJoint { joint: 3, reason: IdleReason::Slot }]);
    // Asked to, it claims skin; and where nothing else may hold any, slots do. Numbers of no joint count for nothing.
    assert_eq!(with(vec![3, 99], vec![3], &[]).0, plain);
    let (weights, report) = with(vec![0, 1, 2, 3], Vec::new(), &[]);
    check_sound(&weights, points.len(), &joints, 8);
    assert!(report.idle_joints.iter().all(|idle| idle.reason != IdleReason::Slot), "{:?}", report.idle_joints);
    assert!((0..body).any(|point| weight(&weights, point, 0) > 0.9));
}

/// A figure of plates: its hips lie in the air between two of them, which nothing encloses, and the root on the ground below.
/// Hips, legs and trunk hold their own plates.
#[test]
fn figures_of_plates_are_held_by_their_bones() {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let mut add = |low: [f32; 3], high: [f32; 3]| add_box(&mut points, &mut triangles, low.into(), high.into());
    let front = add([-0.9, 1.8, 0.4], [0.9, 2.6, 0.5]);
    let back = add([-0.9, 1.8, -0.5], [0.9, 2.6, -0.4]);
    let legs = [add([0.4, 0.35, -0.2], [0.8, 1.7, 0.2]), add([-0.8, 0.35, -0.2], [-0.4, 1.7, 0.2])];
    let trunk = add([-0.9, 2.8, -0.5], [0.9, 4.0, 0.5]);
    // A strap makes one piece of the two plates around the hips.
    triangles.push([front.start + 1, front.start + 3, back.start + 5].map(|point| point as u32));
    let joints = [
        joint([0.0, 0.0, 0.0], None),
        joint([0.0, 2.2, 0.0], Some(0)),
        joint([0.0, 2.9, 0.0], Some(1)),
        joint([0.0, 3.2, 0.0], Some(2)),
        joint([0.0, 3.6, 0.0], Some(3)),
        joint([0.0, 3.9, 0.0], Some(4)),
        joint([0.6, 1.8, 0.0], Some(1)),
        joint([0.6, 0.1, 0.0], Some(6)),
        joint([-0.6, 1.8, 0.0], Some(1)),
        joint([-0.6, 0.1, 0.0], Some(8)),
    ];
    let (weights, report) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
    let held = |mut piece: Range<usize>, by: &[u32]| {
        piece.all(|point| by.iter().map(|joint| weight(&weights, point, *joint)).sum::<f32>() > 0.99)
    };
    assert!(held(front, &[1]) && held(back, &[1]), "the hips hold their plates: {:?}", report.stiff_pieces);
    let [left, right] = legs;
    assert!(held(left, &[6, 7]) && held(right, &[8, 9]), "the legs hold theirs: {:?}", report.stiff_pieces);
    assert!(held(trunk, &[2, 3, 4, 5]), "the spine holds the trunk: {:?}", report.stiff_pieces);
    // The root on the ground holds nothing.
    assert!((0..points.len()).all(|point| weight(&weights, point, 0) == 0.0));
}

/// Legs that end at the knee, while foot and toe hang on the target of the leg: far from the body's bones they hold their
/// flesh. Handles beside the body's own bones and small ones just behind its last joint hold nothing.
#[test]
fn feet_that_hang_on_targets_hold_flesh_and_handles_none() {
    let (points, triangles) = tube();
    let bound = |chain: [f32; 6], handles: [f32; 3]| {
        let mut joints = vec![joint([0.0, -6.0, 0.0], None)];
        joints.extend(chain.iter().enumerate().map(|(above, x)| joint([*x, 0.0, 0.0], Some(above))));
        let parents = [0, 7, 8];
        joints.extend(handles.iter().zip(parents).map(|(x, parent)| joint([*x, 0.0, 0.0], Some(parent))));
        let weights = bind(&points, &triangles, &joints).0;
        check_sound(&weights, points.len(), &joints, 8);
        weights
    };
    let held = |weights: &Weights, point: usize| (7..10).map(|joint| weight(weights, point, joint)).sum::<f32>();
    let feet = bound([0.1, 0.3, 0.5, 0.7, 0.9, 1.2], [3.0, 3.0, 3.4]);
    for (point, place) in points.iter().enumerate() {
        let held = held(&feet, point);
        assert!(place.x < 3.45 || held > 0.9, "{held} of the foot at {place}");
        assert!(place.x > 1.55 || held < 0.1, "{held} of the leg at {place}");
    }
    for (chain, handles) in
        [([0.1, 0.5, 1.2, 2.0, 3.0, 3.6], [3.0, 3.0, 3.4]), ([0.1, 0.3, 0.5, 0.7, 1.2, 3.0], [3.2, 3.2, 3.25])]
    {
        let weights = bound(chain, handles);
        assert!((0..points.len()).all(|point| held(&weights, point) == 0.0), "handles at {handles:?}");
    }
}

/// A thing inside of the tube where two bones meet, as a tooth, moves with one joint; one that lies on the tube there, as a
/// button, keeps the shares of the skin around it.
#[test]
fn small_things_inside_of_flesh_move_with_one_joint() {
    let (mut points, mut triangles) = tube();
    let tooth = add_box(&mut points, &mut triangles, Vec3::new(1.9, -0.1, -0.1), Vec3::new(2.1, 0.1, 0.1));
    let button = add_box(&mut points, &mut triangles, Vec3::new(1.95, 0.32, -0.05), Vec3::new(2.05, 0.36, 0.05));
    let (weights, report) = bind(&points, &triangles, &tube_joints());
    check_sound(&weights, points.len(), &tube_joints(), 8);
    let row = |point: usize| weights.of(point).collect::<Vec<_>>();
    let [(joint, share)] = row(tooth.start)[..] else { panic!("{:?}", row(tooth.start)) };
    assert!(joint < 2 && share == 1.0 && tooth.clone().all(|point| row(point) == [(joint, 1.0)]));
    assert!(row(button.start).len() > 1 && button.clone().all(|point| row(point) == row(button.start)));
    let told = |piece: &Range<usize>| report.stiff_pieces.iter().find(|told| told.first as usize == piece.start);
    assert_eq!(told(&tooth).map(|told| (told.joint, told.share)), Some((joint as usize, 1.0)));
    assert!(told(&button).is_some_and(|told| told.share < 0.8), "{:?}", report.stiff_pieces);
}

/// A foot of one joint that hangs on the root while the leg ends at the knee holds its flesh without being asked to claim it;
/// a target of one joint beside the leg's own bones, or where the leg ends, holds nothing.
#[test]
fn lone_feet_hold_flesh_and_lone_targets_none() {
    let (points, triangles) = tube();
    let bound = |chain: [f32; 6], foot: f32| {
        let mut joints = vec![joint([0.0, -6.0, 0.0], None)];
        joints.extend(chain.iter().enumerate().map(|(above, x)| joint([*x, 0.0, 0.0], Some(above))));
        joints.push(joint([foot, 0.0, 0.0], Some(0)));
        let weights = bind(&points, &triangles, &joints).0;
        check_sound(&weights, points.len(), &joints, 8);
        weights
    };
    for foot in [3.2, 3.4] {
        let weights = bound([0.1, 0.3, 0.5, 0.7, 0.9, 1.2], foot);
        for (point, place) in points.iter().enumerate() {
            let held = weight(&weights, point, 7);
            assert!(place.x < 3.15 || held > 0.9, "{held} of the foot at {place}");
            assert!(place.x > 1.25 || held < 0.1, "{held} of the leg at {place}");
        }
    }
    for (chain, target) in [([0.1, 0.5, 1.2, 2.0, 3.0, 3.6], 3.3), ([0.1, 0.5, 1.0, 1.5, 2.0, 3.2], 3.6)] {
        let weights = bound(chain, target);
        assert!((0..points.len()).all(|point| weight(&weights, point, 7) == 0.0), "a target at {target}");
    }
}

/// Rings around the second bone, from close behind the joint to close before the bone's end, move with it alone, and some
/// around the first bone with that.
#[test]
fn rings_move_with_the_bone_inside_of_them() {
    const SIDES: u32 = 12;
    let (tube_points, tube_triangles) = tube();
    for (place, bone) in [(1.7, 0), (1.9, 0), (2.1, 1), (2.2, 1), (2.4, 1), (3.0, 1), (3.6, 1)] {
        let (mut points, mut triangles) = (tube_points.clone(), tube_triangles.clone());
        let first = points.len();
        for side in 0..SIDES {
            let turn = glam::Quat::from_rotation_x(side as f32 * std::f32::consts::TAU / SIDES as f32);
            for [x, y] in [[-0.06, 0.46], [-0.06, 0.56], [0.06, 0.56], [0.06, 0.46]] {
                points.push(turn * Vec3::new(0.0, y, 0.0) + Vec3::X * (place + x));
            }
            for edge in 0..4 {
                let at = |side: u32, edge: u32| first as u32 + side % SIDES * 4 + edge % 4;
                let [a, b, c, d] = [at(side, edge), at(side, edge + 1), at(side + 1, edge + 1), at(side + 1, edge)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let (weights, report) = bind(&points, &triangles, &tube_joints());
        check_sound(&weights, points.len(), &tube_joints(), 8);
        for point in first..points.len() {
            let row: Vec<(u32, f32)> = weights.of(point).collect();
            assert_eq!(row, [(bone, 1.0)], "a ring at {place}");
        }
        assert_eq!(report.stiff, points.len() - first);
    }
}

/// Legs that are parts of their own below a robe, or that begin in a short trunk, leave it to the hips and the spine; shorts
/// that are one piece with the trunk follow the thighs.
#[test]
fn robes_hang_from_the_hips_and_shorts_follow_the_thighs() {
    let joints = [
        joint([0.0, 2.5, 0.0], None),
        joint([0.0, 3.2, 0.0], Some(0)),
        joint([0.0, 3.9, 0.0], Some(1)),
        joint([0.4, 2.1, 0.0], Some(0)),
        joint([0.4, 1.0, 0.0], Some(3)),
        joint([0.4, 0.2, 0.0], Some(4)),
        joint([-0.4, 2.1, 0.0], Some(0)),
        joint([-0.4, 1.0, 0.0], Some(6)),
        joint([-0.4, 0.2, 0.0], Some(7)),
    ];
    let figure = |hem: f32| {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        let mut add = |low: [f32; 3], high: [f32; 3]| add_box(&mut points, &mut triangles, low.into(), high.into());
        let trunk = add([-0.9, hem, -0.5], [0.9, 4.0, 0.5]);
        let legs = [add([0.25, 0.0, -0.2], [0.65, 2.2, 0.2]), add([-0.65, 0.0, -0.2], [-0.25, 2.2, 0.2])];
        (points, triangles, trunk, legs)
    };
    let of_legs = |weights: &Weights, point: usize| (3..9).map(|joint| weight(weights, point, joint)).sum::<f32>();
    // A robe over most of the thighs, and a trunk over a quarter of them.
    for hem in [1.4, 1.8] {
        let (points, triangles, mut trunk, legs) = figure(hem);
        let weights = bind(&points, &triangles, &joints).0;
        check_sound(&weights, points.len(), &joints, 8);
        assert!(trunk.all(|point| of_legs(&weights, point) == 0.0), "a trunk down to {hem}");
        for mut leg in legs {
            assert!(leg.all(|point| of_legs(&weights, point) > 0.99), "legs below a trunk down to {hem}");
        }
    }
    let (mut points, mut triangles, trunk, _) = figure(2.3);
    for low in [0.1, -0.8] {
        let short = add_box(&mut points, &mut triangles, Vec3::new(low, 1.2, -0.4), Vec3::new(low + 0.7, 2.25, 0.4));
        // A strap makes one piece of the shorts and the trunk.
        triangles.push([trunk.start, trunk.start + 1, short.start + 2].map(|point| point as u32));
        let weights = bind(&points, &triangles, &joints).0;
        check_sound(&weights, points.len(), &joints, 8);
        let hem = short.filter(|point| points[*point].y < 1.5);
        let held: Vec<f32> = hem.map(|point| of_legs(&weights, point)).collect();
        assert!(held.len() == 4 && held.iter().all(|held| *held > 0.5), "{held:?} of the hem at {low}");
    }
}
