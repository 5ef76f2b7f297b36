//! Parts that are dropped onto joints and strokes, and their options.

use rigsmith::editor::library::PartSides;

use super::*;

#[test]
fn a_part_of_a_search_path_is_dropped_onto_a_joint() {
    let mut studio = Studio::new(Both::default());
    studio.settle();
    let before = studio.desk.rig().clone();
    let steps = studio.desk.steps().1;
    let [from, to] = ["Part limb", "arm_l"].map(|label| studio.desk.find(label).rect.center());
    studio.desk.drag(from, to);
    studio.settle();
    assert_eq!(studio.desk.steps().1, steps + 1, "{:?}", studio.desk.told());
    let [part] = studio.desk.rig().dropped_parts() else { panic!("{:?}", studio.desk.rig().dropped_parts()) };
    let expected = vec![studio.joint("arm_l"), studio.joint("elbow_l")];
    assert_eq!((part.part.as_str(), &part.joints, part.mirror), ("limbs/limb.rig.ron", &expected, false));
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
    // On the other side it is the mirror image.
    let to = studio.desk.find("arm_r").rect.center();
    studio.desk.drag(from, to);
    studio.settle();
    assert!(studio.desk.rig().dropped_parts()[0].mirror);
    studio.change(Change::Undo);
    // Whatever is no part is merged below the joint.
    let from = studio.desk.find("Template tall man").rect.center();
    studio.desk.drag(from, to);
    studio.settle();
    assert_eq!(studio.desk.rig().len(), 10, "{:?}", studio.desk.told());
    let hips = studio.joint("tall_man_hips");
    assert_eq!(studio.desk.parent(hips), Some(studio.joint("arm_r")));
    // Let go beside the joints it does nothing.
    let steps = studio.desk.steps().1;
    studio.desk.drag(from, to + egui::vec2(0.0, 600.0));
    studio.settle();
    assert_eq!(studio.desk.steps().1, steps);
}

#[test]
fn a_part_is_dropped_onto_a_joint_in_the_viewport() {
    let mut studio = Studio::with(Sheet::Window);
    let plane = ViewPlane::orthographic(View::Front, [Vec3::splat(-3.0), Vec3::splat(3.0)]);
    let sight = Sight { plane, pixel: 0.01, size: Vec2::new(620.0, 1400.0) };
    studio.desk.app.insert_resource(ViewportSight(Some(sight)));
    studio.desk.frames(2);
    let at = sight.project(studio.desk.rig().position(studio.joint("arm_r"))).unwrap();
    let (from, joint) = (egui::pos2(20.0, 1300.0), egui::pos2(at.x, at.y));
    let drop = |studio: &mut Studio, to: egui::Pos2| {
        studio.desk.press(from);
        let dragged = DraggedTemplate { place: studio.limb(), name: "limb".to_owned() };
        egui::DragAndDrop::set_payload(&studio.desk.ctx, dragged);
        studio.desk.move_to(to);
        studio.desk.release(to);
        studio.settle();
    };
    drop(&mut studio, joint + egui::vec2(0.0, 500.0));
    assert!(
        studio.desk.rig().dropped_parts().is_empty() && studio.told("there is no joint"),
        "{:?}",
        studio.desk.told()
    );
    drop(&mut studio, joint + egui::vec2(6.0, 4.0));
    let [part] = studio.desk.rig().dropped_parts() else { panic!("{:?}", studio.desk.told()) };
    assert_eq!((part.joints[0], part.mirror), (studio.joint("arm_r"), true));
}

#[test]
fn a_module_is_dropped_onto_a_joint_in_the_viewport() {
    let mut studio = Studio::with(Sheet::Window);
    let plane = ViewPlane::orthographic(View::Front, [Vec3::splat(-3.0), Vec3::splat(3.0)]);
    let sight = Sight { plane, pixel: 0.01, size: Vec2::new(620.0, 1400.0) };
    studio.desk.app.insert_resource(ViewportSight(Some(sight)));
    studio.desk.frames(2);
    let arm = studio.joint("arm_r");
    let at = sight.project(studio.desk.rig().position(arm)).unwrap();
    let joint = egui::pos2(at.x, at.y);
    let drop = |studio: &mut Studio, to: egui::Pos2| {
        studio.desk.press(egui::pos2(20.0, 1300.0));
        egui::DragAndDrop::set_payload(&studio.desk.ctx, DraggedModule("null"));
        studio.desk.move_to(to);
        studio.desk.release(to);
        studio.settle();
    };
    let tags = |studio: &Studio| studio.desk.rig().joint(arm).unwrap().data.tags.len();
    let (before, steps, count) = (studio.desk.rig().clone(), studio.desk.steps().1, tags(&studio));
    drop(&mut studio, joint + egui::vec2(0.0, 500.0));
    assert!(*studio.desk.rig() == before && studio.told("there is no joint"), "{:?}", studio.desk.told());
    drop(&mut studio, joint + egui::vec2(6.0, 4.0));
    assert_eq!((tags(&studio), studio.desk.steps().1), (count + 1, steps + 1), "{:?}", studio.desk.told());
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
}

#[test]
fn a_part_goes_onto_the_stroke_that_was_just_drawn() {
    let mut studio = Studio::new(TagsPanel::default());
    let hips = studio.joint("hips");
    let positions = vec![Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.8, 1.0, 0.0)];
    studio.desk.edit(Operation::Chain { positions, parent: Some(hips) });
    let end = studio.desk.selected().to_vec();
    assert_eq!(end.len(), 1, "a stroke selects its end");
    let steps = studio.desk.steps().1;
    studio.click("Part");
    studio.desk.until("the parts", |desk| desk.look("Part limb").is_some());
    assert!(studio.desk.look("Part arm").is_some() && studio.desk.look("Template man").is_none(), "parts alone");
    studio.click("Part limb");
    assert_eq!(studio.desk.steps().1, steps + 1, "{:?}", studio.desk.told());
    let part = &studio.desk.rig().dropped_parts()[0];
    assert_eq!(part.joints, [studio.desk.parent(end[0]).unwrap(), end[0]]);
    // What takes more joints than there are is refused with the reason, and changes nothing.
    let text = studio.text();
    studio.act(TemplatePlace::Bundled("parts/arm.rig.ron"), LibraryAct::Part { joints: end, options: Vec::new() });
    assert_eq!(studio.text(), text);
    assert!(studio.told("needs"), "{:?}", studio.desk.told());
}

#[test]
fn a_part_over_other_commands_is_told_once_it_is_there() {
    let mut studio = Studio::new(LoaderPanel::default());
    let [hips, arm, elbow] = ["hips", "arm_l", "elbow_l"].map(|label| studio.joint(label));
    let onto = |studio: &mut Studio, joints: Vec<Uid>| {
        let place = studio.limb();
        studio.act(place, LibraryAct::Part { joints, options: Vec::new() });
    };
    // One joint is too few, which is refused.
    let one = LibraryAct::Part { joints: vec![elbow], options: Vec::new() };
    studio.act(TemplatePlace::Bundled("parts/arm.rig.ron"), one);
    assert!(studio.desk.rig().dropped_parts().is_empty(), "{:?}", studio.desk.told());
    assert!(!studio.told("was added to joints"), "{:?}", studio.desk.told());
    onto(&mut studio, vec![hips, arm]);
    assert_eq!(studio.desk.rig().dropped_parts().len(), 1, "{:?}", studio.desk.told());
    let own = "Limb was added to joints that have 1 command of their own, which stays";
    assert!(studio.told(own), "{:?}", studio.desk.told());
}

#[test]
fn options_of_a_part_are_set_in_its_card() {
    let mut studio = Studio::new(LoaderPanel::default());
    let arm = studio.joint("arm_l");
    studio.desk.select(&[arm]);
    studio.settle();
    studio.click("Part limb");
    for told in ["Sockets: end on lower_l", "An upper and a lower bone.", "Features: fk"] {
        assert!(studio.desk.says(told), "{told} is not among {:?}", studio.desk.seen);
    }
    assert!(studio.desk.look("Option size").is_some());
    studio.desk.click("Option size");
    studio.desk.hold(egui::Modifiers::COMMAND);
    studio.desk.key(egui::Key::A);
    studio.desk.hold(egui::Modifiers::NONE);
    studio.desk.type_text("0.75");
    studio.desk.frames(2);
    studio.click("Add part");
    let on_arm = studio.desk.rig().joint(arm).unwrap().data.tags.clone();
    let params = on_arm.iter().find_map(|tag| match &tag.kind {
        TagKind::Command { params, .. } => Some(params.clone()),
        TagKind::Feature { .. } => None,
    });
    assert!(params.as_ref().is_some_and(|params| params.contains("0.75")), "{params:?} {:?}", studio.desk.told());
    // A value that the option does not take is refused.
    let text = studio.text();
    let elbow = studio.joint("elbow_r");
    let options = vec![("weight".to_owned(), "1".to_owned())];
    studio.act(studio.limb(), LibraryAct::Part { joints: vec![elbow], options });
    assert!(studio.text() == text && studio.told("has no option \"weight\""), "{:?}", studio.desk.told());
}

#[test]
fn wrong_numbers_of_options_are_told() {
    let mut studio = Studio::new(LoaderPanel::default());
    let spring = LIMB.replace("name: \"limb\"", "name: \"spring\"");
    let spring = spring.replace("default: 0.5,", "default: 0.5, form: Slider(min: 0.1, max: 2),");
    fs::write(studio.site.join("spring.rig.ron"), spring).unwrap();
    studio.click("List the templates again");
    studio.click("Part spring");
    for (text, words) in [
        ("0.05", "0.05 is none of its numbers; write one from 0.1 to 2"),
        ("3", "3 is none of its numbers; write one from 0.1 to 2"),
        ("much", "\"much\" is no number; write one such as 1.5 or -20"),
    ] {
        studio.desk.click("Option size");
        studio.desk.type_text(text);
        studio.desk.key(egui::Key::Enter);
        studio.desk.frames(3);
        assert_eq!(studio.desk.told().pop(), Some(format!("Option size stays as it was: {words}.")));
    }
    // Both ends are numbers of it.
    let told = studio.desk.told().len();
    for text in ["0.1", "2"] {
        studio.desk.click("Option size");
        studio.desk.type_text(text);
        studio.desk.key(egui::Key::Enter);
        studio.desk.frames(3);
        assert_eq!(studio.desk.find("Option size").value.parse::<f32>(), text.parse());
    }
    assert_eq!(studio.desk.told().len(), told);
}

/// The name by which a template calls a part of a folder.
#[test]
fn parts_are_called_relative_to_the_document_or_the_site() {
    let site = SearchPaths { folders: vec![PathBuf::from("/site")] };
    let cases = [
        ("/home/parts/arm.rig.ron", "parts/arm.rig.ron"),
        ("/site/limbs/arm.rig.ron", "limbs/arm.rig.ron"),
        ("/elsewhere/arm.rig.ron", "../elsewhere/arm.rig.ron"),
    ];
    for (file, name) in cases {
        let place = TemplatePlace::File(PathBuf::from(file));
        assert_eq!(place.part_name(Some(Path::new("/home")), &site), name);
    }
    let elsewhere = TemplatePlace::File(PathBuf::from("/elsewhere/arm.rig.ron"));
    assert_eq!(elsewhere.part_name(None, &site), "/elsewhere/arm.rig.ron");
    assert_eq!(TemplatePlace::Bundled("parts/arm.rig.ron").part_name(None, &site), "parts/arm.rig.ron");
}

/// Two parts of a kind on the same joints wait for each other when they are built: the second one is refused at once.
#[test]
fn a_part_goes_onto_the_same_joints_once() {
    let mut studio = Studio::new(LoaderPanel::default());
    let [arm_l, elbow_l, arm_r] = ["arm_l", "elbow_l", "arm_r"].map(|label| studio.joint(label));
    let onto = |studio: &mut Studio, joints: Vec<Uid>| {
        let place = studio.limb();
        studio.act(place, LibraryAct::Part { joints, options: Vec::new() });
    };
    onto(&mut studio, vec![arm_l]);
    let (text, steps) = (studio.text(), studio.desk.steps());
    for joints in [vec![arm_l], vec![arm_l, elbow_l], vec![elbow_l]] {
        onto(&mut studio, joints.clone());
        assert_eq!((studio.text(), studio.desk.steps()), (text.clone(), steps), "{joints:?}");
    }
    let told = "arm_l belongs to the part \"limb\" already";
    assert!(studio.told(told) && studio.told("delete its tags first"), "{:?}", studio.desk.told());
    // Another joint takes it, and so does the same one once the part is gone.
    onto(&mut studio, vec![arm_r]);
    assert_eq!(studio.desk.rig().dropped_parts().len(), 2, "{:?}", studio.desk.told());
    studio.change(Change::Undo);
    studio.change(Change::Undo);
    assert!(studio.desk.rig().dropped_parts().is_empty());
    onto(&mut studio, vec![arm_l, elbow_l]);
    assert_eq!(studio.desk.rig().dropped_parts().len(), 1, "{:?}", studio.desk.told());
    // With both sides, one side that has the part is enough.
    let both = PartSides::choice(studio.world(), true);
    studio.desk.app.insert_resource(both);
    let steps = studio.desk.steps();
    onto(&mut studio, vec![arm_r]);
    assert_eq!((studio.desk.rig().dropped_parts().len(), studio.desk.steps()), (1, steps));
}

#[test]
fn a_part_does_not_go_onto_joints_that_a_template_or_tags_gave_such_a_part() {
    let mut studio = Studio::new(LoaderPanel::default());
    let home = studio.folder.path().join("home");
    fs::write(home.join("limb.rig.ron"), LIMB).unwrap();
    let parts = "parts: [(part: \"limb.rig.ron\", name: \"left arm\", onto: [\"arm_l\", \"elbow_l\"])],\n    joints: [";
    let armed = home.join("armed.rig.ron");
    fs::write(&armed, MAN.replacen("joints: [", parts, 1).replace("\"man\"", "\"armed\"")).unwrap();
    studio.open(OpenRequest::File(armed));
    studio.desk.until("the followed file", |desk| {
        desk.app.world().get::<RigSource>(desk.rig).is_some_and(|source| source.base().is_some())
    });
    let (arm, text) = (studio.joint("arm_l"), studio.text());
    let place = TemplatePlace::File(home.join("limb.rig.ron"));
    studio.act(place, LibraryAct::Part { joints: vec![arm], options: Vec::new() });
    assert!(studio.told("arm_l belongs to the part \"left arm\" already"), "{:?}", studio.desk.told());
    assert_eq!(studio.text(), text);

    // Tags that are no part any more.
    let joints = studio.desk.chain(&["clavicle_l", "upper_arm_l", "forearm_l", "hand_l"]);
    let place = TemplatePlace::Bundled("parts/arm.rig.ron");
    studio.act(place.clone(), LibraryAct::Inject { joints: joints.clone() });
    let text = studio.text();
    assert!(text.contains("ik_fk_switch"), "{:?}", studio.desk.told());
    studio.act(place, LibraryAct::Part { joints: joints[..1].to_vec(), options: Vec::new() });
    assert!(studio.told("clavicle_l belongs to a part of this kind already"), "{:?}", studio.desk.told());
    assert_eq!(studio.text(), text);
}

/// The window, by both of its ways, and the command line refuse a second part of a kind on the same joints, with the same words.
#[cfg(feature = "cli")]
#[test]
fn a_second_part_is_refused_with_the_same_words_everywhere() {
    use rigsmith::rig::part::OccupiedJoint;

    use crate::cli_outputs::json;

    let mut studio = Studio::new(LoaderPanel::default());
    let home = studio.folder.path().join("home");
    let chain = |labels: [&str; 4]| {
        let joint = |(number, label): (usize, &&str)| match number {
            0 => format!("(label: \"{label}\", translation: (0.1, 1.4, 0))"),
            _ => format!("(label: \"{label}\", parent: \"{}\", translation: (0.3, 0, 0))", labels[number - 1]),
        };
        let joints: Vec<String> = labels.iter().enumerate().map(joint).collect();
        format!("(format: 2, name: \"chain\", joints: [{}])", joints.join(", "))
    };
    let arm_labels = ["clavicle_l", "upper_arm_l", "forearm_l", "hand_l"];
    let parts = "parts: [(part: \"limb.rig.ron\", name: \"left arm\", onto: [\"arm_l\", \"elbow_l\"])],\n    joints: [";
    let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/parts/arm.rig.ron");
    for (name, text) in [
        ("limb.rig.ron", LIMB.to_owned()),
        ("arm.rig.ron", fs::read_to_string(arm).unwrap()),
        ("armed.rig.ron", MAN.replacen("joints: [", parts, 1).replace("\"man\"", "\"armed\"")),
        ("chain.rig.ron", chain(arm_labels)),
    ] {
        fs::write(home.join(name), text).unwrap();
    }
    let inject = |part: &str, rig: &str, joints: &str, output: &str| {
        json(&home, &["inject", part, rig, "--joints", joints, "-o", output])
    };
    let (code, told) = inject("arm.rig.ron", "chain.rig.ron", &arm_labels.join(","), "injected.rig.ron");
    assert_eq!(code, 0, "{told}");

    for (part, rig, labels, name) in [
        ("limb.rig.ron", "armed.rig.ron", &["arm_l", "elbow_l"][..], "the part \"left arm\""),
        ("arm.rig.ron", "injected.rig.ron", &arm_labels[..], "a part of this kind"),
    ] {
        let words = OccupiedJoint { joint: labels[0].to_owned(), part: name.to_owned() }.to_string();
        let (code, told) = inject(part, rig, &labels.join(","), "twice.rig.ron");
        let error = &told["error"];
        let said = format!("{}; {}", error["what"].as_str().unwrap(), error["do"].as_str().unwrap());
        assert_eq!((code, said), (1, words.clone()), "{rig}: {told}");
        assert!(!home.join("twice.rig.ron").exists(), "{rig}");

        studio.open(OpenRequest::File(home.join(rig)));
        studio.desk.until("the followed file", |desk| {
            desk.app.world().get::<RigSource>(desk.rig).is_some_and(|source| source.base().is_some())
        });
        let joints: Vec<Uid> = labels.iter().map(|label| studio.joint(label)).collect();
        let text = studio.text();
        for act in [
            LibraryAct::Part { joints: joints.clone(), options: Vec::new() },
            LibraryAct::Inject { joints: joints.clone() },
        ] {
            let way = format!("{rig}: {act:?}");
            studio.act(TemplatePlace::File(home.join(part)), act);
            let told = studio.desk.told().pop().unwrap_or_default();
            assert!(told.contains(&words), "{way}: {:?}", studio.desk.told());
            assert_eq!(studio.text(), text, "{way}");
        }
    }
    // Other joints take the part.
    let (code, told) = inject("limb.rig.ron", "armed.rig.ron", "arm_r,elbow_r", "other.rig.ron");
    assert_eq!(code, 0, "{told}");
}

/// Adding a part is greyed where the part would be refused: menus say why in a few words, the card in those of the refusal.
#[test]
fn adding_a_part_is_greyed_where_it_would_be_refused() {
    use rigsmith::rig::part::OccupiedJoint;

    let mut studio = Studio::new(LoaderPanel::default());
    let [arm_l, arm_r, elbow_r] = ["arm_l", "arm_r", "elbow_r"].map(|label| studio.joint(label));
    let limb = studio.limb();
    studio.settle();
    let reason = |desk: &Desk| palette::obstacle(desk.app.world(), Action::Library(LibraryAction::Part));
    studio.desk.select(&[arm_l]);
    studio.settle();
    studio.click("Part limb");
    assert!(studio.desk.find("Add part").enabled && reason(&studio.desk).is_none(), "it fits");
    studio.act(limb, LibraryAct::Part { joints: vec![arm_l], options: Vec::new() });
    assert_eq!(studio.desk.rig().dropped_parts().len(), 1, "{:?}", studio.desk.told());
    studio.desk.until("the reason", |desk| reason(desk).is_some());
    assert_eq!(reason(&studio.desk), Some("the selected joints have such a part already"));
    studio.desk.frames(2);
    let button = studio.desk.find("Add part");
    assert!(!button.enabled);
    studio.desk.move_to(button.rect.center());
    studio.desk.frames(60);
    let words = OccupiedJoint { joint: "arm_l".to_owned(), part: "the part \"limb\"".to_owned() }.to_string();
    assert!(studio.desk.says(&words), "{words}: {:?}", studio.desk.seen);
    studio.desk.move_to(egui::pos2(3000.0, 3000.0));
    let steps = studio.desk.steps();
    studio.send(ActionRequest(Action::Library(LibraryAction::Part)));
    assert!(studio.told(&words) && studio.desk.steps() == steps, "{:?}", studio.desk.told());

    for (joints, wanted) in
        [(vec![arm_r], None), (vec![arm_r, elbow_r], None), (Vec::new(), Some("no joint is selected"))]
    {
        studio.desk.select(&joints);
        studio.settle();
        assert_eq!(reason(&studio.desk), wanted, "{joints:?}");
        assert_eq!(studio.desk.find("Add part").enabled, wanted.is_none(), "{joints:?}");
        // What is greyed would be refused, and nothing else.
        if !joints.is_empty() {
            let (place, steps) = (studio.limb(), studio.desk.steps().1);
            studio.act(place, LibraryAct::Part { joints: joints.clone(), options: Vec::new() });
            assert_eq!(studio.desk.steps().1 > steps, wanted.is_none(), "{joints:?}: {:?}", studio.desk.told());
            (steps..studio.desk.steps().1).for_each(|_| studio.change(Change::Undo));
        }
    }
    studio.change(Change::Undo);
    studio.desk.select(&[arm_l]);
    studio.settle();
    assert_eq!(reason(&studio.desk), None, "the part is gone");
}

/// The parts that a rig has of its template are known once the template is read, without a change of the rig.
#[test]
fn a_part_is_refused_by_the_parts_of_the_template_that_the_rig_follows_now() {
    let mut studio = Studio::new(LoaderPanel::default());
    let parts =
        "parts: [(part: \"limbs/limb.rig.ron\", name: \"left arm\", onto: [\"arm_l\", \"elbow_l\"])],\n    joints: [";
    let armed = studio.site.join("armed.rig.ron");
    fs::write(&armed, MAN.replacen("joints: [", parts, 1).replace("\"man\"", "\"armed\"")).unwrap();
    studio.open(OpenRequest::File(armed));
    studio.desk.until("the followed file", |desk| {
        desk.app.world().get::<RigSource>(desk.rig).is_some_and(|source| source.base().is_some())
    });
    let reason = |desk: &Desk| palette::obstacle(desk.app.world(), Action::Library(LibraryAction::Part));
    let arm = studio.joint("arm_l");
    studio.desk.select(&[arm]);
    studio.settle();
    studio.click("Part limb");
    studio.desk.until("the reason", |desk| reason(desk).is_some());
    assert_eq!(reason(&studio.desk), Some("the selected joints have such a part already"));
    // Without the template nothing tells the joints of the part.
    let rig = studio.desk.rig;
    let source = studio.desk.app.world_mut().entity_mut(rig).take::<RigSource>().unwrap();
    assert_ne!(reason(&studio.desk), Some("the selected joints have such a part already"));
    studio.desk.app.world_mut().entity_mut(rig).insert(source);
    assert_eq!(reason(&studio.desk), Some("the selected joints have such a part already"));
}

/// Pictures of the Part menu are greyed where a click would be refused, and say why.
#[test]
fn pictures_of_parts_are_greyed_where_the_part_would_be_refused() {
    use rigsmith::rig::part::OccupiedJoint;

    let mut studio = Studio::new(TagsPanel::default());
    let arm_l = studio.joint("arm_l");
    studio.desk.select(&[arm_l]);
    studio.settle();
    studio.click("Part");
    studio.desk.until("the parts", |desk| desk.look("Part limb").is_some());
    // An arm takes more joints than there are.
    let is_greyed = |desk: &Desk, tile: &str| desk.look(tile).is_some_and(|tile| !tile.enabled);
    studio.desk.until("the reason of the arm", |desk| is_greyed(desk, "Part arm"));
    // An open menu asks for nothing more.
    studio.desk.move_to(egui::pos2(3000.0, 3000.0));
    studio.settle();
    studio.desk.frames(120);
    assert!(!studio.desk.asks && studio.desk.wakes_in == Duration::MAX, "{:?}", studio.desk.wakes_in);
    assert!(!is_greyed(&studio.desk, "Part limb"), "it fits");
    let steps = studio.desk.steps();
    studio.click("Part arm");
    assert!(studio.desk.steps() == steps && studio.desk.look("Part arm").is_some(), "the menu stays open");
    studio.click("Part limb");
    assert_eq!((studio.desk.rig().dropped_parts().len(), studio.desk.steps().1), (1, steps.1 + 1));

    studio.desk.select(&[arm_l]);
    studio.settle();
    studio.click("Part");
    studio.desk.until("the reason of the limb", |desk| is_greyed(desk, "Part limb"));
    let limb = studio.desk.find("Part limb").rect.center();
    studio.desk.move_to(limb);
    studio.desk.frames(60);
    let words = OccupiedJoint { joint: "arm_l".to_owned(), part: "the part \"limb\"".to_owned() }.to_string();
    assert!(studio.desk.says(&words), "{words}: {:?}", studio.desk.seen);

    // With the options first a click only shows them.
    studio.click("Options first");
    assert!(!is_greyed(&studio.desk, "Part limb"));
    studio.click("Part limb");
    assert!(!studio.desk.find("Add part").enabled && studio.desk.look("Option size").is_some());
    studio.click("Options first");
    assert!(is_greyed(&studio.desk, "Part limb"));
}
