//! Heads of animals on all fours: the joint between neck and skull, where the girth of the branch tells it.

use super::Work;
use crate::algo::fit_template::{
    limbs::{Limb, LimbKind},
    line::CentreLine,
};

/// Most of a head's length, from the end of its branch, in radii of the branch: a long neck has no longer head.
const MOST_RADII: f32 = 4.0;
/// Girth of the neck over that of the skull below which the neck is a waist, and the girth at which this is clear.
const WAIST: f32 = 0.9;
const CLEAR_WAIST: f32 = 0.75;
/// Share of the way in girth from the waist to the skull at which the head's joint lies.
const TO_SKULL: f32 = 0.5;
/// Fewest slices of the branch from the skull to the waist: fewer are a notch.
const SLICES: usize = 4;
/// Share of the way from the end of the branch to the trunk beyond which a waist is the root of the neck.
const ROOT_OF_NECK: f32 = 0.82;

impl Work<'_> {
    /// Moves the head of an animal on all fours to where the neck widens to the skull. The template's share of the way to the
    /// trunk stands where no waist shows; it gives long necks too long a head.
    pub(super) fn widen_to_skull(&self, limb: &Limb, line: &CentreLine, lengths: &mut [f32]) {
        if limb.kind != LimbKind::Head || !self.template.is_on_fours() {
            return;
        }
        let Some(&whole) = lengths.first() else { return };
        let girths = girths(line);
        let mut ranked = girths.clone();
        ranked.sort_by(f32::total_cmp);
        let Some(median) = ranked.get(ranked.len() / 2) else { return };
        let Some(head) = lengths.last_mut().filter(|head| **head < whole) else { return };
        *head = head.min(MOST_RADII * median);
        // The first point of the line is its end, which has no girth.
        let length = |slice: usize| line.lengths[slice + 1];
        let Some((skull, waist)) = waist(&girths).filter(|(_, waist)| length(*waist) < ROOT_OF_NECK * whole) else {
            return;
        };
        let clear = (WAIST - girths[waist] / girths[skull].max(1e-9)) / (WAIST - CLEAR_WAIST);
        let wanted = girths[waist] + TO_SKULL * (girths[skull] - girths[waist]);
        let place = (skull..waist).rev().find(|&slice| girths[slice] >= wanted).unwrap_or(skull);
        *head += clear.clamp(0.0, 1.0) * (length(place) - *head);
    }
}

/// Radii of the free part of a line, each the median of three, without the last ones, which the trunk cuts off.
fn girths(line: &CentreLine) -> Vec<f32> {
    let end = line.free_count.saturating_sub(2).min(line.radii.len());
    let radii = line.radii.get(1..end).unwrap_or_default();
    let median = |at: usize| {
        let mut around = [radii[at.saturating_sub(1)], radii[at], radii[(at + 1).min(radii.len() - 1)]];
        around.sort_by(f32::total_cmp);
        around[1]
    };
    (0..radii.len()).map(median).collect()
}

/// The widest slice of the skull and the narrowest of the neck behind it, which has the least girth against the skull's.
fn waist(girths: &[f32]) -> Option<(usize, usize)> {
    let mut least = 1.0;
    let mut found = None;
    let mut skull = 0;
    for (slice, &girth) in girths.iter().enumerate() {
        if girth >= girths[skull] {
            skull = slice;
        }
        let ratio = girth / girths[skull].max(1e-9);
        if ratio < least && slice >= skull + SLICES {
            least = ratio;
            found = Some((skull, slice));
        }
    }
    found
}
