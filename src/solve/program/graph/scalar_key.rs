//! Scalars of attributes and channels as keys: equal ones share a register.

use std::{
    mem::{Discriminant, discriminant},
    sync::Arc,
};

use crate::rig::{Channel, Scalar};

/// A scalar bit by bit: kind, node, attribute or channel, and numbers.
pub(super) type ScalarKey = (Discriminant<Scalar>, usize, Option<Arc<str>>, Option<Channel>, [u32; 2]);

/// The key of a scalar at the node with an index.
pub(super) fn scalar_key(node: usize, scalar: &Scalar) -> ScalarKey {
    let (name, channel, numbers) = match scalar {
        Scalar::Value(value) => (None, None, [value.to_bits(), 0]),
        Scalar::Attribute { name, factor, add, .. } => (Some(name), None, [factor.to_bits(), add.to_bits()]),
        Scalar::Choice { name, value, .. } => (Some(name), None, [value.to_bits(), 0]),
        Scalar::Channel { channel, .. } => (None, Some(*channel), [0; 2]),
    };
    (discriminant(scalar), node, name.cloned(), channel, numbers)
}
