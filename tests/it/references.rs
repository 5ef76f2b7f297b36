//! References to nodes: their text form, names beside uids, and references inside parameters of any module.

use std::borrow::Cow;

use proptest::prelude::*;
use rigsmith::rig::{
    GroupData, JointData, NodeRef, NodeRefs, NodeType, Rig, RigEdit, TagData, TagKind, Uid,
    reference::{
        GroupScope, NameKind, NameScope, Names, NodeTypes, Pick, PickAt, PickError, RigNames, RigScope, Source, Top,
        bind_names, label_text, map_references, nearest_to_gone, references_in, refresh_names, written_as,
    },
    template::{read_template, write_template},
};

const ARM: Uid = Uid(0x0123_4567_89ab_cdef);
const HAND: Uid = Uid(0xaa);
const OTHER_HAND: Uid = Uid(0xab);
const ODD: Uid = Uid(0xac);
const GROUP: Uid = Uid(0xb0);
const CONTROL: Uid = Uid(0xc0);
const OTHER_CONTROL: Uid = Uid(0xc1);
const HANDLE: Uid = Uid(0xc2);

fn command(uid: Uid, module: &str, params: &str) -> TagData {
    let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
    TagData { uid, enabled: true, comment: String::new(), kind }
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

#[test]
fn mistakes_are_named_with_their_place_and_what_to_do() {
    let rig = rig();
    for (text, at, says) in [
        ("", 0, "starts with \"@\""),
        ("this", 0, "starts with \"@\""),
        ("@", 1, "a source belongs"),
        ("@thsi", 1, "did you mean \"this\"?"),
        ("@joint", 6, "the end where a joint's label belongs"),
        ("@joint type:joint", 7, "`type:joint` where a joint's label belongs"),
        ("@joint hadn_l", 7, "there is no joint \"hadn_l\"; did you mean \"hand_l\""),
        ("@joint zzz", 7, "known are"),
        (
            "@command control",
            9,
            "2 commands are called \"control\"; write control#UID with one of \"#00000000000000c0\"",
        ),
        ("@command control/hand_x", 9, "did you mean \"control/hand_l\" or \"control/hand_r\"?"),
        ("@command control/lable", 9, "did you mean \"control/label\"?"),
        ("@joints group:arm_r", 14, "there is no local group \"arm_r\"; did you mean \"arm_l\"?"),
        ("@joints label:girp", 14, "did you mean \"grip\"?"),
        ("@joints type:jiont", 13, "no type of node; did you mean \"joint\""),
        ("@joints type:joint,", 19, "a type belongs"),
        ("@joints tpye:joint", 8, "no filter; did you mean \"type\"?"),
        ("@joints type joint", 13, "write a filter as KEY:VALUE"),
        ("@joints type:joint type:null", 19, "\"type:\" is there already"),
        ("@joints pick:MIDLE", 13, "did you mean \"MIDDLE\"?"),
        ("@joints pick:99999999999", 13, "too large"),
        ("@joints pick:-1", 13, "no place or number"),
        ("@joint #12", 7, "16 hexadecimal digits"),
        ("@joint 'hand_l", 7, "close it with '"),
        ("@joint 'ha\\qnd'", 10, "is no escape"),
        ("@joint '\\u{110000}'", 8, "is no escape"),
        ("@this + ", 8, "a source belongs"),
        ("@this, @any", 5, "`,` where a filter"),
        ("@this )", 6, "`)` where"),
        ("@none + @this", 6, "`+` where"),
        ("@joint hand_l rig:other", 18, "there is no rig \"other\"; known are \"body\""),
    ] {
        let error = NodeRefs::parse(text, &rig).expect_err(text);
        assert!(error.to_string().contains(says), "{text}: {error}");
        assert_eq!(error.at, at, "{text}: {error}");
    }
    let unbound = "@this + @joint hand_l".parse::<NodeRefs>().unwrap_err();
    assert_eq!(unbound.at, 15);
    assert!(unbound.to_string().contains("the rig has no joint \"hand_l\", or several"), "{unbound}");
    let two = "@this + @any".parse::<NodeRef>().unwrap_err();
    assert!(two.to_string().contains("one reference is needed here, not 2"), "{two}");
    assert_eq!("@this".parse(), Ok(NodeRef::this()));
}

#[test]
fn places_are_counted_from_zero_and_taken_once() {
    use PickAt::{End, Middle, Number, Start};
    let list = |places: &[PickAt]| Pick::List(places.to_vec());
    for (pick, count, expected) in [
        (Pick::All, 3, Ok(vec![0, 1, 2])),
        (Pick::All, 0, Ok(vec![])),
        (list(&[Start, Middle, End]), 5, Ok(vec![0, 2, 4])),
        (list(&[End, Middle, Start]), 2, Ok(vec![1, 0])),
        (list(&[Start, Middle, End]), 1, Ok(vec![0])),
        (list(&[Start, Middle, End]), 0, Ok(vec![])),
        (list(&[Number(3), Number(0), Number(3)]), 4, Ok(vec![3, 0])),
        (list(&[Start, Number(4)]), 4, Err(PickError { number: 4, count: 4 })),
        (list(&[]), 4, Ok(vec![])),
    ] {
        assert_eq!(pick.indices(count), expected, "{pick:?} of {count}");
    }
    let both = NodeTypes::JOINT | NodeType::Null.into();
    assert!(
        both.allows(NodeTypes::NULL) && !both.allows(NodeTypes::CONTROL) && NodeTypes::ANY.allows(NodeTypes::CONTROL)
    );
}

#[test]
fn labels_are_known_by_who_bears_them() {
    let mut rig = rig();
    let label = |rig: &Rig, uid| label_text(rig, uid).map(Cow::into_owned);
    assert_eq!(label(&rig, HAND).as_deref(), Some("hand_l"));
    assert_eq!(label(&rig, CONTROL).as_deref(), Some("grip"), "what the command gives");
    assert_eq!(label(&rig, OTHER_CONTROL).as_deref(), Some("hand_r"), "its joint's, where it gives none");
    assert_eq!(label(&rig, Uid(0xdead)), None);
    let find =
        |rig: &Rig, group, name: &str| rig.find(NameScope { group, ..Default::default() }, NameKind::Label, name);
    // Several joints with one label: the one in the group that the reference names bears it.
    rig.apply(&RigEdit::SetLabel(ARM, Some("hand_l".into()))).unwrap();
    rig.apply(&RigEdit::SetParent { joint: OTHER_HAND, parent: None, index: 0 }).unwrap();
    rig.apply(&RigEdit::SetLabel(OTHER_HAND, Some("hand_l".into()))).unwrap();
    assert_eq!(find(&rig, GroupScope::Any, "hand_l"), [OTHER_HAND]);
    assert_eq!(find(&rig, GroupScope::Group(GROUP), "hand_l"), [ARM]);
    // Renaming breaks nothing.
    let refs: NodeRefs = NodeRef::from(Source::Joints).labelled(HAND).into();
    rig.apply(&RigEdit::SetLabel(HAND, Some("paw".into()))).unwrap();
    assert_eq!(refs.to_text(&rig), "@joints label:paw#00000000000000aa");
}

#[test]
fn names_are_looked_up_in_the_rig_that_is_named() {
    let own = rig();
    let mut other = Rig::new(Uid(2), "car");
    let wheel = JointData { uid: Uid(0xee), label: Some("hand_l".into()), ..Default::default() };
    other.apply(&RigEdit::AddJoint { joint: Box::new(wheel), parent: None, index: 0 }).unwrap();
    let names = RigNames { own: &own, others: &[&other] };
    assert_eq!(NodeRefs::parse("@joint hand_l", &names), Ok(NodeRef::joint(HAND).into()));
    let in_car = NodeRefs::parse("@joint hand_l rig:car", &names).unwrap();
    assert_eq!(in_car, NodeRef { rig: RigScope::Rig(Uid(2)), ..NodeRef::joint(Uid(0xee)) }.into());
    assert_eq!(in_car.to_text(&names), "@joint hand_l#00000000000000ee rig:car#0000000000000002");
    let error = NodeRefs::parse("@joint hand_r rig:car", &names).unwrap_err();
    assert!(error.to_string().contains("did you mean \"hand_l\"?"), "{error}");
}

/// References in every place where RON allows a string, and none where it does not.
const PARAMS: &str = r###"(
    // a comment with "@this"
    a: "@this", /* "@any" /* "@any" */ */ b: Some("@joint old#00000000000000aa"),
    c: [r"@joint old#00000000000000aa", r##"@command "x"#00000000000000c0"##, 'c', '"', "no @this"],
    d: {"@\u{6a}oints group:g#00000000000000b0": "@nonsense"}, "@joint hand_r": b"@this", e: br"@any",
    f: "@joint it\\'s", g: "@joint 'it\\'s' + @this",
)"###;

#[test]
fn references_are_found_in_parameters_of_any_module() {
    let found: Vec<_> = references_in(PARAMS).collect();
    let texts: Vec<&str> = found.iter().map(|found| found.text.as_str()).collect();
    let expected = [
        "@this",
        "@joint old#00000000000000aa",
        "@joint old#00000000000000aa",
        "@command \"x\"#00000000000000c0",
        "@joints group:g#00000000000000b0",
        "@nonsense",
        "@joint hand_r",
        "@joint it\\'s",
        "@joint 'it\\'s' + @this",
    ];
    assert_eq!(texts, expected);
    for found in &found {
        let literal = &PARAMS[found.range.clone()];
        assert!(literal.ends_with(['"', '#']) && literal.starts_with(['"', 'r']), "{literal}");
    }
    assert_eq!(found[3].references, Ok(NodeRef::command(CONTROL).into()));
    assert!(found[5].references.is_err() && found[6].references.is_err());
}

#[test]
fn changing_references_leaves_all_else_to_the_byte() {
    assert_eq!(map_references(PARAMS, |_| {}), PARAMS);
    let changed = map_references(PARAMS, |reference| {
        for (_, uid) in reference.uids_mut().filter(|(kind, _)| *kind == NameKind::Joint) {
            *uid = OTHER_HAND;
        }
        if reference.source == Source::This {
            reference.source = Source::Any;
        }
    });
    let expected = PARAMS
        .replace("a: \"@this\"", "a: \"@any\"")
        .replace("@joint old#00000000000000aa", "@joint #00000000000000ab");
    assert_eq!(changed, expected);
    // A name stays beside the uid that it stood beside.
    let text = "(\"@joint old#00000000000000aa + @this\")";
    let changed = map_references(text, |reference| reference.types = NodeTypes::JOINT);
    assert_eq!(changed, "(\"@joint old#00000000000000aa type:joint + @this type:joint\")");
}

#[test]
fn names_are_made_current_and_uids_put_beside_them() {
    let rig = rig();
    let refreshed = refresh_names(PARAMS, &rig);
    let expected = PARAMS
        .replace("@joint old#", "@joint hand_l#")
        .replace("@command \"x\"#", "@command control/hand_l#")
        .replace("\"@\\u{6a}oints group:g#", "\"@joints group:arm_l#");
    assert_eq!(refreshed, expected);
    assert_eq!(refresh_names(&refreshed, &rig), refreshed);
    let gone = "(\"@joint gone#00000000000000ff\")";
    assert_eq!(refresh_names(gone, &rig), gone, "a trace of what was meant");

    let (bound, bad) = bind_names(PARAMS, &rig);
    assert!(bound.contains("\"@joint hand_r#00000000000000ab\": b\"@this\""), "{bound}");
    let bad: Vec<String> = bad.iter().map(|bad| bad.to_string()).collect();
    assert_eq!(bad.len(), 2, "{bad:?}");
    assert!(bad[0].contains("`@joint it\\'s`") && bad[1].contains("no joint \"it's\""), "{bad:?}");
    let (bound, bad) = bind_names("(t: \"@joint hand_l type:joint + @command ik_handle\")", &rig);
    assert_eq!(bad, []);
    assert_eq!(
        bound,
        "(t: \"@joint hand_l#00000000000000aa type:joint + @command ik_handle/upper_arm_l#00000000000000c2\")"
    );
}

#[test]
fn errors_can_quote_what_is_written_and_say_what_is_gone() {
    let mut rig = rig();
    let params = "(goal: \"@joint hand_l#00000000000000aa role:offset\")";
    let refs: NodeRefs = NodeRef::joint(HAND).with_role("offset").into();
    assert_eq!(written_as(params, &refs), "@joint hand_l#00000000000000aa role:offset");
    assert_eq!(written_as("()", &refs), "@joint #00000000000000aa role:offset");
    assert_eq!(nearest_to_gone(params, &refs, &rig), "");
    rig.apply(&RigEdit::RemoveJoint(HAND)).unwrap();
    let said = nearest_to_gone(params, &refs, &rig);
    assert!(said.starts_with("; the joint \"hand_l\" is gone; did you mean \"hand_r\""), "{said}");
}

#[test]
fn templates_show_current_names_and_bind_names_without_uids() {
    let mut rig = rig();
    let tag = command(Uid(0xd0), "aim", "(target: \"@joint hand_l#00000000000000aa\", up: \"@joint 'no one'\")");
    rig.apply(&RigEdit::AddTag { joint: ARM, tag: Box::new(tag), index: 9 }).unwrap();
    rig.apply(&RigEdit::SetLabel(HAND, Some("left \"paw\"".into()))).unwrap();
    let text = write_template(&rig);
    assert!(text.contains("target: \"@joint 'left \\\"paw\\\"'#00000000000000aa\""), "{text}");
    let read = read_template(text.as_bytes()).unwrap();
    assert_eq!(write_template(&read.rig), text);
    assert_eq!(read_template(text.as_bytes()).unwrap().rig, read.rig);
    let [note] = read.notes.as_slice() else { panic!("{:?}", read.notes) };
    assert!(note.contains("aim 00000000000000d0 on joint upper_arm_l"), "{note}");
    assert!(note.contains("no joint \"no one\""), "{note}");

    let by_hand = text.replace("@joint 'left \\\"paw\\\"'#00000000000000aa", "@joint hand_r");
    assert_ne!(by_hand, text);
    let read = read_template(by_hand.replace("'no one'", "hand_r").as_bytes()).unwrap();
    let written = write_template(&read.rig);
    assert!(written.contains("target: \"@joint hand_r#00000000000000ab\""), "{written}");
    assert_eq!(read_template(written.as_bytes()).unwrap().rig, read.rig);
}

/// Gives every uid a name that breaks careless writers.
struct Odd(Vec<String>);

impl Names for Odd {
    fn name_of(&self, _: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.0.get(uid.0 as usize % (self.0.len() + 1)).map(|name| Cow::Borrowed(name.as_str()))
    }

    fn find(&self, _: NameScope, _: NameKind, _: &str) -> Vec<Uid> {
        Vec::new()
    }

    fn all(&self, _: NameScope, _: NameKind) -> Vec<Cow<'_, str>> {
        Vec::new()
    }
}

fn references() -> impl Strategy<Value = NodeRefs> {
    let uid = || any::<u64>().prop_map(Uid);
    let text = || prop_oneof!["[a-z_./-]{0,6}", any::<String>(), Just("any".to_owned()), Just("@this".to_owned())];
    let source = prop_oneof![
        Just(Source::Any),
        Just(Source::This),
        Just(Source::Root),
        Just(Source::Joints),
        Just(Source::Hierarchy(Top::This)),
        uid().prop_map(Source::Joint),
        uid().prop_map(Source::Input),
        uid().prop_map(|uid| Source::Hierarchy(Top::Joint(uid))),
        uid().prop_map(Source::Command),
        text().prop_map(Source::Module),
    ];
    let rig = proptest::option::of(uid()).prop_map(|uid| uid.map_or(RigScope::Own, RigScope::Rig));
    let group = prop_oneof![Just(GroupScope::Any), Just(GroupScope::Own), uid().prop_map(GroupScope::Group)];
    let types = proptest::collection::vec(0..NodeTypes::NAMES.len(), 0..3)
        .prop_map(|kinds| kinds.into_iter().fold(NodeTypes::ANY, |types, kind| types | NodeTypes::NAMES[kind].1));
    let place = prop_oneof![
        Just(PickAt::Start),
        Just(PickAt::Middle),
        Just(PickAt::End),
        any::<u32>().prop_map(PickAt::Number)
    ];
    let pick = proptest::option::of(proptest::collection::vec(place, 0..4))
        .prop_map(|places| places.map_or(Pick::All, Pick::List));
    let role = proptest::option::of(text());
    let one = (rig, group, proptest::option::of(uid()), types, source, role, pick).prop_map(
        |(rig, group, label, types, source, role, pick)| NodeRef { rig, group, label, types, source, role, pick },
    );
    proptest::collection::vec(one, 0..4).prop_map(NodeRefs)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_reference_comes_back_from_its_text(
        references in references(),
        names in proptest::collection::vec(any::<String>(), 0..4),
    ) {
        let names = Odd(names);
        for text in [references.to_string(), references.to_text(&names)] {
            prop_assert!(!text.contains('\n'), "{}", text);
            prop_assert_eq!(text.parse::<NodeRefs>(), Ok(references.clone()), "{}", text);
            // As a parameter: found, left alone, and named anew without a change of meaning.
            let params = format!("(before: \"x\", list: [{}], after: 1)", ron::to_string(&text).unwrap());
            let found: Vec<_> = references_in(&params).collect();
            prop_assert_eq!(found.len(), 1);
            prop_assert_eq!(&found[0].references, &Ok(references.clone()));
            prop_assert_eq!(map_references(&params, |_| {}), params.clone());
            let named = refresh_names(&params, &names);
            let again = references_in(&named).next().map(|found| found.references);
            prop_assert_eq!(again, Some(Ok(references.clone())));
            prop_assert_eq!(refresh_names(&named, &names), named.clone());
            prop_assert!(named.starts_with("(before: \"x\", list: [") && named.ends_with("], after: 1)"));
        }
    }

    #[test]
    fn nonsense_is_refused_with_a_place_in_it(
        text in "@?[a-z@#+:,'\"\\\\{}0-9 \u{e9}]{0,24}",
        joined in "[(\\[\"@'/*#rb \\\\tjo]{0,40}",
    ) {
        let rig = rig();
        for text in [text.clone(), format!("@joint {text}"), format!("@this {text}")] {
            if let Err(error) = NodeRefs::parse(&text, &rig) {
                prop_assert!(error.at <= text.len() && text.is_char_boundary(error.at), "{}", error);
            }
        }
        for params in [&text, &joined] {
            prop_assert_eq!(&map_references(params, |_| {}), params);
            let _ = (refresh_names(params, &rig), bind_names(params, &rig));
        }
    }
}
