//! Movement of both sides of a rig, and lengths of a template that is fitted to a body.

use super::*;

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
        let paste = TagOperation::Paste { clipboard: copied.into(), what: PasteContent::Both, to: PasteTo::Mirror };
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

    // Axes of the rig turn with the figure, those of nodes follow their joints.
    let lying = rigsmith::processor::Resize {
        factor: 1.0,
        floor_factor: 1.0,
        turn: Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
    };
    let cases = [
        ("null", "(orient: false)", "rotate:(90.0,0.0,0.0)"),
        ("null", "(world: true)", "(world:true)"),
        ("control", "(axes: rig)", "axes_rotate:(90.0,0.0,0.0)"),
        ("control", "(shape_axes: rig, axes_rotate: (-90.0, 0.0, 0.0))", "axes_rotate:(0.0,0.0,0.0)"),
        ("control", "(follow: false)", "(follow:false)"),
    ];
    for (name, params, expected) in cases {
        let resized = modules.get(name).unwrap().resized(params, &lying).unwrap().replace(' ', "");
        assert!(resized.contains(expected), "{name} {params}: {resized}");
    }
}
