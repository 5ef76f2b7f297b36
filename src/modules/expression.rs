//! `expression`: numbers that are calculated from others.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::{
    parameters,
    processor::{BuildScope, ModuleError, RigModule},
    rig::{Channel, Constraint, label::mirror_label, reference::NodeRefs},
    solve::expression::Expression as CompiledExpression,
};

parameters! {
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
    pub struct Expression {
        /// Arithmetic over the names of the inputs, with functions such as clamp, min, sin and if; angles in degrees.
        pub text: String = String::new(),
        /// Names, each with a node and its attribute or the channel of its pose.
        pub inputs: Vec<Input> = Vec::new(),
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

/// A name in an expression, and the attribute or channel that it stands for.
#[derive(Reflect, Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Input {
    /// The name.
    pub name: String,
    /// The node whose number it is.
    pub node: NodeRefs,
    /// Name of the attribute of the node.
    pub attribute: String,
    /// Channel of the node's pose, in place of an attribute.
    pub channel: Option<Channel>,
}

impl RigModule for Expression {
    const NAME: &'static str = "expression";
    const DOC: &'static str = "Drives channels, attributes or a morph target by arithmetic over other numbers.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["text", "inputs", "output_attribute", "morph"];
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
        CompiledExpression::new(&self.text, &names)
            .map_err(|error| ModuleError::parameter("text", error.to_string()))?;
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

    fn mirror(&mut self) {
        for input in self.inputs.iter().filter(|input| input.channel.is_some_and(Channel::is_turned_over)) {
            self.text = opposite_input(&self.text, &input.name);
        }
        if self.output_channel.is_some_and(Channel::is_turned_over) {
            self.text = opposite_text(&self.text);
        }
        mirror_label(&mut self.morph);
    }
}

/// The text with the opposite value: `-(text)`, or what is within if it is that already.
fn opposite_text(text: &str) -> String {
    let inner = text.strip_prefix("-(").and_then(|rest| rest.strip_suffix(')'));
    let is_whole = |inner: &&str| {
        let mut depth = 0_i32;
        inner.chars().all(|c| {
            depth += i32::from(c == '(') - i32::from(c == ')');
            depth >= 0
        })
    };
    inner.filter(is_whole).map_or_else(|| format!("-({text})"), str::to_owned)
}

/// The text with `(-name)` in the place of an input, or the input in the place of that.
fn opposite_input(text: &str, name: &str) -> String {
    let turned = format!("(-{name})");
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix(turned.as_str()) {
            out.push_str(name);
            rest = after;
            continue;
        }
        let word = rest.len() - rest.trim_start_matches(is_part).len();
        let length = if word > 0 { word } else { rest.chars().next().map_or(0, char::len_utf8) };
        let (piece, after) = rest.split_at(length);
        out.push_str(if piece == name { &turned } else { piece });
        rest = after;
    }
    out
}
