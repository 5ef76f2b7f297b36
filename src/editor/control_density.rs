//! Density of controls in the viewport: those that could not be told apart at this distance come when the view is nearer.

use std::collections::BTreeSet;

use bevy::prelude::*;

use super::{ActiveRig, camera::ViewportSight};
use crate::{
    plugins::{
        controls::{
            NodeVisible,
            density::{CrowdedControl, crowded_controls},
            outline::ControlNodes,
            size::ShapeFactor,
        },
        document::Selection,
        schema::{Control, NodeOf, RigNodes},
    },
    rig::Uid,
};

/// Plugin that leaves crowded controls out of the viewport, but for selected ones.
pub struct ControlDensityPlugin;

impl Plugin for ControlDensityPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ViewportSight>().add_systems(PreUpdate, thin_out.after(super::camera::see));
    }
}

/// Control that looks otherwise than in the frame before.
type ControlRedrawn =
    (With<Control>, Or<(Changed<GlobalTransform>, Changed<NodeVisible>, Changed<Control>, Changed<ShapeFactor>)>);

/// Components that decide which controls of a rig are left out.
type DrawnRig = (&'static RigNodes, &'static GlobalTransform, Ref<'static, Selection>);

/// Updates [`CrowdedControl`] where the view, a control or the selection changed.
fn thin_out(
    sight: Res<ViewportSight>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<DrawnRig>,
    redrawn: Query<&NodeOf, ControlRedrawn>,
    controls: ControlNodes,
    known: Query<(&Uid, Option<&CrowdedControl>), With<Control>>,
    mut commands: Commands,
) {
    let (Some(active), Some(seen)) = (active, sight.0) else { return };
    let Ok((nodes, place, selection)) = rigs.get(active.0) else { return };
    let is_other = sight.is_changed() || active.is_changed() || selection.is_changed();
    if !is_other && !redrawn.iter().any(|of| of.0 == active.0) {
        return;
    }
    let outlines = controls.visible_near(Some(nodes), place.affine().inverse());
    let mut crowded: BTreeSet<Uid> = crowded_controls(&outlines, &seen.plane, seen.pixel);
    for node in &selection.0 {
        crowded.remove(node);
    }
    for node in nodes.iter() {
        let Ok((uid, before)) = known.get(node) else { continue };
        let next = crowded.contains(uid);
        if before.is_some_and(|before| before.0) != next {
            commands.entity(node).try_insert(CrowdedControl(next));
        }
    }
}
