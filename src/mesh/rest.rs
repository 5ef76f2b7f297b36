//! Models at rest: the mesh of a file skinned to its joints' rest transforms.
//!
//! A skinned glTF mesh is stored in its bind pose, and its joints may rest in another pose. Users see, and draw a
//! skeleton into, the mesh at the joints' rest transforms.

use glam::{Affine3A, Mat3A, Mat4, Vec3, Vec3A};

use super::model::{Model, SkinBinding};

impl Model {
    /// Computes the model with points, normals, tangents and morph targets skinned to the joints' rest transforms, and
    /// without skins. Where bind and rest pose agree to about a millionth of the model's size, values are exact copies.
    pub fn at_rest(&self) -> Model {
        let globals = self.rest_globals();
        let palettes: Vec<Option<Vec<Affine3A>>> =
            self.skins.iter().map(|skin| rest_palette(skin, &globals, self.nodes.len())).collect();
        let mut rest = self.clone();
        rest.skins.clear();
        for object in &mut rest.objects {
            object.skin = None;
        }
        for (part, source) in rest.parts.iter_mut().zip(&self.parts) {
            let skin = self.objects.get(source.object).and_then(|object| object.skin);
            let Some(palette) = skin.and_then(|skin| palettes.get(skin)?.as_ref()) else { continue };
            for (vertex, &point) in source.vertices.iter().enumerate() {
                let matrix = self.blended(point as usize, palette);
                let turn = matrix.matrix3;
                let normals = normal_matrix(&turn);
                rest.points[point as usize] = matrix.transform_point3(self.points[point as usize]);
                turn_unit(part.normals.get_mut(vertex), &normals);
                if let Some(tangent) = part.tangents.get_mut(vertex) {
                    let turned = (turn * Vec3A::from(tangent.truncate())).normalize_or_zero();
                    *tangent = Vec3::from(turned).extend(tangent.w);
                }
                for morph in &mut part.morphs {
                    turn_by(morph.positions.get_mut(vertex), &turn);
                    turn_by(morph.normals.get_mut(vertex), &normals);
                    turn_by(morph.tangents.get_mut(vertex), &turn);
                }
            }
        }
        rest
    }

    /// The skinning matrix of a point; the identity for one without influences.
    fn blended(&self, point: usize, palette: &[Affine3A]) -> Affine3A {
        let Some(weights) = self.weights.as_ref().filter(|weights| point < weights.len()) else {
            return Affine3A::IDENTITY;
        };
        let mut influences = weights.of(point).peekable();
        if influences.peek().is_none() {
            return Affine3A::IDENTITY;
        }
        let mut sum = Affine3A { matrix3: Mat3A::ZERO, translation: Vec3A::ZERO };
        for (joint, weight) in influences {
            let matrix = palette.get(joint as usize).copied().unwrap_or(Affine3A::IDENTITY);
            sum.matrix3 += matrix.matrix3 * weight;
            sum.translation += matrix.translation * weight;
        }
        sum
    }
}

/// Matrices of all nodes from bind space to model space at rest, or `None` if all are the identity.
fn rest_palette(skin: &SkinBinding, globals: &[Affine3A], nodes: usize) -> Option<Vec<Affine3A>> {
    let mut palette = vec![Affine3A::IDENTITY; nodes];
    let mut moved = false;
    for (&joint, inverse_bind) in skin.joints.iter().zip(&skin.inverse_binds) {
        let matrix = Mat4::from(*globals.get(joint)?) * *inverse_bind;
        moved |= !near_identity(&matrix, globals[joint].translation.length());
        *palette.get_mut(joint)? = Affine3A::from_mat4(matrix);
    }
    moved.then_some(palette)
}

fn near_identity(matrix: &Mat4, size: f32) -> bool {
    let (columns, identity) = (matrix.to_cols_array(), Mat4::IDENTITY.to_cols_array());
    columns.iter().zip(identity).enumerate().all(|(number, (value, wanted))| {
        let tolerance = if number >= 12 { 2e-6 * size.max(1e-3) + 1e-9 } else { 2e-6 };
        (value - wanted).abs() <= tolerance
    })
}

fn normal_matrix(turn: &Mat3A) -> Mat3A {
    let inverse = turn.inverse();
    if inverse.is_finite() { inverse.transpose() } else { *turn }
}

fn turn_unit(vector: Option<&mut Vec3>, turn: &Mat3A) {
    if let Some(vector) = vector {
        let turned = (*turn * Vec3A::from(*vector)).normalize_or_zero();
        *vector = if turned == Vec3A::ZERO { *vector } else { turned.into() };
    }
}

fn turn_by(vector: Option<&mut Vec3>, turn: &Mat3A) {
    if let Some(vector) = vector {
        *vector = (*turn * Vec3A::from(*vector)).into();
    }
}
