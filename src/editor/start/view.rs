//! View of the start page.

use std::{collections::BTreeMap, path::Path};

use bevy::prelude::*;
use bevy_egui::egui::{
    self, Color32, CornerRadius, FontId, Label, Rect, Response, RichText, ScrollArea, Sense, Stroke, StrokeKind,
    TextureHandle, TextureOptions, Ui, WidgetInfo, WidgetType, vec2,
};

use super::{Job, RecentFile, RecentFiles, StartJob, StartPage, StartPictures, page_id};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        files::{BUNDLED_MODELS, OpenRequest},
        keys::KeyBindings,
        panel::{EditorOverlay, Requests},
        settings::EditorSettings,
        style,
    },
    files::BUNDLED_CHARACTERS,
};

/// The overlay; it keeps the textures of the pictures.
#[derive(Default)]
pub(super) struct StartView {
    textures: BTreeMap<&'static str, TextureHandle>,
}

/// Side of a picture, in points.
const TILE: f32 = 84.0;
/// Widths below which the page has one column.
const NARROW: f32 = 560.0;

impl EditorOverlay for StartView {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        let Some(page) = world.get_resource::<StartPage>().filter(|page| page.is_shown()) else { return };
        let room = ctx.content_rect().size();
        let size = vec2((room.x - 40.0).clamp(240.0, 940.0), (room.y - 150.0).clamp(160.0, 520.0));
        let mut is_open = true;
        egui::Window::new("Start")
            .id(page_id())
            .open(&mut is_open)
            .collapsible(false)
            .resizable(false)
            .anchor(egui::Align2::CENTER_CENTER, vec2(0.0, 8.0))
            .show(ctx, |ui| {
                ui.set_width(size.x);
                ui.set_height(size.y);
                head(ui, world, requests);
                ui.separator();
                if size.x < NARROW {
                    ScrollArea::vertical().id_salt("start").auto_shrink(false).show(ui, |ui| {
                        jobs(ui, requests);
                        self.pictures(ui, world, requests);
                        recent(ui, world, requests);
                    });
                    return;
                }
                ui.columns_const(|[left, right]| {
                    ScrollArea::vertical().id_salt("recent").auto_shrink(false).show(left, |ui| {
                        recent(ui, world, requests);
                    });
                    ScrollArea::vertical().id_salt("jobs").auto_shrink(false).show(right, |ui| {
                        jobs(ui, requests);
                        self.pictures(ui, world, requests);
                    });
                });
            });
        if !is_open {
            requests.set(page.closed());
        }
    }
}

/// Draws what can be opened besides: a file, or nothing.
fn head(ui: &mut Ui, world: &World, requests: &mut Requests) {
    let keys = world.get_resource::<KeyBindings>();
    ui.horizontal_wrapped(|ui| {
        for (name, action) in [("Open…", Action::Open), ("Empty project", Action::New), ("Help", Action::Help)] {
            let button = egui::Button::new(name);
            let button = match keys.and_then(|keys| keys.key(action)) {
                Some(key) => button.shortcut_text(key.to_string()),
                None => button,
            };
            if ui.add(button).clicked() {
                requests.send(ActionRequest(action));
            }
        }
        ui.weak("or drop a mesh, a template or a project on the window. Esc closes this page.");
    });
}

/// Draws the recent files; those that cannot be opened are grey, with the reason.
fn recent(ui: &mut Ui, world: &World, requests: &mut Requests) {
    ui.strong("Recent files");
    let Some(settings) = world.get_resource::<EditorSettings>() else { return };
    if settings.recent.is_empty() {
        ui.weak("Files that you open or save are listed here.");
        return;
    }
    let looked = world.get_resource::<RecentFiles>().map(RecentFiles::list).unwrap_or_default();
    for path in &settings.recent {
        let known = looked.iter().find(|file| file.path == *path);
        let name = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into());
        ui.push_id(path, |ui| {
            ui.horizontal(|ui| {
                let room = (ui.available_width() - 26.0).max(60.0);
                if file_row(ui, path, &name, known, room).clicked() {
                    requests.send(OpenRequest::File(path.clone()));
                }
                let cross = ui.add(egui::Button::new(RichText::new("✖").small()).frame(false));
                let said = format!("Remove {name} from the list");
                cross.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said));
                if cross.on_hover_text(&said).clicked() {
                    let mut next = settings.clone();
                    next.forget(path);
                    requests.set(next);
                }
            });
        });
    }
}

/// Draws a recent file: its name above its folder, or the reason why it cannot be opened.
fn file_row(ui: &mut Ui, path: &Path, name: &str, known: Option<&RecentFile>, width: f32) -> Response {
    let problem = known.and_then(|file| file.problem);
    let folder = path.parent().map(|folder| folder.display().to_string()).unwrap_or_default();
    let below = problem.map_or(folder, |problem| problem.to_string());
    let is_there = problem.is_none();
    let sense = if is_there { Sense::click() } else { Sense::hover() };
    let (rect, response) = ui.allocate_exact_size(vec2(width, 34.0), sense);
    let said = if is_there { format!("Open {name}") } else { format!("{name}: {below}") };
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, is_there, &said));
    if is_there && (response.hovered() || response.has_focus()) {
        ui.painter().rect_filled(rect, 3.0, ui.visuals().widgets.hovered.bg_fill.gamma_multiply(0.35));
    }
    let quiet = style::quiet(ui.visuals());
    let color = if is_there { ui.visuals().strong_text_color() } else { quiet };
    let lines = [(name, FontId::proportional(13.0), color), (&*below, FontId::proportional(11.0), quiet)];
    let mut at = rect.min + vec2(4.0, 2.0);
    for (text, font, color) in lines {
        let mut job = egui::text::LayoutJob::simple_singleline(text.to_owned(), font, color);
        job.wrap = egui::text::TextWrapping::truncate_at_width((width - 8.0).max(1.0));
        let galley = ui.painter().layout_job(job);
        let height = galley.size().y;
        ui.painter().galley(at, galley, color);
        at.y += height;
    }
    response.on_hover_text(path.display().to_string())
}

/// Draws the jobs and the tour.
fn jobs(ui: &mut Ui, requests: &mut Requests) {
    ui.strong("What do you want to do?");
    for job in Job::ALL.into_iter().chain([Job::Tour]) {
        let text = RichText::new(job.title()).strong().color(style::accent(ui.visuals()));
        let width = ui.available_width();
        ui.horizontal(|ui| {
            let button = egui::Button::new(text).min_size(vec2(126.0, 30.0));
            if ui.add(button).on_hover_text(job.about()).clicked() {
                requests.send(StartJob(job));
            }
            ui.allocate_ui(vec2((width - 140.0).max(80.0), 30.0), |ui| ui.add(Label::new(job.about()).wrap()));
        });
    }
    ui.add_space(6.0);
}

impl StartView {
    /// Draws the bundled meshes and templates.
    fn pictures(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(pictures) = world.get_resource::<StartPictures>() else { return };
        ui.strong("Meshes");
        ui.horizontal_wrapped(|ui| {
            for model in &BUNDLED_MODELS {
                let texture = self.texture(ui.ctx(), model.name, pictures).map(TextureHandle::id);
                let paint = |ui: &Ui, square: Rect| {
                    let Some(texture) = texture else { return };
                    let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
                    ui.painter().image(texture, square, whole, Color32::WHITE);
                };
                if tile(ui, "Mesh", model.name, paint).clicked() {
                    requests.send(OpenRequest::Model(model.name.to_owned()));
                }
            }
        });
        ui.strong("Templates");
        ui.horizontal_wrapped(|ui| {
            for (name, _) in BUNDLED_CHARACTERS {
                let paint = |ui: &Ui, square: Rect| {
                    let Some(picture) = pictures.template(name) else { return };
                    let visuals = ui.visuals();
                    picture.paint(ui.painter(), square, style::quiet(visuals), visuals.strong_text_color());
                };
                if tile(ui, "Template", name, paint).clicked() {
                    requests.send(OpenRequest::Template((*name).to_owned()));
                }
            }
        });
    }

    /// Texture of a mesh's picture, once that is drawn.
    fn texture(&mut self, ctx: &egui::Context, name: &'static str, pictures: &StartPictures) -> Option<&TextureHandle> {
        if !self.textures.contains_key(name) {
            let image = pictures.model(name)?;
            let texture = ctx.load_texture(format!("start {name}"), (**image).clone(), TextureOptions::LINEAR);
            self.textures.insert(name, texture);
        }
        self.textures.get(name)
    }
}

/// Draws a picture with its name below.
fn tile(ui: &mut Ui, kind: &str, name: &str, paint: impl FnOnce(&Ui, Rect)) -> Response {
    let (rect, response) = ui.allocate_exact_size(vec2(TILE, TILE + 18.0), Sense::click());
    let said = format!("{kind} {name}");
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said));
    let square = Rect::from_min_size(rect.min, vec2(TILE, TILE));
    let is_lit = response.hovered() || response.has_focus();
    let visuals = ui.visuals();
    let line = if is_lit { style::accent(visuals) } else { visuals.widgets.noninteractive.bg_stroke.color };
    ui.painter().rect(
        square,
        CornerRadius::same(4),
        visuals.extreme_bg_color,
        Stroke::new(1.0, line),
        StrokeKind::Inside,
    );
    paint(ui, square.shrink(3.0));
    let below = egui::pos2(square.center().x, square.bottom() + 9.0);
    let color = ui.visuals().text_color();
    ui.painter().text(below, egui::Align2::CENTER_CENTER, name, FontId::proportional(12.0), color);
    response.on_hover_text(format!("Open the {} {name}", kind.to_lowercase()))
}
