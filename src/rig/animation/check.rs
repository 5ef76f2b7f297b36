//! Validity of clips, layers and keys.

use std::collections::HashSet;

use super::{ClipAbout, ClipLayer, Ease, Key, Property, RigClip};
use crate::rig::{EditError, Uid};

/// Largest difference of the squared length of a rotation from 1.
const UNIT: f32 = 1e-3;

/// Defect of a clip or layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ClipFault {
    /// A frame rate that is not positive and finite.
    #[error("a frame rate that is no positive number; use 30, for example")]
    FrameRate,
    /// A range that is not finite or ends before it begins.
    #[error("a range that is not finite or ends before it begins; correct its two seconds")]
    Range,
    /// Markers that are not finite or not in order.
    #[error("markers that are not finite or not in the order of their times; sort them")]
    Markers,
    /// A weight outside of 0 to 1.
    #[error("a layer whose weight is not from 0 to 1; correct it")]
    Weight,
}

/// Defect of keys.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum KeyFault {
    /// A number that is not finite.
    #[error("a key at {0} s has a number that is not finite; correct it")]
    NotFinite(f32),
    /// Times that do not rise.
    #[error("the times of the keys do not rise at {0} s; sort them, with no two at the same time")]
    Order(f32),
    /// A rotation that is not of unit length.
    #[error("the rotation at {0} s is not of length 1; normalise it")]
    NotARotation(f32),
    /// More numbers than the property has.
    #[error("the key at {0} s has more numbers than its property; leave the others zero")]
    Width(f32),
    /// A key to remove that is not there.
    #[error("there is no key at {0} s to remove")]
    Absent(f32),
    /// A key where there is one.
    #[error("there is a key at {0} s already; remove it in the same edit")]
    Taken(f32),
}

/// Checks the header of a clip.
pub(in crate::rig) fn check_about(clip: Uid, about: &ClipAbout) -> Result<(), EditError> {
    let fault = |fault| Err(EditError::BadClip(clip, fault));
    let ClipAbout { frame_rate, range: [start, end], markers, .. } = about;
    if !frame_rate.is_finite() || *frame_rate <= 0.0 {
        return fault(ClipFault::FrameRate);
    }
    if !start.is_finite() || !end.is_finite() || end < start {
        return fault(ClipFault::Range);
    }
    if markers.iter().any(|marker| !marker.time.is_finite()) || !markers.is_sorted_by_key(|marker| marker.time) {
        return fault(ClipFault::Markers);
    }
    Ok(())
}

/// Checks the weight of a layer.
pub(in crate::rig) fn check_layer(clip: Uid, weight: f32) -> Result<(), EditError> {
    if (0.0..=1.0).contains(&weight) { Ok(()) } else { Err(EditError::BadClip(clip, ClipFault::Weight)) }
}

/// Checks a clip with all of its layers and keys; two layers with one uid are refused, too.
pub(in crate::rig) fn check_clip(clip: &RigClip) -> Result<(), EditError> {
    check_about(clip.uid, &clip.about())?;
    let mut uids = HashSet::from([clip.uid]);
    for layer in &clip.layers {
        if !uids.insert(layer.uid) {
            return Err(EditError::UidInUse(layer.uid));
        }
        check_tracks(clip.uid, layer)?;
    }
    Ok(())
}

/// Checks the weight and the keys of a layer.
pub(in crate::rig) fn check_tracks(clip: Uid, layer: &ClipLayer) -> Result<(), EditError> {
    check_layer(clip, layer.weight)?;
    for (target, track) in &layer.tracks {
        check_keys(&target.property, &track.keys)
            .map_err(|fault| EditError::BadKeys { target: target.clone(), fault })?;
    }
    Ok(())
}

/// Checks keys of a property.
pub(in crate::rig) fn check_keys(property: &Property, keys: &[Key]) -> Result<(), KeyFault> {
    let width = property.width();
    let mut before = f32::NEG_INFINITY;
    for Key { time, value, ease } in keys {
        let tangents = match ease {
            Ease::Cubic { arrive, leave } => [*arrive, *leave],
            Ease::Stepped | Ease::Linear => [[0.0; 4]; 2],
        };
        let lists = [*value, tangents[0], tangents[1]];
        if !time.is_finite() || lists.as_flattened().iter().any(|number| !number.is_finite()) {
            return Err(KeyFault::NotFinite(*time));
        }
        if lists.iter().any(|list| list[width..].iter().any(|number| *number != 0.0)) {
            return Err(KeyFault::Width(*time));
        }
        let length: f32 = value.iter().map(|number| number * number).sum();
        if *property == Property::Rotation && (length - 1.0).abs() >= UNIT {
            return Err(KeyFault::NotARotation(*time));
        }
        if *time <= before {
            return Err(KeyFault::Order(*time));
        }
        before = *time;
    }
    Ok(())
}
