//! Clips packed into few bytes, with the skeleton that they move, for games.

use serde_json::json;

use super::{AnimateArgs, animated_rig::AnimatedRig, bake_settings, reduction, size_of, tolerance};
use crate::{
    cli::{Failure, Report, limits, progress::spinning, report::counted},
    files::{RealDisk, store_packed_clips},
    headless::posing::PoseError,
    rig::{Rig, animation::RigClip, bake::baked},
    solve::packed_clip::{PackedSkeleton, pack_clip},
};

/// Packs clips for the joints of the built rig, and saves them.
pub(super) fn store(
    args: &AnimateArgs,
    animated: &AnimatedRig,
    clips: &[RigClip],
    report: &mut Report,
) -> Result<(), Failure> {
    let built = animated.built().ok_or(PoseError::NotBuilt)?;
    let program = animated.program()?;
    let mut packed = PackedSkeleton::of(animated.rig(), built);
    let nodes = packed.baked_nodes();
    let tolerance = tolerance(args, height_of(&baked(animated.rig(), built)));
    let mut facts = Vec::new();
    let mut sums = [0, 0];
    for clip in clips {
        limits::check_time("packing the clips")?;
        let rate = args.fps.unwrap_or(clip.frame_rate);
        let settings = bake_settings(rate, tolerance);
        let done = spinning("packing", || pack_clip(program, clip, &nodes, &settings))
            .map_err(|error| Failure::Input(format!("clip \"{}\": {error}", clip.name).into()))?;
        // Without packing, each joint had a translation, a rotation and a scale of four bytes a number at each frame.
        let (before, after) = (done.frames() * nodes.len() * 10 * 4, done.to_bytes().len());
        sums = [sums[0] + before, sums[1] + after];
        let ratio = reduction(before, after);
        report.line(format!(
            "packed clip \"{}\": {}, {after} bytes instead of {before} ({ratio:.1} : 1)",
            done.name(),
            counted(done.frames(), "frame", "frames")
        ));
        facts.push(json!({
            "name": done.name(),
            "frames": done.frames(),
            "keys": done.key_count(),
            "bytes_before": before,
            "bytes_after": after,
            "reduction": ratio,
        }));
        packed.clips.push(done);
    }
    report.set("packed", facts);
    // The reduction is that of the file that is written; `motions` tells that of the keys on the rig.
    report.set("bytes_before", sums[0]);
    report.set("bytes_after", sums[1]);
    report.set("reduction", reduction(sums[0], sums[1]));
    report.set("joints", nodes.len());
    store_packed_clips(&RealDisk, &args.output, &packed)?;
    Ok(())
}

/// Size of a skeleton at rest.
fn height_of(rig: &Rig) -> f32 {
    let globals = rig.rest_globals();
    size_of(globals.iter().map(|(_, at)| at.translation.into()))
}
