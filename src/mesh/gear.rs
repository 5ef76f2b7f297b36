//! Gear: objects that hang on a bone of a skinned character, such as a hat, a shield or a staff.

use super::model::{Model, Part};

/// Share of a model's triangles that skinned objects need for its other objects to be gear: the plates of a robot are its
/// body.
const SKINNED: f32 = 0.4;

impl Model {
    /// Objects that a node carries without a skin beside skinned ones that make up most of the model, by their indices;
    /// empty for models without skins.
    pub fn gear(&self) -> Vec<usize> {
        let (mut skinned, mut all) = (0, 0);
        for part in &self.parts {
            all += part.triangles.len();
            if self.objects.get(part.object).is_some_and(|object| object.skin.is_some()) {
                skinned += part.triangles.len();
            }
        }
        if skinned == 0 || (skinned as f32) < SKINNED * all as f32 {
            return Vec::new();
        }
        let is_gear = |at: &usize| self.objects[*at].skin.is_none() && self.objects[*at].node.is_some();
        (0..self.objects.len()).filter(is_gear).collect()
    }

    /// The node on which each point hangs, as part of an object without a skin; empty if no object hangs on a node. Points that
    /// a skinned object has, too, hang on none.
    pub fn carriers(&self) -> Vec<Option<usize>> {
        let mut carriers = Vec::new();
        for part in &self.parts {
            let object = self.objects.get(part.object).filter(|object| object.skin.is_none());
            let Some(node) = object.and_then(|object| object.node) else { continue };
            carriers.resize(self.points.len(), None);
            for point in &part.vertices {
                if let Some(carrier) = carriers.get_mut(*point as usize) {
                    *carrier = Some(node);
                }
            }
        }
        let is_skinned = |part: &&Part| self.objects.get(part.object).is_some_and(|object| object.skin.is_some());
        for point in self.parts.iter().filter(is_skinned).flat_map(|part| &part.vertices) {
            if let Some(carrier) = carriers.get_mut(*point as usize) {
                *carrier = None;
            }
        }
        carriers
    }

    /// Numbers of the triangles, in the order of [`Model::point_triangles`], whose objects are wanted.
    pub fn triangles_of(&self, is_wanted: impl Fn(usize) -> bool) -> Vec<u32> {
        let mut first = 0;
        let mut triangles = Vec::new();
        for part in &self.parts {
            let count = part.triangles.len() as u32;
            if is_wanted(part.object) {
                triangles.extend(first..first + count);
            }
            first += count;
        }
        triangles
    }
}
