//! The node hierarchy: checked to be a forest, ordered, placed in model space; and the selection of the nodes to keep.

use std::mem::size_of;

use glam::{DAffine3, DMat4, Quat, Vec3};

use super::{
    GltfError,
    accessor::Source,
    budget::Notes,
    document::{Document, NodeEntry},
    json::{JsonObject, copy},
    matrix,
};
use crate::mesh::model::{Node, Trs};

/// Index for each node of the file, or none: four bytes each, because a file may have many nodes for its size.
pub(super) struct NodeIndices(Vec<u32>);

impl NodeIndices {
    /// Number that no index has: a node takes at least two bytes of a file of no more than 4 GiB.
    const NONE: u32 = u32::MAX;

    fn none(count: usize) -> Self {
        Self(vec![Self::NONE; count])
    }

    /// Index for a node; `None` if it has none.
    pub(super) fn get(&self, node: usize) -> Option<usize> {
        Some(self.0[node]).filter(|index| *index != Self::NONE).map(|index| index as usize)
    }

    fn set(&mut self, node: usize, index: usize) {
        self.0[node] = index as u32;
    }
}

/// Properties of each node of the file.
pub(super) struct Hierarchy {
    parents: NodeIndices,
    /// Indices of the nodes, parents first.
    order: Vec<u32>,
    /// Marks nodes of the scene that is read.
    pub(super) visible: Vec<bool>,
    /// Marks nodes that a skin lists.
    joint: Vec<bool>,
    /// The nearest kept node at or above a node that a joint or clip moves.
    pub(super) carrier: NodeIndices,
    /// Index in the model's nodes; `None` for a node that is not kept.
    pub(super) kept: NodeIndices,
    /// Rest transforms of the nodes that are kept, in the order of the model's nodes.
    rest: Vec<Trs>,
    /// Transforms to model space at rest. Nodes that are not kept keep the shear that [`Trs`] cannot hold.
    pub(super) world: Vec<DAffine3>,
}

impl Hierarchy {
    pub(super) fn new(source: &Source, notes: &Notes) -> Result<Self, GltfError> {
        let document = source.document;
        let count = document.nodes.len();
        source.budget.take(count, size_of::<DAffine3>() + 40, "/nodes")?;
        let parents = parents(document)?;
        let scene = document.scene.as_deref().unwrap_or_default();
        let order = depth_first(document, &parents, scene)?;

        let mut visible = vec![document.scene.is_none(); count];
        for &node in scene {
            visible[node] = true;
        }
        let (mut joint, mut animated) = (vec![false; count], vec![false; count]);
        for &node in document.skins.iter().flat_map(|skin| &skin.joints) {
            joint[node] = true;
        }
        for channel in document.animations.iter().flat_map(|animation| &animation.channels) {
            animated[channel.node] |= matches!(channel.path, "translation" | "rotation" | "scale");
        }
        let mut moves: Vec<bool> = joint.iter().zip(&animated).map(|(&joint, &animated)| joint || animated).collect();
        let mut needed = moves.clone();
        for node in order.iter().rev().map(|node| *node as usize) {
            if let (true, Some(parent)) = (needed[node], parents.get(node)) {
                needed[parent] = true;
            }
        }
        // A file of motion alone has a skeleton, of which some joints may be still.
        let is_motion_alone = document.skins.is_empty() && document.nodes.iter().all(|entry| entry.mesh.is_none());
        let (mut kept, mut carrier) = (NodeIndices::none(count), NodeIndices::none(count));
        let mut next = 0;
        for node in order.iter().map(|node| *node as usize) {
            if let Some(parent) = parents.get(node) {
                visible[node] |= visible[parent];
                moves[node] |= moves[parent];
                needed[node] |= is_motion_alone && needed[parent] && !document.nodes[node].camera;
            }
            if needed[node] {
                kept.set(node, next);
                next += 1;
            }
            let above = || parents.get(node).and_then(|parent| carrier.get(parent));
            if let Some(index) = kept.get(node).or_else(above).filter(|_| moves[node]) {
                carrier.set(node, index);
            }
        }

        source.budget.take(next, size_of::<Trs>(), "/nodes")?;
        let mut rest = Vec::with_capacity(next);
        let mut world = vec![DAffine3::IDENTITY; count];
        for node in order.iter().map(|node| *node as usize) {
            let at = document.nodes[node].at(node);
            let (trs, exact) = rest_transform(&at, notes, needed[node])?;
            if needed[node] {
                rest.push(trs);
            }
            let local = if needed[node] { matrix::affine(&trs) } else { exact };
            world[node] = parents.get(node).map_or(local, |parent| world[parent] * local);
            // The `f32` matrix has to be finite, too: other code computes with it.
            if !world[node].as_affine3a().is_finite() {
                return Err(GltfError::at(at.place, "the transform in model space is not finite"));
            }
        }
        let hierarchy = Self { parents, order, visible, joint, carrier, kept, rest, world };
        hierarchy.note_dropped(document, notes);
        Ok(hierarchy)
    }

    /// The model's nodes.
    pub(super) fn kept_nodes(&self, source: &Source) -> Result<Vec<Node>, GltfError> {
        let Source { document, budget, .. } = source;
        let mut nodes = Vec::with_capacity(self.rest.len());
        let kept = self.order.iter().map(|node| *node as usize).filter(|node| self.kept.get(*node).is_some());
        for (node, rest) in kept.zip(&self.rest) {
            let entry = &document.nodes[node];
            let at = entry.at(node);
            let extras = at.map.get("extras");
            budget.take(1, size_of::<Node>() + entry.name.len(), &at.place)?;
            nodes.push(Node {
                name: entry.name.to_owned(),
                parent: self.parents.get(node).and_then(|parent| self.kept.get(parent)),
                rest: *rest,
                joint: self.joint[node],
                extras: extras.map(|extras| copy(extras, budget, &at.place)).transpose()?,
            });
        }
        Ok(nodes)
    }

    fn note_dropped(&self, document: &Document, notes: &Notes) {
        let of_scene = |node: &(usize, &NodeEntry)| self.visible[node.0];
        let count = |what: &dyn Fn(&NodeEntry) -> bool| {
            document.nodes.iter().enumerate().filter(of_scene).filter(|(_, entry)| what(entry)).count()
        };
        let extension = |entry: &NodeEntry, name: &str| {
            entry.map.get("extensions").is_some_and(|extensions| extensions.get(name).is_some())
        };
        notes.add_times("A camera was not kept", count(&|entry| entry.camera));
        notes.add_times("A light was not kept", count(&|entry| extension(entry, "KHR_lights_punctual")));
        let instanced = count(&|entry| extension(entry, "EXT_mesh_gpu_instancing"));
        notes.add_times("Instances of a mesh by EXT_mesh_gpu_instancing were not made", instanced);
        let carries =
            |entry: &NodeEntry| entry.mesh.is_some() || entry.camera || extension(entry, "KHR_lights_punctual");
        let plain = document.nodes.iter().enumerate().filter(of_scene);
        let plain = plain
            .filter(|(node, entry)| self.kept.get(*node).is_none() && !carries(entry) && entry.children.is_empty());
        notes.add_times("A node without mesh, joint or animation was not kept", plain.count());
    }
}

/// The parent of each node; a node with two is an error.
fn parents(document: &Document) -> Result<NodeIndices, GltfError> {
    let mut parents = NodeIndices::none(document.nodes.len());
    for (node, entry) in document.nodes.iter().enumerate() {
        for (i, &child) in entry.children.iter().enumerate() {
            if let Some(other) = parents.get(child) {
                let what = format!("node {child} is already a child of node {other}");
                return Err(GltfError::at(format!("/nodes/{node}/children/{i}"), what));
            }
            parents.set(child, node);
        }
    }
    Ok(parents)
}

/// Orders nodes depth first, each before its children: first the scene's roots, then other roots. A node below no root
/// is in a cycle, which is an error.
fn depth_first(document: &Document, parents: &NodeIndices, scene: &[usize]) -> Result<Vec<u32>, GltfError> {
    let count = document.nodes.len();
    let mut order = Vec::with_capacity(count);
    let mut seen = vec![false; count];
    let roots = scene.iter().copied().chain(0..count).filter(|&node| parents.get(node).is_none());
    let mut stack = Vec::new();
    for root in roots {
        if std::mem::replace(&mut seen[root], true) {
            continue;
        }
        stack.push(root);
        while let Some(node) = stack.pop() {
            seen[node] = true;
            order.push(node as u32);
            stack.extend(document.nodes[node].children.iter().rev());
        }
    }
    match seen.iter().position(|seen| !seen) {
        None => Ok(order),
        Some(node) => {
            Err(GltfError::at(format!("/nodes/{node}"), "the node is its own ancestor, or below one that is"))
        }
    }
}

/// Transform of a node as declared, and as a matrix that keeps its shear.
fn rest_transform(at: &JsonObject, notes: &Notes, needed: bool) -> Result<(Trs, DAffine3), GltfError> {
    if let Some(columns) = at.vector::<16>("matrix")? {
        let matrix = DMat4::from_cols_array(&columns);
        let last = matrix.row(3);
        if last.truncate().abs().max_element() > 1e-6 || (last.w - 1.0).abs() > 1e-6 {
            return Err(at.fail("matrix", "the last row must be 0 0 0 1"));
        }
        let (trs, sheared) = matrix::decompose(matrix);
        if sheared && needed {
            notes.add("The shear of a node's matrix was not kept");
        }
        if ["translation", "rotation", "scale"].iter().any(|key| at.map.contains_key(key)) {
            notes.add("A node has a matrix and also translation, rotation or scale; the matrix was used");
        }
        return Ok((trs, DAffine3::from_mat4(matrix)));
    }
    let vec3 = |key: &str, default: Vec3| {
        let found = at.vector::<3>(key)?;
        Ok::<_, GltfError>(found.map_or(default, |v| Vec3::from_array(v.map(|number| number as f32))))
    };
    let rotation = match at.vector::<4>("rotation")? {
        None => Quat::IDENTITY,
        Some(numbers) => matrix::unit(Quat::from_array(numbers.map(|number| number as f32)))
            .ok_or_else(|| at.fail("rotation", "must be a unit quaternion, is zero"))?,
    };
    let trs = Trs { translation: vec3("translation", Vec3::ZERO)?, rotation, scale: vec3("scale", Vec3::ONE)? };
    Ok((trs, matrix::affine(&trs)))
}
