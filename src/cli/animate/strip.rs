//! A strip of pictures of a clip, side by side.

use std::sync::Arc;

use bevy::math::{Affine3A, UVec2, Vec3};
use image::{ImageFormat, RgbImage};

use super::AnimateArgs;
use crate::{
    algo::view::View,
    cli::{
        Failure, Report,
        build::{loaded, open_all},
        progress::spinning,
    },
    files::{RealDisk, save_atomic},
    headless::Workbench,
    mesh::skinning::skin_points,
    plugins::{drawing::RigDrawing, surface::RigMesh},
    render::{PictureError, PictureSettings, take_picture},
    rig::{
        NodeType, PoseOffset, Rig, RigEdit, SkinData, Uid,
        animation::{RigClip, SampledPose},
        deform::DeformSkeleton,
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
    if clips.len() > 1 {
        report.notes.push(format!(
            "the strip shows \"{}\", the first of {} clips; choose another one with --clip",
            clip.name,
            clips.len()
        ));
    }
    let meshes = loaded(&args.meshes, report)?;
    open_all(meshes, bench, &args.weights, report)?;
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
            drawing: RigDrawing { rig: args.meshes.is_empty(), ..RigDrawing::default() },
            build: true,
            bounds: Some(bounds),
            ..PictureSettings::default()
        };
        let rig = posed(bench.rig(), pose)?;
        let meshes = bench.meshes().cloned().collect();
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

/// Weighted points of a mesh, which follow the joints.
struct Body<'a> {
    points: &'a [Vec3],
    skin: Option<&'a SkinData>,
    /// Joint of each joint of the weights, with its inverse at rest.
    holders: Vec<Option<(Uid, Affine3A)>>,
}

impl<'a> Body<'a> {
    /// Points of a mesh of the workbench; `None` without any.
    fn of(bench: &'a Workbench, mesh: &'a RigMesh) -> Option<Self> {
        let points = &mesh.rest.points[..];
        let skin = bench.rig().skin(mesh.uid).map(Arc::as_ref);
        let skeleton = DeformSkeleton::new(bench.rig(), bench.built());
        let held = skin.map(|skin| skeleton.holders(bench.rig(), skin)).unwrap_or_default();
        let holder = |at: usize| {
            let joint = &skeleton.joints()[at];
            (joint.uid, Affine3A::from(joint.rest).inverse())
        };
        let holders = held.into_iter().map(|at| at.map(holder)).collect();
        (!points.is_empty()).then_some(Self { points, skin, holders })
    }

    /// Box around the points in a pose.
    fn around(&self, state: &RigState) -> [Vec3; 2] {
        let Some(skin) = self.skin else { return around(self.points.iter().copied()) };
        let moved = |holder: &Option<(Uid, Affine3A)>| {
            let (joint, back) = holder.as_ref()?;
            Some(state.global(*joint)?.affine() * *back)
        };
        let matrices: Vec<Affine3A> =
            self.holders.iter().map(|holder| moved(holder).unwrap_or(Affine3A::IDENTITY)).collect();
        let mut posed = Vec::new();
        skin_points(self.points, &skin.weights, &matrices, &mut posed);
        around(posed.into_iter())
    }
}

fn around(places: impl Iterator<Item = Vec3>) -> [Vec3; 2] {
    places.fold([Vec3::MAX, Vec3::MIN], |[low, high], place| [low.min(place), high.max(place)])
}

/// Boxes of one size around the meshes in each pose, or around the joints, with some room for flesh.
fn boxes(bench: &Workbench, poses: &[SampledPose]) -> Result<Vec<[Vec3; 2]>, Failure> {
    let program = bench.runtime()?.state().program();
    let mut state = RigState::new(Arc::clone(program));
    let bodies: Vec<Body> = bench.meshes().filter_map(|mesh| Body::of(bench, mesh)).collect();
    let around: Vec<[Vec3; 2]> = poses
        .iter()
        .map(|pose| {
            strike(&mut state, pose);
            let joints = program.nodes().iter().zip(state.globals()).filter(|(node, _)| node.kind == NodeType::Joint);
            let of_bodies = bodies.iter().map(|body| body.around(&state));
            let whole = of_bodies.reduce(|[a, b], [low, high]| [a.min(low), b.max(high)]);
            whole.unwrap_or_else(|| around(joints.map(|(_, at)| at.translation)))
        })
        .collect();
    let room = if bodies.is_empty() { 0.55 } else { 0.51 };
    let mut half = around.iter().map(|[low, high]| room * (*high - *low)).fold(Vec3::ZERO, Vec3::max);
    // All pictures have one ground, and room for the highest pose.
    let low = around.iter().map(|[low, _]| low.y).fold(f32::MAX, f32::min);
    let high = around.iter().map(|[_, high]| high.y).fold(f32::MIN, f32::max);
    half.y = room * (high - low);
    Ok(around
        .iter()
        .map(|[a, b]| {
            let middle = a.midpoint(*b).with_y(low.midpoint(high));
            [middle - half, middle + half]
        })
        .collect())
}
