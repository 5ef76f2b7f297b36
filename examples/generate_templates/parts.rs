//! Parts: one a file, each with joints of its own and a function that puts its tags onto joints with those labels.

pub mod arm;
pub mod eye;
pub mod fk_chain;
pub mod hand;
pub mod ikfk_chain;
pub mod jaw;
pub mod leg;
pub mod leg_3joint;
pub mod neck_head;
pub mod single_control;
pub mod spine;
pub mod spring_chain;
pub mod tail;
pub mod wing;

use super::writer::Writer;

/// Every part with its name.
pub const ALL: &[(&str, fn() -> Writer)] = &[
    ("arm", arm::part),
    ("eye", eye::part),
    ("fk_chain", fk_chain::part),
    ("hand", hand::part),
    ("ikfk_chain", ikfk_chain::part),
    ("jaw", jaw::part),
    ("leg", leg::part),
    ("leg_3joint", leg_3joint::part),
    ("neck_head", neck_head::part),
    ("single_control", single_control::part),
    ("spine", spine::part),
    ("spring_chain", spring_chain::part),
    ("tail", tail::part),
    ("wing", wing::part),
];

/// What a part stands in: the node that carries its free controls, and spaces that they can change to.
pub struct Around {
    /// A reference to the node.
    pub root: String,
    /// Names of spaces and references to them; the first is what controls follow until somebody chooses another.
    pub spaces: Vec<(&'static str, String)>,
}

impl Around {
    /// What a part makes for itself on its first joint: a null that goes with the control that carries the rig, or
    /// stands still where there is none, and one that goes with the joint's parent.
    pub fn make(writer: &mut Writer, joint: &str, body: &'static str) -> Self {
        writer.command(joint, "world", "null", "(parent: \"@root\", orient: false, creation: (name: \"world\"))");
        writer.command(joint, "body", "null", format!("(creation: (name: \"{body}\"))"));
        let (world, body_node) = ("@command world".to_owned(), "@command body".to_owned());
        Self { root: world.clone(), spaces: vec![("world", world), (body, body_node)] }
    }

    /// The same with more spaces.
    pub fn with(&self, more: &[(&'static str, &str)]) -> Self {
        let more = more.iter().map(|(name, reference)| (*name, (*reference).to_owned()));
        Self { root: self.root.clone(), spaces: self.spaces.iter().cloned().chain(more).collect() }
    }

    /// Parameters of a `space_switch` for a control.
    pub fn switch(&self, control: &str, more: &str) -> String {
        let spaces = self.spaces.iter().map(|(_, node)| node.as_str()).collect::<Vec<_>>().join(" + ");
        let names = self.spaces.iter().map(|(name, _)| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
        format!("(control: \"{control}\", spaces: \"{spaces}\", names: [{names}]{more})")
    }
}

/// References to joints as one text.
pub fn joints(labels: &[&str]) -> String {
    labels.iter().map(|label| format!("@joint {label}")).collect::<Vec<_>>().join(" + ")
}
