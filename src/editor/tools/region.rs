//! Region tool: faces of a mesh are chosen, for a fit of a part of the mesh.
//!
//! While it is open it has the pointer in every mode: a click takes a connected piece, a drag the faces in a box, through the
//! mesh; Shift adds, Ctrl takes away. Faces are those at rest, which a fit sees.

use std::{collections::BTreeSet, sync::Arc};

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    Tool, ToolPointer, ToolSystems,
    paint::PaintMeshes,
    scene::{EditedRig, Scene},
};
use crate::{
    editor::{
        camera::ViewportSight,
        panel::{PanelApp, ViewportPainter},
        pointer::{ModifierKeys, PointerAct},
    },
    plugins::{
        fit::region::{middle, triangle_pieces},
        surface::RigMesh,
        viewport::Sight,
    },
};

/// Plugin of the region tool.
pub struct RegionPlugin;

impl Plugin for RegionPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<RegionTool>()
            .add_systems(Update, choose.in_set(ToolSystems::Tools))
            .add_painter(RegionPainter);
    }
}

/// State of the region tool.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct RegionTool {
    /// The chosen faces; `None` while the tool is closed.
    pub faces: Option<ChosenFaces>,
    /// Opposite corners of the box that is being dragged, in pixels of the viewport.
    pub band: Option<[Vec2; 2]>,
    press: Option<Vec2>,
}

/// Faces of a mesh, and the skeleton to fit into them.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenFaces {
    /// Entity of the rig.
    pub rig: Entity,
    /// Entity of the mesh.
    pub mesh: Entity,
    /// Triangles of the mesh, by their numbers.
    pub triangles: Arc<BTreeSet<u32>>,
    /// Skeleton to fit.
    pub skeleton: RegionSkeleton,
}

/// Skeleton that is fitted into chosen faces.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RegionSkeleton {
    /// The selected joints of the rig, with those below them.
    Selected,
    /// Part of the library, by its name or file; it is added below the selected joint.
    Part(String),
}

impl RegionTool {
    /// The tool, open on a mesh without chosen faces.
    pub fn open(rig: Entity, mesh: Entity, skeleton: RegionSkeleton) -> Self {
        Self::with(ChosenFaces { rig, mesh, triangles: default(), skeleton })
    }

    /// The tool, open with chosen faces.
    pub fn with(faces: ChosenFaces) -> Self {
        Self { faces: Some(faces), ..Self::default() }
    }

    /// True while the tool has the pointer.
    pub fn is_open(&self) -> bool {
        self.faces.is_some()
    }
}

impl ChosenFaces {
    /// Takes triangles in place of the chosen ones; with Shift besides them, with Ctrl from them.
    pub fn take(&mut self, taken: impl IntoIterator<Item = u32>, held: ModifierKeys) {
        let triangles = Arc::make_mut(&mut self.triangles);
        if held.control {
            taken.into_iter().for_each(|triangle| {
                triangles.remove(&triangle);
            });
            return;
        }
        if !held.shift {
            triangles.clear();
        }
        triangles.extend(taken);
    }
}

/// Pieces of the mesh under the last click.
struct PieceCache {
    triangles: Arc<[[u32; 3]]>,
    pieces: Vec<u32>,
}

fn choose(
    mut tool: ResMut<RegionTool>,
    mut pointers: MessageReader<ToolPointer>,
    (scene, under): (Scene, PaintMeshes),
    meshes: Query<&RigMesh>,
    mut known: Local<Option<PieceCache>>,
) {
    let is_of_rig = |rig: &EditedRig, faces: &ChosenFaces| rig.entity == faces.rig && meshes.contains(faces.mesh);
    let (rig, sight) = match (scene.rig(), scene.sight()) {
        (Some(rig), Some(sight)) if tool.faces.as_ref().is_some_and(|faces| is_of_rig(&rig, faces)) => (rig, sight),
        (rig, _) => {
            pointers.clear();
            // Another document was opened, or the mesh was closed.
            let is_stale = |faces: &ChosenFaces| rig.as_ref().is_none_or(|rig| !is_of_rig(rig, faces));
            if tool.faces.as_ref().is_some_and(is_stale) {
                *tool = RegionTool::default();
            }
            *known = None;
            return;
        }
    };
    for ToolPointer { tool: who, pointer } in pointers.read() {
        if *who != Tool::Region {
            continue;
        }
        match pointer.act {
            PointerAct::Pressed => tool.press = Some(pointer.at),
            PointerAct::Dragged => tool.band = tool.press.map(|press| [press, pointer.at]),
            PointerAct::Released { dragged, .. } => {
                let band = tool.band.take();
                let Some(press) = tool.press.take() else { continue };
                let Some(faces) = &mut tool.faces else { continue };
                match band.filter(|_| dragged) {
                    Some(band) => {
                        let boxed = meshes.get(faces.mesh).map(|mesh| faces_in(mesh, &sight, band));
                        faces.take(boxed.unwrap_or_default(), pointer.held);
                    }
                    None => click(faces, (&rig, &under, &sight, press), &meshes, pointer.held, &mut known),
                }
            }
            PointerAct::Moved | PointerAct::Left | PointerAct::Wheel(_) => {}
        }
    }
}

/// Takes the piece under the pointer, of whichever mesh of the rig; beside all of them nothing, in place of what was chosen.
fn click(
    faces: &mut ChosenFaces,
    (rig, under, sight, at): (&EditedRig, &PaintMeshes, &Sight, Vec2),
    meshes: &Query<&RigMesh>,
    held: ModifierKeys,
    known: &mut Option<PieceCache>,
) {
    let Ok(place) = under.at(rig, sight, at) else {
        faces.take([], held);
        return;
    };
    let Ok(mesh) = meshes.get(place.mesh) else { return };
    if faces.mesh != place.mesh {
        (faces.mesh, faces.triangles) = (place.mesh, default());
    }
    if known.as_ref().is_none_or(|known| !Arc::ptr_eq(&known.triangles, &mesh.triangles)) {
        *known = Some(PieceCache { triangles: mesh.triangles.clone(), pieces: triangle_pieces(mesh) });
    }
    let Some(PieceCache { pieces, .. }) = known.as_ref() else { return };
    let Some(piece) = pieces.get(place.triangle as usize) else { return };
    let same = pieces.iter().enumerate().filter(|(_, other)| *other == piece).map(|(number, _)| number as u32);
    faces.take(same, held);
}

/// Triangles whose middle is in a box of the viewport.
fn faces_in(mesh: &RigMesh, sight: &Sight, [a, b]: [Vec2; 2]) -> Vec<u32> {
    let (low, high) = (a.min(b), a.max(b));
    let is_inside = |corners: &[u32; 3]| {
        let pixel = middle(&mesh.rest.points, corners).and_then(|place| sight.project(place));
        pixel.is_some_and(|pixel| pixel.cmpge(low).all() && pixel.cmple(high).all())
    };
    let inside = mesh.triangles.iter().enumerate().filter(|(_, corners)| is_inside(corners));
    inside.map(|(number, _)| number as u32).collect()
}

/// Largest number of chosen triangles that are painted; of more, some are left out.
const MOST_PAINTED: usize = 6000;

/// Painter of the chosen faces and of the box that is being dragged.
struct RegionPainter;

impl ViewportPainter for RegionPainter {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        let Some(tool) = world.get_resource::<RegionTool>() else { return };
        let color = egui::Color32::from_rgb(90, 200, 250);
        let place = |at: Vec2| area.min + egui::vec2(at.x, at.y);
        let sight = world.get_resource::<ViewportSight>().and_then(|sight| sight.0);
        if let (Some(faces), Some(sight)) = (&tool.faces, sight)
            && let Some(mesh) = world.get::<RigMesh>(faces.mesh)
        {
            let mut shape = egui::Mesh::default();
            let step = faces.triangles.len().div_ceil(MOST_PAINTED).max(1);
            for number in faces.triangles.iter().step_by(step) {
                let Some(corners) = mesh.triangles.get(*number as usize) else { continue };
                let pixel = |corner: u32| sight.project(*mesh.rest.points.get(corner as usize)?);
                let [Some(a), Some(b), Some(c)] = corners.map(pixel) else { continue };
                let first = shape.vertices.len() as u32;
                [a, b, c].iter().for_each(|at| shape.colored_vertex(place(*at), color.gamma_multiply(0.3)));
                shape.add_triangle(first, first + 1, first + 2);
            }
            painter.add(shape);
        }
        if let Some([a, b]) = tool.band {
            let band = egui::Rect::from_two_pos(place(a), place(b));
            painter.rect_stroke(band, 0.0, egui::Stroke::new(1.0, color), egui::StrokeKind::Inside);
        }
    }
}
