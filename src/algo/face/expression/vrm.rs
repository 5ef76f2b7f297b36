//! Preset expressions of VRM 1.0 as mixes of the shapes of ARKit.

use super::{
    set::ExpressionSet,
    text::{Sides, UnitUse},
};

/// Expressions and visemes of the set that are presets of VRM.
const KNOWN: [(&str, &str); 9] = [
    ("happy", "happiness"),
    ("angry", "anger"),
    ("sad", "sadness"),
    ("surprised", "surprise"),
    ("aa", "viseme_aa"),
    ("ih", "viseme_ih"),
    ("ou", "viseme_ou"),
    ("ee", "viseme_e"),
    ("oh", "viseme_oh"),
];

/// Presets as units with their sides and strengths.
const UNITS: [(&str, &[(&str, Sides, f32)]); 8] = [
    ("relaxed", &[("mouth_smile", Sides::Both, 0.35), ("eye_blink", Sides::Both, 0.15)]),
    ("blink", &[("eye_blink", Sides::Both, 1.0)]),
    ("blinkLeft", &[("eye_blink", Sides::Left, 1.0)]),
    ("blinkRight", &[("eye_blink", Sides::Right, 1.0)]),
    ("lookUp", &[("eye_look_up", Sides::Both, 1.0)]),
    ("lookDown", &[("eye_look_down", Sides::Both, 1.0)]),
    ("lookLeft", &[("eye_look_out", Sides::Left, 1.0), ("eye_look_in", Sides::Right, 1.0)]),
    ("lookRight", &[("eye_look_in", Sides::Left, 1.0), ("eye_look_out", Sides::Right, 1.0)]),
];

/// Mixes for the presets of VRM: the name of each, and names of ARKit's shapes with their weights, 0 to 1. Units without a name
/// in ARKit are left out.
pub fn vrm_mixes(set: &ExpressionSet) -> Vec<(String, Vec<(String, f32)>)> {
    let unit = |(unit, side, strength): &(&str, Sides, f32)| UnitUse {
        unit: (*unit).to_owned(),
        side: *side,
        strength: *strength,
    };
    let known = KNOWN.iter().filter_map(|(preset, name)| Some((*preset, set.get(name)?.units.clone())));
    let made = UNITS.iter().map(|(preset, units)| (*preset, units.iter().map(unit).collect::<Vec<_>>()));
    let mix = |(preset, units): (&str, Vec<UnitUse>)| {
        (preset.to_owned(), units.iter().flat_map(|used| shapes(set, used)).collect())
    };
    known.chain(made).map(mix).collect()
}

/// Shapes of ARKit that a unit is, on the sides on which it is used.
fn shapes(set: &ExpressionSet, used: &UnitUse) -> Vec<(String, f32)> {
    let units = set.unit_set();
    let Some(index) = units.index(&used.unit) else { return Vec::new() };
    let is_used = |side: Sides| side == Sides::Both || used.side == Sides::Both || side == used.side;
    let own = units.arkit_shapes().filter(|(_, unit, side)| *unit == index && is_used(*side));
    own.map(|(name, ..)| (name.to_owned(), used.strength.min(1.0))).collect()
}
