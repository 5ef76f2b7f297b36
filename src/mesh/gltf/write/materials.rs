//! Materials, textures and samplers, written unchanged; images, written into the buffer or into files.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::{
    buffer::{Bin, Target},
    insert_name,
};
use crate::mesh::{
    CompanionSink,
    gltf::{
        geometry::MAX_UV_SETS,
        materials::{OWN_FIELDS, declare, find_extensions, remap, sniff, whole},
        uri::percent_encode,
    },
    model::{Image, MaterialSet},
};

/// Lists of the document that come from materials; materials and samplers are written as they are.
pub(super) struct WrittenMaterials {
    pub(super) textures: Vec<Value>,
    pub(super) images: Vec<Value>,
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_required: Vec<String>,
}

/// Writes materials and their textures; images go into the buffer, or to the sink of companions. Images without bytes
/// are left out: their textures stay, which glTF allows, so that materials need not change.
pub(super) fn write(
    material_set: &MaterialSet,
    mut outside: Option<&mut (&str, &mut CompanionSink)>,
    bin: &mut Bin,
) -> WrittenMaterials {
    let mut images = Vec::new();
    let mut names = BTreeSet::new();
    let mut image_of = vec![None; material_set.images.len()];
    for (index, image) in material_set.images.iter().enumerate().filter(|(_, image)| !image.bytes.is_empty()) {
        image_of[index] = Some(images.len());
        let mut map = Map::new();
        insert_name(&mut map, &image.name);
        let mime = if image.mime.is_empty() { sniff(&image.bytes).unwrap_or("image/png") } else { &image.mime };
        map.insert("mimeType".to_owned(), mime.into());
        match &mut outside {
            None => drop(map.insert("bufferView".to_owned(), bin.view(&image.bytes, Target::Other).into())),
            Some((stem, companion)) => {
                let name = companion(&file_name(image, stem, index, &mut names), image.bytes.clone());
                map.insert("uri".to_owned(), percent_encode(&name).into());
            }
        }
        for (key, value) in image.rest.iter().filter(|(key, _)| !OWN_FIELDS.contains(&key.as_str())) {
            map.insert(key.clone(), value.clone());
        }
        images.push(map.into());
    }

    let mut textures = Vec::new();
    for texture in &material_set.textures {
        let mut texture = texture.clone();
        if let Value::Object(map) = &mut texture {
            remap(map, "source", &image_of);
            if let Some(Value::Object(extensions)) = map.get_mut("extensions") {
                extensions.retain(|_, value| match value {
                    Value::Object(extension) if extension.contains_key("source") => {
                        remap(extension, "source", &image_of);
                        extension.contains_key("source")
                    }
                    _ => true,
                });
                if extensions.is_empty() {
                    map.shift_remove("extensions");
                }
            }
        }
        textures.push(texture);
    }

    let mut found = BTreeSet::new();
    for value in material_set.materials.iter().chain(&textures).chain(&material_set.samplers).chain(&images) {
        find_extensions(value, &mut found);
    }
    let (extensions_used, extensions_required) =
        declare(found, &material_set.extensions_used, &material_set.extensions_required);
    WrittenMaterials { textures, images, extensions_used, extensions_required }
}

/// Number of texture coordinate sets that a material uses: glTF demands them of each of its meshes.
pub(super) fn uv_sets(material: &Value) -> usize {
    let Value::Object(map) = material else {
        return 0;
    };
    let of_field = |(key, value): (&String, &Value)| {
        let coord = |value: &Value| value.get("texCoord").and_then(whole).unwrap_or(0);
        match value {
            _ if key == "extras" => 0,
            Value::Object(info) if key.ends_with("Texture") => {
                let transform = value.get("extensions").and_then(|value| value.get("KHR_texture_transform"));
                let sets = [Some(coord(value)), transform.map(coord), info.contains_key("index").then_some(0)];
                sets.into_iter().flatten().max().map_or(0, |set| set.saturating_add(1))
            }
            value => uv_sets(value),
        }
    };
    map.iter().map(of_field).filter(|sets| *sets <= MAX_UV_SETS).max().unwrap_or(0)
}

/// A file name for an image: its own name if it is plain and free, else the stem and its number.
fn file_name(image: &Image, stem: &str, index: usize, taken: &mut BTreeSet<String>) -> String {
    let extension = match image.mime.as_str() {
        "image/jpeg" => "jpg",
        "image/webp" => "webp",
        "image/ktx2" => "ktx2",
        "image/vnd-ms.dds" => "dds",
        "image/avif" => "avif",
        _ => "png",
    };
    let own = match image.name.rsplit_once('.') {
        Some((own, old)) if old.len() <= 5 => own,
        _ => &image.name,
    };
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let own_name = format!("{own}.{extension}");
    // Names that differ in case only are one file on some systems.
    if !own.is_empty()
        && !own.starts_with('.')
        && own.len() <= 64
        && own.chars().all(plain)
        && taken.insert(own_name.to_ascii_lowercase())
    {
        return own_name;
    }
    let mut name = format!("{stem}_image{index}.{extension}");
    while !taken.insert(name.to_ascii_lowercase()) {
        name.insert(name.len() - extension.len() - 1, '_');
    }
    name
}
