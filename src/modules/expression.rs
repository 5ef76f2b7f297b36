//! `expression`: numbers that are calculated from others.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::{
    processor::{BuildScope, ModuleError, RigModule},
    rig::{Channel, Constraint, reference::NodeRefs},
    solve::expression::Expression as Compiled,
};

/// Drives a number by arithmetic over others; see [`expression`](crate::solve::expression) for the language.
///
/// ```
/// # use rigsmith::{processor::RigModule, modules::expression::Expression};
/// let params = r#"(
///     text: "clamp(curl * 90, 0, 90) + 0.5 * spread",
///     inputs: [
///         (name: "curl", node: "@command control/hand_l#00000000000000aa", attribute: "curl"),
///         (name: "spread", node: "@command control/hand_l#00000000000000aa", channel: RotateZ),
///     ],
///     output: "@joint index_1_l#0000000000000004",
///     output_channel: RotateX,
/// )"#;
/// # rigsmith::modules::all().load(Expression::NAME, params).map(|_| ()).unwrap();
/// ```
#[derive(Reflect, Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Expression {
    /// The arithmetic.
    pub text: String,
    /// What its names stand for.
    pub inputs: Vec<Input>,
    /// The nodes that are driven.
    pub output: NodeRefs,
    /// The attribute that is driven,
    pub output_attribute: String,
    /// or the channel,
    pub output_channel: Option<Channel>,
    /// or the morph target.
    pub morph: String,
}

/// A name in an expression, and the attribute or channel that it stands for.
#[derive(Reflect, Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Input {
    /// The name.
    pub name: String,
    /// The node whose number it is.
    pub node: NodeRefs,
    /// The attribute,
    pub attribute: String,
    /// or the channel of its pose.
    pub channel: Option<Channel>,
}

impl RigModule for Expression {
    const NAME: &'static str = "expression";
    const DOC: &'static str = "Drives channels, attributes or a morph target by arithmetic over other numbers.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[
        (
            "text",
            "Arithmetic over the names of the inputs, with functions such as clamp, min, sin and if; angles in degrees.",
        ),
        ("inputs", "Names, each with a node and its attribute or the channel of its pose."),
        ("output", "The nodes that are driven; none for a morph target."),
        ("output_attribute", "Name of the attribute of theirs that is driven."),
        ("output_channel", "Or the channel that is driven, on top of how they were built."),
        ("morph", "Or the name of the morph target whose weight is driven, on every mesh of the rig."),
    ];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/expression.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/expression.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let names: Vec<&str> = self.inputs.iter().map(|input| input.name.as_str()).collect();
        for (at, name) in names.iter().enumerate() {
            let starts = name.starts_with(|c: char| c.is_alphabetic() || c == '_');
            if !starts || !name.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '.') {
                return Err(ModuleError::parameter(
                    "inputs",
                    format!("\"{name}\" is no name; use letters, digits, _ and ., and begin with a letter"),
                ));
            }
            if names[..at].contains(name) {
                return Err(ModuleError::parameter(
                    "inputs",
                    format!("there are two of the name \"{name}\"; rename one of them"),
                ));
            }
        }
        Compiled::new(&self.text, &names).map_err(|error| ModuleError::parameter("text", error.to_string()))?;
        let mut inputs = Vec::with_capacity(self.inputs.len());
        for input in &self.inputs {
            let parameter = format!("inputs, {}", input.name);
            let scalar = scope.read_number(&parameter, &input.node, &input.attribute, input.channel)?;
            inputs.push((input.name.clone(), scalar));
        }
        let outputs =
            scope.driven_numbers("output", &self.output, &self.output_attribute, self.output_channel, &self.morph)?;
        let joint = scope.joint();
        for (output, number) in outputs.into_iter().zip(0..) {
            let (text, inputs) = (self.text.clone(), inputs.clone());
            scope.constrain("expression", joint, number, Constraint::Expression { text, inputs, output })?;
        }
        Ok(())
    }

    /// What is driven is turned over where the other side needs it; channels that are read are left to the text.
    fn mirror(&mut self) {
        if self.output_channel.is_some_and(Channel::is_turned_over) {
            self.text = format!("-({})", self.text);
        }
    }
}
