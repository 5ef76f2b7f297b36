//! Expressions made of the morph targets of a model.

use std::collections::BTreeMap;

use crate::mesh::{
    model::Model,
    vrm::{AvatarExpression, Expressions, MorphTargetBind, PRESET_EXPRESSIONS},
};

/// Share of a recipe's weights that a model has to have.
const ENOUGH: f32 = 0.5;

/// Mix of shapes with names of ARKit that makes an expression of VRM.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpressionRecipe {
    /// Name among [`PRESET_EXPRESSIONS`].
    pub preset: String,
    /// Shapes with their weights.
    pub shapes: Vec<(String, f32)>,
}

/// Expressions of a model. A morph target with the name of a preset expression is that expression, whatever the case of its
/// letters. Other presets follow the recipes, if the model has at least half of a recipe by weight. Each other morph target is
/// an expression of its own.
pub fn expressions(model: &Model, recipes: &[ExpressionRecipe]) -> Expressions {
    let mut shapes: BTreeMap<String, Vec<(usize, usize)>> = BTreeMap::new();
    let mut own: BTreeMap<String, Vec<(usize, usize)>> = BTreeMap::new();
    for (at, object) in model.objects.iter().enumerate() {
        // An object that nothing draws is not in the file.
        if !model.parts.iter().any(|part| part.object == at && !part.triangles.is_empty()) {
            continue;
        }
        for (index, name) in object.morph_names.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
            shapes.entry(plain(name)).or_default().push((at, index));
            own.entry(name.clone()).or_default().push((at, index));
        }
    }
    let mut found = Expressions::default();
    for preset in PRESET_EXPRESSIONS {
        let recipe = recipes.iter().find(|recipe| recipe.preset == preset);
        let made = match (shapes.get(&plain(preset)), recipe) {
            (Some(places), _) => Some(made_of(places.iter().map(|place| (*place, 1.0)))),
            (None, Some(recipe)) => mixed(&shapes, recipe),
            (None, None) => None,
        };
        found.preset.extend(made.map(|expression| (preset.to_owned(), expression)));
    }
    let is_preset = |name: &str| PRESET_EXPRESSIONS.iter().any(|preset| plain(preset) == plain(name));
    let custom = own.into_iter().filter(|(name, _)| !is_preset(name));
    found.custom = custom.map(|(name, places)| (name, made_of(places.into_iter().map(|place| (place, 1.0))))).collect();
    found
}

/// Expression of a recipe; `None` if too many of its shapes are not there.
fn mixed(shapes: &BTreeMap<String, Vec<(usize, usize)>>, recipe: &ExpressionRecipe) -> Option<AvatarExpression> {
    let all: f32 = recipe.shapes.iter().map(|(_, weight)| weight).sum();
    let there = recipe.shapes.iter().filter_map(|(name, weight)| Some((shapes.get(&plain(name))?, *weight)));
    let there: Vec<_> = there.collect();
    let known: f32 = there.iter().map(|(_, weight)| weight).sum();
    let is_enough = known > 0.0 && known >= ENOUGH * all;
    let places = there.into_iter().flat_map(|(places, weight)| places.iter().map(move |place| (*place, weight)));
    is_enough.then(|| made_of(places))
}

/// Expression of morph targets, each an object's and a number, with weights, which add up.
fn made_of(weighted: impl IntoIterator<Item = ((usize, usize), f32)>) -> AvatarExpression {
    let mut weights: BTreeMap<(usize, usize), f32> = BTreeMap::new();
    for (place, weight) in weighted {
        *weights.entry(place).or_default() += weight;
    }
    let bind =
        |((node, index), weight): ((usize, usize), f32)| MorphTargetBind { node, index, weight: weight.min(1.0) };
    AvatarExpression { morph_target_binds: weights.into_iter().map(bind).collect(), ..AvatarExpression::default() }
}

/// A name without the signs and capitals in which programs differ: `eyeBlink_L` is `eyeBlinkLeft`.
pub(super) fn plain(name: &str) -> String {
    let sided = [("_L", "Left"), (".L", "Left"), ("_R", "Right"), (".R", "Right")];
    let ending = sided.iter().find_map(|(short, long)| Some((name.strip_suffix(short)?, *long)));
    let (stem, side) = ending.unwrap_or((name, ""));
    stem.chars().chain(side.chars()).filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}
