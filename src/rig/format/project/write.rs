//! Writer of projects.

use std::fmt::Write;

use super::{Project, ProjectRig, ProjectView, TemplateReference};
use crate::rig::{
    FaceCut, Rig, SelectionSet,
    animation::NodeNames,
    format::{
        animation::write_clips,
        poses::{write_offsets, write_stored_poses, write_values},
        scan,
    },
    part::DroppedPart,
    template::{quoted, vector, write_without_poses},
};

/// The text of a project. The same project gives the same bytes.
pub fn write_project(project: &Project) -> String {
    let mut out = String::new();
    write_into(&mut out, project).unwrap_or_default();
    out
}

fn write_into(out: &mut String, project: &Project) -> std::fmt::Result {
    let of_rigs = project.rigs.iter().map(|entry| needed_format(&entry.rig)).max().unwrap_or(1);
    let of_templates = project.templates.iter().map(|template| if template.text.is_some() { 7 } else { 3 }).max();
    let of_content = of_rigs.max(of_templates.unwrap_or(1));
    let of_graph = if project.view.graph.is_empty() { 1 } else { 5 };
    let of_clip = if project.view.clip.is_none() { 1 } else { 8 };
    let format = of_content.max(of_graph).max(of_clip);
    writeln!(out, "(\n    format: {format},\n    name: {},", quoted(&project.name))?;
    writeln!(out, "    meshes: [")?;
    for mesh in &project.meshes {
        writeln!(out, "        (\n            uid: \"{}\",\n            rig: \"{}\",", mesh.uid, mesh.rig)?;
        writeln!(out, "            path: {},\n            hash: \"{:032x}\",", quoted(&mesh.path), mesh.hash)?;
        if !mesh.nodes.is_empty() {
            writeln!(out, "            nodes: [")?;
            for node in &mesh.nodes {
                writeln!(out, "                \"{node}\",")?;
            }
            writeln!(out, "            ],")?;
        }
        writeln!(out, "        ),")?;
    }
    writeln!(out, "    ],\n    rigs: [")?;
    for rig in &project.rigs {
        write_rig(out, rig, &project.names)?;
    }
    writeln!(out, "    ],")?;
    if !project.templates.is_empty() {
        writeln!(out, "    templates: [")?;
        for TemplateReference { rig, path, base, text } in &project.templates {
            write!(
                out,
                "        (\n            rig: \"{rig}\",\n            path: {},\n            base: ",
                quoted(path)
            )?;
            write_indented(out, &write_without_poses(base), "            ");
            if let Some(text) = text {
                write!(out, ",\n            text: {}", raw(text))?;
            }
            writeln!(out, ",\n        ),")?;
        }
        writeln!(out, "    ],")?;
    }
    write_view(out, &project.view)?;
    if let Some(journal) = &project.journal {
        writeln!(out, "    journal: (file: {}, last: {}),", quoted(&journal.file), journal.last)?;
    }
    writeln!(out, ")")
}

/// A text without escapes, so that its lines are lines of the file.
fn raw(text: &str) -> String {
    let behind_quotes = text.split('"').skip(1);
    let hashes = behind_quotes.map(|rest| rest.bytes().take_while(|byte| *byte == b'#').count() + 1).max();
    let hashes = "#".repeat(hashes.unwrap_or(1));
    format!("r{hashes}\"{text}\"{hashes}")
}

fn write_rig(out: &mut String, entry: &ProjectRig, known: &NodeNames) -> std::fmt::Result {
    write!(out, "        (\n            rig: ")?;
    write_indented(out, &write_without_poses(&entry.rig), "            ");
    writeln!(out, ",\n            skins: [")?;
    for skin in &entry.skins {
        writeln!(
            out,
            "                (mesh: \"{}\", path: {}, hash: \"{:016x}\", at_rest: {}),",
            skin.mesh,
            quoted(&skin.path),
            skin.hash,
            skin.at_rest
        )?;
    }
    writeln!(out, "            ],\n            pose: [")?;
    write_offsets(out, entry.rig.pose(), "                ")?;
    writeln!(out, "            ],")?;
    write_values(out, entry.rig.attribute_values(), "            ")?;
    writeln!(out, "            poses: [")?;
    write_stored_poses(out, &entry.rig, "                ")?;
    writeln!(out, "            ],")?;
    if !entry.rig.clips().is_empty() {
        writeln!(out, "            clips: [")?;
        let mut names = known.clone();
        names.extend(&NodeNames::of(&entry.rig, None));
        write_clips(out, entry.rig.clips(), &names, "                ")?;
        writeln!(out, "            ],")?;
    }
    if !entry.rig.dropped_parts().is_empty() {
        writeln!(out, "            parts: [")?;
        for DroppedPart { uid, part, joints, mirror } in entry.rig.dropped_parts() {
            let joints: Vec<String> = joints.iter().map(|joint| format!("\"{joint}\"")).collect();
            let (part, joints) = (quoted(part), joints.join(", "));
            writeln!(out, "                (uid: \"{uid}\", part: {part}, joints: [{joints}], mirror: {mirror}),")?;
        }
        writeln!(out, "            ],")?;
    }
    if !entry.rig.selection_sets().is_empty() {
        writeln!(out, "            sets: [")?;
        for SelectionSet { name, nodes } in entry.rig.selection_sets() {
            let nodes: Vec<String> = nodes.iter().map(|node| format!("\"{node}\"")).collect();
            writeln!(out, "                (name: {}, nodes: [{}]),", quoted(name), nodes.join(", "))?;
        }
        writeln!(out, "            ],")?;
    }
    write_faces(out, &entry.rig)?;
    writeln!(out, "        ),")
}

fn write_faces(out: &mut String, rig: &Rig) -> std::fmt::Result {
    if rig.face_cuts().is_empty() {
        return Ok(());
    }
    writeln!(out, "            faces: [")?;
    for (mesh, FaceCut { bones, groups }) in rig.face_cuts() {
        let groups = groups.map_or_else(String::new, |groups| format!(", groups: {groups}"));
        writeln!(out, "                (mesh: \"{mesh}\", bones: {bones}{groups}),")?;
    }
    writeln!(out, "            ],")
}

/// The first format that can hold the rig's poses, clips, dropped parts, selection sets and cuts of faces.
fn needed_format(rig: &Rig) -> u32 {
    if !rig.face_cuts().is_empty() {
        return 6;
    }
    let needs_values = !rig.attribute_values().is_empty()
        || rig.stored_poses().iter().any(|pose| !pose.values.is_empty())
        || rig.pose().keys().any(|node| rig.joint(*node).is_none());
    let is_plain = rig.dropped_parts().is_empty() && rig.selection_sets().is_empty();
    match (is_plain, rig.clips().is_empty(), needs_values) {
        (false, ..) => 4,
        (true, false, _) => 3,
        (true, true, true) => 2,
        (true, true, false) => 1,
    }
}

/// Writes the text of a template with indentation. Parameters of modules stay unchanged, because a line break in them
/// may be part of a string.
fn write_indented(out: &mut String, text: &str, indent: &str) {
    let text = text.trim_end();
    let fields = scan::fields(text);
    let mut fixed = fields.iter().filter(|field| field.name == "params").map(|field| field.value..field.end).peekable();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        while fixed.next_if(|range| range.end <= at).is_some() {}
        if at > 0 && fixed.peek().is_none_or(|range| range.start >= at) {
            out.push_str(indent);
        }
        out.push_str(line);
        at += line.len();
    }
}

fn write_view(out: &mut String, view: &ProjectView) -> std::fmt::Result {
    writeln!(out, "    view: (")?;
    if let Some(camera) = view.camera.filter(|camera| camera.is_finite()) {
        writeln!(
            out,
            "        camera: (yaw: {:?}, pitch: {:?}, distance: {:?}, focus: {}, orthographic: {}),",
            camera.yaw,
            camera.pitch,
            camera.distance,
            vector(camera.focus),
            camera.orthographic
        )?;
    }
    writeln!(out, "        mode: {},\n        shading: {},", quoted(&view.mode), quoted(&view.shading))?;
    writeln!(out, "        switches: {{")?;
    for (name, on) in &view.switches {
        writeln!(out, "            {}: {on},", quoted(name))?;
    }
    writeln!(out, "        }},")?;
    if !view.graph.is_empty() {
        writeln!(out, "        graph: {{")?;
        for (uid, [x, y]) in view.graph.iter().filter(|(_, place)| place.iter().all(|number| number.is_finite())) {
            writeln!(out, "            \"{uid}\": ({x:?}, {y:?}),")?;
        }
        writeln!(out, "        }},")?;
    }
    if let Some(clip) = view.clip {
        writeln!(out, "        clip: \"{clip}\",")?;
    }
    writeln!(out, "    ),")
}
