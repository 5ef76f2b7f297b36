//! Avatars of VRM 1.0 files, read from their extensions.

use std::collections::BTreeMap;

use super::{GltfError, budget::Budget, container, tree::Json};
use crate::mesh::vrm::{Avatar, NodeConstraint, SpringBones, Vrm};
use serde::de::DeserializeOwned;

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
    let extensions = root.get("extensions");
    let own = |name: &str| extensions.and_then(|extensions| extensions.get(name));
    let Some(vrm) = extension::<Vrm>(own("VRMC_vrm"), "/extensions/VRMC_vrm")? else { return Ok(None) };
    let springs = extension::<SpringBones>(own("VRMC_springBone"), "/extensions/VRMC_springBone")?.unwrap_or_default();
    let mut constraints = BTreeMap::new();
    let nodes = root.get("nodes").and_then(Json::as_list).unwrap_or_default();
    for (node, entry) in nodes.iter().enumerate() {
        let constraint = entry.get("extensions").and_then(|extensions| extensions.get("VRMC_node_constraint"));
        let constraint = extension::<NodeConstraint>(constraint, "").ok().flatten();
        constraints.extend(constraint.map(|constraint| (node, constraint)));
    }
    Ok(Some(Avatar { vrm, springs, constraints }))
}

/// Extension at a place of the document; `None` if it is not there.
fn extension<T: DeserializeOwned>(value: Option<&Json>, place: &str) -> Result<Option<T>, GltfError> {
    let Some(value) = value else { return Ok(None) };
    T::deserialize(value.to_value()).map(Some).map_err(|error| GltfError::at(place, error.to_string()))
}
