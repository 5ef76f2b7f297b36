//! Rays, closest points, volumes and skinning, through the public API.

mod nearest;

use glam::{Affine3A, Quat, Vec3};
use rigsmith::mesh::adjacency::{Edge, edges, islands, weld};
use rigsmith::mesh::model::Weights;
use rigsmith::mesh::ray::{Hit, Ray};
use rigsmith::mesh::skinning::{skin_point, skin_points};
use rigsmith::mesh::surface::{PendingSurface, Surface, SurfaceError, Volume, hits_brute, volumes};

use crate::random::Random;

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// A closed bumpy ball of `6 * n * n * 2` triangles, radius about one, with concave dents.
fn ball(n: usize, dent: f32) -> Mesh {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for face in 0..6 {
        for i in 0..=n {
            for j in 0..=n {
                // Exactly the same at the seams of the six faces.
                let [u, v] = [i, j].map(|i| (2.0 * i as f32 - n as f32) / n as f32);
                let side = if face % 2 == 0 { 1.0 } else { -1.0 };
                let mut p = [0.0; 3];
                (p[face / 2], p[(face / 2 + 1) % 3], p[(face / 2 + 2) % 3]) = (side, u * side, v);
                let d = Vec3::from_array(p).normalize();
                let bumps = (d * 5.0).map(|x| (x - x.round()).abs()).to_array();
                points.push(d * (1.0 - dent * (bumps[0] * bumps[1] + bumps[2] * bumps[2])));
            }
        }
        let start = (face * (n + 1) * (n + 1)) as u32;
        for i in 0..n as u32 {
            for j in 0..n as u32 {
                let (a, row) = (start + i * (n as u32 + 1) + j, n as u32 + 1);
                triangles.push([a, a + row, a + row + 1]);
                triangles.push([a, a + row + 1, a + 1]);
            }
        }
    }
    (points, triangles)
}

/// The ball with one point a position.
fn welded(n: usize, dent: f32) -> Mesh {
    let (points, triangles) = ball(n, dent);
    let (numbers, count) = weld(&points);
    let mut single = vec![Vec3::ZERO; count];
    for (point, &number) in points.iter().zip(&numbers) {
        single[number as usize] = *point;
    }
    (single, triangles.iter().map(|t| t.map(|c| numbers[c as usize])).collect())
}

fn scaled((points, triangles): Mesh, scale: f32, offset: Vec3) -> Mesh {
    (points.iter().map(|&p| p * scale + offset).collect(), triangles)
}

fn cube() -> Mesh {
    scaled(welded(1, 0.0), 3.0_f32.sqrt(), Vec3::ZERO)
}

fn towards(origin: Vec3, target: Vec3) -> Ray {
    Ray { origin, direction: (target - origin).normalize() }
}

fn hits_of(surface: &Surface, ray: &Ray) -> Vec<Hit> {
    let mut out = vec![Hit { distance: -1.0, triangle: 0, entering: false }];
    surface.hits(ray, &mut out);
    out
}

fn check_alternates(hits: &[Hit], what: &str) {
    assert_eq!(hits.len() % 2, 0, "{what}: {hits:?}");
    for (i, hit) in hits.iter().enumerate() {
        assert_eq!(hit.entering, i % 2 == 0, "{what}: {hits:?}");
    }
    assert!(hits.windows(2).all(|w| w[0].distance <= w[1].distance), "{what}: {hits:?}");
}

#[test]
fn cube_near_and_far() {
    let (points, triangles) = cube();
    let surface = Surface::build(&points, &triangles);
    assert_eq!(surface.triangle_count(), 12);
    for (origin, near, far) in [
        (Vec3::new(0.3, 0.2, 5.0), 4.0, 6.0),
        (Vec3::new(0.0, 0.0, 5.0), 4.0, 6.0),
        (Vec3::new(0.5, 0.5, 5.0), 4.0, 6.0),
    ] {
        let ray = Ray { origin, direction: Vec3::NEG_Z };
        let (a, b) = surface.near_far(&ray).unwrap();
        assert!((a.distance - near).abs() < 1e-5 && (b.distance - far).abs() < 1e-5, "{a:?} {b:?}");
        assert!(a.entering && !b.entering);
        assert_eq!(surface.closest(&ray), Some(a));
        assert_eq!(hits_of(&surface, &ray), [a, b]);
    }
    let inside = Ray { origin: Vec3::ZERO, direction: Vec3::X };
    let hits = hits_of(&surface, &inside);
    assert!(hits.len() == 1 && !hits[0].entering && (hits[0].distance - 1.0).abs() < 1e-5);
    assert_eq!(surface.near_far(&inside), Some((hits[0], hits[0])));
    let past = Ray { origin: Vec3::new(0.0, 3.0, 5.0), direction: Vec3::NEG_Z };
    assert_eq!((surface.closest(&past), surface.near_far(&past), hits_of(&surface, &past)), (None, None, vec![]));
}

#[test]
fn watertight_at_vertices_and_edges_at_any_scale() {
    for scale in [0.001, 1.0, 1000.0] {
        for (points, triangles) in [
            scaled(cube(), scale, Vec3::ZERO),
            scaled(welded(12, 0.0), scale, Vec3::splat(scale * 3.0)),
            scaled(welded(12, 0.6), scale, Vec3::ZERO),
            scaled(ball(12, 0.6), scale, Vec3::ZERO),
        ] {
            let surface = Surface::build(&points, &triangles);
            let center = points.iter().sum::<Vec3>() / points.len() as f32;
            let mut random = Random(11);
            let mut targets = points.clone();
            targets.extend(triangles.iter().flat_map(|t| {
                let [a, b, c] = t.map(|i| points[i as usize]);
                [(a + b) * 0.5, b.lerp(c, 0.25), (a + b + c) / 3.0]
            }));
            let mut crossed = 0;
            for target in targets {
                let axis = [Vec3::X, Vec3::NEG_Y, Vec3::Z][random.next() as usize % 3];
                for ray in [
                    towards(center + random.direction() * 4.0 * scale, target),
                    Ray { origin: target - axis * (5.0 * scale), direction: axis },
                ] {
                    let hits = hits_of(&surface, &ray);
                    check_alternates(&hits, &format!("scale {scale}, {ray:?}"));
                    crossed += usize::from(!hits.is_empty());
                    let ends = surface.near_far(&ray);
                    assert_eq!(ends.is_some(), !hits.is_empty());
                    if let Some((near, far)) = ends {
                        assert_eq!(near.distance, hits[0].distance);
                        assert_eq!(surface.closest(&ray), Some(near));
                        assert!((far.distance - hits[hits.len() - 1].distance).abs() <= 1e-5 * scale);
                    }
                }
            }
            assert!(crossed > points.len(), "rays at the mesh hit it");
        }
    }
}

#[test]
fn brute_force_gives_the_same_bits() {
    for (seed, (points, triangles)) in
        [welded(14, 0.5), scaled(ball(9, 0.7), 0.001, Vec3::splat(0.5)), soup(3000)].into_iter().enumerate()
    {
        let surface = Surface::build(&points, &triangles);
        let (low, high) = surface.bounds().unwrap();
        let (mut random, mut spans, mut crossed) = (Random(seed as u64), Random(77), [0, 0]);
        let pending = PendingSurface::new(points.clone().into(), triangles.clone().into());
        let mut found = 0;
        for i in 0..1000 {
            let target = low + (random.point() * 0.5 + 0.5) * (high - low);
            let target = if i % 4 == 0 { points[random.next() as usize % points.len()] } else { target };
            let away = (high - low).length() * [1.0, 1.0, 0.3, 300.0][i / 4 % 4];
            let direction = if i % 5 == 0 { Vec3::AXES[i / 5 % 3] } else { random.direction() };
            let ray = match i % 5 {
                0 => Ray { origin: target - direction * away, direction },
                _ => towards((low + high) * 0.5 + direction * away, target),
            };
            let mut brute = Vec::new();
            hits_brute(&points, &triangles, &ray, &mut brute);
            assert_eq!(hits_of(&surface, &ray), brute);
            let [from, to] = [spans.unit(), spans.unit()].map(|share| share * 2.0 * away);
            let is_between = brute.iter().any(|hit| (from.min(to)..from.max(to)).contains(&hit.distance));
            assert_eq!(surface.crosses(&ray, from.min(to), from.max(to)), is_between, "{ray:?} from {from} to {to}");
            crossed[usize::from(is_between)] += 1;
            assert_eq!(
                (pending.near_far(&ray), pending.closest(&ray)),
                (surface.near_far(&ray), surface.closest(&ray))
            );
            found += brute.len();
        }
        assert!(found > 800, "{found}");
        assert!(crossed.iter().all(|count| *count > 50), "{crossed:?}");
        assert!(pending.ready().is_none());
        assert_eq!(pending.build().triangle_count(), surface.triangle_count());
        assert!(pending.into_surface().is_some());
    }
}

/// Triangles of very different sizes, everywhere.
fn soup(count: usize) -> Mesh {
    let mut random = Random(5);
    let mut points = Vec::new();
    for _ in 0..count {
        let (center, size) = (random.point(), 0.5 * random.unit().powi(4));
        points.extend([random.point(), random.point(), random.point()].map(|v| center + v * size));
    }
    (points, (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

#[test]
fn tiny_triangles_are_hit() {
    for size in [1e-12_f32, 1e-6, 1e-3, 1e6] {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|v| v * size);
        let surface = Surface::build(&points, &[[0, 1, 2]]);
        let ray = Ray { origin: Vec3::new(0.25, 0.25, 3.0) * size, direction: Vec3::NEG_Z };
        let hit = surface.closest(&ray).unwrap();
        assert!(hit.entering && (hit.distance / size - 3.0).abs() < 1e-5);
    }
}

#[test]
fn refit_equals_build() {
    let (mut points, triangles) = welded(20, 0.4);
    let mut surface = Surface::build(&points, &triangles);
    assert_eq!(
        surface.refit(&points[1..]),
        Err(SurfaceError::PointCount { expected: points.len(), found: points.len() - 1 })
    );
    let turn = Quat::from_xyzw(0.1, 0.2, 0.3, 0.9).normalize();
    for point in &mut points {
        *point = turn * *point * Vec3::new(1.0, 2.0, 0.5) + Vec3::X * point.y;
    }
    surface.refit(&points).unwrap();
    let built = Surface::build(&points, &triangles);
    assert_eq!(surface.bounds(), built.bounds());
    let mut random = Random(3);
    for _ in 0..2000 {
        let ray = towards(random.direction() * 9.0, random.point());
        assert_eq!(hits_of(&surface, &ray), hits_of(&built, &ray));
        assert_eq!(surface.near_far(&ray), built.near_far(&ray));
    }
    let before = surface.bounds();
    points[7].y = f32::NAN;
    assert_eq!(surface.refit(&points), Err(SurfaceError::Point { point: 7 }));
    assert_eq!(surface.bounds(), before);
}

#[test]
fn threads_change_nothing() {
    let (points, triangles) = welded(60, 0.4);
    let answers = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut surface = Surface::build(&points, &triangles);
            surface.refit(&points.iter().map(|p| *p * 1.1).collect::<Vec<_>>()).unwrap();
            let mut random = Random(31);
            let mut out = Vec::new();
            for _ in 0..500 {
                let from = random.direction() * 3.0;
                let ray = towards(from, random.point());
                out.push((hits_of(&surface, &ray), surface.near_far(&ray), surface.closest_point(from)));
            }
            out
        })
    };
    assert_eq!(answers(1), answers(5));
}

#[test]
fn bad_input_is_left_out() {
    let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(f32::NAN), Vec3::splat(f32::INFINITY), Vec3::splat(1e30)];
    for (triangles, kept) in [
        (vec![], 0),
        (vec![[0, 1, 9]], 0),
        (vec![[0, 1, 3], [0, 1, 4], [0, 5, 1], [0, 1, u32::MAX]], 0),
        (vec![[0, 1, 3], [0, 1, 2], [0, 0, 0], [1, 1, 2]], 3),
    ] {
        let mut surface = Surface::build(&points, &triangles);
        assert_eq!(surface.triangle_count(), kept);
        // Bad points that nothing uses do no harm.
        assert_eq!(surface.refit(&points), Ok(()));
        assert_eq!(surface.bounds().is_some(), kept > 0);
        let ray = Ray { origin: Vec3::new(0.2, 0.2, 1.0), direction: Vec3::NEG_Z };
        assert_eq!(surface.closest(&ray).map(|hit| hit.triangle), (kept > 0).then_some(1));
        assert_eq!(surface.closest_point(Vec3::ONE).is_some(), kept > 0);
        assert_eq!(surface.closest_point(Vec3::NAN), None);
        for ray in [
            Ray { origin: Vec3::NAN, ..ray },
            Ray { origin: Vec3::INFINITY, ..ray },
            Ray { direction: Vec3::ZERO, ..ray },
            Ray { direction: Vec3::new(0.0, f32::NAN, 1.0), ..ray },
        ] {
            assert_eq!((surface.near_far(&ray), hits_of(&surface, &ray)), (None, vec![]));
        }
    }
}

#[test]
fn a_million_triangles_at_one_point() {
    let points = [Vec3::ONE, Vec3::ONE, Vec3::new(1.5, 1.0, 1.0), Vec3::new(1.0, 2.0, 1.0)];
    for triangle in [[0, 0, 1], [0, 2, 3]] {
        let mut surface = Surface::build(&points, &vec![triangle; 1_000_000]);
        assert_eq!(surface.triangle_count(), 1_000_000);
        let ray = Ray { origin: Vec3::new(1.1, 1.1, 4.0), direction: Vec3::NEG_Z };
        assert_eq!(surface.closest(&ray).is_some(), triangle[1] == 2);
        assert_eq!(surface.closest_point(Vec3::ZERO).unwrap().triangle, 0);
        surface.refit(&points).unwrap();
    }
}

#[test]
fn a_fan_of_growing_triangles() {
    // Every box is nearest to the one before it, and holds all of them.
    let count = 200_000;
    let points: Vec<Vec3> = (0..=count).map(|i| Vec3::new(1.0, (i % 2) as f32, 0.5) * i as f32).collect();
    let triangles: Vec<[u32; 3]> = (1..count).map(|i| [0, i, i + 1]).collect();
    let surface = Surface::build(&points, &triangles);
    assert_eq!(surface.triangle_count(), triangles.len());
    let ray = Ray { origin: Vec3::new(1000.0, 500.0, 2000.0), direction: Vec3::NEG_Z };
    let hits = hits_of(&surface, &ray);
    assert!(!hits.is_empty());
    let mut brute = Vec::new();
    hits_brute(&points, &triangles, &ray, &mut brute);
    assert_eq!(hits, brute);
}

/// Triangles about one point in a plane.
fn fan(count: usize) -> Mesh {
    let corner = |at: usize| {
        let turn = at as f32 / count as f32;
        Vec3::new(1.0 - 2.0 * (turn - 0.5).abs() * 2.0, (turn * 2.0 - 1.0) * (1.0 - turn), 0.0)
    };
    let points = std::iter::once(Vec3::ZERO).chain((0..=count).map(corner)).collect();
    (points, (0..count as u32).map(|at| [0, at + 1, at + 2]).collect())
}

/// A ray within a flat fan runs along all of its triangles, and looks at a few only.
#[test]
fn a_ray_along_a_flat_fan_looks_at_few_leaves() {
    for count in [500, 2_000, 8_000, 32_000] {
        let (points, triangles) = fan(count);
        let surface = Surface::build(&points, &triangles);
        for at in (0..count).step_by(count / 50) {
            let ray = towards(points[at + 1], Vec3::new(0.01, -0.02, 0.0));
            let (is_crossed, leaves) = surface.crosses_counted(&ray, 1e-3, 0.5);
            assert_eq!(is_crossed, surface.crosses(&ray, 1e-3, 0.5));
            assert!(leaves <= 160, "{count} triangles, ray {at}: {leaves} leaves");
        }
    }
}

/// Triangles that join points at random, from everywhere to everywhere.
fn knot(count: usize) -> Mesh {
    let mut random = Random(11);
    let points: Vec<Vec3> = (0..count.div_ceil(3).max(3)).map(|_| random.point()).collect();
    let corner = |random: &mut Random| random.below(points.len()) as u32;
    let triangles = (0..count).map(|_| [corner(&mut random), corner(&mut random), corner(&mut random)]).collect();
    (points, triangles)
}

/// The work of a ray is bounded: it has all hits, or none and says so.
#[test]
fn a_ray_in_a_soup_is_given_up() {
    const MOST: usize = 256;
    for ((points, triangles), is_body) in [(ball(20, 0.3), true), (knot(300), true), (knot(20_000), false)] {
        let surface = Surface::build(&points, &triangles);
        let mut random = Random(7);
        for _ in 0..40 {
            let ray = towards(random.point() * 0.2, random.point() * 0.2);
            let mut hits = vec![Hit { distance: -1.0, triangle: 0, entering: false }];
            let is_whole = surface.hits_within(&ray, MOST, &mut hits);
            assert_eq!(is_whole, is_body, "{} triangles", triangles.len());
            assert_eq!(hits, if is_whole { hits_of(&surface, &ray) } else { Vec::new() });
        }
    }
}

#[test]
fn skinning_blends() {
    let mut weights = Weights::default();
    for influences in [vec![(0, 1.0)], vec![(0, 0.25), (1, 0.75)], vec![], vec![(7, 1.0)]] {
        weights.push(influences);
    }
    let matrices = [
        Affine3A::from_translation(Vec3::X * 4.0),
        Affine3A::from_quat(Quat::from_xyzw(0.0, 0.0, 0.5_f32.sqrt(), 0.5_f32.sqrt())),
    ];
    let points = [Vec3::ZERO, Vec3::X, Vec3::splat(3.0), Vec3::splat(5.0), Vec3::splat(6.0)];
    let mut out = vec![Vec3::ONE; 99];
    skin_points(&points, &weights, &matrices, &mut out);
    let expected = [Vec3::X * 4.0, Vec3::new(1.25, 0.75, 0.0), points[2], points[3], points[4]];
    assert_eq!(out.len(), 5);
    for i in 0..5 {
        assert!(out[i].distance(expected[i]) < 1e-6, "{i}: {}", out[i]);
        assert_eq!(skin_point(i, points[i], &weights, &matrices), out[i]);
    }
    skin_points(&points, &Weights::default(), &matrices, &mut out);
    assert_eq!(out, points);
}

#[test]
fn adjacency_by_position() {
    let points = [Vec3::ZERO, Vec3::X, Vec3::new(-0.0, 0.0, -0.0), Vec3::Y, Vec3::X];
    assert_eq!(weld(&points), (vec![0, 1, 0, 2, 1], 3));
    assert_eq!(weld(&[]), (vec![], 0));
    let triangles = [[0, 1, 2], [2, 1, 3], [5, 6, 4], [4, 4, 4]];
    assert_eq!(islands(&triangles, 9), (vec![0, 0, 0, 0, 1, 1, 1, 2, 3], 4));
    let edge = |a, b, triangles| Edge { points: [a, b], triangles };
    assert_eq!(edges(&triangles[..2]), [edge(0, 1, 1), edge(0, 2, 1), edge(1, 2, 2), edge(1, 3, 1), edge(2, 3, 1)]);
    // A closed ball has every edge twice, and one island.
    let (points, triangles) = ball(6, 0.3);
    let (numbers, count) = weld(&points);
    let triangles: Vec<_> = triangles.iter().map(|t| t.map(|c| numbers[c as usize])).collect();
    assert!(edges(&triangles).iter().all(|edge| edge.triangles == 2));
    assert_eq!(islands(&triangles, count), (vec![0; count], 1));
}
