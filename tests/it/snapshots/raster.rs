//! Rasteriser of egui's triangles on the processor: the same pixels on every machine, without a graphics adapter.
//!
//! Corners are rounded to 1/256 of a pixel and edges are integers, so that no pixel on the border of two triangles depends
//! on how a processor rounds. Colours have premultiplied alpha.

use std::{collections::BTreeMap, sync::Arc};

use bevy_egui::egui::{
    Color32, ColorImage, ImageData, Mesh, Pos2, TextureId, TexturesDelta,
    epaint::{ClippedPrimitive, Primitive, WHITE_UV},
};

use super::picture::Picture;

/// Steps between two pixels.
const STEPS: i64 = 256;

/// Everything of a frame that a renderer draws.
#[derive(Clone)]
pub struct Scene {
    pub textures: Textures,
    pub primitives: Vec<ClippedPrimitive>,
    pub pixels_per_point: f32,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Colour below everything.
    pub ground: Color32,
}

/// Space in which translucent colours are blended with those below, and pixels of textures with those beside them.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Blending {
    /// Values as they are stored: what egui's own painters do, and what the stored pictures show.
    Gamma,
    /// Amounts of light: what Bevy's renderer does, in which shadows and soft edges are therefore lighter.
    Linear,
}

/// Textures of a context, which come in parts.
#[derive(Clone, Default)]
pub struct Textures(BTreeMap<TextureId, Arc<ColorImage>>);

impl Textures {
    /// Whole textures by their names.
    pub fn iter(&self) -> impl Iterator<Item = (TextureId, &Arc<ColorImage>)> {
        self.0.iter().map(|(id, image)| (*id, image))
    }

    /// Takes over what a frame has changed.
    pub fn apply(&mut self, mut delta: TexturesDelta) {
        for (id, changes) in delta.set.drain() {
            for change in changes {
                let ImageData::Color(image) = &change.image;
                match (change.pos, self.0.get_mut(&id)) {
                    (Some([left, top]), Some(whole)) => {
                        let whole = Arc::make_mut(whole);
                        let [width, height] = image.size;
                        for row in 0..height {
                            let to = (top + row) * whole.size[0] + left;
                            let from = row * width;
                            whole.pixels[to..to + width].copy_from_slice(&image.pixels[from..from + width]);
                        }
                    }
                    _ => {
                        self.0.insert(id, Arc::clone(image));
                    }
                }
            }
        }
        // A texture that a frame frees may still be painted in it; it costs nothing to keep it.
        delta.free.clear();
    }
}

/// Draws a scene.
pub fn draw(scene: &Scene, blending: Blending) -> Picture {
    let [width, height] = scene.size;
    let scale = scene.pixels_per_point;
    let mut pixels = vec![scene.ground; width * height];
    for ClippedPrimitive { clip_rect, primitive } in &scene.primitives {
        let Primitive::Mesh(mesh) = primitive else { continue };
        let pixel = |at: f32, most: usize| (at * scale).round().clamp(0.0, most as f32) as i64;
        let clip = Clip {
            low: [pixel(clip_rect.min.x, width), pixel(clip_rect.min.y, height)],
            high: [pixel(clip_rect.max.x, width), pixel(clip_rect.max.y, height)],
        };
        let texture = scene.textures.0.get(&mesh.texture_id).map(|texture| &**texture);
        let brush = Brush { texture, blending, clip };
        fill(&mut pixels, width, mesh, scale, brush);
    }
    let rgb = pixels.iter().flat_map(|color| [color.r(), color.g(), color.b()]).collect();
    Picture::new(width, height, rgb)
}

/// Texture, space and area that the triangles of a mesh have in common.
#[derive(Clone, Copy)]
struct Brush<'a> {
    texture: Option<&'a ColorImage>,
    blending: Blending,
    clip: Clip,
}

/// Pixels that are drawn: from `low` to before `high`.
#[derive(Clone, Copy)]
struct Clip {
    low: [i64; 2],
    high: [i64; 2],
}

#[derive(Clone, Copy)]
struct Corner {
    at: [i64; 2],
    uv: Pos2,
    color: [f32; 4],
}

fn fill(pixels: &mut [Color32], width: usize, mesh: &Mesh, scale: f32, brush: Brush) {
    let corner = |index: u32| {
        let vertex = mesh.vertices[index as usize];
        let step = |at: f32| (at * scale * STEPS as f32).round() as i64;
        let color = vertex.color.to_array().map(f32::from);
        Corner { at: [step(vertex.pos.x), step(vertex.pos.y)], uv: vertex.uv, color }
    };
    for triangle in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [corner(triangle[0]), corner(triangle[1]), corner(triangle[2])];
        triangle_of(pixels, width, [a, b, c], brush);
    }
}

/// Twice the signed area of a triangle.
fn area(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn triangle_of(pixels: &mut [Color32], width: usize, [a, mut b, mut c]: [Corner; 3], brush: Brush) {
    let Brush { texture, blending, clip } = brush;
    let mut whole = area(a.at, b.at, c.at);
    if whole == 0 {
        return;
    }
    if whole < 0 {
        std::mem::swap(&mut b, &mut c);
        whole = -whole;
    }
    let is_plain = [a, b, c].iter().all(|corner| corner.uv == WHITE_UV);
    let is_even = a.color == b.color && a.color == c.color;
    let range = |axis: usize| {
        let ends = [a.at[axis], b.at[axis], c.at[axis]];
        let low = ends.iter().min().copied().unwrap_or_default().div_euclid(STEPS).max(clip.low[axis]);
        let high = (ends.iter().max().copied().unwrap_or_default().div_euclid(STEPS) + 1).min(clip.high[axis]);
        low..high
    };
    // Pixels on an edge belong to the triangle on one side of it alone: that whose upper or left edge it is.
    let bias = |from: [i64; 2], to: [i64; 2]| {
        let is_top_left = to[1] < from[1] || to[1] == from[1] && to[0] > from[0];
        i64::from(!is_top_left)
    };
    let biases = [bias(b.at, c.at), bias(c.at, a.at), bias(a.at, b.at)];
    for y in range(1) {
        for x in range(0) {
            let at = [x * STEPS + STEPS / 2, y * STEPS + STEPS / 2];
            let parts = [area(b.at, c.at, at), area(c.at, a.at, at), area(a.at, b.at, at)];
            if parts.iter().zip(biases).any(|(part, bias)| *part < bias) {
                continue;
            }
            let share = parts.map(|part| part as f32 / whole as f32);
            let mix = |of: fn(&Corner) -> f32| of(&a) * share[0] + of(&b) * share[1] + of(&c) * share[2];
            let mut color = if is_even {
                a.color
            } else {
                [
                    mix(|corner| corner.color[0]),
                    mix(|corner| corner.color[1]),
                    mix(|corner| corner.color[2]),
                    mix(|corner| corner.color[3]),
                ]
            };
            if !is_plain && let Some(texture) = texture {
                let texel = sample(texture, [mix(|corner| corner.uv.x), mix(|corner| corner.uv.y)], blending);
                for (part, texel) in color.iter_mut().zip(texel) {
                    *part *= texel / 255.0;
                }
            }
            let pixel = &mut pixels[y as usize * width + x as usize];
            *pixel = blended(color, *pixel, blending);
        }
    }
}

/// Colour with premultiplied alpha, from 0 to 255, over another one.
fn blended(color: [f32; 4], below: Color32, blending: Blending) -> Color32 {
    let rest = 1.0 - color[3] / 255.0;
    let below = below.to_array().map(f32::from);
    let over = |n: usize| match blending {
        Blending::Linear if rest > 0.0 => gamma(light(color[n]) + light(below[n]) * rest),
        _ => color[n] + below[n] * rest,
    };
    let part = |n: usize| over(n).round().clamp(0.0, 255.0) as u8;
    Color32::from_rgb(part(0), part(1), part(2))
}

/// Amount of light, from 0 to 1, of a stored value from 0 to 255.
fn light(value: f32) -> f32 {
    let value = value / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Stored value, from 0 to 255, of an amount of light from 0 to 1.
fn gamma(light: f32) -> f32 {
    255.0 * if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// Colour of a texture at a place, between its four nearest pixels.
fn sample(texture: &ColorImage, [u, v]: [f32; 2], blending: Blending) -> [f32; 4] {
    let [width, height] = texture.size;
    let (x, y) = (u * width as f32 - 0.5, v * height as f32 - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (right_share, lower_share) = (x - left, y - top);
    let pixel = |dx: f32, dy: f32| {
        let x = (left + dx).clamp(0.0, width as f32 - 1.0) as usize;
        let y = (top + dy).clamp(0.0, height as f32 - 1.0) as usize;
        texture.pixels[y * width + x].to_array().map(f32::from)
    };
    let corners = [pixel(0.0, 0.0), pixel(1.0, 0.0), pixel(0.0, 1.0), pixel(1.0, 1.0)];
    std::array::from_fn(|n| {
        // Alpha is a share in both spaces.
        let is_light = blending == Blending::Linear && n < 3;
        let values = corners.map(|corner| if is_light { light(corner[n]) } else { corner[n] });
        let upper = values[0] * (1.0 - right_share) + values[1] * right_share;
        let lower = values[2] * (1.0 - right_share) + values[3] * right_share;
        let mixed = upper * (1.0 - lower_share) + lower * lower_share;
        if is_light { gamma(mixed) } else { mixed }
    })
}
