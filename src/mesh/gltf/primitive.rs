//! Meshes and primitives as declared (section 3.7): their accessors, checked against each other.

use super::{
    GltfError,
    accessor::Accessor,
    budget::{Budget, Notes},
    json::{JsonObject, whole},
    tree::Json,
};

/// Attribute names and their accessors, in the file's order.
pub(super) type Attributes<'a> = Vec<(&'a str, usize)>;

/// Extension of compressed geometry; files may or may not have plain geometry beside it.
const DRACO: &str = "KHR_draco_mesh_compression";

/// A mesh as declared.
pub(super) struct Mesh<'a> {
    pub(super) name: &'a str,
    pub(super) primitives: Vec<Primitive<'a>>,
    pub(super) weights: Vec<f32>,
    pub(super) extras: Option<&'a Json<'a>>,
    /// Morph targets of every primitive.
    pub(super) targets: usize,
}

/// A primitive as declared; all its vertex attributes have `count` elements.
pub(super) struct Primitive<'a> {
    pub(super) place: String,
    pub(super) attributes: Attributes<'a>,
    pub(super) count: usize,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: usize,
    pub(super) targets: Vec<Attributes<'a>>,
}

impl Primitive<'_> {
    pub(super) fn attribute(&self, name: &str) -> Option<usize> {
        find(&self.attributes, name)
    }
}

/// The accessor of an attribute.
pub(super) fn find(attributes: &Attributes, name: &str) -> Option<usize> {
    attributes.iter().find(|(known, _)| *known == name).map(|(_, accessor)| *accessor)
}

impl<'a> Mesh<'a> {
    pub(super) fn new(
        at: &JsonObject<'a>,
        accessors: &[Accessor],
        materials: usize,
        budget: &Budget,
        notes: &Notes,
    ) -> Result<Self, GltfError> {
        at.need("primitives", at.map.get("primitives"))?;
        let mut primitives: Vec<Primitive> = Vec::new();
        for primitive in at.objects("primitives")? {
            let primitive = primitive?;
            budget.take(1, 256, &primitive.place)?;
            primitives.push(Primitive::new(&primitive, accessors, materials, budget, notes)?);
        }
        let targets = primitives.first().map_or(0, |primitive| primitive.targets.len());
        if let Some(other) = primitives.iter().find(|primitive| primitive.targets.len() != targets) {
            let what = format!("{} morph targets, the mesh's first primitive has {targets}", other.targets.len());
            return Err(GltfError::at(format!("{}/targets", other.place), what));
        }
        let weights = morph_weights(at, targets)?.unwrap_or_default();
        Ok(Self { name: at.name(), primitives, weights, extras: at.map.get("extras"), targets })
    }
}

/// The `weights` of a mesh or node.
pub(super) fn morph_weights(at: &JsonObject, targets: usize) -> Result<Option<Vec<f32>>, GltfError> {
    match at.numbers("weights")? {
        Some(weights) if weights.len() != targets => {
            Err(at.fail("weights", format!("{} weights for {targets} morph targets", weights.len())))
        }
        weights => Ok(weights.map(|weights| weights.into_iter().map(|weight| weight as f32).collect())),
    }
}

impl<'a> Primitive<'a> {
    fn new(
        at: &JsonObject<'a>,
        accessors: &[Accessor],
        materials: usize,
        budget: &Budget,
        notes: &Notes,
    ) -> Result<Self, GltfError> {
        let map = at.need("attributes", at.object("attributes")?)?;
        let attributes = attributes(&map, accessors.len())?;
        budget.take(attributes.len(), 32, &at.place)?;
        let mode = at.uint("mode")?.unwrap_or(4);
        if mode > 6 {
            return Err(at.fail("mode", format!("is {mode}, must be at most 6")));
        }
        let count = match find(&attributes, "POSITION").or(attributes.first().map(|(_, accessor)| *accessor)) {
            Some(accessor) => accessors[accessor].count,
            None => 0,
        };
        check_counts(&map, &attributes, count, accessors)?;
        let mut targets = Vec::new();
        for target in at.objects("targets")? {
            let target = target?;
            let list = self::attributes(&target, accessors.len())?;
            budget.take(list.len() + 1, 32, &target.place)?;
            check_counts(&target, &list, count, accessors)?;
            targets.push(list);
        }
        let extension = |name: &str| at.map.get("extensions").is_some_and(|extensions| extensions.get(name).is_some());
        let empty = find(&attributes, "POSITION").is_some_and(|accessor| accessors[accessor].is_empty());
        if extension(DRACO) && empty {
            return Err(GltfError::Extension { file: String::new(), name: DRACO.to_owned() });
        }
        let indices = at.index("indices", accessors.len(), "accessor")?;
        let material = at.index("material", materials, "material")?;
        if extension("KHR_materials_variants") {
            notes.add("Material variants were not kept");
        }
        Ok(Self { place: at.place.clone(), attributes, count, indices, material, mode, targets })
    }
}

fn attributes<'a>(at: &JsonObject<'a>, accessors: usize) -> Result<Attributes<'a>, GltfError> {
    let mut list = Vec::with_capacity(at.map.len());
    for (name, value) in at.map.iter() {
        match whole(value) {
            Some(index) if index < accessors => list.push((name, index)),
            Some(index) => {
                let what = format!("refers to accessor {index}, but there are {accessors}");
                return Err(at.fail(name, what));
            }
            None => return Err(at.fail(name, "must be the index of an accessor")),
        }
    }
    Ok(list)
}

fn check_counts(
    at: &JsonObject,
    attributes: &Attributes,
    count: usize,
    accessors: &[Accessor],
) -> Result<(), GltfError> {
    match attributes.iter().find(|(_, accessor)| accessors[*accessor].count != count) {
        None => Ok(()),
        Some((name, accessor)) => {
            let what = format!("has {} elements, but there are {count} vertices", accessors[*accessor].count);
            Err(at.fail(name, what))
        }
    }
}
