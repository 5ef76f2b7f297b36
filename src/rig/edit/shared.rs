//! Weights in an edit as plain data: that they are shared in memory is nothing a file should know.

use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::rig::SkinData;

pub(super) fn serialize<S: Serializer>(skin: &Option<Arc<SkinData>>, serializer: S) -> Result<S::Ok, S::Error> {
    skin.as_deref().serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Arc<SkinData>>, D::Error> {
    Ok(Option::<SkinData>::deserialize(deserializer)?.map(Arc::new))
}
