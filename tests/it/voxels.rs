//! Solid voxels and geodesic voxel binding, on shapes with known answers and on real bodies.

use std::collections::BTreeMap;

use glam::Vec3;
use rigsmith::{
    algo::weights::{
        bone::BoneSegment,
        voxel_bind::{VoxelError, VoxelSettings, geodesic_voxel_weights},
    },
    mesh::{
        model::Weights,
        voxels::{VoxelizeError, Voxels},
    },
};

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// A box with `n` by `n` quads a side, welded at no edge.
fn cuboid(low: Vec3, high: Vec3, n: u32) -> Mesh {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, 1] {
            for i in 0..n {
                for j in 0..n {
                    let base = points.len() as u32;
                    for (a, b) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
                        let mut t = Vec3::ZERO;
                        t[axis] = side as f32;
                        t[u] = a as f32 / n as f32;
                        t[v] = b as f32 / n as f32;
                        points.push(low + (high - low) * t);
                    }
                    let quad = if side == 1 { [0, 1, 2, 3] } else { [3, 2, 1, 0] };
                    triangles.push([base + quad[0], base + quad[1], base + quad[2]]);
                    triangles.push([base + quad[0], base + quad[2], base + quad[3]]);
                }
            }
        }
    }
    (points, triangles)
}

fn join(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh::default();
    for (points, triangles) in meshes {
        let base = all.0.len() as u32;
        all.0.extend(points);
        all.1.extend(triangles.iter().map(|t| t.map(|c| c + base)));
    }
    all
}

fn bone(joint: u32, head: [f32; 3], tail: [f32; 3]) -> BoneSegment {
    BoneSegment { joint, head: Vec3::from_array(head), tail: Vec3::from_array(tail) }
}

fn bind(mesh: &Mesh, bones: &[BoneSegment], settings: &VoxelSettings) -> Result<Weights, VoxelError> {
    geodesic_voxel_weights(&mesh.0, &mesh.1, bones, settings, &|_| true)
}

/// True if the solid cell around a point is there.
fn solid(voxels: &Voxels, x: f32, y: f32, z: f32) -> bool {
    voxels.cell_at(voxels.to_grid(Vec3::new(x, y, z))).is_some_and(|cell| voxels.solid_index(cell).is_some())
}

#[test]
fn boxes_are_solid_whatever_their_triangles_are_like() {
    let whole = cuboid(Vec3::ZERO, Vec3::new(2.0, 1.0, 1.0), 12);
    let flipped: Mesh = (whole.0.clone(), whole.1.iter().map(|t| [t[0], t[2], t[1]]).collect());
    let mixed = (
        whole.0.clone(),
        whole.1.iter().enumerate().map(|(i, t)| if i % 2 == 0 { *t } else { [t[0], t[2], t[1]] }).collect(),
    );
    let open: Mesh = (whole.0.clone(), whole.1[288..].to_vec());
    let mut state = 1u32;
    let torn = (
        whole.0.clone(),
        whole
            .1
            .chunks(2)
            .filter(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                state >> 16 > 21845
            })
            .flatten()
            .copied()
            .collect::<Vec<_>>(),
    );
    let inner = cuboid(Vec3::new(0.3, 0.3, 0.3), Vec3::new(0.7, 0.7, 0.7), 4);
    let inside_out: Mesh = (inner.0.clone(), inner.1.iter().map(|t| [t[0], t[2], t[1]]).collect());
    let nested = join([whole.clone(), inside_out]);
    let crossing = join([whole.clone(), cuboid(Vec3::new(1.0, 0.2, 0.2), Vec3::new(2.5, 0.8, 0.8), 3)]);
    let cases: [(&str, &Mesh); 7] = [
        ("whole", &whole),
        ("flipped", &flipped),
        ("faces in both directions", &mixed),
        ("one end open", &open),
        ("a third of faces missing", &torn),
        ("an inside-out shell inside", &nested),
        ("a shell that crosses it", &crossing),
    ];
    for (name, mesh) in cases {
        let voxels = Voxels::new(&mesh.0, &mesh.1, 64, None).unwrap();
        let (mut inside, mut outside) = ((0, 0), (0, 0));
        for i in 0..4000u32 {
            // Low-discrepancy samples of a box twice as large.
            let sample = |step: f64| ((f64::from(i) * step).fract() * 2.0 - 0.5) as f32;
            let (x, y, z) = (sample(0.819_172_513) * 2.0, sample(0.671_043_607), sample(0.549_700_478));
            let margin = 0.08;
            let deep = (margin..2.0 - margin).contains(&x)
                && (margin..1.0 - margin).contains(&y)
                && (margin..1.0 - margin).contains(&z);
            let far = !(-margin..2.6).contains(&x)
                || !(-margin..1.0 + margin).contains(&y)
                || !(-margin..1.0 + margin).contains(&z);
            let hit = usize::from(solid(&voxels, x, y, z));
            if deep {
                inside = (inside.0 + hit, inside.1 + 1);
            } else if far {
                outside = (outside.0 + hit, outside.1 + 1);
            }
        }
        assert!(inside.1 > 300 && outside.1 > 1000);
        assert!(inside.0 as f32 >= 0.97 * inside.1 as f32, "{name}: {inside:?} inside");
        assert!(outside.0 as f32 <= 0.01 * outside.1 as f32, "{name}: {outside:?} outside");
    }
}

#[test]
fn surface_cells_cover_every_triangle() {
    let mesh = join([
        cuboid(Vec3::ZERO, Vec3::new(1.0, 0.7, 0.4), 1),
        (vec![Vec3::new(-0.3, 0.1, 0.0), Vec3::new(1.2, 0.9, 0.5), Vec3::new(0.1, -0.4, 0.9)], vec![[0, 1, 2]]),
    ]);
    let voxels = Voxels::new(&mesh.0, &mesh.1, 40, None).unwrap();
    for triangle in &mesh.1 {
        let [a, b, c] = triangle.map(|i| mesh.0[i as usize]);
        for i in 0..=60 {
            for j in 0..=60 - i {
                let p = a + (b - a) * (i as f32 / 60.0) + (c - a) * (j as f32 / 60.0);
                assert!(solid(&voxels, p.x, p.y, p.z), "{p} is on a triangle");
            }
        }
    }
    assert_eq!(voxels.cells().len(), voxels.len());
    for (index, cell) in voxels.cells().iter().enumerate() {
        assert_eq!(voxels.solid_index(cell.map(usize::from)), Some(index));
    }
}

#[test]
fn paths_stay_inside_the_body() {
    // Two bars side by side, joined at one end: near each other, far apart inside.
    let mesh = join([
        cuboid(Vec3::ZERO, Vec3::new(2.0, 0.2, 0.2), 10),
        cuboid(Vec3::new(0.0, 0.3, 0.0), Vec3::new(2.0, 0.5, 0.2), 10),
        cuboid(Vec3::ZERO, Vec3::new(0.2, 0.5, 0.2), 10),
    ]);
    let bones = [bone(3, [1.0, 0.1, 0.1], [1.95, 0.1, 0.1]), bone(8, [1.0, 0.4, 0.1], [1.95, 0.4, 0.1])];
    let weights = bind(&mesh, &bones, &VoxelSettings { resolution: 96, ..VoxelSettings::default() }).unwrap();
    for (p, &place) in mesh.0.iter().enumerate() {
        let sum: f32 = weights.of(p).map(|w| w.1).sum();
        assert!((sum - 1.0).abs() < 1e-5, "point {p} sums to {sum}");
        if place.x > 1.0 {
            let own = if place.y < 0.25 { 3 } else { 8 };
            let share = weights.of(p).find(|w| w.0 == own).map_or(0.0, |w| w.1);
            assert!(share > 0.99, "{place} belongs to bone {own} but has {:?}", weights.of(p).collect::<Vec<_>>());
        }
    }
}

#[test]
fn weights_blend_smoothly_and_evenly_across_a_joint() {
    let mesh = cuboid(Vec3::new(-1.0, -0.1, -0.1), Vec3::new(1.0, 0.1, 0.1), 40);
    let bones = [bone(0, [-0.95, 0.0, 0.0], [0.0; 3]), bone(1, [0.0; 3], [0.95, 0.0, 0.0])];
    for scale in [1.0, 0.001, 1000.0] {
        let points: Vec<Vec3> = mesh.0.iter().map(|&p| p * scale).collect();
        let bones = bones.map(|b| BoneSegment { head: b.head * scale, tail: b.tail * scale, ..b });
        let weights = bind(&(points, mesh.1.clone()), &bones, &VoxelSettings::default()).unwrap();
        let mut along: BTreeMap<i32, Vec<f32>> = BTreeMap::new();
        for (p, place) in mesh.0.iter().enumerate() {
            let share = weights.of(p).find(|w| w.0 == 1).map_or(0.0, |w| w.1);
            along.entry((place.x * 100.0).round() as i32).or_default().push(share);
        }
        let mut last = 0.0;
        for (x, shares) in along {
            let mean = shares.iter().sum::<f32>() / shares.len() as f32;
            assert!(mean >= last - 0.02, "unit {scale}: rises along the bar, {mean} after {last} at {x}");
            assert!(x.abs() > 4 || mean - last < 0.45, "unit {scale}: from {last} to {mean} at {x} is a step");
            match x {
                0 => assert!((mean - 0.5).abs() < 0.03, "unit {scale}: {mean} at the joint"),
                _ if x < -25 => assert!(mean < 0.01, "unit {scale}: {mean} at {x}"),
                _ if x > 25 => assert!(mean > 0.99, "unit {scale}: {mean} at {x}"),
                _ => {}
            }
            last = mean;
        }
    }
}

#[test]
fn several_segments_of_a_joint_are_one() {
    let mesh = cuboid(Vec3::ZERO, Vec3::new(3.0, 0.2, 0.2), 20);
    let bones = [
        bone(5, [0.1, 0.1, 0.1], [1.0, 0.1, 0.1]),
        bone(2, [1.0, 0.1, 0.1], [2.0, 0.1, 0.1]),
        bone(5, [2.0, 0.1, 0.1], [2.9, 0.1, 0.1]),
    ];
    let weights = bind(&mesh, &bones, &VoxelSettings::default()).unwrap();
    for (p, place) in mesh.0.iter().enumerate() {
        assert!(weights.of(p).len() <= 2);
        let own = if (1.0..2.0).contains(&place.x) { 2 } else { 5 };
        if (place.x - 1.0).abs() > 0.15 && (place.x - 2.0).abs() > 0.15 {
            assert_eq!(weights.of(p).next().map(|w| w.0), Some(own), "{place}");
        }
    }
}

#[test]
fn what_no_bone_reaches_stays_empty() {
    let mesh = join([
        cuboid(Vec3::ZERO, Vec3::ONE, 6),
        cuboid(Vec3::splat(1.3), Vec3::splat(1.35), 1),
        cuboid(Vec3::splat(1e9), Vec3::splat(2e9), 1),
        (vec![Vec3::NAN, Vec3::new(50.0, 0.0, 0.0)], vec![]),
    ]);
    let weights = bind(&mesh, &[bone(0, [0.2, 0.5, 0.5], [0.8, 0.5, 0.5])], &VoxelSettings::default()).unwrap();
    assert_eq!(weights.len(), mesh.0.len());
    let body = 6 * 36 * 4;
    assert!((0..body).all(|p| weights.of(p).len() == 1), "the body is bound although something is very far away");
    assert!((body..weights.len()).all(|p| weights.of(p).len() == 0));
}

#[test]
fn hostile_input_gets_an_answer() {
    let some = [bone(0, [0.0; 3], [1.0, 0.0, 0.0])];
    let cube = cuboid(Vec3::ZERO, Vec3::ONE, 1);
    let settings = VoxelSettings::default();
    let flat = (cube.0.iter().map(|p| Vec3::new(p.x, p.y, 0.0)).collect(), cube.1.clone());
    let line = (cube.0.iter().map(|p| Vec3::new(p.x, 0.0, 0.0)).collect(), cube.1.clone());
    let dot = (vec![Vec3::splat(0.25); cube.0.len()], cube.1.clone());
    let huge = (cube.0.iter().map(|p| (*p - 0.5) * f32::MAX).collect(), cube.1.clone());
    let tiny = (cube.0.iter().map(|p| *p * 1e-40).collect(), cube.1.clone());
    let nan = (cube.0.iter().enumerate().map(|(i, p)| if i == 3 { Vec3::NAN } else { *p }).collect(), cube.1.clone());
    for (name, mesh) in [("flat", flat), ("line", line), ("dot", dot), ("huge", huge), ("tiny", tiny), ("nan", nan)] {
        let bones = [some[0], bone(1, [f32::MAX, 0.0, 0.0], [f32::MIN, 1.0, 0.0]), bone(2, [f32::NAN; 3], [0.0; 3])];
        for bones in [&bones[..], &bones[..1]] {
            let weights = bind(&mesh, bones, &settings).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(weights.len(), mesh.0.len());
            assert!(weights.values.iter().all(|w| w.is_finite() && *w > 0.0), "{name}");
        }
    }
    let none = (cube.0.clone(), vec![]);
    assert_eq!(bind(&none, &some, &settings), Err(VoxelError::Mesh(VoxelizeError::NoSurface)));
    let wrong = (cube.0.clone(), vec![[0, 1, 99]]);
    let out = VoxelizeError::PointOutOfRange { triangle: 0, point: 99, points: 24 };
    assert_eq!(bind(&wrong, &some, &settings), Err(VoxelError::Mesh(out)));
    assert_eq!(bind(&cube, &[], &settings), Err(VoxelError::NoBones));
    assert_eq!(bind(&cube, &[bone(0, [f32::NAN; 3], [0.0; 3])], &settings), Err(VoxelError::NoBones));
    let extreme =
        VoxelSettings { resolution: usize::MAX, labels: usize::MAX, falloff: f32::NAN, sharpness: 0, influences: 0 };
    assert!(bind(&(cube.0[..4].to_vec(), cube.1[..2].to_vec()), &some, &extreme).is_ok());
    let zero = VoxelSettings { resolution: 0, labels: 0, ..settings.clone() };
    assert!(bind(&cube, &some, &zero).is_ok());
    let many: Vec<BoneSegment> = (0..200_000).map(|i| bone(i, [0.5; 3], [0.5; 3])).collect();
    assert!(bind(&cube, &many, &settings).is_ok(), "joints at one point");
    let away: Vec<BoneSegment> = (0..20_000).map(|i| bone(i, [0.5, 0.5, 2.0], [0.5, 0.5, 3.0])).collect();
    assert!(bind(&cube, &away, &VoxelSettings { resolution: 32, ..settings.clone() }).is_ok(), "bones outside");
    // Thousands of triangles as large as the grid: coarser voxels instead of hours.
    let fan: Vec<[u32; 3]> = (0..30_000).map(|i| [i % 24, (i / 24) % 24, (i / 576) % 24]).collect();
    assert!(bind(&(cube.0.clone(), fan), &some, &settings).is_ok());
}

#[test]
fn progress_rises_and_cancels() {
    let mesh = cuboid(Vec3::ZERO, Vec3::ONE, 4);
    let bones = [bone(0, [0.2; 3], [0.8; 3])];
    let seen = std::sync::Mutex::new(Vec::new());
    let run = |stop: f32| {
        geodesic_voxel_weights(&mesh.0, &mesh.1, &bones, &VoxelSettings::default(), &|share| {
            seen.lock().unwrap().push(share);
            share < stop
        })
    };
    assert!(run(2.0).is_ok());
    let shares = std::mem::take(&mut *seen.lock().unwrap());
    assert!(shares.is_sorted() && shares.first() == Some(&0.0) && shares.last() == Some(&1.0), "{shares:?}");
    for stop in [0.0, 0.1, 0.5, 1.0] {
        assert_eq!(run(stop), Err(VoxelError::Cancelled));
    }
}

#[test]
fn the_same_for_any_number_of_threads() {
    let mesh = join([cuboid(Vec3::ZERO, Vec3::new(2.0, 1.0, 0.5), 20), cuboid(Vec3::splat(0.4), Vec3::splat(1.4), 9)]);
    let bones = [
        bone(0, [0.1, 0.5, 0.2], [1.0, 0.5, 0.2]),
        bone(1, [1.0, 0.5, 0.2], [1.9, 0.5, 0.3]),
        bone(2, [0.9; 3], [1.3; 3]),
    ];
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bind(&mesh, &bones, &VoxelSettings { resolution: 64, ..VoxelSettings::default() }).unwrap())
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(7));
}

#[test]
fn bodies_are_bound_well_even_with_a_third_of_faces_missing() {
    let Some(data) = crate::prerequisites::test_data() else { return };
    let bodies = data.join("bodies");
    let json = |path: &str| -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(bodies.join(path)).unwrap()).unwrap()
    };
    let vector = |v: &serde_json::Value| Vec3::from_array([0, 1, 2].map(|i| v[i].as_f64().unwrap() as f32));
    // Bone heat of Blender has 0.233 and 0.159 on this body.
    for (rig, most) in [("game_engine", 0.27), ("mixamo", 0.18)] {
        let truth = json(&format!("gt_weights_{rig}.json"));
        let joints = json("male_young/joints.json");
        let mut points = Vec::new();
        let mut quads: Vec<Vec<u32>> = Vec::new();
        for line in std::fs::read_to_string(bodies.join("male_young/body.obj")).unwrap().lines() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => points.push(Vec3::from_array([0; 3].map(|_: i32| words.next().unwrap().parse().unwrap()))),
                Some("f") => {
                    quads.push(words.map(|w| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1).collect())
                }
                _ => {}
            }
        }
        let bones: Vec<BoneSegment> = truth["bone_order"]
            .as_array()
            .unwrap()
            .iter()
            .enumerate()
            .filter_map(|(i, name)| {
                let bone = &joints[rig][name.as_str()?];
                let used = name != "Root" && !bone.is_null();
                used.then(|| BoneSegment { joint: i as u32, head: vector(&bone["head"]), tail: vector(&bone["tail"]) })
            })
            .collect();
        let mut state = 7u32;
        let torn: Vec<Vec<u32>> = quads
            .iter()
            .filter(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                state >> 16 > 21845
            })
            .cloned()
            .collect();
        for (name, quads, most) in [("whole", quads, most), ("torn", torn, most * 1.04)] {
            let triangles: Vec<[u32; 3]> =
                quads.iter().flat_map(|f| (2..f.len()).map(|i| [f[0], f[i - 1], f[i]])).collect();
            let weights =
                geodesic_voxel_weights(&points, &triangles, &bones, &VoxelSettings::default(), &|_| true).unwrap();
            let mut sum = 0.0;
            for p in 0..points.len() {
                let mut difference: BTreeMap<u32, f32> = weights.of(p).collect();
                for entry in truth["weights"][p].as_array().unwrap() {
                    *difference.entry(entry[0].as_u64().unwrap() as u32).or_default() -=
                        entry[1].as_f64().unwrap() as f32;
                }
                sum += difference.values().map(|d| d.abs() / 2.0).sum::<f32>();
            }
            let error = sum / points.len() as f32;
            println!("{rig} {name}: {error:.4}");
            assert!(error < most, "{rig} {name}: {error}");
        }
    }
}
