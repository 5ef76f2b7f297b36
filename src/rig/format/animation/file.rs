//! Clips as they stand in files.

use std::{collections::BTreeMap, fmt, sync::Arc};

use serde::{
    Deserialize, Deserializer,
    de::{SeqAccess, Visitor},
};

use super::Place;
use crate::rig::{
    EditError, Uid,
    animation::{
        ClipLayer, Ease, Key, KeyFault, LayerMode, Marker, NodeName, NodeNames, Property, RigClip, Track, TrackTarget,
        check_about, check_keys, check_layer,
    },
    format::tree::Tree,
};

/// A clip.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::rig::format) struct ClipFile {
    uid: Uid,
    name: String,
    #[serde(default = "default_rate")]
    frame_rate: f32,
    range: (f32, f32),
    #[serde(default)]
    looped: bool,
    #[serde(default)]
    markers: Vec<Marker>,
    #[serde(default)]
    layers: Vec<LayerFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LayerFile {
    uid: Uid,
    #[serde(default)]
    name: String,
    #[serde(default)]
    mode: LayerMode,
    #[serde(default = "default_weight")]
    weight: f32,
    #[serde(default)]
    muted: bool,
    #[serde(default)]
    mask: Vec<NodeFile>,
    #[serde(default)]
    tracks: Vec<TrackFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NodeFile {
    node: Uid,
    #[serde(default)]
    label: String,
    #[serde(default)]
    role: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TrackFile {
    node: Uid,
    #[serde(default)]
    label: String,
    #[serde(default)]
    role: String,
    property: Property,
    #[serde(default)]
    keys: Vec<KeyFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyFile {
    t: f32,
    v: Numbers,
    #[serde(default)]
    ease: EaseFile,
}

#[derive(Deserialize, Default)]
enum EaseFile {
    Stepped,
    #[default]
    Linear,
    Cubic {
        arrive: Numbers,
        leave: Numbers,
    },
}

/// One to four numbers in brackets.
struct Numbers {
    values: [f32; 4],
    count: usize,
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct List;
        impl<'de> Visitor<'de> for List {
            type Value = Numbers;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("one to four numbers in brackets")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Numbers, A::Error> {
                let mut numbers = Numbers { values: [0.0; 4], count: 0 };
                while numbers.count < 4
                    && let Some(number) = list.next_element()?
                {
                    numbers.values[numbers.count] = number;
                    numbers.count += 1;
                }
                Ok(numbers)
            }
        }
        deserializer.deserialize_tuple(4, List)
    }
}

fn default_rate() -> f32 {
    30.0
}

fn default_weight() -> f32 {
    1.0
}

/// Place of an error: numbers of the clip and of what is in it, and the name of a field.
#[derive(Debug, Clone, Default)]
pub(in crate::rig::format) struct ClipPlace {
    pub clip: usize,
    pub layer: Option<usize>,
    pub track: Option<usize>,
    pub key: Option<usize>,
    pub field: &'static str,
}

/// Names that are allowed for a field of a clip, or of what is in it.
pub(in crate::rig::format) fn clip_fields(path: &[&str]) -> Option<&'static [&'static str]> {
    match path {
        [] => Some(&["uid", "name", "frame_rate", "range", "looped", "markers", "layers"]),
        ["markers"] => Some(&["time", "name"]),
        ["layers"] => Some(&["uid", "name", "mode", "weight", "muted", "mask", "tracks"]),
        ["layers", "mask"] => Some(&["node", "label", "role"]),
        ["layers", "tracks"] => Some(&["node", "label", "role", "property", "keys"]),
        ["layers", "tracks", "keys"] => Some(&["t", "v", "ease"]),
        ["layers", "tracks", "keys", "ease"] => Some(&["arrive", "leave"]),
        _ => None,
    }
}

/// Byte of a place in the text; `path` leads from the root to the struct with the field `clips`.
pub(super) fn offset(text: &str, path: &[(&str, usize)], place: &ClipPlace) -> Option<usize> {
    let tree = Tree::parse(text)?;
    let mut at = tree.root();
    let ClipPlace { clip, layer, track, key, field } = place;
    let below = [("clips", Some(*clip)), ("layers", *layer), ("tracks", *track), ("keys", *key)];
    let below = below.into_iter().map_while(|(name, number)| Some((name, number?)));
    for (name, number) in path.iter().copied().chain(below) {
        at = element((&tree, at), name, number)?;
    }
    Some(tree.field(at, field).map_or(tree.node(at).range.start, |field| field.start))
}

fn element((tree, node): Place, name: &str, number: usize) -> Option<usize> {
    Some(tree.optional(tree.elements(node, name).get(number)?.value))
}

type Error = (ClipPlace, String);

/// Converts and checks clips; names of nodes go to `names`.
pub(super) fn clips(files: Vec<ClipFile>, names: &mut NodeNames) -> Result<Vec<RigClip>, Error> {
    let mut seen: std::collections::HashSet<Uid> = std::collections::HashSet::new();
    files.into_iter().enumerate().map(|(number, file)| clip(file, number, names, &mut seen)).collect()
}

fn clip(
    file: ClipFile,
    number: usize,
    names: &mut NodeNames,
    seen: &mut std::collections::HashSet<Uid>,
) -> Result<RigClip, Error> {
    let place = ClipPlace { clip: number, ..ClipPlace::default() };
    let ClipFile { uid, name, frame_rate, range, looped, markers, layers } = file;
    let range = [range.0, range.1];
    let mut clip = RigClip {
        uid,
        name,
        frame_rate,
        range,
        looped,
        markers,
        layers: Vec::with_capacity(layers.len()),
        names: NodeNames::default(),
    };
    if !seen.insert(uid) {
        return Err((ClipPlace { field: "uid", ..place }, twice(uid)));
    }
    check_about(uid, &clip.about())
        .map_err(|error| (ClipPlace { field: "range", ..place.clone() }, error.to_string()))?;
    for (number, file) in layers.into_iter().enumerate() {
        let place = ClipPlace { layer: Some(number), ..place.clone() };
        if !seen.insert(file.uid) {
            return Err((ClipPlace { field: "uid", ..place }, twice(file.uid)));
        }
        check_layer(uid, file.weight)
            .map_err(|error| (ClipPlace { field: "weight", ..place.clone() }, error.to_string()))?;
        clip.layers.push(layer(file, &place, names)?);
    }
    Ok(clip)
}

fn twice(uid: Uid) -> String {
    format!("the uid {uid} is there twice; give the second clip or layer a uid of its own")
}

fn layer(file: LayerFile, place: &ClipPlace, names: &mut NodeNames) -> Result<ClipLayer, Error> {
    let LayerFile { uid, name, mode, weight, muted, mask, tracks: files } = file;
    let mut note = |node: Uid, label: String, role: String| {
        if !label.is_empty() || !role.is_empty() {
            names.0.insert(node, NodeName { label, role });
        }
    };
    let mut masked = Vec::with_capacity(mask.len());
    for NodeFile { node, label, role } in mask {
        masked.push(node);
        note(node, label, role);
    }
    let mut tracks = BTreeMap::new();
    for (number, file) in files.into_iter().enumerate() {
        let place = ClipPlace { track: Some(number), ..place.clone() };
        let TrackFile { node, label, role, property, keys } = file;
        note(node, label, role);
        let target = TrackTarget { node, property };
        if tracks.contains_key(&target) {
            let message = format!("the {} of {node} has two tracks in the layer; keep one of them", target.property);
            return Err((ClipPlace { field: "property", ..place }, message));
        }
        let keys = read_keys(node, &target.property, keys, &place)?;
        if !keys.is_empty() {
            tracks.insert(target, Arc::new(Track { keys }));
        }
    }
    Ok(ClipLayer { uid, name, mode, weight, mask: masked, muted, tracks })
}

fn read_keys(node: Uid, property: &Property, files: Vec<KeyFile>, place: &ClipPlace) -> Result<Vec<Key>, Error> {
    let width = property.width();
    let at = |key: usize, field: &'static str| ClipPlace { key: Some(key), field, ..place.clone() };
    let mut keys: Vec<Key> = Vec::with_capacity(files.len());
    for (number, KeyFile { t: time, v, ease }) in files.into_iter().enumerate() {
        let counted = |numbers: &Numbers, field: &'static str| {
            if numbers.count == width {
                return Ok(numbers.values);
            }
            let message = format!("{} numbers for the {property}, which has {width}; correct them", numbers.count);
            Err((at(number, field), message))
        };
        let value = counted(&v, "v")?;
        let ease = match &ease {
            EaseFile::Stepped => Ease::Stepped,
            EaseFile::Linear => Ease::Linear,
            EaseFile::Cubic { arrive, leave } => {
                Ease::Cubic { arrive: counted(arrive, "ease")?, leave: counted(leave, "ease")? }
            }
        };
        let key = Key { time, value, ease };
        let rises = keys.last().is_none_or(|before| before.time < time);
        let checked = check_keys(property, &[key]);
        if let Err(fault) = if rises { checked } else { checked.and(Err(KeyFault::Order(time))) } {
            let field = if matches!(fault, KeyFault::Order(_)) { "t" } else { "v" };
            let target = TrackTarget { node, property: property.clone() };
            return Err((at(number, field), EditError::BadKeys { target, fault }.to_string()));
        }
        keys.push(key);
    }
    Ok(keys)
}
