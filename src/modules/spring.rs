//! `spring`: nodes that lag behind, swing and settle.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::{
    processor::{Amount, BuildScope, ModuleError, RigModule},
    rig::{
        Constraint,
        reference::{NodeRef, NodeRefs},
    },
};

/// Lets nodes lag behind what moves them, swing and settle: hair, tails, ears, antennas.
///
/// ```
/// # use rigsmith::{processor::RigModule, modules::spring::Spring};
/// let params = r#"(nodes: "@hierarchy this", frequency: 3.0, damping: 0.3)"#;
/// # rigsmith::modules::all().load(Spring::NAME, params).map(|_| ()).unwrap();
/// ```
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Spring {
    /// The nodes.
    pub nodes: NodeRefs,
    /// Swings a second.
    pub frequency: Amount,
    /// How soon it settles.
    pub damping: Amount,
    /// Share of the lag.
    pub weight: Amount,
    /// The position lags.
    pub translate: bool,
    /// The direction of the bone lags.
    pub rotate: bool,
    /// The control whose attributes the numbers may name.
    pub control: NodeRefs,
}

impl Default for Spring {
    fn default() -> Self {
        Self {
            nodes: NodeRef::this().into(),
            frequency: Amount::Value(2.0),
            damping: Amount::Value(0.4),
            weight: Amount::Value(1.0),
            translate: false,
            rotate: true,
            control: NodeRefs::NONE,
        }
    }
}

impl RigModule for Spring {
    const NAME: &'static str = "spring";
    const DOC: &'static str = "Lets nodes lag behind what moves them, swing and settle: hair, tails, ears, antennas.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[
        ("nodes", "The nodes, each of which swings for itself."),
        ("frequency", "Swings a second, above 0 to 60; a number or an attribute's name."),
        ("damping", "0 swings for ever, 1 settles without swinging, up to 10; a number or an attribute's name."),
        ("weight", "0 leaves the nodes as they are, 1 swings; a number or an attribute's name."),
        ("translate", "The position lags."),
        ("rotate", "The direction lags in which the node's children lie."),
        ("control", "The control whose attributes the numbers may name; the first of the nodes if left out."),
    ];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/spring.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/spring.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let nodes = scope.resolve_some("nodes", &self.nodes)?;
        if !(self.translate || self.rotate) {
            return Err(ModuleError::parameter("rotate", "nothing lags; turn on rotate or translate"));
        }
        let control = scope.resolve_maybe("control", &self.control)?.or(nodes.first().copied());
        let frequency = scope.amount("frequency", &self.frequency, control, 1e-2..=60.0, 2.0)?;
        let damping = scope.amount("damping", &self.damping, control, 0.0..=10.0, 0.4)?;
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        for node in nodes {
            let constraint = Constraint::Spring {
                driven: scope.uid(node),
                frequency: frequency.clone(),
                damping: damping.clone(),
                weight: weight.clone(),
                translate: self.translate,
                rotate: self.rotate,
            };
            scope.constrain("spring", node, 0, constraint)?;
        }
        Ok(())
    }
}
