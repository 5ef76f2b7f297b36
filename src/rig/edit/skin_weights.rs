//! Serialisation of shared weights in an edit as plain data: files do not record which weights are shared in memory.

use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::rig::SkinData;

pub(super) fn serialize<S: Serializer>(skin: &Option<Arc<SkinData>>, serializer: S) -> Result<S::Ok, S::Error> {
    skin.as_deref().serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Arc<SkinData>>, D::Error> {
    Ok(Option::<SkinData>::deserialize(deserializer)?.map(Arc::new))
}
