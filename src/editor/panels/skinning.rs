//! Skinning panel: a button that computes weights, and a report of the results. Beside meshes without weights, those that
//! have some keep them.

mod findings;
mod parts;

use bevy::prelude::*;
use bevy_egui::egui::{
    self, Button, Checkbox, CollapsingHeader, ComboBox, DragValue, ProgressBar, RichText, ScrollArea, Slider, Ui,
};

pub use findings::SkinningClaims;
pub use parts::SkinningParts;

use super::{
    displayed_rig::{DisplayedRig, joint_name},
    fields::{self, TypedText},
    list,
    log::LogSystems,
};
use crate::{
    algo::weights::{Method, WeightError, WeightReport, WeightSettings},
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        counts::counted,
        notice::{Notice, Severity},
        panel::{EditorPanel, Requests},
    },
    plugins::{
        RigSystems,
        commands::BuildResult,
        landing::ResultHeld,
        skinning::{BindAnswer, BindRequest, SkinningError, SkinningJob, SkinningReport},
        surface::{RigMesh, RigMeshes},
    },
    rig::{BuiltRig, NodeKind, Rig, SkinData, Uid},
};

/// Plugin that carries out [`Action::Skin`] and reports the results.
pub struct SkinningPanelPlugin;

impl Plugin for SkinningPanelPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<SkinningSettings>()
            .init_resource::<SkinningResults>()
            .init_resource::<SkinningParts>()
            .init_resource::<SkinningClaims>()
            .add_message::<ActionRequest>()
            .add_message::<CancelSkinning>()
            .add_message::<SkinMesh>()
            .add_message::<Notice>()
            .add_message::<BindAnswer>()
            .add_message::<ResultHeld>()
            .add_systems(Update, (skin, cancel).chain().after(RigSystems::Build).before(RigSystems::Bind))
            .add_systems(Last, (tell_results, tell_held).chain().before(LogSystems));
    }
}

/// Settings of the weights that [`Action::Skin`] computes.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct SkinningSettings(pub WeightSettings);

/// Result of the last computation of each mesh.
#[derive(Resource, Debug, Default)]
pub struct SkinningResults(Vec<(Entity, Result<SkinningReport, SkinningError>)>);

impl SkinningResults {
    /// The last result for a mesh.
    pub fn get(&self, mesh: Entity) -> Option<&Result<SkinningReport, SkinningError>> {
        self.0.iter().find(|(known, _)| *known == mesh).map(|(_, result)| result)
    }
}

/// Request to compute the weights of one mesh; the others keep theirs.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct SkinMesh(pub Entity);

/// Request to cancel all computations for the active rig; the weights stay unchanged.
#[derive(Message, Debug, Clone, Copy)]
pub struct CancelSkinning;

/// Requests weights for the meshes that have none, for every mesh if that is none or each of them, or for single ones; or
/// sends a notice with the obstacle.
fn skin(
    mut actions: MessageReader<ActionRequest>,
    mut singles: MessageReader<SkinMesh>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, Option<&RigMeshes>, Option<&BuildResult>)>,
    jobs: Query<&SkinningJob>,
    models: Query<&RigMesh>,
    (settings, parts, claims): (Res<SkinningSettings>, Res<SkinningParts>, Res<SkinningClaims>),
    mut commands: Commands,
) {
    let is_for_all = actions.read().any(|request| request.0 == Action::Skin);
    let singles: Vec<Entity> = singles.read().map(|request| request.0).collect();
    if !is_for_all && singles.is_empty() {
        return;
    }
    let Some((rig, meshes, built)) = active.and_then(|active| rigs.get(active.0).ok()) else { return };
    let meshes: Vec<Entity> = meshes.iter().flat_map(|meshes| meshes.iter()).collect();
    if let Some(progress) = meshes.iter().find_map(|mesh| jobs.get(*mesh).ok()).map(SkinningJob::progress) {
        let percent = (progress * 100.0) as u32;
        let text = format!("Skinning is running ({percent} %). Wait for it, or cancel it in the Skinning panel.");
        commands.write_message(Notice::info(text).at(TITLE));
        return;
    }
    if let Some(obstacle) = obstacle(rig, meshes.len()) {
        commands.write_message(Notice::warning(obstacle));
        return;
    }
    let built = built.map(|built| &*built.0);
    let models_of = |mesh: &Entity| models.get(*mesh).ok();
    let (bare, bound): (Vec<Entity>, Vec<Entity>) =
        meshes.iter().copied().partition(|mesh| models_of(mesh).is_some_and(|model| needs_weights(rig, built, model)));
    let asked: Vec<Entity> = match is_for_all {
        false => meshes.into_iter().filter(|mesh| singles.contains(mesh)).collect(),
        true if bare.is_empty() || bound.is_empty() => meshes,
        true => {
            let kept: Vec<&str> = bound.iter().filter_map(models_of).map(mesh_name).collect();
            let keep = if kept.len() == 1 { "keeps its" } else { "keep their" };
            let text = format!("{} {keep} weights. Skin again computes those of all meshes.", kept.join(", "));
            commands.write_message(Notice::info(text).named().at(TITLE));
            bare
        }
    };
    for mesh in asked {
        let parts = models.get(mesh).map(|model| parts.of(model.uid)).unwrap_or_default();
        let claims = claims.0.iter().copied().collect();
        commands.write_message(BindRequest { mesh, settings: settings.0.clone(), parts, claims });
    }
}

/// Name of the panel.
const TITLE: &str = "Skinning";

/// Reason why there is nothing to skin, if so.
fn obstacle(rig: &Rig, meshes: usize) -> Option<&'static str> {
    if meshes == 0 {
        Some("There is no mesh to skin: open one first.")
    } else if rig.is_empty() {
        Some("There are no joints to skin to: place some or draw a stroke first.")
    } else {
        None
    }
}

fn cancel(
    mut requests: MessageReader<CancelSkinning>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<&RigMeshes>,
    jobs: Query<&SkinningJob>,
) {
    if requests.read().count() == 0 {
        return;
    }
    let Some(meshes) = active.and_then(|active| rigs.get(active.0).ok()) else { return };
    meshes.iter().filter_map(|mesh| jobs.get(mesh).ok()).for_each(SkinningJob::cancel);
}

fn tell_results(
    mut bound: MessageReader<BindAnswer>,
    meshes: Query<&RigMesh>,
    mut results: ResMut<SkinningResults>,
    mut notices: MessageWriter<Notice>,
) {
    for BindAnswer { mesh, result } in bound.read() {
        let name = meshes.get(*mesh).map_or("The mesh", |mesh| mesh_name(mesh));
        notices.write(match result {
            Ok(SkinningReport { weights: report, .. }) => {
                let told = format!("{name} is skinned: {}.", covered(report.points, unweighted(report)));
                let notice = if unweighted(report) == 0 { Notice::done(told) } else { Notice::warning(told).at(TITLE) };
                notice.named()
            }
            Err(error) if is_cancelled(error) => Notice::info("Skinning was cancelled. The weights are as they were."),
            Err(error) => Notice::error(format!("{name} was not skinned: {error}.")).named().at(TITLE),
        });
        results.0.retain(|(known, _)| known != mesh && meshes.contains(*known));
        results.0.push((*mesh, result.clone()));
    }
}

/// Sends a notice that a finished result waits, so that committing it discards no undone step.
pub(super) fn tell_held(mut held: MessageReader<ResultHeld>, mut notices: MessageWriter<Notice>) {
    for ResultHeld { reason, .. } in held.read() {
        notices.write(Notice::warning(reason.sentence()));
    }
}

fn is_cancelled(error: &SkinningError) -> bool {
    *error == SkinningError::Weights(WeightError::Cancelled)
}

/// Name of a mesh for people.
pub(in crate::editor) fn mesh_name(mesh: &RigMesh) -> &str {
    if mesh.file.name.is_empty() { "The mesh" } else { &mesh.file.name }
}

/// Number of points without weights.
fn unweighted(report: &WeightReport) -> usize {
    let held = report.by_surface + report.by_voxels + report.by_fill + report.by_nearest + report.given;
    report.points.saturating_sub(held)
}

/// "100 % of 13380 points have weights", or the number of points without any.
fn covered(points: usize, without: usize) -> String {
    if without == 0 {
        match points {
            1 => "100 % of 1 point has weights".to_owned(),
            _ => format!("100 % of {} have weights", counted(points, "point", "points")),
        }
    } else {
        let have = if without == 1 { "has" } else { "have" };
        format!("{without} of {} {have} no weights", counted(points, "point", "points"))
    }
}

/// The panel.
#[derive(Default)]
pub struct SkinningPanel {
    /// Number of points without weights, for each counted set of weights.
    counted: Vec<(Uid, std::sync::Weak<SkinData>, usize)>,
    held: Vec<parts::HeldObjects>,
}

impl EditorPanel for SkinningPanel {
    fn title(&self) -> &'static str {
        TITLE
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let meshes = world.get::<RigMeshes>(shown.entity);
        let meshes: Vec<Entity> = meshes.iter().flat_map(|meshes| meshes.iter()).collect();
        let running: Vec<&SkinningJob> = meshes.iter().filter_map(|mesh| world.get::<SkinningJob>(*mesh)).collect();
        ScrollArea::vertical().id_salt("skinning").auto_shrink(false).show(ui, |ui| {
            skin_button(ui, &shown, meshes.len(), &running, requests);
            ui.add_space(4.0);
            settings(ui, world, requests);
            let is_alone = meshes.len() == 1;
            for entity in meshes {
                ui.add_space(6.0);
                if let Some(mesh) = world.get::<RigMesh>(entity) {
                    ui.separator();
                    let can_skin = (!is_alone).then_some(running.is_empty() && !shown.rig.is_empty());
                    title(ui, (entity, mesh), can_skin, requests);
                }
                self.mesh(ui, world, entity, &shown);
                if let Some(mesh) = world.get::<RigMesh>(entity) {
                    parts::show(ui, world, mesh, &shown, &mut self.held, requests);
                    findings::show(ui, world, (entity, mesh), &shown, requests);
                }
            }
        });
    }
}

/// Draws the button; while a job runs, its progress and a button that cancels it.
fn skin_button(ui: &mut Ui, shown: &DisplayedRig, meshes: usize, running: &[&SkinningJob], requests: &mut Requests) {
    let size = egui::vec2(ui.available_width(), 34.0);
    if running.is_empty() {
        let obstacle = obstacle(&shown.rig, meshes);
        let button = Button::new(RichText::new("Skin").size(16.0).strong());
        let response = ui.add_enabled_ui(obstacle.is_none(), |ui| ui.add_sized(size, button)).inner;
        let response =
            response.on_hover_text("Compute weights in the background: of the meshes that have none, else of all");
        if response.clicked() {
            requests.send(ActionRequest(Action::Skin));
        }
        if let Some(obstacle) = obstacle {
            ui.weak(obstacle);
        }
        return;
    }
    let progress = running.iter().map(|job| job.progress()).sum::<f32>() / running.len() as f32;
    ui.add(ProgressBar::new(progress).text(format!("{:.0} %", progress * 100.0)).desired_height(20.0));
    if ui.add_sized(egui::vec2(ui.available_width(), 24.0), Button::new("Cancel")).clicked() {
        requests.send(CancelSkinning);
    }
    if !running.iter().all(|job| job.waits()) {
        ui.ctx().request_repaint_after_secs(0.1);
    }
}

/// Draws the name of a mesh and, beside other meshes, a button that binds it alone.
fn title(ui: &mut Ui, (entity, mesh): (Entity, &RigMesh), can_skin: Option<bool>, requests: &mut Requests) {
    let name = mesh_name(mesh);
    let Some(can) = can_skin else {
        ui.strong(name);
        return;
    };
    ui.horizontal_wrapped(|ui| {
        ui.strong(name);
        let button = ui.add_enabled(can, Button::new("Skin it alone").small());
        let button = button.on_hover_text("Compute the weights of this mesh; the others keep theirs");
        let button = button.on_disabled_hover_text("There are no joints, or weights are being computed");
        let said = format!("Skin {name} alone");
        button.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, can, &said));
        if button.clicked() {
            requests.send(SkinMesh(entity));
        }
    });
}

/// Draws the settings of the computation, folded by default.
fn settings(ui: &mut Ui, world: &World, requests: &mut Requests) {
    let current = world.get_resource::<SkinningSettings>().cloned().unwrap_or_default();
    let mut next = current.clone();
    CollapsingHeader::new("Settings").show(ui, |ui| {
        fields::labelled(ui, "Method", |ui| {
            let names = [(Method::Auto, "Automatic"), (Method::Heat, "Heat"), (Method::Voxel, "Voxels")];
            let name = names.iter().find(|(method, _)| *method == next.0.method).map_or("", |(_, name)| name);
            let combo = ComboBox::from_id_salt("method").selected_text(name).width(ui.available_width()).truncate();
            let combo = combo.show_ui(ui, |ui| {
                for (method, name) in names {
                    ui.selectable_value(&mut next.0.method, method, name);
                }
            });
            fields::named(ui, combo.response.id, "Method");
        });
        fields::labelled(ui, "Smoothing", |ui| {
            ui.spacing_mut().slider_width = (ui.available_width() - 52.0).max(30.0);
            let typed = TypedText::default();
            let slider = Slider::new(&mut next.0.smoothing, 0.25..=4.0).logarithmic(true).max_decimals(2);
            let slider = slider.update_while_editing(false).custom_parser(typed.reader(0.25..=4.0, ""));
            let field = fields::typed_field(ui, "Smoothing", slider);
            let field = field.on_hover_text("Width of the blend between joints: 1 is usual, less is stiffer");
            typed.tell(&field, "Smoothing", requests);
        });
        fields::labelled(ui, "Influences", |ui| {
            let typed = TypedText::default();
            let field = DragValue::new(&mut next.0.max_influences).range(1..=16).speed(0.05);
            let field = field.update_while_editing(false).custom_parser(typed.whole_reader(1.0..=16.0, ""));
            let field = fields::typed_field(ui, "Influences", field);
            typed.tell(&field, "Influences", requests);
            field.on_hover_text("The largest number of joints that move one point; many games allow 4");
        });
        fields::labelled(ui, "Parts", |ui| {
            let field = Checkbox::new(&mut next.0.stiff_parts, "stiff");
            ui.add(field)
                .on_hover_text("Parts that one joint holds (helmets, swords, eyes) move as one; off: they bend");
        });
        fields::labelled(ui, "Voxels", |ui| {
            let typed = TypedText::default();
            let field = DragValue::new(&mut next.0.voxel_resolution).range(32..=1024).speed(2.0);
            let field = field.update_while_editing(false).custom_parser(typed.whole_reader(32.0..=1024.0, ""));
            let field = fields::typed_field(ui, "Voxels", field);
            typed.tell(&field, "Voxels", requests);
            field.on_hover_text("Voxels along the longest side, where voxels are used");
        });
        if next.0 != WeightSettings::default() && ui.button("Defaults").clicked() {
            next = SkinningSettings::default();
        }
    });
    if next != current {
        requests.set(next);
    }
}

impl SkinningPanel {
    /// Draws the coverage of one mesh, and the sources of its points' weights.
    fn mesh(&mut self, ui: &mut Ui, world: &World, entity: Entity, shown: &DisplayedRig) {
        let Some(mesh) = world.get::<RigMesh>(entity) else { return };
        let points = mesh.rest.points.len();
        let Some(skin) = shown.rig.skin(mesh.uid) else {
            ui.weak(format!("Not skinned ({})", counted(points, "point", "points")));
            self.failure(ui, world, entity);
            return;
        };
        if !is_held(&shown.rig, world.get::<BuildResult>(shown.entity).map(|built| &*built.0), skin) {
            let text = "The joints of its weights are gone: undo, or make joints and skin again.";
            ui.colored_label(ui.visuals().warn_fg_color, text);
            return;
        }
        let without = self.without_weights(mesh.uid, skin) + points.saturating_sub(skin.weights.len());
        let good = without == 0;
        let (symbol, color) = super::log::severity_symbol(ui, if good { Severity::Done } else { Severity::Warning });
        ui.horizontal_wrapped(|ui| {
            ui.colored_label(color, symbol);
            ui.label(covered(points, without));
        });
        self.failure(ui, world, entity);
        if let Some(Ok(report)) = world.get_resource::<SkinningResults>().and_then(|results| results.get(entity)) {
            for note in notes(&report.weights) {
                ui.weak(note);
            }
        }
        if !skin.at_rest {
            ui.weak("Weights as they came with the file");
        }
        if let Some(note) = unbound(&shown.rig, skin) {
            ui.weak(note);
        }
    }

    fn failure(&self, ui: &mut Ui, world: &World, mesh: Entity) {
        let result = world.get_resource::<SkinningResults>().and_then(|results| results.get(mesh));
        if let Some(Err(error)) = result.filter(|result| !result.as_ref().is_err_and(is_cancelled)) {
            ui.colored_label(ui.visuals().error_fg_color, error.to_string());
        }
    }

    /// Counts points without weights, once for each set of weights.
    fn without_weights(&mut self, mesh: Uid, skin: &std::sync::Arc<SkinData>) -> usize {
        let same = |known: &std::sync::Weak<SkinData>| std::ptr::eq(known.as_ptr(), std::sync::Arc::as_ptr(skin));
        if let Some((.., count)) = self.counted.iter().find(|(uid, known, _)| *uid == mesh && same(known)) {
            return *count;
        }
        let count = skin.weights.starts.windows(2).filter(|ends| ends[0] == ends[1]).count();
        self.counted.retain(|(uid, known, _)| *uid != mesh && known.strong_count() > 0);
        self.counted.push((mesh, std::sync::Arc::downgrade(skin), count));
        count
    }
}

/// True for a mesh that nothing moves: without weights for joints that the rig has, and with objects that hang on no joint.
pub(in crate::editor) fn needs_weights(rig: &Rig, built: Option<&BuiltRig>, mesh: &RigMesh) -> bool {
    match rig.skin(mesh.uid) {
        Some(skin) => skin.weights.is_empty() || !is_held(rig, built, skin),
        None => mesh.file.objects.iter().any(|object| object.node.is_none()),
    }
}

/// True if a rig has a joint of some weights, its own or one that commands created.
pub(in crate::editor) fn is_held(rig: &Rig, built: Option<&BuiltRig>, skin: &SkinData) -> bool {
    let is_there = |joint: &Uid| rig.joint(*joint).is_some() || built.is_some_and(|built| built.node(*joint).is_some());
    skin.joints.iter().any(is_there)
}

/// Sources of the points' weights that deserve a look.
fn notes(report: &WeightReport) -> Vec<String> {
    let share = |count: usize| 100.0 * count as f64 / report.points.max(1) as f64;
    let kinds = [
        (report.by_surface, "by heat on the surface"),
        (report.by_voxels, "through voxels"),
        (report.by_fill, "from their neighbours"),
        (report.by_nearest, "by the nearest bone alone: look at them"),
        (report.given, "given"),
        (report.stiff, "in parts that move as one"),
    ];
    kinds
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, how)| format!("{} % {how}", fields::short(share(*count), 1)))
        .collect()
}

/// Note about joints added after skinning, which have no weights yet.
fn unbound(rig: &Rig, skin: &SkinData) -> Option<String> {
    let bound: std::collections::HashSet<Uid> = skin.joints.iter().copied().collect();
    let mut missing = rig.walk().filter(|joint| joint.data.kind == NodeKind::Joint && !bound.contains(&joint.data.uid));
    let first = missing.next()?;
    let more = missing.count();
    let name = joint_name(&first.data);
    Some(match more {
        0 => format!("{name} was added after skinning and moves nothing: skin again"),
        more => format!("{name} and {more} more were added after skinning and move nothing: skin again"),
    })
}
