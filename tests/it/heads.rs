//! Real heads and their landmarks, for the tests of faces.

use std::path::{Path, PathBuf};

use glam::Vec3;
use rigsmith::{
    algo::face::landmarks::Landmarks,
    files::{RealDisk, load_model},
    mesh::model::Model,
};

/// Points and triangles.
pub type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// The heads whose landmarks are known.
pub const HEADS: [&str; 3] = ["ict_neutral", "ict_identity_1", "ict_identity_2"];

/// The folder of real meshes; `None`, with a line that says so, where there is none.
pub fn data(what: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("RIGSMITH_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: {what} needs real meshes, set RIGSMITH_DATA");
    }
    folder
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
