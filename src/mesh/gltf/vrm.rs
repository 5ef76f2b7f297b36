//! Avatars of VRM 1.0 files, read from their extensions.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde_json::Value;

use super::{GltfError, budget::Budget, container};
use crate::mesh::vrm::{Avatar, NodeConstraint, SpringBones, Vrm};

/// Reads the avatar of a VRM 1.0 file; its indices are those of the file's nodes. `None` for a file without the extension
/// `VRMC_vrm`. Content that [`Avatar`] has no fields for, such as colours in expressions, is passed over, and so are
/// constraints of other kinds.
///
/// # Errors
/// [`GltfError`] if the file is no glTF, or an extension is not as the specification has it.
pub fn read_avatar(bytes: &[u8], name: &str) -> Result<Option<Avatar>, GltfError> {
    read(bytes).map_err(|error| error.in_file(name))
}

fn read(bytes: &[u8]) -> Result<Option<Avatar>, GltfError> {
    let budget = Budget::new(bytes.len() as u64);
    let root = container::parse(container::split(bytes)?.json, &budget)?;
    let Some(vrm) = extension::<Vrm>(&root, "/extensions/VRMC_vrm")? else { return Ok(None) };
    let springs = extension::<SpringBones>(&root, "/extensions/VRMC_springBone")?.unwrap_or_default();
    let mut constraints = BTreeMap::new();
    let nodes = root.get("nodes").and_then(Value::as_array).map_or(0, Vec::len);
    for node in 0..nodes {
        let place = format!("/nodes/{node}/extensions/VRMC_node_constraint");
        let constraint = extension::<NodeConstraint>(&root, &place).ok().flatten();
        constraints.extend(constraint.map(|constraint| (node, constraint)));
    }
    Ok(Some(Avatar { vrm, springs, constraints }))
}

/// Extension at a place of the document; `None` if it is not there.
fn extension<T: DeserializeOwned>(root: &Value, place: &str) -> Result<Option<T>, GltfError> {
    let Some(value) = root.pointer(place) else { return Ok(None) };
    T::deserialize(value).map(Some).map_err(|error| GltfError::at(place, error.to_string()))
}
