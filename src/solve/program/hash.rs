//! Hash of the content that a program is compiled from, the same on every machine.

use std::{
    fmt::{self, Write},
    sync::Arc,
};

use super::{CompileOptions, Keep};
use crate::{
    mesh::model::Trs,
    rig::{AttributeKind, BuiltRig, Channels, Constraint, Limits},
};

/// 128 bits that stand for the content of a built rig and the options of its program: equal for equal content. Not
/// meant to withstand an attacker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ContentHash(pub u128);

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl ContentHash {
    /// The hash of a built rig and its options.
    ///
    /// Data that the program does not depend on (shapes and colours of controls, layers, groups, origins, names) does
    /// not count.
    pub fn of(rig: &BuiltRig, options: &CompileOptions) -> Self {
        Self::with(rig, options, |constraint| of_constraint(constraint))
    }

    /// Hash of a rig, with hashes of constraints that may be known: `of` gives what [`of_constraint`] does.
    pub(super) fn with(rig: &BuiltRig, options: &CompileOptions, mut of: impl FnMut(&Arc<Constraint>) -> u128) -> Self {
        let mut hasher = Hasher::default();
        hasher.word(rig.nodes.len() as u64);
        for node in &rig.nodes {
            hasher.word(node.uid.0);
            hasher.word(node.kind as u64);
            hasher.word(node.parent.map_or(0, |parent| parent as u64 + 1));
            hasher.trs(&node.base);
            hasher.text(node.label.as_deref().unwrap_or_default());
            if let Some(control) = &node.control
                && (control.channels != Channels::default() || control.limits != Limits::default())
            {
                hasher.ranges(&control.channels, &control.limits);
            }
            hasher.word(node.attributes.len() as u64);
            for attribute in node.attributes.iter() {
                hasher.text(&attribute.name);
                hasher.word(u64::from(attribute.default.to_bits()));
                match &attribute.kind {
                    AttributeKind::Number { min, max } => {
                        hasher.end(*min);
                        hasher.end(*max);
                    }
                    AttributeKind::Choice(names) => {
                        hasher.word(2 << 32);
                        hasher.word(names.len() as u64);
                        names.iter().for_each(|name| hasher.text(name));
                    }
                }
            }
        }
        hasher.word(rig.constraints.len() as u64);
        for constraint in &rig.constraints {
            hasher.word(constraint.uid.0);
            let hash = of(&constraint.constraint);
            hasher.word(hash as u64);
            hasher.word((hash >> 64) as u64);
        }
        match &options.keep {
            Keep::All => hasher.word(0),
            Keep::DeformAndExposed(list) => {
                hasher.word(list.len() as u64 + 1);
                list.iter().for_each(|exposed| hasher.debug(exposed));
            }
        }
        let inputs = super::inputs::outside(rig, options);
        hasher.word(inputs.len() as u64);
        for input in &inputs {
            hasher.word(input.uid.0);
            hasher.trs(&input.rest);
        }
        rig.inputs.iter().for_each(|input| hasher.text(&input.name));
        hasher.finish()
    }
}

/// The hash of one constraint.
pub(super) fn of_constraint(constraint: &Constraint) -> u128 {
    let mut hasher = Hasher::default();
    // The text of a constraint holds all of its fields, also fields added later, and is exact.
    hasher.debug(constraint);
    hasher.finish().0
}

/// Two lanes of multiply and fold.
struct Hasher {
    low: u64,
    high: u64,
}

impl Default for Hasher {
    fn default() -> Self {
        Self { low: 0x9E37_79B9_7F4A_7C15, high: 0xD1B5_4A32_D192_ED03 }
    }
}

impl Hasher {
    fn word(&mut self, word: u64) {
        let fold = |a: u64, b: u64| {
            let product = u128::from(a) * u128::from(b);
            (product as u64) ^ ((product >> 64) as u64)
        };
        self.low = fold(self.low ^ word, 0xA076_1D64_78BD_642F).wrapping_add(0x2545_F491_4F6C_DD1D);
        self.high = fold(self.high ^ word.rotate_left(32), 0xE703_7ED1_A0B4_28DB) ^ self.low.rotate_left(17);
    }

    fn trs(&mut self, trs: &Trs) {
        let numbers = trs.translation.to_array().into_iter().chain(trs.rotation.to_array());
        numbers.chain(trs.scale.to_array()).for_each(|number| self.word(u64::from(number.to_bits())));
    }

    /// Free channels and their ranges, word by word: most controls have some, and their text would take longer than all
    /// the rest of a node.
    fn ranges(&mut self, channels: &Channels, limits: &Limits) {
        let Channels { translate, rotate, scale } = channels;
        let free = [translate, rotate, scale].into_iter().flatten();
        self.word(free.fold(1, |bits, is_free| bits << 1 | u64::from(*is_free)));
        let Limits { translate, rotate, scale } = limits;
        for (low, high) in [translate, rotate, scale].into_iter().flatten() {
            self.end(*low);
            self.end(*high);
        }
    }

    /// End of a range; no bits of a number stand for an open one.
    fn end(&mut self, end: Option<f32>) {
        self.word(end.map_or(1 << 32, |end| u64::from(end.to_bits())));
    }

    fn text(&mut self, text: &str) {
        self.word(text.len() as u64);
        for chunk in text.as_bytes().chunks(8) {
            let mut bytes = [0; 8];
            bytes[..chunk.len()].copy_from_slice(chunk);
            self.word(u64::from_le_bytes(bytes));
        }
    }

    fn debug(&mut self, value: &dyn fmt::Debug) {
        // Writing to a hasher cannot fail.
        let _ = write!(self, "{value:?}");
        self.word(u64::MAX);
    }

    fn finish(mut self) -> ContentHash {
        self.word(0x5851_F42D_4C95_7F2D);
        self.word(0x1405_7B7E_F767_814F);
        ContentHash(u128::from(self.high) << 64 | u128::from(self.low))
    }
}

impl Write for Hasher {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.text(text);
        Ok(())
    }
}
