//! Values with a side: what tags say on the other side of the character, and that both sides move alike.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    sync::Arc,
};

use bevy::{
    math::{EulerRot, Quat, Vec3},
    reflect::{TypeInfo, enums::VariantInfo},
};
use rigsmith::{
    files::{RealDisk, load_template},
    modules,
    processor::{Amount, Builder},
    rig::{
        JointData, NodeType, PoseOffset, RestTransform, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
        label::mirrored_label,
        operations::{Operation, PasteTo, PasteWhat, TagClipboard, TagOperation, TagScope},
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

/// For each module with sided parameters: parameters in which each of those has a value with a side, and what they are
/// on the other side.
const SIDED: &[(&str, &str, &str)] = &[
    (
        "aim",
        "(aim: x, up_axis: neg_y, /* up */ direction: (0.5, 1.0, 0.0), weight: 0.5)",
        "(aim: neg_x, up_axis: neg_y, /* up */ direction: (-0.5,1.0,0.0), weight: 0.5)",
    ),
    ("aim", "(aim: z, up_axis: neg_x)", "(aim: z, up_axis: x)"),
    (
        "control",
        "(shape_translate: (0.1, 0.2, 0.3), shape_rotate: (10.0, 20.0, 30.0), color: Some((0.25, 0.55, 1.0)), limits: \
         (rotate: ((Some(1.0), None), (Some(-2.0), Some(3.0)), (None, None))))",
        "(shape_translate: (-0.1,0.2,0.3), shape_rotate: (10.0,-20.0,-30.0), color: COLOR, limits: (rotate: LIMITS))",
    ),
    (
        "driven_key",
        "(driver: \"@this\", driver_channel: TranslateX, keys: [(-1.0, 5.0), (2.0, 0.0)], output: \"@this\", \
         output_channel: RotateX)",
        "(driver: \"@this\", driver_channel: TranslateX, keys: [(-2.0,0.0),(1.0,5.0)], output: \"@this\", \
         output_channel: RotateX)",
    ),
    ("driven_key", "(morph: \"smile_l\")", "(morph: \"smile_r\")"),
    (
        "expression",
        "(text: \"a * 2 + ab\", inputs: [(name: \"a\", node: \"@this\", channel: RotateY)], output_channel: RotateZ)",
        "(text: \"-((-a) * 2 + ab)\", inputs: [(name: \"a\", node: \"@this\", channel: RotateY)], output_channel: RotateZ)",
    ),
    ("ik_fk_switch", "(twist: \"-turn\", prefer: (0.5, 0.0, -1.0))", "(twist: \"turn\", prefer: (-0.5,0.0,-1.0))"),
    ("spline_ik", "(twist: \"turn\")", "(twist: \"-turn\")"),
    (
        "ik_fk_switch",
        "(twist: 30.0, prefer: (0.5, 0.0, -1.0), soft: \"soft\")",
        "(twist: -30.0, prefer: (-0.5,0.0,-1.0), soft: \"soft\")",
    ),
    (
        "ik_handle",
        "(twist: 30.0, prefer: (0.5, 0.0, -1.0), limits: [((1.0, 2.0), (3.0, 4.0), (5.0, None))])",
        "(twist: -30.0, prefer: (-0.5,0.0,-1.0), limits: [((1.0,2.0),(-4.0,-3.0),(None,-5.0))])",
    ),
    ("limit", "(limits: (translate: ((1.0, 2.0), (None, None), (None, None))))", ""),
    ("mirror_joints", "(point: (1.0, 0.0, 0.0), normal: (1.0, 1.0, 0.0))", ""),
    ("morph", "(morph: \"Left Smile\")", "(morph: \"Right Smile\")"),
    ("null", "(translate: (1.0, 2.0, 3.0), rotate: (1.0, 2.0, 3.0))", ""),
    ("orient_joints", "(along: x, up_axis: y, direction: (1.0, 0.0, 0.0))", ""),
    ("pole_vector", "(prefer: (1.0, 0.0, 1.0))", "(prefer: (-1.0,0.0,1.0))"),
    ("reverse_foot", "(up: (0.1, 1.0, 0.0))", "(up: (-0.1,1.0,0.0))"),
    ("space_switch", "(names: [\"hand_l\", \"root\"])", "(names: [\"hand_r\",\"root\"])"),
    ("spline_ik", "(twist: 5.0)", "(twist: -5.0)"),
    ("stretch", "(axis: (1.0, 1.0, 0.0))", "(axis: (-1.0,1.0,0.0))"),
    (
        "cone_reader",
        "(axis: x, towards: (0.5, 1.0, 0.0), output_attribute: \"up_l\")",
        "(axis: neg_x, towards: (-0.5,1.0,0.0), output_attribute: \"up_r\")",
    ),
    ("cone_reader", "(morph: \"arm_l\")", "(morph: \"arm_r\")"),
    (
        "path",
        "(aim: x, up_axis: neg_y, direction: (0.5, 1.0, 0.0))",
        "(aim: neg_x, up_axis: neg_y, direction: (-0.5,1.0,0.0))",
    ),
    ("path", "(aim: z, up_axis: x)", "(aim: z, up_axis: neg_x)"),
    ("piston", "(up_axis: x, direction: (0.5, 1.0, 0.0))", "(up_axis: neg_x, direction: (-0.5,1.0,0.0))"),
    ("rbf_reader", "(poses: [(rotate: (1.0, 2.0, 3.0), attribute: \"up_l\", channel: None, morph: \"\")])", ""),
    ("wheel", "(direction: (0.5, 0.0, 1.0), channel: RotateY, reverse: true)", ""),
];

#[test]
fn every_sided_value_is_mirrored_and_twice_gives_the_first_back() {
    let modules = modules::all();
    for module in modules.iter() {
        let sided: Vec<&str> = module.parameters.iter().filter(|p| p.sided).map(|p| p.name).collect();
        // Without values with a side, and with defaults, nothing changes, to the byte.
        for params in ["()", "( /* nothing */ )"] {
            assert_eq!(module.mirrored(params).unwrap(), params, "{}", module.name);
        }
        let samples: Vec<_> = SIDED.iter().filter(|(name, ..)| *name == module.name).collect();
        assert_eq!(samples.is_empty(), sided.is_empty(), "{}: {sided:?}", module.name);
        for (name, params, expected) in samples {
            let mirrored = module.mirrored(params).unwrap();
            assert_ne!(mirrored, *params, "{name}");
            if !expected.is_empty() && !expected.contains("COLOR") {
                assert_eq!(mirrored, *expected, "{name}");
            }
            module.parse(&mirrored).unwrap();
            // Written the same once both are read: the numbers are, if not the blanks between them.
            let again = module.mirrored(&mirrored).unwrap();
            let plain = |text: &str| text.replace([' ', '\n'], "").replace("Some", "").replace(['(', ')'], "");
            assert_eq!(plain(&again), plain(params), "{name}");
            assert_eq!(module.mirrored(&module.mirrored(&again).unwrap()).unwrap(), again, "{name}");
        }
        for name in sided {
            let is_listed =
                module.parameters.iter().any(|parameter| parameter.name == name && !parameter.doc.is_empty());
            assert!(is_listed, "{}: {name} is no parameter", module.name);
        }
    }
}

/// Fields of parameters whose texts name no attribute of a node. A text in another field that names one is called
/// `attribute` or `SOMETHING_attribute`, and mirrored.
const OTHER_TEXTS: [&str; 8] = ["choices", "label", "morph", "name", "names", "shape", "suffix", "text"];

/// Values of a field, each of which names the attribute `open_l` once; names of fields with other texts go to `others`.
fn naming_values(info: &TypeInfo, field: &str, others: &mut BTreeSet<String>) -> Vec<String> {
    let name = || vec!["\"open_l\"".to_owned()];
    if info.is::<Amount>() {
        return name();
    }
    if info.is::<String>() {
        if field == "attribute" || field.ends_with("_attribute") {
            return name();
        }
        others.insert(field.to_owned());
        return Vec::new();
    }
    let mut found = Vec::new();
    match info {
        TypeInfo::Struct(fields) => {
            for inner in fields.iter() {
                let values = inner.type_info().map(|info| naming_values(info, inner.name(), others));
                found.extend(values.into_iter().flatten().map(|value| format!("({}: {value})", inner.name())));
            }
        }
        TypeInfo::List(list) => {
            let values = list.item_info().map(|info| naming_values(info, field, others));
            found.extend(values.into_iter().flatten().map(|value| format!("[{value}]")));
        }
        TypeInfo::Enum(kinds) => {
            for variant in kinds.iter() {
                let VariantInfo::Tuple(tuple) = variant else { continue };
                for inner in tuple.iter() {
                    let values = inner.type_info().map(|info| naming_values(info, field, others));
                    found.extend(values.into_iter().flatten().map(|value| format!("{}({value})", variant.name())));
                }
            }
        }
        _ => {}
    }
    found
}

/// Every parameter that can name an attribute names the other side's on the other side, whichever module has it.
#[test]
fn every_name_of_an_attribute_is_mirrored() {
    let modules = modules::all();
    let mut others = BTreeSet::new();
    let mut found = Vec::new();
    for module in modules.iter() {
        let TypeInfo::Struct(fields) = module.type_info else { panic!("{} has no fields", module.name) };
        for field in fields.iter() {
            let Some(info) = field.type_info() else { continue };
            for value in naming_values(info, field.name(), &mut others) {
                let params = format!("({}: {value})", field.name());
                let mirrored = module.mirrored(&params).unwrap_or_else(|error| panic!("{}: {error}", module.name));
                // A value with a side is the opposite of the attribute besides.
                let plain = mirrored.replace("\"-open", "\"open");
                assert_eq!(plain, params.replace("open_l", "open_r"), "{}", module.name);
                assert_eq!(module.mirrored(&mirrored).unwrap(), params, "{}", module.name);
                found.push((module.name, field.name()));
            }
        }
    }
    for known in [("orient", "weight"), ("blend", "blend"), ("spring", "motion"), ("ik_fk_switch", "attribute")] {
        assert!(found.contains(&known), "{known:?}");
    }
    for known in [("aim", "weights"), ("expression", "inputs"), ("rbf_reader", "poses")] {
        assert!(found.contains(&known), "{known:?}");
    }
    assert!(found.len() >= 40, "{found:?}");
    let unknown: Vec<&String> = others.iter().filter(|field| !OTHER_TEXTS.contains(&field.as_str())).collect();
    assert!(unknown.is_empty(), "texts in {unknown:?}: do they name attributes?");
    // Numbers have no name, and the opposite of an attribute is that of the other side's.
    let orient = modules.get("orient").unwrap();
    assert_eq!(orient.mirrored("(weight: 0.5)").unwrap(), "(weight: 0.5)");
    assert_eq!(orient.mirrored("(weight: \"-open_l\")").unwrap(), "(weight: \"-open_r\")");
    assert_eq!(orient.mirrored("(weight: \"-l_open\")").unwrap(), "(weight: \"-r_open\")");
    assert_eq!(orient.mirrored("(weight: \"open\")").unwrap(), "(weight: \"open\")");
}

/// A part on both sides: the attribute of each side does there what it does on the other.
#[test]
fn attributes_of_both_sides_of_a_part_do_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let side = "(format: 2, name: \"side\", kind: \"part\", joints: [\
         (label: \"lid_l\", translation: (0.1, 0, 0), tags: [\
         control(creation: (name: \"lid_ctl_l\")), \
         attribute(node: \"@command control/lid_ctl_l role:control\", name: \"open_l\", min: 0.0, max: 1.0), \
         orient(node: \"@joint tip_l\", targets: \"@command control/lid_ctl_l role:control\", \
         control: \"@command control/lid_ctl_l role:control\", weight: \"open_l\")]), \
         (label: \"tip_l\", translation: (0, 0.1, 0))])";
    fs::write(folder.path().join("side.rig.ron"), side).unwrap();
    let path = folder.path().join("both.rig.ron");
    let both = "(format: 2, name: \"both\", joints: [(label: \"body\")], parts: [\
         (part: \"side.rig.ron\", name: \"L\", parent: \"body\"), \
         (part: \"side.rig.ron\", name: \"R\", parent: \"body\", mirror: true)])";
    fs::write(&path, both).unwrap();
    let rig = load_template(&RealDisk, &path).unwrap_or_else(|error| panic!("{error}")).rig;
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
    let node = |name: &str| {
        let mut found = built.nodes.iter().filter(|node| node.kind == NodeType::Control && &*node.name == name);
        found.next().unwrap_or_else(|| panic!("there is no {name}"))
    };
    let has = |control: &str, attribute: &str| node(control).attributes.iter().any(|known| &*known.name == attribute);
    assert!(has("lid_ctl_r", "open_r") && !has("lid_ctl_r", "open_l"), "{:?}", node("lid_ctl_r").attributes);
    for (left, right) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.25)] {
        let mut state = RigState::new(Arc::clone(&program));
        for (side, share) in [("l", left), ("r", right)] {
            let control = node(&format!("lid_ctl_{side}")).uid;
            let rotation = Quat::from_rotation_x(60_f32.to_radians());
            state.set_offset(control, PoseOffset { rotation, ..PoseOffset::default() }).unwrap();
            state.set_attribute(control, &format!("open_{side}"), share).unwrap();
        }
        state.evaluate(0.0);
        for (side, share) in [("l", left), ("r", right)] {
            let tip = rig.find_label(&format!("tip_{side}")).unwrap();
            let turned = state.global(tip).unwrap().rotation.angle_between(Quat::IDENTITY).to_degrees();
            assert!((turned - 60.0 * share).abs() < 0.1, "tip_{side} at {share} is turned by {turned} degrees");
        }
    }
}

const ROOT: Uid = Uid(1);

/// A limb on the left, of joints with frames that are turned anyhow, mirrored to the right.
struct Stage {
    rig: Rig,
    uids: UidSource,
    left: Vec<Uid>,
}

impl Stage {
    fn new() -> Self {
        let mut stage = Self { rig: Rig::new(Uid(0x99), "sides"), uids: UidSource::seeded(3), left: Vec::new() };
        let turned = |x, y, z| Quat::from_euler(EulerRot::XYZ, x, y, z);
        let joints = [
            ("middle", None, Vec3::new(0.0, 1.0, 0.0), Quat::IDENTITY),
            ("a_l", Some(0), Vec3::new(0.3, 0.2, 0.1), turned(0.3, -0.2, 0.9)),
            ("b_l", Some(1), Vec3::new(0.1, 0.5, 0.07), turned(-0.2, 0.4, 0.1)),
            ("c_l", Some(2), Vec3::new(0.05, 0.4, -0.1), turned(0.1, 0.3, -0.5)),
            ("d_l", Some(3), Vec3::new(0.02, 0.35, 0.05), turned(0.2, 0.1, 0.3)),
            ("e_l", Some(0), Vec3::new(0.6, 0.9, 0.4), turned(-0.4, 0.2, 0.1)),
        ];
        let mut made = Vec::new();
        for (label, parent, translation, rotation) in joints {
            let uid = Uid(made.len() as u64 + 1);
            let rest = RestTransform { translation, rotation, ..RestTransform::default() };
            let joint = JointData { uid, label: Some(label.into()), rest, ..JointData::default() };
            let parent = parent.map(|parent: usize| made[parent]);
            stage.rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX }).unwrap();
            made.push(uid);
        }
        Operation::Mirror { joints: vec![ROOT] }.run(&mut stage.rig, &mut stage.uids, None).unwrap();
        stage.left = made.split_off(1);
        stage
    }

    /// Tags of the left, mirrored to the right, as a person does it.
    fn tagged(mut self, tags: &[(&str, &str, &str)]) -> Self {
        for (number, (label, module, params)) in tags.iter().enumerate() {
            let joint = self.rig.find_label(label).unwrap();
            let uid = Uid(0xc000 + number as u64);
            let kind = TagKind::Command { module: (*module).into(), params: (*params).into(), feature: None };
            let tag = TagData { uid, enabled: true, comment: String::new(), kind };
            let edit = RigEdit::AddTag { joint, tag: Box::new(tag), index: usize::MAX };
            self.rig.apply(&edit).unwrap();
        }
        let modules = modules::all();
        let copied = TagClipboard::copy(&self.rig, &TagScope::Joints(self.left.clone()), false, |_| true).unwrap();
        let copied = copied.map_params(|module, params| modules.get(module)?.mirrored(params).ok());
        let paste = TagOperation::Paste { clipboard: copied.into(), what: PasteWhat::Both, to: PasteTo::Mirror };
        Operation::Tags(paste).run(&mut self.rig, &mut self.uids, None).unwrap();
        self
    }

    /// Poses the controls of both sides alike, and compares where the joints are.
    fn check(&self, what: &str) {
        let built =
            Builder::build(&self.rig, &Arc::new(modules::all())).unwrap_or_else(|error| panic!("{what}: {error}"));
        let program = RigProgram::compile(&built, &CompileOptions::default()).unwrap();
        let mut state = RigState::new(Arc::new(program));
        state.evaluate(0.0);
        let mut rest: BTreeMap<Uid, Vec3> = BTreeMap::new();
        for uid in &self.left {
            rest.insert(*uid, state.global(*uid).unwrap().translation);
        }
        let side = |name: &str| mirrored_label(name).map(|_| name.contains("_l"));
        let mut moved = 0.0_f32;
        let mut sides = [0, 0];
        for pose in 0..4 {
            for node in built.nodes.iter().filter(|node| node.kind == NodeType::Control) {
                let Some(is_left) = side(&node.name) else { continue };
                sides[usize::from(is_left)] += 1;
                let t = 0.5 + pose as f32;
                let mut offset = PoseOffset {
                    translation: Vec3::new(0.05 * t, -0.04 * t, 0.03),
                    rotation: Quat::from_euler(EulerRot::XYZ, 0.2 * t, -0.3 * t, 0.25 * t),
                    ..PoseOffset::default()
                };
                if !is_left {
                    offset.translation.x = -offset.translation.x;
                    (offset.rotation.y, offset.rotation.z) = (-offset.rotation.y, -offset.rotation.z);
                }
                state.set_offset(node.uid, offset).unwrap();
                // One value of an attribute moves both sides alike.
                for attribute in node.attributes.iter() {
                    let value = match &*attribute.name {
                        "turn" => 25.0 * t,
                        // Of attributes with a side, those of the control's own.
                        name if side(name) == Some(is_left) => 0.2 * t,
                        _ => continue,
                    };
                    state.set_attribute(node.uid, &attribute.name, value).unwrap();
                }
            }
            state.evaluate(0.0);
            for uid in &self.left {
                let joint = self.rig.joint(*uid).unwrap();
                let left = state.global(*uid).unwrap();
                let right = state.global(joint.data.mirror.unwrap()).unwrap();
                // Origin and the ends of two axes: the right one's X axis is the mirror image turned over.
                for axis in [Vec3::ZERO, Vec3::X, Vec3::Y] {
                    let a = left.translation + left.rotation * axis;
                    let b = right.translation + right.rotation * (axis * Vec3::new(-1.0, 1.0, 1.0));
                    let off = (a * Vec3::new(-1.0, 1.0, 1.0)).distance(b);
                    let label = joint.data.label.as_deref().unwrap_or_default();
                    assert!(off < 1e-5, "{what}, pose {pose}: {label} is {off} from the mirror image ({a} and {b})");
                }
                moved = moved.max(left.translation.distance(rest[uid]));
                let (_, turned, _) = self.rig.rest_global(*uid).to_scale_rotation_translation();
                moved = moved.max(left.rotation.angle_between(turned));
            }
        }
        assert_eq!(sides[0], sides[1], "{what}");
        assert!(moved > 0.01, "{what}: nothing moves");
    }
}

#[test]
fn both_sides_move_alike() {
    let reach = |more: &str| format!("(start: \"@joint #2\", goal: \"@command #c000 role:control\", {more})");
    let uid = |text: &str| {
        text.replace("#c000", "#000000000000c000")
            .replace("#c001", "#000000000000c001")
            .replace("#2", "#0000000000000002")
            .replace("#6", "#0000000000000006")
            .replace("#3", "#0000000000000003")
            .replace("#4", "#0000000000000004")
    };
    let goal = "(parent: \"@joint #0000000000000001\", follow: false, creation: (name: \"goal_l\"))";
    let table: &[(&str, &[(&str, &str, String)])] = &[
        (
            "ccd limits",
            &[
                ("d_l", "control", goal.into()),
                (
                    "d_l",
                    "ik_handle",
                    reach(
                        "end: \"@this\", solver: ccd, iterations: 30, prefer: (0.4, 0.0, 1.0), limits: \
                         [((-10.0, 20.0), (-5.0, 30.0), (0.0, 40.0)), ((-20.0, 5.0), (-30.0, 2.0), (-3.0, 10.0))]",
                    ),
                ),
            ],
        ),
        (
            "twist of two bones",
            &[
                ("c_l", "control", goal.into()),
                ("c_l", "ik_handle", reach("end: \"@this\", twist: 35.0, prefer: (0.4, 0.0, 1.0)")),
            ],
        ),
        (
            "twist of two bones by an attribute",
            &[
                ("c_l", "control", goal.into()),
                ("c_l", "ik_handle", reach("end: \"@this\", twist: \"turn\", prefer: (0.4, 0.0, 1.0)")),
            ],
        ),
        (
            "twist of a curve by the opposite of an attribute",
            &[
                (
                    "a_l",
                    "control",
                    "(at: \"@joint #2 + @joint #3 + @joint #4\", parent: \"@joint #0000000000000001\", hierarchy: false, follow: false, creation: (name: \"p_l\"))".into(),
                ),
                (
                    "c_l",
                    "spline_ik",
                    "(start: \"@joint #2\", end: \"@this\", points: \"@command #c000 role:control\", control: \"@command #c000 role:control pick:START\", twist: \"-turn\")".into(),
                ),
            ],
        ),
        (
            "twist of a curve",
            &[
                (
                    "a_l",
                    "control",
                    "(at: \"@joint #2 + @joint #3 + @joint #4\", parent: \"@joint #0000000000000001\", hierarchy: false, follow: false, creation: (name: \"p_l\"))".into(),
                ),
                (
                    "c_l",
                    "spline_ik",
                    "(start: \"@joint #2\", end: \"@this\", points: \"@command #c000 role:control\", twist: 25.0)".into(),
                ),
            ],
        ),
        (
            "aim",
            &[
                ("e_l", "control", "(creation: (name: \"e_l\"))".into()),
                (
                    "a_l",
                    "aim",
                    "(targets: \"@joint #6\", aim: x, up_axis: neg_y, direction: (0.3, 1.0, 0.2), keep_offset: false)"
                        .into(),
                ),
            ],
        ),
        (
            "orientation of joints",
            &[
                ("a_l", "orient_joints", "(along: x, up_axis: neg_y, direction: (0.3, 0.2, 1.0))".into()),
                ("a_l", "control", "(at: \"@joint #2 + @joint #3\", creation: (name: \"fk_l\"))".into()),
            ],
        ),
        (
            "limits of controls and nodes",
            &[
                (
                    "a_l",
                    "control",
                    "(creation: (name: \"a_l\"), limits: (translate: ((-0.01, 0.02), (None, None), (None, None)), \
                     rotate: ((-5.0, 3.0), (-4.0, 20.0), (-1.0, 9.0))))"
                        .into(),
                ),
                (
                    "a_l",
                    "limit",
                    "(limits: (translate: ((-0.005, 0.01), (-0.01, None), (None, None)), rotate: ((None, None), (-3.0, 10.0), \
                     (None, 4.0))))"
                        .into(),
                ),
            ],
        ),
        (
            "offsets of nulls",
            &[
                ("a_l", "null", "(translate: (0.1, 0.2, 0.3), rotate: (10.0, 20.0, 30.0))".into()),
                (
                    "a_l",
                    "control",
                    "(at: \"@command #c000\", parent: \"@command #c000\", follow: false, creation: (name: \"n_l\"))".into(),
                ),
                ("a_l", "parent", "(targets: \"@command #c001 role:control\")".into()),
            ],
        ),
        (
            "driven keys and expressions",
            &[
                ("a_l", "control", "(at: \"@joint #6\", follow: false, creation: (name: \"e_l\"))".into()),
                ("a_l", "control", "(creation: (name: \"a_l\"))".into()),
                (
                    "a_l",
                    "driven_key",
                    "(driver: \"@command #c000 role:control\", driver_channel: TranslateX, keys: [(-1.0, -50.0), (0.1, 10.0), \
                     (1.0, 90.0)], output: \"@command #c001 role:offset\", output_channel: RotateY)"
                        .into(),
                ),
                (
                    "a_l",
                    "expression",
                    "(text: \"3 + t * 20\", inputs: [(name: \"t\", node: \"@command #c000 role:control\", channel: TranslateX)], \
                     output: \"@command #c001 role:offset\", output_channel: RotateX)"
                        .into(),
                ),
            ],
        ),
        (
            "weight by an attribute of a side",
            &[
                ("a_l", "control", "(at: \"@joint #6\", follow: false, creation: (name: \"e_l\"))".into()),
                (
                    "a_l",
                    "attribute",
                    "(node: \"@command #c000 role:control\", name: \"open_l\", min: 0.0, max: 1.0)".into(),
                ),
                (
                    "a_l",
                    "orient",
                    "(node: \"@joint #3\", targets: \"@command #c000 role:control\", \
                     control: \"@command #c000 role:control\", weight: \"open_l\")"
                        .into(),
                ),
            ],
        ),
        (
            "pole",
            &[
                ("c_l", "control", goal.into()),
                (
                    "a_l",
                    "pole_vector",
                    "(chain: \"@joint #2 + @joint #3 + @joint #4\", prefer: (0.5, 0.1, 1.0))".into(),
                ),
                ("c_l", "ik_handle", reach("end: \"@this\"")),
            ],
        ),
    ];
    for (what, tags) in table {
        let tags: Vec<(&str, &str, String)> =
            tags.iter().map(|(joint, module, params)| (*joint, *module, uid(params))).collect();
        let tags: Vec<(&str, &str, &str)> =
            tags.iter().map(|(joint, module, params)| (*joint, *module, params.as_str())).collect();
        Stage::new().tagged(&tags).check(what);
    }
}

/// Lengths in parameters follow the size of a body; what is no length, and what is left out, stays as it is written.
#[test]
fn lengths_follow_the_body_that_a_template_is_fitted_to() {
    let modules = modules::all();
    let change = rigsmith::processor::Resize { factor: 0.5, floor_factor: 0.25, turn: Quat::from_rotation_x(1.0) };
    let cases = [
        ("control", "( size: 0.5, /* wide */ relative_size: 0.4 )", "( size: 0.25, /* wide */ relative_size: 0.4 )"),
        ("control", "(shape_translate: (0.0, 1.0, 0.0))", "(shape_translate: (0.0,0.5,0.0))"),
        ("null", "(translate: (0.0, 0.0, 2.0))", "(translate: (0.0,0.0,1.0))"),
        ("null", "(world: true, translate: (0.0, 0.0, 2.0))", "(world: true, translate: (0.0,0.0,0.5))"),
        ("twist", "(count: 3)", "(count: 3)"),
        ("control", "()", "()"),
    ];
    for (name, params, expected) in cases {
        let resized = modules.get(name).unwrap().resized(params, &change).unwrap();
        assert_eq!(resized, expected, "{name}");
    }
    let turned = modules.get("null").unwrap().resized("(orient: false, translate: (0.0, 1.0, 0.0))", &change).unwrap();
    assert!(turned.contains("0.27") && turned.contains("0.42"), "along the rig's axes, with them: {turned}");
}
