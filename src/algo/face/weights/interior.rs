//! Weights of parts other than skin: eyeballs, teeth, tongue, lashes.

use std::collections::BTreeMap;

use super::{
    Face, HEAD, NECK, Row,
    sides::{Rim, Sides},
    smooth,
};
use crate::algo::face::{bones::map::line_distance, shells::ShellKind};

/// Fills the rows of vertices that are not skin, shell by shell.
pub(crate) fn rows(face: &Face, sides: &Sides, shell: &[u32], kinds: &[ShellKind], rows: &mut [Row]) {
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for v in 0..face.places.len() {
        match kinds[v] {
            ShellKind::Skin => {}
            ShellKind::LeftEye => rows[v] = vec![(face.eyes[0], 1.0)],
            ShellKind::RightEye => rows[v] = vec![(face.eyes[1], 1.0)],
            ShellKind::Inside => members.entry(shell[v]).or_default().push(v),
        }
    }
    for members in members.values() {
        if in_mouth(face, members) {
            mouth(face, members, rows);
        } else if !lashes(face, sides, members, rows) {
            for &v in members {
                let neck = face.neck_share(face.places[v]);
                rows[v] = vec![(HEAD, 1.0 - neck), (NECK, neck)];
            }
        }
    }
}

/// Returns `true` for a shell whose middle lies behind the lips.
fn in_mouth(face: &Face, members: &[usize]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let middle = members.iter().map(|&v| face.places[v]).sum::<glam::Vec3>() / members.len().max(1) as f32;
    let (half, p) = face.map.fold(middle);
    let corner = half.lip_corner();
    let e = face.map.scale;
    p.x < 1.3 * corner.x && (p.y - corner.y).abs() < 0.4 * e && p.z < half.lip_line()[0].z + 0.02 * e
}

/// Fills the rows of teeth and tongue: a part below the lips follows the jaw fully; a bag that spans both is shared
/// smoothly.
fn mouth(face: &Face, members: &[usize], rows: &mut [Row]) {
    let Some(jaw) = face.jaw else {
        for &v in members {
            rows[v] = vec![(HEAD, 1.0)];
        }
        return;
    };
    let below: Vec<f32> = members.iter().map(|&v| face.below_lips(face.places[v])).collect();
    let low = below.iter().copied().fold(f32::INFINITY, f32::min);
    let high = below.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mean = below.iter().sum::<f32>() / below.len().max(1) as f32;
    let e = face.map.scale;
    let spans = low < -0.1 * e && high > 0.1 * e && mean.abs() < 0.3 * (high - low);
    for (&v, &below) in members.iter().zip(&below) {
        let share = match spans {
            true => smooth(-0.06 * e, 0.06 * e, below),
            false => f32::from(u8::from(mean > 0.0)),
        };
        rows[v] = vec![(jaw, share), (HEAD, 1.0 - share)];
    }
}

/// Fills the rows of lashes, brows and the like that lie on the skin with the weights of the nearest skin; returns
/// `false` for a shell of another kind.
fn lashes(face: &Face, sides: &Sides, members: &[usize], rows: &mut [Row]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let e = face.map.scale;
    let middle = members.iter().map(|&v| face.places[v]).sum::<glam::Vec3>() / members.len().max(1) as f32;
    let (half, p) = face.map.fold(middle);
    let near = half.eye().distance(p) < 0.3 * e || line_distance(&half.brow, p) < 0.15 * e;
    if !near {
        return false;
    }
    let low = members.iter().fold(glam::Vec3::INFINITY, |a, &v| a.min(face.places[v]));
    let high = members.iter().fold(glam::Vec3::NEG_INFINITY, |a, &v| a.max(face.places[v]));
    let margin = glam::Vec3::splat(0.12 * e);
    let skin: Vec<usize> = (0..face.places.len())
        .filter(|&v| face.mask[v] && (face.places[v].cmpge(low - margin) & face.places[v].cmple(high + margin)).all())
        .collect();
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
    if root.0 > (0.03 * e) * (0.03 * e) {
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
