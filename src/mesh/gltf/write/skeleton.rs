//! Selection of the written nodes, and the skins over them.

use super::{
    GltfWriteSettings,
    buffer::{Bin, Target},
    document::{Node, Skin},
};
use crate::mesh::{
    gltf::{GltfError, skin::settle},
    model::{Model, Weights},
};

/// The name of the node that joins several roots.
const COMMON_ROOT: &str = "skeleton";

/// The written nodes, and the influences over them.
pub(super) struct Skeleton {
    /// The glTF node of each of the model's nodes.
    pub(super) node_of: Vec<Option<usize>>,
    /// The glTF nodes at the scene's root.
    pub(super) roots: Vec<usize>,
    /// The model's root nodes below the common root.
    joined: Vec<usize>,
    /// Influences of each point of a skinned object, over the model's nodes.
    influences: Weights,
    /// The glTF skin of each of the model's skins.
    pub(super) skin_of: Vec<Option<usize>>,
    /// Written joints of each skin by node, with their position in the skin.
    slots: Vec<Vec<(usize, u16)>>,
    /// Joint of each skin that points without weights are bound to.
    root_joints: Vec<Option<usize>>,
}

impl Skeleton {
    pub(super) fn new(model: &Model, settings: &GltfWriteSettings) -> Result<Self, GltfError> {
        let count = model.nodes.len();
        let mut needed = vec![settings.all_joints; count];
        // Parents come first, so no joint of a skin is above the smallest.
        let root_joints: Vec<Option<usize>> =
            model.skins.iter().map(|skin| skin.joints.iter().copied().min()).collect();
        let skinned = skinned_points(model);
        let influences = cut(model, &skinned, settings.max_influences.clamp(1, 8));
        for joint in &influences.joints {
            needed[*joint as usize] = true;
        }
        for (object, points) in model.objects.iter().zip(&skinned) {
            let bare = points.iter().filter(|point| influences.of(**point as usize).len() == 0).count();
            let Some(skin) = object.skin.filter(|_| bare > 0) else {
                continue;
            };
            match root_joints[skin].filter(|_| settings.bind_unweighted) {
                Some(root) => needed[root] = true,
                None => return Err(GltfError::Unweighted { object: object.name.clone(), points: bare }),
            }
        }
        for part in model.parts.iter().filter(|part| !part.triangles.is_empty()) {
            let object = &model.objects[part.object];
            if let (None, Some(node)) = (object.skin, object.node) {
                needed[node] = true;
            }
        }
        for node in (0..count).rev() {
            if let (true, Some(parent)) = (needed[node], model.nodes[node].parent) {
                needed[parent] = true;
            }
        }

        let (mut slots, mut skin_of) = (Vec::new(), Vec::new());
        let mut skins = 0;
        for skin in &model.skins {
            let written = skin.joints.iter().filter(|joint| needed[**joint]);
            let mut list: Vec<(usize, u16)> = written.zip(0..=u16::MAX).map(|(joint, slot)| (*joint, slot)).collect();
            if list.len() < skin.joints.iter().filter(|joint| needed[**joint]).count() {
                return Err(GltfError::model("a skin has more than 65536 joints"));
            }
            list.sort_unstable();
            skin_of.push((!list.is_empty()).then_some(skins));
            skins += usize::from(!list.is_empty());
            slots.push(list);
        }

        let joined = joined_roots(model, &slots);
        let first = usize::from(!joined.is_empty());
        let mut node_of = vec![None; count];
        let mut roots: Vec<usize> = (0..first).collect();
        for (at, node) in (first..).zip((0..count).filter(|node| needed[*node])) {
            node_of[node] = Some(at);
            if model.nodes[node].parent.is_none() && joined.binary_search(&node).is_err() {
                roots.push(at);
            }
        }
        Ok(Self { node_of, roots, joined, influences, skin_of, slots, root_joints })
    }

    /// The chosen nodes as glTF objects.
    pub(super) fn nodes<'a>(&self, model: &'a Model) -> Vec<Node<'a>> {
        let mut children = vec![Vec::new(); self.node_of.iter().flatten().max().map_or(0, |last| last + 1)];
        let mut nodes = Vec::with_capacity(children.len() + model.objects.len());
        if !self.joined.is_empty() {
            nodes.push(Node { name: COMMON_ROOT, ..Node::default() });
            children[0] = self.joined.iter().filter_map(|node| self.node_of[*node]).collect();
        }
        for (node, at) in model.nodes.iter().zip(&self.node_of) {
            let Some(at) = *at else {
                continue;
            };
            if let Some(parent) = node.parent.and_then(|parent| self.node_of[parent]) {
                children[parent].push(at);
            }
            let mut written = Node { name: &node.name, extras: node.extras.as_ref(), ..Node::default() };
            written.set_transform(&node.rest);
            nodes.push(written);
        }
        for (node, children) in nodes.iter_mut().zip(children) {
            node.children = children;
        }
        nodes
    }

    /// The skins over written joints.
    pub(super) fn skins<'a>(&self, model: &'a Model, bin: &mut Bin) -> Vec<Skin<'a>> {
        let mut skins = Vec::new();
        for skin in &model.skins {
            let (mut joints, mut matrices) = (Vec::new(), Vec::new());
            for (joint, matrix) in skin.joints.iter().zip(&skin.inverse_binds) {
                if let Some(node) = self.node_of[*joint] {
                    let mut columns = matrix.to_cols_array();
                    for (i, last) in [(3, 0.0), (7, 0.0), (11, 0.0), (15, 1.0)] {
                        columns[i] = last;
                    }
                    joints.push(node);
                    matrices.push(columns);
                }
            }
            if joints.is_empty() {
                continue;
            }
            let inverse_bind_matrices = bin.floats(&matrices, Target::Other);
            skins.push(Skin { name: &skin.name, inverse_bind_matrices, joints });
        }
        skins
    }

    /// Number of written joints of a skin.
    pub(super) fn joint_count(&self, skin: usize) -> usize {
        self.slots[skin].len()
    }

    /// The influences of a point over the written joints of a skin.
    pub(super) fn influences(&self, skin: usize, point: u32) -> Result<Vec<(u16, f32)>, GltfError> {
        let slot = |node: usize| {
            let outside =
                || GltfError::model(format!("point {point} has weights on node {node}, which its skin does not list"));
            let slots = &self.slots[skin];
            let found = slots.binary_search_by_key(&node, |(node, _)| *node);
            found.map(|found| slots[found].1).map_err(|_| outside())
        };
        let list = self.influences.of(point as usize);
        if list.len() == 0 {
            return self.root_joints[skin].map(|root| Ok((slot(root)?, 1.0))).into_iter().collect();
        }
        list.map(|(node, weight)| Ok((slot(node as usize)?, weight))).collect()
    }
}

/// The points that triangles of each skinned object use, each once.
fn skinned_points(model: &Model) -> Vec<Vec<u32>> {
    let mut parts: Vec<_> = model.parts.iter().filter(|part| model.objects[part.object].skin.is_some()).collect();
    parts.sort_by_key(|part| part.object);
    let mut points = vec![Vec::new(); model.objects.len()];
    // The last object that has used each point, counted from one.
    let mut user = vec![0; model.points.len()];
    for part in parts {
        for vertex in part.triangles.iter().flatten() {
            let point = part.vertices[*vertex as usize];
            if std::mem::replace(&mut user[point as usize], part.object + 1) != part.object + 1 {
                points[part.object].push(point);
            }
        }
    }
    points
}

/// The `most` strongest influences of the given points, summing to one.
fn cut(model: &Model, skinned: &[Vec<u32>], most: usize) -> Weights {
    let mut wanted = vec![false; model.points.len()];
    skinned.iter().flatten().for_each(|point| wanted[*point as usize] = true);
    let mut out = Weights { starts: vec![0], ..Default::default() };
    let mut list = Vec::new();
    for (point, wanted) in wanted.into_iter().enumerate() {
        list.clear();
        if let Some(weights) = model.weights.as_ref().filter(|_| wanted) {
            list.extend(weights.of(point));
            settle(&mut list);
            if list.len() > most {
                list.truncate(most);
                settle(&mut list);
            }
        }
        out.push(list.iter().copied());
    }
    out
}

/// Roots that need a common parent: the roots above a skin with joints below several of them.
fn joined_roots(model: &Model, slots: &[Vec<(usize, u16)>]) -> Vec<usize> {
    let mut root_of: Vec<usize> = Vec::with_capacity(model.nodes.len());
    for (node, entry) in model.nodes.iter().enumerate() {
        root_of.push(entry.parent.map_or(node, |parent| root_of[parent]));
    }
    let mut joined = Vec::new();
    for slots in slots {
        let mut roots: Vec<usize> = slots.iter().map(|(node, _)| root_of[*node]).collect();
        roots.sort_unstable();
        roots.dedup();
        if roots.len() > 1 {
            joined.extend(roots);
        }
    }
    joined.sort_unstable();
    joined.dedup();
    joined
}
