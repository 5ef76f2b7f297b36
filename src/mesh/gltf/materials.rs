//! Materials, textures and samplers, carried unread; images, loaded. Only references and extensions are inspected.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::{
    ExternalError, ExternalFile, ExternalKind, GltfError, MAX_IMAGE_BYTES,
    accessor::Source,
    budget::{Budget, Notes},
    json::{JsonObject, copy, whole_float},
    tree::Fields,
    uri,
};
use crate::mesh::model::{Image, MaterialSet};

/// Fields of a glTF image that [`Image`] has fields for.
pub(super) const OWN_FIELDS: [&str; 4] = ["name", "uri", "mimeType", "bufferView"];

/// Reads materials, textures, samplers and images.
pub(super) fn read(
    source: &Source,
    external: &mut dyn FnMut(ExternalFile) -> Result<Vec<u8>, ExternalError>,
    notes: &Notes,
) -> Result<MaterialSet, GltfError> {
    let document = source.document;
    let root = &document.root;
    let mut material_set = MaterialSet { images: images(source, external, notes)?, ..Default::default() };
    let count = |key: &str| Ok::<_, GltfError>(root.array(key)?.len());
    let (textures, samplers, images) = (count("textures")?, count("samplers")?, count("images")?);
    for at in root.objects("materials")? {
        let at = at?;
        check_textures(at.map, &at.place, textures, 0)?;
        material_set.materials.push(carried(&at, source.budget, notes)?);
    }
    for at in root.objects("textures")? {
        let at = at?;
        at.index("sampler", samplers, "sampler")?;
        at.index("source", images, "image")?;
        if let Some(extensions) = at.object("extensions")? {
            for (name, value) in extensions.map.iter() {
                if let Some(value) = value.as_object().filter(|value| value.contains_key("source")) {
                    let extension = JsonObject { map: value, place: extensions.sub(name) };
                    extension.index("source", images, "image")?;
                }
            }
        }
        material_set.textures.push(carried(&at, source.budget, notes)?);
    }
    for at in root.objects("samplers")? {
        material_set.samplers.push(carried(&at?, source.budget, notes)?);
    }

    let mut found = BTreeSet::new();
    for value in material_set.materials.iter().chain(&material_set.textures).chain(&material_set.samplers) {
        find_extensions(value, &mut found);
    }
    for image in &material_set.images {
        image.rest.values().for_each(|value| find_extensions(value, &mut found));
        find_extension_names(image.rest.get("extensions"), &mut found);
    }
    let (used, required) = (&document.extensions_used, &document.extensions_required);
    (material_set.extensions_used, material_set.extensions_required) = declare(found, used, required);
    Ok(material_set)
}

/// The extensions to declare when `found` are used: in the order of the lists given, undeclared ones last.
pub(super) fn declare(
    found: BTreeSet<&str>,
    used: &[impl AsRef<str>],
    required: &[impl AsRef<str>],
) -> (Vec<String>, Vec<String>) {
    let required = required.iter().map(AsRef::as_ref).filter(|name| found.contains(name)).map(str::to_owned).collect();
    let mut rest = found;
    let mut list = Vec::new();
    for name in used.iter().map(AsRef::as_ref) {
        list.extend(rest.take(name).map(str::to_owned));
    }
    list.extend(rest.into_iter().map(str::to_owned));
    (list, required)
}

/// A copy of an object, without references to packets of metadata that are not carried.
fn carried(at: &JsonObject, budget: &Budget, notes: &Notes) -> Result<Value, GltfError> {
    let mut map = Map::new();
    for (key, value) in at.map.iter() {
        map.insert(key.to_owned(), copy(value, budget, &at.place)?);
    }
    if let Some(Value::Object(extensions)) = map.get_mut("extensions")
        && extensions.shift_remove("KHR_xmp_json_ld").is_some()
    {
        notes.add("Metadata (KHR_xmp_json_ld) of a material, texture or sampler was not kept");
    }
    Ok(Value::Object(map))
}

/// Checks every `...Texture` in a material, also in its extensions, to refer to a texture.
fn check_textures(map: &Fields, place: &str, textures: usize, depth: usize) -> Result<(), GltfError> {
    for (key, value) in map.iter() {
        let Some(inner) = value.as_object().filter(|_| key != "extras" && depth < 8) else {
            continue;
        };
        let at = JsonObject { map: inner, place: format!("{place}/{key}") };
        if key.ends_with("Texture") {
            at.index("index", textures, "texture")?;
        }
        check_textures(inner, &at.place, textures, depth + 1)?;
    }
    Ok(())
}

/// Names of the extensions anywhere in a value.
pub(super) fn find_extensions<'a>(value: &'a Value, found: &mut BTreeSet<&'a str>) {
    match value {
        Value::Object(map) => {
            find_extension_names(map.get("extensions"), found);
            // Extras belong to the user; an object named `extensions` in them declares none.
            map.iter().filter(|(key, _)| *key != "extras").for_each(|(_, value)| find_extensions(value, found));
        }
        Value::Array(list) => list.iter().for_each(|value| find_extensions(value, found)),
        _ => {}
    }
}

fn find_extension_names<'a>(extensions: Option<&'a Value>, found: &mut BTreeSet<&'a str>) {
    found.extend(extensions.and_then(Value::as_object).into_iter().flat_map(Map::keys).map(String::as_str));
}

fn images(
    source: &Source,
    external: &mut dyn FnMut(ExternalFile) -> Result<Vec<u8>, ExternalError>,
    notes: &Notes,
) -> Result<Vec<Image>, GltfError> {
    let mut images = Vec::new();
    let mut total = 0u64;
    for at in source.document.root.objects("images")? {
        let at = at?;
        let mut image = Image { name: at.name().to_owned(), ..Default::default() };
        let mut mime = at.text("mimeType")?.unwrap_or_default().to_owned();
        if let Some(view) = at.index("bufferView", source.document.views.len(), "buffer view")? {
            image.bytes = source.view(view)?.to_vec();
        } else if let Some(text) = at.text("uri")? {
            let place = at.sub("uri");
            if text.len() as u64 > MAX_IMAGE_BYTES * 2 {
                return Err(too_large(place));
            }
            match uri::resolve(text, &place)? {
                uri::UriTarget::Data { mime: of_uri, bytes } => {
                    image.bytes = bytes;
                    mime = if mime.is_empty() { of_uri } else { mime };
                }
                uri::UriTarget::File(path) => match external(ExternalFile {
                    path: &path,
                    kind: ExternalKind::Image,
                    limit: MAX_IMAGE_BYTES - total,
                }) {
                    Ok(bytes) => {
                        let file = path.rsplit('/').next().unwrap_or_default();
                        image.bytes = bytes;
                        if image.name.is_empty() && !is_given_name(file) {
                            image.name = file.to_owned();
                        }
                    }
                    Err(error) => {
                        notes.add(format!("The image \"{path}\" could not be loaded ({error}) and is left out"));
                        image.rest.insert("uri".to_owned(), Value::String(text.to_owned()));
                    }
                },
            }
        } else {
            return Err(GltfError::at(at.place, "an image needs a uri or a bufferView"));
        }
        total = total.saturating_add(image.bytes.len() as u64);
        if total > MAX_IMAGE_BYTES {
            return Err(too_large(at.place));
        }
        image.mime = sniff(&image.bytes).map_or(mime, str::to_owned);
        for (key, value) in at.map.iter().filter(|(key, _)| !OWN_FIELDS.contains(key)) {
            image.rest.insert(key.to_owned(), copy(value, source.budget, &at.place)?);
        }
        images.push(image);
    }
    Ok(images)
}

/// True if the name of a file ends in the hash of its content, as names do that are given to files beside a `.gltf`: an image
/// there whose document names it has that name, and one without a name stays without.
fn is_given_name(file: &str) -> bool {
    const DIGITS: usize = 16;
    let hash = file.rsplit('.').nth(1).and_then(|mark| mark.split('-').next());
    hash.is_some_and(|hash| {
        hash.len() == DIGITS && hash.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
    })
}

fn too_large(place: String) -> GltfError {
    GltfError::at(place, format!("the images have more than {} MiB together", MAX_IMAGE_BYTES >> 20))
}

/// The media type by the first bytes, which are right more often than a file's `mimeType`.
pub(super) fn sniff(bytes: &[u8]) -> Option<&'static str> {
    let is = |at: usize, magic: &[u8]| bytes.get(at..).is_some_and(|bytes| bytes.starts_with(magic));
    if is(0, b"\x89PNG\r\n\x1a\n") {
        Some("image/png")
    } else if is(0, b"\xFF\xD8\xFF") {
        Some("image/jpeg")
    } else if is(0, b"RIFF") && is(8, b"WEBP") {
        Some("image/webp")
    } else if is(0, b"\xABKTX 20\xBB\r\n\x1a\n") {
        Some("image/ktx2")
    } else if is(0, b"DDS ") {
        Some("image/vnd-ms.dds")
    } else if is(4, b"ftypavif") {
        Some("image/avif")
    } else {
        None
    }
}

/// A whole number of a carried value, within range, also when it is written as a float.
pub(super) fn whole(value: &Value) -> Option<usize> {
    match value.as_u64() {
        Some(number) => usize::try_from(number).ok(),
        None => whole_float(value.as_f64()?),
    }
}

/// Maps the index in a field through `map`; removes the field if there is nothing to map to.
pub(super) fn remap(object: &mut Map<String, Value>, key: &str, map: &[Option<usize>]) {
    let Some(index) = object.get(key).and_then(whole) else {
        return;
    };
    match map.get(index).copied().flatten() {
        Some(to) => object.insert(key.to_owned(), Value::from(to)),
        None => object.shift_remove(key),
    };
}

/// Appends materials with their textures, samplers and images to others. Indices in them are moved behind those that are there.
pub(in crate::mesh) fn append_materials(set: &mut MaterialSet, other: MaterialSet) {
    let (textures, samplers, images) = (set.textures.len(), set.samplers.len(), set.images.len());
    for mut material in other.materials {
        if let Value::Object(map) = &mut material {
            move_textures(map, textures, 0);
        }
        set.materials.push(material);
    }
    for mut texture in other.textures {
        if let Value::Object(map) = &mut texture {
            move_index(map, "sampler", samplers);
            move_index(map, "source", images);
            if let Some(Value::Object(extensions)) = map.get_mut("extensions") {
                for extension in extensions.values_mut().filter_map(Value::as_object_mut) {
                    move_index(extension, "source", images);
                }
            }
        }
        set.textures.push(texture);
    }
    set.samplers.extend(other.samplers);
    set.images.extend(other.images);
    append_names(&mut set.extensions_used, other.extensions_used);
    append_names(&mut set.extensions_required, other.extensions_required);
}

/// Moves the indices of every `...Texture` in a material, also in its extensions.
fn move_textures(map: &mut Map<String, Value>, by: usize, depth: usize) {
    for (key, value) in map.iter_mut() {
        let Some(inner) = value.as_object_mut().filter(|_| key != "extras" && depth < 8) else {
            continue;
        };
        if key.ends_with("Texture") {
            move_index(inner, "index", by);
        }
        move_textures(inner, by, depth + 1);
    }
}

fn move_index(object: &mut Map<String, Value>, key: &str, by: usize) {
    if let Some(index) = object.get(key).and_then(whole) {
        object.insert(key.to_owned(), Value::from(index.saturating_add(by)));
    }
}

fn append_names(names: &mut Vec<String>, more: Vec<String>) {
    for name in more {
        if !names.contains(&name) {
            names.push(name);
        }
    }
}
