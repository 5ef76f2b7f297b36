//! Drawing: rigs over their meshes, what tools are about to make, the grid.
//!
//! A rig's picture is one mesh of coloured triangles, built on the processor for the view of the [`RigViewport`]
//! camera. Its vertices name their depth themselves, in a part of the depth buffer that is in front of everything else:
//! so bones hide each other properly and are never hidden by the mesh, without a second camera and its passes. The
//! picture is built again only when the rig, its pose, what is selected or hovered, the view or [`RigDrawing`] changed.
//!
//! Sizes in pixels are logical pixels. Where several cameras are marked, the first one active by order counts.

pub mod ghosts;
pub mod grid;
pub mod ink;
pub mod labels;
pub mod material;
pub mod shapes;
pub mod skeleton;
mod systems;
pub mod theme;

use bevy::{asset::AssetEventSystems, camera::CameraUpdateSystems, camera::visibility::VisibilitySystems, prelude::*};

pub use ghosts::{GhostJoint, Ghosts};
pub use labels::{LETTER, LabelWish, label_places};
pub use theme::{BACKGROUND, Theme};

use super::RigSystems;
#[cfg(doc)]
use super::viewport::RigViewport;

/// Adds the drawing of rigs. Works without a renderer, too, building pictures that nobody sees.
pub struct DrawingPlugin;

impl Plugin for DrawingPlugin {
    fn build(&self, app: &mut App) {
        material::add_material(app);
        app.init_resource::<RigDrawing>()
            .init_resource::<Ghosts>()
            .init_resource::<DrawingCounts>()
            .init_resource::<systems::Looks>()
            .configure_sets(
                PostUpdate,
                DrawingSystems
                    .after(TransformSystems::Propagate)
                    .after(CameraUpdateSystems)
                    .after(RigSystems::Surface)
                    // The renderer takes a picture's data once: a change must be told in the frame in which it is made.
                    .before(AssetEventSystems)
                    .before(VisibilitySystems::VisibilityPropagate),
            )
            .add_systems(
                PostUpdate,
                (
                    systems::frame_planes,
                    systems::draw_rigs,
                    systems::draw_ghosts,
                    systems::draw_planes,
                    systems::draw_grid,
                )
                    .chain()
                    .in_set(DrawingSystems),
            );
    }
}

/// Where pictures of rigs are built: in `PostUpdate`, after transforms have propagated and before visibility is worked
/// out.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DrawingSystems;

/// What is drawn, and how.
#[derive(Resource, Debug, Clone, PartialEq)]
pub struct RigDrawing {
    /// The rigs.
    pub rig: bool,
    /// Labels of which joints.
    pub labels: LabelChoice,
    /// Whether this plugin writes the labels itself, with lines; false where a window paints [`RigLabels`] with letters.
    pub write_labels: bool,
    /// The local axes of selected joints.
    pub axes: bool,
    /// The ground grid and the world's axes.
    pub grid: bool,
    /// The symmetry plane of rigs with live mirroring.
    pub plane: bool,
    /// Multiplies the size of joint balls; 1 is usual.
    pub ball_scale: f32,
    /// Colours.
    pub theme: Theme,
}

impl Default for RigDrawing {
    fn default() -> Self {
        Self {
            rig: true,
            labels: LabelChoice::None,
            write_labels: true,
            axes: false,
            grid: true,
            plane: true,
            ball_scale: 1.0,
            theme: Theme::default(),
        }
    }
}

/// Which joints have their labels shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LabelChoice {
    /// None.
    #[default]
    None,
    /// Those selected and the one hovered.
    Selected,
    /// As many as there is room for, those selected first.
    All,
}

/// The labels of a rig where they are to be painted: pixels from the viewport's top left corner to the left end and
/// half the height of each text. On every rig that has been drawn; empty while [`RigDrawing::labels`] is off.
#[derive(Component, Debug, Clone, PartialEq, Default)]
pub struct RigLabels(pub Vec<(Vec2, String)>);

/// How often pictures were built: to see that idle frames build none.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DrawingCounts {
    /// Rigs.
    pub rigs: u64,
    /// Ghosts.
    pub ghosts: u64,
    /// Symmetry planes.
    pub planes: u64,
    /// The grid.
    pub grid: u64,
}
