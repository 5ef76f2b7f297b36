//! A rig whose file and parts are saved at random while it is edited.

use super::*;

/// A joint of a file that changes at random.
#[derive(Clone)]
struct FileJoint {
    name: String,
    above: Option<usize>,
    /// Place in the rig's space, and turn about Z in degrees.
    place: Vec3,
    turn: f32,
    size: f32,
}

/// The text of a template of these joints, with a control on each and an attribute on the first.
fn template_of_joints(joints: &[Option<FileJoint>]) -> String {
    let mut text = String::from("(\n    format: 2,\n    name: \"living\",\n    joints: [\n");
    for joint in joints.iter().flatten() {
        let above = joint.above.and_then(|above| joints[above].as_ref());
        let (parent, origin, turn) = above.map_or((String::new(), Vec3::ZERO, 0.0), |above| {
            (format!("parent: \"{}\", ", above.name), above.place, above.turn)
        });
        let at = Quat::from_rotation_z(-turn.to_radians()) * (joint.place - origin);
        let attribute = match joint.above {
            None => format!(", attribute(node: \"@command control/{}\", name: \"amount\", default: 0.5)", joint.name),
            Some(_) => String::new(),
        };
        text.push_str(&format!(
            "        (label: \"{}\", {parent}translation: ({:?}, {:?}, {:?}), rotation: (0, 0, {:?}), tags: [control(relative_size: {:?}){attribute}]),\n",
            joint.name, at.x, at.y, at.z, joint.turn - turn, joint.size
        ));
    }
    text.push_str("    ],\n    parts: [(part: \"link.rig.ron\", name: \"link\", prefix: \"link_\")],\n)\n");
    text
}

/// Changes a file in one way. Returns true if that changes what poses mean, and false if it leaves that alone.
fn rewrite(joints: &mut Vec<Option<FileJoint>>, dice: &mut Dice, number: usize) -> bool {
    let living: Vec<usize> = (1..joints.len()).filter(|at| joints[*at].is_some()).collect();
    let one = living[dice.below(living.len() as u64) as usize];
    let is_below = |joints: &[Option<FileJoint>], mut at: usize, above: usize| loop {
        match joints[at].as_ref().and_then(|joint| joint.above) {
            Some(next) if next == above => return true,
            Some(next) => at = next,
            None => return false,
        }
    };
    let is_leaf = joints.iter().flatten().all(|joint| joint.above != Some(one));
    let above = living[dice.below(living.len() as u64) as usize];
    let is_free = above != one && !is_below(joints, above, one);
    let kind = dice.below(6);
    if kind == 0 && is_leaf && living.len() > 4 {
        joints[one] = None;
        return false;
    }
    if kind == 1 || living.len() < 4 {
        let place = joints[one].as_ref().unwrap().place + Vec3::new(0.05 + 0.001 * number as f32, 0.2, 0.0);
        joints.push(Some(FileJoint { name: format!("new_{number}"), above: Some(one), place, turn: 0.0, size: 1.0 }));
        return false;
    }
    let joint = joints[one].as_mut().unwrap();
    match kind {
        2 => joint.name = format!("named_{number}"),
        3 => joint.turn = 45.0 * (dice.below(8) as f32 - 4.0),
        4 if is_free => joint.above = Some(above),
        _ => joint.size = 0.5 + 0.1 * dice.below(10) as f32,
    }
    kind == 3 || kind == 4
}

/// The clip of the long life, and its layer.
const CLIP: Uid = Uid(0xC11B_0001);
const LAYER: Uid = Uid(0xC11B_0002);

/// Checks that a reload has left all keys of the clip: those of nodes that are gone, too. Where nothing changed what they mean and all
/// of their nodes are there, they are as they were.
fn check_keys(studio: &Studio, before: Option<&RigClip>, is_same: bool, step: usize) {
    let (Some(before), Some(after)) = (before, studio.base.rig().clip(CLIP)) else {
        assert!(before.is_none(), "step {step}: the clip is gone");
        return;
    };
    for (target, track) in &before.layers[0].tracks {
        let now = after.layers[0].tracks.get(target).unwrap_or_else(|| panic!("step {step}: {target:?} has no keys"));
        for key in &track.keys {
            assert!(now.keys.iter().any(|now| now.time == key.time), "step {step}: {target:?} at {} s", key.time);
        }
    }
    if is_same && before.nodes().into_iter().all(|node| studio.is_built(node)) {
        assert_eq!(after, before, "step {step}");
    }
}

/// Losses that updates have told: joints that a pose could not hold, and nodes whose keys are set aside.
#[derive(Resource, Default)]
struct ListedLosses {
    joints: HashSet<Uid>,
    set_aside: HashSet<Uid>,
}

#[test]
fn a_long_life_of_edits_and_saves_loses_nothing() {
    let steps = std::env::var("RIGSMITH_STEPS").ok().and_then(|steps| steps.parse().ok()).unwrap_or(400);
    let dice = &mut Dice(UidSource::seeded(12));
    let mut joints: Vec<Option<FileJoint>> = Vec::new();
    for number in 0..6usize {
        let place = Vec3::new(0.0, 0.3 * number as f32, 0.02 * number as f32);
        let above = number.checked_sub(1);
        joints.push(Some(FileJoint { name: format!("joint_{number}"), above, place, turn: 0.0, size: 1.0 }));
    }
    let mut studio = Studio::of(true, &template_of_joints(&joints));
    studio.base.app.init_resource::<ListedLosses>();
    studio.base.app.add_observer(|updated: On<RigUpdated>, mut listed: ResMut<ListedLosses>| {
        listed.joints.extend(updated.poses.iter().map(|note| note.deviation.joint));
        listed.set_aside.extend(updated.clips.set_aside.iter().map(|aside| aside.keys.node));
    });
    let first = write_template(studio.base.rig());
    let mut keys = 0;
    let (mut done, mut is_mixed, mut reloads, mut offers, mut held, mut aside) = (0usize, false, 0, 0, 0, 0);
    let (mut version, mut parts) = (0, 0);
    for step in 0..steps {
        // An undo may have taken it away.
        if studio.base.rig().clip(CLIP).is_none() {
            let clip = RigClip { range: [0.0, 1.0], ..RigClip::new(CLIP, LAYER, "sway") };
            studio.base.apply(RigEdit::AddClip(Box::new(clip), 0));
        }
        let controls: Vec<Uid> = {
            let built = &studio.base.get::<BuildResult>(studio.base.rig).unwrap().0;
            built.nodes.iter().filter(|node| node.control.is_some()).map(|node| node.uid).collect()
        };
        let control = controls[dice.below(controls.len() as u64) as usize];
        let labels: Vec<Uid> = studio.base.rig().walk().map(|joint| joint.data.uid).collect();
        let joint = labels[dice.below(labels.len() as u64) as usize];
        let share = dice.below(1000) as f32 / 1000.0;
        let before = studio.posed_state();
        let clip_before = studio.base.rig().clip(CLIP).cloned();
        let edit = match dice.below(10) {
            0..=2 => {
                let turned = PoseOffset::from_rotation(Quat::from_rotation_z(share - 0.5));
                Some(Operation::Pose(vec![(control, turned)]))
            }
            3 => Some(Operation::Edits(vec![RigEdit::SetAttributeValue(control, "amount".into(), Some(share))])),
            4 => Some(Operation::Edits(vec![RigEdit::SetLabel(joint, Some(format!("mine_{step}")))])),
            5 if share < 0.3 => Some(Operation::Edits(vec![RigEdit::SetLocked(joint, share > 0.15)])),
            5 => {
                let target = TrackTarget { node: control, property: Property::Rotation };
                let key = Key::rotation((step % 5) as f32 * 0.25, Quat::from_rotation_z(share - 0.5));
                let change = KeyOperation::Set(vec![(target, vec![key])]);
                keys += 1;
                Some(Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: LAYER, change }))
            }
            6 => {
                let change = if share < 0.7 && done > 0 { Change::Undo } else { Change::Redo };
                studio.base.change(change);
                is_mixed = true;
                None
            }
            _ => {
                let known = studio.built();
                let was = template_of_joints(&joints);
                let is_part = dice.below(4) == 0;
                let mut means_other = false;
                let keyed: Vec<Uid> =
                    clip_before.iter().flat_map(RigClip::nodes).filter(|node| studio.is_built(*node)).collect();
                *studio.base.app.world_mut().resource_mut::<ListedLosses>() = ListedLosses::default();
                if is_part {
                    let next =
                        (1..).map(|more| version + more).find(|next| written_part(*next) != written_part(version));
                    version = next.unwrap_or_default();
                    save_whole(&studio.file.with_file_name("link.rig.ron"), written_part(version));
                    parts += 1;
                } else {
                    means_other = rewrite(&mut joints, dice, step);
                    while template_of_joints(&joints) == was {
                        means_other |= rewrite(&mut joints, dice, step);
                    }
                    studio.save(&template_of_joints(&joints));
                }
                studio.until("the template", |world, _| {
                    world.resource::<RigTemplates>().built(&known.0).is_some_and(|now| !Arc::ptr_eq(now, &known.1))
                        || world.resource::<InstanceReport>().failed.len() > 3
                });
                for _ in 0..4 {
                    studio.base.app.update();
                }
                if studio.base.get::<UpdateOffer>(studio.base.rig).is_some() {
                    offers += 1;
                    let take = if share < 0.5 { Take::Mine } else { Take::Theirs };
                    studio
                        .base
                        .app
                        .world_mut()
                        .write_message(AcceptUpdate { rig: studio.base.rig, choices: take.into() });
                    for _ in 0..4 {
                        studio.base.app.update();
                    }
                    is_mixed = true;
                }
                assert_eq!(studio.instance_report().failed, Vec::<String>::new());
                reloads += 1;
                let after = studio.posed_state();
                for (node, values) in before.values.iter().filter(|(node, _)| studio.is_built(**node)) {
                    assert_eq!(after.values.get(node), Some(values), "step {step}");
                }
                check_keys(&studio, clip_before.as_ref(), !means_other && !is_mixed, step);
                let listed = studio.base.app.world().resource::<ListedLosses>();
                for node in keyed.iter().filter(|node| !studio.is_built(**node)) {
                    assert!(listed.set_aside.contains(node), "step {step}: keys of {node} are gone and not listed");
                    aside += 1;
                }
                if !means_other && !is_mixed {
                    for (node, offset) in before.pose.iter().filter(|(node, _)| studio.is_built(**node)) {
                        assert_eq!(after.pose.get(node), Some(offset), "step {step}");
                    }
                } else if !is_mixed {
                    for (joint, place, rest) in
                        before.joints.iter().filter(|(joint, ..)| !listed.joints.contains(joint))
                    {
                        let Some((_, now, rest_now)) = after.joints.iter().find(|(known, ..)| known == joint) else {
                            continue;
                        };
                        // What hangs on a turned joint, and the file knows nothing of, moves at rest.
                        let is_held = rest_now.distance(*rest) < 1e-5;
                        let distance = now.distance(*place);
                        assert!(!is_held || distance < 1e-4, "step {step}: {joint} {place} {now}");
                        held += usize::from(is_held);
                    }
                }
                is_mixed = false;
                None
            }
        };
        done += 1;
        if let Some(operation) = edit {
            studio.base.change(Change::Do(operation));
        }
    }
    assert!(reloads > steps / 10 && parts > steps / 40, "{reloads} reloads, {parts} of them of the part");
    println!(
        "{steps} steps, {reloads} reloads, {parts} of the part, {offers} offered, {held} held, {keys} keys, {aside} aside"
    );
    assert!(held > steps / 10 && keys > steps / 40, "{held} {keys}");
    for _ in 0..steps * 2 {
        studio.base.change(Change::Undo);
    }
    assert_eq!(write_template(studio.base.rig()), first);
    assert!(studio.base.rig().clips().is_empty());
}
