//! Exports: the format follows from the ending of the file, names and axes from a preset, and what was written is read back
//! with Rigsmith's own readers.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::prelude::*;

use super::{
    active,
    clips::{packed_clips, put_clips},
    dialog::Purpose,
    document::{OpenDocument, last_step, meshes},
    error::WriteError,
    file_name,
    open::spawn,
    save::{Job, SaveJob, SavedContent, animated_names, settled},
};
use crate::{
    algo::face::expression::{ExpressionSet, vrm_mixes},
    editor::counts::counted,
    files::{
        Disk, DocumentBase, FileKind, LoadError, RealDisk, StopSign, StoppableDisk, StoreError, TemplateOrigin,
        is_template_of, load_animation, load_model, load_packed_clips, load_rig_text, load_skin, load_template, stem,
        store_animation, store_avatar, store_document_over, store_model, store_packed_clips, store_rig_from,
        store_skin,
    },
    instance::RigSource,
    mesh::{gltf::GltfWriteSettings, model::Model},
    plugins::{
        commands::{BuildResult, RigModules},
        face::FaceExpressions,
        surface::RigMesh,
    },
    processor::Modules,
    rig::{
        BuiltRig, Rig, Uid,
        animation::NodeNames,
        bake::baked,
        character::{Character, character, mark_joints},
        nearest::listed,
        skeleton_preset::{SkeletonPreset, apply_preset},
        skin::{SkinFile, SkinJoint},
        vrm::{AvatarError, AvatarSource, ExpressionRecipe, avatar_meta, hang_half_joints},
    },
    solve::avatar::make_avatar,
};

/// Choices of an export that its file name does not say.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct ExportOptions {
    /// Names and axes of the skeleton.
    pub preset: SkeletonPreset,
    /// Author of an avatar; that of the rig's header if it is empty.
    pub author: String,
}

/// Presets in the order of the dialog, with their names.
pub(super) const PRESETS: [(SkeletonPreset, &str); 5] = [
    (SkeletonPreset::Plain, "As in the rig"),
    (SkeletonPreset::Mixamo, "Mixamo"),
    (SkeletonPreset::Unreal, "Unreal mannequin"),
    (SkeletonPreset::Unity, "Unity humanoid"),
    (SkeletonPreset::Vrm, "VRM"),
];

/// Effect of a preset, in a few words.
pub(super) fn effect(preset: SkeletonPreset) -> &'static str {
    match preset {
        SkeletonPreset::Plain => "Names and axes of the joints stay.",
        SkeletonPreset::Mixamo => "Bones are called mixamorig:LeftUpLeg and so on; Y points along them.",
        SkeletonPreset::Unreal => "Bones are called thigh_l and so on; X points along them.",
        SkeletonPreset::Unity => "Bones are called LeftUpperLeg and so on; their axes are those of the model.",
        SkeletonPreset::Vrm => {
            "Bones are called leftUpperLeg and so on; as .vrm the character is an avatar of VRM 1.0."
        }
    }
}

/// True for files that have names and axes of a skeleton, which a preset changes.
pub(super) fn takes_preset(path: &Path) -> bool {
    matches!(FileKind::of(path), Some(FileKind::Glb | FileKind::Gltf | FileKind::Vrm))
}

/// Exports the format given by the path's extension.
pub(super) fn export(world: &mut World, path: PathBuf) {
    if world.resource::<SaveJob>().name().is_some() {
        world.resource_mut::<SaveJob>().queue(Purpose::Export, path, None);
        return;
    }
    let Some(rig) = active(world) else { return };
    let Some(data) = settled(world, rig) else { return };
    let open: Vec<RigMesh> = meshes(world, rig).into_iter().map(|(_, mesh, _)| mesh.clone()).collect();
    let (step, name) = (last_step(world, rig), file_name(&path));
    let built = world.get::<BuildResult>(rig).map(|built| built.0.clone());
    let Some(modules) = world.get_resource::<RigModules>().map(|modules| modules.0.clone()) else { return };
    let document = world.get::<OpenDocument>(rig);
    let template = document.and_then(|document| document.template.clone());
    let base = document.and_then(|document| document.base.as_ref()).map(|base| &base.rig);
    let source = world.get::<RigSource>(rig);
    let base = source.and_then(RigSource::base).or(base).cloned();
    let parts = source.map_or_else(Vec::new, |source| source.taken_over().parts.to_vec());
    let options = world.get_resource::<ExportOptions>().cloned().unwrap_or_default();
    let FaceExpressions(expressions) = world.get_resource().cloned().unwrap_or_default();
    let names = animated_names(world, &data);
    let sign = StopSign::default();
    let heeded = sign.clone();
    let task = spawn(move || {
        let disk = StoppableDisk::new(&RealDisk, heeded);
        let (built, base) = (built.as_deref(), DocumentBase { rig: base.as_deref(), parts: &parts });
        let (meshes, expressions, names) = (&*open, &*expressions, &names);
        let source =
            ExportSource { disk: &disk, rig: &data, built, modules: &modules, expressions, meshes, base, names };
        let notes = source.write(&path, template.as_deref(), &options)?;
        let checked = check(&path);
        let is_followed = match &template {
            Some(template) => *template == path,
            None => FileKind::of(&path) == Some(FileKind::Template),
        };
        let template = is_followed.then(|| (path, Arc::new(data)));
        Ok(SavedContent::Export { checked, notes, template })
    });
    world.resource_mut::<SaveJob>().begin(Job { name, rig, step, task, sign, then: None });
}

/// Document that is exported.
struct ExportSource<'a> {
    disk: &'a dyn Disk,
    rig: &'a Rig,
    built: Option<&'a BuiltRig>,
    modules: &'a Arc<Modules>,
    /// Expressions of faces.
    expressions: &'a ExpressionSet,
    /// Meshes of the rig, which are one file together.
    meshes: &'a [RigMesh],
    /// The version of the template that the document took over last.
    base: DocumentBase<'a>,
    /// Names of animated nodes that the window knows.
    names: &'a NodeNames,
}

impl ExportSource<'_> {
    fn write(&self, path: &Path, template: Option<&Path>, options: &ExportOptions) -> Result<Vec<String>, WriteError> {
        let rig = self.rig;
        match FileKind::of(path) {
            Some(FileKind::Vrm) => self.avatar(path, options),
            Some(FileKind::Glb | FileKind::Gltf | FileKind::Obj) => {
                let mut model = self.character();
                self.mark_joints(&mut model);
                put_clips(&mut model, rig, self.built, self.modules)?;
                let mut notes = self.loose_meshes();
                if options.preset != SkeletonPreset::Plain
                    && takes_preset(path)
                    && apply_preset(&mut model, options.preset).is_none()
                {
                    notes.push("no human was found in the skeleton: names and axes stay".to_owned());
                }
                // Without weights no joint deforms, and none would be written.
                let is_bare = self.meshes.iter().all(|mesh| rig.skin(mesh.uid).is_none());
                let settings = GltfWriteSettings { all_joints: is_bare, ..default() };
                notes.extend(store_model(self.disk, path, &model, &settings)?);
                Ok(notes)
            }
            Some(FileKind::Animation) if rig.clips().is_empty() => Err(WriteError::NoClips),
            Some(FileKind::Animation) => {
                let mut clips = rig.clips().to_vec();
                clips.iter_mut().for_each(|clip| clip.names.extend(self.names));
                store_animation(self.disk, path, rig, self.built, &clips)?;
                Ok(Vec::new())
            }
            Some(FileKind::PackedClips) if rig.clips().is_empty() => Err(WriteError::NoClips),
            Some(FileKind::PackedClips) => {
                store_packed_clips(self.disk, path, &packed_clips(rig, self.built, self.modules)?)?;
                Ok(Vec::new())
            }
            Some(FileKind::Template | FileKind::RigText) => {
                let sources = [Some(path), template];
                let sources: Vec<&Path> = sources.into_iter().flatten().collect();
                Ok(self.store_rig(path, &sources)?)
            }
            Some(FileKind::Skin) => {
                let mut bound = self.meshes.iter().filter_map(|mesh| Some((mesh, rig.skin(mesh.uid)?)));
                let (mesh, skin) = bound.next().ok_or(WriteError::NoWeights)?;
                let others: Vec<&str> = bound.map(|(mesh, _)| mesh.file.name.as_str()).collect();
                let joints = SkinJoint::list(rig, skin);
                let file = SkinFile::new(joints, skin.weights.clone(), &mesh.rest.points, &mesh.triangles, true);
                let file = file?;
                store_skin(self.disk, path, &file)?;
                let note = || {
                    let (name, others) = (&mesh.file.name, listed(&others, "and"));
                    format!("a .skin file is of one mesh, {name:?}: the weights of {others} are not in it")
                };
                Ok((!others.is_empty()).then(note).into_iter().collect())
            }
            _ => Err(WriteError::Ending),
        }
    }

    /// Saves the rig over its template. One that is in no file yet keeps the parts of the template of Rigsmith that it was made
    /// from, by a fit for example.
    fn store_rig(&self, path: &Path, sources: &[&Path]) -> Result<Vec<String>, StoreError> {
        let is_known = sources.iter().any(|source| is_template_of(self.disk, source, self.rig.uid()));
        let is_first = FileKind::of(path) == Some(FileKind::Template) && !is_known;
        match is_first.then(|| TemplateOrigin::of(self.rig)).flatten() {
            Some(origin) => store_rig_from(self.disk, path, self.rig, &origin),
            None => store_document_over(self.disk, path, self.rig, self.base, sources),
        }
    }

    /// The character at rest, with all its meshes and their weights.
    fn character(&self) -> Model {
        let mut models = self.meshes.iter().map(|mesh| self.character_of(Some(mesh)));
        let mut model = models.next().unwrap_or_else(|| self.character_of(None));
        models.for_each(|more| model.append(more));
        model
    }

    /// Notes about meshes that stay where they are when joints of the file move, beside others that follow them.
    fn loose_meshes(&self) -> Vec<String> {
        let is_bound = |mesh: &RigMesh| self.rig.skin(mesh.uid).is_some();
        if !self.meshes.iter().any(is_bound) {
            return Vec::new();
        }
        let is_loose = |mesh: &RigMesh| !is_bound(mesh) && mesh.file.objects.iter().any(|object| object.node.is_none());
        let names: Vec<&str> =
            self.meshes.iter().filter(|mesh| is_loose(mesh)).map(|mesh| mesh.file.name.as_str()).collect();
        let note =
            || format!("joints do not move {}, without weights; the Skinning panel binds it", listed(&names, "and"));
        (!names.is_empty()).then(note).into_iter().collect()
    }

    /// The rig with one of its meshes, or without any.
    fn character_of(&self, mesh: Option<&RigMesh>) -> Model {
        let rig = self.rig;
        let empty = Model { name: rig.about().name.clone(), ..default() };
        character(&Character {
            rig,
            built: self.built,
            file: mesh.map_or(&empty, |mesh| &mesh.file),
            rest: mesh.map_or(&empty, |mesh| &mesh.rest),
            nodes: mesh.map_or(&[], |mesh| &mesh.nodes),
            skin: mesh.and_then(|mesh| rig.skin(mesh.uid)).map(Arc::as_ref),
        })
    }

    /// Skeleton of a model that has no weights, for readers that know joints by skins.
    fn mark_joints(&self, model: &mut Model) {
        match self.built {
            Some(built) => mark_joints(model, &baked(self.rig, built)),
            None => mark_joints(model, self.rig),
        }
    }

    /// Writes an avatar of VRM 1.0, as `rigsmith build` does.
    fn avatar(&self, path: &Path, options: &ExportOptions) -> Result<Vec<String>, WriteError> {
        let authors = [options.author.clone()];
        let meta = avatar_meta(self.rig.about(), &authors, &stem(path)).map_err(|error| match error {
            AvatarError::NoAuthor(_) => WriteError::NoAuthor,
            error => error.into(),
        })?;
        let mut model = self.character();
        let bare = self.built.map(|built| baked(self.rig, built));
        let mut joints: Vec<Uid> = Vec::with_capacity(model.nodes.len());
        for (joint, node) in bare.as_ref().unwrap_or(self.rig).walk().zip(&mut model.nodes) {
            joints.push(joint.data.uid);
            node.rest = joint.data.rest.into();
        }
        self.mark_joints(&mut model);
        let source = AvatarSource { rig: self.rig, built: self.built, joints: &joints };
        hang_half_joints(&mut model, &source);
        put_clips(&mut model, self.rig, self.built, self.modules)?;
        let recipe = |(preset, shapes)| ExpressionRecipe { preset, shapes };
        let recipes: Vec<ExpressionRecipe> = vrm_mixes(self.expressions).into_iter().map(recipe).collect();
        let made = make_avatar(&mut model, &source, meta, &recipes)?;
        // Bones of the human are written whether skin hangs on them or not.
        let settings = GltfWriteSettings { all_joints: true, ..default() };
        store_avatar(self.disk, path, &model, &made.avatar, &settings)?;
        Ok(made.notes)
    }
}

/// Content of a written file as Rigsmith's own reader finds it, in a sentence.
fn check(path: &Path) -> Result<String, LoadError> {
    let parts = match FileKind::of(path) {
        Some(FileKind::Glb | FileKind::Gltf | FileKind::Obj | FileKind::Vrm) => {
            let model = load_model(&RealDisk, path)?;
            let morphs: usize = model.objects.iter().map(|object| object.morph_names.len()).sum();
            let all = [
                (model.points.len(), "point", "points"),
                (model.nodes.len(), "joint", "joints"),
                (morphs, "morph target", "morph targets"),
                (model.clips.len(), "animation", "animations"),
            ];
            let there = all.into_iter().filter(|(count, ..)| *count > 0);
            there.map(|(count, one, more)| counted(count, one, more)).collect()
        }
        Some(FileKind::Animation) => {
            let read = load_animation(&RealDisk, path)?;
            let keys = read.clips.iter().map(crate::rig::animation::RigClip::key_count).sum();
            vec![counted(read.clips.len(), "clip", "clips"), counted(keys, "key", "keys")]
        }
        Some(FileKind::PackedClips) => {
            let packed = load_packed_clips(&RealDisk, path)?;
            let (clips, joints) = (packed.clips.len(), packed.nodes.len());
            vec![counted(clips, "clip", "clips"), counted(joints, "joint", "joints")]
        }
        Some(FileKind::Template) => {
            let rig = load_template(&RealDisk, path)?.rig;
            let tags = rig.walk().map(|joint| joint.data.tags.len()).sum();
            vec![counted(rig.len(), "joint", "joints"), counted(tags, "tag", "tags")]
        }
        Some(FileKind::RigText) => {
            load_rig_text(&RealDisk, path)?;
            vec!["the skeleton".to_owned()]
        }
        Some(FileKind::Skin) => {
            load_skin(&RealDisk, path)?;
            vec!["the weights".to_owned()]
        }
        _ => Vec::new(),
    };
    Ok(parts.join(", "))
}
