//! Payloads: steps and rigs as RON, in which weights, and large changes of weights, are named by the hash of their bytes.

use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
    sync::{Arc, Weak},
};

use serde::{Deserialize, Serialize};

use super::JournalWriteError;
use crate::rig::{
    Rig, RigEdit, SkinData, Uid, WeightPatch,
    skin::{content_hash, skin_data_bytes},
    step::{Step, edits_from_empty},
};

/// Bytes of RON that one record holds at most.
pub(super) const MAX_TEXT: usize = 64 << 20;

/// Number of points and influences from which on a change of weights is kept as bytes: as text it takes several times as much,
/// and a stroke over a large mesh would be longer than a record may be.
const LARGE_PATCH: usize = 1 << 12;

#[derive(Serialize)]
enum EditRef<'a> {
    Edit(&'a RigEdit),
    Skin(Uid, u64),
    Batch(Vec<EditRef<'a>>),
    Weights(Uid, PatchRef<'a>),
}

#[derive(Deserialize)]
enum EditText {
    Edit(RigEdit),
    Skin(Uid, u64),
    Batch(Vec<EditText>),
    Weights(Uid, PatchText),
}

/// A large [`WeightPatch`].
#[derive(Serialize)]
struct PatchRef<'a> {
    kept: u32,
    added: &'a [(Uid, Option<Uid>)],
    /// First point, and the distance of each further one from that before it.
    points: Vec<u32>,
    /// Hash of the influences.
    rows: u64,
}

#[derive(Deserialize)]
struct PatchText {
    kept: u32,
    added: Vec<(Uid, Option<Uid>)>,
    points: Vec<u32>,
    rows: u64,
}

#[derive(Serialize)]
struct StepRef<'a> {
    name: &'a str,
    forward: Vec<EditRef<'a>>,
    backward: Vec<EditRef<'a>>,
    before: &'a [Uid],
    after: &'a [Uid],
}

#[derive(Deserialize)]
struct StepText {
    name: String,
    forward: Vec<EditText>,
    backward: Vec<EditText>,
    before: Vec<Uid>,
    after: Vec<Uid>,
}

#[derive(Serialize)]
struct RigRef<'a> {
    uid: Uid,
    edits: Vec<EditRef<'a>>,
}

#[derive(Deserialize)]
struct RigText {
    uid: Uid,
    edits: Vec<EditText>,
}

/// Hashes of the weights that a journal holds, and weights that are still to be written.
#[derive(Default)]
pub(super) struct SkinsOut {
    known: HashSet<u64>,
    /// Hashes by address of the weights; the weak reference keeps the address from being used again.
    seen: HashMap<usize, (Weak<SkinData>, u64)>,
    fresh: Vec<(u64, Vec<u8>)>,
}

impl SkinsOut {
    /// Removes and returns the weights that records refer to but that are not written yet: hash and bytes.
    pub(super) fn take_fresh(&mut self) -> Vec<(u64, Vec<u8>)> {
        std::mem::take(&mut self.fresh)
    }

    fn name(&mut self, skin: &Arc<SkinData>) -> Result<u64, JournalWriteError> {
        let address = Arc::as_ptr(skin) as usize;
        if let Some((_, hash)) = self.seen.get(&address) {
            return Ok(*hash);
        }
        let hash = self.keep(skin)?;
        self.seen.insert(address, (Arc::downgrade(skin), hash));
        Ok(hash)
    }

    /// Hash of weights, whose bytes are to be written unless they are already.
    fn keep(&mut self, skin: &SkinData) -> Result<u64, JournalWriteError> {
        let bytes = skin_data_bytes(skin).ok_or(JournalWriteError::Weights)?;
        let hash = content_hash(&bytes);
        if self.known.insert(hash) {
            self.fresh.push((hash, bytes));
        }
        Ok(hash)
    }

    /// A large change of weights; `None` for one that is text.
    fn patch<'a>(&mut self, patch: &'a WeightPatch) -> Result<Option<PatchRef<'a>>, JournalWriteError> {
        let WeightPatch { kept, added, points, rows } = patch;
        if points.len() + rows.joints.len() < LARGE_PATCH || !points.is_sorted() {
            return Ok(None);
        }
        let mut last = 0;
        let points = points.iter().map(|point| point - std::mem::replace(&mut last, *point)).collect();
        let rows = self.keep(&SkinData { weights: rows.clone(), ..SkinData::default() })?;
        Ok(Some(PatchRef { kept: *kept, added, points, rows }))
    }

    fn edits<'a>(&mut self, edits: &'a [RigEdit]) -> Result<Vec<EditRef<'a>>, JournalWriteError> {
        edits.iter().map(|edit| self.edit(edit)).collect()
    }

    fn edit<'a>(&mut self, edit: &'a RigEdit) -> Result<EditRef<'a>, JournalWriteError> {
        Ok(match edit {
            RigEdit::SetSkin(mesh, Some(skin)) => EditRef::Skin(*mesh, self.name(skin)?),
            RigEdit::Batch(edits) => EditRef::Batch(self.edits(edits)?),
            RigEdit::SetWeights(mesh, patch) => match self.patch(patch)? {
                Some(patch) => EditRef::Weights(*mesh, patch),
                None => EditRef::Edit(edit),
            },
            edit => EditRef::Edit(edit),
        })
    }
}

fn written(value: &impl Serialize) -> Result<String, JournalWriteError> {
    let text = ron::to_string(value)?;
    if text.len() > MAX_TEXT {
        return Err(JournalWriteError::LargeText { mebibytes: text.len() >> 20 });
    }
    Ok(text)
}

/// A step as text.
pub(super) fn step_text(step: &Step, skins: &mut SkinsOut) -> Result<String, JournalWriteError> {
    let (forward, backward) = (skins.edits(&step.forward)?, skins.edits(&step.backward)?);
    written(&StepRef { name: &step.name, forward, backward, before: &step.before, after: &step.after })
}

/// A whole rig as text.
pub(super) fn rig_text(rig: &Rig, skins: &mut SkinsOut) -> Result<String, JournalWriteError> {
    let edits = edits_from_empty(rig);
    written(&RigRef { uid: rig.uid(), edits: skins.edits(&edits)? })
}

/// A caller's value as text.
pub(super) fn value_text(value: &impl Serialize) -> Result<String, JournalWriteError> {
    written(value)
}

/// Weights of a journal up to the present record, by hash.
pub(super) type SkinsIn = HashMap<u64, Arc<SkinData>>;

fn parsed<'a, T: Deserialize<'a>>(payload: &'a [u8]) -> Option<T> {
    let text = std::str::from_utf8(payload).ok().filter(|text| text.len() <= MAX_TEXT)?;
    ron::from_str(text).ok()
}

/// A step as read from a journal.
pub(super) struct StepIn {
    pub step: Step,
    /// False if the edits refer to lost weights; the step then has no forward edits.
    pub has_forward: bool,
    /// False if the edits that undo the step refer to lost weights.
    pub has_backward: bool,
}

/// Reads a step; `None` if the payload is invalid.
pub(super) fn read_step(payload: &[u8], skins: &SkinsIn) -> Option<StepIn> {
    let StepText { name, forward, backward, before, after } = parsed(payload)?;
    let (forward, backward) = (edits(forward, skins), edits(backward, skins));
    let (has_forward, has_backward) = (forward.is_some(), backward.is_some());
    let (forward, backward) = (forward.unwrap_or_default(), backward.unwrap_or_default());
    Some(StepIn { step: Step { name: Cow::Owned(name), forward, backward, before, after }, has_forward, has_backward })
}

/// Reads a rig without its lost weights, and whether all weights were found; `None` if the payload is invalid.
pub(super) fn read_rig(payload: &[u8], skins: &SkinsIn) -> Option<(Rig, bool)> {
    let RigText { uid, edits: list } = parsed(payload)?;
    let (mut rig, mut is_whole) = (Rig::new(uid, ""), true);
    for text in list {
        match edit(text, skins) {
            Some(edit) => drop(rig.apply(&edit).ok()?),
            None => is_whole = false,
        }
    }
    Some((rig, is_whole))
}

/// Reads a value that [`value_text`] wrote.
pub(super) fn read_value<'a, T: Deserialize<'a>>(payload: &'a [u8]) -> Option<T> {
    parsed(payload)
}

/// Edits from their text form; `None` if they refer to lost weights.
fn edits(list: Vec<EditText>, skins: &SkinsIn) -> Option<Vec<RigEdit>> {
    list.into_iter().map(|text| edit(text, skins)).collect()
}

fn edit(text: EditText, skins: &SkinsIn) -> Option<RigEdit> {
    Some(match text {
        EditText::Edit(edit) => edit,
        EditText::Skin(mesh, hash) => RigEdit::SetSkin(mesh, Some(skins.get(&hash)?.clone())),
        EditText::Batch(list) => RigEdit::Batch(edits(list, skins)?),
        EditText::Weights(mesh, patch) => RigEdit::SetWeights(mesh, Box::new(weight_patch(patch, skins)?)),
    })
}

fn weight_patch(PatchText { kept, added, points, rows }: PatchText, skins: &SkinsIn) -> Option<WeightPatch> {
    let mut last = 0_u32;
    let sum = |step: u32| {
        last = last.checked_add(step)?;
        Some(last)
    };
    let points = points.into_iter().map(sum).collect::<Option<Vec<u32>>>()?;
    Some(WeightPatch { kept, added, points, rows: skins.get(&rows)?.weights.clone() })
}
