//! Facial bones of format 1: their placement stood in the comment of their control tag.

use bevy::math::Vec3;

use crate::rig::{FaceBonePart, FacePlacement, TagData};

/// The newest format whose comments hold placements.
const LAST_FORMAT: u32 = 1;

/// Moves the placement of a facial bone out of the comment of its tag.
pub(super) fn take_placement(format: u32, tags: &mut [TagData]) -> Option<FacePlacement> {
    if format > LAST_FORMAT {
        return None;
    }
    tags.iter_mut().find_map(|tag| {
        let (comment, placement) = split(&tag.comment)?;
        tag.comment = comment.to_owned();
        Some(placement)
    })
}

/// Splits a comment such as `face bone lip_l, placed at 0.1 0.2 0.3`.
fn split(comment: &str) -> Option<(&str, FacePlacement)> {
    let (named, place) = comment.split_once(", placed at ")?;
    let words =
        [("face bone ", FaceBonePart::Skin), ("jaw bone ", FaceBonePart::Jaw), ("eye bone ", FaceBonePart::Eye)];
    let (part, label) = words.into_iter().find_map(|(words, part)| Some((part, named.strip_prefix(words)?)))?;
    let mut numbers = place.split(' ').map(|number| number.parse::<f32>().ok().filter(|number| number.is_finite()));
    let mut next = || numbers.next().flatten();
    let position = Vec3::new(next()?, next()?, next()?);
    Some((named, FacePlacement { part, label: label.to_owned(), position }))
}
