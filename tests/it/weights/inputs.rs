//! Weights of bad, odd and dense meshes.

use super::*;

#[test]
fn bad_input_is_named() {
    let (points, triangles) = tube();
    let joints = tube_joints();
    let settings = WeightSettings::default();
    let bind = |points: &[Vec3], triangles: &[[u32; 3]], joints: &[WeightJoint]| {
        skin_weights(points, triangles, joints, &[], None, &settings, &|_| true).map(|_| ())
    };
    let mut broken = points.clone();
    broken[7].y = f32::NAN;
    assert_eq!(bind(&broken, &triangles, &joints), Err(WeightError::Point { point: 7 }));
    broken[7].y = f32::INFINITY;
    assert_eq!(bind(&broken, &triangles, &joints), Err(WeightError::Point { point: 7 }));
    assert_eq!(bind(&points, &triangles, &[]), Err(WeightError::NoJoints));
    assert_eq!(bind(&points, &[[0, 1, 999]], &joints), Err(WeightError::Triangle { triangle: 0 }));
    assert_eq!(
        bind(&points, &triangles, &[joint([0.0; 3], None), joint([f32::NAN; 3], Some(0))]),
        Err(WeightError::Joint { joint: 1 })
    );
    for parents in [[Some(1), Some(0)], [None, Some(1)], [None, Some(5)]] {
        let joints = parents.map(|parent| joint([0.0; 3], parent));
        assert!(matches!(bind(&points, &triangles, &joints), Err(WeightError::Parent { .. })), "{parents:?}");
    }
    let twist = |joint: usize, end| WeightJoint { twist: Some(TwistBone { joint, end }), ..joints[2] };
    for broken in [twist(9, Vec3::X), twist(2, Vec3::X), twist(0, Vec3::NAN)] {
        assert_eq!(bind(&points, &triangles, &[joints[0], joints[1], broken]), Err(WeightError::Twist { joint: 2 }));
    }
    let rigid = skin_weights(&points, &triangles, &joints, &[(0..9999, 0)], None, &settings, &|_| true);
    assert_eq!(rigid.map(|_| ()), Err(WeightError::Rigid { part: 0 }));
    let locks = Locks { weights: &Weights::default(), joints: &[true] };
    let locked = skin_weights(&points, &triangles, &joints, &[], Some(locks), &settings, &|_| true);
    assert_eq!(locked.map(|_| ()), Err(WeightError::Locks { points: 0, joints: 1 }));
    let cancelled = skin_weights(&points, &triangles, &joints, &[], None, &settings, &|share| share < 0.5);
    assert_eq!(cancelled.map(|_| ()), Err(WeightError::Cancelled));
}

#[test]
fn odd_input_gives_weights() {
    let (points, triangles) = tube();
    let joints = tube_joints();
    let all_at_one_point = vec![Vec3::ONE; 30];
    let fan: Vec<[u32; 3]> = (1..40).map(|i| [0, i, i + 1]).collect();
    let many_here: Vec<WeightJoint> = (0..100_000).map(|i| joint([1.0, 0.0, 0.0], (i > 0).then_some(0))).collect();
    let chain_here: Vec<WeightJoint> = (0..100_000usize).map(|i| joint([1.0, 0.0, 0.0], i.checked_sub(1))).collect();
    let many_apart: Vec<WeightJoint> = (0..5000)
        .map(|i| joint([i as f32 * 8e-4, 0.1, (i % 7) as f32 * 0.01], (i > 0).then(|| i as usize - 1)))
        .collect();
    for (name, points, triangles, joints) in [
        ("no points", &[][..], &[][..], &joints[..]),
        ("no triangles", &points[..], &[][..], &joints[..]),
        ("one place", &all_at_one_point[..], &[[0, 1, 2]][..], &joints[..]),
        ("a fin on one edge", &points[..], &fan[..], &joints[..]),
        ("siblings at one place", &points[..], &triangles[..], &many_here[..]),
        ("a chain at one place", &points[..], &triangles[..], &chain_here[..]),
        ("many joints", &points[..], &triangles[..], &many_apart[..]),
    ] {
        let (weights, _) = bind(points, triangles, joints);
        check_sound(&weights, points.len(), joints, 8);
        println!("{name} is sound");
    }
    let far: Vec<WeightJoint> = joints.iter().map(|&j| WeightJoint { head: j.head + Vec3::splat(1e30), ..j }).collect();
    check_sound(&bind(&points, &triangles, &far).0, points.len(), &far, 8);
}

#[test]
fn many_triangles_at_one_place_fit_the_stack_of_a_thread() {
    let fan: Vec<Vec3> =
        (0..25_002).map(|i| if i == 0 { Vec3::ZERO } else { Vec3::new(1.0, i as f32 * 4e-5, 0.0) }).collect();
    let blades: Vec<[u32; 3]> = (1..25_001).map(|i| [0, i, i + 1]).collect();
    let joints = [joint([0.0, 0.0, 0.0], None), joint([0.5, 0.2, 0.0], Some(0)), joint([1.0, 0.5, 0.0], Some(1))];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).stack_size(1 << 20).build().unwrap();
    pool.install(|| {
        let (weights, _) = bind(&fan, &blades, &joints);
        check_sound(&weights, fan.len(), &joints, 8);
        let (weights, _) = bind(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[[0, 1, 2]; 22_000], &joints);
        check_sound(&weights, 3, &joints, 8);
    });
}

#[test]
fn dense_meshes_are_bound_like_sparse_ones() {
    // 50,000 points, more than are bound one by one.
    let (around, along) = (100usize, 500usize);
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..along {
        for side in 0..around {
            // A square section, walked at even steps.
            let t = side as f32 / around as f32 * 4.0;
            let (edge, at) = (t as usize, t.fract() * 0.6 - 0.3);
            let [y, z] = [[at, -0.3], [0.3, at], [-at, 0.3], [-0.3, -at]][edge];
            points.push(Vec3::new(ring as f32 / (along - 1) as f32 * 4.0, y, z));
        }
    }
    for ring in 0..along - 1 {
        for side in 0..around {
            let (a, b) = ((ring * around + side) as u32, (ring * around + (side + 1) % around) as u32);
            let up = around as u32;
            triangles.extend([[a, b, b + up], [a, b + up, a + up]]);
        }
    }
    let joints = tube_joints();
    let (weights, report) = bind(&points, &triangles, &joints);
    check_sound(&weights, points.len(), &joints, 8);
    assert_eq!(report.by_surface, points.len());
    let line: Vec<f32> = (0..along).map(|ring| weight(&weights, ring * around + around / 8, 0)).collect();
    assert!(line[0] > 0.98 && line[along - 1] < 0.02 && (0.35..0.65).contains(&line[along / 2]), "{}", line[along / 2]);
    assert!(line.windows(2).all(|w| (w[0] - w[1]).abs() < 0.04), "the blend has steps");
    let settings = WeightSettings { method: Method::Voxel, voxel_resolution: 64, ..WeightSettings::default() };
    let (weights, _) = skin_weights(&points, &triangles, &joints, &[], None, &settings, &|_| true).unwrap();
    check_sound(&weights, points.len(), &joints, 8);
}
