//! Process panel: the list of commands with their states, steps in both directions, breakpoints.

use std::collections::{BTreeMap, BTreeSet};

use bevy::{ecs::change_detection::Tick, prelude::*};
use bevy_egui::egui::{
    self, Align, Color32, Layout, Rect, RichText, Sense, Ui, Visuals, WidgetInfo, WidgetType, pos2, vec2,
};

use super::{
    displayed_rig::{DisplayedRig, Stamp},
    list::{self, List},
    tags::show_tag,
};
use crate::{
    editor::{
        notice::Notice,
        panel::{EditorPanel, Requests},
        style,
    },
    plugins::{
        commands::{BuildRequest, BuildResult, BuildStep, Processor},
        picking::{Pick, PickRequest},
        stage::{RigStage, StageRequest},
    },
    processor::{BuildRange, Builder, CommandState, CommandStatus, ListEntry},
    rig::{BuiltNode, TagKind, Uid},
};

/// Least width with which stage and steps stand in one line, and the choices and the search in another.
const TWO_LINES: f32 = 600.0;

/// Reason why nothing can be taken back.
pub(super) const AT_START: &str = "No command is carried out";
/// Reason why nothing can be carried out.
pub(super) const AT_END: &str = "All commands are carried out";

/// Reason why the rig is not brought to a stage.
pub(super) const AT_STAGE: &str = "The rig is at this stage";

/// The panel.
#[derive(Default)]
pub struct ProcessPanel {
    made_from: Option<(Stamp, Tick)>,
    rows: Vec<Row>,
    /// Commands that ran when the list changed last.
    ran: BTreeSet<Uid>,
    /// Search text: words that rows have to contain.
    filter: String,
    /// Rows that contain the words.
    shown: Vec<usize>,
    filtered: Option<String>,
    /// Scrolls to the command that ran last.
    follow: bool,
    /// Choice of the last frame.
    was_following: bool,
    cursor: usize,
    /// First row that an edit made run again, until it is scrolled to.
    rerun: Option<usize>,
    in_range: bool,
}

/// A command of the list.
struct Row {
    entry: ListEntry,
    joint: String,
    name: String,
    status: Option<CommandStatus>,
    is_breakpoint: bool,
}

impl Row {
    /// The command with the number of its runs.
    fn runs(&self) -> Option<(Uid, u32)> {
        let status = self.status.as_ref()?;
        (status.runs > 0).then_some((self.entry.command, status.runs))
    }
}

impl EditorPanel for ProcessPanel {
    fn title(&self) -> &'static str {
        "Process"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let processor = world.get_entity(shown.entity).ok().and_then(|rig| rig.get_ref::<Processor>());
        let Some(processor) = processor else {
            list::nothing(ui, "The rig has no commands yet: add tags to its joints, or drop a part.");
            return;
        };
        let builder = processor.builder();
        self.refresh(&shown, processor.last_changed(), builder);
        self.head(ui, &shown, (world.get::<RigStage>(shown.entity).copied(), &*processor), requests);
        self.find();
        let reveal = self.news(builder.cursor()).and_then(|row| self.shown.iter().position(|shown| *shown >= row));
        let height = list::row_height(ui);
        let rows = List { id: "commands", count: self.shown.len(), height, reveal, follow: false };
        let mut clicked = None;
        rows.show(ui, |ui, range, place| {
            for number in range {
                let at = self.shown[number];
                if let Some(click) = self.row(ui, place(number), at, builder.cursor()) {
                    clicked = Some((at, click));
                }
            }
        });
        if let Some((at, click)) = clicked {
            self.carry_out(at, click, world, &shown, requests);
        }
    }
}

/// Request of a click on a row.
enum Click {
    Select,
    Values,
    Made,
    RunTo,
    Breakpoint,
}

impl ProcessPanel {
    fn refresh(&mut self, shown: &DisplayedRig, changed: Tick, builder: &Builder) {
        let made_from = Some((shown.stamp(), changed));
        if self.made_from == made_from {
            return;
        }
        let breakpoints = builder.breakpoints();
        let before: BTreeMap<Uid, u32> = self.rows.iter().filter_map(Row::runs).collect();
        let row = |entry: ListEntry| Row {
            joint: shown.name(entry.joint).into_owned(),
            name: name(shown, &entry),
            status: builder.status(entry.command),
            is_breakpoint: breakpoints.contains(&entry.command),
            entry,
        };
        self.rows = builder.list().into_iter().map(row).collect();
        let is_more = |(command, runs): &(Uid, u32)| before.get(command).is_none_or(|before| before < runs);
        let ran: BTreeSet<Uid> = self.rows.iter().filter_map(Row::runs).filter(is_more).map(|(uid, _)| uid).collect();
        // Of the whole list nothing stands out, and what else changes leaves the marks.
        if before.is_empty() || !ran.is_empty() {
            let all = self.rows.iter().filter_map(Row::runs).count();
            self.ran = if ran.len() < all { ran } else { BTreeSet::new() };
            self.rerun = self.rows.iter().position(|row| self.ran.contains(&row.entry.command));
        }
        self.made_from = made_from;
        self.filtered = None;
    }

    /// Row to scroll to: the last one in effect after a step, or the first one that an edit made run again.
    fn news(&mut self, cursor: usize) -> Option<usize> {
        let is_begun = std::mem::replace(&mut self.was_following, self.follow) != self.follow;
        let is_step = std::mem::replace(&mut self.cursor, cursor) != cursor;
        let rerun = self.rerun.take();
        let row = if is_step { None } else { rerun };
        let row = row.or_else(|| (is_step || is_begun).then(|| cursor.saturating_sub(1)));
        row.filter(|_| self.follow)
    }

    fn find(&mut self) {
        if self.filtered.as_ref() == Some(&self.filter) {
            return;
        }
        let words: Vec<String> = self.filter.split_whitespace().map(str::to_lowercase).collect();
        let fits = |row: &Row| {
            let text = format!("{} {} {}", row.joint, row.entry.module, state_word(row.status.as_ref())).to_lowercase();
            words.iter().all(|word| text.contains(word.as_str()))
        };
        self.shown = (0..self.rows.len()).filter(|row| fits(&self.rows[*row])).collect();
        self.filtered = Some(self.filter.clone());
    }

    /// Draws everything above the list: two lines where there is width, so that a low panel has room for commands.
    fn head(&mut self, ui: &mut Ui, shown: &DisplayedRig, of: (Option<RigStage>, &Processor), requests: &mut Requests) {
        let (builder, follows) = (of.1.builder(), of.1.follows());
        let filter = ("Filter commands", "Words of joint, module and state");
        if ui.available_width() < TWO_LINES {
            ui.horizontal(|ui| stages(ui, shown, of, requests));
            ui.horizontal_wrapped(|ui| self.steps(ui, shown, builder, requests));
            ui.horizontal_wrapped(|ui| self.choices(ui, shown, follows, requests));
            return list::search_bar(ui, filter.0, filter.1, &mut self.filter, |_| {});
        }
        ui.horizontal(|ui| {
            stages(ui, shown, of, requests);
            ui.separator();
            self.steps(ui, shown, builder, requests);
        });
        ui.horizontal(|ui| {
            self.choices(ui, shown, follows, requests);
            list::search_bar(ui, filter.0, filter.1, &mut self.filter, |_| {});
        });
    }

    /// Draws the steps of the build, and how far it is.
    fn steps(&self, ui: &mut Ui, shown: &DisplayedRig, builder: &Builder, requests: &mut Requests) {
        let (done, total) = (builder.cursor(), builder.len());
        let mut ask = |step: BuildStep| requests.send(BuildRequest { rig: shown.entity, step });
        ui.spacing_mut().item_spacing.x = 3.0;
        let no_back = (done == 0).then_some(AT_START);
        let no_further = (done == total).then_some(AT_END);
        let steps = [
            ("⏮", "Roll all back", BuildStep::RollBack, no_back),
            ("⏪", "Roll the last joint back", BuildStep::JointBack, no_back),
            ("⏴", "Take the last command back", BuildStep::Back, no_back),
            ("⏵", "Carry out the next command", BuildStep::Forward, no_further),
            ("⏩", "Carry out the next joint", BuildStep::JointForward, no_further),
            ("⏭", "Run to the next breakpoint, or to the end", BuildStep::Run, no_further),
        ];
        for (symbol, tip, step, why_not) in steps {
            if list::symbol_button_unless(ui, symbol, tip, why_not) {
                ask(step);
            }
        }
        let counts = builder.counts();
        ui.label(format!("{} of {}", counts.built, counts.all))
            .on_hover_text("Commands that are in effect, of those that a build carries out");
        if counts.off > 0 {
            ui.weak(format!("{} off", counts.off)).on_hover_text(
                "Commands that the build passes over: their tag, feature or group is off, or what they refer to",
            );
        }
        if !self.ran.is_empty() {
            let ran = format!("{} ran", self.ran.len());
            ui.label(RichText::new(ran).color(style::accent(ui.visuals())))
                .on_hover_text("Commands that the last change made run again; the others keep what they built");
        }
        let micros: f32 = self.rows.iter().filter_map(|row| Some(row.status.as_ref()?.micros)).sum();
        // As wide for any time, so that nothing moves while commands run.
        let size = vec2(62.0, ui.spacing().interact_size.y);
        ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_width(size.x);
            ui.weak(format!("{:.1} ms", micros / 1000.0))
                .on_hover_text("Time of the last run of each command, together");
        });
    }

    /// Draws what edits rebuild, what the list follows, and which joints are built.
    fn choices(&mut self, ui: &mut Ui, shown: &DisplayedRig, follows: bool, requests: &mut Requests) {
        let mut ask = |step: BuildStep| requests.send(BuildRequest { rig: shown.entity, step });
        let mut live = follows;
        if ui.checkbox(&mut live, "Live").on_hover_text("Edits rebuild what depends on them at once").clicked() {
            ask(BuildStep::Follow(live));
        }
        ui.checkbox(&mut self.follow, "Follow").on_hover_text("Scrolls to the command that was carried out last");
        let selected = &shown.selection.0;
        let tip = "Only commands of the selected joints and of those below them";
        let field = ui.add_enabled(
            self.in_range || !selected.is_empty(),
            egui::Checkbox::new(&mut self.in_range, "Selection only"),
        );
        let field = field.on_hover_text(tip).on_disabled_hover_text("Select the joints first");
        if field.clicked() {
            ask(BuildStep::Range(match self.in_range {
                true => BuildRange::Hierarchy(selected.iter().copied().collect()),
                false => BuildRange::Rig,
            }));
        }
    }

    fn row(&self, ui: &mut Ui, rect: Rect, number: usize, cursor: usize) -> Option<Click> {
        let row = &self.rows[number];
        let id = ui.id().with(row.entry.command.0);
        let response = ui.interact(rect, id, Sense::click());
        let state = state_word(row.status.as_ref());
        let has_run = self.ran.contains(&row.entry.command);
        let said = format!("{} {} {state}{}", row.joint, row.name, if has_run { ", ran" } else { "" });
        response.widget_info(move || WidgetInfo::labeled(WidgetType::SelectableLabel, true, &said));
        let painter = ui.painter();
        if response.hovered() {
            painter.rect_filled(rect, 2.0, ui.visuals().widgets.hovered.weak_bg_fill);
        }
        let size = rect.height();
        let dot = Rect::from_min_size(rect.min, vec2(size, size));
        let color = color(ui.visuals(), row.status.as_ref());
        painter.circle_filled(dot.center(), 4.0, color);
        if row.is_breakpoint {
            painter.circle_stroke(dot.center(), 6.0, (2.0, ui.visuals().error_fg_color));
        }
        if has_run {
            painter.vline(rect.left() + 1.0, rect.y_range(), (2.0, style::accent(ui.visuals())));
        }
        // The next command to be carried out.
        if number == cursor {
            painter.hline(rect.x_range(), rect.top(), (1.5, ui.visuals().selection.stroke.color));
        }
        let time =
            row.status.as_ref().filter(|status| status.runs > 0).map_or_else(String::new, |status| time(status.micros));
        let right = if rect.width() > 180.0 { 62.0 } else { 0.0 };
        let middle = rect.left() + size + (rect.width() - size - right) * 0.45;
        let text = |from: f32, to: f32| Rect::from_min_max(pos2(from, rect.top()), pos2(to, rect.bottom()));
        let quiet = ui.visuals().weak_text_color();
        let is_off = matches!(row.status.as_ref().map(|status| status.state), Some(CommandState::Skipped));
        let strong = if is_off { quiet } else { ui.visuals().text_color() };
        list::line(ui, text(rect.left() + size, middle - 4.0), &row.joint, quiet);
        list::line(ui, text(middle, rect.right() - right), &row.name, strong);
        if right > 0.0 {
            list::line(ui, text(rect.right() - right + 4.0, rect.right()), &time, quiet);
        }
        let mut click = response.clicked().then_some(Click::Select);
        response.context_menu(|ui| {
            let label = if row.is_breakpoint { "Remove breakpoint" } else { "Stop before it" };
            for (name, asked) in [
                ("Run to here", Click::RunTo),
                (label, Click::Breakpoint),
                ("Show its values", Click::Values),
                ("Select what it made", Click::Made),
            ] {
                if ui.button(name).clicked() {
                    click = Some(asked);
                    ui.close();
                }
            }
        });
        let reason = row.status.as_ref().and_then(reason);
        if let Some(reason) = reason {
            response.on_hover_ui(|ui| {
                ui.label(RichText::new(reason).color(color));
            });
        }
        click
    }

    fn carry_out(&self, number: usize, click: Click, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
        let row = &self.rows[number];
        let ask = |step| BuildRequest { rig: shown.entity, step };
        let pick = |nodes| PickRequest { rig: shown.entity, what: Pick::Joints(nodes), add: false };
        let has_failed = row.status.as_ref().is_some_and(|status| status.state == CommandState::Failed);
        match click {
            // What failed is mended where its values are.
            Click::Select if has_failed => show_tag(world, shown, row.entry.command, requests),
            Click::Select => requests.send(pick(vec![row.entry.joint])),
            Click::Values => show_tag(world, shown, row.entry.command, requests),
            Click::Made => match made_by(world, shown, row.entry.command) {
                nodes if nodes.is_empty() => {
                    let text = format!("{} of {} made no node.", row.name, row.joint);
                    requests.send(Notice::info(text).named());
                }
                nodes => requests.send(pick(nodes)),
            },
            Click::RunTo => requests.send(ask(BuildStep::To(number + 1))),
            Click::Breakpoint => requests.send(ask(BuildStep::Breakpoint(row.entry.command, !row.is_breakpoint))),
        }
    }
}

/// Nodes that a command made.
fn made_by(world: &World, shown: &DisplayedRig, command: Uid) -> Vec<Uid> {
    let Some(built) = world.get::<BuildResult>(shown.entity) else { return Vec::new() };
    let is_own = |node: &&BuiltNode| node.origin.as_ref().is_some_and(|origin| origin.command == command);
    built.0.nodes.iter().filter(is_own).map(|node| node.uid).collect()
}

/// Stage of the rig, and the choice of another.
fn stages(
    ui: &mut Ui,
    shown: &DisplayedRig,
    (now, processor): (Option<RigStage>, &Processor),
    requests: &mut Requests,
) {
    let label = ui.label("Stage");
    let name = now.map_or("not built", RigStage::name);
    let combo = egui::ComboBox::from_id_salt("stage").selected_text(name).show_ui(ui, |ui| {
        for stage in RigStage::ALL {
            let tip = match stage {
                RigStage::Skeleton => "The joints in their pose; no command is in effect",
                RigStage::Edit => "The joints at rest, to be edited; no command runs",
                RigStage::Built => "All commands are in effect, and follow every edit",
                RigStage::Deleted => "No joints; another stage, or Ctrl+Z, brings them back",
            };
            let entry = egui::Button::selectable(now == Some(stage), stage.name());
            let entry = ui.add_enabled(!stage.is_kept(now, Some(processor)), entry).on_hover_text(tip);
            if entry.on_disabled_hover_text(AT_STAGE).clicked() {
                requests.send(StageRequest { rig: shown.entity, stage });
            }
        }
    });
    combo.response.labelled_by(label.id);
}

/// Module of a command, with the name that it gives.
fn name(shown: &DisplayedRig, entry: &ListEntry) -> String {
    let comment = |uid: Uid| {
        let (_, tag) = shown.rig.find_tag(uid)?;
        let is_command = matches!(tag.kind, TagKind::Command { .. });
        (is_command && !tag.comment.is_empty()).then(|| tag.comment.clone())
    };
    match comment(entry.command) {
        Some(comment) => format!("{} · {comment}", entry.module),
        None => entry.module.to_string(),
    }
}

/// Word for the state of a command.
pub(super) fn state_word(status: Option<&CommandStatus>) -> &'static str {
    match status.map(|status| status.state) {
        Some(CommandState::Done) => "built",
        Some(CommandState::Skipped) => "passed over",
        Some(CommandState::Failed) => "failed",
        Some(CommandState::Pending) | None => "not built yet",
    }
}

/// Colour of the state of a command.
pub(super) fn color(visuals: &Visuals, status: Option<&CommandStatus>) -> Color32 {
    match status.map(|status| status.state) {
        Some(CommandState::Done) => style::readable(visuals, Color32::from_rgb(96, 176, 96)),
        Some(CommandState::Skipped) => visuals.warn_fg_color,
        Some(CommandState::Failed) => visuals.error_fg_color,
        Some(CommandState::Pending) | None => visuals.weak_text_color(),
    }
}

fn reason(status: &CommandStatus) -> Option<String> {
    super::properties::tags::reason(status)
}

fn time(micros: f32) -> String {
    if micros < 1000.0 { format!("{micros:.0} µs") } else { format!("{:.2} ms", micros / 1000.0) }
}
