//! Help page with a search: every action, its keys, and the reason if it can do nothing at present.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    actions::{Action, ActionRequest},
    files::attend,
    keys::{ChosenKey, KeyBindings},
    palette::obstacle,
    panel::{EditorOverlay, PanelApp, Requests},
    settings::SettingsFile,
    style,
};

/// Plugin of the help page.
pub struct HelpPlugin;

impl Plugin for HelpPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<HelpShown>()
            .add_message::<ActionRequest>()
            .add_overlay(HelpPage::default())
            .add_systems(Update, toggle_help.after(attend));
    }
}

/// Visibility of the page.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HelpShown(pub bool);

/// Name of the page's area on the screen.
pub fn page_id() -> egui::Id {
    egui::Id::new("help page")
}

/// Actions of the pointer, for the list.
const POINTER: &[(&str, &str)] = &[
    ("Left", "the mode's tool"),
    ("Middle drag, or Alt + left drag", "orbit"),
    ("Right drag, or Shift + middle drag", "pan"),
    ("Wheel, or Alt + right drag", "zoom (with Ctrl while a tool has the wheel)"),
    ("Trackpad: two fingers / Shift / Ctrl", "orbit / pan / zoom"),
    ("Pose mode: drag a joint or a control", "pull it; the joints above follow (with Ctrl in steps)"),
    ("Pose and Select mode: right click", "switches, pose and selection sets of the node"),
    ("Loader: drag a template onto a joint", "add the part there, or merge the template below it"),
    ("Fit into a part: click, or drag a box", "choose faces (with Shift more, with Ctrl fewer)"),
    ("Paint: Ctrl, Shift", "the opposite of the brush, smooth"),
    ("Paint: Ctrl + Shift", "select points; a drag selects all within the brush"),
    ("Timeline: drag in the ruler", "scrub (with Shift between frames)"),
    ("Timeline: click, or drag a box", "select keys (with Shift more, with Ctrl one more or less)"),
    ("Timeline: drag selected keys", "move (with Alt between frames); with Ctrl scale about the playhead"),
    ("Timeline: Ctrl + wheel, Shift + wheel", "zoom, pan in time"),
    ("Graph: click, or drag a box", "select commands (with Shift more, with Ctrl one more or less)"),
    ("Graph: click on a frame's title or box", "fold the frame to a box, or open it"),
    ("Graph: drag selected nodes", "move them on the grid; the project keeps their places"),
    ("Graph: point at a node or box", "draw its wires in full, as those of selected ones; others fade"),
    ("Graph: drag from an output to an input", "refer to what the command makes (with Shift besides what is there)"),
    ("Timeline: right click on a node", "its switches, for the pose and over the selected keys"),
    ("Timeline: right click on other rows", "what can be done with their keys"),
    ("Curves: click a key, or drag a box", "select keys (with Shift or Ctrl more)"),
    ("Curves: drag a key, or a tangent's end", "time or value, whichever comes first; slope (with Alt on one side)"),
    ("Graph: right click on a wire", "remove its reference, or insert a command"),
    ("Graph: right drag, wheel, Ctrl + wheel", "pan, pan, zoom"),
];

pub(super) fn toggle_help(mut actions: MessageReader<ActionRequest>, mut shown: ResMut<HelpShown>) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::Help => shown.0 = !shown.0,
            Action::Cancel if shown.0 => shown.0 = false,
            _ => {}
        }
    }
}

/// Description of an action, in a few words.
pub fn describe(action: Action) -> String {
    let text = match action {
        Action::Mode(mode) => return format!("{} mode", mode.name()),
        Action::New => "New project",
        Action::Open => "Open",
        Action::AddMesh => "Add mesh",
        Action::Save => "Save",
        Action::SaveAs => "Save as",
        Action::Export => "Export",
        Action::Quit => "Quit",
        Action::Undo => "Undo",
        Action::Redo => "Redo",
        Action::Delete => "Delete, keep what hangs below",
        Action::DeleteHierarchy => "Delete with children",
        Action::SelectAll => "Select all",
        Action::SelectNone => "Select none",
        Action::MirrorSelected => "Mirror selected",
        Action::Symmetry => "Symmetry",
        Action::MoveChildren => "Move children along",
        Action::Accept => "Accept what is drawn",
        Action::Cancel => "Drop what is drawn",
        Action::NextVolume => "Next volume under the pointer",
        Action::Fit => "Fit a skeleton into the mesh",
        Action::FitPart => "Fit into a part of the mesh",
        Action::NextDoubt => "Next doubtful joint of the fit",
        Action::Skin => "Skin",
        Action::ResetPose => "Reset pose",
        Action::MirrorPose => "Mirror pose",
        Action::StorePose => "Store pose",
        Action::Build => "Build the rig",
        Action::RollBack => "Roll the build back",
        Action::StepForward => "Carry out the next command",
        Action::StepBack => "Take back the last command",
        Action::GizmoSpace => "World, local or view axes",
        Action::FrameSelected => "Frame selected",
        Action::FrameAll => "Frame all",
        Action::ViewFront => "Front",
        Action::ViewBack => "Back",
        Action::ViewLeft => "Left side",
        Action::ViewRight => "Right side",
        Action::ViewTop => "Top",
        Action::ViewBottom => "Bottom",
        Action::Projection => "Perspective or orthographic",
        Action::XRay => "X-ray",
        Action::Wireframe => "Wireframe",
        Action::Labels => "Labels",
        Action::LocalAxes => "Local axes",
        Action::Grid => "Grid",
        Action::Controls => "Controls",
        Action::Help => "Help",
        Action::Palette => "All actions",
        Action::StartPage => "Start page",
        Action::Bones => "Bones",
        Action::Meshes => "Meshes",
        Action::Deforming => "Joints that deform",
        Action::OnionSkin => "Onion skin",
        Action::UiLarger => "Larger interface",
        Action::UiSmaller => "Smaller interface",
        Action::UiUsual => "Interface as large as usual",
        Action::Theme => "Dark or light theme",
        Action::Contrast => "High contrast",
        Action::Timeline(action) => action.name(),
        Action::Graph(action) => action.name(),
        Action::Library(action) => action.name(),
        Action::Brush(action) => action.name(),
    };
    text.to_owned()
}

/// Action with its keys and the reason if it can do nothing at present.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HelpRow {
    /// The action.
    pub action: Action,
    /// Description of the action.
    pub text: String,
    /// Keys of the action, with commas between them.
    pub keys: String,
    /// Reason why it can do nothing at present.
    pub obstacle: Option<&'static str>,
}

/// Actions whose description, keys or reason contain all words, in the order of [`Action::all`].
pub fn rows(world: &World, words: &str) -> Vec<HelpRow> {
    let words: Vec<String> = words.split_whitespace().map(str::to_lowercase).collect();
    let bindings = world.get_resource::<KeyBindings>();
    let row = |action: Action| {
        let keys: Vec<String> = bindings.iter().flat_map(|keys| keys.keys(action)).map(ToString::to_string).collect();
        HelpRow { action, text: describe(action), keys: keys.join(", "), obstacle: obstacle(world, action) }
    };
    let is_meant = |row: &HelpRow| {
        let all = format!("{} {} {}", row.text, row.keys, row.obstacle.unwrap_or_default()).to_lowercase();
        words.iter().all(|word| all.contains(word.as_str()))
    };
    Action::all().into_iter().map(row).filter(is_meant).collect()
}

/// The page.
#[derive(Default)]
struct HelpPage {
    words: String,
    was_shown: bool,
    /// True if an action waited for its key in the last frame.
    was_waiting: bool,
}

impl EditorOverlay for HelpPage {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        let is_shown = world.get_resource::<HelpShown>().is_some_and(|shown| shown.0);
        let opened = is_shown && !self.was_shown;
        self.was_shown = is_shown;
        if !is_shown {
            return;
        }
        if opened {
            self.words.clear();
        }
        let waiting = world.get_resource::<ChosenKey>().and_then(|chosen| chosen.0);
        // Escape in place of a key keeps the page.
        let is_for_key = std::mem::replace(&mut self.was_waiting, waiting.is_some()) || waiting.is_some();
        let mut is_open = true;
        let room = ctx.content_rect().size() - egui::vec2(48.0, 164.0);
        egui::Window::new("Help")
            .id(page_id())
            .open(&mut is_open)
            .collapsible(false)
            .resizable(false)
            .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
            .show(ctx, |ui| {
                ui.set_width(room.x.clamp(280.0, 660.0));
                self.head(ui, opened, requests);
                egui::ScrollArea::vertical().max_height(room.y.max(120.0)).auto_shrink([false, true]).show(ui, |ui| {
                    self.pointer(ui);
                    actions(ui, &rows(world, &self.words), waiting, requests);
                });
                let file = world.get_resource::<SettingsFile>().and_then(SettingsFile::path);
                let place = file.map_or_else(|| "the settings file".to_owned(), |file| file.display().to_string());
                ui.horizontal_wrapped(|ui| {
                    ui.weak(format!("Click an action to give it another key. Keys are kept in {place}."));
                    let keys = world.get_resource::<KeyBindings>();
                    let is_other = keys.is_some_and(|keys| *keys != KeyBindings::default());
                    let usual = ui.add_enabled(is_other, egui::Button::new("Usual keys").small());
                    let usual = usual.on_hover_text("Gives all actions the keys that they have at first");
                    if usual.on_disabled_hover_text("All actions have their usual keys").clicked() {
                        requests.set(KeyBindings::default());
                    }
                });
            });
        if !is_open || !is_for_key && ctx.input(|input| input.key_pressed(egui::Key::Escape)) {
            requests.set(HelpShown(false));
            requests.set(ChosenKey(None));
        }
    }
}

impl HelpPage {
    /// Draws the search field, and the ways to the other helpers.
    fn head(&mut self, ui: &mut egui::Ui, opened: bool, requests: &mut Requests) {
        ui.horizontal(|ui| {
            let width = (ui.available_width() - 190.0).max(100.0);
            let field = egui::TextEdit::singleline(&mut self.words).hint_text("Search").desired_width(width);
            let field = ui.add(field);
            field.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, "Search help"));
            if opened {
                field.request_focus();
            }
            for action in [Action::StartPage, Action::Palette] {
                if ui.button(describe(action)).clicked() {
                    requests.set(HelpShown(false));
                    requests.send(ActionRequest(action));
                }
            }
        });
        ui.add_space(4.0);
    }

    /// Draws what the pointer does.
    fn pointer(&self, ui: &mut egui::Ui) {
        let words: Vec<String> = self.words.split_whitespace().map(str::to_lowercase).collect();
        let is_meant = |(what, does): &&(&str, &str)| {
            let all = format!("{what} {does}").to_lowercase();
            words.iter().all(|word| all.contains(word.as_str()))
        };
        let list: Vec<&(&str, &str)> = POINTER.iter().filter(is_meant).collect();
        if list.is_empty() {
            return;
        }
        ui.strong("Pointer");
        egui::Grid::new("pointer").num_columns(2).striped(true).show(ui, |ui| {
            for (what, does) in list {
                ui.colored_label(style::accent(ui.visuals()), *what);
                ui.label(*does);
                ui.end_row();
            }
        });
        ui.add_space(6.0);
    }
}

/// Draws actions, a row each: a click on one lets it wait for another key.
fn actions(ui: &mut egui::Ui, list: &[HelpRow], waiting: Option<Action>, requests: &mut Requests) {
    if list.is_empty() {
        ui.weak("No action is called so.");
        return;
    }
    ui.strong("Actions");
    egui::Grid::new("actions").num_columns(3).striped(true).spacing([18.0, 4.0]).show(ui, |ui| {
        for row in list {
            let is_free = row.obstacle.is_none();
            let color = if is_free { ui.visuals().text_color() } else { style::quiet(ui.visuals()) };
            let text = egui::RichText::new(&row.text).color(color);
            let label = ui.add(egui::Label::new(text).sense(egui::Sense::click()));
            label.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, &row.text));
            if label.on_hover_text("Click, then press the key that it is to have").clicked() {
                requests.set(ChosenKey(Some(row.action)));
            }
            let keys = if waiting == Some(row.action) { "press a key" } else { row.keys.as_str() };
            ui.colored_label(style::accent(ui.visuals()), keys);
            ui.weak(row.obstacle.unwrap_or_default());
            ui.end_row();
        }
    });
}
