//! Animals on their hind legs, whose forelegs end high, as the arms of dinosaurs do, and animals with hooves.

use bevy::math::Vec3;

use super::{FittedSkeleton, fitted, labels};

/// Boxes on both sides: those on the left, and their images.
fn on_both_sides(left: &[[[f32; 3]; 2]]) -> Vec<[[f32; 3]; 2]> {
    let image = |[low, high]: &[[f32; 3]; 2]| [[-high[0], low[1], low[2]], [-low[0], high[1], high[2]]];
    left.iter().copied().chain(left.iter().map(image)).collect()
}

/// The fit of an animal of boxes.
fn fitted_boxes(trunk: &[[[f32; 3]; 2]], left: &[[[f32; 3]; 2]]) -> FittedSkeleton {
    let boxes: Vec<_> = trunk.iter().copied().chain(on_both_sides(left)).collect();
    let model = crate::gestures::boxes(&boxes);
    fitted(&model.points, &model.point_triangles(), "quadruped").unwrap()
}

fn place(fit: &FittedSkeleton, label: &str) -> Vec3 {
    fit.joints[labels("quadruped").iter().position(|known| known == label).unwrap()].position
}

/// A dinosaur with a level trunk stands upright on its hind legs: its hands are no feet on a slope.
#[test]
fn a_dinosaur_stands_on_its_hind_legs() {
    let trunk = [
        [[-0.16, 0.62, -0.2], [0.16, 0.95, 0.55]],
        [[-0.1, 0.8, 0.5], [0.1, 1.1, 0.68]],
        [[-0.1, 0.98, 0.6], [0.1, 1.18, 1.02]],
        [[-0.09, 0.7, -0.7], [0.09, 0.9, -0.15]],
        [[-0.05, 0.76, -1.25], [0.05, 0.86, -0.65]],
    ];
    let left = [
        [[0.1, 0.5, 0.46], [0.17, 0.75, 0.53]],
        [[0.1, 0.46, 0.46], [0.17, 0.53, 0.72]],
        [[0.08, 0.0, -0.05], [0.18, 0.75, 0.05]],
        [[0.08, 0.0, -0.05], [0.18, 0.05, 0.21]],
    ];
    let fit = fitted_boxes(&trunk, &left);
    println!("up {}, forward {}", fit.up, fit.forward);
    assert_eq!((fit.up, fit.forward), (Vec3::Y, Vec3::Z));
    for side in ["l", "r"] {
        let [hand, foot] = ["paw", "foot"].map(|name| place(&fit, &format!("{name}_{side}")));
        println!("{side}: hand {hand}, foot {foot}");
        assert!((0.43..0.53).contains(&hand.y) && hand.z > 0.5, "{side}: {hand}");
        assert!(foot.y < 0.06 && foot.z.abs() < 0.1, "{side}: {foot}");
    }
}

/// Hooves are shorter than paws, and their joints lie nearer to the ends of the legs.
#[test]
fn joints_over_hooves_are_low() {
    let trunk = [
        [[-0.14, 0.52, -0.4], [0.14, 0.82, 0.36]],
        [[-0.07, 0.7, 0.3], [0.07, 1.1, 0.46]],
        [[-0.06, 1.0, 0.36], [0.06, 1.12, 0.72]],
        [[-0.03, 0.45, -0.46], [0.03, 0.78, -0.4]],
    ];
    let leg = |z: f32| {
        [[[0.045, 0.0, z - 0.035], [0.115, 0.6, z + 0.035]], [[0.045, 0.0, z - 0.035], [0.115, 0.035, z + 0.055]]]
    };
    let fit = fitted_boxes(&trunk, &[leg(0.28), leg(-0.3)].concat());
    for (name, most) in [("paw", 0.065), ("foot", 0.052)] {
        for side in ["l", "r"] {
            let joint = place(&fit, &format!("{name}_{side}"));
            println!("{name} {side}: {joint}");
            assert!((0.0..most).contains(&joint.y), "{name} {side}: {joint}");
        }
    }
}
