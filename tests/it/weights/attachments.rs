//! Weights of gear through which no bone runs: bows, packs, wings, and what lies on such things.

use super::{
    gear::{add_band, add_sheet, body, figure, heights},
    *,
};

/// Adds an upright bar with four sides, closed at both ends, and returns its points.
fn add_bar(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>, [x, y, z]: [Range<f32>; 3]) -> Range<usize> {
    let middle = |height: f32| vec![Vec3::new(0.5 * (x.start + x.end), height, 0.5 * (z.start + z.end)); 5];
    let corners = [[x.start, z.start], [x.end, z.start], [x.end, z.end], [x.start, z.end], [x.start, z.start]];
    let ring = |height: f32| corners.map(|[x, z]| Vec3::new(x, height, z)).into();
    let mut rows: Vec<Vec<Vec3>> = heights(y.start, y.end).into_iter().map(ring).collect();
    rows.insert(0, middle(y.start));
    rows.push(middle(y.end));
    add_sheet(points, triangles, &rows)
}

/// The joint that alone holds some points.
fn holder(weights: &Weights, points: Range<usize>) -> u32 {
    let first: Vec<(u32, f32)> = weights.of(points.start).collect();
    assert!(points.clone().all(|point| weights.of(point).eq(first.iter().copied())), "{first:?}");
    let [(joint, _)] = first[..] else { panic!("{first:?}") };
    joint
}

/// A bow along the back from the legs to the neck is stiff, and so is a pack on the back.
#[test]
fn bows_and_packs_are_stiff() {
    for [x, y, z] in [[-0.04..0.04, -1.2..1.8, -0.6..-0.52], [-0.4..0.4, -0.2..1.2, -1.0..-0.5]] {
        let (mut points, mut triangles) = body();
        let gear = add_bar(&mut points, &mut triangles, [x, y, z]);
        let (weights, report) = bind(&points, &triangles, &figure());
        assert_eq!(report.stiff, gear.len());
        holder(&weights, gear.clone());
        // A person may say that it bends.
        let first = gear.start as u32;
        let settings =
            WeightSettings { bending: std::iter::once(first..first + 1).collect(), ..WeightSettings::default() };
        let bent = skin_weights(&points, &triangles, &figure(), &[], None, &settings, &|_| true).unwrap().1;
        assert_eq!(bent.stiff, 0);
    }
}

/// Wings go with the back that they touch, whatever limbs their far ends come near to; a skirt hangs from the hips and bends.
#[test]
fn wings_go_with_the_back_that_they_touch() {
    let (mut points, mut triangles) = body();
    let rows: Vec<Vec<Vec3>> = (0..=20)
        .map(|step| {
            let out = 0.1 * step as f32;
            (0..=4).map(|row| Vec3::new(0.05 + out, 1.5 - 0.07 * row as f32 - 0.6 * out, -0.46 - 0.3 * out)).collect()
        })
        .collect();
    let wing = add_sheet(&mut points, &mut triangles, &rows);
    add_band(&mut points, &mut triangles, [0.8, 0.75], &heights(-1.2, 0.1));
    let (weights, report) = bind(&points, &triangles, &figure());
    assert_eq!(report.stiff, wing.len());
    assert!([1, 2, 3].contains(&holder(&weights, wing)));
}

/// An orb on a staff goes with the staff, though a joint of the leg alone is nearest to it.
#[test]
fn small_things_go_with_the_stiff_ones_that_they_lie_on() {
    let (mut points, mut triangles) = body();
    let staff = add_bar(&mut points, &mut triangles, [-0.04..0.04, -1.5..1.8, -0.6..-0.52]);
    let orb = add_bar(&mut points, &mut triangles, [-0.08..0.08, -1.5..-1.3, -0.75..-0.61]);
    let (weights, report) = bind(&points, &triangles, &figure());
    assert_eq!(report.stiff, staff.len() + orb.len());
    assert_eq!(holder(&weights, staff), holder(&weights, orb));
}
