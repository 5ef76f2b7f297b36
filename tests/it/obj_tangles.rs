//! Polygons that cross themselves: cut short, without harm to the polygons behind them.

use std::fmt::Write as _;

use glam::Vec3;
use rigsmith::mesh::{
    model::Model,
    obj::{ObjSettings, read_model},
};

/// Outline of the letter L, from a corner at which a fan would leave it; its area is 5.
const LETTER: [[f32; 2]; 6] = [[3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0], [0.0, 0.0]];

/// Polygon of so many corners anywhere, and a letter behind it.
fn tangled(count: usize) -> Model {
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    let mut text = String::new();
    for _ in 0..count {
        let _ = writeln!(text, "v {} {} 0", random(), random());
    }
    for [x, y] in LETTER {
        let _ = writeln!(text, "v {x} {y} 0");
    }
    for corners in [1..=count, count + 1..=count + LETTER.len()] {
        text += "f";
        for corner in corners {
            let _ = write!(text, " {corner}");
        }
        text += "\n";
    }
    read_model(text.as_bytes(), "tangled", &ObjSettings::default(), &mut |_| None).unwrap()
}

#[test]
fn polygons_behind_a_tangled_one_are_cut_inside() {
    let count = 6000;
    let model = tangled(count);
    assert!(model.notes.iter().any(|note| note.starts_with("1 very large or tangled")), "{:?}", model.notes);
    let part = &model.parts[0];
    assert_eq!(part.triangles.len(), count - 2 + LETTER.len() - 2);
    let corner = |vertex: u32| -> Vec3 { model.points[part.vertices[vertex as usize] as usize] };
    let area = |[a, b, c]: [u32; 3]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).z / 2.0;
    let areas: Vec<f32> = part.triangles[count - 2..].iter().map(|triangle| area(*triangle)).collect();
    assert!(areas.iter().all(|area| *area > 0.0) && (areas.iter().sum::<f32>() - 5.0).abs() < 1e-5, "{areas:?}");
    assert_eq!(tangled(count).parts[0].triangles, part.triangles, "the same file gives the same triangles");
}
