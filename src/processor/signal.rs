//! Numbers that commands read and drive: attributes, channels of poses, morph targets.

use super::{BuildScope, ModuleError};
use crate::rig::{Channel, Output, Scalar, reference::NodeRefs};

impl BuildScope<'_> {
    /// A number of the one node that `references` finds: the value of an attribute, or a channel of what people and
    /// animation do to it. `parameter` is the name of the references' parameter, on whose name those of the other two
    /// build.
    ///
    /// # Errors
    /// Neither or both of attribute and channel; no such node or attribute, with the nearest names.
    pub fn read_number(
        &mut self,
        parameter: &str,
        references: &NodeRefs,
        attribute: &str,
        channel: Option<Channel>,
    ) -> Result<Scalar, ModuleError> {
        let node = self.resolve_one(parameter, references)?;
        match (attribute.is_empty(), channel) {
            (false, None) => self.attribute(node, attribute),
            (true, Some(channel)) => Ok(Scalar::Channel { node: self.uid(node), channel }),
            (true, None) => Err(ModuleError::parameter(
                parameter,
                "say which number is meant: the name of an attribute, or a channel such as RotateX",
            )),
            (false, Some(_)) => {
                Err(ModuleError::parameter(parameter, "has an attribute and a channel; leave one of the two out"))
            }
        }
    }

    /// Numbers that a command drives: an attribute or a channel of each node that `references` finds, or a morph target.
    ///
    /// # Errors
    /// None or several of them; no such node or attribute, with the nearest names.
    pub fn driven_numbers(
        &mut self,
        parameter: &str,
        references: &NodeRefs,
        attribute: &str,
        channel: Option<Channel>,
        morph: &str,
    ) -> Result<Vec<Output>, ModuleError> {
        if !morph.is_empty() {
            if !attribute.is_empty() || channel.is_some() || !references.is_empty() {
                return Err(ModuleError::parameter(
                    "morph",
                    format!("\"{morph}\" is driven on every mesh of the rig; leave {parameter} out, or the morph"),
                ));
            }
            return Ok(vec![Output::Morph(morph.into())]);
        }
        let nodes = self.resolve_some(parameter, references)?;
        let mut outputs = Vec::with_capacity(nodes.len());
        for node in nodes {
            let uid = self.uid(node);
            outputs.push(match (attribute.is_empty(), channel) {
                (false, None) => {
                    self.attribute(node, attribute)?;
                    Output::Attribute(uid, attribute.into())
                }
                (true, Some(channel)) => Output::Channel(uid, channel),
                (true, None) => {
                    return Err(ModuleError::parameter(
                        parameter,
                        "say what is driven: the name of an attribute, a channel such as RotateX, or a morph target",
                    ));
                }
                (false, Some(_)) => {
                    return Err(ModuleError::parameter(
                        parameter,
                        "has an attribute and a channel; leave one of the two out",
                    ));
                }
            });
        }
        Ok(outputs)
    }
}
