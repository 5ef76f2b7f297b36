//! Shapes: displacements of a mesh's points, from morph targets, from other meshes, or from raw numbers.

use glam::Vec3;
use serde::Deserialize;

use super::model::Model;

/// Named displacements of all points of a mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shapes {
    /// A name for each shape.
    pub names: Vec<String>,
    /// Displacements of each shape, one a point, in the mesh's space and unit.
    pub displacements: Vec<Vec<Vec3>>,
}

/// Error of reading shapes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// The model has no morph targets.
    #[error("there are no morph targets; export them with the mesh")]
    NoMorphs,
    /// The shape belongs to another mesh: its number of points differs.
    #[error("shape \"{name}\" has {found} points, the mesh has {wanted}; shapes must be of the same mesh")]
    Points {
        /// Name of the shape.
        name: String,
        /// Number of points of the shape.
        found: usize,
        /// Number of points of the mesh.
        wanted: usize,
    },
    /// A displacement is not finite.
    #[error("shape \"{name}\", point {point}: the displacement is not finite")]
    NotFinite {
        /// Name of the shape.
        name: String,
        /// Index of the first such point.
        point: usize,
    },
    /// The index is not JSON with the expected fields.
    #[error("{0}; wanted is an object with \"vertices\" (a number) and \"names\" (a list)")]
    Index(String),
    /// The numbers are too few or too many.
    #[error("the numbers take {found} bytes, {names} shapes of {vertices} points need {wanted}")]
    Length {
        /// Number of bytes given.
        found: usize,
        /// Number of bytes expected.
        wanted: usize,
        /// Number of shapes in the index.
        names: usize,
        /// Number of points in the index.
        vertices: usize,
    },
}

impl Shapes {
    /// Reads the morph targets of a model, over its points. Targets of one name in several parts are one shape.
    ///
    /// # Errors
    /// [`ShapeError::NoMorphs`], [`ShapeError::NotFinite`].
    pub fn of_morphs(model: &Model) -> Result<Self, ShapeError> {
        let mut shapes = Self::default();
        for part in &model.parts {
            let names = model.objects.get(part.object).map_or(&[][..], |object| &object.morph_names);
            for (number, morph) in part.morphs.iter().enumerate() {
                let name = names.get(number).cloned().unwrap_or_else(|| format!("shape {}", number + 1));
                let at = shapes.names.iter().position(|known| *known == name).unwrap_or_else(|| {
                    shapes.names.push(name);
                    shapes.displacements.push(vec![Vec3::ZERO; model.points.len()]);
                    shapes.names.len() - 1
                });
                for (vertex, moved) in part.vertices.iter().zip(&morph.positions) {
                    if let Some(place) = shapes.displacements[at].get_mut(*vertex as usize) {
                        *place = *moved;
                    }
                }
            }
        }
        if shapes.names.is_empty() {
            return Err(ShapeError::NoMorphs);
        }
        shapes.check(model.points.len())?;
        Ok(shapes)
    }

    /// Adds the shape that moves the points of a mesh from `rest` to `points`.
    ///
    /// # Errors
    /// [`ShapeError::Points`], [`ShapeError::NotFinite`].
    pub fn add_mesh(&mut self, name: &str, rest: &[Vec3], points: &[Vec3]) -> Result<(), ShapeError> {
        if rest.len() != points.len() {
            return Err(ShapeError::Points { name: name.to_owned(), found: points.len(), wanted: rest.len() });
        }
        self.names.push(name.to_owned());
        self.displacements.push(points.iter().zip(rest).map(|(point, rest)| *point - *rest).collect());
        self.check(rest.len())
    }

    /// Reads raw displacements: `index` is JSON with the number of vertices and the names of the shapes; `numbers` are
    /// little-endian 32-bit floats, shape by shape, vertex by vertex, x, y and z.
    ///
    /// # Errors
    /// All but [`ShapeError::NoMorphs`].
    pub fn of_numbers(index: &[u8], numbers: &[u8], points: usize) -> Result<Self, ShapeError> {
        let Index { vertices, names } =
            serde_json::from_slice(index).map_err(|error| ShapeError::Index(error.to_string()))?;
        let wanted = names.len().saturating_mul(vertices).saturating_mul(12);
        if numbers.len() != wanted || vertices == 0 {
            return Err(ShapeError::Length { found: numbers.len(), wanted, names: names.len(), vertices });
        }
        let number = |bytes: &[u8]| bytes.try_into().map_or(f32::NAN, f32::from_le_bytes);
        let point = |bytes: &[u8]| Vec3::new(number(&bytes[0..4]), number(&bytes[4..8]), number(&bytes[8..12]));
        let shapes = numbers.chunks_exact(12 * vertices).map(|shape| shape.chunks_exact(12).map(point).collect());
        let shapes = Self { names, displacements: shapes.collect() };
        shapes.check(points)?;
        Ok(shapes)
    }

    fn check(&self, points: usize) -> Result<(), ShapeError> {
        for (name, shape) in self.names.iter().zip(&self.displacements) {
            if shape.len() != points {
                return Err(ShapeError::Points { name: name.clone(), found: shape.len(), wanted: points });
            }
            if let Some(point) = shape.iter().position(|moved| !moved.is_finite()) {
                return Err(ShapeError::NotFinite { name: name.clone(), point });
            }
        }
        Ok(())
    }
}

#[derive(Deserialize)]
struct Index {
    vertices: usize,
    names: Vec<String>,
}
