//! Writer of `.rig` text.

use std::fmt::{self, Write as _};

use super::{
    RigText, RigTextError, VERSION,
    error::{chain, quoted},
    find_cycle,
};

/// A written skeleton.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RigTextOutput {
    /// The content of the file.
    pub text: String,
    /// Labels that the format cannot hold, and the labels written instead.
    pub relabelled: Vec<LabelChange>,
}

/// A label that was written differently.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelChange {
    /// The joint, by its position in [`RigText::joints`].
    pub joint: usize,
    /// Label of the joint.
    pub from: String,
    /// The label as written; empty if the joint was written without one.
    pub to: String,
}

impl fmt::Display for LabelChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { joint, from, to } = self;
        match to.as_str() {
            "" => write!(f, "joint {joint} was written without a label: its own is empty"),
            _ => write!(f, "joint {joint} was labelled `{to}`: the format has no room for `{}`", quoted(from)),
        }
    }
}

/// Writes a skeleton as `.rig` text; [`parse`](super::parse) reads it back as the same skeleton, with identical bits in
/// its positions.
///
/// White space and control characters in labels, and a `#` at the start, become `_`; empty labels are left out. Both
/// are reported. Time is linear.
///
/// # Errors
/// [`RigTextError::WriteParent`], [`RigTextError::WriteCycle`] and [`RigTextError::WriteNotFinite`], for skeletons that
/// could not be read back.
pub fn write(rig: &RigText) -> Result<RigTextOutput, RigTextError> {
    for (i, joint) in rig.joints.iter().enumerate() {
        if let Some(parent) = joint.parent.filter(|&parent| parent >= rig.joints.len()) {
            return Err(RigTextError::WriteParent { joint: i, parent });
        }
        if !joint.position.is_finite() {
            return Err(RigTextError::WriteNotFinite { joint: i });
        }
    }
    let parents: Vec<Option<usize>> = rig.joints.iter().map(|joint| joint.parent).collect();
    if let Some(cycle) = find_cycle(&parents) {
        return Err(RigTextError::WriteCycle { joints: chain(&cycle) });
    }
    let mut text = format!("rig {VERSION}\n");
    let mut relabelled = Vec::new();
    for (i, joint) in rig.joints.iter().enumerate() {
        // Writing to a `String` does not fail.
        let _ = match joint.parent {
            Some(parent) => write!(text, "joint {i} {parent}"),
            None => write!(text, "joint {i} -1"),
        };
        for value in joint.position.to_array() {
            let magnitude = value.abs();
            let _ = if value == 0.0 || (1e-5..1e9).contains(&magnitude) {
                write!(text, " {value}")
            } else {
                write!(text, " {value:e}")
            };
        }
        if let Some(label) = &joint.label {
            let safe = writable(label);
            if !safe.is_empty() {
                text.push(' ');
                text.push_str(&safe);
            }
            if safe != *label || label.is_empty() {
                relabelled.push(LabelChange { joint: i, from: label.clone(), to: safe });
            }
        }
        text.push('\n');
    }
    Ok(RigTextOutput { text, relabelled })
}

fn writable(label: &str) -> String {
    label
        .chars()
        .enumerate()
        .map(|(i, c)| if c.is_whitespace() || c.is_control() || (i == 0 && c == '#') { '_' } else { c })
        .collect()
}
