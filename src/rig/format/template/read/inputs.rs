//! Declared inputs of a template.

use std::collections::HashSet;

use bevy::math::Quat;

use super::{super::file::InputFile, Places};
use crate::rig::{RestTransform, RigInput, SourceError, Uid};

/// The inputs of a file, without those at fault.
pub(super) fn inputs(
    places: &Places,
    list: Vec<InputFile>,
    seen: &mut HashSet<Uid>,
    faults: &mut Vec<SourceError>,
) -> Vec<RigInput> {
    let mut found: Vec<RigInput> = Vec::with_capacity(list.len());
    let mut names: HashSet<String> = HashSet::with_capacity(list.len());
    for InputFile { uid, name, translation, rotation: (x, y, z, w), scale } in list {
        if !seen.insert(uid) {
            faults.push(places.used_twice(uid));
            continue;
        }
        if name.is_empty() || names.contains(&name) {
            let message = format!("an input needs a name that no other has; \"{name}\" is none");
            faults.push(places.error(uid, 0, "name", message));
            continue;
        }
        let rest = RestTransform {
            translation: <[f32; 3]>::from(translation).into(),
            rotation: Quat::from_xyzw(x, y, z, w),
            scale: <[f32; 3]>::from(scale).into(),
        };
        if !rest.is_valid() {
            let wrong = match (rest.translation.is_finite(), rest.scale.is_finite()) {
                (false, _) => "translation",
                (true, false) => "scale",
                (true, true) => "rotation",
            };
            let message = format!(
                "input \"{name}\" has a transform that is not finite or whose rotation is not of length 1; correct the numbers"
            );
            faults.push(places.error(uid, 0, wrong, message));
            continue;
        }
        names.insert(name.clone());
        found.push(RigInput { uid, name, rest });
    }
    found
}
