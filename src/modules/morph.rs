//! `morph`: a morph target that follows an attribute.

use super::driven_key::check_keys;
use crate::{
    parameters,
    processor::{BuildScope, ModuleError, RigModule},
    rig::{
        AttributeKind, Constraint, KeyEase, Output,
        label::mirror_label,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Gives a control an attribute that is the weight of a morph target.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::morph::Morph};
    /// let params = r#"(control: "@command control/jaw#00000000000000aa", morph: "smile", attribute: "smile")"#;
    /// # rigsmith::modules::all().load(Morph::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Morph {
        /// The control that carries the attribute.
        pub control: NodeRefs = NodeRef::this().into(),
        /// Name of the morph target; every mesh of the rig that has it is driven.
        pub morph: String = String::new(),
        /// Name of the attribute, added over the range of the keys if missing; the target's name if left out.
        pub attribute: String = String::new(),
        /// Pairs of attribute and weight, attribute increasing; flat before the first and after the last.
        pub keys: Vec<(f32, f32)> = vec![(0.0, 0.0), (1.0, 1.0)],
        /// The run between keys: Step, Linear or Smooth, without overshoot.
        pub ease: KeyEase = KeyEase::Linear,
    }
}

impl RigModule for Morph {
    const NAME: &'static str = "morph";
    const DOC: &'static str = "Drives the weight of a morph target from an attribute of a control.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
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
        mirror_label(&mut self.morph);
    }
}
