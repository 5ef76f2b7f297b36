//! Parts that go onto both sides in one step, where the joint that they are dropped on has a partner.

use std::sync::Arc;

use bevy::math::Affine3A;
use rigsmith::{
    editor::library::PartSides,
    plugins::{
        commands::{BuildRequest, BuildStep, Processor},
        document::Symmetry,
    },
    processor::CommandState,
    rig::{BuiltRig, NodeType, operations::MirrorPlane},
};

use super::*;

/// Switches live mirroring on or off.
fn mirror(studio: &mut Studio, is_on: bool) {
    let rig = studio.desk.rig;
    let plane = is_on.then(|| MirrorPlane::sagittal(1.5));
    studio.desk.app.world_mut().entity_mut(rig).insert(Symmetry(plane));
    studio.desk.frames(2);
}

fn parts(studio: &Studio) -> Vec<(Vec<Uid>, bool)> {
    studio.desk.rig().dropped_parts().iter().map(|part| (part.joints.clone(), part.mirror)).collect()
}

fn built(studio: &mut Studio) -> BuiltRig {
    let rig = studio.desk.rig;
    studio.send(BuildRequest { rig, step: BuildStep::All });
    let processor = studio.world().get::<Processor>(rig).unwrap();
    let builder = processor.builder();
    for entry in builder.list() {
        let status = builder.status(entry.command).expect("every command has run");
        assert_eq!(status.state, CommandState::Done, "{status:?}");
    }
    builder.built()
}

/// Place in the rig's space of the control that was made for a joint, and the number of constraints of its command.
fn control_of(built: &BuiltRig, joint: Uid) -> (Vec3, usize) {
    let is_wanted = |number: &usize| {
        let node = &built.nodes[*number];
        node.kind == NodeType::Control && node.origin.as_ref().is_some_and(|origin| origin.subject == joint)
    };
    let found: Vec<usize> = (0..built.nodes.len()).filter(is_wanted).collect();
    let [control] = found[..] else { panic!("{found:?}") };
    let command = built.nodes[control].origin.as_ref().map(|origin| origin.command);
    let constraints = built.constraints.iter().filter(|constraint| Some(constraint.command) == command).count();
    let (mut global, mut next) = (Affine3A::IDENTITY, Some(control));
    while let Some(number) = next {
        let base = built.nodes[number].base;
        global = Affine3A::from_scale_rotation_translation(base.scale, base.rotation, base.translation) * global;
        next = built.nodes[number].parent;
    }
    (global.translation.into(), constraints)
}

#[test]
fn a_part_goes_onto_both_sides_in_one_step() {
    let mut studio = Studio::new(LoaderPanel::default());
    mirror(&mut studio, true);
    let [arm_l, elbow_l, arm_r, elbow_r] = ["arm_l", "elbow_l", "arm_r", "elbow_r"].map(|label| studio.joint(label));
    // Beside the document, where the file finds it, too.
    let home = studio.folder.path().join("home");
    fs::write(home.join("limb.rig.ron"), LIMB).unwrap();
    let limb = TemplatePlace::File(home.join("limb.rig.ron"));
    let (before, rig, steps) = (studio.text(), studio.desk.rig().clone(), studio.desk.steps().1);
    studio.act(limb.clone(), LibraryAct::Drop { joint: arm_l });
    assert_eq!(studio.desk.steps().1, steps + 1, "{:?}", studio.desk.told());
    assert_eq!(parts(&studio), [(vec![arm_l, elbow_l], false), (vec![arm_r, elbow_r], true)]);

    // Both are built, and the controls of one side are the mirror image of those of the other.
    let built = built(&mut studio);
    let ((left, of_left), (right, of_right)) = (control_of(&built, arm_l), control_of(&built, arm_r));
    assert!((left - right * Vec3::new(-1.0, 1.0, 1.0)).length() < 1e-5, "{left} and {right}");
    assert!(of_left == of_right && of_left > 0, "{of_left} and {of_right} constraints");

    // A file has both as parts, and what is read from it is the same.
    let path = home.join("both.rig.ron");
    studio.send(SaveTemplate { path: path.clone(), replace: false, content: TemplateContent::Rig { picture: false } });
    studio.desk.until("the template", |_| path.exists());
    studio.settle();
    let read = load_template(&RealDisk, &path).unwrap();
    let onto: Vec<_> = read.instances.iter().map(|part| (part.onto.clone(), part.mirror)).collect();
    let named = |labels: [&str; 2]| labels.map(str::to_owned).to_vec();
    assert_eq!(onto, [(named(["arm_l", "elbow_l"]), false), (named(["arm_r", "elbow_r"]), true)]);

    studio.change(Change::Undo);
    assert_eq!((studio.text(), studio.desk.rig()), (before, &rig));
    studio.change(Change::Redo);
    assert_eq!(parts(&studio).len(), 2);
    studio.change(Change::Undo);

    // From the right side it is the same pair.
    studio.act(limb, LibraryAct::Drop { joint: arm_r });
    assert_eq!(parts(&studio), [(vec![arm_r, elbow_r], true), (vec![arm_l, elbow_l], false)]);
}

#[test]
fn the_check_is_on_with_symmetry_and_a_person_may_say_otherwise() {
    let mut studio = Studio::new(TagsPanel::default());
    let [arm_l, arm_r] = ["arm_l", "arm_r"].map(|label| studio.joint(label));
    studio.desk.select(&[arm_l]);
    studio.settle();
    let are_both = |studio: &Studio| PartSides::are_both(studio.world());
    assert!(!are_both(&studio));
    mirror(&mut studio, true);
    assert!(are_both(&studio));
    studio.click("Part");
    studio.desk.until("the parts", |desk| desk.look("Part limb").is_some());
    assert_eq!(studio.desk.find("Both sides").on, Some(true));
    studio.click("Both sides");
    assert_eq!(studio.desk.find("Both sides").on, Some(false));
    studio.click("Part limb");
    assert_eq!(parts(&studio).len(), 1, "{:?}", studio.desk.told());
    studio.change(Change::Undo);
    // The choice is forgotten when symmetry is switched.
    mirror(&mut studio, false);
    assert!(!are_both(&studio));
    let choice = PartSides::choice(studio.world(), true);
    studio.desk.app.insert_resource(choice);
    studio.act(studio.limb(), LibraryAct::Part { joints: vec![arm_r], options: Vec::new() });
    assert_eq!(parts(&studio).len(), 2, "{:?}", studio.desk.told());
    mirror(&mut studio, true);
    assert!(are_both(&studio));
}

#[test]
fn joints_without_a_partner_take_one_part() {
    let mut studio = Studio::new(LoaderPanel::default());
    mirror(&mut studio, true);
    // The hips have no other side, which the person is told where other joints have one.
    let hips = studio.joint("hips");
    let [arm_l, elbow_l, elbow_r] = ["arm_l", "elbow_l", "elbow_r"].map(|label| studio.joint(label));
    let told = studio.desk.told().len();
    studio.act(studio.limb(), LibraryAct::Part { joints: vec![hips, arm_l], options: Vec::new() });
    assert_eq!(parts(&studio), [(vec![hips, arm_l], false)]);
    assert!(
        studio.desk.told()[told..].iter().any(|told| told.contains("hips has no partner")),
        "{:?}",
        studio.desk.told()
    );
    studio.change(Change::Undo);
    // A joint that has lost its partner is told, too.
    studio.desk.edit(Operation::Delete { joints: vec![elbow_r], keep_children: false });
    studio.act(studio.limb(), LibraryAct::Drop { joint: arm_l });
    assert_eq!(parts(&studio), [(vec![arm_l, elbow_l], false)]);
    assert!(studio.told("elbow_l has no partner"), "{:?}", studio.desk.told());
}

#[test]
fn a_pair_is_taken_back_whole_if_one_side_is_refused() {
    let studio = Studio::new(LoaderPanel::default());
    let mut rig = studio.desk.rig().clone();
    let before = rig.clone();
    let limb = Arc::new(load_template(&RealDisk, &studio.site.join("limbs").join("limb.rig.ron")).unwrap().rig);
    let [arm_l, elbow_l, arm_r] = ["arm_l", "elbow_l", "arm_r"].map(|label| studio.joint(label));
    let side =
        |joints: Vec<Uid>, mirror: bool| rigsmith::rig::operations::PartSide { fitted: limb.clone(), joints, mirror };
    // The other side is given one joint twice.
    let sides = [side(vec![arm_l, elbow_l], false), side(vec![arm_r, arm_r], true)];
    let part = "limbs/limb.rig.ron".to_owned();
    let operation = Operation::Tags(rigsmith::rig::operations::TagOperation::AddPair { part, sides });
    let mut uids = UidSource::seeded(3);
    assert!(operation.run(&mut rig, &mut uids, None).is_err());
    assert_eq!(rig, before);
}
