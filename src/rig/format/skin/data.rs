//! Weights as compact bytes without a mesh: for files that hold weights among other things.
//!
//! Little endian: flags, counts (7 bits a byte), uids of the joints, subjects of created joints where there are any,
//! and the influences as in a `*.skin` file. The same weights give the same bytes, and reading gives exactly the same
//! weights. There is no checksum: whatever holds the bytes has one.

use super::{
    bytes::{Bytes, put_varint},
    is_rigid,
};
use crate::{
    mesh::model::Weights,
    rig::{SkinData, Uid},
};

/// Flag: the weights bind the mesh in its state at rest.
const AT_REST: u8 = 1;
/// Flag: the list of starts is empty, which means no points like a single start does, but is not equal to it.
const NO_STARTS: u8 = 2;
/// Flag: pairs of created joints and their subjects follow the joints.
const SUBJECTS: u8 = 4;

/// Weights as bytes; `None` if their lists do not fit together.
pub fn skin_data_bytes(skin: &SkinData) -> Option<Vec<u8>> {
    let weights = &skin.weights;
    let count = weights.starts.last().map_or(0, |last| *last as usize);
    let whole = weights.starts.is_sorted()
        && weights.starts.first().is_none_or(|first| *first == 0)
        && count == weights.joints.len()
        && count == weights.values.len();
    if !whole {
        return None;
    }
    let mut out = Vec::with_capacity(32 + skin.joints.len() * 8 + weights.len() + count * 6);
    let no_starts = if weights.starts.is_empty() { NO_STARTS } else { 0 };
    let subjects = if skin.subjects.is_empty() { 0 } else { SUBJECTS };
    out.push(no_starts | subjects | if skin.at_rest { AT_REST } else { 0 });
    for count in [skin.joints.len(), weights.len(), count] {
        put_varint(&mut out, count as u64);
    }
    for joint in &skin.joints {
        out.extend(joint.0.to_le_bytes());
    }
    if !skin.subjects.is_empty() {
        put_varint(&mut out, skin.subjects.len() as u64);
        for (joint, subject) in &skin.subjects {
            out.extend(joint.0.to_le_bytes());
            out.extend(subject.0.to_le_bytes());
        }
    }
    for point in 0..weights.len() {
        let rigid = is_rigid(weights.of(point));
        put_varint(&mut out, (weights.of(point).len() as u64) << 1 | u64::from(rigid));
        for (joint, value) in weights.of(point) {
            put_varint(&mut out, u64::from(joint));
            if !rigid {
                out.extend(value.to_le_bytes());
            }
        }
    }
    Some(out)
}

/// Reads bytes from [`skin_data_bytes`]; `None` for any other bytes. Memory stays below eight times their number.
pub fn read_skin_data(all: &[u8]) -> Option<SkinData> {
    let mut bytes = Bytes::new(all, 0);
    let [flags] = bytes.array()?;
    let mut count = || usize::try_from(bytes.varint()?).ok();
    let (joints, points, influences) = (count()?, count()?, count()?);
    // Each entry takes at least one byte, so counts beyond the remaining bytes are invalid, and no memory is reserved
    // for them.
    let least = joints.checked_mul(8)?.checked_add(points)?.checked_add(influences)?;
    let no_starts = flags & NO_STARTS != 0;
    if flags & !(AT_REST | NO_STARTS | SUBJECTS) != 0 || least > bytes.left() || (no_starts && points != 0) {
        return None;
    }
    let mut skin = SkinData { at_rest: flags & AT_REST != 0, ..SkinData::default() };
    skin.joints.reserve_exact(joints);
    for _ in 0..joints {
        skin.joints.push(Uid(bytes.array().map(u64::from_le_bytes)?));
    }
    if flags & SUBJECTS != 0 {
        read_subjects(&mut bytes, &mut skin)?;
    }
    let weights = &mut skin.weights;
    if !no_starts {
        weights.starts.reserve_exact(points + 1);
        weights.starts.push(0);
    }
    weights.joints.reserve_exact(influences);
    weights.values.reserve_exact(influences);
    for _ in 0..points {
        read_point(&mut bytes, weights, influences)?;
    }
    (weights.joints.len() == influences && bytes.left() == 0).then_some(skin)
}

/// Reads at least one pair, in rising order, so that equal weights have equal bytes.
fn read_subjects(bytes: &mut Bytes, skin: &mut SkinData) -> Option<()> {
    let count = bytes.varint().filter(|count| (1..=bytes.left() as u64 / 16).contains(count))?;
    for _ in 0..count {
        let [joint, subject] = [bytes.array()?, bytes.array()?].map(|uid| Uid(u64::from_le_bytes(uid)));
        if skin.subjects.last_key_value().is_some_and(|(last, _)| *last >= joint) {
            return None;
        }
        skin.subjects.insert(joint, subject);
    }
    Some(())
}

fn read_point(bytes: &mut Bytes, weights: &mut Weights, influences: usize) -> Option<()> {
    let head = bytes.varint()?;
    let (count, rigid) = (head >> 1, head & 1 == 1);
    if count > (influences - weights.joints.len()) as u64 || (rigid && count != 1) {
        return None;
    }
    for _ in 0..count {
        weights.joints.push(u32::try_from(bytes.varint()?).ok()?);
        weights.values.push(if rigid { 1.0 } else { bytes.float()? });
    }
    weights.starts.push(u32::try_from(weights.joints.len()).ok()?);
    Some(())
}
