//! Values with a side: what tags say on the other side of the character, and that both sides move alike.

mod movement;

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
        operations::{Operation, PasteContent, PasteTo, TagClipboard, TagOperation, TagScope},
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
        "(axes_rotate: (90.0, 10.0, 20.0), shape_translate: (0.1, 0.2, 0.3), shape_rotate: (10.0, 20.0, 30.0), color: Some((0.25, 0.55, 1.0)), limits: \
         (rotate: ((Some(1.0), None), (Some(-2.0), Some(3.0)), (None, None))))",
        "(axes_rotate: (90.0,-10.0,-20.0), shape_translate: (-0.1,0.2,0.3), shape_rotate: (10.0,-20.0,-30.0), color: COLOR, limits: (rotate: LIMITS))",
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
