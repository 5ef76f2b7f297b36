//! A strip of pictures of a clip, side by side.

use std::sync::Arc;

use bevy::math::{UVec2, Vec3};
use image::{ImageFormat, RgbImage};

use super::AnimateArgs;
use crate::{
    algo::view::View,
    cli::{Failure, Report, binding::bind, limits, progress::spinning},
    files::{RealDisk, save_atomic},
    headless::Workbench,
    plugins::drawing::RigDrawing,
    render::{PictureError, PictureSettings, take_picture},
    rig::{
        NodeType, PoseOffset, Rig, RigEdit,
        animation::{RigClip, SampledPose},
    },
    solve::{bake_clip::strike, program::RigState},
};

/// Height of a picture, and its greatest width, in pixels.
const SIZE: UVec2 = UVec2::new(320, 420);
/// Greatest width of a strip in pixels.
const WIDTH: u32 = 8192;

/// Draws frames of the first clip at equal distances of time, seen from the left and a little from the front.
pub(super) fn draw(
    args: &AnimateArgs,
    bench: &mut Workbench,
    clips: &[RigClip],
    report: &mut Report,
) -> Result<(), Failure> {
    let Some(clip) = clips.first() else { return Ok(()) };
    if let Some(mesh) = &args.mesh {
        let model = limits::load_model(mesh)?;
        report.notes(model.notes.iter().cloned());
        bench.open(model, true)?;
        bind(bench, args.weights.settings(), &args.weights.claim, Vec::new(), report)?;
    }
    let count = u32::from(args.frames);
    let poses: Vec<SampledPose> = (0..count)
        .map(|frame| clip.sample(clip.range[0] + clip.duration() * frame as f32 / (count.max(2) - 1) as f32))
        .collect();
    let boxes = boxes(bench, &poses)?;
    let size = UVec2::new(SIZE.x.min(WIDTH / count), SIZE.y);
    let mut strip = RgbImage::new(size.x * count, size.y);
    let failed = |error: PictureError| Failure::Input(Box::new(error));
    for (number, (pose, bounds)) in poses.iter().zip(boxes).enumerate() {
        let settings = PictureSettings {
            size,
            view: View::Orbit(65.0, 8.0),
            drawing: RigDrawing { rig: args.mesh.is_none(), ..RigDrawing::default() },
            build: true,
            bounds: Some(bounds),
            ..PictureSettings::default()
        };
        let rig = posed(bench.rig(), pose)?;
        let meshes = bench.mesh().cloned().into_iter().collect();
        let image = spinning("drawing", || take_picture(rig, meshes, &settings)).map_err(failed)?;
        let encode = |error: String| failed(PictureError::Encode(error));
        let image = image.try_into_dynamic().map_err(|error| encode(error.to_string()))?.to_rgb8();
        image::imageops::replace(&mut strip, &image, i64::from(size.x) * number as i64, 0);
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    let written = strip.write_to(&mut bytes, ImageFormat::Png);
    written.map_err(|error| failed(PictureError::Encode(error.to_string())))?;
    save_atomic(&RealDisk, &args.output, bytes.get_ref()).map_err(|error| Failure::Input(Box::new(error)))
}

/// The document in a pose.
fn posed(rig: &Rig, pose: &SampledPose) -> Result<Rig, Failure> {
    let mut rig = rig.clone();
    let mut edits: Vec<RigEdit> = Vec::new();
    for (node, offset) in &pose.offsets {
        edits.push(RigEdit::SetOffset(*node, Some(*offset).filter(|offset| *offset != PoseOffset::IDENTITY)));
    }
    for (node, values) in &pose.values {
        edits.extend(values.iter().map(|(name, value)| RigEdit::SetAttributeValue(*node, name.clone(), Some(*value))));
    }
    rig.apply(&RigEdit::Batch(edits)).map_err(|error| Failure::Input(Box::new(error)))?;
    Ok(rig)
}

/// Boxes of one size around the joints in each pose, with some room for flesh.
fn boxes(bench: &Workbench, poses: &[SampledPose]) -> Result<Vec<[Vec3; 2]>, Failure> {
    let program = bench.runtime()?.state().program();
    let mut state = RigState::new(Arc::clone(program));
    let around: Vec<[Vec3; 2]> = poses
        .iter()
        .map(|pose| {
            strike(&mut state, pose);
            let joints = program.nodes().iter().zip(state.globals()).filter(|(node, _)| node.kind == NodeType::Joint);
            let places = || joints.clone().map(|(_, at)| at.translation);
            [places().fold(Vec3::MAX, Vec3::min), places().fold(Vec3::MIN, Vec3::max)]
        })
        .collect();
    let half = around.iter().map(|[low, high]| 0.55 * (*high - *low)).fold(Vec3::ZERO, Vec3::max);
    let low = around.iter().map(|[low, _]| low.y).fold(f32::MAX, f32::min);
    Ok(around
        .iter()
        .map(|[a, b]| {
            let middle = a.midpoint(*b).with_y(low + half.y);
            [middle - half, middle + half]
        })
        .collect())
}
