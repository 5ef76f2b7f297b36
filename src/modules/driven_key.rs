//! `driven_key`: numbers that follow another one along keys.

use crate::{
    parameters,
    processor::{BuildScope, ModuleError, RigModule, opposite},
    rig::{
        Channel, Constraint, KeyEase,
        label::mirror_label,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Drives a number by another one along keys: fingers by a curl, a corrective shape by an elbow.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::driven_key::DrivenKey};
    /// let params = r#"(
    ///     driver: "@command control/hand_l#00000000000000aa",
    ///     driver_attribute: "curl",
    ///     keys: [(0.0, 0.0), (1.0, 80.0)],
    ///     output: "@hierarchy index_1_l#0000000000000004",
    ///     output_channel: RotateX,
    /// )"#;
    /// # rigsmith::modules::all().load(DrivenKey::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct DrivenKey {
        /// The node whose attribute or channel drives.
        pub driver: NodeRefs = NodeRef::this().into(),
        /// Name of the attribute of the driver that drives.
        pub driver_attribute: String = String::new(),
        /// Channel of the driver's pose that drives, in place of an attribute, such as RotateX in degrees.
        pub driver_channel: Option<Channel> = None,
        /// Pairs of driver and value, driver increasing; flat before the first and after the last.
        pub keys: Vec<(f32, f32)> = vec![(0.0, 0.0), (1.0, 1.0)],
        /// The run between keys: Step, Linear or Smooth, without overshoot.
        pub ease: KeyEase = KeyEase::Smooth,
        /// The nodes that are driven; none for a morph target.
        pub output: NodeRefs = NodeRefs::NONE,
        /// Name of the attribute of the nodes that is driven.
        pub output_attribute: String = String::new(),
        /// Channel of the nodes that is driven, in place of an attribute; added to the value that they were built with.
        pub output_channel: Option<Channel> = None,
        /// Name of the morph target whose weight is driven on every mesh of the rig, in place of nodes.
        pub morph: String = String::new(),
    }
}

impl RigModule for DrivenKey {
    const NAME: &'static str = "driven_key";
    const DOC: &'static str = "Drives channels, attributes or a morph target by another number, along keys.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["driver_attribute", "keys", "output_attribute", "morph"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/driven_key.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/driven_key.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let driver = scope.read_number("driver", &self.driver, &self.driver_attribute, self.driver_channel)?;
        check_keys(&self.keys)?;
        let outputs =
            scope.driven_numbers("output", &self.output, &self.output_attribute, self.output_channel, &self.morph)?;
        let joint = scope.joint();
        for (output, number) in outputs.into_iter().zip(0..) {
            let (driver, keys) = (driver.clone(), self.keys.clone());
            let constraint = Constraint::DrivenKey { driver, keys, ease: self.ease, output };
            scope.constrain("key", joint, number, constraint)?;
        }
        Ok(())
    }

    fn mirror(&mut self) {
        if self.output_channel.is_some_and(Channel::is_turned_over) {
            self.keys.iter_mut().for_each(|(_, value)| *value = opposite(*value));
        }
        if self.driver_channel.is_some_and(Channel::is_turned_over) {
            self.keys.iter_mut().for_each(|(driver, _)| *driver = opposite(*driver));
            self.keys.reverse();
        }
        mirror_label(&mut self.morph);
    }
}

/// Refuses keys that are no curve.
pub(super) fn check_keys(keys: &[(f32, f32)]) -> Result<(), ModuleError> {
    if keys.is_empty() {
        return Err(ModuleError::parameter("keys", "there is none; write pairs such as [(0.0, 0.0), (1.0, 90.0)]"));
    }
    if !keys.iter().all(|(driver, value)| driver.is_finite() && value.is_finite()) {
        return Err(ModuleError::parameter("keys", "one is not a finite number; correct it"));
    }
    if let Some(pair) = keys.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
        let (first, second) = (pair[0].0, pair[1].0);
        return Err(ModuleError::parameter(
            "keys",
            format!("the key at {second} stands after that at {first}; sort them by driver, each once"),
        ));
    }
    Ok(())
}
