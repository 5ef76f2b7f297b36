//! Rest skeletons: where the joints lie that shaped a model.

use std::fmt::Write;

use glam::{DVec3, dvec3};

/// Joints in the order they were added, parents first.
#[derive(Debug, Clone, Default)]
pub struct Rig {
    /// Parent (or -1), place in metres, and label of each joint.
    pub joints: Vec<(i64, DVec3, String)>,
}

impl Rig {
    /// Adds a joint and returns its index; `parent` is -1 for a root.
    pub fn add(&mut self, parent: i64, at: DVec3, label: impl Into<String>) -> usize {
        self.joints.push((parent, at, label.into()));
        self.joints.len() - 1
    }

    /// Appends the mirror image of every joint whose label ends in `_l`, as `_r`.
    pub fn mirror(&mut self) {
        let count = self.joints.len();
        let mut twin: Vec<i64> = (0..count as i64).collect();
        for i in 0..count {
            let (parent, at, label) = self.joints[i].clone();
            if let Some(stem) = label.strip_suffix("_l") {
                let parent = if parent < 0 { -1 } else { twin[parent as usize] };
                twin[i] = self.add(parent, dvec3(-at.x, at.y, at.z), format!("{stem}_r")) as i64;
            }
        }
    }

    /// Text of a `.rig` file.
    pub fn text(&self, about: &str) -> String {
        let mut text = String::from("rig 1\n");
        for line in about.lines() {
            let _ = writeln!(text, "# {line}");
        }
        for (i, (parent, p, label)) in self.joints.iter().enumerate() {
            let _ = writeln!(
                text,
                "joint {i} {parent} {} {} {} {label}",
                decimals(p.x, 5),
                decimals(p.y, 5),
                decimals(p.z, 5)
            );
        }
        text
    }
}

/// A number with a few decimals, zero without a sign.
pub fn decimals(x: f64, places: usize) -> String {
    let text = format!("{x:.places$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
        _ => text,
    }
}
