//! Reader of projects: strict, with the place of each error.

use std::{
    borrow::Cow,
    collections::{BTreeSet, HashMap, HashSet},
};

use bevy::math::Vec3;
use serde::{Deserialize, Deserializer, de::Error as _, de::IgnoredAny};

use super::{
    FORMAT, JournalReference, MAX_BYTES, MeshReference, Project, ProjectRig, ProjectView, ReadProject, SkinReference,
    TemplateReference,
};
use crate::rig::{
    AttributeValues, EditError, FaceCut, Rig, RigEdit, SelectionSet, SourceError, StoredPose, Uid,
    animation::NodeNames,
    format::animation::{ClipFile, clip_fields, clip_offset, clips_in},
    format::poses::{OffsetFile, PoseFile, ValueFile},
    format::scan::{self, Field},
    format::source::{ron_options, utf8},
    format::version::Format,
    part::DroppedPart,
    template,
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProjectFile {
    #[serde(rename = "format")]
    _format: u32,
    name: String,
    #[serde(default)]
    meshes: Vec<MeshReference>,
    #[serde(default)]
    rigs: Vec<RigFile>,
    #[serde(default)]
    templates: Vec<TemplateFile>,
    #[serde(default)]
    view: ProjectView,
    #[serde(default)]
    journal: Option<JournalReference>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TemplateFile {
    rig: Uid,
    path: String,
    /// The base is read separately, as a template from the text.
    #[serde(rename = "base")]
    _base: IgnoredAny,
    #[serde(default)]
    text: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RigFile {
    /// The rig is read separately, as a template from the text.
    #[serde(rename = "rig")]
    _rig: IgnoredAny,
    #[serde(default)]
    skins: Vec<SkinReference>,
    #[serde(default)]
    pose: Vec<OffsetFile>,
    #[serde(default)]
    values: Vec<ValueFile>,
    #[serde(default)]
    poses: Vec<PoseFile>,
    #[serde(default)]
    clips: Vec<ClipFile>,
    #[serde(default)]
    parts: Vec<DroppedPart>,
    #[serde(default)]
    sets: Vec<SelectionSet>,
    #[serde(default)]
    faces: Vec<FaceFile>,
}

/// Cut of a face of a rig.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FaceFile {
    mesh: Uid,
    bones: u32,
    #[serde(default)]
    groups: Option<u32>,
}

pub(super) fn vector<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    let (x, y, z) = Deserialize::deserialize(deserializer)?;
    Ok(Vec3::new(x, y, z))
}

pub(super) fn mesh_hash<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u128, D::Error> {
    let text = Cow::<'de, str>::deserialize(deserializer)?;
    let number = is_hexadecimal(&text, 32).then(|| u128::from_str_radix(&text, 16).ok()).flatten();
    number.ok_or_else(|| D::Error::custom(format!("\"{text}\" is no hash of a mesh: it has 32 hexadecimal digits")))
}

pub(super) fn content_hash<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let text = Cow::<'de, str>::deserialize(deserializer)?;
    let number = is_hexadecimal(&text, 16).then(|| u64::from_str_radix(&text, 16).ok()).flatten();
    number.ok_or_else(|| D::Error::custom(format!("\"{text}\" is no hash of a file: it has 16 hexadecimal digits")))
}

fn is_hexadecimal(text: &str, digits: usize) -> bool {
    text.len() == digits && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

const PROJECT: Format = Format { what: "project", number: FORMAT, known: known_names };

/// Reads a project. An error anywhere refuses the whole project, except in the view, whose errors are ignored.
pub fn read_project(bytes: &[u8]) -> Result<ReadProject, SourceError> {
    let text = utf8(bytes, MAX_BYTES, "project")?;
    let fields = scan::fields(text);
    let mut notes = Vec::new();
    let known = PROJECT.readable(text, &fields, 1, &mut notes)?;
    let file: ProjectFile = ron_options().from_str(&known).map_err(|error| SourceError::from_ron(text, &error))?;
    let places = Places::new(text, &fields);
    let ProjectFile { name, meshes, rigs, templates, mut view, journal, .. } = file;
    let rigs = read_rigs(&places, rigs, &meshes, &mut notes)?;
    let templates = read_templates(&places, templates, &rigs, &mut notes)?;
    check_meshes(&places, &meshes, &rigs)?;
    if view.camera.is_some_and(|camera| !camera.is_finite()) {
        view.camera = None;
        notes.push("the view's camera is not finite; the whole character is shown instead".to_owned());
    }
    let kept = view.graph.len();
    view.graph.retain(|_, place| place.iter().all(|number| number.is_finite()));
    if view.graph.len() < kept {
        notes.push("places of the graph are not finite; those nodes are laid out instead".to_owned());
    }
    let project = Project { name, meshes, rigs, templates, view, journal, names: NodeNames::default() };
    Ok(ReadProject { project, notes })
}

fn check_meshes(places: &Places, meshes: &[MeshReference], rigs: &[ProjectRig]) -> Result<(), SourceError> {
    let mut seen = HashSet::new();
    let known: HashSet<Uid> = rigs.iter().map(|rig| rig.rig.uid()).collect();
    for (mesh, element) in meshes.iter().zip(places.elements(places.top("meshes"))) {
        if !seen.insert(mesh.uid) {
            let message = format!("mesh {} is listed twice; give the second a uid of its own", mesh.uid);
            return Err(places.error(element, "uid", message));
        }
        if !known.contains(&mesh.rig) {
            let message = format!("the mesh belongs to the rig {}, which is not in the file; correct it", mesh.rig);
            return Err(places.error(element, "rig", message));
        }
    }
    Ok(())
}

fn read_templates(
    places: &Places,
    files: Vec<TemplateFile>,
    rigs: &[ProjectRig],
    notes: &mut Vec<String>,
) -> Result<Vec<TemplateReference>, SourceError> {
    let mut found: Vec<TemplateReference> = Vec::with_capacity(files.len());
    let mut bases = Templates { text: places.text, line: 1, counted: 0 };
    for (TemplateFile { rig, path, text, .. }, element) in
        files.into_iter().zip(places.elements(places.top("templates")))
    {
        if !rigs.iter().any(|known| known.rig.uid() == rig) {
            let message = format!("the template is of the rig {rig}, which is not in the file; correct it");
            return Err(places.error(element, "rig", message));
        }
        if found.iter().any(|known| known.rig == rig) {
            let message = format!("rig {rig} follows two templates; keep one of them");
            return Err(places.error(element, "rig", message));
        }
        let base = bases.read(places.within(element, "base").map(|field| &places.fields[field]), notes)?;
        found.push(TemplateReference { rig, path, base, text });
    }
    Ok(found)
}

fn read_rigs(
    places: &Places,
    files: Vec<RigFile>,
    meshes: &[MeshReference],
    notes: &mut Vec<String>,
) -> Result<Vec<ProjectRig>, SourceError> {
    let known: HashSet<Uid> = meshes.iter().map(|mesh| mesh.uid).collect();
    let mut rigs: Vec<ProjectRig> = Vec::with_capacity(files.len());
    let mut seen = HashSet::new();
    let mut templates = Templates { text: places.text, line: 1, counted: 0 };
    for ((number, file), element) in files.into_iter().enumerate().zip(places.elements(places.top("rigs"))) {
        let field = places.within(element, "rig").map(|field| &places.fields[field]);
        let mut rig = templates.read(field, notes)?;
        if !seen.insert(rig.uid()) {
            let message = format!("rig {} is in the project twice; give the second a uid of its own", rig.uid());
            return Err(places.error(element, "rig", message));
        }
        let mut skinned = HashSet::new();
        for (skin, place) in file.skins.iter().zip(places.elements(places.within(element, "skins"))) {
            if !known.contains(&skin.mesh) {
                let message = format!("the weights are of the mesh {}, which is not in the file; add it", skin.mesh);
                return Err(places.error(place, "mesh", message));
            }
            if !skinned.insert(skin.mesh) {
                let message = format!("mesh {} has weights twice; keep one of the two", skin.mesh);
                return Err(places.error(place, "mesh", message));
            }
        }
        read_pose(places, element, &mut rig, &file.pose)?;
        let values = places.within(element, "values");
        for (node, values) in read_values(places, values, &file.values)? {
            for (name, value) in values {
                let edit = RigEdit::SetAttributeValue(node, name, Some(value));
                rig.apply(&edit).map_err(|error| places.error(element, "values", error.to_string()))?;
            }
        }
        read_stored_poses(places, element, &mut rig, &file.poses)?;
        read_clips(places, number, &mut rig, file.clips)?;
        let edit = RigEdit::SetDroppedParts(file.parts);
        rig.apply(&edit).map_err(|error| places.error(element, "parts", error.to_string()))?;
        let edit = RigEdit::SetSelectionSets(file.sets);
        rig.apply(&edit).map_err(|error| places.error(element, "sets", error.to_string()))?;
        read_faces(places, element, &mut rig, &file.faces)?;
        rigs.push(ProjectRig { rig, skins: file.skins });
    }
    Ok(rigs)
}

fn read_faces(places: &Places, element: Option<usize>, rig: &mut Rig, faces: &[FaceFile]) -> Result<(), SourceError> {
    for (face, place) in faces.iter().zip(places.elements(places.within(element, "faces"))) {
        if rig.face_cut(face.mesh).is_some() {
            let message = format!("the face of mesh {} has two cuts; keep one of them", face.mesh);
            return Err(places.error(place, "mesh", message));
        }
        let edit = RigEdit::SetFaceCut(face.mesh, Some(FaceCut { bones: face.bones, groups: face.groups }));
        rig.apply(&edit).map_err(|error| places.error(place, "mesh", error.to_string()))?;
    }
    Ok(())
}

fn read_pose(
    places: &Places,
    element: Option<usize>,
    rig: &mut Rig,
    offsets: &[OffsetFile],
) -> Result<(), SourceError> {
    let mut seen = HashSet::new();
    for (offset, place) in offsets.iter().zip(places.elements(places.within(element, "pose"))) {
        if !seen.insert(offset.joint) {
            return Err(places.error(place, "joint", twice(offset.joint)));
        }
        let edit = RigEdit::SetOffset(offset.joint, Some(offset.offset()));
        rig.apply(&edit).map_err(|error| places.error(place, named(&error), error.to_string()))?;
    }
    Ok(())
}

fn read_stored_poses(
    places: &Places,
    element: Option<usize>,
    rig: &mut Rig,
    poses: &[PoseFile],
) -> Result<(), SourceError> {
    for (pose, place) in poses.iter().zip(places.elements(places.within(element, "poses"))) {
        let mut stored = StoredPose { uid: pose.uid, name: pose.name.clone(), ..Default::default() };
        for (offset, at) in pose.offsets.iter().zip(places.elements(places.within(place, "offsets"))) {
            if !offset.offset().is_valid() {
                let error = EditError::BadTransform(offset.joint);
                return Err(places.error(at, named(&error), error.to_string()));
            }
            if stored.offsets.insert(offset.joint, offset.offset()).is_some() {
                return Err(places.error(at, "joint", twice(offset.joint)));
            }
        }
        stored.values = read_values(places, places.within(place, "values"), &pose.values)?;
        let edit = RigEdit::AddStoredPose(Box::new(stored), usize::MAX);
        rig.apply(&edit).map_err(|error| places.error(place, "uid", error.to_string()))?;
    }
    Ok(())
}

fn read_clips(places: &Places, number: usize, rig: &mut Rig, files: Vec<ClipFile>) -> Result<(), SourceError> {
    let path = [("rigs", number)];
    let (clips, mut names) = clips_in(files, places.text, &path)?;
    // Joints of the document have their labels.
    names.0.retain(|node, _| rig.joint(*node).is_none());
    for (number, mut clip) in clips.into_iter().enumerate() {
        let masked = clip.layers.iter().flat_map(|layer| layer.mask.iter().copied());
        let nodes: BTreeSet<Uid> = clip.nodes().into_iter().chain(masked).collect();
        let own = names.0.iter().filter(|(node, _)| nodes.contains(*node));
        clip.names = NodeNames(own.map(|(node, name)| (*node, name.clone())).collect());
        rig.apply(&RigEdit::AddClip(Box::new(clip), usize::MAX)).map_err(|error| {
            let offset = clip_offset(places.text, &path, number).unwrap_or_default();
            SourceError::at(places.text, offset, error.to_string())
        })?;
    }
    Ok(())
}

fn read_values(places: &Places, list: Option<usize>, files: &[ValueFile]) -> Result<AttributeValues, SourceError> {
    let mut values = AttributeValues::new();
    for (file, at) in files.iter().zip(places.elements(list)) {
        if !file.value.is_finite() {
            let error = EditError::BadValue(file.node, file.name.clone());
            return Err(places.error(at, "value", error.to_string()));
        }
        if values.entry(file.node).or_default().insert(file.name.clone(), file.value).is_some() {
            let message = format!("attribute \"{}\" of {} has two values; keep one of them", file.name, file.node);
            return Err(places.error(at, "name", message));
        }
    }
    Ok(values)
}

fn twice(joint: Uid) -> String {
    format!("joint {joint} is in the pose twice; keep one of the two")
}

/// Name of the field that an edit's error refers to.
fn named(error: &EditError) -> &'static str {
    if matches!(error, EditError::BadTransform(_)) { "rotation" } else { "joint" }
}

/// Names that are allowed for a field at its place; `None` where any name is allowed, and in rigs, which are templates.
fn known_names(fields: &[Field], field: &Field) -> Option<&'static [&'static str]> {
    let above = |field: &Field| field.parent.map(|parent| &fields[parent]);
    let mut whole: Vec<&str> =
        std::iter::successors(above(field), |field| above(field)).map(|field| field.name).collect();
    whole.reverse();
    if let ["rigs", "clips", rest @ ..] = &whole[..] {
        return clip_fields(rest);
    }
    let mut path = [""; 3];
    let mut parents = std::iter::successors(above(field), |field| above(field));
    for (name, parent) in path.iter_mut().zip(&mut parents) {
        *name = parent.name;
    }
    if parents.next().is_some() {
        return None;
    }
    const OFFSET: &[&str] = &["joint", "translation", "rotation", "scale"];
    match (field.depth, path) {
        (1, ["", "", ""]) => Some(&["format", "name", "meshes", "rigs", "templates", "view", "journal"]),
        (3, ["meshes", "", ""]) => Some(&["uid", "rig", "path", "hash", "nodes"]),
        (3, ["templates", "", ""]) => Some(&["rig", "path", "base", "text"]),
        (3, ["rigs", "", ""]) => Some(&["rig", "skins", "pose", "values", "poses", "clips", "parts", "sets", "faces"]),
        (5, ["skins", "rigs", ""]) => Some(&["mesh", "path", "hash", "at_rest"]),
        (5, ["sets", "rigs", ""]) => Some(&["name", "nodes"]),
        (5, ["faces", "rigs", ""]) => Some(&["mesh", "bones", "groups"]),
        (5, ["parts", "rigs", ""]) => Some(&["uid", "part", "joints", "mirror"]),
        (5, ["pose", "rigs", ""]) => Some(OFFSET),
        (5, ["poses", "rigs", ""]) => Some(&["uid", "name", "offsets", "values"]),
        (7, ["offsets", "poses", "rigs"]) => Some(OFFSET),
        (5, ["values", "rigs", ""]) | (7, ["values", "poses", "rigs"]) => Some(&["node", "name", "value"]),
        (2, ["view", "", ""]) => Some(&["camera", "mode", "shading", "switches", "graph", "clip"]),
        (3, ["camera", "view", ""]) => Some(&["yaw", "pitch", "distance", "focus", "orthographic"]),
        (2, ["journal", "", ""]) => Some(&["file", "last"]),
        _ => None,
    }
}

/// Finds the places of declarations in the text. Structs are identified by their bracket.
struct Places<'a> {
    text: &'a str,
    fields: &'a [Field<'a>],
    /// Fields of each struct.
    structs: HashMap<usize, Vec<usize>>,
    /// Structs of each list, by the field that has the list as its value.
    lists: HashMap<usize, Vec<usize>>,
}

impl<'a> Places<'a> {
    fn new(text: &'a str, fields: &'a [Field<'a>]) -> Self {
        let mut structs: HashMap<usize, Vec<usize>> = HashMap::new();
        let mut lists: HashMap<usize, Vec<usize>> = HashMap::new();
        for (number, field) in fields.iter().enumerate() {
            structs.entry(field.bracket).or_default().push(number);
            if let Some(list) = field.parent.filter(|parent| fields[*parent].depth + 2 == field.depth) {
                let brackets = lists.entry(list).or_default();
                if brackets.last() != Some(&field.bracket) {
                    brackets.push(field.bracket);
                }
            }
        }
        Self { text, fields, structs, lists }
    }

    /// The field of the outermost struct with that name.
    fn top(&self, name: &str) -> Option<usize> {
        self.within(self.fields.iter().find(|field| field.depth == 1).map(|field| field.bracket), name)
    }

    /// The field with that name in a struct.
    fn within(&self, bracket: Option<usize>, name: &str) -> Option<usize> {
        self.structs.get(&bracket?)?.iter().copied().find(|field| self.fields[*field].name == name)
    }

    /// Structs in the list that is a field's value, followed by `None` without end.
    fn elements(&self, list: Option<usize>) -> impl Iterator<Item = Option<usize>> {
        let brackets = list.and_then(|list| self.lists.get(&list)).map_or(&[] as &[usize], Vec::as_slice);
        brackets.iter().copied().map(Some).chain(std::iter::repeat(None))
    }

    /// An error at a field of a struct, or at the struct.
    fn error(&self, bracket: Option<usize>, name: &str, message: String) -> SourceError {
        let first = || self.structs.get(&bracket?)?.first().copied();
        let field = self.within(bracket, name).or_else(first);
        SourceError::at(self.text, field.map_or(0, |field| self.fields[field].start), message)
    }
}

/// Reader of the templates inside a text, in the order of the text.
struct Templates<'a> {
    text: &'a str,
    line: usize,
    counted: usize,
}

impl Templates<'_> {
    /// The rig that is the value of a field.
    fn read(&mut self, field: Option<&Field>, notes: &mut Vec<String>) -> Result<Rig, SourceError> {
        let Some(field) = field.filter(|field| field.value >= self.counted) else {
            return Err(SourceError::at(self.text, 0, "a rig of the project cannot be found in it; take a backup"));
        };
        self.line += self.text[self.counted..field.value].matches('\n').count();
        self.counted = field.value;
        let text = &self.text[field.value..field.end];
        let template = template::read_text(text.strip_suffix(',').unwrap_or(text), self.line)
            .map_err(|error| SourceError::at(self.text, field.value + error.offset, error.message))?;
        notes.extend(template.notes);
        Ok(template.rig)
    }
}
