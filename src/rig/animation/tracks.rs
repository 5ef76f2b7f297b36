//! Serialisation of tracks as a list: files do not record which tracks are shared in memory.

use std::{collections::BTreeMap, sync::Arc};

use serde::{Deserialize, Deserializer, Serializer};

use super::{Track, TrackTarget};

pub(super) fn serialize<S: Serializer>(
    tracks: &BTreeMap<TrackTarget, Arc<Track>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(tracks.iter().map(|(target, track)| (target, &**track)))
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<TrackTarget, Arc<Track>>, D::Error> {
    let list: Vec<(TrackTarget, Track)> = Deserialize::deserialize(deserializer)?;
    Ok(list.into_iter().map(|(target, track)| (target, Arc::new(track))).collect())
}
