//! Changes that an update makes.

use std::fmt;

use serde::Serialize;

use crate::rig::Uid;

/// Kind of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// New thing.
    Added,
    /// Thing that is gone.
    Removed,
    /// A field has another value.
    Changed,
    /// Thing with another name that is the same otherwise.
    Renamed,
    /// Tag that is on another joint.
    Moved,
}

/// One change of an update.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Change {
    /// Kind of the change.
    pub kind: ChangeKind,
    /// Uid of the joint, tag, group, pose or part instance; of the rig for its header.
    pub uid: Uid,
    /// Label of the joint, or of the joint of the tag; its uid without one. `None` for groups, poses and the header.
    pub joint: Option<String>,
    /// Module or kind of feature, and the name that the tag gives after a `/`; `None` if no tag is concerned.
    pub tag: Option<String>,
    /// Name of the field; of a parameter as `params.NAME`; `group NAME`, `input NAME` or `pose NAME` for those, and
    /// `part NAME FIELD` for a field of a part instance.
    pub field: Option<String>,
    /// Value before, as it is written in files.
    pub from: Option<String>,
    /// Value after.
    pub to: Option<String>,
    /// True where both sides changed the field; `from` is the value now and `to` that of the file.
    pub conflict: bool,
}

impl fmt::Display for Change {
    /// The change in a line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [self.joint.as_deref(), self.tag.as_deref(), self.field.as_deref()];
        let what = parts.into_iter().flatten().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
        let [from, to] = [&self.from, &self.to].map(|value| value.as_deref().unwrap_or("nothing"));
        match (self.kind, self.conflict) {
            (ChangeKind::Added, false) => write!(f, "added    {what}"),
            (ChangeKind::Added, true) => write!(f, "conflict {what}: deleted here, changed there"),
            (ChangeKind::Removed, false) => write!(f, "removed  {what}"),
            (ChangeKind::Removed, true) => write!(f, "conflict {what}: changed here, deleted there"),
            (ChangeKind::Changed, false) => write!(f, "changed  {what}: {from} to {to}"),
            (ChangeKind::Changed, true) => write!(f, "conflict {what}: {from} here, {to} there"),
            (ChangeKind::Moved, is_conflict) => {
                // The joint that it is told of is one of the two.
                let tag = self.tag.as_deref().unwrap_or_default();
                match is_conflict {
                    false => write!(f, "moved    {tag}: from {from} to {to}"),
                    true => write!(f, "conflict {tag}: on {from} here, on {to} there"),
                }
            }
            (ChangeKind::Renamed, _) => {
                // A joint or tag is told by its name, a group or an input by what it is, too.
                let kind = self.field.as_deref().and_then(|field| field.split_once(' ')).map(|(kind, _)| kind);
                let space = if kind.is_some() { " " } else { "" };
                write!(f, "renamed  {}{space}{from} to {to}?", kind.unwrap_or_default())
            }
        }
    }
}
