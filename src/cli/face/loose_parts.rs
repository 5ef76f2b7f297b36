//! Report of the loose parts of a head: eyes, teeth, tongue, lashes and hair, and what each of them follows.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::json;

use crate::{
    algo::face::{bones::FaceBoneKind, shells::ShellKind},
    cli::{
        binding::{JointNames, shortened},
        report::{Report, counted},
    },
    headless::Workbench,
    plugins::{
        face::FaceReport,
        skinning::{MeshPart, MeshParts},
    },
};

/// Name of the skin, in the place of a joint, for parts that ride along with it.
const SKIN: &str = "skin";
/// Least share of facial bones in a part that rides along with the skin.
const LEAST: f32 = 0.02;

/// Weights of a part of the head.
#[derive(Default)]
struct PartWeights {
    points: usize,
    /// Points that belong to the outer surface.
    surface: usize,
    /// Sum of the weights of each joint, by its number in the weights.
    sums: BTreeMap<u32, f32>,
}

/// Reports what each part of the head follows, but for the face itself.
pub(super) fn describe(report: &mut Report, bench: &Workbench, placed: &FaceReport) {
    let (Some(face), Some(mesh), Some(skin)) = (bench.placed_face(), bench.mesh(), bench.weights()) else { return };
    let (analysis, parts) = (&face.analysis, MeshParts::new(mesh));
    let mut found: BTreeMap<MeshPart, PartWeights> = BTreeMap::new();
    for of_head in 0..analysis.points.len() {
        let point = analysis.mesh_point(of_head);
        let Some(part) = parts.at(point).filter(|_| point < skin.weights.len()) else { continue };
        let part = found.entry(part).or_default();
        part.points += 1;
        part.surface += usize::from(analysis.shells.kind(of_head) == ShellKind::Skin);
        for (joint, value) in skin.weights.of(point) {
            *part.sums.entry(joint).or_default() += value;
        }
    }
    let itself = found.iter().max_by_key(|(_, part)| part.surface).map(|(part, _)| *part);
    found.retain(|part, _| Some(*part) != itself);
    let names = JointNames::new(bench);
    let facial = placed.bones.iter().filter(|bone| bone.kind == FaceBoneKind::Skin);
    let facial: BTreeSet<&str> = facial.map(|bone| bone.label.as_str()).collect();
    let followed = |part: &PartWeights| {
        let label = |joint: u32| skin.joints.get(joint as usize).map(|uid| names.of(*uid)).unwrap_or_default();
        let of_skin: f32 =
            part.sums.iter().filter(|(joint, _)| facial.contains(label(**joint).as_str())).map(|(_, sum)| sum).sum();
        if of_skin > LEAST * part.points as f32 {
            return SKIN.to_owned();
        }
        let most = part.sums.iter().max_by(|a, b| a.1.total_cmp(b.1));
        most.map(|(joint, _)| label(*joint)).unwrap_or_default()
    };
    // Strands of hair are told as their object, unless the face is in it.
    let face_object = itself.and_then(|part| parts.object(part));
    let told = |part: MeshPart| parts.object(part).filter(|object| Some(*object) != face_object).unwrap_or(part);
    let mut grouped: BTreeMap<(MeshPart, String), usize> = BTreeMap::new();
    for (part, weights) in &found {
        *grouped.entry((told(*part), followed(weights))).or_default() += weights.points;
    }
    let mut lines: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut list = Vec::new();
    for ((part, joint), points) in grouped {
        let name = parts.name(part);
        list.push(json!({ "part": name, "points": points, "follows": joint }));
        lines.entry(joint).or_default().push(format!("{name} ({})", counted(points, "point", "points")));
    }
    report.set_list("parts", list);
    for (joint, parts) in lines {
        let parts = shortened(parts.into_iter());
        report.line(match joint.as_str() {
            SKIN => format!("riding along with the skin: {parts}"),
            joint => format!("following {joint}: {parts}"),
        });
    }
}
