//! Translation of an OBJ's materials and textures to glTF's.

use std::collections::HashMap;

use serde_json::{Map, Value, json};

use super::{
    NONE, ObjArrays,
    mtl::{ObjMaterial, ObjTexture, read_mtl},
    paths::{candidates, folder_of, library_names, safe_relative_path},
};
use crate::mesh::model::{Image, MaterialSet};

/// Fetches a file by its safe path below the model's folder; `None` if there is none.
pub type Sidecar<'a> = dyn FnMut(&str) -> Option<SidecarFile> + 'a;

/// File that a model refers to, and that is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SidecarFile {
    /// Content of the file.
    Bytes(Vec<u8>),
    /// Reason for not reading the file, in words.
    Refused(String),
}

/// Largest size of all images of one model together, in bytes.
const MOST_IMAGE_BYTES: usize = 256 << 20;
/// Largest size of one material library, in bytes.
const MOST_LIBRARY_BYTES: usize = 64 << 20;
/// Largest number of materials of one model.
const MOST_MATERIALS: usize = 1 << 14;
/// Largest number of notes of one kind.
const MOST_NOTES: usize = 20;

/// Translates the materials in use, in the order of their first use, and maps each name to its material.
pub(super) fn material_set(
    arrays: &ObjArrays,
    sidecar: &mut Sidecar,
    notes: &mut Vec<String>,
) -> (MaterialSet, HashMap<u32, usize>) {
    let libraries = load_libraries(arrays, sidecar, notes);
    let mut builder =
        Builder { material_set: MaterialSet::default(), images: HashMap::new(), bytes: 0, sidecar, notes };
    let mut numbers = HashMap::new();
    let mut unknown = Vec::new();
    // Faces without a material are a part, too.
    let most = MOST_MATERIALS.min(arrays.most_parts() - 1);
    for run in &arrays.runs {
        if run.material == NONE || numbers.contains_key(&run.material) {
            continue;
        }
        if numbers.len() == most {
            builder.note(format!("more than {most} materials in a file of this size: the others were left out"));
            break;
        }
        let name = arrays.names.get(run.material);
        let found = libraries.get(name);
        if found.is_none() {
            unknown.push(name);
        }
        let bare = (ObjMaterial { name: name.to_owned(), ..ObjMaterial::default() }, String::new());
        let (material, folder) = found.unwrap_or(&bare);
        let value = builder.material(material, folder);
        numbers.insert(run.material, builder.material_set.materials.len());
        builder.material_set.materials.push(value);
    }
    let Builder { material_set, .. } = builder;
    if !unknown.is_empty() && !libraries.is_empty() {
        let names = unknown[..unknown.len().min(5)].join("`, `");
        notes.push(format!("{} material(s) are in no material library: `{names}`", unknown.len()));
    }
    (material_set, numbers)
}

/// Loads all materials of all libraries by name, with the folder of the library. The first of a name counts.
fn load_libraries(
    arrays: &ObjArrays,
    sidecar: &mut Sidecar,
    notes: &mut Vec<String>,
) -> HashMap<String, (ObjMaterial, String)> {
    let mut materials = HashMap::new();
    for statement in &arrays.material_libraries {
        let names = library_names(statement);
        let mut load = |name: &str, sidecar: &mut Sidecar| {
            let mut refused = None;
            for place in candidates("", name) {
                let bytes = match sidecar(&place) {
                    None => continue,
                    Some(SidecarFile::Bytes(bytes)) if bytes.len() <= MOST_LIBRARY_BYTES => bytes,
                    Some(SidecarFile::Bytes(_)) => {
                        refused.get_or_insert_with(|| "it is larger than 64 MiB".to_owned());
                        continue;
                    }
                    Some(SidecarFile::Refused(reason)) => {
                        refused.get_or_insert(reason);
                        continue;
                    }
                };
                for material in read_mtl(&bytes) {
                    let name = material.name.clone();
                    materials.entry(name).or_insert_with(|| (material, folder_of(&place).to_owned()));
                }
                return Library::Read;
            }
            refused.map_or(Library::Missing, Library::Refused)
        };
        let whole = load(&names[0], sidecar);
        if matches!(whole, Library::Read) {
            continue;
        }
        // A single name equals the whole statement, which was just tried.
        let mut tried = Vec::new();
        for name in &names[1..] {
            tried.push((name, load(name, sidecar)));
        }
        if tried.is_empty() {
            tried.push((&names[0], whole));
        }
        for (name, library) in tried {
            let note = match library {
                Library::Read => continue,
                Library::Missing => format!("the material library `{name}` was not found"),
                Library::Refused(reason) => format!("the material library `{name}` was left out: {reason}"),
            };
            if notes.len() < MOST_NOTES {
                notes.push(note);
            }
        }
    }
    materials
}

/// Outcome of looking for a library.
enum Library {
    Read,
    Missing,
    Refused(String),
}

struct Builder<'a, 'b, 'c> {
    material_set: MaterialSet,
    /// Images by path, or `None` for a path without one.
    images: HashMap<String, Option<usize>>,
    bytes: usize,
    sidecar: &'a mut Sidecar<'b>,
    notes: &'c mut Vec<String>,
}

impl Builder<'_, '_, '_> {
    fn material(&mut self, material: &ObjMaterial, folder: &str) -> Value {
        let mut surface = Map::new();
        let mut out = Map::new();
        out.insert("name".into(), material.name.clone().into());
        let texture = material.diffuse_map.as_ref().and_then(|map| self.texture(map, folder));
        // With a texture `Kd` has no meaning: some exporters write white, some grey, some black.
        let diffuse = if texture.is_some() { [1.0; 3] } else { material.diffuse.unwrap_or([0.8; 3]).map(unit) };
        let opacity = unit(material.opacity.unwrap_or(1.0));
        let [r, g, b] = diffuse;
        surface.insert("baseColorFactor".into(), numbers(&[r, g, b, opacity]));
        if let Some(texture) = texture {
            surface.insert("baseColorTexture".into(), texture);
        }
        let combined = match (&material.roughness_map, &material.metallic_map) {
            (Some(roughness), Some(metallic)) if roughness.path == metallic.path => self.texture(roughness, folder),
            (None, None) => None,
            _ => {
                self.note(format!("material `{}`: separate roughness and metalness textures left out", material.name));
                None
            }
        };
        // Default factor: full strength where a texture gives the values.
        let default = combined.is_some().then_some(1.0);
        surface.insert("metallicFactor".into(), number(unit(material.metallic.or(default).unwrap_or(0.0))));
        let roughness = material.roughness.or(default).or(material.shininess.map(roughness_of)).unwrap_or(0.5);
        surface.insert("roughnessFactor".into(), number(unit(roughness)));
        if let Some(texture) = combined {
            surface.insert("metallicRoughnessTexture".into(), texture);
        }
        out.insert("pbrMetallicRoughness".into(), surface.into());
        if let Some(map) = &material.normal_map
            && let Some(Value::Object(mut texture)) = self.texture(map, folder)
        {
            if map.strength != 1.0 {
                texture.insert("scale".into(), number(map.strength));
            }
            out.insert("normalTexture".into(), texture.into());
        }
        self.emission(material, folder, &mut out);
        let same_map = |map: &ObjTexture| material.diffuse_map.as_ref().is_some_and(|diffuse| diffuse.path == map.path);
        let cut_out = material.opacity_map.as_ref().is_some_and(same_map);
        if material.opacity_map.is_some() && !cut_out {
            self.note(format!("material `{}`: its separate opacity texture was left out", material.name));
        }
        if opacity < 1.0 || cut_out {
            out.insert("alphaMode".into(), "BLEND".into());
        }
        out.into()
    }

    fn emission(&mut self, material: &ObjMaterial, folder: &str, out: &mut Map<String, Value>) {
        let texture = material.emissive_map.as_ref().and_then(|map| self.texture(map, folder));
        let color = material.emissive.unwrap_or([0.0; 3]).map(|value| value.max(0.0));
        let strongest = color.into_iter().fold(0.0, f32::max);
        let textured = texture.is_some();
        if let Some(texture) = texture {
            out.insert("emissiveTexture".into(), texture);
        }
        match strongest {
            0.0 if textured => {
                out.insert("emissiveFactor".into(), numbers(&[1.0; 3]));
            }
            0.0 => {}
            ..=1.0 => {
                out.insert("emissiveFactor".into(), numbers(&color));
            }
            _ => {
                out.insert("emissiveFactor".into(), numbers(&color.map(|value| value / strongest)));
                let strength = json!({ "emissiveStrength": number(strongest) });
                out.insert("extensions".into(), json!({ "KHR_materials_emissive_strength": strength }));
                self.use_extension("KHR_materials_emissive_strength");
            }
        }
    }

    /// A reference to a texture, if its image is found and has a format that glTF allows.
    fn texture(&mut self, map: &ObjTexture, folder: &str) -> Option<Value> {
        let source = self.image(map, folder)?;
        let mut texture = json!({ "source": source });
        if map.clamp {
            let sampler = json!({ "wrapS": 33071, "wrapT": 33071 });
            if self.material_set.samplers.is_empty() {
                self.material_set.samplers.push(sampler);
            }
            texture["sampler"] = 0.into();
        }
        let index = self.material_set.textures.iter().position(|known| *known == texture).unwrap_or_else(|| {
            self.material_set.textures.push(texture);
            self.material_set.textures.len() - 1
        });
        let mut reference = json!({ "index": index });
        let ([su, sv], [ou, ov]) = (map.scale, map.offset);
        if map.scale != [1.0; 2] || map.offset != [0.0; 2] {
            // Texture coordinates are turned upside down on reading, so the shift is from the other end.
            let offset = numbers(&[ou, 1.0 - sv - ov]);
            let transform = json!({ "offset": offset, "scale": numbers(&[su, sv]) });
            reference["extensions"] = json!({ "KHR_texture_transform": transform });
            self.use_extension("KHR_texture_transform");
        }
        Some(reference)
    }

    fn image(&mut self, map: &ObjTexture, folder: &str) -> Option<usize> {
        let places = candidates(folder, &map.path);
        if let Some(known) = places.iter().find_map(|place| self.images.get(place)) {
            return *known;
        }
        let mut refused = None;
        for place in &places {
            let bytes = match (self.sidecar)(place) {
                None => continue,
                Some(SidecarFile::Bytes(bytes)) => bytes,
                Some(SidecarFile::Refused(reason)) => {
                    refused.get_or_insert(reason);
                    continue;
                }
            };
            let image = self.keep_image(place, bytes);
            self.images.insert(place.clone(), image);
            return image;
        }
        self.note(match (refused, safe_relative_path(&map.path)) {
            (Some(reason), _) => format!("the texture `{}` was left out: {reason}", map.path),
            (None, Some(_)) => format!("the texture `{}` was not found", map.path),
            (None, None) => format!("the texture `{}` lies outside the model's folder and was not opened", map.path),
        });
        self.images.extend(places.into_iter().map(|place| (place, None)));
        None
    }

    fn keep_image(&mut self, place: &str, bytes: Vec<u8>) -> Option<usize> {
        let mime = match &bytes[..] {
            [0x89, b'P', b'N', b'G', ..] => "image/png",
            [0xff, 0xd8, 0xff, ..] => "image/jpeg",
            _ => {
                self.note(format!("the texture `{place}` is neither PNG nor JPEG and was left out"));
                return None;
            }
        };
        if self.bytes + bytes.len() > MOST_IMAGE_BYTES {
            self.note(format!("the texture `{place}` was left out: all together are larger than 256 MiB"));
            return None;
        }
        self.bytes += bytes.len();
        self.material_set.images.push(Image { name: place.into(), mime: mime.into(), bytes, rest: Map::new() });
        Some(self.material_set.images.len() - 1)
    }

    fn use_extension(&mut self, name: &str) {
        if !self.material_set.extensions_used.iter().any(|used| used == name) {
            self.material_set.extensions_used.push(name.into());
        }
    }

    fn note(&mut self, note: String) {
        if self.notes.len() < MOST_NOTES && !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }
}

/// The roughness that matches a Phong exponent in appearance, as Blender's importer computes it.
fn roughness_of(shininess: f32) -> f32 {
    1.0 - (shininess.clamp(0.0, 1000.0) / 1000.0).sqrt()
}

fn unit(value: f32) -> f32 {
    value.clamp(0.0, 1.0)
}

/// A float as the number with the fewest digits that reads back to it.
fn number(value: f32) -> Value {
    value.to_string().parse::<f64>().unwrap_or(0.0).into()
}

fn numbers(values: &[f32]) -> Value {
    values.iter().map(|value| number(*value)).collect()
}
