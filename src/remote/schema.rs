//! The methods of remote control, and their description in the form of OpenRPC.

use std::net::SocketAddr;

use serde_json::{Value, json};

/// Name of the method that describes all others.
pub(super) const DISCOVER: &str = "rpc.discover";

/// Methods that the main world carries out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verb {
    List,
    Describe,
    Edit,
    Build,
    Step,
    Load,
    Save,
    Update,
}

impl Verb {
    pub fn name(self) -> &'static str {
        match self {
            Self::List => "rig.list",
            Self::Describe => "rig.describe",
            Self::Edit => "rig.edit",
            Self::Build => "rig.build",
            Self::Step => "rig.step",
            Self::Load => "rig.template.load",
            Self::Save => "rig.template.save",
            Self::Update => "rig.template.update",
        }
    }

    fn summary(self) -> &'static str {
        match self {
            Self::List => "Lists the rigs of the app.",
            Self::Describe => "Describes a rig: joints with their tags, commands with their states, built nodes.",
            Self::Edit => {
                "Changes a rig by edits, all of them or none, as one step of its history; or undoes or redoes a step."
            }
            Self::Build => "Runs all commands of a rig.",
            Self::Step => "Runs or rolls back commands of a rig.",
            Self::Load => "Opens a template as a rig with a document of its own, built.",
            Self::Save => "Saves a rig as a template: over the text of the file, so that only what differs is written.",
            Self::Update => "Brings a rig to its template's file: what was changed in the rig stays.",
        }
    }

    /// Parameters: name, schema, and whether it has to be given.
    fn params(self) -> Vec<(&'static str, Value, bool)> {
        let rig = || {
            let text = "number that rig.list gives, or uid or name if only one rig has it";
            ("rig", json!({"type": ["integer", "string"], "description": text}), true)
        };
        let yes_no = |text: &str| json!({"type": "boolean", "default": false, "description": text});
        let path = |text: &str| json!({"type": "string", "description": text});
        match self {
            Self::List => Vec::new(),
            Self::Describe => vec![rig(), ("text", yes_no("adds the text of the rig as a template"), false)],
            Self::Edit => {
                let edits = json!({
                    "type": "array",
                    "items": {"type": "object", "minProperties": 1, "maxProperties": 1},
                    "description": "edits as the journal has them, by the names of RigEdit",
                    "examples": [[{"SetLabel": ["00c0ffee00c0ffee", "hips"]}]],
                });
                let history =
                    json!({"enum": ["undo", "redo"], "description": "instead of edits: a step of the history"});
                vec![rig(), ("edits", edits, false), ("history", history, false)]
            }
            Self::Build => vec![rig(), ("restart", yes_no("discards what is built first"), false)],
            Self::Step => {
                let steps = ["run", "forward", "back", "joint_forward", "joint_back", "roll_back"];
                let text = "step, or the number of commands that are in effect afterwards";
                vec![rig(), ("to", json!({"anyOf": [{"enum": steps}, {"type": "integer"}], "description": text}), true)]
            }
            Self::Load => vec![
                ("path", path("file, .rig.ron, in a folder that the app allows"), true),
                ("live", yes_no("takes changes of the file over at once"), false),
            ],
            Self::Save => vec![rig(), ("path", path("file, .rig.ron; by default the one that was loaded"), false)],
            Self::Update => vec![
                rig(),
                ("path", path("file, .rig.ron; by default the one that was loaded"), false),
                (
                    "take",
                    json!({"enum": ["mine", "theirs"], "default": "mine", "description": "side of conflicts"}),
                    false,
                ),
                ("dry_run", yes_no("lists the changes only"), false),
            ],
        }
    }

    fn result(self) -> Value {
        let list = |text: &str| json!({"type": "array", "description": text});
        let object = |fields: Value| json!({"type": "object", "properties": fields});
        let error = || json!({"type": ["string", "null"], "description": "error that stopped the build"});
        let run = || {
            object(json!({
                "executed": list("tags of the commands that ran"),
                "cursor": {"type": "integer", "description": "number of commands in effect"},
                "error": error(),
            }))
        };
        match self {
            Self::List => list("rig, uid, name, number of joints, is_document, is_built"),
            Self::Describe => object(json!({
                "rig": {"type": "integer"}, "uid": {"type": "string"}, "name": {"type": "string"},
                "joints": list("data of joints, with their parents"),
                "commands": list("tag, state, error"),
                "nodes": list("uid, name, label, is_control"),
                "error": error(),
                "text": {"type": "string"},
            })),
            Self::Edit => object(json!({
                "changed": {"type": "boolean"}, "step": {"type": "string"}, "notes": list("sentences"),
            })),
            Self::Build | Self::Step => run(),
            Self::Load => object(json!({"rig": {"type": "integer"}})),
            Self::Save => object(json!({"path": {"type": "string"}, "notes": list("sentences")})),
            Self::Update => object(json!({
                "changes": list("kind, uid, joint, tag, field, from, to, conflict"),
                "ran": list("tags of the commands that ran"),
                "poses": list("joints that do not stand as before, a sentence each"),
                "clips": list("joints that do not move as before, and keys that are set aside, a sentence each"),
            })),
        }
    }
}

const VERBS: [Verb; 8] =
    [Verb::List, Verb::Describe, Verb::Edit, Verb::Build, Verb::Step, Verb::Load, Verb::Save, Verb::Update];

/// The method with that name.
pub(super) fn verb(name: &str) -> Option<Verb> {
    VERBS.into_iter().find(|verb| verb.name() == name)
}

/// Names of all methods.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    VERBS.into_iter().map(Verb::name).chain([DISCOVER])
}

/// Description of all methods.
pub(super) fn document(address: SocketAddr) -> Value {
    let method = |verb: Verb| {
        let param = |(name, schema, required)| json!({"name": name, "required": required, "schema": schema});
        json!({
            "name": verb.name(),
            "summary": verb.summary(),
            "paramStructure": "by-name",
            "params": verb.params().into_iter().map(param).collect::<Vec<_>>(),
            "result": {"name": "result", "schema": verb.result()},
        })
    };
    let discover = json!({
        "name": DISCOVER,
        "summary": "Describes all methods.",
        "params": [],
        "result": {"name": "result", "schema": {"type": "object"}},
    });
    json!({
        "openrpc": "1.3.2",
        "info": {"title": "Rigsmith", "version": env!("CARGO_PKG_VERSION")},
        "methods": VERBS.into_iter().map(method).chain([discover]).collect::<Vec<_>>(),
        "servers": [{"name": "this app", "url": format!("http://{address}")}],
    })
}
