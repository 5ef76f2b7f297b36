//! The ends of the lips' line.

use glam::vec2;

use super::relief::{Relief, smooth};

/// Step along u and v, in eye distances.
const STEP: f32 = 0.008;

/// The end of the lips' line on one side (`side` −1 or 1), as (|u|, v), followed from `start` (the height of the line
/// in the middle).
pub(super) fn lip_corner(relief: &Relief, side: f32, start: f32, tall: f32) -> Option<(f32, f32)> {
    let reach = 0.09 * tall;
    let half = (reach / STEP) as usize;
    let count = 2 * half + 1;
    // Depth and height of the valley at height `v` of a column, on a line of `count` depths around the last height.
    let valley = |u: f32, around: f32, slack: usize| -> (f32, f32) {
        let span = half + slack;
        let mut line = relief.line(vec2(side * u, around + span as f32 * STEP), vec2(0.0, -STEP), count + 2 * slack);
        smooth(&mut line, 1);
        let mut best = (f32::NEG_INFINITY, around);
        for at in half..=half + 2 * slack {
            let Some(&here) = line.get(at) else { continue };
            let top = |window: &[f32]| window.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            let (above, below) = (top(&line[at - half..at]), top(&line[at + 1..(at + half + 1).min(line.len())]));
            let depth = above.min(below) - here;
            if depth > best.0 {
                best = (depth, around + (span as f32 - at as f32) * STEP);
            }
        }
        best
    };
    let mut track: Vec<(f32, f32, f32)> = Vec::new();
    let mut height = start;
    let mut u = 0.0;
    while u < 0.55 {
        let (depth, v) = valley(u, height, if u == 0.0 { 4 } else { 2 });
        height += (v - height) * 0.5;
        track.push((u, v, depth));
        u += STEP;
    }
    let strong = track.iter().filter(|step| step.0 < 0.16).map(|step| step.2.min(0.05)).fold(0.0, f32::max);
    if strong < 0.012 {
        return None;
    }
    let end = track.iter().skip(8).position(|step| step.2 < 0.12 * strong)? + 8;
    let (u, _, _) = *track.get(end)?;
    // The valley is lost past its end, so the height is taken a little before it.
    let (_, v, _) = *track.get(end * 9 / 10)?;
    Some((u, v))
}
