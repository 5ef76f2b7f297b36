//! Eye openings: an eyeball, a hole or a dent between the lids in the front view.

use glam::{Vec2, vec2};

use crate::algo::face::depth_map::{DepthMap, NO_TRIANGLE};

use super::search::Pose;

/// The rim of one eye's opening, in head space (x, y).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EyeOpening {
    /// The corner away from the nose.
    pub outer: Vec2,
    /// The corner at the nose.
    pub inner: Vec2,
    /// Heights of the lower and the upper lid from the outer to the inner corner in even steps.
    pub lids: Vec<(f32, f32)>,
    /// Marks a dent in closed skin, without a hole or an eyeball.
    pub is_dent: bool,
}

impl EyeOpening {
    /// Heights of the lower and upper lid at `part` of the way from the outer to the inner corner.
    pub fn lid(&self, part: f32) -> (f32, f32) {
        let at = part.clamp(0.0, 1.0) * (self.lids.len().max(1) - 1) as f32;
        let index = at.floor() as usize;
        let t = at - index as f32;
        let get = |i: usize| self.lids.get(i).or(self.lids.last()).copied().unwrap_or_default();
        let (a, b) = (get(index), get(index + 1));
        (a.0 + (b.0 - a.0) * t, a.1 + (b.1 - a.1) * t)
    }
}

/// Looks for the opening of the eye on one side (`side` −1 right, 1 left). `eyeball` tells whether a triangle belongs
/// to an eyeball.
pub(super) fn find_opening(
    map: &DepthMap,
    pose: &Pose,
    side: f32,
    eyeball: impl Fn(u32) -> bool,
) -> Option<EyeOpening> {
    let frame = &map.frame;
    let corner = |u: f32, v: f32| frame.pixels(pose.center + vec2(u, v) * pose.size);
    let (a, b) = (corner(side * 0.08, -0.25), corner(side * 0.68, 0.28));
    let (x0, x1) = (a.x.min(b.x).max(0.0) as usize, (a.x.max(b.x) as usize).min(frame.width));
    let (y0, y1) = (a.y.min(b.y).max(0.0) as usize, (a.y.max(b.y) as usize).min(frame.height));
    if x0 + 4 >= x1 || y0 + 4 >= y1 {
        return None;
    }
    let (width, height) = (x1 - x0, y1 - y0);
    let depth = |x: usize, y: usize| map.at(x0 + x, y0 + y).unwrap_or(f32::NEG_INFINITY);
    let bare = |x: usize, y: usize| {
        let pixel = (y0 + y) * frame.width + x0 + x;
        map.triangle.get(pixel).is_none_or(|&triangle| triangle == NO_TRIANGLE || eyeball(triangle))
    };
    let mut open: Vec<bool> = (0..width * height).map(|pixel| bare(pixel % width, pixel / width)).collect();
    let scale = pose.size / frame.pixel;
    let least = (0.004 * scale * scale) as usize;
    let is_dent = open.iter().filter(|&&open| open).count() < least;
    if is_dent {
        // Without hole and eyeball: a dent that neither a tall nor a wide window fills.
        let (tall, wide) = (((0.085 * scale) as usize).max(2), ((0.2 * scale) as usize).max(2));
        let mut filled = vec![f32::INFINITY; width * height];
        for x in 0..width {
            let line: Vec<f32> = (0..height).map(|y| depth(x, y)).collect();
            close(&line, tall).into_iter().enumerate().for_each(|(y, depth)| filled[y * width + x] = depth);
        }
        for y in 0..height {
            let line: Vec<f32> = (0..width).map(|x| depth(x, y)).collect();
            let row = close(&line, wide).into_iter().zip(&mut filled[y * width..]);
            row.for_each(|(depth, slot)| *slot = slot.min(depth));
        }
        let dent = 0.02 * pose.size;
        open.iter_mut().enumerate().for_each(|(i, open)| *open = filled[i] - depth(i % width, i / width) > dent);
    }
    let ideal = corner(side * 0.35, 0.0) - vec2(x0 as f32, y0 as f32);
    let spot = largest(&open, width, height, |area, low, high| {
        let (wide, tall) = ((high.x - low.x) / scale, (high.y - low.y) / scale);
        let off = ((low + high) / 2.0).distance(ideal) / scale;
        if !(0.1..0.5).contains(&wide) || !(0.012..0.3).contains(&tall) || off > 0.25 {
            0.0
        } else {
            area * (1.0 - 3.0 * off).max(0.05)
        }
    })?;
    let columns: Vec<(usize, usize, usize)> = (0..width)
        .filter_map(|column| {
            let rows = (0..height).filter(|row| spot[row * width + column]);
            let (low, high) = rows.fold((usize::MAX, 0), |(low, high), row| (low.min(row), high.max(row)));
            (low != usize::MAX).then_some((column, low, high))
        })
        .collect();
    let (first, last) = (columns.first()?, columns.last()?);
    let place = |&(column, low, high): &(usize, usize, usize), nudge: f32| {
        frame.origin + (vec2((x0 + column) as f32 + nudge, y0 as f32 + (low + high) as f32 / 2.0)) * frame.pixel
    };
    let ends = (place(first, -0.5), place(last, 0.5));
    let half = frame.pixel / 2.0;
    let height_of = |row: usize| frame.origin.y + (y0 + row) as f32 * frame.pixel;
    let mut lids: Vec<(f32, f32)> =
        columns.iter().map(|&(_, low, high)| (height_of(low) - half, height_of(high) + half)).collect();
    let (outer, inner) = if side < 0.0 { ends } else { (ends.1, ends.0) };
    if side > 0.0 {
        lids.reverse();
    }
    Some(EyeOpening { outer, inner, lids, is_dent })
}

/// Morphological closing along a line: gaps narrower than a window of `reach` either side are filled.
fn close(line: &[f32], reach: usize) -> Vec<f32> {
    let slide = |line: &[f32], pick: fn(f32, f32) -> f32| -> Vec<f32> {
        (0..line.len())
            .map(|i| {
                let window = &line[i.saturating_sub(reach)..(i + reach + 1).min(line.len())];
                window.iter().copied().reduce(pick).unwrap_or(f32::NEG_INFINITY)
            })
            .collect()
    };
    slide(&slide(line, f32::max), f32::min)
}

/// The connected set (sides touching) with the highest positive score by `judge` (area, bounds in pixels), if any.
fn largest(open: &[bool], width: usize, height: usize, judge: impl Fn(f32, Vec2, Vec2) -> f32) -> Option<Vec<bool>> {
    let mut label = vec![0u32; open.len()];
    let (mut best, mut best_worth, mut next) = (0, 0.0, 0);
    let mut stack = Vec::new();
    for start in 0..open.len() {
        if !open[start] || label[start] != 0 {
            continue;
        }
        next += 1;
        label[start] = next;
        stack.push(start);
        let (mut area, mut low, mut high) = (0.0, Vec2::INFINITY, Vec2::NEG_INFINITY);
        while let Some(pixel) = stack.pop() {
            let (x, y) = (pixel % width, pixel / width);
            area += 1.0;
            low = low.min(vec2(x as f32, y as f32));
            high = high.max(vec2(x as f32, y as f32));
            let mut visit = |pixel: usize| {
                if open[pixel] && label[pixel] == 0 {
                    label[pixel] = next;
                    stack.push(pixel);
                }
            };
            if x > 0 {
                visit(pixel - 1);
            }
            if x + 1 < width {
                visit(pixel + 1);
            }
            if y > 0 {
                visit(pixel - width);
            }
            if y + 1 < height {
                visit(pixel + width);
            }
        }
        let worth = judge(area, low, high);
        if worth > best_worth {
            (best, best_worth) = (next, worth);
        }
    }
    (best > 0).then(|| label.iter().map(|&own| own == best).collect())
}
