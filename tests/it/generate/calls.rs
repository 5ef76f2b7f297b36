//! Calls of remote control: bodies of requests, most of them right, the others bent.

use rigsmith::{
    processor::Modules,
    rig::{Rig, UidSource},
};
use serde_json::{Value, json};

use super::{Choices, choices::bend, edits::operation, params::NAMES};

/// Files that calls may name: in the folder, missing, of another kind, and outside.
pub const PATHS: [&str; 10] = [
    "t.rig.ron",
    "u.rig.ron",
    "copy.rig.ron",
    "nothing.rig.ron",
    "t.txt",
    "../secret.rig.ron",
    "/etc/passwd",
    "",
    "sub/../t.rig.ron",
    "sub/new.rig.ron",
];

/// Body of a call about a rig, whose document is given if there is one.
pub fn call(choices: &mut Choices, rig: Option<(u64, &Rig)>, modules: &Modules, number: u64) -> String {
    let name = match (rig, choices.chance(8)) {
        (Some((entity, _)), false) => json!(entity),
        (Some((_, rig)), true) => json!(rig.about().name),
        (None, _) => choices.pick(&[0, 1, u64::MAX]).into(),
    };
    let path = choices.pick(&PATHS);
    let (method, mut params) = match choices.below(14) {
        // A rig that follows its file changes by itself, whatever is called.
        0 | 1 => ("rig.template.load", json!({"path": path, "live": false})),
        2..=5 => ("rig.edit", json!({"rig": name, "edits": edits(choices, rig.map(|(_, rig)| rig), modules, number)})),
        6 => ("rig.edit", json!({"rig": name, "history": choices.pick(&["undo", "redo", "both"])})),
        7 => ("rig.build", json!({"rig": name, "restart": choices.chance(3)})),
        8 => {
            let steps = ["run", "forward", "back", "joint_forward", "joint_back", "roll_back"];
            let to =
                if choices.chance(3) { json!(choices.pick(&[0, 1, u64::MAX])) } else { json!(choices.pick(&steps)) };
            ("rig.step", json!({"rig": name, "to": to}))
        }
        9 => ("rig.template.save", json!({"rig": name, "path": path})),
        10 => ("rig.template.update", json!({"rig": name, "take": choices.pick(&["mine", "theirs"])})),
        11 => ("rig.template.update", json!({"rig": name, "path": path, "dry_run": true})),
        12 => ("rig.describe", json!({"rig": name, "text": choices.chance(2)})),
        _ => (choices.pick(&["rig.list", "rpc.discover", "rig.nothing", ""]), json!({})),
    };
    if choices.chance(12) {
        let field = choices.pick(&["rig", "path", "edits", "surplus"]);
        params[field] = match choices.below(4) {
            0 => Value::Null,
            1 => json!([]),
            2 => json!({"no": "such"}),
            _ => json!(-1.5),
        };
    }
    let mut text = json!({"jsonrpc": "2.0", "id": number, "method": method, "params": params}).to_string();
    if choices.chance(8) {
        bend(choices, &mut text);
    }
    text
}

/// Edits as a call has them.
fn edits(choices: &mut Choices, rig: Option<&Rig>, modules: &Modules, number: u64) -> Value {
    let Some(rig) = rig else { return json!([]) };
    let operation = operation(choices, rig, modules, 3000 + number * 16);
    let done = operation.run(&mut rig.clone(), &mut UidSource::seeded(number), None);
    let edits = done.map(|outcome| outcome.edits).unwrap_or_default();
    let mut value = serde_json::to_value(edits).unwrap_or_default();
    if choices.chance(6) {
        // An edit that the rig refuses behind others that it takes.
        if let Some(list) = value.as_array_mut() {
            list.push(json!({"SetLabel": ["00000000deadbeef", choices.pick(&NAMES)]}));
        }
    }
    value
}
