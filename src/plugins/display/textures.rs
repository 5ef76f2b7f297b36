//! Decoded images of a model: bounded in size, in a format that every graphics card takes, with mipmaps.

use bevy::{
    asset::RenderAssetUsages,
    image::{CompressedImageFormats, Image, ImageSampler, ImageSamplerDescriptor, ImageType},
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};

use crate::mesh::model;

/// Largest size in bytes of the decoded images of one model together.
const MOST_BYTES: u64 = 256 << 20;
/// Longest side of a texture; larger images are halved until they fit. Graphics cards take more, not all do.
const MOST_SIDE: u32 = 8192;

/// Remaining budget of bytes for the images of one model.
pub(super) struct TextureBudget {
    bytes: u64,
}

impl Default for TextureBudget {
    fn default() -> Self {
        Self { bytes: MOST_BYTES }
    }
}

/// Reason why an image is not shown; a sentence for people without its full stop.
#[derive(Debug, thiserror::Error)]
#[error("The image \"{name}\" is not shown: {fault}")]
pub(super) struct TextureError {
    /// Name of the image.
    name: String,
    /// Fault of the image.
    #[source]
    fault: TextureFault,
}

/// Fault of an image.
#[derive(Debug, thiserror::Error)]
pub(super) enum TextureFault {
    /// The image has no content.
    #[error("its file was not found")]
    NoFile,
    /// The content has an unknown format.
    #[error("it is neither PNG nor JPEG, or damaged")]
    Format,
    /// The image takes more memory than is left for the model.
    #[error("{width} by {height} pixels are more than the 256 MiB that a model's images may take")]
    TooLarge {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The content cannot be decoded.
    #[error(transparent)]
    Decode(#[from] bevy::image::TextureError),
    /// The decoded pixels have an unknown format.
    #[error("its pixels have an unknown format")]
    Pixels,
}

/// Decodes a PNG or JPEG file. `srgb` is `true` for colours and `false` for numbers.
pub(super) fn decode(
    source: &model::Image,
    srgb: bool,
    sampler: ImageSamplerDescriptor,
    budget: &mut TextureBudget,
) -> Result<Image, TextureError> {
    decode_image(source, srgb, sampler, budget).map_err(|fault| {
        let name = if source.name.is_empty() { "without a name" } else { &source.name };
        TextureError { name: name.to_owned(), fault }
    })
}

fn decode_image(
    source: &model::Image,
    srgb: bool,
    sampler: ImageSamplerDescriptor,
    budget: &mut TextureBudget,
) -> Result<Image, TextureFault> {
    if source.bytes.is_empty() {
        return Err(TextureFault::NoFile);
    }
    let (kind, width, height, sample) = header(&source.bytes).ok_or(TextureFault::Format)?;
    let bytes = u64::from(width) * u64::from(height) * 4 * u64::from(sample);
    if bytes > budget.bytes {
        return Err(TextureFault::TooLarge { width, height });
    }
    let image = Image::from_buffer(
        &source.bytes,
        ImageType::MimeType(kind),
        CompressedImageFormats::NONE,
        srgb,
        ImageSampler::Descriptor(sampler),
        RenderAssetUsages::RENDER_WORLD,
    )?;
    let (mut pixels, mut size) = rgba8(&image).ok_or(TextureFault::Pixels)?;
    while size[0].max(size[1]) > MOST_SIDE {
        (pixels, size) = halve(&pixels, size);
    }
    budget.bytes -= bytes;
    Ok(with_mips(image, pixels, size, srgb))
}

/// Media type, width, height and bytes a sample of an image file, by its header alone: a decoder would reserve memory
/// for whatever a file claims.
fn header(bytes: &[u8]) -> Option<(&'static str, u32, u32, u8)> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        let number = |at: usize| Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
        let depth = *bytes.get(24)?;
        return Some(("image/png", number(16)?, number(20)?, if depth > 8 { 2 } else { 1 }));
    }
    if !bytes.starts_with(b"\xFF\xD8") {
        return None;
    }
    let short = |at: usize| Some(u32::from(u16::from_be_bytes(bytes.get(at..at + 2)?.try_into().ok()?)));
    let mut at = 2;
    loop {
        if *bytes.get(at)? != 0xFF {
            return None;
        }
        match *bytes.get(at + 1)? {
            0xFF => at += 1,
            0x01 | 0xD0..=0xD9 => at += 2,
            // Start of frame: all markers of its range but the tables.
            kind @ 0xC0..=0xCF if !matches!(kind, 0xC4 | 0xC8 | 0xCC) => {
                return Some(("image/jpeg", short(at + 7)?, short(at + 5)?, 1));
            }
            _ => at += 2 + short(at + 2)? as usize,
        }
    }
}

/// The pixels as four bytes each. Sixteen bits a channel become eight: not every graphics card takes more.
fn rgba8(image: &Image) -> Option<(Vec<u8>, [u32; 2])> {
    let data = image.data.as_deref()?;
    let size = [image.width(), image.height()];
    let high =
        |pixel: &[u8], channel: usize| (u16::from_ne_bytes([pixel[2 * channel], pixel[2 * channel + 1]]) >> 8) as u8;
    let pixels = match image.texture_descriptor.format {
        TextureFormat::Rgba8Unorm | TextureFormat::Rgba8UnormSrgb => data.to_vec(),
        TextureFormat::R16Uint => {
            data.chunks_exact(2).flat_map(|p| [high(p, 0), high(p, 0), high(p, 0), 255]).collect()
        }
        TextureFormat::Rg16Uint => {
            data.chunks_exact(4).flat_map(|p| [high(p, 0), high(p, 0), high(p, 0), high(p, 1)]).collect()
        }
        TextureFormat::Rgba16Unorm => {
            data.chunks_exact(8).flat_map(|p| [high(p, 0), high(p, 1), high(p, 2), high(p, 3)]).collect()
        }
        _ => return None,
    };
    let whole = pixels.len() as u64 == u64::from(size[0]) * u64::from(size[1]) * 4 && !pixels.is_empty();
    whole.then_some((pixels, size))
}

/// The image at full size and at every half size down to one pixel.
fn with_mips(image: Image, pixels: Vec<u8>, size: [u32; 2], srgb: bool) -> Image {
    let format = if srgb { TextureFormat::Rgba8UnormSrgb } else { TextureFormat::Rgba8Unorm };
    let [width, height] = size;
    let mut all = pixels.clone();
    let (mut level, mut level_size, mut levels) = (pixels, size, 1);
    while level_size != [1, 1] {
        (level, level_size) = halve(&level, level_size);
        all.extend_from_slice(&level);
        levels += 1;
    }
    let extent = Extent3d { width, height, depth_or_array_layers: 1 };
    let mut made = Image::new_uninit(extent, TextureDimension::D2, format, RenderAssetUsages::RENDER_WORLD);
    made.texture_descriptor.mip_level_count = levels;
    made.data = Some(all);
    made.sampler = image.sampler;
    made
}

/// Halves the size, each pixel the mean of four. Means of encoded colours are a little dark at hard edges, which is not
/// visible in a small mipmap.
fn halve(pixels: &[u8], [width, height]: [u32; 2]) -> (Vec<u8>, [u32; 2]) {
    let half = [(width / 2).max(1), (height / 2).max(1)];
    let mut out = Vec::with_capacity(half[0] as usize * half[1] as usize * 4);
    let at = |x: u32, y: u32| (y.min(height - 1) as usize * width as usize + x.min(width - 1) as usize) * 4;
    for y in 0..half[1] {
        for x in 0..half[0] {
            let four = [at(2 * x, 2 * y), at(2 * x + 1, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1)];
            for channel in 0..4 {
                let sum: u32 = four.iter().map(|place| u32::from(pixels[place + channel])).sum();
                out.push(((sum + 2) / 4) as u8);
            }
        }
    }
    (out, half)
}
