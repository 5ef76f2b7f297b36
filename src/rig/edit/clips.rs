//! Edits of clips, their layers and their keys.

use std::sync::Arc;

use crate::rig::{
    EditError, Rig, RigEdit, Uid,
    animation::{
        ClipAbout, ClipLayer, Key, KeyFault, LayerAbout, RigClip, Track, TrackTarget, check_about, check_clip,
        check_keys, check_layer, check_tracks,
    },
};

impl Rig {
    fn clip_mut(&mut self, uid: Uid) -> Result<&mut RigClip, EditError> {
        self.clips.iter_mut().find(|clip| clip.uid == uid).ok_or(EditError::NoClip(uid))
    }

    fn layer_mut(&mut self, clip: Uid, layer: Uid) -> Result<&mut ClipLayer, EditError> {
        let layers = &mut self.clip_mut(clip)?.layers;
        layers.iter_mut().find(|known| known.uid == layer).ok_or(EditError::NoLayer(clip, layer))
    }

    pub(super) fn add_clip(&mut self, clip: &RigClip, index: usize) -> Result<RigEdit, EditError> {
        self.check_free(clip.uid)?;
        clip.layers.iter().try_for_each(|layer| self.check_free(layer.uid))?;
        check_clip(clip)?;
        let mut clip = clip.clone();
        clip.layers.iter_mut().for_each(settle);
        let uid = clip.uid;
        self.clip_uids.extend(uids_of(&clip));
        self.clips.insert(index.min(self.clips.len()), clip);
        Ok(RigEdit::RemoveClip(uid))
    }

    pub(super) fn remove_clip(&mut self, uid: Uid) -> Result<RigEdit, EditError> {
        let index = self.clips.iter().position(|clip| clip.uid == uid).ok_or(EditError::NoClip(uid))?;
        let clip = self.clips.remove(index);
        for uid in uids_of(&clip) {
            self.clip_uids.remove(&uid);
        }
        Ok(RigEdit::AddClip(Box::new(clip), index))
    }

    pub(super) fn set_clip_about(&mut self, uid: Uid, about: &ClipAbout) -> Result<RigEdit, EditError> {
        check_about(uid, about)?;
        Ok(RigEdit::SetClipAbout(uid, Box::new(self.clip_mut(uid)?.set_about(about))))
    }

    pub(super) fn add_layer(&mut self, clip: Uid, layer: &ClipLayer, index: usize) -> Result<RigEdit, EditError> {
        self.check_free(layer.uid)?;
        check_tracks(clip, layer)?;
        let mut layer = layer.clone();
        settle(&mut layer);
        let uid = layer.uid;
        let layers = &mut self.clip_mut(clip)?.layers;
        layers.insert(index.min(layers.len()), layer);
        self.clip_uids.insert(uid);
        Ok(RigEdit::RemoveLayer { clip, layer: uid })
    }

    pub(super) fn remove_layer(&mut self, clip: Uid, layer: Uid) -> Result<RigEdit, EditError> {
        let layers = &mut self.clip_mut(clip)?.layers;
        let index = layers.iter().position(|known| known.uid == layer).ok_or(EditError::NoLayer(clip, layer))?;
        let removed = layers.remove(index);
        self.clip_uids.remove(&layer);
        Ok(RigEdit::AddLayer { clip, layer: Box::new(removed), index })
    }

    pub(super) fn set_layer(&mut self, clip: Uid, layer: Uid, about: &LayerAbout) -> Result<RigEdit, EditError> {
        check_layer(clip, about.weight)?;
        let about = Box::new(self.layer_mut(clip, layer)?.set_about(about));
        Ok(RigEdit::SetLayer { clip, layer, about })
    }

    /// Removes the keys at the times `removed`, then adds `inserted`.
    pub(super) fn set_keys(
        &mut self,
        clip: Uid,
        layer: Uid,
        target: &TrackTarget,
        removed: &[f32],
        inserted: &[Key],
    ) -> Result<RigEdit, EditError> {
        let tracks = &mut self.layer_mut(clip, layer)?.tracks;
        let fault = |fault| EditError::BadKeys { target: target.clone(), fault };
        check_keys(&target.property, inserted).map_err(fault)?;
        let before = tracks.get(target).map_or(&[] as &[Key], |track| &track.keys);
        let (keys, taken) = exchanged(before, removed, inserted).map_err(fault)?;
        if keys.is_empty() {
            tracks.remove(target);
        } else {
            tracks.insert(target.clone(), Arc::new(Track { keys }));
        }
        let removed = inserted.iter().map(|key| key.time).collect();
        Ok(RigEdit::SetKeys { clip, layer, target: target.clone(), removed, inserted: taken })
    }
}

/// Uids of a clip and of its layers.
fn uids_of(clip: &RigClip) -> impl Iterator<Item = Uid> {
    std::iter::once(clip.uid).chain(clip.layers.iter().map(|layer| layer.uid))
}

/// Layer in its stored form: without tracks that have no keys.
fn settle(layer: &mut ClipLayer) {
    layer.tracks.retain(|_, track| !track.keys.is_empty());
}

/// Keys without those at the times `removed` and with those `inserted`, and the removed keys.
fn exchanged(before: &[Key], removed: &[f32], inserted: &[Key]) -> Result<(Vec<Key>, Vec<Key>), KeyFault> {
    let mut taken = Vec::with_capacity(removed.len());
    let mut keys = Vec::with_capacity((before.len() + inserted.len()).saturating_sub(removed.len()));
    let (mut gone, mut fresh) = (removed.iter().peekable(), inserted.iter().peekable());
    if let Some(pair) = removed.windows(2).find(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less))
    {
        return Err(KeyFault::Order(pair[1]));
    }
    for key in before {
        match gone.peek() {
            Some(time) if **time == key.time => {
                gone.next();
                taken.push(*key);
                continue;
            }
            Some(time) if **time < key.time || time.is_nan() => return Err(KeyFault::Absent(**time)),
            _ => {}
        }
        while let Some(next) = fresh.next_if(|next| next.time < key.time) {
            keys.push(*next);
        }
        if fresh.peek().is_some_and(|next| next.time == key.time) {
            return Err(KeyFault::Taken(key.time));
        }
        keys.push(*key);
    }
    if let Some(time) = gone.next() {
        return Err(KeyFault::Absent(*time));
    }
    keys.extend(fresh);
    Ok((keys, taken))
}
