//! A model: the content of a mesh file, whatever its format.
//!
//! Readers fill it and writers take it; the rig, the skin and the surface work on its flat arrays. Positions live in
//! one list of [`Model::points`] for the whole file, because weights, rays and volumes do not depend on texture seams
//! that split vertices; the other vertex attributes of a renderer live in [`Part`]s, whose vertices refer to points.

use glam::{Affine3A, Mat4, Quat, Vec2, Vec3, Vec4};
use serde_json::{Map, Value};

/// A whole mesh file in memory: geometry, materials, and, where the file has them, a skeleton, weights and clips.
///
/// Units and axes are the file's own (Y is up and the character faces +Z in all bundled models). Points of objects with
/// a [`Object::skin`] are in that skin's bind space; all others are in model space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Model {
    /// The file's name without folder and extension, or the scene's name.
    pub name: String,
    /// Positions of all points: an OBJ's `v` lines in order, or a glTF's vertices, primitive after primitive.
    pub points: Vec<Vec3>,
    /// Named objects: body, eyes, clothes. A part belongs to exactly one.
    pub objects: Vec<Object>,
    /// Drawable parts: the faces of one object with one material.
    pub parts: Vec<Part>,
    /// Materials, textures and images.
    pub material_set: MaterialSet,
    /// Nodes of the file that are joints, carry joints, or are moved by a clip; parents before children.
    pub nodes: Vec<Node>,
    /// Bind poses of skinned objects; see [`Object::skin`].
    pub skins: Vec<SkinBinding>,
    /// Influences of every point over [`Model::nodes`]; `None` if nothing is skinned.
    pub weights: Option<Weights>,
    /// Animation clips over [`Model::nodes`].
    pub clips: Vec<Clip>,
    /// Sentences for the user about content that the reader met and did not keep.
    pub notes: Vec<String>,
}

/// A named group of parts: one glTF mesh node, or one `o`/`g` of an OBJ.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Object {
    /// The name in the file; may be empty or not unique.
    pub name: String,
    /// Index into [`Model::skins`] if the object is skinned.
    pub skin: Option<usize>,
    /// Index into [`Model::nodes`] of the node that carries an object without a skin (a rigid part). The object's
    /// points are in model space at the nodes' rest transforms.
    pub node: Option<usize>,
    /// Names of the morph targets, shared by the object's parts.
    pub morph_names: Vec<String>,
    /// Weights of the morph targets at rest; empty if the file gives none.
    pub morph_weights: Vec<f32>,
    /// The glTF `extras` of the mesh, carried unread.
    pub extras: Option<Value>,
}

/// Faces of one object with one material, with the attributes a renderer wants. All attribute lists are either empty
/// or as long as [`Part::vertices`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Part {
    /// Index into [`Model::objects`].
    pub object: usize,
    /// Index into [`MaterialSet::materials`].
    pub material: Option<usize>,
    /// The point (index into [`Model::points`]) of each vertex.
    pub vertices: Vec<u32>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Tangents, `w` is the sign of the bitangent.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets, origin at the top left as in glTF.
    pub uvs: Vec<Vec<Vec2>>,
    /// Linear vertex colours.
    pub colors: Vec<Vec4>,
    /// Polygons as the file has them, over [`Part::vertices`]; empty if the file has triangles only.
    pub faces: Faces,
    /// The polygons triangulated, over [`Part::vertices`]; counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Morph target displacements, one entry a target, in the order of [`Object::morph_names`].
    pub morphs: Vec<Morph>,
}

/// Polygons of any size: face `i` has the corners `corners[starts[i]..starts[i + 1]]`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Faces {
    /// Index in `corners` of the first corner of each face, and the number of corners at the end; empty without faces.
    pub starts: Vec<u32>,
    /// Vertex indices.
    pub corners: Vec<u32>,
}

impl Faces {
    /// The number of faces.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Returns `true` without faces.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The corners of each face in order.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|w| &self.corners[w[0] as usize..w[1] as usize])
    }
}

/// Morph target of a part: displacements for each vertex. Lists are empty where the file has none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Morph {
    /// Displacements of positions, in the same space as the object's points.
    pub positions: Vec<Vec3>,
    /// Displacements of normals.
    pub normals: Vec<Vec3>,
    /// Displacements of tangents (without the sign).
    pub tangents: Vec<Vec3>,
}

/// Materials with their textures, samplers and images, as glTF JSON objects carried unread, so that nothing in them is
/// lost.
///
/// Indices inside them refer to the lists here, as in a glTF file. OBJ materials are translated on reading.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MaterialSet {
    /// glTF material objects.
    pub materials: Vec<Value>,
    /// glTF texture objects.
    pub textures: Vec<Value>,
    /// glTF sampler objects.
    pub samplers: Vec<Value>,
    /// Image files in memory.
    pub images: Vec<Image>,
    /// Names of the glTF extensions that these objects use.
    pub extensions_used: Vec<String>,
    /// Names of the glTF extensions without which these objects cannot be shown.
    pub extensions_required: Vec<String>,
}

/// An encoded image (PNG, JPEG, ...), never decoded here.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Image {
    /// The name in the file, or the file's name.
    pub name: String,
    /// Media type, for example `image/png`.
    pub mime: String,
    /// The encoded bytes.
    pub bytes: Vec<u8>,
    /// The remaining fields of the glTF image object, carried unread.
    pub rest: Map<String, Value>,
}

/// A transform relative to its parent: scale first, then rotation, then translation.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Trs {
    /// Translation.
    pub translation: Vec3,
    /// Rotation, a unit quaternion.
    pub rotation: Quat,
    /// Scale along the local axes.
    pub scale: Vec3,
}

impl Default for Trs {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Trs {
    /// Identity transform.
    pub const IDENTITY: Self = Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };

    /// The transform as an affine matrix.
    pub fn affine(&self) -> Affine3A {
        Affine3A::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }

    /// Maps a position in this transform's space to the space around it.
    pub fn transform_point(&self, point: Vec3) -> Vec3 {
        self.translation + self.rotation * (self.scale * point)
    }

    /// Transform relative to `parent`: `parent` times the result is `self`. Along an axis on which the parent's scale is
    /// zero, the value is taken unchanged.
    pub fn relative_to(&self, parent: &Self) -> Self {
        let back = parent.rotation.inverse();
        let divided = |a: f32, by: f32| if by == 0.0 { a } else { a / by };
        let by = |v: Vec3| {
            Vec3::new(divided(v.x, parent.scale.x), divided(v.y, parent.scale.y), divided(v.z, parent.scale.z))
        };
        Self {
            translation: by(back * (self.translation - parent.translation)),
            rotation: (back * self.rotation).normalize(),
            scale: by(self.scale),
        }
    }
}

/// Product of two transforms, as Bevy multiplies them: scales axis by axis, so that there is never any shear.
impl std::ops::Mul for Trs {
    type Output = Self;

    fn mul(self, inner: Self) -> Self {
        Self {
            translation: self.transform_point(inner.translation),
            rotation: (self.rotation * inner.rotation).normalize(),
            scale: self.scale * inner.scale,
        }
    }
}

/// A node of the file's hierarchy that the rig needs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Node {
    /// The name in the file; may be empty or not unique.
    pub name: String,
    /// Index into [`Model::nodes`]; always smaller than the node's own.
    pub parent: Option<usize>,
    /// Rest transform, relative to the parent.
    pub rest: Trs,
    /// Marks a joint (listed in a skin, or marked as one by this crate); a node without the mark only carries others.
    pub joint: bool,
    /// The glTF `extras` of the node, carried unread.
    pub extras: Option<Value>,
}

/// The bind pose of one skin: for each of its joints the matrix from bind space to the joint's space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SkinBinding {
    /// The name in the file.
    pub name: String,
    /// Joints, as indices into [`Model::nodes`].
    pub joints: Vec<usize>,
    /// Inverse bind matrices, one a joint.
    pub inverse_binds: Vec<Mat4>,
}

/// Influences of points: point `p` has the entries `starts[p]..starts[p + 1]`, strongest first, summing to one (or
/// none).
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Weights {
    /// Index of the first influence of each point, and the number of influences at the end.
    pub starts: Vec<u32>,
    /// Joint of each influence, as an index into the list of joints that the owner of the weights has.
    pub joints: Vec<u32>,
    /// The weight of each influence, positive.
    pub values: Vec<f32>,
}

impl Weights {
    /// The number of points.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Returns `true` without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The influences of a point.
    pub fn of(&self, point: usize) -> impl ExactSizeIterator<Item = (u32, f32)> + '_ {
        let range = self.starts[point] as usize..self.starts[point + 1] as usize;
        self.joints[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    /// Appends a point with its influences.
    pub fn push(&mut self, influences: impl IntoIterator<Item = (u32, f32)>) {
        if self.starts.is_empty() {
            self.starts.push(0);
        }
        for (joint, value) in influences {
            self.joints.push(joint);
            self.values.push(value);
        }
        self.starts.push(self.joints.len() as u32);
    }
}

/// An animation clip, its keys exactly as in the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Clip {
    /// The name in the file.
    pub name: String,
    /// Channels, one for each animated property.
    pub channels: Vec<Channel>,
    /// The glTF `extras` of the animation, carried unread.
    pub extras: Option<Value>,
}

/// The keys of one property of one node or object.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// The animated property.
    pub target: ChannelTarget,
    /// Interpolation between keys.
    pub interpolation: Interpolation,
    /// Key times in seconds, rising.
    pub times: Vec<f32>,
    /// Key values, flat: 3 a key for translation and scale, 4 for rotation (xyzw), one a target for morph weights;
    /// three times as many for cubic splines (in-tangent, value, out-tangent).
    pub values: Vec<f32>,
}

/// The property that a [`Channel`] animates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChannelTarget {
    /// Translation of a node (index into [`Model::nodes`]).
    Translation(usize),
    /// Rotation of a node.
    Rotation(usize),
    /// Scale of a node.
    Scale(usize),
    /// Morph target weights of an object (index into [`Model::objects`]).
    MorphWeights(usize),
}

/// Interpolation of a channel between its keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Linear (spherical for rotations).
    #[default]
    Linear,
    /// Constant from each key to the next.
    Step,
    /// Cubic Hermite spline with tangents.
    CubicSpline,
}

impl Model {
    /// The triangles of all parts over [`Model::points`], part after part.
    pub fn point_triangles(&self) -> Vec<[u32; 3]> {
        let count = self.parts.iter().map(|part| part.triangles.len()).sum();
        let mut triangles = Vec::with_capacity(count);
        for part in &self.parts {
            triangles.extend(part.triangles.iter().map(|t| t.map(|v| part.vertices[v as usize])));
        }
        triangles
    }

    /// The number of faces of all parts: polygons where the file has them, else triangles.
    pub fn face_count(&self) -> usize {
        let faces = |part: &Part| if part.faces.is_empty() { part.triangles.len() } else { part.faces.len() };
        self.parts.iter().map(faces).sum()
    }

    /// Transforms of all nodes to model space at rest.
    pub fn rest_globals(&self) -> Vec<Affine3A> {
        let mut globals: Vec<Affine3A> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let local = node.rest.affine();
            globals.push(node.parent.map_or(local, |parent| globals[parent] * local));
        }
        globals
    }
}
