//! Material libraries written from glTF materials.

use serde_json::Value;

use super::{
    paths::safe_relative_path,
    write::{distinct, line},
};
use crate::mesh::{CompanionSink, model::MaterialSet};

/// Names of the materials, and the library. No library for no materials. Images that it refers to go to `companion`.
pub(super) fn materials(material_set: &MaterialSet, companion: &mut CompanionSink) -> (Vec<String>, Option<Vec<u8>>) {
    let names = distinct(
        material_set.materials.iter().map(|material| material["name"].as_str().unwrap_or_default()),
        "material",
    );
    let plain = image_names(material_set);
    let mut files: Vec<Option<String>> = vec![None; plain.len()];
    let mut out = Vec::new();
    for (name, material) in names.iter().zip(&material_set.materials) {
        line(&mut out, format_args!("newmtl {name}"));
        write_material(&mut out, material, |texture| {
            let texture = material_set.textures.get(texture["index"].as_u64()? as usize)?;
            let image = texture["source"].as_u64()? as usize;
            // An image that was not found has no bytes.
            let bytes = Some(&material_set.images.get(image)?.bytes).filter(|bytes| !bytes.is_empty())?;
            let file = files.get_mut(image)?.get_or_insert_with(|| companion(&plain[image], bytes.clone()));
            let clamped = texture["sampler"].as_u64().and_then(|at| material_set.samplers.get(at as usize));
            let clamped = clamped.is_some_and(|sampler| sampler["wrapS"] == 33071 && sampler["wrapT"] == 33071);
            Some((file.clone(), clamped))
        });
    }
    (names, (!material_set.materials.is_empty()).then_some(out))
}

fn write_material(out: &mut Vec<u8>, material: &Value, mut file: impl FnMut(&Value) -> Option<(String, bool)>) {
    let surface = &material["pbrMetallicRoughness"];
    let color = numbers(&surface["baseColorFactor"], [1.0; 4]);
    line(out, format_args!("Kd {} {} {}", color[0], color[1], color[2]));
    if color[3] != 1.0 {
        line(out, format_args!("d {}", color[3]));
    }
    let strength = &material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
    let emitted = numbers(&material["emissiveFactor"], [0.0; 3]).map(|value| value * number(strength, 1.0));
    if emitted != [0.0; 3] {
        line(out, format_args!("Ke {} {} {}", emitted[0], emitted[1], emitted[2]));
    }
    let roughness = number(&surface["roughnessFactor"], 1.0);
    let smooth = 1.0 - roughness;
    line(out, format_args!("Ns {}", smooth * smooth * 1000.0));
    line(out, format_args!("Pr {roughness}"));
    line(out, format_args!("Pm {}", number(&surface["metallicFactor"], 1.0)));
    line(out, format_args!("illum 2"));
    let maps = [
        ("map_Kd", &surface["baseColorTexture"]),
        ("map_Pr", &surface["metallicRoughnessTexture"]),
        ("map_Pm", &surface["metallicRoughnessTexture"]),
        ("map_Ke", &material["emissiveTexture"]),
        ("map_Bump", &material["normalTexture"]),
    ];
    for (keyword, texture) in maps {
        let Some((name, clamped)) = file(texture) else { continue };
        let mut options = String::new();
        let strength = number(&texture["scale"], 1.0);
        if keyword == "map_Bump" && strength != 1.0 {
            options += &format!("-bm {strength} ");
        }
        if clamped {
            options += "-clamp on ";
        }
        let transform = &texture["extensions"]["KHR_texture_transform"];
        if transform.is_object() {
            let [su, sv] = numbers(&transform["scale"], [1.0; 2]);
            let [ou, ov] = numbers(&transform["offset"], [0.0; 2]);
            options += &format!("-s {su} {sv} -o {ou} {} ", 1.0 - sv - ov);
        }
        line(out, format_args!("{keyword} {options}{name}"));
    }
    if material["alphaMode"] == "BLEND"
        && color[3] == 1.0
        && let Some((name, _)) = file(&surface["baseColorTexture"])
    {
        line(out, format_args!("map_d {name}"));
    }
}

/// A file name for each image, each used once.
fn image_names(material_set: &MaterialSet) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (at, image) in material_set.images.iter().enumerate() {
        let extension = if image.mime == "image/jpeg" { "jpg" } else { "png" };
        let safe = safe_relative_path(&image.name).unwrap_or_else(|| format!("texture_{at}"));
        let known =
            safe.rsplit_once('.').is_some_and(|(_, end)| ["png", "jpg", "jpeg"].contains(&&*end.to_ascii_lowercase()));
        let name = if known { safe } else { format!("{safe}.{extension}") };
        let taken = names.contains(&name);
        names.push(if taken { format!("texture_{at}_{}", name.replace('/', "_")) } else { name });
    }
    names
}

fn number(value: &Value, default: f64) -> f64 {
    value.as_f64().unwrap_or(default)
}

fn numbers<const N: usize>(value: &Value, default: [f64; N]) -> [f64; N] {
    let mut numbers = default;
    for (number, value) in numbers.iter_mut().zip(value.as_array().into_iter().flatten()) {
        *number = value.as_f64().unwrap_or(*number);
    }
    numbers
}
