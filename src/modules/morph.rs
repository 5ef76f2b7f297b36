//! `morph`: a morph target that follows an attribute.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::driven_key::check_keys;
use crate::{
    processor::{BuildScope, ModuleError, RigModule},
    rig::{
        AttributeKind, Constraint, KeyEase, Output,
        label::mirror_label,
        reference::{NodeRef, NodeRefs},
    },
};

/// Gives a control an attribute that is the weight of a morph target.
///
/// ```
/// # use rigsmith::{processor::RigModule, modules::morph::Morph};
/// let params = r#"(control: "@command control/jaw#00000000000000aa", morph: "smile", attribute: "smile")"#;
/// # rigsmith::modules::all().load(Morph::NAME, params).map(|_| ()).unwrap();
/// ```
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Morph {
    /// The control that carries the attribute.
    pub control: NodeRefs,
    /// The morph target.
    pub morph: String,
    /// The attribute.
    pub attribute: String,
    /// Pairs of attribute and weight.
    pub keys: Vec<(f32, f32)>,
    /// The run between keys.
    pub ease: KeyEase,
}

impl Default for Morph {
    fn default() -> Self {
        Self {
            control: NodeRef::this().into(),
            morph: String::new(),
            attribute: String::new(),
            keys: vec![(0.0, 0.0), (1.0, 1.0)],
            ease: KeyEase::Linear,
        }
    }
}

impl RigModule for Morph {
    const NAME: &'static str = "morph";
    const DOC: &'static str = "Drives the weight of a morph target from an attribute of a control.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[
        ("control", "The control that carries the attribute."),
        ("morph", "Name of the morph target; every mesh of the rig that has it is driven."),
        (
            "attribute",
            "Name of the attribute, added over the range of the keys if missing; the target's name if left out.",
        ),
        ("keys", "Pairs of attribute and weight, attribute increasing; flat before the first and after the last."),
        ("ease", "The run between keys: Step, Linear or Smooth, without overshoot."),
    ];
    const SIDED: &'static [&'static str] = &["morph", "attribute"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/morph.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/morph.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if self.morph.trim().is_empty() {
            return Err(ModuleError::parameter("morph", "is empty; write the name of a morph target of the mesh"));
        }
        let control = scope.resolve_one("control", &self.control)?;
        check_keys(&self.keys)?;
        let (min, max) = (self.keys.first().map(|key| key.0), self.keys.last().map(|key| key.0));
        let name = if self.attribute.is_empty() { &self.morph } else { &self.attribute };
        let driver = scope.ensure_attribute(control, name, AttributeKind::Number { min, max }, 0.0)?;
        let output = Output::Morph(self.morph.as_str().into());
        let constraint = Constraint::DrivenKey { driver, keys: self.keys.clone(), ease: self.ease, output };
        scope.constrain("morph", control, 0, constraint)?;
        Ok(())
    }

    fn mirror(&mut self) {
        [&mut self.morph, &mut self.attribute].into_iter().for_each(mirror_label);
    }
}
