//! Models as OBJ files.

use std::{collections::HashSet, io::Write};

use glam::Vec4;

use super::{color::srgb_text, write_mtl::materials};
use crate::mesh::{
    CompanionSink,
    model::{Model, Part},
};

/// Writes a model's geometry, objects and materials. The material library, which would be called `<stem>.mtl`, and the
/// images that it refers to go to `companion`, which returns the names that they get; they must fit on a line.
///
/// Polygons are written where the model has them. Each vertex gets its own `vt` and `vn`, so that reading the file again
/// gives the same points, vertices, faces and attributes to the bit; numbers are the shortest that do. Skins, morph
/// targets, clips and second texture coordinate sets have no place in the format.
pub fn write_obj(model: &Model, stem: &str, companion: &mut CompanionSink) -> Vec<u8> {
    let (names, library) = materials(&model.material_set, companion);
    let mut out = Vec::new();
    if let Some(library) = library {
        let library = companion(&format!("{stem}.mtl"), library);
        line(&mut out, format_args!("mtllib {library}"));
    }
    let colors = point_colors(model);
    for (at, point) in model.points.iter().enumerate() {
        match colors.get(at) {
            Some(color) => {
                let [r, g, b] = [color.x, color.y, color.z].map(srgb_text);
                line(&mut out, format_args!("v {} {} {} {r} {g} {b}", point.x, point.y, point.z));
            }
            None => line(&mut out, format_args!("v {} {} {}", point.x, point.y, point.z)),
        }
    }
    let objects = object_names(model);
    let mut current = (None, None);
    let (mut texcoords, mut normals) = (0, 0);
    for part in &model.parts {
        if current.0 != Some(part.object)
            && let Some(name) = objects.get(part.object).filter(|name| !name.is_empty())
        {
            line(&mut out, format_args!("o {name}"));
        }
        let material = part.material.and_then(|material| names.get(material));
        match material {
            _ if current.1 == material => {}
            Some(name) => line(&mut out, format_args!("usemtl {name}")),
            None => line(&mut out, format_args!("usemtl (null)")),
        }
        current = (Some(part.object), material);
        write_part(&mut out, part, texcoords, normals);
        texcoords += part.uvs.first().map_or(0, Vec::len);
        normals += part.normals.len();
    }
    out
}

/// Writes formatted text to memory, which cannot fail.
pub(super) fn line(out: &mut Vec<u8>, text: std::fmt::Arguments) {
    let _ = out.write_fmt(text);
    out.push(b'\n');
}

fn write_part(out: &mut Vec<u8>, part: &Part, texcoords: usize, normals: usize) {
    let uvs = part.uvs.first().filter(|uvs| uvs.len() == part.vertices.len());
    for uv in uvs.into_iter().flatten() {
        line(out, format_args!("vt {} {}", uv.x, turned(uv.y)));
    }
    for normal in &part.normals {
        line(out, format_args!("vn {} {} {}", normal.x, normal.y, normal.z));
    }
    let with_normals = part.normals.len() == part.vertices.len() && !part.vertices.is_empty();
    let mut face = |corners: &[u32]| {
        out.push(b'f');
        for corner in corners {
            let (corner, point) = (*corner as usize, part.vertices[*corner as usize] as usize + 1);
            let (texcoord, normal) = (texcoords + corner + 1, normals + corner + 1);
            let _ = match (uvs.is_some(), with_normals) {
                (true, true) => write!(out, " {point}/{texcoord}/{normal}"),
                (true, false) => write!(out, " {point}/{texcoord}"),
                (false, true) => write!(out, " {point}//{normal}"),
                (false, false) => write!(out, " {point}"),
            };
        }
        out.push(b'\n');
    };
    if part.faces.is_empty() {
        part.triangles.iter().for_each(|triangle| face(triangle));
    } else {
        part.faces.iter().for_each(face);
    }
}

/// The texture coordinate that reading turns into `v`: `1 - v`, or the float next to it where that rounds differently.
fn turned(v: f32) -> f32 {
    let near = 1.0 - v;
    [near, near.next_up(), near.next_down()].into_iter().find(|turned| 1.0 - turned == v).unwrap_or(near)
}

/// The colour of each point, from the first vertex at it; white for points without one. Empty if no part has colours.
fn point_colors(model: &Model) -> Vec<Vec4> {
    let colored = |part: &&Part| !part.colors.is_empty() && part.colors.len() == part.vertices.len();
    if !model.parts.iter().any(|part| colored(&part)) {
        return Vec::new();
    }
    let mut colors = vec![None; model.points.len()];
    for part in model.parts.iter().filter(colored) {
        for (point, color) in part.vertices.iter().zip(&part.colors) {
            colors[*point as usize].get_or_insert(*color);
        }
    }
    colors.into_iter().map(|color| color.unwrap_or(Vec4::ONE)).collect()
}

/// A different name for each object, but none for an object without name whose parts come first: faces before the first
/// `o` are in no named object either.
fn object_names(model: &Model) -> Vec<String> {
    let mut names = distinct(model.objects.iter().map(|object| object.name.as_str()), "object");
    if let Some(first) = model.parts.first().map(|part| part.object)
        && model.objects.get(first).is_some_and(|object| object.name.is_empty())
        && !model.parts.iter().skip_while(|part| part.object == first).any(|part| part.object == first)
    {
        names[first].clear();
    }
    names
}

/// Distinct names fit for a line; an empty name becomes `kind` and a number.
pub(super) fn distinct<'a>(names: impl Iterator<Item = &'a str>, kind: &str) -> Vec<String> {
    let mut used = HashSet::new();
    let unique = |(at, name): (usize, &str)| {
        let name = clean(name);
        let name = if name.is_empty() || name == "(null)" { format!("{kind}_{at}") } else { name };
        let mut candidate = name.clone();
        let mut copy = at;
        while !used.insert(candidate.clone()) {
            candidate = format!("{name}_{copy}");
            copy += 1;
        }
        candidate
    };
    names.enumerate().map(unique).collect()
}

/// Text with control characters replaced by blanks, so that it stays on its line.
fn clean(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    text.trim().trim_end_matches('\\').trim_end().to_owned()
}
