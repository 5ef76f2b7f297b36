//! Findings of the last computation: parts that move as one, and joints that hold no skin, each with a choice.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_egui::egui::{CollapsingHeader, Label, RichText, Ui};

use super::{SkinningParts, SkinningResults};
use crate::{
    algo::weights::IdleReason,
    editor::{
        counts::counted,
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{labelled, short},
        },
    },
    plugins::{
        skinning::{MeshPart, PartBinding, SkinningReport},
        surface::RigMesh,
    },
    rig::Uid,
};

/// Joints that claim skin in the next computation of weights although they would be idle.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct SkinningClaims(pub BTreeSet<Uid>);

/// Draws the rigid parts and the idle joints of a mesh's last result, folded.
pub(super) fn show(
    ui: &mut Ui,
    world: &World,
    (entity, mesh): (Entity, &RigMesh),
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    let results = world.get_resource::<SkinningResults>();
    let Some(Ok(report)) = results.and_then(|results| results.get(entity)) else { return };
    rigid_parts(ui, world, mesh, report, shown, requests);
    idle_joints(ui, world, mesh, report, shown, requests);
}

/// Row of a part: the part, its name, and what is known of it.
type PartRow<'a> = (MeshPart, &'a str, String);

fn rigid_parts(
    ui: &mut Ui,
    world: &World,
    mesh: &RigMesh,
    report: &SkinningReport,
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    let rigid = report.rigid_parts.iter().map(|rigid| {
        let note = format!("{} with {}", counted(rigid.points, "point", "points"), shown.name(rigid.joint));
        (rigid.part, rigid.name.as_str(), note)
    });
    let bending = report.bending_parts.iter().map(|(part, name)| (*part, name.as_str(), "bends".to_owned()));
    let mut rows: Vec<PartRow> = rigid.chain(bending).collect();
    rows.sort_by_key(|(part, ..)| *part);
    if rows.is_empty() {
        return;
    }
    let choices = world.get_resource::<SkinningParts>().cloned().unwrap_or_default();
    let mut next = choices.clone();
    CollapsingHeader::new(format!("Rigid parts ({})", rows.len())).id_salt(("rigid", mesh.uid)).show(ui, |ui| {
        for (part, name, note) in rows {
            let key = (mesh.uid, part);
            let was_rigid = next.0.get(&key) != Some(&PartBinding::Bends);
            let mut is_rigid = was_rigid;
            labelled(ui, name, |ui| {
                ui.checkbox(&mut is_rigid, "rigid").on_hover_text("On: the part moves as one; off: it bends");
                ui.add(Label::new(RichText::new(note).weak()).truncate());
            });
            if was_rigid && !is_rigid {
                next.0.insert(key, PartBinding::Bends);
            } else if is_rigid && !was_rigid {
                next.0.remove(&key);
            }
        }
        ui.weak("Choices count when the mesh is skinned again.");
    });
    if next != choices {
        requests.set(next);
    }
}

fn idle_joints(
    ui: &mut Ui,
    world: &World,
    mesh: &RigMesh,
    report: &SkinningReport,
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    let claims = world.get_resource::<SkinningClaims>().cloned().unwrap_or_default();
    let mut rows: Vec<(Uid, String)> = report.idle_joints.iter().map(|idle| (idle.joint, note(idle.reason))).collect();
    let is_idle = |joint: &Uid| report.idle_joints.iter().any(|idle| idle.joint == *joint);
    let holding = claims.0.iter().filter(|joint| shown.rig.joint(**joint).is_some() && !is_idle(joint));
    rows.extend(holding.map(|joint| (*joint, String::new())));
    if rows.is_empty() {
        return;
    }
    let mut next = claims.clone();
    CollapsingHeader::new(format!("Idle joints ({})", rows.len())).id_salt(("idle", mesh.uid)).show(ui, |ui| {
        for (joint, note) in rows {
            let mut is_claiming = next.0.contains(&joint);
            labelled(ui, &shown.name(joint), |ui| {
                let field = ui.checkbox(&mut is_claiming, "claims skin");
                field.on_hover_text("On: the joint holds the skin that lies nearer to it than to other joints");
                ui.add(Label::new(RichText::new(note).weak()).truncate());
            });
            if is_claiming {
                next.0.insert(joint);
            } else {
                next.0.remove(&joint);
            }
        }
        ui.weak("Choices count when the mesh is skinned again.");
    });
    if next != claims {
        requests.set(next);
    }
}

/// Reason why a joint holds no skin, for people.
fn note(reason: IdleReason) -> String {
    match reason {
        IdleReason::Outside { distance } => format!("{} outside of the mesh", short(f64::from(distance), 3)),
        IdleReason::NoSurface => "all skin is of other joints".to_owned(),
        IdleReason::Slot => "carries or steers things, by its name".to_owned(),
        IdleReason::NotDeforming => "does not deform".to_owned(),
        IdleReason::Locked => "locked without weights".to_owned(),
    }
}
