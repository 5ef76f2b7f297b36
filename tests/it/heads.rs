//! Heads for the tests of faces: the bundled one, and real ones with their landmarks.

use std::{collections::HashMap, path::Path};

use glam::Vec3;
use rigsmith::{
    algo::face::landmarks::Landmarks,
    files::{RealDisk, load_model},
    mesh::model::Model,
};

use crate::prerequisites::test_data;

/// Points and triangles.
pub type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// The heads whose landmarks are known.
pub const HEADS: [&str; 3] = ["ict_neutral", "ict_identity_1", "ict_identity_2"];

/// The bundled head, which is on every machine.
pub fn bundled() -> Mesh {
    mesh(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj"))
}

/// The bundled head and, where test data is, one of [`HEADS`], each with its name.
#[track_caller]
pub fn bundled_and(name: &str) -> Vec<(String, Mesh)> {
    let bundled = ("the bundled head".to_owned(), bundled());
    let real = test_data().map(|folder| (name.to_owned(), mesh(&folder.join(format!("heads/{name}.obj")))));
    [bundled].into_iter().chain(real).collect()
}

/// A model of any format.
pub fn model(path: &Path) -> Model {
    load_model(&RealDisk, path).unwrap()
}

/// Points in the file's order, since truth is told by their numbers, and triangles.
pub fn mesh(path: &Path) -> Mesh {
    let model = model(path);
    let triangles = model.point_triangles();
    (model.points, triangles)
}

/// Triangles cut into four at the middles of their edges.
pub fn subdivided((points, triangles): &Mesh) -> Mesh {
    let mut all = points.clone();
    let mut middles = HashMap::new();
    let mut finer = Vec::new();
    for corners in triangles {
        let [a, b, c] = [0, 1, 2].map(|i| {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            *middles.entry((from.min(to), from.max(to))).or_insert_with(|| {
                all.push((points[from as usize] + points[to as usize]) / 2.0);
                all.len() as u32 - 1
            })
        });
        finer.extend([[corners[0], a, c], [corners[1], b, a], [corners[2], c, b], [a, b, c]]);
    }
    (all, finer)
}

/// The points of the 68 landmarks, the same on all of [`HEADS`].
pub fn truth(folder: &Path) -> Vec<usize> {
    let text = std::fs::read_to_string(folder.join("heads/ict_landmarks.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    json["landmark_vertex_indices"].as_array().unwrap().iter().map(|index| index.as_u64().unwrap() as usize).collect()
}

/// The true landmarks of one of [`HEADS`], with the points they are at.
pub fn true_landmarks(points: &[Vec3], marks: &[usize]) -> Landmarks {
    let places = std::array::from_fn(|mark| points[marks[mark]]);
    Landmarks { points: places, middle: places[33].x, symmetric: true, confidence: 1.0, mouth_open: true }
}
