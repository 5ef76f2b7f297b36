//! Nearest points of a surface, and the volumes between its entries and exits.

use super::*;

#[test]
fn closest_point_is_the_least_over_all_triangles() {
    let (points, triangles) = soup(400);
    let surface = Surface::build(&points, &triangles);
    let mut random = Random(17);
    for _ in 0..300 {
        let from = random.point() * 2.0;
        let found = surface.closest_point(from).unwrap();
        let corners = triangles[found.triangle as usize].map(|i| points[i as usize]);
        let b = found.barycentric;
        let at = corners[0] * b.x + corners[1] * b.y + corners[2] * b.z;
        assert!(at.distance(found.point) < 1e-6 && (b.element_sum() - 1.0).abs() < 1e-5 && b.min_element() >= 0.0);
        assert!((found.point.distance(from) - found.distance).abs() < 1e-5);
        // No sample of any triangle is closer.
        for t in &triangles {
            let [p, q, r] = t.map(|i| points[i as usize]);
            for i in 0..=4 {
                for j in 0..=4 - i {
                    let sample = p + (q - p) * (i as f32 / 4.0) + (r - p) * (j as f32 / 4.0);
                    assert!(sample.distance(from) >= found.distance - 1e-5);
                }
            }
        }
    }
    let square = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let surface = Surface::build(&square, &[[0, 1, 2]]);
    for (from, to) in [
        (Vec3::new(0.2, 0.3, 0.7), Vec3::new(0.2, 0.3, 0.0)),
        (Vec3::new(-1.0, -1.0, 0.0), Vec3::ZERO),
        (Vec3::new(2.0, -0.5, 0.0), Vec3::X),
        (Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.5, 0.5, 0.0)),
        (Vec3::new(0.5, -1.0, 0.0), Vec3::new(0.5, 0.0, 0.0)),
    ] {
        assert!(surface.closest_point(from).unwrap().point.distance(to) < 1e-6, "{from}");
    }
}

#[test]
fn volumes_pair_entries_and_exits() {
    // `<` enters, `>` leaves, one unit apart; `x` is both at one place.
    let check = |shape: &str, expected: &[(f32, f32)]| {
        let hits: Vec<Hit> = shape
            .chars()
            .zip(1..)
            .flat_map(|(side, i)| {
                let sides: &[bool] = match side {
                    '<' => &[true],
                    '>' => &[false],
                    _ => &[true, false],
                };
                sides.iter().map(move |&entering| Hit { distance: i as f32, triangle: 0, entering }).collect::<Vec<_>>()
            })
            .collect();
        let expected: Vec<Volume> = expected.iter().map(|&(near, far)| Volume { near, far }).collect();
        assert_eq!(volumes(&hits), expected, "{shape}");
    };
    check("", &[]);
    check("<>", &[(1., 2.)]);
    check("<><>", &[(1., 2.), (3., 4.)]);
    // A shell in a shell, two of them, and shells that overlap.
    check("<<>>", &[(1., 4.)]);
    check("<<><>>", &[(1., 6.)]);
    check("<<>><>", &[(1., 4.), (5., 6.)]);
    // Inside out.
    check("><", &[(1., 2.)]);
    check("><><", &[(1., 2.), (3., 4.)]);
    check("<>><", &[(1., 2.), (3., 4.)]);
    // A side is missing.
    check("<", &[(1., 1.)]);
    check(">", &[(1., 1.)]);
    check("<<>", &[(1., 1.), (2., 3.)]);
    check("<>>", &[(1., 2.), (3., 3.)]);
    check("><>", &[(1., 1.), (2., 3.)]);
    check("<<<>>", &[(1., 1.), (2., 5.)]);
    check("<><", &[(1., 2.), (3., 3.)]);
    // Two-sided sheets, and a touch beside a body.
    check("xx", &[(1., 2.)]);
    check("x<>", &[(2., 3.)]);
    check("xxx", &[(1., 2.), (3., 3.)]);
}

#[test]
fn volumes_of_duplicated_and_flipped_balls() {
    let (points, triangles) = welded(10, 0.0);
    let flipped: Vec<_> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let twice = [triangles.clone(), triangles.clone()].concat();
    let sheet = [triangles.clone(), flipped.clone()].concat();
    let mut random = Random(23);
    for _ in 0..200 {
        let ray = towards(random.direction() * 3.0, random.point() * 0.3);
        let expect = volumes(&hits_of(&Surface::build(&points, &triangles), &ray));
        assert_eq!(expect.len(), 1);
        for triangles in [&flipped, &twice, &sheet] {
            let found = volumes(&hits_of(&Surface::build(&points, triangles), &ray));
            assert_eq!(found, expect);
        }
    }
}
