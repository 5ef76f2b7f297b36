//! Rules of VRM 1.0 as a table: the JSON schemas of its extensions, and what the text of the specification adds.

use std::collections::BTreeMap;

use serde_json::Value;

/// Kind of a value.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Text,
    /// A text that is one of some.
    OneOf(&'static [&'static str]),
    Flag,
    /// A number within a range.
    Number(f64, f64),
    /// A whole number that is not negative.
    Index,
    /// A list of so many numbers.
    Vector(usize),
    /// A list of at least so many entries.
    List(usize),
    Object,
}

use Kind::{Flag, Index, List, Number, Object, OneOf, Text, Vector};

const ANY: f64 = f64::INFINITY;
const OVERRIDE: Kind = OneOf(&["none", "block", "blend"]);

/// Places with the kind of their value; `!` marks one that has to be there if what carries it is there. `*` stands for each
/// entry of a list or object. What no row names may not be there.
const RULES: &[(&str, Kind)] = &[
    ("!VRMC_vrm", Object),
    ("VRMC_vrm/!specVersion", OneOf(&["1.0"])),
    ("VRMC_vrm/!meta", Object),
    ("VRMC_vrm/meta/!name", Text),
    ("VRMC_vrm/meta/version", Text),
    ("VRMC_vrm/meta/!authors", List(1)),
    ("VRMC_vrm/meta/authors/*", Text),
    ("VRMC_vrm/meta/!licenseUrl", OneOf(&["https://vrm.dev/licenses/1.0/"])),
    ("VRMC_vrm/meta/avatarPermission", OneOf(&["onlyAuthor", "onlySeparatelyLicensedPerson", "everyone"])),
    ("VRMC_vrm/meta/allowExcessivelyViolentUsage", Flag),
    ("VRMC_vrm/meta/allowExcessivelySexualUsage", Flag),
    ("VRMC_vrm/meta/commercialUsage", OneOf(&["personalNonProfit", "personalProfit", "corporation"])),
    ("VRMC_vrm/meta/allowPoliticalOrReligiousUsage", Flag),
    ("VRMC_vrm/meta/allowAntisocialOrHateUsage", Flag),
    ("VRMC_vrm/meta/creditNotation", OneOf(&["required", "unnecessary"])),
    ("VRMC_vrm/meta/allowRedistribution", Flag),
    ("VRMC_vrm/meta/modification", OneOf(&["prohibited", "allowModification", "allowModificationRedistribution"])),
    ("VRMC_vrm/!humanoid", Object),
    ("VRMC_vrm/humanoid/!humanBones", Object),
    ("VRMC_vrm/humanoid/humanBones/*", Object),
    ("VRMC_vrm/humanoid/humanBones/*/!node", Index),
    ("VRMC_vrm/expressions", Object),
    ("VRMC_vrm/expressions/preset", Object),
    ("VRMC_vrm/expressions/preset/*", Object),
    ("VRMC_vrm/expressions/preset/*/morphTargetBinds", List(1)),
    ("VRMC_vrm/expressions/preset/*/morphTargetBinds/*", Object),
    ("VRMC_vrm/expressions/preset/*/morphTargetBinds/*/!node", Index),
    ("VRMC_vrm/expressions/preset/*/morphTargetBinds/*/!index", Index),
    ("VRMC_vrm/expressions/preset/*/morphTargetBinds/*/!weight", Number(0.0, 1.0)),
    ("VRMC_vrm/expressions/preset/*/isBinary", Flag),
    ("VRMC_vrm/expressions/preset/*/overrideBlink", OVERRIDE),
    ("VRMC_vrm/expressions/preset/*/overrideLookAt", OVERRIDE),
    ("VRMC_vrm/expressions/preset/*/overrideMouth", OVERRIDE),
    ("VRMC_vrm/expressions/custom", Object),
    ("VRMC_vrm/expressions/custom/*", Object),
    ("VRMC_vrm/expressions/custom/*/morphTargetBinds", List(1)),
    ("VRMC_vrm/expressions/custom/*/morphTargetBinds/*", Object),
    ("VRMC_vrm/expressions/custom/*/morphTargetBinds/*/!node", Index),
    ("VRMC_vrm/expressions/custom/*/morphTargetBinds/*/!index", Index),
    ("VRMC_vrm/expressions/custom/*/morphTargetBinds/*/!weight", Number(0.0, 1.0)),
    ("VRMC_vrm/expressions/custom/*/isBinary", Flag),
    ("VRMC_vrm/expressions/custom/*/overrideBlink", OVERRIDE),
    ("VRMC_vrm/expressions/custom/*/overrideLookAt", OVERRIDE),
    ("VRMC_vrm/expressions/custom/*/overrideMouth", OVERRIDE),
    ("VRMC_vrm/lookAt", Object),
    ("VRMC_vrm/lookAt/type", OneOf(&["bone", "expression"])),
    ("VRMC_vrm/lookAt/offsetFromHeadBone", Vector(3)),
    ("VRMC_vrm/lookAt/rangeMapHorizontalInner", Object),
    ("VRMC_vrm/lookAt/rangeMapHorizontalInner/!inputMaxValue", Number(0.0, 180.0)),
    ("VRMC_vrm/lookAt/rangeMapHorizontalInner/!outputScale", Number(0.0, 90.0)),
    ("VRMC_vrm/lookAt/rangeMapHorizontalOuter", Object),
    ("VRMC_vrm/lookAt/rangeMapHorizontalOuter/!inputMaxValue", Number(0.0, 180.0)),
    ("VRMC_vrm/lookAt/rangeMapHorizontalOuter/!outputScale", Number(0.0, 90.0)),
    ("VRMC_vrm/lookAt/rangeMapVerticalDown", Object),
    ("VRMC_vrm/lookAt/rangeMapVerticalDown/!inputMaxValue", Number(0.0, 180.0)),
    ("VRMC_vrm/lookAt/rangeMapVerticalDown/!outputScale", Number(0.0, 90.0)),
    ("VRMC_vrm/lookAt/rangeMapVerticalUp", Object),
    ("VRMC_vrm/lookAt/rangeMapVerticalUp/!inputMaxValue", Number(0.0, 180.0)),
    ("VRMC_vrm/lookAt/rangeMapVerticalUp/!outputScale", Number(0.0, 90.0)),
    ("VRMC_springBone", Object),
    ("VRMC_springBone/!specVersion", OneOf(&["1.0"])),
    ("VRMC_springBone/colliders", List(1)),
    ("VRMC_springBone/colliders/*", Object),
    ("VRMC_springBone/colliders/*/!node", Index),
    ("VRMC_springBone/colliders/*/!shape", Object),
    ("VRMC_springBone/colliders/*/shape/sphere", Object),
    ("VRMC_springBone/colliders/*/shape/sphere/offset", Vector(3)),
    ("VRMC_springBone/colliders/*/shape/sphere/radius", Number(0.0, ANY)),
    ("VRMC_springBone/colliders/*/shape/capsule", Object),
    ("VRMC_springBone/colliders/*/shape/capsule/offset", Vector(3)),
    ("VRMC_springBone/colliders/*/shape/capsule/radius", Number(0.0, ANY)),
    ("VRMC_springBone/colliders/*/shape/capsule/tail", Vector(3)),
    ("VRMC_springBone/colliderGroups", List(1)),
    ("VRMC_springBone/colliderGroups/*", Object),
    ("VRMC_springBone/colliderGroups/*/name", Text),
    ("VRMC_springBone/colliderGroups/*/!colliders", List(1)),
    ("VRMC_springBone/colliderGroups/*/colliders/*", Index),
    ("VRMC_springBone/springs", List(1)),
    ("VRMC_springBone/springs/*", Object),
    ("VRMC_springBone/springs/*/name", Text),
    ("VRMC_springBone/springs/*/!joints", List(2)),
    ("VRMC_springBone/springs/*/joints/*", Object),
    ("VRMC_springBone/springs/*/joints/*/!node", Index),
    ("VRMC_springBone/springs/*/joints/*/hitRadius", Number(0.0, ANY)),
    ("VRMC_springBone/springs/*/joints/*/stiffness", Number(0.0, ANY)),
    ("VRMC_springBone/springs/*/joints/*/gravityPower", Number(0.0, ANY)),
    ("VRMC_springBone/springs/*/joints/*/gravityDir", Vector(3)),
    ("VRMC_springBone/springs/*/joints/*/dragForce", Number(0.0, 1.0)),
    ("VRMC_springBone/springs/*/colliderGroups", List(1)),
    ("VRMC_springBone/springs/*/colliderGroups/*", Index),
    ("VRMC_springBone/springs/*/center", Index),
];

/// Rules of a constraint, which stands at a node.
const CONSTRAINT: &[(&str, Kind)] = &[
    ("!specVersion", OneOf(&["1.0"])),
    ("!constraint", Object),
    ("constraint/roll", Object),
    ("constraint/roll/!source", Index),
    ("constraint/roll/!rollAxis", OneOf(&["X", "Y", "Z"])),
    ("constraint/roll/weight", Number(0.0, 1.0)),
    ("constraint/rotation", Object),
    ("constraint/rotation/!source", Index),
    ("constraint/rotation/weight", Number(0.0, 1.0)),
];

/// Bones with the bone on which each hangs, and a mark at those that are required. A bone in brackets may be there only with
/// the one on which it hangs.
const BONES: &[(&str, &str)] = &[
    ("hips!", ""),
    ("spine!", "hips"),
    ("chest", "spine"),
    ("(upperChest)", "chest"),
    ("neck", "upperChest"),
    ("head!", "neck"),
    ("leftEye", "head"),
    ("rightEye", "head"),
    ("jaw", "head"),
    ("*UpperLeg!", "hips"),
    ("*LowerLeg!", "*UpperLeg"),
    ("*Foot!", "*LowerLeg"),
    ("*Toes", "*Foot"),
    ("*Shoulder", "upperChest"),
    ("*UpperArm!", "*Shoulder"),
    ("*LowerArm!", "*UpperArm"),
    ("*Hand!", "*LowerArm"),
    ("*ThumbMetacarpal", "*Hand"),
    ("(*ThumbProximal)", "*ThumbMetacarpal"),
    ("(*ThumbDistal)", "*ThumbProximal"),
    ("*IndexProximal", "*Hand"),
    ("(*IndexIntermediate)", "*IndexProximal"),
    ("(*IndexDistal)", "*IndexIntermediate"),
    ("*MiddleProximal", "*Hand"),
    ("(*MiddleIntermediate)", "*MiddleProximal"),
    ("(*MiddleDistal)", "*MiddleIntermediate"),
    ("*RingProximal", "*Hand"),
    ("(*RingIntermediate)", "*RingProximal"),
    ("(*RingDistal)", "*RingIntermediate"),
    ("*LittleProximal", "*Hand"),
    ("(*LittleIntermediate)", "*LittleProximal"),
    ("(*LittleDistal)", "*LittleIntermediate"),
];

/// Names of preset expressions, sorted.
pub const PRESETS: [&str; 18] = [
    "aa",
    "angry",
    "blink",
    "blinkLeft",
    "blinkRight",
    "ee",
    "happy",
    "ih",
    "lookDown",
    "lookLeft",
    "lookRight",
    "lookUp",
    "neutral",
    "oh",
    "ou",
    "relaxed",
    "sad",
    "surprised",
];

/// A bone of the table: whether it is required, whether it needs the very bone above it, and the name of that bone.
struct Bone {
    is_required: bool,
    needs_above: bool,
    above: String,
}

fn bones() -> BTreeMap<String, Bone> {
    let mut bones = BTreeMap::new();
    for (name, above) in BONES {
        let sides: &[&str] = if name.contains('*') { &["left", "right"] } else { &[""] };
        for side in sides {
            let plain = name.trim_matches(['!', '(', ')']).replace('*', side);
            let (is_required, needs_above) = (name.ends_with('!'), name.starts_with('('));
            bones.insert(plain, Bone { is_required, needs_above, above: above.replace('*', side) });
        }
    }
    bones
}

/// Rules as a tree of fields.
#[derive(Default)]
struct Field {
    kind: Option<Kind>,
    is_required: bool,
    fields: BTreeMap<String, Field>,
}

fn tree(rules: &[(&str, Kind)]) -> Field {
    let mut root = Field { kind: Some(Object), ..Field::default() };
    for (path, kind) in rules {
        let mut field = &mut root;
        for part in path.split('/') {
            let own = field.fields.entry(part.trim_start_matches('!').to_owned()).or_default();
            own.is_required |= part.starts_with('!');
            field = own;
        }
        field.kind = Some(*kind);
    }
    root
}

fn check(value: &Value, field: &Field, place: &str) {
    let number = |value: &Value| value.as_f64().filter(|number| number.is_finite());
    let is_right = match field.kind.unwrap_or_else(|| panic!("{place}: the table has no row")) {
        Text => value.as_str().is_some_and(|text| !text.trim().is_empty()),
        OneOf(names) => value.as_str().is_some_and(|text| names.contains(&text)),
        Flag => value.is_boolean(),
        Number(least, most) => number(value).is_some_and(|number| (least..=most).contains(&number)),
        Index => value.as_u64().is_some(),
        Vector(count) => {
            value.as_array().is_some_and(|list| list.len() == count && list.iter().all(|entry| number(entry).is_some()))
        }
        List(least) => value.as_array().is_some_and(|list| list.len() >= least),
        Object => value.is_object(),
    };
    assert!(is_right, "{place}: {value} is not {:?}", field.kind);
    let each = field.fields.get("*");
    match value {
        Value::Object(map) => {
            for (name, field) in field.fields.iter().filter(|(_, field)| field.is_required) {
                assert!(map.contains_key(name), "{place}: lacks {name} {:?}", field.kind);
            }
            for (name, value) in map {
                let field = field.fields.get(name).or(each);
                check(value, field.unwrap_or_else(|| panic!("{place}/{name} is unknown")), &format!("{place}/{name}"));
            }
        }
        Value::Array(list) if each.is_some() => {
            for (at, value) in list.iter().enumerate() {
                check(value, each.unwrap(), &format!("{place}/{at}"));
            }
        }
        _ => {}
    }
}

/// The document of a GLB.
pub fn document(glb: &[u8]) -> Value {
    assert_eq!(&glb[..4], b"glTF");
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

/// Parents of the nodes of a document.
pub fn parents(document: &Value) -> Vec<Option<usize>> {
    let nodes = document["nodes"].as_array().unwrap();
    let mut parents = vec![None; nodes.len()];
    for (at, node) in nodes.iter().enumerate() {
        for child in node["children"].as_array().into_iter().flatten() {
            let child = child.as_u64().unwrap() as usize;
            assert_eq!(parents[child].replace(at), None, "node {child} has two parents");
        }
    }
    parents
}

fn is_above(parents: &[Option<usize>], above: usize, node: usize) -> bool {
    std::iter::successors(parents[node], |node| parents[*node]).any(|node| node == above)
}

fn index(value: &Value) -> usize {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no index")) as usize
}

/// Checks the extensions of a document against all rules.
pub fn check_avatar(document: &Value) {
    check(&document["extensions"], &tree(RULES), "/extensions");
    let used: Vec<&str> =
        document["extensionsUsed"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    let nodes = document["nodes"].as_array().unwrap();
    let parents = parents(document);
    for name in document["extensions"].as_object().unwrap().keys() {
        assert!(used.contains(&name.as_str()), "{name} is not declared");
    }
    for (at, node) in nodes.iter().enumerate() {
        // Definition 2.1 of the T-pose; nothing here writes a scale at all.
        assert!(node.get("scale").is_none() && node.get("matrix").is_none(), "node {at} is scaled");
        let Some(constraint) = node.pointer("/extensions/VRMC_node_constraint") else { continue };
        check(constraint, &tree(CONSTRAINT), &format!("/nodes/{at}"));
        let kinds = constraint["constraint"].as_object().unwrap();
        assert_eq!(kinds.len(), 1, "one kind");
        let source = index(&kinds.values().next().unwrap()["source"]);
        assert!(source < nodes.len() && source != at);
        assert!(used.contains(&"VRMC_node_constraint"));
    }
    let known = bones();
    let human = document.pointer("/extensions/VRMC_vrm/humanoid/humanBones").unwrap().as_object().unwrap();
    let mut taken = BTreeMap::new();
    for (name, bone) in &known {
        assert!(!bone.is_required || human.contains_key(name), "{name} is not there");
    }
    for (name, node) in human {
        let bone = known.get(name).unwrap_or_else(|| panic!("{name} is no bone"));
        let node = index(&node["node"]);
        assert!(node < nodes.len(), "{name}: there is no node {node}");
        assert_eq!(taken.insert(node, name), None, "{name}: node {node} is another bone, too");
        assert!(!bone.needs_above || human.contains_key(&bone.above), "{name} without {}", bone.above);
        let mut above = &bone.above;
        while !above.is_empty() && !human.contains_key(above) {
            above = &known[above].above;
        }
        if !above.is_empty() {
            assert!(is_above(&parents, index(&human[above]["node"]), node), "{name} does not hang on {above}");
        }
    }
    check_expressions(document, nodes);
    check_springs(document, nodes.len(), &parents);
}

fn check_expressions(document: &Value, nodes: &[Value]) {
    let Some(expressions) = document.pointer("/extensions/VRMC_vrm/expressions") else { return };
    for (kind, list) in expressions.as_object().unwrap() {
        for (name, expression) in list.as_object().unwrap() {
            assert_eq!(PRESETS.contains(&name.as_str()), kind == "preset", "{kind} {name}");
            for bind in expression["morphTargetBinds"].as_array().unwrap() {
                let mesh = index(&nodes[index(&bind["node"])]["mesh"]);
                for primitive in document["meshes"][mesh]["primitives"].as_array().unwrap() {
                    let targets = primitive["targets"].as_array().unwrap().len();
                    assert!(index(&bind["index"]) < targets, "{name}: {bind} of {targets}");
                }
            }
        }
    }
}

fn check_springs(document: &Value, nodes: usize, parents: &[Option<usize>]) {
    let Some(springs) = document.pointer("/extensions/VRMC_springBone") else { return };
    let list = |value: &Value, name: &str| value.get(name).and_then(Value::as_array).cloned().unwrap_or_default();
    let (colliders, groups) = (list(springs, "colliders"), list(springs, "colliderGroups"));
    for collider in &colliders {
        assert!(index(&collider["node"]) < nodes);
        assert_eq!(collider["shape"].as_object().unwrap().len(), 1, "{collider}");
    }
    for group in &groups {
        assert!(list(group, "colliders").iter().all(|collider| index(collider) < colliders.len()));
    }
    let mut taken = Vec::new();
    for spring in list(springs, "springs") {
        assert!(list(&spring, "colliderGroups").iter().all(|group| index(group) < groups.len()));
        let joints: Vec<usize> = list(&spring, "joints").iter().map(|joint| index(&joint["node"])).collect();
        for pair in joints.windows(2) {
            assert!(is_above(parents, pair[0], pair[1]), "{spring}: {pair:?}");
        }
        if let Some(center) = spring.get("center") {
            assert!(index(center) == joints[0] || is_above(parents, index(center), joints[0]), "{spring}");
        }
        taken.extend(joints);
    }
    let count = taken.len();
    taken.sort_unstable();
    taken.dedup();
    assert_eq!(taken.len(), count, "a joint is in two springs");
}

/// The table finds what is wrong.
#[test]
fn the_rules_find_faults() {
    let bone = |node: usize| serde_json::json!({ "node": node });
    let mut human = serde_json::Map::new();
    let mut nodes: Vec<Value> = Vec::new();
    for (name, about) in bones().iter().filter(|(_, bone)| bone.is_required) {
        human.insert(name.clone(), bone(nodes.len()));
        nodes.push(serde_json::json!({ "name": name, "above": about.above }));
    }
    // Each bone below the nearest one of those that there are.
    let known = bones();
    let place = |name: &str| nodes.iter().position(|node| node["name"] == name);
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    for (at, node) in nodes.iter().enumerate() {
        let mut above = node["above"].as_str().unwrap();
        while !above.is_empty() && place(above).is_none() {
            above = &known[above].above;
        }
        if let Some(parent) = place(above) {
            children[parent].push(at);
        }
    }
    let nodes: Vec<Value> = children.iter().map(|children| serde_json::json!({ "children": children })).collect();
    let right = serde_json::json!({
        "extensionsUsed": ["VRMC_vrm"],
        "nodes": nodes,
        "extensions": { "VRMC_vrm": {
            "specVersion": "1.0",
            "meta": { "name": "a", "authors": ["b"], "licenseUrl": "https://vrm.dev/licenses/1.0/" },
            "humanoid": { "humanBones": human },
        } },
    });
    check_avatar(&right);
    let hips = place("hips").unwrap();
    let faults: [(&str, Value); 8] = [
        ("/extensions/VRMC_vrm/specVersion", "2.0".into()),
        ("/extensions/VRMC_vrm/meta/authors", Value::Array(Vec::new())),
        ("/extensions/VRMC_vrm/meta/name", Value::Null),
        ("/extensions/VRMC_vrm/humanoid/humanBones/head", bone(hips)),
        ("/extensions/VRMC_vrm/humanoid/humanBones/hips", bone(99)),
        ("/extensions/VRMC_vrm/humanoid/humanBones", serde_json::json!({})),
        ("/extensionsUsed", Value::Array(Vec::new())),
        ("/nodes/3", serde_json::json!({ "scale": [1, 1, 2] })),
    ];
    for (place, value) in faults {
        let mut wrong = right.clone();
        *wrong.pointer_mut(place).unwrap() = value;
        assert!(std::panic::catch_unwind(|| check_avatar(&wrong)).is_err(), "{place}");
    }
}
