//! Materials of a model as Bevy's.
//!
//! A model carries glTF material objects unread. This module reads the properties that a viewport shows: base colour,
//! metalness and roughness, normals, occlusion, emission, transparency, sides, unlit materials, transparent and shifted
//! textures.

use std::collections::HashMap;

use bevy::{
    asset::AssetHandleProvider,
    image::{ImageAddressMode, ImageFilterMode, ImageSamplerDescriptor},
    math::Affine2,
    mesh::UvChannel,
    prelude::*,
    render::render_resource::Face,
};
use serde_json::{Map, Value};

use super::textures::{TextureBudget, TextureError, decode};
use crate::mesh::model::MaterialSet;

/// Largest opacity of see-through surfaces.
const XRAY_OPACITY: f32 = 0.14;
/// Light of see-through surfaces themselves, so that dark ones are seen, too.
const XRAY_GLOW: f32 = 0.2;

/// An image used by a material, with its sampler.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct TextureUse {
    /// Index into [`MaterialSet::images`].
    pub image: usize,
    /// Index into [`MaterialSet::samplers`].
    pub sampler: Option<usize>,
    /// Colour space: `true` for colours (sRGB), `false` for numbers.
    pub srgb: bool,
}

/// A model's materials for the renderer, and the images they wait for.
#[derive(Debug, Default)]
pub(super) struct Materials {
    /// Materials, one for each of the model's.
    pub materials: Vec<StandardMaterial>,
    /// The images, each with its handle in the materials.
    pub textures: Vec<(TextureUse, Handle<Image>)>,
}

/// Neutral material for parts without one.
pub(super) fn clay() -> StandardMaterial {
    StandardMaterial {
        base_color: Color::srgb(0.80, 0.78, 0.75),
        perceptual_roughness: 0.75,
        reflectance: 0.3,
        double_sided: true,
        cull_mode: None,
        ..default()
    }
}

/// Material under weight colours: matt, so that a colour does not depend on the light.
pub(super) fn painted() -> StandardMaterial {
    StandardMaterial {
        base_color: Color::WHITE,
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        double_sided: true,
        cull_mode: None,
        ..default()
    }
}

/// The see-through variant of a material. Its light is added to that of all behind it, because a sum does not depend on the order
/// of the triangles: those of one mesh are not drawn from far to near, and blending would show that as patches.
pub(super) fn xray(mut material: StandardMaterial) -> StandardMaterial {
    let opacity = material.base_color.alpha() * XRAY_OPACITY;
    material.base_color.set_alpha(opacity);
    material.alpha_mode = AlphaMode::Add;
    material.emissive = LinearRgba::rgb(XRAY_GLOW, XRAY_GLOW, XRAY_GLOW);
    material.emissive_texture = None;
    material.double_sided = true;
    material.cull_mode = None;
    material
}

/// Translates all materials. Images get handles at once and their content later, from [`decode_textures`].
pub(super) fn translate(material_set: &MaterialSet, images: &AssetHandleProvider) -> Materials {
    let mut translation = Translation { material_set, images, known: HashMap::new(), textures: Vec::new() };
    let materials = material_set.materials.iter().map(|material| translation.material(material)).collect();
    Materials { materials, textures: translation.textures }
}

/// Decodes the images of a model one after the other.
pub(super) fn decode_textures(
    material_set: &MaterialSet,
    textures: &[(TextureUse, Handle<Image>)],
) -> impl Iterator<Item = (Handle<Image>, Result<Image, TextureError>)> {
    let mut budget = TextureBudget::default();
    textures.iter().filter_map(move |(texture, handle)| {
        let source = material_set.images.get(texture.image)?;
        let sampler = texture.sampler.and_then(|sampler| material_set.samplers.get(sampler));
        Some((handle.clone(), decode(source, texture.srgb, sampler_of(sampler), &mut budget)))
    })
}

/// A material without the textures that are `missing`.
pub(super) fn without_textures(
    material: &StandardMaterial,
    missing: impl Fn(&Handle<Image>) -> bool,
) -> StandardMaterial {
    let mut material = material.clone();
    for texture in [
        &mut material.base_color_texture,
        &mut material.metallic_roughness_texture,
        &mut material.normal_map_texture,
        &mut material.occlusion_texture,
        &mut material.emissive_texture,
    ] {
        texture.take_if(|texture| missing(texture));
    }
    material
}

struct Translation<'a> {
    material_set: &'a MaterialSet,
    images: &'a AssetHandleProvider,
    known: HashMap<TextureUse, Handle<Image>>,
    textures: Vec<(TextureUse, Handle<Image>)>,
}

/// A texture as a material refers to it.
struct Texture {
    image: Handle<Image>,
    channel: UvChannel,
    transform: Option<Affine2>,
}

impl Translation<'_> {
    fn material(&mut self, value: &Value) -> StandardMaterial {
        let none = Map::new();
        let map = value.as_object().unwrap_or(&none);
        let surface = map.get("pbrMetallicRoughness").and_then(Value::as_object).unwrap_or(&none);
        let extensions = map.get("extensions").and_then(Value::as_object).unwrap_or(&none);
        let double_sided = map.get("doubleSided").and_then(Value::as_bool).unwrap_or(false);
        let [r, g, b, a] = numbers(surface.get("baseColorFactor"), [1.0; 4]);
        let strength = extensions.get("KHR_materials_emissive_strength").and_then(|e| e.get("emissiveStrength"));
        let strength = number(strength, 1.0).max(0.0);
        let [er, eg, eb] = numbers(map.get("emissiveFactor"), [0.0; 3]).map(|factor| factor.max(0.0) * strength);
        let mut material = StandardMaterial {
            base_color: Color::linear_rgba(r, g, b, a),
            metallic: number(surface.get("metallicFactor"), 1.0).clamp(0.0, 1.0),
            perceptual_roughness: number(surface.get("roughnessFactor"), 1.0).clamp(0.0, 1.0),
            emissive: LinearRgba::rgb(er, eg, eb),
            double_sided,
            cull_mode: if double_sided { None } else { Some(Face::Back) },
            unlit: extensions.contains_key("KHR_materials_unlit"),
            alpha_mode: match map.get("alphaMode").and_then(Value::as_str) {
                Some("MASK") => AlphaMode::Mask(number(map.get("alphaCutoff"), 0.5)),
                Some("BLEND") => AlphaMode::Blend,
                _ => AlphaMode::Opaque,
            },
            ..default()
        };
        // Bevy has one transform for all textures of a material; that of the base colour matters most.
        let mut transform = None;
        let mut texture = |value: Option<&Value>, srgb: bool| {
            let texture = self.texture(value?.as_object()?, srgb)?;
            transform = transform.or(texture.transform);
            Some((texture.image, texture.channel))
        };
        if let Some((image, channel)) = texture(surface.get("baseColorTexture"), true) {
            (material.base_color_texture, material.base_color_channel) = (Some(image), channel);
        }
        if let Some((image, channel)) = texture(surface.get("metallicRoughnessTexture"), false) {
            (material.metallic_roughness_texture, material.metallic_roughness_channel) = (Some(image), channel);
        }
        if let Some((image, channel)) = texture(map.get("normalTexture"), false) {
            (material.normal_map_texture, material.normal_map_channel) = (Some(image), channel);
        }
        if let Some((image, channel)) = texture(map.get("occlusionTexture"), false) {
            (material.occlusion_texture, material.occlusion_channel) = (Some(image), channel);
        }
        if let Some((image, channel)) = texture(map.get("emissiveTexture"), true) {
            (material.emissive_texture, material.emissive_channel) = (Some(image), channel);
        }
        material.uv_transform = transform.unwrap_or(Affine2::IDENTITY);
        material
    }

    fn texture(&mut self, reference: &Map<String, Value>, srgb: bool) -> Option<Texture> {
        let moved = reference.get("extensions").and_then(|extensions| extensions.get("KHR_texture_transform"));
        let set = moved.and_then(|moved| moved.get("texCoord")).or(reference.get("texCoord"));
        let channel = match set.and_then(Value::as_u64).unwrap_or(0) {
            0 => UvChannel::Uv0,
            1 => UvChannel::Uv1,
            _ => return None,
        };
        let transform = moved.map(|moved| {
            let [x, y] = numbers(moved.get("scale"), [1.0; 2]);
            // glTF turns counter-clockwise with v pointing down.
            let angle = -number(moved.get("rotation"), 0.0);
            let offset = Vec2::from(numbers(moved.get("offset"), [0.0; 2]));
            let (sin, cos) = bevy::math::ops::sin_cos(angle);
            Affine2::from_mat2_translation(Mat2::from_cols(Vec2::new(cos, sin) * x, Vec2::new(-sin, cos) * y), offset)
        });
        let index = |value: Option<&Value>| value.and_then(Value::as_u64).map(|index| index as usize);
        let texture = self.material_set.textures.get(index(reference.get("index"))?)?;
        let image = index(texture.get("source")).filter(|image| *image < self.material_set.images.len())?;
        let texture = TextureUse { image, sampler: index(texture.get("sampler")), srgb };
        let (images, textures) = (self.images, &mut self.textures);
        let image = self.known.entry(texture).or_insert_with(|| {
            let handle: Handle<Image> = images.reserve_handle().typed();
            textures.push((texture, handle.clone()));
            handle
        });
        Some(Texture { image: image.clone(), channel, transform })
    }
}

/// Sampler of a glTF texture; repeating and smooth by default.
fn sampler_of(sampler: Option<&Value>) -> ImageSamplerDescriptor {
    let code = |key: &str| sampler.and_then(|sampler| sampler.get(key)).and_then(Value::as_u64);
    let wrap = |key: &str| match code(key) {
        Some(33071) => ImageAddressMode::ClampToEdge,
        Some(33648) => ImageAddressMode::MirrorRepeat,
        _ => ImageAddressMode::Repeat,
    };
    let filter = |nearest: bool| if nearest { ImageFilterMode::Nearest } else { ImageFilterMode::Linear };
    let min = code("minFilter");
    ImageSamplerDescriptor {
        address_mode_u: wrap("wrapS"),
        address_mode_v: wrap("wrapT"),
        mag_filter: filter(code("magFilter") == Some(9728)),
        min_filter: filter(matches!(min, Some(9728 | 9984 | 9986))),
        mipmap_filter: filter(matches!(min, Some(9984 | 9985))),
        ..default()
    }
}

fn number(value: Option<&Value>, default: f32) -> f32 {
    value.and_then(Value::as_f64).map(|value| value as f32).filter(|value| value.is_finite()).unwrap_or(default)
}

fn numbers<const N: usize>(value: Option<&Value>, default: [f32; N]) -> [f32; N] {
    let list = value.and_then(Value::as_array);
    std::array::from_fn(|place| number(list.and_then(|list| list.get(place)), default[place]))
}
