//! Pictures of templates: the one that the template names, else its skeleton; drawn in the background when they are seen.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::Cursor,
    path::Path,
    sync::Arc,
};

use bevy::{
    prelude::*,
    tasks::{IoTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};
use bevy_egui::egui::ColorImage;

use super::listing::LibraryFolders;
use crate::{
    editor::start::BonePicture,
    files::{FileState, ListedTemplate, RealDisk, TemplatePlace, read_capped, read_listed},
};

/// Pixels along the longer side of a picture.
const PIXELS: u32 = 160;
/// Largest size in bytes of a picture's file that is read.
const MOST_BYTES: u64 = 16 << 20;
/// Largest width and height of a picture that is read, in pixels.
const MOST_PIXELS: u32 = 4096;

/// Request for the pictures of templates that are seen.
#[derive(Message, Debug, Clone)]
pub struct PictureRequest(pub Vec<Arc<ListedTemplate>>);

/// Picture of a template.
#[derive(Debug, Clone)]
pub enum TemplatePicture {
    /// Joints and bones.
    Bones(BonePicture),
    /// Picture that the template names.
    Image(Arc<ColorImage>),
    /// No picture: the template cannot be read.
    Nothing,
}

type PictureList = Vec<(TemplatePlace, Option<FileState>, TemplatePicture)>;

/// The pictures.
#[derive(Resource, Default)]
pub struct LibraryPictures {
    known: BTreeMap<TemplatePlace, (Option<FileState>, TemplatePicture)>,
    task: Option<Task<PictureList>>,
    waiting: BTreeMap<TemplatePlace, Arc<ListedTemplate>>,
    drawn: BTreeSet<TemplatePlace>,
}

impl LibraryPictures {
    /// Picture of a template, once it is drawn.
    pub fn get(&self, listed: &ListedTemplate) -> Option<&TemplatePicture> {
        let (state, picture) = self.known.get(&listed.place)?;
        (*state == listed.state).then_some(picture)
    }

    /// True if the picture is being drawn.
    pub fn is_wanted(&self, listed: &ListedTemplate) -> bool {
        self.waiting.contains_key(&listed.place) || self.drawn.contains(&listed.place)
    }
}

/// Draws the pictures that are asked for.
pub(super) fn draw(
    mut requests: MessageReader<PictureRequest>,
    mut pictures: ResMut<LibraryPictures>,
    folders: Res<LibraryFolders>,
    mut commands: Commands,
) {
    let pictures = pictures.bypass_change_detection();
    for listed in requests.read().flat_map(|request| &request.0) {
        if pictures.get(listed).is_none() {
            pictures.waiting.insert(listed.place.clone(), listed.clone());
        }
    }
    if pictures.task.is_none() && !pictures.waiting.is_empty() {
        let wanted: Vec<Arc<ListedTemplate>> = std::mem::take(&mut pictures.waiting).into_values().collect();
        pictures.drawn = wanted.iter().map(|listed| listed.place.clone()).collect();
        let folders = folders.clone();
        pictures.task = Some(IoTaskPool::get().spawn(async move {
            let one = |listed: Arc<ListedTemplate>| (listed.place.clone(), listed.state, picture(&listed, &folders));
            wanted.into_iter().map(one).collect()
        }));
    }
    let Some(task) = &mut pictures.task else { return };
    if let Some(drawn) = check_ready(task) {
        pictures.task = None;
        pictures.drawn.clear();
        pictures.known.extend(drawn.into_iter().map(|(place, state, picture)| (place, (state, picture))));
    }
    commands.write_message(RequestRedraw);
}

fn picture(listed: &ListedTemplate, folders: &LibraryFolders) -> TemplatePicture {
    let named = listed.header.as_ref().ok().and_then(|header| header.preview.as_deref());
    if let Some(image) = named.and_then(|name| image(listed.place.path()?, name)) {
        return TemplatePicture::Image(Arc::new(image));
    }
    let site = folders.read().unwrap_or_default();
    match read_listed(&RealDisk, &listed.place, &site) {
        Ok(template) => TemplatePicture::Bones(BonePicture::of(&template.rig)),
        Err(_) => TemplatePicture::Nothing,
    }
}

/// The picture of that name beside a template. Only the name of the file counts: a template leads to no other folder.
fn image(template: &Path, name: &str) -> Option<ColorImage> {
    let path = template.with_file_name(Path::new(name).file_name()?);
    let bytes = read_capped(&RealDisk, &path, MOST_BYTES).ok()?;
    let mut reader = image::ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok()?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MOST_PIXELS);
    limits.max_image_height = Some(MOST_PIXELS);
    reader.limits(limits);
    let small = reader.decode().ok()?.thumbnail(PIXELS, PIXELS).to_rgba8();
    let size = [small.width() as usize, small.height() as usize];
    Some(ColorImage::from_rgba_unmultiplied(size, small.as_raw()))
}
