//! The profile: heights of nose, lips and chin along the plane of symmetry.

use glam::vec2;

use super::relief::{Relief, smooth};

/// Step along the profile, in eye distances.
const STEP: f32 = 0.008;
/// Start and end of the profile, in eye distances.
const TOP: f32 = 0.6;
const BOTTOM: f32 = -1.7;

/// Heights (v) of the features along the profile, from the forehead down.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Profile {
    /// The deepest place between the brows and the nose.
    pub nasion: f32,
    /// The tip of the nose.
    pub tip: f32,
    /// The corner below the nose.
    pub subnasale: f32,
    /// The foremost place of the upper lip.
    pub upper_lip: f32,
    /// The lower edge of the upper lip.
    pub upper_edge: f32,
    /// The upper edge of the lower lip.
    pub lower_edge: f32,
    /// The foremost place of the lower lip.
    pub lower_lip: f32,
    /// The fold between lip and chin.
    pub fold: f32,
    /// The foremost place of the chin.
    pub pogonion: f32,
    /// The lower edge of the chin.
    pub menton: f32,
    /// Depth of the lips' line behind the lips.
    pub slit: f32,
    /// Height of the nose above the face.
    pub nose: f32,
}

/// Depths along the profile.
pub(super) struct Curve {
    depths: Vec<f32>,
    /// Columns beside the middle, for features that run across.
    beside: Vec<Vec<f32>>,
}

impl Curve {
    /// Reads the profile at u = 0.
    pub fn read(relief: &Relief) -> Self {
        let count = ((TOP - BOTTOM) / STEP) as usize;
        let lines = [-0.012f32, 0.0, 0.012].map(|u| relief.line(vec2(u, TOP), vec2(0.0, -STEP), count));
        let mut depths: Vec<f32> = (0..count).map(|i| lines.iter().map(|line| line[i]).sum::<f32>() / 3.0).collect();
        // Below the last covered pixel the profile falls away, so that a cut neck looks like a receding one.
        let seen = (0..count).rposition(|i| relief.at(0.0, TOP - i as f32 * STEP).is_some()).unwrap_or(0);
        // Between open lips there may be no surface at all.
        let nothing: Vec<bool> = (0..seen).map(|i| relief.at(0.0, TOP - i as f32 * STEP).is_none()).collect();
        let mut first = 0;
        for run in nothing.chunk_by(|a, b| a == b) {
            let last = first + run.len();
            if run[0] && first > 0 {
                let floor = depths[first - 1].min(depths[last]) - 0.2;
                depths[first..last].fill(floor);
            }
            first = last;
        }
        for i in seen + 1..count {
            depths[i] = depths[seen] - 2.0 * STEP * (i - seen) as f32;
        }
        smooth(&mut depths, 2);
        let beside = [-0.12f32, -0.06, 0.06, 0.12].map(|u| {
            let mut line = relief.line(vec2(u, TOP), vec2(0.0, -STEP), count);
            smooth(&mut line, 2);
            line
        });
        Self { depths, beside: beside.into() }
    }

    fn at(&self, v: f32) -> f32 {
        Self::on(&self.depths, v)
    }

    fn on(line: &[f32], v: f32) -> f32 {
        let at = ((TOP - v) / STEP).clamp(0.0, (line.len().max(2) - 2) as f32);
        let (index, part) = (at.floor() as usize, at.fract());
        let get = |i: usize| line.get(i).copied().unwrap_or_default();
        get(index) * (1.0 - part) + get(index + 1) * part
    }

    /// Depth of a line behind short chords across the height `v`; a slit counts as a deep fold.
    fn hollow(line: &[f32], v: f32, tall: f32) -> f32 {
        let here = Self::on(line, v);
        let chord = |reach: f32| 0.5 * (Self::on(line, v + reach * tall) + Self::on(line, v - reach * tall)) - here;
        chord(0.03).max(chord(0.05)).min(0.05)
    }

    /// The height between `from` and `to` at which `worth` (of height and depth) is largest, to a fraction of a step.
    fn best(&self, from: f32, to: f32, worth: impl Fn(f32, f32) -> f32) -> f32 {
        let (low, high) = (from.min(to), from.max(to));
        let count = (((high - low) / STEP) as usize).max(1);
        let at = |i: f32| high - i * STEP;
        let values: Vec<f32> = (0..=count).map(|i| worth(at(i as f32), self.at(at(i as f32)))).collect();
        let best = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        let mut offset = 0.0;
        if best > 0 && best + 1 < values.len() {
            let (a, b, c) = (values[best - 1], values[best], values[best + 1]);
            let bend = a - 2.0 * b + c;
            if bend < 0.0 {
                offset = (0.5 * (a - c) / bend).clamp(-0.5, 0.5);
            }
        }
        at(best as f32 + offset)
    }

    /// The height between two heights where the curve lies furthest behind (`side` 1) or before (−1) the straight line.
    fn off_line(&self, from: f32, to: f32, side: f32) -> f32 {
        let (a, b) = (self.at(from), self.at(to));
        let slope = (b - a) / (to - from);
        self.best(from, to, |v, depth| side * (a + slope * (v - from) - depth))
    }

    /// Edges of open lips, upper and lower: the tallest stretch below the nose that lies far behind the skin above and
    /// below it.
    fn gap(&self, subnasale: f32, tall: f32) -> Option<(f32, f32)> {
        let (start, count) = (subnasale - 0.08 * tall, (0.75 * tall / STEP) as usize);
        let line: Vec<f32> = (0..count).map(|i| self.at(start - i as f32 * STEP)).collect();
        let highest = |line: &mut dyn Iterator<Item = f32>| {
            let mut most = f32::NEG_INFINITY;
            line.map(|depth| {
                most = most.max(depth);
                most
            })
            .collect::<Vec<f32>>()
        };
        let above = highest(&mut line.iter().copied());
        let mut below = highest(&mut line.iter().rev().copied());
        below.reverse();
        let open = |i: usize| above[i].min(below[i]) - line[i] > 0.09;
        let (mut best, mut from) = ((0, 0), None);
        for i in 0..count {
            match (open(i), from) {
                (true, None) => from = Some(i),
                (false, Some(start)) => {
                    if i - start > best.1 - best.0 {
                        best = (start, i);
                    }
                    from = None;
                }
                _ => {}
            }
        }
        (best.1 > best.0 + 1).then_some((start - (best.0 as f32 - 0.5) * STEP, start - (best.1 as f32 - 0.5) * STEP))
    }

    /// Finds the features; `tall` is the height of the face relative to its width.
    pub fn features(&self, tall: f32) -> Profile {
        let t = tall;
        let tip = self.best(-0.1 * t, -0.62 * t, |_, depth| depth);
        let glabella = self.best(0.15 * t, 0.42 * t, |v, depth| depth - 0.3 * (v - 0.25 * t).abs());
        let nasion = self.off_line(glabella, tip, 1.0);
        let subnasale = self.off_line(tip, tip - 0.34 * t, 1.0);
        // The lips' line is the deepest fold that runs across, near its usual height.
        let across = |v: f32| {
            let sides: f32 = self.beside.iter().map(|line| Self::hollow(line, v, t)).sum();
            (Self::hollow(&self.depths, v, t) * 2.0 + sides) / (self.beside.len() + 2) as f32
        };
        let lips = self.best(subnasale - 0.12 * t, subnasale - 0.42 * t, |v, _| {
            let off = (v - (subnasale - 0.25 * t)) / t;
            across(v) - 0.6 * off * off
        });
        let lips = self.best(lips + 0.02, lips - 0.02, |v, depth| 2.0 * Self::hollow(&self.depths, v, t) - depth);
        let slit = Self::hollow(&self.depths, lips, t);
        let (upper_edge, lower_edge) = self.gap(subnasale, t).unwrap_or((lips, lips));
        let upper_lip = self.best(upper_edge + 0.02 * t, upper_edge + 0.15 * t, |_, depth| depth);
        let mut lower_lip = self.best(lower_edge - 0.02 * t, lower_edge - 0.15 * t, |_, depth| depth);
        if lower_lip > lower_edge - 0.03 * t {
            // A lip that lies far behind the upper one is not a maximum.
            lower_lip = self.off_line(lower_edge, lower_edge - 0.17 * t, -1.0);
        }
        let chin = self.best(lower_lip - 0.2 * t, lower_lip - 0.55 * t, |v, depth| {
            depth - 0.15 * (v - (lower_lip - 0.33 * t)).abs()
        });
        let fold = self.off_line(lower_lip, chin, 1.0);
        let pogonion = self.best(fold - 0.03, fold - 0.4 * t, |v, depth| depth + 0.3 * (v - fold));
        let mut menton = pogonion;
        while self.at(menton) - self.at(menton - 0.03) < 0.03 && menton > pogonion - 0.35 * t {
            menton -= STEP / 2.0;
        }
        Profile {
            nasion,
            tip,
            subnasale,
            upper_lip,
            upper_edge,
            lower_edge,
            lower_lip,
            fold,
            pogonion,
            menton,
            slit,
            nose: self.at(tip) - 0.5 * (self.at(nasion) + self.at(subnasale)),
        }
    }
}
