//! Command palette: every action by words, with its key, and the reason if it can do nothing at present; and every panel. A key
//! whose action can do nothing tells the same reason.

use bevy::prelude::*;
use bevy_egui::egui::{self, Key, RichText, TextEdit, WidgetInfo, WidgetType};

use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    dock::ShowPanel,
    files::attend,
    help::describe,
    keys::KeyBindings,
    library,
    mode::Mode,
    notice::Notice,
    panel::{EditorOverlay, PanelApp, PanelTitles, Requests},
    panels::{graph, poses::PosedRig, timeline},
    running_work::running,
    settings::{EditorSettings, UI_SCALES},
    style,
    tools::{
        paint::brush,
        region::RegionTool,
        stroke::{StrokeState, StrokeTool},
    },
};
use crate::{
    plugins::{
        RigSystems, commands::Processor, document::Selection, fit::FittedRig, history::RigHistory, surface::RigMeshes,
    },
    rig::{Rig, TagKind, Uid},
};

/// Plugin of the command palette.
pub struct PalettePlugin;

impl Plugin for PalettePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<PaletteShown>()
            .add_message::<ActionRequest>()
            .add_message::<ShowPanel>()
            .add_message::<Notice>()
            .add_overlay(Palette::default())
            .add_systems(Update, (toggle_palette, tell_obstacles.before(RigSystems::Script)).after(attend));
    }
}

/// Visibility of the palette.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PaletteShown(pub bool);

fn toggle_palette(mut actions: MessageReader<ActionRequest>, mut shown: ResMut<PaletteShown>) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::Palette => shown.0 = !shown.0,
            Action::Cancel if shown.0 => shown.0 = false,
            _ => {}
        }
    }
}

/// True for actions that say nothing themselves where they can do nothing.
fn is_silent(action: Action) -> bool {
    matches!(
        action,
        Action::Build
            | Action::RollBack
            | Action::StepForward
            | Action::StepBack
            | Action::XRay
            | Action::Wireframe
            | Action::Meshes
            | Action::Deforming
            | Action::OnionSkin
    )
}

/// Tells why an action can do nothing, for keys and buttons that are not greyed.
fn tell_obstacles(mut actions: MessageReader<ActionRequest>, mut commands: Commands) {
    for action in actions.read().map(|request| request.0).filter(|action| is_silent(*action)) {
        commands.queue(move |world: &mut World| {
            if let Some(why_not) = obstacle(world, action) {
                world.write_message(Notice::info(format!("{}: {why_not}.", describe(action))));
            }
        });
    }
}

/// The reason why an action can do nothing at present, in a few words; `None` if it can.
pub fn obstacle(world: &World, action: Action) -> Option<&'static str> {
    if is_of_window(action) {
        return of_window(world, action);
    }
    let Some(entity) = world.get_resource::<ActiveRig>().map(|rig| rig.0) else { return Some("no rig is open") };
    if let Action::Library(action) = action {
        return library::obstacle(world, action);
    }
    if let Action::Timeline(action) = action {
        return timeline::obstacle(world, action);
    }
    if let Action::Graph(action) = action {
        return graph::obstacle(world, action);
    }
    if let Action::Brush(action) = action {
        return brush::obstacle(world, action);
    }
    let rig = world.get::<Rig>(entity)?;
    let history = world.get::<RigHistory>(entity);
    let selection: &[Uid] = world.get::<Selection>(entity).map_or(&[], |selection| &selection.0);
    let has_joint = || selection.iter().any(|node| rig.joint(*node).is_some());
    let has_mesh = world.get::<RigMeshes>(entity).is_some_and(|meshes| !meshes.is_empty());
    let commands = rig.walk().flat_map(|joint| &joint.data.tags);
    let has_commands = || commands.into_iter().any(|tag| matches!(tag.kind, TagKind::Command { .. }));
    let place = world.get::<Processor>(entity).map(|processor| processor.builder());
    match action {
        Action::Undo => history.is_some_and(|history| history.steps().1 == 0).then_some("there is no step to undo"),
        Action::Redo => history.is_some_and(|history| !history.can_redo()).then_some("nothing was undone"),
        Action::Delete | Action::DeleteHierarchy | Action::MirrorSelected => {
            (!has_joint()).then_some("no joint is selected")
        }
        Action::SelectNone => selection.is_empty().then_some("nothing is selected"),
        Action::SelectAll | Action::StorePose | Action::Labels | Action::LocalAxes | Action::Bones => {
            rig.is_empty().then_some("there are no joints")
        }
        Action::ResetPose | Action::MirrorPose if rig.is_empty() => Some("there are no joints"),
        Action::ResetPose | Action::MirrorPose => {
            let posed = PosedRig::of(world, entity)?;
            let is_at_rest = posed.shown.offsets.is_empty() && posed.shown.values.is_empty();
            match action {
                Action::MirrorPose if !selection.is_empty() => {
                    posed.other_side().is_empty().then_some("what is selected has no other side")
                }
                _ if is_at_rest => Some("nothing is posed"),
                Action::ResetPose if !selection.is_empty() => {
                    let is_any = posed.meant().into_iter().any(|node| posed.is_posed(node));
                    (!is_any).then_some("nothing of what is selected is posed")
                }
                _ => None,
            }
        }
        Action::FrameSelected | Action::FrameAll => {
            (rig.is_empty() && !has_mesh).then_some("there is nothing to look at")
        }
        Action::Export => {
            (rig.is_empty() && !has_mesh && rig.clips().is_empty()).then_some("there is nothing to export")
        }
        Action::Controls => (!has_commands()).then_some("no joint has commands: add tags, or a part"),
        Action::OnionSkin => timeline::OpenClip::of(world).is_none().then_some("no clip is open"),
        Action::Accept => {
            let is_fitted = world.get::<FittedRig>(entity).is_some();
            let chooses = world.get_resource::<RegionTool>().is_some_and(RegionTool::is_open);
            (!is_fitted && !chooses && !is_drawing(world)).then_some("nothing is drawn or fitted")
        }
        Action::Cancel => {
            let is_fitted = world.get::<FittedRig>(entity).is_some();
            let chooses = world.get_resource::<RegionTool>().is_some_and(RegionTool::is_open);
            let is_busy = is_fitted || chooses || is_drawing(world) || running(world).is_some();
            (!is_busy && !is_placing(world)).then_some("nothing is drawn, fitted or computed")
        }
        Action::NextVolume if !is_placing(world) && !is_drawing(world) => {
            Some("no joint is placed, and no stroke is drawn")
        }
        Action::NextVolume => (!has_mesh).then_some("no mesh is open"),
        Action::Fit | Action::FitPart | Action::Meshes | Action::XRay | Action::Wireframe => {
            (!has_mesh).then_some("no mesh is open")
        }
        Action::NextDoubt => {
            let fitted = world.get::<FittedRig>(entity);
            fitted
                .is_none_or(|fitted| fitted.report.doubtful().next().is_none())
                .then_some("no fit has doubtful joints")
        }
        Action::Deforming => rig.skins().next().is_none().then_some("no mesh has weights"),
        Action::Skin if !has_mesh => Some("no mesh is open"),
        Action::Skin => rig.is_empty().then_some("there are no joints"),
        Action::Build => (!has_commands()).then_some("no joint has commands: add tags, or a part"),
        Action::RollBack | Action::StepBack => {
            place.is_none_or(|builder| builder.cursor() == 0).then_some("no command is carried out")
        }
        Action::StepForward => {
            place.is_none_or(|builder| builder.cursor() == builder.len()).then_some("all commands are carried out")
        }
        _ => None,
    }
}

/// The reason why an action that needs no rig can do nothing at present.
fn of_window(world: &World, action: Action) -> Option<&'static str> {
    let scale = world.get_resource::<EditorSettings>()?.ui_scale;
    let [least, .., most] = UI_SCALES;
    match action {
        Action::UiLarger => (scale >= most).then_some("it has its largest size"),
        Action::UiSmaller => (scale <= least).then_some("it has its smallest size"),
        Action::UiUsual => (scale == 1.0).then_some("it is as large as usual"),
        _ => None,
    }
}

/// True in the mode that places joints.
fn is_placing(world: &World) -> bool {
    world.get_resource::<Mode>() == Some(&Mode::Place)
}

/// True while a stroke is drawn or shown.
fn is_drawing(world: &World) -> bool {
    world.get_resource::<StrokeTool>().is_some_and(|tool| !matches!(tool.state, StrokeState::Idle))
}

/// True for actions that need no rig.
fn is_of_window(action: Action) -> bool {
    if let Action::Library(action) = action {
        return action.is_of_window();
    }
    matches!(
        action,
        Action::New
            | Action::Open
            | Action::Quit
            | Action::Help
            | Action::Palette
            | Action::StartPage
            | Action::UiLarger
            | Action::UiSmaller
            | Action::UiUsual
            | Action::Theme
            | Action::Contrast
    )
}

/// Actions whose descriptions contain all words. Those that begin with the first word come first, then those one of whose words
/// begins with it.
pub fn found(words: &str) -> Vec<Action> {
    let words: Vec<String> = words.split_whitespace().map(str::to_lowercase).collect();
    let rank = |text: &str| {
        let begins = |part: &str| words.first().is_some_and(|word| part.starts_with(word.as_str()));
        let mut parts = text.split(|letter: char| !letter.is_alphanumeric());
        (!begins(text), !parts.any(begins))
    };
    let mut list: Vec<(Action, String)> =
        Action::all().into_iter().map(|action| (action, describe(action).to_lowercase())).collect();
    list.retain(|(_, text)| words.iter().all(|word| text.contains(word.as_str())));
    list.sort_by_key(|(_, text)| rank(text));
    list.into_iter().map(|(action, _)| action).collect()
}

/// Titles of the panels whose names, such as "Process panel", contain all words.
pub fn found_panels(world: &World, words: &str) -> Vec<&'static str> {
    let words: Vec<String> = words.split_whitespace().map(str::to_lowercase).collect();
    let titles = world.get_resource::<PanelTitles>().map(|titles| titles.0.as_slice()).unwrap_or_default();
    let fits = |title: &str| {
        let text = panel_name(title).to_lowercase();
        words.iter().all(|word| text.contains(word.as_str()))
    };
    titles.iter().copied().filter(|title| fits(title)).collect()
}

fn panel_name(title: &str) -> String {
    format!("{title} panel")
}

/// Entry of the palette that is chosen.
#[derive(Clone, Copy)]
enum Chosen {
    Action(Action),
    Panel(&'static str),
}

#[derive(Default)]
struct Palette {
    words: String,
    /// Place in the list that `Enter` takes.
    place: usize,
    was_shown: bool,
}

impl EditorOverlay for Palette {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        let is_shown = world.get_resource::<PaletteShown>().is_some_and(|shown| shown.0);
        let opened = is_shown && !self.was_shown;
        self.was_shown = is_shown;
        if !is_shown {
            return;
        }
        if opened {
            (self.words, self.place) = (String::new(), 0);
        }
        let (list, panels) = (found(&self.words), found_panels(world, &self.words));
        let at = |place: usize| match list.get(place) {
            Some(action) => Some(Chosen::Action(*action)),
            None => panels.get(place - list.len()).copied().map(Chosen::Panel),
        };
        let moved = ctx.input_mut(|input| {
            let down = input.consume_key(egui::Modifiers::NONE, Key::ArrowDown);
            let up = input.consume_key(egui::Modifiers::NONE, Key::ArrowUp);
            i32::from(down) - i32::from(up)
        });
        let last = (list.len() + panels.len()).saturating_sub(1);
        self.place = self.place.saturating_add_signed(moved as isize).min(last);
        let mut chosen = None;
        let mut is_open = true;
        let frame = egui::Window::new("Actions")
            .open(&mut is_open)
            .collapsible(false)
            .resizable(false)
            .anchor(egui::Align2::CENTER_TOP, [0.0, 60.0]);
        frame.show(ctx, |ui| {
            ui.set_width(440.0);
            let field = TextEdit::singleline(&mut self.words).hint_text("What do you want to do?").desired_width(440.0);
            let field = ui.add(field);
            field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Search actions"));
            if field.changed() {
                self.place = 0;
            }
            if field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter)) {
                chosen = at(self.place);
            } else if opened || !field.has_focus() {
                field.request_focus();
            }
            let height = (ctx.viewport_rect().height() - 220.0).clamp(120.0, 420.0);
            egui::ScrollArea::vertical().max_height(height).auto_shrink([false, true]).show(ui, |ui| {
                let keys = world.get_resource::<KeyBindings>();
                for (number, action) in list.iter().enumerate() {
                    let why_not = obstacle(world, *action);
                    ui.horizontal(|ui| {
                        let text = RichText::new(describe(*action));
                        let text = if why_not.is_some() { text.color(style::quiet(ui.visuals())) } else { text };
                        let row = ui.selectable_label(number == self.place, text);
                        if moved != 0 && number == self.place {
                            row.scroll_to_me(None);
                        }
                        if row.clicked() {
                            chosen = Some(Chosen::Action(*action));
                        }
                        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                            if let Some(key) = keys.and_then(|keys| keys.key(*action)) {
                                let color = style::accent(ui.visuals());
                                ui.label(RichText::new(key.to_string()).small().color(color));
                            }
                            if let Some(why_not) = why_not {
                                let color = style::quiet(ui.visuals());
                                ui.label(RichText::new(why_not).small().color(color));
                            }
                        });
                    });
                }
                for (number, title) in panels.iter().enumerate() {
                    let is_at = list.len() + number == self.place;
                    let row = ui.selectable_label(is_at, panel_name(title));
                    if moved != 0 && is_at {
                        row.scroll_to_me(None);
                    }
                    if row.clicked() {
                        chosen = Some(Chosen::Panel(title));
                    }
                }
                if list.is_empty() && panels.is_empty() {
                    ui.weak("No action is called so.");
                }
            });
        });
        match chosen {
            Some(Chosen::Action(action)) if obstacle(world, action).is_none() => {
                requests.set(PaletteShown(false));
                requests.send(ActionRequest(action));
            }
            Some(Chosen::Panel(title)) => {
                requests.set(PaletteShown(false));
                requests.send(ShowPanel(title));
            }
            _ if !is_open || ctx.input(|input| input.key_pressed(Key::Escape)) => requests.set(PaletteShown(false)),
            _ => {}
        }
    }
}
