//! Lists in the cards of commands: empty ones, usual ones, and such as are far longer than a panel.

use bevy::prelude::*;
use rigsmith::{
    editor::files::OpenRequest,
    prelude::*,
    rig::{JointData, RestTransform, TagData, TagKind},
};

use super::{
    booth::{Booth, Step},
    cases::{ALL, Case, NAMES, varied},
};

const SEED: u64 = 0x5B00_0000;

/// Number of items in each list: of texts, of numbers, and of items with fields.
const LENGTHS: [(&str, [usize; 3]); 3] = [("empty", [0, 0, 0]), ("typical", [3, 2, 2]), ("extreme", [40, 30, 12])];

/// Joint of a chain of three, of which there is one for each state.
fn joint(state: usize, number: usize) -> Uid {
    Uid(SEED + (10 * state + number) as u64)
}

fn label(state: usize, number: usize) -> String {
    let name = ["upper", "lower", "end"][number];
    match LENGTHS[state].0 {
        "extreme" => format!("{name}_with_a_label_that_is_longer_than_the_card_which_shows_it"),
        other => format!("{name}_{other}"),
    }
}

/// Chains of joints, the first joint of each with a command for each kind of list.
pub fn booth() -> Booth {
    let mut booth = Booth::new(&[]);
    booth.open(OpenRequest::Empty);
    let mut edits = Vec::new();
    for (state, (name, lengths)) in LENGTHS.into_iter().enumerate() {
        for number in 0..3 {
            let data = JointData {
                uid: joint(state, number),
                label: Some(label(state, number)),
                rest: RestTransform::from_translation(Vec3::new(state as f32 * 0.5, 0.3, 0.0)),
                ..default()
            };
            let parent = (number > 0).then(|| joint(state, number - 1));
            edits.push(RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX });
        }
        for (index, (module, params)) in commands(state, name, lengths).into_iter().enumerate() {
            let tag = TagData {
                uid: Uid(SEED + 0x1000 + (10 * state + index) as u64),
                enabled: true,
                comment: String::new(),
                kind: TagKind::Command { module: module.to_owned(), params, feature: None },
            };
            edits.push(RigEdit::AddTag { joint: joint(state, 0), tag: Box::new(tag), index });
        }
    }
    booth.edit(Operation::Edits(edits));
    booth.settle();
    booth.tell([]);
    booth
}

/// Modules with the parameters of their commands, whose lists have so many items.
fn commands(state: usize, name: &str, [texts, numbers, items]: [usize; 3]) -> [(&'static str, String); 3] {
    let node = |number: usize| format!("\"@joint {}#{:016x}\"", label(state, number), joint(state, number).0);
    let is_long = name == "extreme";
    let choice = |number: usize| match is_long {
        true => format!("\"选择 {number}: a choice with a name that is far longer than its field\""),
        false => format!("\"{}\"", ["world", "hips", "chest"][number % 3]),
    };
    let share = |number: usize| format!("{:.4}", (number + 1) as f32 / (numbers + 1) as f32);
    let input = |number: usize| {
        let name = if is_long { format!("an_input_with_a_long_name_{number}") } else { format!("turn_{number}") };
        format!("(name: \"{name}\", node: {}, channel: RotateX)", node(1))
    };
    let listed = |count: usize, item: &dyn Fn(usize) -> String| (0..count).map(item).collect::<Vec<_>>().join(", ");
    let count = numbers.max(2);
    [
        ("attribute", format!("(name: \"space\", choices: [{}])", listed(texts, &choice))),
        ("twist", format!("(end: {}, count: {count}, shares: [{}])", node(1), listed(numbers, &share))),
        (
            "expression",
            format!(
                "(text: \"30\", inputs: [{}], output: {}, output_channel: RotateY)",
                listed(items, &input),
                node(2)
            ),
        ),
    ]
}

/// A picture of each list in each state.
pub fn cases() -> Vec<Case> {
    let selections: [fn(&mut Booth); 3] = [select_empty, select_typical, select_extreme];
    let cards: [(&str, &'static [Step]); 3] = [
        ("texts", &[Step::Click("Values of attribute")]),
        ("numbers", &[Step::Click("Values of twist")]),
        ("items", &[Step::Click("Values of expression")]),
    ];
    let mut cases = Vec::new();
    for ((name, _), before) in LENGTHS.into_iter().zip(selections) {
        let (height, asked) = if name == "extreme" { (900, NAMES) } else { (640, ALL) };
        for (list, steps) in cards {
            cases.push(Case { asked, ..varied("tags", &format!("{list}_{name}"), height, before, steps) });
        }
    }
    cases
}

fn select(booth: &mut Booth, state: usize) {
    booth.select(&[joint(state, 0)]);
}

fn select_empty(booth: &mut Booth) {
    select(booth, 0);
}

fn select_typical(booth: &mut Booth) {
    select(booth, 1);
}

fn select_extreme(booth: &mut Booth) {
    select(booth, 2);
}
