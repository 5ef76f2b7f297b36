//! Templates as people write them: joints, groups, inputs, features and commands, parts with their changes, stored poses.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    path::{Path, PathBuf},
};

use rigsmith::{files::PartFiles, processor::Modules, rig::template::Template};

use super::{
    Choices,
    choices::{bend, text_of},
    params::{Scene, command},
};

/// The part that templates use, beside those that come with the program.
const PART: &str = r#"(
    format: 2,
    name: "link",
    kind: "part",
    chains: [(name: "chain", joints: ["link_1", "link_2", "link_3"], min: 1, max: 12)],
    sockets: [(name: "end", joint: "link_3", translation: (0, 0.1, 0))],
    options: [(name: "size", default: 0.5, form: Slider(min: 0, max: 1), sets: [(tag: "control/link_2", param: "relative_size")])],
    joints: [
        (label: "link_1", translation: (0, 0.5, 0), tags: [Feature(kind: "fk", name: "fk"), control(feature: "fk", creation: (name: "base"))]),
        (label: "link_2", parent: "link_1", translation: (0, 0.2, 0), tags: [control(relative_size: 0.4)]),
        (label: "link_3", parent: "link_2", translation: (0, 0.2, 0), tags: [null(at: "@joint link_1 + @this")]),
    ],
)
"#;

/// Joints apart from all others, with the controls that commands of a template refer to in which most is to build.
const GOALS: [&str; 2] = [
    r#"(label: "goal_1", translation: (1, 0, 0.5), tags: [control(), null()])"#,
    r#"(label: "goal_2", translation: (-0.5, 0, 2), tags: [control()])"#,
];

/// Most joints of a template, without those of its parts.
const JOINTS: usize = 14;

/// A template's text with the files of its parts.
#[derive(Debug, Clone)]
pub struct MadeTemplate {
    /// The text.
    pub text: String,
    /// Files of parts, by path.
    pub files: BTreeMap<PathBuf, Option<Vec<u8>>>,
}

impl MadeTemplate {
    /// Path of the template.
    pub fn path() -> &'static Path {
        Path::new("made.rig.ron")
    }

    /// The template with its parts; `None` if it is none.
    pub fn read(&self) -> Option<Template> {
        PartFiles::given(&self.files).complete(Self::path(), self.text.as_bytes()).ok()
    }
}

/// Label of a joint; some have a side.
fn label(number: usize) -> String {
    let side = ["", "", "_l", "_r"][number % 4];
    format!("j{number}{side}")
}

fn vector(choices: &mut Choices) -> String {
    let [x, y, z] = [(); 3].map(|()| text_of(choices.any_number()));
    format!("({x}, {y}, {z})")
}

/// Writes a template. `has_parts` allows parts in it.
pub fn template(choices: &mut Choices, modules: &Modules, has_parts: bool) -> MadeTemplate {
    let mut text = String::from("(\n    format: 2,\n    name: \"made\",\n");
    let count = 1 + choices.below(JOINTS);
    let mut scene = Scene::default();
    if !choices.is_wild() {
        scene.goals = Some(["control/goal_1", "control/goal_2"].map(str::to_owned));
    }
    for number in 0..choices.below(4) {
        scene.groups.push(format!("g{number}"));
    }
    for number in 0..choices.below(3) {
        scene.inputs.push(format!("input{number}"));
    }
    for number in 0..count {
        scene.joints.push(label(number));
        // Mostly chains, with a branch and another root now and then.
        let parent = match choices.below(8) {
            0..=4 => number.checked_sub(1),
            5 | 6 => (number > 0).then(|| choices.below(number)),
            _ => None,
        };
        scene.parents.push(parent);
    }
    list(&mut text, "groups", scene.groups.iter().map(|name| format!("(name: {name:?}, enabled: true)")));
    let inputs: Vec<String> =
        scene.inputs.clone().iter().map(|name| format!("(name: {name:?}, translation: {})", vector(choices))).collect();
    list(&mut text, "inputs", inputs);
    let goals: &[&str] = if scene.goals.is_some() { &GOALS } else { &[] };
    let mut joints: Vec<String> = goals.iter().map(|&joint| joint.to_owned()).collect();
    joints.extend((0..count).map(|number| joint(choices, &mut scene, modules, number)));
    list(&mut text, "joints", joints);
    let mut files = BTreeMap::new();
    if has_parts && choices.chance(3) {
        files.insert(PathBuf::from("link.rig.ron"), Some(PART.as_bytes().to_vec()));
        let instances: Vec<String> = (0..1 + choices.below(3)).map(|number| part(choices, &scene, number)).collect();
        list(&mut text, "parts", instances);
    }
    if choices.chance(4) {
        let pose = format!(
            "(name: \"bent\", offsets: [(joint: {:?}, translation: {})])",
            scene.joints[choices.below(count)],
            vector(choices)
        );
        list(&mut text, "poses", [pose]);
    }
    text.push_str(")\n");
    if scene.goals.is_none() && choices.chance(3) {
        bend(choices, &mut text);
    }
    MadeTemplate { text, files }
}

fn list(text: &mut String, name: &str, items: impl IntoIterator<Item = String>) {
    let items: Vec<String> = items.into_iter().collect();
    if !items.is_empty() {
        let _ = writeln!(text, "    {name}: [\n        {},\n    ],", items.join(",\n        "));
    }
}

fn joint(choices: &mut Choices, scene: &mut Scene, modules: &Modules, number: usize) -> String {
    let own = scene.joints[number].clone();
    let mut text = format!("(label: {own:?}");
    if let Some(parent) = scene.parents[number] {
        let _ = write!(text, ", parent: {:?}", scene.joints[parent]);
    }
    let up = 0.25 + choices.unit();
    let place = if choices.chance(3) { vector(choices) } else { format!("(0, {up:?}, 0)") };
    let _ = write!(text, ", translation: {place}");
    if choices.chance(4) {
        let _ = write!(text, ", rotation: {}", vector(choices));
    }
    if choices.chance(12) {
        let _ = write!(text, ", scale: {}", vector(choices));
    }
    if choices.chance(3) && !scene.groups.is_empty() {
        let _ = write!(text, ", group: {:?}", scene.groups[choices.below(scene.groups.len())]);
    }
    if choices.chance(12) {
        text.push_str(", kind: Null");
    }
    if choices.chance(12) {
        text.push_str(", locked: true");
    }
    if choices.chance(12) {
        let _ = write!(text, ", uid: \"{:016x}\"", 0x1000 + number);
    }
    let mut tags = Vec::new();
    let has_feature = choices.chance(4);
    if has_feature {
        let switch = choices.pick(&["", "a", "b"]);
        let choice = if switch.is_empty() { "" } else { choices.pick(&["", "solver"]) };
        tags.push(format!("Feature(kind: \"ik\", name: \"f{number}\", switch: {switch:?}, choice: {choice:?})"));
        tags.push(format!("Feature(kind: \"ik\", name: \"f{number}\")"));
    }
    let most = if scene.goals.is_some() { 2 } else { 4 };
    for _ in 0..choices.below(most) {
        let (module, params) = command(choices, scene, modules);
        scene.commands.push(format!("{module}/{own}"));
        tags.push(tag(choices, &module, &params, has_feature.then_some(number)));
    }
    if !tags.is_empty() {
        let _ = write!(text, ", tags: [{}]", tags.join(", "));
    }
    text + ")"
}

/// A command in one of its two forms.
fn tag(choices: &mut Choices, module: &str, params: &str, feature: Option<usize>) -> String {
    let feature = feature.filter(|_| choices.chance(2)).map(|number| format!("feature: \"f{number}\""));
    let enabled = choices.chance(12).then(|| "enabled: false".to_owned());
    let own: Vec<String> = feature.into_iter().chain(enabled).collect();
    if choices.chance(2) {
        let own: String = own.iter().map(|field| format!("{field}, ")).collect();
        return format!("Command({own}module: {module:?}, params: {params})");
    }
    let inside = params.strip_prefix('(').and_then(|text| text.strip_suffix(')')).unwrap_or_default();
    let fields: Vec<&str> = own.iter().map(String::as_str).chain((!inside.is_empty()).then_some(inside)).collect();
    format!("{module}({})", fields.join(", "))
}

/// A part instance.
fn part(choices: &mut Choices, scene: &Scene, number: usize) -> String {
    let is_usual = scene.goals.is_some();
    let file = match is_usual {
        true => "link.rig.ron",
        false => choices.pick(&["link.rig.ron", "link.rig.ron", "parts/single_control.rig.ron", "nothing.rig.ron"]),
    };
    let joint = |choices: &mut Choices| scene.joints[choices.below(scene.joints.len())].clone();
    let mut text = format!("(part: {file:?}, name: \"part {number}\", prefix: \"p{number}_\"");
    match choices.below(if is_usual { 3 } else { 6 }) {
        0..=2 => {
            let _ = write!(text, ", parent: {:?}, translation: {}", joint(choices), vector(choices));
        }
        3 => {
            let _ = write!(text, ", onto: [{:?}]", joint(choices));
        }
        4 => {
            let _ = write!(text, ", onto: [{:?}], adds: true", joint(choices));
        }
        _ => {
            let _ = write!(text, ", socket: \"part {}.end\"", number.saturating_sub(1));
        }
    }
    for (one_in, field) in [
        (3, ", mirror: true"),
        (6, ", world: true"),
        (3, ", off: [\"fk\"]"),
        (4, ", count: 5"),
        (16, ", count: 4294967295"),
        (4, ", options: {\"size\": 0.7}"),
        (16, ", options: {\"size\": \"big\"}"),
        (3, ", changes: [(tag: \"control/link_2\", params: (relative_size: 0.9))]"),
        (4, ", changes: [(joint: \"link_3\", translation: (0, 0.05, 0), tags: [null(creation: (name: \"nail\"))])]"),
        (8, ", changes: [(tag: \"control/link_2\", removed: true)]"),
        (16, ", changes: [(tag: \"control/nothing\", unset: [\"size\"])]"),
    ] {
        let is_fault = [": \"big\"", "4294967295", "/nothing", "removed"].iter().any(|fault| field.contains(fault));
        if is_usual && is_fault {
            continue;
        }
        // A second list of changes would be a field twice.
        if choices.chance(one_in) && !(field.contains("changes") && text.contains("changes")) {
            text.push_str(field);
        }
    }
    text + ")"
}
