//! Dialogs of the questions about files. Keys work in all of them: Enter takes the marked answer, Escape cancels.

use std::{
    path::{Path, PathBuf},
    time::SystemTime,
};

use bevy::prelude::*;
use bevy_egui::egui;
use egui_file_dialog::{DialogState, FileDialog, Filter};

use super::{
    dialog::{Answer, Dialog, DialogAnswer, Purpose, Question},
    export::{ExportOptions, PRESETS, effect, takes_preset},
    file_name,
    template::{Fit, number},
};
use crate::{
    editor::{
        counts::counted,
        panel::{EditorOverlay, Requests},
        panels::timeline::{import::MOTION_FILES, map_file::MAP_FILES},
        recovery, style,
    },
    files::{
        FileKind,
        journal::{Condition, PendingJournal},
    },
    rig::skeleton_preset::SkeletonPreset,
};

/// View of the current question.
#[derive(Default)]
pub(super) struct DialogView {
    /// Number of the question that the state belongs to.
    number: u64,
    text: String,
    /// Frames since the question was asked; widgets get the keyboard focus in the first ones.
    age: u32,
    chosen: usize,
    browser: Option<FileDialog>,
    /// Choices of an export.
    options: ExportOptions,
}

/// Kinds of files that can be opened, by name.
const OPENED: &[(&str, &[FileKind])] = &[
    (
        "Meshes, templates, projects",
        &[
            FileKind::Obj,
            FileKind::Gltf,
            FileKind::Glb,
            FileKind::Vrm,
            FileKind::Template,
            FileKind::RigText,
            FileKind::Project,
        ],
    ),
    ("Meshes (.obj, .gltf, .glb, .vrm)", &[FileKind::Obj, FileKind::Gltf, FileKind::Glb, FileKind::Vrm]),
    ("Templates (.rig.ron, .rig)", &[FileKind::Template, FileKind::RigText]),
    ("Projects (.rigsmith.ron)", &[FileKind::Project]),
];

/// Kinds of files with meshes, by name.
const MESHES: &[(&str, &[FileKind])] =
    &[("Meshes (.obj, .gltf, .glb, .vrm)", &[FileKind::Obj, FileKind::Gltf, FileKind::Glb, FileKind::Vrm])];

/// Kinds of files with motion, by name.
const MOTION: &[(&str, &[FileKind])] = &[
    ("Motion (.bvh, .anim.ron, .rigclip, .glb, .gltf, .vrm)", MOTION_FILES),
    ("Motion capture (.bvh)", &[FileKind::Bvh]),
    ("Clips (.anim.ron, .rigclip)", &[FileKind::Animation, FileKind::PackedClips]),
];

/// Kinds of files with maps of joints, by name.
const MAPS: &[(&str, &[FileKind])] = &[("Maps of joints (.ron)", MAP_FILES)];

impl EditorOverlay for DialogView {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        let Some(dialog) = world.get_resource::<Dialog>() else { return };
        let Some(question) = dialog.question() else {
            self.browser = None;
            return;
        };
        if self.number != dialog.number() {
            *self = Self { number: dialog.number(), ..Self::default() };
            match question {
                Question::Path { suggestion, .. } => {
                    self.text = suggestion.display().to_string();
                    self.options = world.get_resource::<ExportOptions>().cloned().unwrap_or_default();
                }
                Question::Open => self.browser = Some(browser(world, "Open", OPENED)),
                Question::Mesh => self.browser = Some(browser(world, "Add mesh", MESHES)),
                Question::Motion => self.browser = Some(browser(world, "Import motion", MOTION)),
                Question::JointMap => self.browser = Some(browser(world, "Load map of joints", MAPS)),
                _ => {}
            }
        }
        self.age = self.age.saturating_add(1);
        if let Some(answer) = self.ask(ctx, question) {
            self.browser = None;
            let is_export = matches!(question, Question::Path { purpose: Purpose::Export, .. });
            if is_export && matches!(answer, Answer::Path(_)) {
                requests.set(self.options.clone());
            }
            requests.send(DialogAnswer(answer));
        }
    }
}

/// Initial folder of file choices: that of the last opened file.
fn folder(world: &World) -> Option<PathBuf> {
    let settings = world.get_resource::<crate::editor::settings::EditorSettings>()?;
    settings.recent.first()?.parent().filter(|folder| folder.is_dir()).map(Path::to_path_buf)
}

fn file_dialog(folder: Option<PathBuf>) -> FileDialog {
    let dialog = FileDialog::new().default_size([680.0, 420.0]).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]);
    match folder {
        Some(folder) => dialog.initial_directory(folder),
        None => dialog,
    }
}

fn browser(world: &World, title: &str, files: &'static [(&'static str, &'static [FileKind])]) -> FileDialog {
    let mut dialog = file_dialog(folder(world)).title(title);
    for (name, kinds) in files {
        let matches = move |path: &Path| FileKind::of(path).is_some_and(|kind| kinds.contains(&kind));
        dialog = dialog.add_file_filter(name, Filter::new(matches));
    }
    if let Some((name, _)) = files.first() {
        dialog = dialog.default_file_filter(name);
    }
    dialog.pick_file();
    dialog
}

impl DialogView {
    fn ask(&mut self, ctx: &egui::Context, question: &Question) -> Option<Answer> {
        if let Some(browser) = &mut self.browser {
            browser.update(ctx);
            let picked = browser.take_picked();
            let is_open = *browser.state() == DialogState::Open;
            return match (question, picked) {
                (Question::Open | Question::Mesh | Question::Motion | Question::JointMap, picked) => {
                    picked.map(Answer::Path).or((!is_open).then_some(Answer::Cancel))
                }
                (_, picked) => {
                    if let Some(path) = picked {
                        self.text = path.display().to_string();
                    }
                    if !is_open {
                        self.browser = None;
                        self.age = 0;
                    }
                    None
                }
            };
        }
        let shown = egui::Modal::new(egui::Id::new(("question", self.number))).frame(frame(ctx)).show(ctx, |ui| {
            ui.set_width(460.0_f32.min(ctx.viewport_rect().width() - 60.0));
            ui.spacing_mut().item_spacing = egui::vec2(8.0, 8.0);
            match question {
                Question::Unsaved { name, .. } => self.unsaved(ui, name),
                Question::Path { purpose, .. } => self.path(ui, *purpose),
                Question::Replace { path, .. } => self.replace(ui, path),
                Question::Fit(fit) => self.fit(ui, fit),
                Question::Recover(list) => self.recover(ui, list),
                Question::Open | Question::Mesh | Question::Motion | Question::JointMap => None,
            }
        });
        let escaped = ctx.input(|input| input.key_pressed(egui::Key::Escape));
        shown.inner.or(escaped.then_some(Answer::Cancel))
    }

    /// Draws buttons aligned to the right; the first one is outermost and takes Enter.
    fn buttons(&self, ui: &mut egui::Ui, answers: &[(&str, Answer)]) -> Option<Answer> {
        let mut taken = None;
        ui.add_space(4.0);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            for (place, (name, answer)) in answers.iter().enumerate() {
                let mut text = egui::RichText::new(*name);
                if place == 0 {
                    text = text.strong();
                }
                let button = ui.add(egui::Button::new(text).min_size(egui::vec2(76.0, 24.0)));
                if place == 0 && self.age <= 2 {
                    button.request_focus();
                }
                if button.clicked() {
                    taken = Some(answer.clone());
                }
            }
        });
        taken
    }

    fn unsaved(&self, ui: &mut egui::Ui, name: &str) -> Option<Answer> {
        ui.heading(format!("Save the changes to {name}?"));
        ui.label("They are in no file yet, and would be lost.");
        let answers = [("Save", Answer::Save), ("Cancel", Answer::Cancel), ("Don't save", Answer::Discard)];
        self.buttons(ui, &answers)
    }

    fn replace(&self, ui: &mut egui::Ui, path: &Path) -> Option<Answer> {
        ui.heading(format!("Replace {}?", file_name(path)));
        ui.label(format!("There is a file of that name in {}.", path.parent().unwrap_or(path).display()));
        self.buttons(ui, &[("Replace", Answer::Save), ("Cancel", Answer::Cancel)])
    }

    fn path(&mut self, ui: &mut egui::Ui, purpose: Purpose) -> Option<Answer> {
        let (title, verb, hint) = match purpose {
            Purpose::Save => {
                ("Save the project as", "Save", "A project ends in .rigsmith.ron; its weights lie beside it.")
            }
            Purpose::Export => (
                "Export",
                "Export",
                "The ending says what: .glb or .gltf the character with its clips, .vrm an avatar, .obj at rest, \
                 .anim.ron the clips, .rigclip the motion of the joints in few bytes, .rig.ron the template, .rig the skeleton, .skin the weights. What is written is \
                 read back.",
            ),
            Purpose::JointMap => (
                "Save the map of joints",
                "Save",
                "A list of pairs: a joint of the motion and one of the rig, or \"\" for none. Load map… and --map take it.",
            ),
        };
        ui.heading(title);
        let mut browse = false;
        let field = ui
            .horizontal(|ui| {
                let width = ui.available_width() - 90.0;
                let field = ui.add(egui::TextEdit::singleline(&mut self.text).desired_width(width));
                field.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, "Path"));
                browse = ui.button("Browse…").clicked();
                field
            })
            .inner;
        if self.age <= 2 {
            field.request_focus();
            select_stem(ui.ctx(), field.id, &self.text);
        }
        ui.label(egui::RichText::new(hint).color(style::quiet(ui.visuals())));
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        if purpose == Purpose::Export {
            self.export_options(ui);
        }
        let path = PathBuf::from(self.text.trim());
        if browse {
            let folder = path.parent().filter(|folder| folder.is_dir()).map(Path::to_path_buf);
            let mut dialog = file_dialog(folder).title(title).default_file_name(&file_name(&path));
            dialog.save_file();
            self.browser = Some(dialog);
            return None;
        }
        let accept = Answer::Path(path);
        let has_name = !self.text.trim().is_empty();
        let answers = [(verb, accept.clone()), ("Cancel", Answer::Cancel)];
        // The text field has the keyboard focus here, not the first button.
        let view = Self { age: u32::MAX, ..Self::default() };
        let clicked = view.buttons(ui, &answers);
        match clicked.or(entered.then_some(accept)) {
            Some(Answer::Path(_)) if !has_name => None,
            answer => answer,
        }
    }

    /// Draws the preset of the skeleton, and the author of an avatar.
    fn export_options(&mut self, ui: &mut egui::Ui) {
        let path = PathBuf::from(self.text.trim());
        if !takes_preset(&path) {
            return;
        }
        let before = self.options.preset;
        let name = PRESETS.iter().find(|(preset, _)| *preset == before).map_or("", |(_, name)| name);
        ui.horizontal(|ui| {
            ui.label("Names and axes");
            let combo = egui::ComboBox::from_id_salt("preset").selected_text(name).show_ui(ui, |ui| {
                for (preset, name) in PRESETS {
                    ui.selectable_value(&mut self.options.preset, preset, name);
                }
            });
            ui.ctx().accesskit_node_builder(combo.response.id, |node| node.set_label("Preset of the skeleton"));
        });
        if self.options.preset != before {
            // An avatar has an ending of its own.
            let ending = if self.options.preset == SkeletonPreset::Vrm { "vrm" } else { "glb" };
            let is_avatar = FileKind::of(&path) == Some(FileKind::Vrm);
            if is_avatar || ending == "vrm" {
                self.text = path.with_extension(ending).display().to_string();
            }
        }
        ui.label(egui::RichText::new(effect(self.options.preset)).color(style::quiet(ui.visuals())));
        if FileKind::of(Path::new(self.text.trim())) == Some(FileKind::Vrm) {
            ui.horizontal(|ui| {
                ui.label("Author");
                let field =
                    egui::TextEdit::singleline(&mut self.options.author).hint_text("as in the template's header");
                let field = ui.add(field.desired_width(ui.available_width()));
                field.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, "Author of the avatar")
                });
            });
        }
    }

    fn fit(&self, ui: &mut egui::Ui, fit: &Fit) -> Option<Answer> {
        ui.heading(format!("{} is for a mesh of another size", fit.name));
        ui.label(format!(
            "Its joints are {} tall, this mesh is {}. To fit, they are scaled by {:.3}.",
            number(fit.rig_height),
            number(fit.mesh_height),
            fit.ratio()
        ));
        let answers = [("Fit to this mesh", Answer::Fit), ("As it is", Answer::AsItIs), ("Cancel", Answer::Cancel)];
        self.buttons(ui, &answers)
    }

    fn recover(&mut self, ui: &mut egui::Ui, list: &[PendingJournal]) -> Option<Answer> {
        ui.heading("There is unsaved work from before");
        ui.label("Rigsmith ended without closing its document. Recover it with its steps?");
        egui::ScrollArea::vertical().max_height(220.0).show(ui, |ui| {
            for (number, pending) in list.iter().enumerate() {
                let mut text = format!("{}, {}", recovery::describe(pending), when(pending.modified));
                if pending.project_changed {
                    text.push_str("; its project was changed since");
                }
                ui.radio_value(&mut self.chosen, number, text).on_hover_text(pending.path.display().to_string());
            }
        });
        let pending = list.get(self.chosen).or(list.first())?;
        if pending.condition != Condition::Whole {
            ui.label("What is damaged stays on the disk until you delete it.");
        }
        let path = pending.path.clone();
        let mut answers = vec![
            ("Recover", Answer::Recover(path.clone())),
            ("Later", Answer::Cancel),
            ("Delete", Answer::Forget(path)),
        ];
        if !recovery::can_recover(pending) {
            answers.remove(0);
        }
        self.buttons(ui, &answers)
    }
}

/// Selects the name without folder and extension, the part that people usually change.
fn select_stem(ctx: &egui::Context, id: egui::Id, text: &str) {
    let name_at = text.rfind(['/', '\\']).map_or(0, |at| at + 1);
    let stem = crate::files::stem(Path::new(&text[name_at..]));
    let start = text[..name_at].chars().count();
    let range = egui::text::CCursorRange::two(
        egui::text::CCursor::new(start),
        egui::text::CCursor::new(start + stem.chars().count()),
    );
    let mut state = egui::TextEdit::load_state(ctx, id).unwrap_or_default();
    state.cursor.set_char_range(Some(range));
    egui::TextEdit::store_state(ctx, id, state);
}

fn frame(ctx: &egui::Context) -> egui::Frame {
    egui::Frame::popup(&ctx.global_style()).inner_margin(16)
}

/// Age of a time, in words.
fn when(time: Option<SystemTime>) -> String {
    let Some(seconds) = time.and_then(|time| time.elapsed().ok()).map(|age| age.as_secs()) else {
        return "at an unknown time".to_owned();
    };
    let ago = |number: u64, one: &str, many: &str| format!("{} ago", counted(number as usize, one, many));
    match seconds {
        0..60 => "just now".to_owned(),
        60..3600 => ago(seconds / 60, "minute", "minutes"),
        3600..86_400 => ago(seconds / 3600, "hour", "hours"),
        _ => ago(seconds / 86_400, "day", "days"),
    }
}
