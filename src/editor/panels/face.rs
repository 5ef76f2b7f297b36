//! Face panel: number of bones, grouping of the head, and expressions.

mod dendrogram;
mod expressions;
mod thumbnail;

use std::{collections::BTreeMap, ops::RangeInclusive, sync::Arc};

use bevy::prelude::*;
use bevy_egui::egui::{self, Button, CollapsingHeader, DragValue, ProgressBar, RichText, ScrollArea, Slider, Ui};

use super::{
    displayed_rig::{DisplayedRig, Stamp},
    fields::{self, TypedText},
    list,
    log::LogSystems,
    weights::meshes::choose,
};
use crate::{
    algo::face::{
        auto::{AutoSettings, FaceError},
        bones::{FaceBoneKind, Region},
    },
    editor::{
        counts::counted,
        notice::Notice,
        panel::{EditorPanel, Requests},
    },
    mesh::shapes::Shapes,
    plugins::{
        RigSystems,
        document::EditRequest,
        face::{
            BackgroundPosing, ExpressionAnswer, Face, FaceExpressions, FaceJob, FacePlaced, FaceReport, FaceRequest,
            FaceRig, PlaceFaceError, cut_of, with_cut,
        },
        picking::{Pick, PickRequest},
        surface::{RigMesh, RigMeshes},
    },
    rig::{FaceCut, RigEdit, Uid, operations::Operation},
};

/// Plugin of the face panel: reports results of face jobs, and cancels jobs. Poses of expressions are computed in the background.
pub struct FacePanelPlugin;

impl Plugin for FacePanelPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<FaceResults>()
            .init_resource::<BackgroundPosing>()
            .add_message::<CancelFace>()
            .add_message::<FacePlaced>()
            .add_message::<ExpressionAnswer>()
            .add_message::<Notice>()
            .add_systems(Update, cancel.after(RigSystems::Build).before(RigSystems::Bind))
            .add_systems(Last, tell_results.before(LogSystems));
    }
}

/// Last report of each mesh.
#[derive(Resource, Debug, Default)]
pub struct FaceResults(Vec<(Entity, FaceReport)>);

impl FaceResults {
    /// The last report for a mesh.
    pub fn get(&self, mesh: Entity) -> Option<&FaceReport> {
        self.0.iter().find(|(known, _)| *known == mesh).map(|(_, report)| report)
    }
}

/// Request to cancel the face job of a mesh; the rig stays unchanged.
#[derive(Message, Debug, Clone, Copy)]
pub struct CancelFace(pub Entity);

fn cancel(mut requests: MessageReader<CancelFace>, jobs: Query<&FaceJob>) {
    requests.read().filter_map(|request| jobs.get(request.0).ok()).for_each(FaceJob::cancel);
}

fn tell_results(
    mut placed: MessageReader<FacePlaced>,
    mut expressed: MessageReader<ExpressionAnswer>,
    meshes: Query<&RigMesh>,
    mut results: ResMut<FaceResults>,
    mut commands: Commands,
) {
    for FacePlaced { mesh, result } in placed.read() {
        match result {
            Ok(report) => {
                commands.write_message(Notice::done(summary(report)));
                if report.is_part {
                    let text = "The mesh is more than a head: the face was placed in its head part. \
                                Tick \"Whole mesh\" in the Face panel to take all of it for a head.";
                    commands.write_message(Notice::info(text).at("Face"));
                }
                if !report.certain {
                    let text = "Which way the head looks is a weak guess. Choose up and forward in the Face panel.";
                    commands.write_message(Notice::warning(text).at("Face"));
                }
                results.0.retain(|(known, _)| known != mesh && meshes.contains(*known));
                results.0.push((*mesh, report.clone()));
            }
            Err(PlaceFaceError::Face(FaceError::Cancelled)) => {
                commands.write_message(Notice::info("Placing the face was cancelled. The rig is as it was."));
            }
            Err(error) => {
                commands.write_message(Notice::error(format!("No face was placed: {error}.")).at("Face"));
            }
        }
    }
    for ExpressionAnswer { result, .. } in expressed.read() {
        if let Err(error) = result {
            commands.write_message(Notice::error(format!("The face shows nothing: {error}.")));
        }
    }
}

fn summary(report: &FaceReport) -> String {
    let skin = report.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin).count();
    let sum: f64 = report.times.iter().map(|(_, time)| time.as_secs_f64() * 1000.0).sum();
    let kept = match report.kept {
        0 => String::new(),
        1 => ", 1 of them kept as it was".to_owned(),
        more => format!(", {more} of them kept as they were"),
    };
    let fitted =
        report.fit_error.map_or(String::new(), |error| format!("; the shapes are met to {error:.4} on average"));
    format!("{} in {sum:.0} ms{kept}{fitted}.", counted(skin, "facial bone", "facial bones"))
}

/// Largest seed that people type: beyond it not every whole number is one of its kind.
const MOST_SEED: f64 = 9_007_199_254_740_992.0;

/// Numbers of bones of the facial skin that people choose from.
const DENSITIES: RangeInclusive<usize> = 4..=150;

/// The panel.
#[derive(Default)]
pub struct FacePanel {
    /// Mesh whose face is shown; without a choice, the first one with a face.
    chosen: Option<Uid>,
    settings: AutoSettings,
    shown: Option<FaceData>,
    /// Strengths while a slider is dragged.
    held: Option<expressions::HeldStrengths>,
    /// A face was being placed in the last frame.
    is_placing: bool,
}

/// Data of the face in one state of the rig.
struct FaceData {
    mesh: Entity,
    stamp: Stamp,
    known: FaceRig,
    /// Density and grouping of the document.
    cut: Option<FaceCut>,
    pictures: thumbnail::Pictures,
}

/// Mesh whose face the panel shows, in its rig.
#[derive(Clone, Copy)]
struct FaceTarget<'a, 'w> {
    world: &'a World,
    shown: &'a DisplayedRig<'w>,
    entity: Entity,
    /// Uid of the mesh in the document.
    mesh: Uid,
}

impl EditorPanel for FacePanel {
    fn title(&self) -> &'static str {
        "Face"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let meshes = world.get::<RigMeshes>(shown.entity);
        let meshes: Vec<Entity> = meshes.map(|meshes| meshes.iter().collect()).unwrap_or_default();
        let Some((entity, mesh)) = self.mesh(ui, world, &shown, meshes) else {
            return list::nothing(ui, "Open a head, or a character with one, to place a face in it.");
        };
        self.renew(&shown, (entity, mesh.uid), world.get::<Face>(entity));
        ScrollArea::vertical().id_salt("face").auto_shrink(false).show(ui, |ui| {
            let target = FaceTarget { world, shown: &shown, entity, mesh: mesh.uid };
            self.place(ui, &target, requests);
            ui.add_space(4.0);
            self.options(ui, &target, requests);
            let Some(drawn) = self.shown.as_mut().filter(|drawn| !drawn.known.bones.is_empty()) else {
                return;
            };
            ui.separator();
            regions(ui, &shown, &drawn.known, world.get::<Face>(entity), requests);
            ui.separator();
            expressions::show(
                ui,
                world,
                (shown.entity, &shown.rig),
                (entity, mesh),
                (&mut drawn.pictures, &mut self.held),
                requests,
            );
            ui.separator();
            fit(ui, entity, mesh, &self.settings, requests);
        });
    }
}

impl FacePanel {
    /// The mesh that was chosen, else the first one with a face, else the first one; draws the choice where there are several.
    fn mesh<'w>(
        &mut self,
        ui: &mut Ui,
        world: &'w World,
        shown: &DisplayedRig,
        meshes: Vec<Entity>,
    ) -> Option<(Entity, &'w RigMesh)> {
        let meshes: Vec<(Entity, &RigMesh)> =
            meshes.into_iter().filter_map(|entity| Some((entity, world.get::<RigMesh>(entity)?))).collect();
        let has_face = |entity: Entity, mesh: &RigMesh| {
            world.get::<Face>(entity).is_some() || shown.rig.face_cut(mesh.uid).is_some()
        };
        let chosen = meshes.iter().find(|(_, mesh)| Some(mesh.uid) == self.chosen);
        let first = || meshes.iter().find(|(entity, mesh)| has_face(*entity, mesh)).or_else(|| meshes.first());
        let (mut entity, mut mesh) = *chosen.or_else(first)?;
        if meshes.len() > 1 {
            let mut next = mesh.uid;
            choose(ui, "Mesh", meshes.iter().map(|(_, mesh)| *mesh), &mut next);
            if let Some(other) = meshes.iter().find(|(_, mesh)| mesh.uid == next).filter(|_| next != mesh.uid) {
                (entity, mesh) = *other;
                self.chosen = Some(next);
                (self.held, self.is_placing) = (None, false);
            }
        }
        Some((entity, mesh))
    }

    /// Reads the rig's face again if the rig has changed. The settings go on from the face of a mesh that is shown anew, and
    /// follow the density and grouping of the document.
    fn renew(&mut self, shown: &DisplayedRig, (mesh, uid): (Entity, Uid), face: Option<&Face>) {
        let stamp = shown.stamp();
        if self.shown.as_ref().is_some_and(|drawn| drawn.mesh == mesh && drawn.stamp == stamp) {
            return;
        }
        let known = FaceRig::read(&shown.rig);
        let former = self.shown.take().filter(|drawn| drawn.mesh == mesh);
        let cut = shown.rig.face_cut(uid);
        if let Some(face) = face.filter(|_| former.is_none()) {
            self.settings = face.settings.clone();
        }
        if former.as_ref().is_none_or(|former| former.cut != cut) {
            self.follow(cut, &known);
        }
        let pictures = former.map(|drawn| drawn.pictures).unwrap_or_default();
        self.shown = Some(FaceData { mesh, stamp, known, cut, pictures });
    }

    /// Takes over the density and grouping of the document. Documents of older versions have the bones, not the number that
    /// was asked for.
    fn follow(&mut self, cut: Option<FaceCut>, known: &FaceRig) {
        self.settings = with_cut(std::mem::take(&mut self.settings), cut);
        let density = known.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin).count();
        if cut.is_none() && density > 0 && density.abs_diff(self.settings.bones) * 10 > density {
            self.settings.bones = density;
        }
        self.settings.bones = self.settings.bones.clamp(*DENSITIES.start(), *DENSITIES.end());
    }

    /// Puts density and grouping into the document, as a step, if it has others.
    fn keep_cut(&self, shown: &DisplayedRig, mesh: Uid, requests: &mut Requests) {
        let cut = cut_of(&self.settings);
        if shown.rig.face_cut(mesh) != cut {
            let edits = vec![RigEdit::SetFaceCut(mesh, cut)];
            let operation = Operation::Named { name: "Cut face", edits };
            requests.send(EditRequest::operation(shown.entity, operation));
        }
    }

    /// Draws the button; while a job runs, its progress and a button that cancels it.
    fn place(&mut self, ui: &mut Ui, of: &FaceTarget, requests: &mut Requests) {
        let FaceTarget { world, shown, entity, mesh } = *of;
        let size = egui::vec2(ui.available_width(), 34.0);
        let was_placing = std::mem::replace(&mut self.is_placing, world.get::<FaceJob>(entity).is_some());
        if let Some(job) = world.get::<FaceJob>(entity) {
            let step = job.step().map_or("", |step| step.name()).replace('_', " ");
            let text = format!("{step} {:.0} %", job.progress() * 100.0);
            ui.add(ProgressBar::new(job.progress()).text(text).desired_height(20.0));
            if ui.add_sized(egui::vec2(ui.available_width(), 24.0), Button::new("Cancel")).clicked() {
                requests.send(CancelFace(entity));
            }
            if !job.waits() {
                ui.ctx().request_repaint_after_secs(0.05);
            }
            return;
        }
        // A face that was not placed leaves the density of the document.
        let is_other = |drawn: &FaceData, settings: &AutoSettings| drawn.cut != cut_of(settings);
        if let Some(drawn) = self.shown.take_if(|drawn| was_placing && is_other(&*drawn, &self.settings)) {
            self.follow(drawn.cut, &drawn.known);
            self.shown = Some(drawn);
        }
        let again = self.shown.as_ref().is_some_and(|drawn| !drawn.known.bones.is_empty());
        let button = Button::new(RichText::new(if again { "Place again" } else { "Place face" }).size(16.0).strong());
        let hint = "Head, neck and facial bones, weights and controls; bones you have touched stay";
        if ui.add_sized(size, button).on_hover_text(hint).clicked() {
            requests.send(FaceRequest { mesh: entity, settings: self.settings.clone(), fit: None });
        }
        fields::labelled(ui, "Bones", |ui| {
            ui.spacing_mut().slider_width = (ui.available_width() - 52.0).max(30.0);
            let typed = TypedText::default();
            let slider = Slider::new(&mut self.settings.bones, DENSITIES).logarithmic(true).update_while_editing(false);
            let ends = *DENSITIES.start() as f64..=*DENSITIES.end() as f64;
            let slider = fields::typed_field(ui, "Bones", slider.custom_parser(typed.whole_reader(ends, "")));
            let slider = slider.on_hover_text("Density: bones of the facial skin");
            let is_dropped = typed.is_refused() || ui.input(|input| input.key_pressed(egui::Key::Escape));
            typed.tell(&slider, "Bones", requests);
            // Releasing the slider is enough: an existing face is placed again with the new density, in one step with it.
            let is_released = slider.drag_stopped() || slider.lost_focus() && !is_dropped;
            if is_released && again {
                requests.send(FaceRequest { mesh: entity, settings: self.settings.clone(), fit: None });
            } else if is_released {
                self.keep_cut(shown, mesh, requests);
            }
        });
    }

    /// Draws the settings, folded by default, with the merge history.
    fn options(&mut self, ui: &mut Ui, of: &FaceTarget, requests: &mut Requests) {
        let FaceTarget { world, shown, entity, mesh } = *of;
        CollapsingHeader::new("Settings").show(ui, |ui| {
            fields::labelled(ui, "Seed", |ui| {
                let typed = TypedText::default();
                let field = DragValue::new(&mut self.settings.seed).speed(0.1).update_while_editing(false);
                let field = field.custom_parser(typed.whole_reader(0.0..=MOST_SEED, ""));
                let field = fields::typed_field(ui, "Seed", field);
                typed.tell(&field, "Seed", requests);
                field.on_hover_text("The same seed gives the same bones");
            });
            ui.checkbox(&mut self.settings.symmetric, "Symmetric").on_hover_text("Pairs of bones on both sides");
            ui.checkbox(&mut self.settings.extras, "Jaw and eyes")
                .on_hover_text("Bones for jaw and eyes besides, where the mesh has them");
            ui.checkbox(&mut self.settings.whole, "Whole mesh")
                .on_hover_text("Take all of the mesh for a head, even if it looks like a body");
            axis(ui, "Up", &mut self.settings.up);
            axis(ui, "Forward", &mut self.settings.forward);
        });
        let Some(face) = world.get::<Face>(entity) else { return };
        CollapsingHeader::new("Grouping").show(ui, |ui| {
            if dendrogram::show(ui, &face.analysis, &mut self.settings.groups, requests) {
                self.keep_cut(shown, mesh, requests);
            }
        });
    }
}

/// Choice of one of the six axes, or of a guess from the mesh.
fn axis(ui: &mut Ui, name: &str, value: &mut Option<Vec3>) {
    let axes =
        [("X", Vec3::X), ("Y", Vec3::Y), ("Z", Vec3::Z), ("-X", Vec3::NEG_X), ("-Y", Vec3::NEG_Y), ("-Z", Vec3::NEG_Z)];
    let text = axes.iter().find(|(_, axis)| *value == Some(*axis)).map_or("Guess", |(name, _)| name);
    fields::labelled(ui, name, |ui| {
        let combo = egui::ComboBox::from_id_salt(name).selected_text(text).width(ui.available_width());
        let combo = combo.show_ui(ui, |ui| {
            ui.selectable_value(value, None, "Guess");
            for (name, axis) in axes {
                ui.selectable_value(value, Some(axis), name);
            }
        });
        fields::named(ui, combo.response.id, &format!("{name} axis of the head"));
    });
}

/// Draws the number of bones in each region; a click selects them.
fn regions(ui: &mut Ui, shown: &DisplayedRig, known: &FaceRig, face: Option<&Face>, requests: &mut Requests) {
    let mut by_region: BTreeMap<&str, Vec<Uid>> = BTreeMap::new();
    match face {
        Some(face) => {
            for (bone, uid) in known.face_bones(&face.analysis).iter().zip(known.bones.iter().map(|bone| bone.uid)) {
                by_region.entry(region_name(bone.kind, bone.region)).or_default().push(uid);
            }
        }
        None => by_region.entry("all").or_default().extend(known.bones.iter().map(|bone| bone.uid)),
    }
    ui.strong("Regions");
    ui.horizontal_wrapped(|ui| {
        for (name, joints) in by_region {
            let selected = joints.iter().all(|joint| shown.selection.0.contains(joint));
            let label = ui.selectable_label(selected, format!("{name} {}", joints.len()));
            if label.on_hover_text("Select these bones").clicked() {
                let add = ui.input(|input| input.modifiers.shift);
                requests.send(PickRequest { rig: shown.entity, what: Pick::Joints(joints), add });
            }
        }
    });
}

fn region_name(kind: FaceBoneKind, region: Region) -> &'static str {
    match (kind, region) {
        (FaceBoneKind::Jaw, _) => "jaw pivot",
        (FaceBoneKind::Tongue, _) => "tongue",
        (FaceBoneKind::Eye, _) | (_, Region::Eye) => "eyes",
        (_, Region::Forehead) => "forehead",
        (_, Region::Brow) => "brow",
        (_, Region::Lid) => "lid",
        (_, Region::Nose) => "nose",
        (_, Region::Cheek) => "cheek",
        (_, Region::Lip) => "lip",
        (_, Region::Jaw) => "jaw",
        (_, Region::Temple) => "temple",
    }
}

/// Moves the bones to fit the morph targets of the mesh's file.
fn fit(ui: &mut Ui, entity: Entity, mesh: &RigMesh, settings: &AutoSettings, requests: &mut Requests) {
    let count: usize = mesh.file.objects.iter().map(|object| object.morph_names.len()).max().unwrap_or(0);
    let text = match count {
        0 => "The mesh has no morph targets to fit".to_owned(),
        count => format!("Moves the bones so that they can show the mesh's {count} morph targets"),
    };
    let button = ui.add_enabled(count > 0, Button::new("Refit to morph targets")).on_hover_text(&text);
    if button.on_disabled_hover_text(&text).clicked() {
        match Shapes::of_morphs(&mesh.file) {
            Ok(shapes) => {
                let settings = settings.clone();
                requests.send(FaceRequest { mesh: entity, settings, fit: Some(Arc::new(shapes)) });
            }
            Err(error) => requests.send(Notice::error(format!("The morph targets cannot be fitted: {error}."))),
        }
    }
}

/// The available expressions.
fn set(world: &World) -> FaceExpressions {
    world.get_resource::<FaceExpressions>().cloned().unwrap_or_default()
}
