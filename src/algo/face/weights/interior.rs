//! Weights of parts other than skin: eyeballs, teeth, tongue, lashes, hair on the face.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    Face, HEAD, Row, facial_hair, rigid,
    sides::{Rim, Sides},
    skin_columns::SkinColumns,
    smooth, tooth_rows,
};
use crate::algo::face::{bones::map::line_distance, shells::ShellKind};

/// Fills the rows of vertices that are not skin, shell by shell; returns the number of the stiff shell of each vertex that
/// is on one.
pub(crate) fn rows(
    face: &Face,
    sides: &Sides,
    shell: &[u32],
    kinds: &[ShellKind],
    rows: &mut [Row],
) -> Vec<Option<u32>> {
    let mut stiff = vec![None; face.places.len()];
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for v in 0..face.places.len() {
        match kinds[v] {
            ShellKind::Skin => {}
            ShellKind::LeftEye => rows[v] = vec![(face.eyes[0], 1.0)],
            ShellKind::RightEye => rows[v] = vec![(face.eyes[1], 1.0)],
            ShellKind::Inside | ShellKind::Tongue => members.entry(shell[v]).or_default().push(v),
        }
    }
    let (skin, outer) = (SkinColumns::new(face, |_| face.map.trusted), facial_hair::outer_skin(face));
    let is_tongue = |members: &[usize]| members.first().is_some_and(|&v| kinds[v] == ShellKind::Tongue);
    let (inside, outside): (Vec<_>, Vec<_>) =
        members.values().partition(|members| is_tongue(members) || in_mouth(face, &outer, members));
    let shells: Vec<&[usize]> =
        inside.iter().map(|members| members.as_slice()).filter(|part| !is_tongue(part)).collect();
    let tongues = inside.iter().map(|members| members.as_slice()).filter(|part| is_tongue(part));
    let rows_of_teeth = tooth_rows::rows(face, &shells).into_iter().map(|row| {
        let members = row.iter().flat_map(|&shell| shells[shell]).copied().collect();
        MouthPart::new(face, members, row.len() > 1)
    });
    let inside: Vec<MouthPart> =
        tongues.map(|members| MouthPart::new(face, members.to_vec(), false)).chain(rows_of_teeth).collect();
    let ends = inside.iter().filter(|part| is_tongue(&part.members)).map(|part| [part.low.z, part.high.z]);
    let ends = ends.reduce(|[back, front], [low, high]| [back.min(low), front.max(high)]);
    for part in &inside {
        match (face.jaw, face.tongue, ends) {
            (Some(jaw), Some(tongue), Some(ends)) if is_tongue(&part.members) => {
                stretched(face, part, [jaw, tongue], ends, rows);
            }
            _ => mouth(face, part, &inside, rows),
        }
    }
    for members in outside {
        let is_of_skin = !rigid::is_hanging_ring(face, members)
            && (lashes(face, sides, &skin, members, rows) || facial_hair::rows(face, sides, &outer, members, rows));
        if is_of_skin {
            if rigid::stiffen(face, members, rows) {
                members.iter().for_each(|&v| stiff[v] = Some(shell[v]));
            }
        } else {
            rigid::hang(face, members, rows);
        }
    }
    stiff
}

/// Returns `true` for a shell whose middle lies behind the lips, and that does not lie on the skin.
fn in_mouth(face: &Face, outer: &SkinColumns, members: &[usize]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let middle = members.iter().map(|&v| face.places[v]).sum::<Vec3>() / members.len().max(1) as f32;
    let (half, p) = face.map.fold(middle);
    let corner = half.lip_corner();
    let e = face.map.scale;
    let is_behind = p.x < 1.3 * corner.x && (p.y - corner.y).abs() < 0.4 * e && p.z < half.lip_line()[0].z + 0.02 * e;
    is_behind && !facial_hair::is_on_skin(face, outer, members)
}

/// A part of the mouth: a row of teeth, of one shell or of many, a tooth, the tongue, or a bag around them.
struct MouthPart {
    members: Vec<usize>,
    /// Distance of each vertex below the lips.
    below: Vec<f32>,
    /// Mean of those distances.
    mean: f32,
    /// True if much of it lies on either side of the lips.
    spans: bool,
    /// True for a row of single teeth.
    is_row: bool,
    low: Vec3,
    high: Vec3,
}

impl MouthPart {
    fn new(face: &Face, members: Vec<usize>, is_row: bool) -> Self {
        let below: Vec<f32> = members.iter().map(|&v| face.below_lips(face.places[v])).collect();
        let top = below.iter().copied().fold(f32::INFINITY, f32::min);
        let bottom = below.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let mean = below.iter().sum::<f32>() / below.len().max(1) as f32;
        let e = face.map.scale;
        let spans = !is_row && top < -0.1 * e && bottom > 0.1 * e && mean.abs() < 0.3 * (bottom - top);
        let places = || members.iter().map(|&v| face.places[v]);
        let (low, high) = (places().fold(Vec3::INFINITY, Vec3::min), places().fold(Vec3::NEG_INFINITY, Vec3::max));
        Self { members, below, mean, spans, is_row, low, high }
    }

    /// True for a part that belongs to the jaw, by the parts that it faces; `None` if it faces none.
    ///
    /// They and the part itself are split in two by height, so that a tooth does not fall to the other jaw because its own
    /// gum is above it.
    fn is_lower(&self, all: &[Self], face: &Face) -> Option<bool> {
        let facing = all.iter().filter(|other| self.faces(other, face));
        let mut below: Vec<f32> =
            facing.map(|other| other.mean_beside(self, face) - self.mean_beside(other, face)).collect();
        if below.is_empty() {
            return None;
        }
        below.push(0.0);
        below.sort_by(f32::total_cmp);
        Some(split(&below) < 0.0)
    }

    /// Mean distance below the lips where the part is beside another, which may be a single tooth below a row; of the whole
    /// part if no vertex is there.
    fn mean_beside(&self, other: &Self, face: &Face) -> f32 {
        let margin = 0.03 * face.map.scale;
        let (mut sum, mut count) = (0.0_f32, 0_u32);
        for (&v, below) in self.members.iter().zip(&self.below) {
            let x = face.places[v].x;
            if x >= other.low.x - margin && x <= other.high.x + margin {
                sum += below;
                count += 1;
            }
        }
        if count == 0 { self.mean } else { sum / count as f32 }
    }

    /// True for parts of which one lies over the other, as an upper tooth over a lower one, and not within it.
    ///
    /// A row of teeth is never within another, though the bounds of one with fangs hold the other row.
    fn faces(&self, other: &Self, face: &Face) -> bool {
        let e = face.map.scale;
        let overlap = self.high.min(other.high) - self.low.max(other.low);
        let least = 0.5 * (self.high - self.low).min(other.high - other.low);
        let within = |inner: &Self, outer: &Self| {
            let margin = Vec3::splat(0.03 * e);
            inner.low.cmpge(outer.low - margin).all() && inner.high.cmple(outer.high + margin).all()
        };
        overlap.x >= least.x
            && overlap.z >= least.z
            && (self.mean_beside(other, face) - other.mean_beside(self, face)).abs() > 0.05 * e
            && (self.is_row && other.is_row || !within(self, other) && !within(other, self))
    }
}

/// Share of the tongue's length from its root in which its own bone takes over from the jaw's.
const ROOT: f32 = 0.75;

/// Fills the rows of a tongue, whose root stays with the jaw when its bone moves.
fn stretched(face: &Face, part: &MouthPart, [jaw, tongue]: [u32; 2], [back, front]: [f32; 2], rows: &mut [Row]) {
    let least = f32::MIN_POSITIVE;
    for &v in &part.members {
        let share = smooth(back, back + (ROOT * (front - back)).max(least), face.places[v].z);
        rows[v] = vec![(tongue, share), (jaw, 1.0 - share)];
    }
}

/// The value between the two groups of sorted numbers that are furthest apart, by the variance between them.
fn split(sorted: &[f32]) -> f32 {
    let sum: f32 = sorted.iter().sum();
    let (mut lower, mut most, mut best) = (0.0_f32, f32::NEG_INFINITY, 0.0_f32);
    for (at, pair) in sorted.windows(2).enumerate() {
        lower += pair[0];
        let (count, rest) = ((at + 1) as f32, (sorted.len() - at - 1) as f32);
        let apart = (sum - lower) / rest - lower / count;
        let variance = count * rest * apart * apart;
        if variance > most {
            (most, best) = (variance, 0.5 * (pair[0] + pair[1]));
        }
    }
    best
}

/// Fills the rows of a part of the mouth.
///
/// A part below the lips follows the jaw fully, one above them the head; a bag that spans both is shared smoothly. Upper
/// teeth often hang below the lips: of parts that face each other near the lips the upper ones belong to the head and the
/// lower ones to the jaw, and all are stiff.
fn mouth(face: &Face, part: &MouthPart, all: &[MouthPart], rows: &mut [Row]) {
    let Some(jaw) = face.jaw else {
        for &v in &part.members {
            rows[v] = vec![(HEAD, 1.0)];
        }
        return;
    };
    let e = face.map.scale;
    let is_lower = part.is_lower(all, face);
    let is_near = part.mean > -0.15 * e && part.mean < 0.25 * e;
    let follows_jaw = is_lower.filter(|_| is_near).unwrap_or(part.mean > 0.0);
    for (&v, &below) in part.members.iter().zip(&part.below) {
        let share = match part.spans && is_lower.is_none() {
            true => smooth(-0.06 * e, 0.06 * e, below),
            false => f32::from(u8::from(follows_jaw)),
        };
        rows[v] = vec![(jaw, share), (HEAD, 1.0 - share)];
    }
}

/// Fills the rows of lashes, brows and the like that lie on the skin with the weights of the nearest skin; returns
/// `false` for a shell of another kind.
fn lashes(face: &Face, sides: &Sides, skin: &SkinColumns, members: &[usize], rows: &mut [Row]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let e = face.map.scale;
    let middle = members.iter().map(|&v| face.places[v]).sum::<Vec3>() / members.len().max(1) as f32;
    let (half, p) = face.map.fold(middle);
    let near = half.eye().distance(p) < 0.3 * e || line_distance(&half.brow, p) < 0.15 * e;
    if !near {
        return false;
    }
    let low = members.iter().fold(Vec3::INFINITY, |a, &v| a.min(face.places[v]));
    let high = members.iter().fold(Vec3::NEG_INFINITY, |a, &v| a.max(face.places[v]));
    let margin = Vec3::splat(0.12 * e);
    let skin: Vec<usize> = skin.within(low - margin, high + margin).collect();
    let nearest = |v: usize, rim: Option<(usize, Rim)>| {
        skin.iter()
            .copied()
            .filter(|&s| rim.is_none_or(|(opening, rim)| sides.rim(s, opening) == rim))
            .map(|s| (face.places[s].distance_squared(face.places[v]), s))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    };
    let found: Vec<Option<(f32, usize)>> = members.iter().map(|&v| nearest(v, None)).collect();
    let Some(root) = found.iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).copied() else {
        return false;
    };
    // Brows of drawn faces float in front of the skin; frames of glasses do, too, and reach below the eyes.
    let size = high - low;
    let is_brow = low.y > half.eye().y + 0.05 * e && size.y <= 0.3 * e && size.x > 1.2 * size.y;
    let reach = e * if is_brow { 0.1 } else { 0.03 };
    let is_touching = |found: &Option<(f32, usize)>| found.is_some_and(|found| found.0 <= reach * reach);
    if !is_touching(&Some(root)) || rigid::is_frame(face, members, |at| is_touching(&found[at])) {
        return false;
    }
    // Tips may be nearer to the other lid: all vertices follow the lid at the root.
    let opening = if p.x == 0.0 || middle.x >= face.map.middle { 1 } else { 2 };
    let rim = sides.rim(root.1, opening);
    for (&v, found) in members.iter().zip(found) {
        let own = if rim == Rim::None { found } else { nearest(v, Some((opening, rim))).or(found) };
        rows[v] = own.map_or_else(|| vec![(HEAD, 1.0)], |(_, s)| rows[s].clone());
    }
    true
}
