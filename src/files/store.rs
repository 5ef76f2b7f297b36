//! Saving models, rigs and weights, whole or not at all.

use std::{
    borrow::Borrow,
    path::{Path, PathBuf},
};

use super::{
    Disk, FileKind, FileSet, LoadError, PartFiles, ReadError, SaveError, StagedFile,
    atomic::linked_file,
    kept_lists::with_kept_lists,
    read_capped, save_atomic, save_set, stage_file, stem,
    template_origin::moved_text,
    template_text::{TemplateText, new_template_text, template_text},
    template_update::with_known_uids,
    verify::{self, ModelCounts},
};
use crate::{
    mesh::{
        gltf::{GltfError, GltfWriteSettings, write_glb, write_gltf, write_vrm},
        model::Model,
        obj::write_obj,
        vrm::Avatar,
    },
    rig::{
        BuiltRig, Rig, Uid,
        animation::RigClip,
        character::rig_text,
        format::animation::{self, write_animation},
        part::PartInstance,
        project,
        skin::{SkinError, SkinFile},
        template,
        text::{self, RigTextError},
    },
    solve::packed_clip::PackedSkeleton,
};

/// Reason for not saving a file. The former content of the file is unchanged.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The disk refused the save.
    #[error(transparent)]
    Save(#[from] SaveError),
    /// glTF cannot hold the model.
    #[error("`{}`: {source}", path.display())]
    Gltf {
        /// The file.
        path: PathBuf,
        /// Reason for the refusal.
        source: GltfError,
    },
    /// The `.rig` format cannot hold the rig.
    #[error("`{}`: {source}", path.display())]
    RigText {
        /// The file.
        path: PathBuf,
        /// Reason for the refusal.
        source: RigTextError,
    },
    /// The template would be longer than the limit of its reader.
    #[error(
        "`{}`: the template would have {mebibytes} MiB, and no more than {} are read; save as .rig, or split the rig",
        path.display(),
        template::MAX_BYTES >> 20
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Length in mebibytes that the file would have.
        mebibytes: usize,
    },
    /// The project would be longer than the limit of its reader.
    #[error(
        "`{}`: the project would have {mebibytes} MiB, and no more than {} are read; delete stored poses, or split the rig",
        path.display(),
        project::MAX_BYTES >> 20
    )]
    ProjectTooLarge {
        /// The file.
        path: PathBuf,
        /// Length in mebibytes that the file would have.
        mebibytes: usize,
    },
    /// The clips would be longer than the limit of their reader.
    #[error(
        "`{}`: the clips would have {mebibytes} MiB, and no more than {} are read; reduce their keys, or save them one by one",
        path.display(),
        animation::MAX_BYTES >> 20
    )]
    AnimationTooLarge {
        /// The file.
        path: PathBuf,
        /// Length in mebibytes that the file would have.
        mebibytes: usize,
    },
    /// The weights are invalid for any file.
    #[error("`{}`: {source}", path.display())]
    Skin {
        /// The file.
        path: PathBuf,
        /// Defect of the weights.
        source: SkinError,
    },
    /// The file would have no content.
    #[error("`{}` was not written, and nothing was changed: {what}", path.display())]
    Nothing {
        /// The file.
        path: PathBuf,
        /// The reason, and what to do.
        what: &'static str,
    },
    /// The text of a template that was to be changed cannot be read.
    #[error("`{}` was not written, because its present text could not be read ({source}), and nothing was changed; allow reading it and try again, or save under another name", path.display())]
    Unread {
        /// The file.
        path: PathBuf,
        /// Error of reading it.
        source: ReadError,
    },
    /// Rigsmith's own reader refuses the bytes that were to be written.
    #[error("`{}` was not written, because it could not be read again ({source}), and nothing was changed; save in another format and report this", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reader's answer.
        source: Box<LoadError>,
    },
    /// Rigsmith's own reader finds less content than was to be written.
    #[error("`{}` was not written, because only {read} of {written} {what} could be read again, and nothing was changed; save in another format and report this", path.display())]
    Lost {
        /// The file.
        path: PathBuf,
        /// Kind of the counted things, in words.
        what: &'static str,
        /// Number of things in the model.
        written: usize,
        /// Number of things that were read back.
        read: usize,
    },
    /// The file's name has no fitting ending.
    #[error("`{}`: {wanted}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// Endings that fit, in words.
        wanted: &'static str,
    },
}

impl StoreError {
    /// The file that was to be written.
    pub fn path(&self) -> &Path {
        match self {
            Self::Save(error) => error.path(),
            Self::Gltf { path, .. }
            | Self::RigText { path, .. }
            | Self::TooLarge { path, .. }
            | Self::ProjectTooLarge { path, .. }
            | Self::AnimationTooLarge { path, .. }
            | Self::Skin { path, .. }
            | Self::Nothing { path, .. }
            | Self::Unread { path, .. }
            | Self::Unreadable { path, .. }
            | Self::Lost { path, .. }
            | Self::Kind { path, .. } => path,
        }
    }
}

/// Saves a model as `.glb`, `.gltf` (with its buffer and images beside it) or `.obj` (with its materials), after
/// reading back what is to be written. Returns notes about content that the format could not keep, a sentence each.
///
/// # Errors
/// [`StoreError`]; the former file is unchanged. A model without any content that the format can hold is an error, too.
pub fn store_model(
    disk: &dyn Disk,
    path: &Path,
    model: &Model,
    settings: &GltfWriteSettings,
) -> Result<Vec<String>, StoreError> {
    let (set, notes) = model_set(disk, path, model, settings)?;
    verify::model(&set, ModelCounts::of(model))?;
    save_set(disk, &set)?;
    Ok(notes)
}

/// Saves a model as [`store_model`] does, and drops it before what is written is read back.
///
/// # Errors
/// Those of [`store_model`].
pub fn store_owned_model(
    disk: &dyn Disk,
    path: &Path,
    model: Model,
    settings: &GltfWriteSettings,
) -> Result<Vec<String>, StoreError> {
    let (set, notes) = model_set(disk, path, &model, settings)?;
    let counts = ModelCounts::of(&model);
    drop(model);
    verify::model(&set, counts)?;
    save_set(disk, &set)?;
    Ok(notes)
}

/// Files of a model, and notes about content that the format cannot keep.
fn model_set(
    disk: &dyn Disk,
    path: &Path,
    model: &Model,
    settings: &GltfWriteSettings,
) -> Result<(FileSet, Vec<String>), StoreError> {
    let gltf_error = |source| StoreError::Gltf { path: path.into(), source };
    let nothing = |what| Err(StoreError::Nothing { path: path.into(), what });
    let kind = FileKind::of(path);
    let has_faces = model.face_count() > 0;
    match kind {
        Some(FileKind::Glb | FileKind::Gltf) if !has_faces && model.nodes.is_empty() => {
            return nothing("there is neither a mesh nor a joint to write; give a file that has one");
        }
        Some(FileKind::Obj) if !has_faces => {
            return nothing("there is no mesh to write, and .obj holds nothing else; give a file that has one");
        }
        _ => {}
    }
    let mut set = FileSet::new(path);
    let mut notes = Vec::new();
    match kind {
        Some(FileKind::Glb) => set.finish(write_glb(model, settings).map_err(gltf_error)?),
        Some(FileKind::Gltf) => {
            let mut companion = |plain: &str, bytes| set.add(disk, plain, bytes);
            let json = write_gltf(model, settings, &stem(path), &mut companion).map_err(gltf_error)?;
            set.finish(json);
        }
        Some(FileKind::Obj) => {
            let posed = (!model.skins.is_empty()).then(|| model.at_rest());
            let mut companion = |plain: &str, bytes| set.add(disk, plain, bytes);
            let obj = write_obj(posed.as_ref().unwrap_or(model), &stem(path), &mut companion);
            set.finish(obj);
            notes = lost_in_obj(model);
        }
        Some(FileKind::Vrm) => {
            let wanted = "a .vrm has the bones of a human, which are looked for where a rig is; save the model as .glb";
            return Err(StoreError::Kind { path: path.into(), wanted });
        }
        _ => return Err(StoreError::Kind { path: path.into(), wanted: "a model is saved as .glb, .gltf or .obj" }),
    }
    Ok((set, notes))
}

/// Saves an avatar as `.vrm`, after reading back what is to be written. A model that is handed over, not lent, is dropped before:
/// reading back takes as much memory as the model.
///
/// # Errors
/// [`StoreError`]; the former file is unchanged.
pub fn store_avatar(
    disk: &dyn Disk,
    path: &Path,
    model: impl Borrow<Model>,
    avatar: &Avatar,
    settings: &GltfWriteSettings,
) -> Result<(), StoreError> {
    if FileKind::of(path) != Some(FileKind::Vrm) {
        return Err(StoreError::Kind { path: path.into(), wanted: "an avatar is saved as .vrm" });
    }
    let mut set = FileSet::new(path);
    let bytes = write_vrm(model.borrow(), avatar, settings);
    set.finish(bytes.map_err(|source| StoreError::Gltf { path: path.into(), source })?);
    let counts = ModelCounts::of(model.borrow());
    drop(model);
    verify::model(&set, counts)?;
    verify::avatar(&set, avatar)?;
    Ok(save_set(disk, &set)?)
}

/// Note about the content of a model that OBJ cannot hold; empty if there is none.
fn lost_in_obj(model: &Model) -> Vec<String> {
    let morphs = model.objects.iter().any(|object| !object.morph_names.is_empty());
    let lost: Vec<&str> = [
        (!model.nodes.is_empty(), "the skeleton"),
        (model.weights.is_some(), "weights"),
        (morphs, "morph targets"),
        (!model.clips.is_empty(), "animation clips"),
    ]
    .into_iter()
    .filter_map(|(there, what)| there.then_some(what))
    .collect();
    if lost.is_empty() { Vec::new() } else { vec![format!("OBJ cannot hold {}: left out", lost.join(", "))] }
}

const SOURCE_UNREAD: &str =
    "the file was written anew: the template that it comes from could not be read, and its comments are not in it";

/// Saves a rig over a template that was read: only what changed is written into its text, see
/// [`write_template_over`](template::write_template_over). That is the first of the files in `sources` that is a template
/// of the same rig, with parts beside it called by their way from `path`; without one, and for another kind of file, it is
/// saved as by [`store_rig`]. Returns notes, a sentence each: about what the format cannot hold, and about a text that had to
/// be written anew. A rig that is handed over is dropped as by [`store_rig`].
///
/// # Errors
/// [`StoreError`]; the former file is unchanged. A file at `path` that is one of the sources and cannot be read is not
/// replaced.
pub fn store_rig_over(
    disk: &dyn Disk,
    path: &Path,
    rig: impl Borrow<Rig>,
    sources: &[&Path],
) -> Result<Vec<String>, StoreError> {
    store_over(disk, path, rig, &[], sources)
}

/// Saves a rig as [`store_rig_over`] does. Part instances of the text that are those of `parts` get their uids.
fn store_over(
    disk: &dyn Disk,
    path: &Path,
    rig: impl Borrow<Rig>,
    parts: &[PartInstance],
    sources: &[&Path],
) -> Result<Vec<String>, StoreError> {
    if FileKind::of(path) != Some(FileKind::Template) {
        return store_rig(disk, path, rig);
    }
    let mut found = None;
    let mut is_unread = false;
    for source in sources {
        match template_of(disk, source, rig.borrow().uid()) {
            Ok(Some(text)) => {
                let text = with_known_uids(disk, source, &text, parts).unwrap_or(text);
                found = Some((*source, text));
                break;
            }
            Ok(None) => {}
            // What people wrote in it would be gone.
            Err(source) if source.path() == path => return Err(StoreError::Unread { path: path.into(), source }),
            Err(_) => is_unread = true,
        }
    }
    is_unread &= found.is_none();
    let reader = || PartFiles::new(disk);
    // Parts beside the one file may not be there beside the other. Those that were dropped are known by the names that they had.
    let has_dropped = !rig.borrow().dropped_parts().is_empty();
    let linked = linked_file(disk, path);
    let place = linked.as_path();
    let elsewhere = found.as_ref().filter(|(source, _)| !has_dropped && source.parent() != place.parent());
    let moved = elsewhere.and_then(|(source, text)| moved_text(text, source, place, &reader));
    let source = match &moved {
        Some(text) => Some((place, text.as_str())),
        None => found.as_ref().map(|(source, text)| (*source, text.as_str())),
    };
    let place = if moved.is_some() { place } else { path };
    let TemplateText { text, note } = template_text(rig.borrow(), source, place, &reader);
    drop((rig, found, moved));
    save_template(disk, path, &text)?;
    Ok(note.into_iter().chain(is_unread.then(|| SOURCE_UNREAD.to_owned())).collect())
}

/// Version of its template that a document took over last.
#[derive(Debug, Clone, Copy, Default)]
pub struct DocumentBase<'b> {
    /// The rig of the version; `None` if nobody knows it.
    pub rig: Option<&'b Rig>,
    /// Part instances of the version, with the uids that they have in the document; none if nobody knows them.
    pub parts: &'b [PartInstance],
}

/// Saves a document over its template as [`store_rig_over`] does. A part instance whose uid is left out, and that has another name
/// or other joints in the file than in the base, gets the uid that it has in the document. Sockets and options of the file that
/// neither the document nor its base has stay there; a note names them.
///
/// # Errors
/// Those of [`store_rig_over`].
pub fn store_document_over(
    disk: &dyn Disk,
    path: &Path,
    rig: &Rig,
    base: DocumentBase,
    sources: &[&Path],
) -> Result<Vec<String>, StoreError> {
    let is_template = FileKind::of(path) == Some(FileKind::Template);
    let mut texts = sources.iter().filter_map(|source| template_of(disk, source, rig.uid()).ok().flatten());
    let text = if is_template { texts.next() } else { None };
    let Some((kept, note)) = text.and_then(|text| with_kept_lists(rig, base.rig, &text)) else {
        return store_over(disk, path, rig, base.parts, sources);
    };
    let mut notes = store_over(disk, path, kept, base.parts, sources)?;
    notes.push(note);
    Ok(notes)
}

/// The text of the template of a rig in a file; `None` if the file is not there, or is something else.
fn template_of(disk: &dyn Disk, path: &Path, rig: Uid) -> Result<Option<String>, ReadError> {
    let bytes = match read_capped(disk, path, template::MAX_BYTES as u64) {
        Ok(bytes) => bytes,
        Err(error @ (ReadError::NoAccess { .. } | ReadError::Io { .. })) => return Err(error),
        Err(_) => return Ok(None),
    };
    let is_same = template::read_header(&bytes).is_ok_and(|header| header.uid == rig);
    Ok(String::from_utf8(bytes).ok().filter(|_| is_same))
}

/// True if a file is the template of a rig, or cannot be read to tell.
pub fn is_template_of(disk: &dyn Disk, path: &Path, rig: Uid) -> bool {
    !matches!(template_of(disk, path, rig), Ok(None))
}

pub(super) fn save_template(disk: &dyn Disk, path: &Path, text: &str) -> Result<(), StoreError> {
    if text.len() > template::MAX_BYTES {
        return Err(StoreError::TooLarge { path: path.into(), mebibytes: text.len() >> 20 });
    }
    verify::template(path, text.as_bytes())?;
    Ok(save_atomic(disk, path, text.as_bytes())?)
}

/// Saves a rig as `.rig.ron`, as people go on to write it (tags of the short form, names where they are enough, in the layout), or
/// its skeleton as `.rig`. A rig that such a text cannot say, and one that is too large for people to read, is written in full.
/// Returns notes about content that the format could not keep, a sentence each. A rig that is handed over, not lent, is dropped
/// as soon as its text is written: reading the text back takes as much memory as the rig.
pub fn store_rig(disk: &dyn Disk, path: &Path, rig: impl Borrow<Rig>) -> Result<Vec<String>, StoreError> {
    match FileKind::of(path) {
        Some(FileKind::Template) => {
            let text = new_template_text(rig.borrow());
            drop(rig);
            save_template(disk, path, &text)?;
            Ok(Vec::new())
        }
        Some(FileKind::RigText) => {
            let written = text::write(&rig_text(rig.borrow()))
                .map_err(|source| StoreError::RigText { path: path.into(), source })?;
            verify::rig_text(path, written.text.as_bytes())?;
            save_atomic(disk, path, written.text.as_bytes())?;
            Ok(written
                .relabelled
                .iter()
                .map(|label| {
                    format!("a .rig label has no white space: \"{}\" was written as \"{}\"", label.from, label.to)
                })
                .collect())
        }
        _ => Err(StoreError::Kind { path: path.into(), wanted: "a rig is saved as .rig.ron or .rig" }),
    }
}

/// Saves clips of a rig as `.anim.ron`, after reading back what is to be written. `built` gives the labels of nodes that
/// commands created.
pub fn store_animation(
    disk: &dyn Disk,
    path: &Path,
    rig: &Rig,
    built: Option<&BuiltRig>,
    clips: &[RigClip],
) -> Result<(), StoreError> {
    Ok(stage_animation(disk, path, rig, built, clips)?.put_in_place()?)
}

/// Stages clips for saving with other files; otherwise as [`store_animation`].
pub fn stage_animation<'d>(
    disk: &'d dyn Disk,
    path: &Path,
    rig: &Rig,
    built: Option<&BuiltRig>,
    clips: &[RigClip],
) -> Result<StagedFile<'d>, StoreError> {
    if FileKind::of(path) != Some(FileKind::Animation) {
        return Err(StoreError::Kind { path: path.into(), wanted: "clips are saved as .anim.ron" });
    }
    let text = write_animation(rig, built, clips);
    if text.len() > animation::MAX_BYTES {
        return Err(StoreError::AnimationTooLarge { path: path.into(), mebibytes: text.len() >> 20 });
    }
    verify::animation(path, text.as_bytes(), clips)?;
    Ok(stage_file(disk, path, text.as_bytes())?)
}

/// Saves packed clips with their skeleton as `.rigclip`, after reading back what is to be written.
pub fn store_packed_clips(disk: &dyn Disk, path: &Path, packed: &PackedSkeleton) -> Result<(), StoreError> {
    if FileKind::of(path) != Some(FileKind::PackedClips) {
        return Err(StoreError::Kind { path: path.into(), wanted: "packed clips are saved as .rigclip" });
    }
    let bytes = packed.to_bytes();
    verify::packed_clips(path, &bytes, packed)?;
    Ok(save_atomic(disk, path, &bytes)?)
}

/// Saves weights as `.skin`.
pub fn store_skin(disk: &dyn Disk, path: &Path, skin: &SkinFile) -> Result<(), StoreError> {
    Ok(stage_skin(disk, path, skin)?.put_in_place()?)
}

/// Stages weights for saving with other files; otherwise as [`store_skin`].
pub fn stage_skin<'d>(disk: &'d dyn Disk, path: &Path, skin: &SkinFile) -> Result<StagedFile<'d>, StoreError> {
    if FileKind::of(path) != Some(FileKind::Skin) {
        return Err(StoreError::Kind { path: path.into(), wanted: "weights are saved as .skin" });
    }
    let bytes = skin.write();
    verify::skin(path, &bytes)?;
    Ok(stage_file(disk, path, &bytes)?)
}
