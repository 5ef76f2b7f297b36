//! References to nodes: their text form, names beside uids, and references inside parameters of any module.

use rigsmith::rig::{
    GroupData, JointData, NodeRef, NodeRefs, Rig, RigEdit, Tag, TagKind, Uid,
    reference::{GroupScope, NodeTypes, Pick, PickAt, RigScope, Source, Top},
};

const ARM: Uid = Uid(0x0123_4567_89ab_cdef);
const HAND: Uid = Uid(0xaa);
const OTHER_HAND: Uid = Uid(0xab);
const ODD: Uid = Uid(0xac);
const GROUP: Uid = Uid(0xb0);
const CONTROL: Uid = Uid(0xc0);
const OTHER_CONTROL: Uid = Uid(0xc1);
const HANDLE: Uid = Uid(0xc2);

fn command(uid: Uid, module: &str, params: &str) -> Tag {
    let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
    Tag { uid, enabled: true, comment: String::new(), kind }
}

fn rig() -> Rig {
    let mut rig = Rig::new(Uid(1), "body");
    let color = [0.0; 3];
    rig.apply(&RigEdit::AddLocalGroup(GroupData { uid: GROUP, name: "arm_l".into(), color, enabled: true }, 0))
        .unwrap();
    let joint = |uid, label: &str, tags| JointData { uid, label: Some(label.into()), tags, ..Default::default() };
    let add = |rig: &mut Rig, joint, parent| {
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 9 }).unwrap();
    };
    add(
        &mut rig,
        JointData { group: Some(GROUP), ..joint(ARM, "upper_arm_l", vec![command(HANDLE, "ik_handle", "()")]) },
        None,
    );
    add(
        &mut rig,
        joint(HAND, "hand_l", vec![command(CONTROL, "control", "(creation: (label: Some(\"grip\")))")]),
        Some(ARM),
    );
    add(&mut rig, joint(OTHER_HAND, "hand_r", vec![command(OTHER_CONTROL, "control", "(name: \"label\")")]), Some(ARM));
    add(&mut rig, joint(ODD, "it's \"odd\"\n#+:", Vec::new()), Some(ARM));
    rig
}

#[test]
fn the_text_form_shows_names_and_the_uid_wins() {
    let rig = rig();
    let at = |places: &[PickAt]| Pick::List(places.to_vec());
    let table: [(&str, NodeRefs, &str); 14] = [
        ("@this", NodeRef::this().into(), "@this"),
        (" @ Joint hand_l", NodeRef::joint(HAND).into(), "@joint hand_l#00000000000000aa"),
        ("@joint wrong#00000000000000ab", NodeRef::joint(OTHER_HAND).into(), "@joint hand_r#00000000000000ab"),
        ("@joint \"upper_arm_l\" #0123456789ABCDEF", NodeRef::joint(ARM).into(), "@joint upper_arm_l#0123456789abcdef"),
        ("@joint #00000000000000ff", NodeRef::joint(Uid(0xff)).into(), "@joint #00000000000000ff"),
        (
            "@joint 'it\\'s \\u{22}odd\"\\n#+:'",
            NodeRef::joint(ODD).into(),
            "@joint 'it\\'s \"odd\"\\n#+:'#00000000000000ac",
        ),
        ("@hierarchy", Source::Hierarchy(Top::This).into(), "@hierarchy this"),
        (
            "@hierarchy this + any",
            NodeRefs(vec![Source::Hierarchy(Top::This).into(), Source::Any.into()]),
            "@hierarchy this + @any",
        ),
        (
            "@hierarchy upper_arm_l",
            Source::Hierarchy(Top::Joint(ARM)).into(),
            "@hierarchy upper_arm_l#0123456789abcdef",
        ),
        (
            "@command ik_handle role:offset",
            NodeRef::command(HANDLE).with_role("offset").into(),
            "@command ik_handle/upper_arm_l#00000000000000c2 role:offset",
        ),
        ("@command control/hand_r", NodeRef::command(OTHER_CONTROL).into(), "@command control/hand_r#00000000000000c1"),
        (
            "@joints label : hand_l pick: end,2, start group:arm_l type:Control,joint",
            NodeRef {
                group: GroupScope::Group(GROUP),
                label: Some(HAND),
                types: NodeTypes::JOINT | NodeTypes::CONTROL,
                pick: at(&[PickAt::End, PickAt::Number(2), PickAt::Start]),
                ..Source::Joints.into()
            }
            .into(),
            "@joints group:arm_l#00000000000000b0 label:hand_l#00000000000000aa type:joint,control pick:END,2,START",
        ),
        (
            "@module 'my module' rig:body group:own label:grip role:'' pick:none",
            NodeRef {
                rig: RigScope::Rig(Uid(1)),
                group: GroupScope::Own,
                label: Some(CONTROL),
                role: Some(String::new()),
                pick: at(&[]),
                ..NodeRef::module("my module")
            }
            .into(),
            "@module 'my module' rig:body#0000000000000001 group:own label:grip#00000000000000c0 role:'' pick:none",
        ),
        ("@none", NodeRefs::NONE, "@none"),
    ];
    for (text, meant, canonical) in table {
        let read = NodeRefs::parse(text, &rig);
        assert_eq!(read.as_ref(), Ok(&meant), "{text}");
        assert_eq!(meant.to_text(&rig), canonical);
        assert_eq!(canonical.parse(), Ok(meant.clone()), "with uids beside them, names are not needed");
        let bare = meant.to_string();
        assert_eq!(bare.parse(), Ok(meant.clone()), "{bare}");
        let ron = ron::to_string(&meant).unwrap();
        assert_eq!(ron::from_str::<NodeRefs>(&ron).unwrap(), meant);
    }
}
