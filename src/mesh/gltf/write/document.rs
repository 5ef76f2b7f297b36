//! Document of a written file: its long lists are plain fields, which take a fraction of the memory of JSON trees.

use std::{borrow::Cow, fmt};

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Map, Value};

use super::buffer::{Accessor, View};
use crate::mesh::{gltf::matrix, model::Trs};

/// A document and its buffer.
pub(super) struct Document<'a> {
    /// Fields before the lists.
    pub(super) root: Map<String, Value>,
    /// The one scene; `None` without nodes, because some readers refuse an empty one.
    pub(super) scene: Option<Scene<'a>>,
    pub(super) lists: Lists<'a>,
    /// The one buffer, as it is declared.
    pub(super) buffer: Option<Value>,
    pub(super) bytes: Vec<u8>,
}

/// Lists of a document, in the order of the file.
pub(super) struct Lists<'a> {
    pub(super) nodes: Vec<Node<'a>>,
    pub(super) meshes: Vec<Mesh<'a>>,
    pub(super) skins: Vec<Skin<'a>>,
    pub(super) animations: Vec<Animation<'a>>,
    pub(super) materials: &'a [Value],
    pub(super) textures: Vec<Value>,
    pub(super) images: Vec<Value>,
    pub(super) samplers: &'a [Value],
    pub(super) accessors: Vec<Accessor>,
    pub(super) views: Vec<View>,
}

impl Serialize for Document<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, value) in &self.root {
            map.serialize_entry(key, value)?;
        }
        if let Some(scene) = &self.scene {
            map.serialize_entry("scene", &0)?;
            map.serialize_entry("scenes", &[scene])?;
        }
        let lists = &self.lists;
        list(&mut map, "nodes", &lists.nodes)?;
        list(&mut map, "meshes", &lists.meshes)?;
        list(&mut map, "skins", &lists.skins)?;
        list(&mut map, "animations", &lists.animations)?;
        list(&mut map, "materials", lists.materials)?;
        list(&mut map, "textures", &lists.textures)?;
        list(&mut map, "images", &lists.images)?;
        list(&mut map, "samplers", lists.samplers)?;
        list(&mut map, "accessors", &lists.accessors)?;
        list(&mut map, "bufferViews", &lists.views)?;
        if let Some(buffer) = &self.buffer {
            map.serialize_entry("buffers", &[buffer])?;
        }
        map.end()
    }
}

/// Writes a list unless it is empty, which glTF forbids.
fn list<M: SerializeMap, T: Serialize>(map: &mut M, key: &str, list: &[T]) -> Result<(), M::Error> {
    if list.is_empty() { Ok(()) } else { map.serialize_entry(key, list) }
}

/// Scene, with its fields in the order of the file.
#[derive(serde::Serialize)]
pub(super) struct Scene<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(super) name: &'a str,
    pub(super) nodes: Vec<usize>,
}

/// Node, with its fields in the order of the file.
#[derive(Default, serde::Serialize)]
pub(super) struct Node<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(super) name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mesh: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "doubles")]
    pub(super) translation: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "doubles")]
    pub(super) rotation: Option<[f32; 4]>,
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "doubles")]
    pub(super) scale: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) skin: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) extras: Option<&'a Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) children: Vec<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) extensions: Option<Box<Value>>,
}

impl Node<'_> {
    /// Takes a transform over, without those of its properties that are at rest.
    pub(super) fn set_transform(&mut self, trs: &Trs) {
        if trs.translation != Trs::IDENTITY.translation {
            self.translation = Some(trs.translation.to_array());
        }
        let rotation = matrix::unit(trs.rotation).unwrap_or_default();
        if rotation != Trs::IDENTITY.rotation {
            self.rotation = Some(rotation.to_array());
        }
        if trs.scale != Trs::IDENTITY.scale {
            self.scale = Some(trs.scale.to_array());
        }
    }
}

/// Mesh, with its fields in the order of the file.
#[derive(PartialEq, serde::Serialize)]
pub(super) struct Mesh<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(super) name: &'a str,
    pub(super) primitives: Vec<Primitive>,
    #[serde(skip_serializing_if = "no_floats", serialize_with = "list_of_doubles")]
    pub(super) weights: &'a [f32],
    /// Content of the object, and the names of its morph targets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) extras: Option<Cow<'a, Value>>,
}

/// Primitive of a mesh, with its fields in the order of the file.
#[derive(PartialEq, serde::Serialize)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) material: Option<usize>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) targets: Vec<MorphTarget>,
}

/// Accessors of a primitive, each with what it holds.
#[derive(Default, PartialEq)]
pub(super) struct Attributes(Vec<(Attribute, usize)>);

impl Attributes {
    pub(super) fn put(&mut self, attribute: Attribute, accessor: usize) {
        self.0.push((attribute, accessor));
    }

    pub(super) fn accessors(&self) -> impl Iterator<Item = usize> {
        self.0.iter().map(|entry| entry.1)
    }
}

impl Serialize for Attributes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|entry| (entry.0, entry.1)))
    }
}

/// Content of an accessor of vertices; sets are counted from zero.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Attribute {
    Position,
    Normal,
    Tangent,
    TexCoord(usize),
    Color,
    Joints(usize),
    Weights(usize),
}

impl fmt::Display for Attribute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Position => f.write_str("POSITION"),
            Self::Normal => f.write_str("NORMAL"),
            Self::Tangent => f.write_str("TANGENT"),
            Self::TexCoord(set) => write!(f, "TEXCOORD_{set}"),
            Self::Color => f.write_str("COLOR_0"),
            Self::Joints(set) => write!(f, "JOINTS_{set}"),
            Self::Weights(set) => write!(f, "WEIGHTS_{set}"),
        }
    }
}

impl Serialize for Attribute {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Accessors of a morph target.
#[derive(PartialEq, serde::Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) struct MorphTarget {
    pub(super) position: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) normal: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) tangent: Option<usize>,
}

/// Skin, with its fields in the order of the file.
#[derive(serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(super) name: &'a str,
    pub(super) inverse_bind_matrices: usize,
    pub(super) joints: Vec<usize>,
}

/// Animation, with its fields in the order of the file.
#[derive(serde::Serialize)]
pub(super) struct Animation<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(super) name: &'a str,
    pub(super) channels: Vec<Channel>,
    pub(super) samplers: Vec<Sampler>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) extras: Option<&'a Value>,
}

/// Channel of an animation.
#[derive(serde::Serialize)]
pub(super) struct Channel {
    pub(super) sampler: usize,
    pub(super) target: AnimatedProperty,
}

/// Property of a node that a channel moves.
#[derive(serde::Serialize)]
pub(super) struct AnimatedProperty {
    pub(super) node: usize,
    pub(super) path: &'static str,
}

/// Keys of a channel, as accessors.
#[derive(serde::Serialize)]
pub(super) struct Sampler {
    pub(super) input: usize,
    pub(super) interpolation: &'static str,
    pub(super) output: usize,
}

fn no_floats(values: &&[f32]) -> bool {
    values.is_empty()
}

/// Floats as JSON numbers that read back to the same bits.
fn list_of_doubles<S: Serializer>(values: &&[f32], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|value| f64::from(*value)))
}

/// Floats as JSON numbers that read back to the same bits.
fn doubles<S: Serializer, const N: usize>(values: &Option<[f32; N]>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().flatten().map(|value| f64::from(*value)))
}
