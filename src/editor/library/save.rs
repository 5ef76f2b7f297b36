//! The open rig as a template, with its header and a picture; or some of its joints as a part.

use std::path::{Path, PathBuf};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use super::{
    listing::{ListTemplates, own_folder},
    preview::{Preview, PreviewError},
};
use crate::{
    editor::{
        ActiveRig,
        counts::counted,
        files::{ExportRequest, OpenDocument, loading::settled},
        notice::Notice,
    },
    files::{Disk, FileKind, RealDisk, SaveError, StopSign, StoppableDisk, StoreError, save_atomic, stem, store_rig},
    instance::RigSource,
    plugins::{
        document::{Change, EditRequest},
        history::RigHistory,
    },
    rig::{
        EditError, Rig, RigAbout, RigEdit, Uid,
        extract::{Extraction, extract},
        operations::Operation,
        step::Step,
    },
};

/// Name of the step that changes the header.
pub(in crate::editor) const HEADER: &str = "Change header";

/// Request to write a template.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct SaveTemplate {
    /// The file; `.rig.ron` is added where it has another ending.
    pub path: PathBuf,
    /// True to replace a file that is there.
    pub replace: bool,
    /// Content of the template.
    pub content: TemplateContent,
}

/// Content of a template that is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TemplateContent {
    /// The open rig.
    Rig {
        /// True to take a picture in the viewport, which lies beside the template.
        picture: bool,
    },
    /// Joints of the open rig, as a part.
    Joints(Vec<Uid>),
}

/// Choices of the form in which a template is written.
#[derive(Resource, Debug, Clone, PartialEq, Eq)]
pub struct TemplateDraft {
    /// True while the form is open.
    pub is_open: bool,
    /// The typed path; a suggestion while it is empty.
    pub path: String,
    /// True to take a picture in the viewport.
    pub picture: bool,
    /// True to replace a file that is there.
    pub replace: bool,
}

impl Default for TemplateDraft {
    fn default() -> Self {
        Self { is_open: false, path: String::new(), picture: true, replace: false }
    }
}

impl TemplateDraft {
    /// The typed path, or a suggestion: the template that was opened, else one of the rig's name in the document's folder.
    pub fn file(&self, world: &World) -> PathBuf {
        if !self.path.trim().is_empty() {
            return PathBuf::from(self.path.trim());
        }
        let document = world.get_resource::<ActiveRig>().and_then(|rig| world.get::<OpenDocument>(rig.0));
        if let Some(template) = own_template(world) {
            return template.to_owned();
        }
        let name =
            world.get_resource::<ActiveRig>().and_then(|rig| world.get::<Rig>(rig.0)).map(|rig| &rig.about().name);
        let name = name.filter(|name| !name.is_empty()).map_or("rig", String::as_str).replace(['/', '\\'], "_");
        document.and_then(own_folder).unwrap_or_default().join(format!("{name}.rig.ron"))
    }
}

/// Reason why a template is not written.
#[derive(Debug, thiserror::Error)]
enum SaveFailure {
    #[error(transparent)]
    Picture(#[from] PreviewError),
    #[error(transparent)]
    Save(#[from] SaveError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Edit(#[from] EditError),
}

/// Template that is being written.
#[derive(Resource, Default)]
pub struct TemplateSave {
    job: Option<Job>,
}

impl TemplateSave {
    /// True while a template or its picture is being written.
    pub fn is_writing(&self) -> bool {
        self.job.is_some()
    }

    /// Name of the file that is being written, with its picture.
    pub(in crate::editor) fn name(&self) -> Option<&str> {
        self.job.as_ref().map(|job| job.name.as_str())
    }

    /// Has the writing stopped; the template stays as it was, unless it is replaced already.
    pub(in crate::editor) fn stop(&self) {
        if let Some(job) = &self.job {
            job.sign.stop();
        }
    }
}

struct Job {
    name: String,
    /// The rig whose header got the name of the picture for it.
    named: Option<(Entity, String)>,
    task: Task<Result<SaveProgress, SaveFailure>>,
    /// Wish to stop.
    sign: StopSign,
}

/// Finished part of the work.
enum SaveProgress {
    /// The picture is there, and the rig can be exported.
    Picture(PathBuf),
    /// Joints were extracted: their number, and notes.
    Joints(usize, Vec<String>),
}

/// Starts to write.
pub(super) fn start(mut requests: MessageReader<SaveTemplate>, mut commands: Commands) {
    for request in requests.read() {
        let request = request.clone();
        commands.queue(move |world: &mut World| begin(world, request));
    }
}

fn begin(world: &mut World, SaveTemplate { path, replace, content }: SaveTemplate) {
    let path = completed(&path);
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let is_own = matches!(content, TemplateContent::Rig { .. }) && own_template(world) == Some(path.as_path());
    let may_replace = replace || is_own;
    if let Some(refused) = refusal(world, &path, &name, may_replace) {
        world.write_message(Notice::error(refused));
        return;
    }
    let Some(entity) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    let Some(rig) = settled(world, entity) else { return };
    let mut named = None;
    let sign = StopSign::default();
    let heeded = sign.clone();
    let task = match content {
        TemplateContent::Joints(joints) => AsyncComputeTaskPool::get()
            .spawn(async move { write_joints(&StoppableDisk::new(&RealDisk, heeded), &path, &rig, &joints) }),
        TemplateContent::Rig { picture: false } => {
            world.write_message(ExportRequest(path));
            return;
        }
        TemplateContent::Rig { picture: true } => {
            let file = format!("{}.png", stem(&path));
            let is_named = rig.about().preview.as_ref() == Some(&file);
            // Textures of a character are often called as it is.
            if !(replace || is_own && is_named) && path.with_file_name(&file).exists() {
                let text = format!("There is a picture {file} already: tick Replace, or leave the picture out");
                world.write_message(Notice::error(text));
                return;
            }
            let Some(preview) = Preview::of(world, entity) else { return };
            if !is_named {
                let about = RigAbout { preview: Some(file.clone()), ..rig.about().clone() };
                world.write_message(header_step(entity, HEADER, about));
                named = Some((entity, file.clone()));
            }
            AsyncComputeTaskPool::get().spawn(async move {
                let disk = StoppableDisk::new(&RealDisk, heeded);
                save_atomic(&disk, &path.with_file_name(file), &preview.png()?)?;
                Ok(SaveProgress::Picture(path))
            })
        }
    };
    world.resource_mut::<TemplateSave>().job = Some(Job { name, named, task, sign });
}

/// File of the template that is open. One that was only loaded onto the rig is another's.
fn own_template(world: &World) -> Option<&Path> {
    let entity = world.get_resource::<ActiveRig>()?.0;
    let (rig, source) = (world.get::<Rig>(entity)?, world.get::<RigSource>(entity)?);
    let is_own = source.base().is_some_and(|base| base.uid() == rig.uid());
    world.get::<OpenDocument>(entity)?.template.as_deref().filter(|_| is_own)
}

/// Request for another header, as one step of that name.
pub(in crate::editor) fn header_step(rig: Entity, name: &'static str, about: RigAbout) -> EditRequest {
    let edits = vec![RigEdit::SetAbout(Box::new(about))];
    EditRequest::operation(rig, Operation::Named { name, edits })
}

/// The path, absolute and with the ending of a template.
fn completed(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    if FileKind::of(&path) == Some(FileKind::Template) {
        return path;
    }
    let mut named = path.into_os_string();
    named.push(".rig.ron");
    named.into()
}

/// The reason why nothing can be written there.
fn refusal(world: &World, path: &Path, name: &str, may_replace: bool) -> Option<String> {
    let Some(active) = world.get_resource::<ActiveRig>() else {
        return Some("No rig is open: open one first".to_owned());
    };
    if world.get::<Rig>(active.0).is_none_or(Rig::is_empty) {
        return Some("There are no joints to write: place or draw some first".to_owned());
    }
    if world.resource::<TemplateSave>().job.is_some() {
        return Some(format!("{name} has to wait: another template is being written. Write it then"));
    }
    if let Some(folder) = path.parent().filter(|folder| !folder.is_dir()) {
        return Some(format!("There is no folder {}; create it first, or choose another place", folder.display()));
    }
    (path.exists() && !may_replace)
        .then(|| format!("There is a file {name} already: tick Replace, or choose another name"))
}

fn write_joints(disk: &dyn Disk, path: &Path, rig: &Rig, joints: &[Uid]) -> Result<SaveProgress, SaveFailure> {
    let Extraction { rig: out, left } = extract(rig, joints, &stem(path), None)?;
    let mut notes = store_rig(disk, path, &out)?;
    notes.extend(left);
    Ok(SaveProgress::Joints(out.len(), notes))
}

/// Goes on with what is being written.
pub(super) fn go_on(mut save: ResMut<TemplateSave>, histories: Query<&RigHistory>, mut commands: Commands) {
    let save = save.bypass_change_detection();
    let Some(job) = &mut save.job else { return };
    commands.write_message(RequestRedraw);
    let Some(result) = check_ready(&mut job.task) else { return };
    let Some(Job { name, named, sign, .. }) = save.job.take() else { return };
    let failure = match result {
        Ok(SaveProgress::Picture(path)) if !sign.is_given() => {
            commands.write_message(ExportRequest(path));
            return;
        }
        Ok(SaveProgress::Joints(count, notes)) => {
            let joints = counted(count, "joint", "joints");
            commands.write_message(Notice::done(format!("Wrote {name}: {joints}")));
            for note in notes {
                commands.write_message(Notice::warning(note));
            }
            commands.write_message(ListTemplates);
            return;
        }
        // The picture alone is no template.
        Ok(SaveProgress::Picture(_)) => None,
        Err(_) if sign.has_refused() => None,
        Err(error) => Some(error),
    };
    commands.write_message(match failure {
        Some(error) => Notice::error(format!("Could not write {name}: {error}")),
        None => Notice::info(format!("{name} is not written: it was stopped")).named(),
    });
    // The header names no picture that is not there.
    if let Some((rig, file)) = named
        && histories.get(rig).ok().and_then(RigHistory::last).is_some_and(|step| names_picture(step, &file))
    {
        commands.write_message(EditRequest { rig, change: Change::Undo });
    }
}

/// True if a step gives a header the name of a picture, which a later change of the header has before and after it.
fn names_picture(step: &Step, file: &str) -> bool {
    match (&step.forward[..], &step.backward[..]) {
        ([RigEdit::SetAbout(after)], [RigEdit::SetAbout(before)]) => {
            after.preview.as_deref() == Some(file) && before.preview.as_deref() != Some(file)
        }
        _ => false,
    }
}
