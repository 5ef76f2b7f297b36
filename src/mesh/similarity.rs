//! Similarities: a whole model in other units, axes and places.

use glam::{Mat3A, Mat4, Quat, Vec3, Vec3A};

use super::model::{Channel, ChannelTarget, Interpolation, Model};

/// Uniform scale, then a rotation, then a translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Factor of all lengths, above zero.
    pub scale: f32,
    /// Rotation, a unit quaternion.
    pub rotation: Quat,
    /// Translation.
    pub translation: Vec3,
}

impl Default for Similarity {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Similarity {
    /// Similarity that changes nothing.
    pub const IDENTITY: Self = Self { scale: 1.0, rotation: Quat::IDENTITY, translation: Vec3::ZERO };

    /// A translation alone.
    pub fn from_translation(translation: Vec3) -> Self {
        Self { translation, ..Self::IDENTITY }
    }

    /// Image of a position.
    pub fn point(&self, point: Vec3) -> Vec3 {
        self.translation + self.vector(point)
    }

    /// Image of a difference of positions.
    pub fn vector(&self, vector: Vec3) -> Vec3 {
        self.rotation * (vector * self.scale)
    }

    fn inverse_matrix(&self) -> Mat4 {
        let (scale, rotation) = (1.0 / self.scale, self.rotation.inverse());
        let translation = rotation * (self.translation * -scale);
        Mat4::from_scale_rotation_translation(Vec3::splat(scale), rotation, translation)
    }
}

impl Model {
    /// Moves everything: points, nodes, bind poses and clips. No node has a scale at rest afterwards, so that lengths are
    /// those of the model's space everywhere. The model looks as before, at rest and in its clips; where a node is scaled
    /// unevenly, only at rest.
    pub fn place(&mut self, by: &Similarity) {
        let is_plain = self.nodes.iter().all(|node| node.rest.scale == Vec3::ONE);
        if is_plain && *by == Similarity::IDENTITY {
            return;
        }
        let spaces = self.node_spaces(by.scale, is_plain);
        self.move_points(by);
        for channel in self.clips.iter_mut().flat_map(|clip| &mut clip.channels) {
            match channel.target {
                ChannelTarget::Translation(node) => {
                    let parent = self.nodes.get(node).and_then(|node| node.parent);
                    for_each_key(channel, 3, |key, is_value| {
                        let (vector, space) = (Vec3::from_slice(key), parent.and_then(|parent| spaces.get(parent)));
                        let moved = match space {
                            Some(space) => (*space * Vec3A::from(vector)).into(),
                            None if is_value => by.point(vector),
                            None => by.vector(vector),
                        };
                        key.copy_from_slice(&moved.to_array());
                    });
                }
                ChannelTarget::Rotation(node) => {
                    if self.nodes.get(node).is_some_and(|node| node.parent.is_none()) {
                        for_each_key(channel, 4, |key, _| {
                            let turned = by.rotation * Quat::from_slice(key);
                            key.copy_from_slice(&turned.to_array());
                        });
                    }
                }
                ChannelTarget::Scale(node) => {
                    let rest = self.nodes.get(node).map_or(Vec3::ONE, |node| node.rest.scale);
                    for_each_key(channel, 3, |key, _| {
                        for (value, rest) in key.iter_mut().zip(rest.to_array()) {
                            *value /= if rest == 0.0 { 1.0 } else { rest };
                        }
                    });
                }
                ChannelTarget::MorphWeights(_) => {}
            }
        }
        let back = by.inverse_matrix();
        for skin in &mut self.skins {
            for (joint, matrix) in skin.joints.iter().zip(&mut skin.inverse_binds) {
                let space = spaces.get(*joint).copied().unwrap_or(Mat3A::IDENTITY);
                *matrix = Mat4::from_mat3a(space) * *matrix * back;
            }
        }
        for node in &mut self.nodes {
            match node.parent.and_then(|parent| spaces.get(parent)) {
                Some(space) => node.rest.translation = (*space * Vec3A::from(node.rest.translation)).into(),
                None => {
                    node.rest.translation = by.point(node.rest.translation);
                    node.rest.rotation = (by.rotation * node.rest.rotation).normalize();
                }
            }
            node.rest.scale = Vec3::ONE;
        }
    }

    /// Maps from the space of each node to its space without scales, in lengths that are `scale` times as large.
    fn node_spaces(&self, scale: f32, is_plain: bool) -> Vec<Mat3A> {
        if is_plain {
            return vec![Mat3A::from_diagonal(Vec3::splat(scale)); self.nodes.len()];
        }
        let mut rotations: Vec<Quat> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let above = node.parent.map_or(Quat::IDENTITY, |parent| rotations[parent]);
            rotations.push((above * node.rest.rotation).normalize());
        }
        let globals = self.rest_globals();
        let space = |(global, rotation): (&glam::Affine3A, &Quat)| {
            Mat3A::from_quat(rotation.inverse()) * global.matrix3 * Mat3A::from_diagonal(Vec3::splat(scale))
        };
        globals.iter().zip(&rotations).map(space).collect()
    }

    fn move_points(&mut self, by: &Similarity) {
        for point in &mut self.points {
            *point = by.point(*point);
        }
        for part in &mut self.parts {
            part.normals.iter_mut().for_each(|normal| *normal = by.rotation * *normal);
            for tangent in &mut part.tangents {
                *tangent = (by.rotation * tangent.truncate()).extend(tangent.w);
            }
            for morph in &mut part.morphs {
                morph.positions.iter_mut().for_each(|offset| *offset = by.vector(*offset));
                let turned = morph.normals.iter_mut().chain(&mut morph.tangents);
                turned.for_each(|offset| *offset = by.rotation * *offset);
            }
        }
    }
}

/// Runs a function on the numbers of each key, and of the tangents at it; its flag is true for keys.
fn for_each_key(channel: &mut Channel, width: usize, mut change: impl FnMut(&mut [f32], bool)) {
    let is_cubic = channel.interpolation == Interpolation::CubicSpline;
    for (number, key) in channel.values.chunks_exact_mut(width).enumerate() {
        change(key, !is_cubic || number % 3 == 1);
    }
}
