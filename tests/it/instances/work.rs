//! Work of a reload: what is the same for all instances is made once, and only what differs is written.

use std::{any::type_name, collections::BTreeMap, fs, path::Path, sync::Arc};

use bevy::prelude::*;
use rigsmith::{
    instance::{ExposedNodes, RigInstance, RunningTemplate},
    plugins::{
        runtime::{ControlPose, InstanceMode, NodeSlot, RigRuntime},
        schema::{Attributes, Control, CreatedRole, NodeLabel, NodeLayer, NodeOf},
    },
    rig::RestTransform,
    solve::program::{Carry, ExposedNode, RigProgram},
};

use super::{AppBench, TWO, saved};

const CROWD: usize = 12;

/// Numbers of components of nodes that were written, by their types.
#[derive(Resource, Default)]
struct Written(BTreeMap<&'static str, usize>);

fn count<C: Component>(nodes: Query<(), (Changed<C>, With<NodeOf>)>, mut written: ResMut<Written>) {
    *written.0.entry(type_name::<C>()).or_default() += nodes.iter().count();
}

impl AppBench {
    /// A game that counts what is written, with the bundled biped as a file beside the part of its hands.
    fn counting(folder: &Path) -> (Self, String) {
        let templates = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
        fs::create_dir(folder.join("parts")).unwrap();
        fs::copy(templates.join("parts/hand.rig.ron"), folder.join("parts/hand.rig.ron")).unwrap();
        let text = fs::read_to_string(templates.join("biped.rig.ron")).unwrap();
        saved(folder, &text);
        let mut game = Self::still_game();
        game.app.init_resource::<Written>().add_systems(
            Last,
            (
                (count::<Name>, count::<NodeLabel>, count::<RestTransform>, count::<Control>, count::<NodeLayer>),
                (count::<CreatedRole>, count::<NodeSlot>, count::<Attributes>, count::<ControlPose>),
                (count::<Transform>, count::<GlobalTransform>),
            )
                .chain(),
        );
        (game, text)
    }

    /// Instances of the template in the folder, the first hand of each somewhere else.
    fn crowd(&mut self, folder: &Path, mode: InstanceMode) -> Vec<Entity> {
        let first = self.open(&folder.join("t.rig.ron"), mode);
        let handle = self.app.world().get::<RigInstance>(first).unwrap().0.clone();
        let mut crowd = vec![first];
        crowd.extend((1..CROWD).map(|_| self.spawn(handle.clone(), mode)));
        for (number, instance) in crowd.iter().enumerate() {
            let hand = self.node(*instance, "hand_ik_l");
            let lift = 0.01 * number as f32;
            let world = self.app.world_mut();
            match mode {
                InstanceMode::Direct => world.get_mut::<ControlPose>(hand).unwrap().translation.y = lift,
                InstanceMode::Hierarchy => world.get_mut::<Transform>(hand).unwrap().translation.y += lift,
            }
        }
        (0..5).for_each(|_| self.app.update());
        crowd
    }

    /// Takes a content over; the numbers of written components that are not zero, without those of world transforms.
    fn written_by(&mut self, instance: Entity, content: &str) -> BTreeMap<&'static str, usize> {
        let before = self.instance_report().updated.len();
        self.app.world_mut().resource_mut::<Written>().0.clear();
        self.offer(instance, content.as_bytes());
        self.until("the update", |told| told.updated.len() > before);
        assert_eq!(self.instance_report().updated.len(), before + CROWD, "all in one frame");
        (0..3).for_each(|_| self.app.update());
        let written = self.app.world().resource::<Written>().0.iter();
        written.filter(|(_, number)| **number > 0).map(|(name, number)| (*name, *number)).collect()
    }

    fn program(&self, instance: Entity) -> &Arc<RigProgram> {
        self.app.world().get::<RigRuntime>(instance).unwrap().state().program()
    }

    fn template(&self, instance: Entity) -> &RunningTemplate {
        self.app.world().get::<RunningTemplate>(instance).unwrap()
    }
}

#[test]
fn a_size_of_a_control_writes_that_control_alone() {
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let folder = tempfile::tempdir().unwrap();
        let (mut game, text) = AppBench::counting(folder.path());
        let crowd = game.crowd(folder.path(), mode);
        let (before, program) = (game.template(crowd[0]).clone(), game.program(crowd[0]).clone());
        let written = game.written_by(crowd[0], &text.replacen("size: 0.573", "size: 0.6", 1));
        let controls = game.template(crowd[0]).get().built.nodes.iter().zip(&before.get().built.nodes);
        let resized = controls.filter(|(now, before)| now.control != before.control).count();
        assert!(resized > 0);
        assert_eq!(written, BTreeMap::from([(type_name::<Control>(), resized * CROWD)]), "{mode:?}");
        // Sizes are nothing to a program.
        assert!(crowd.iter().all(|instance| Arc::ptr_eq(game.program(*instance), &program)), "{mode:?}");
    }
}

#[test]
fn a_program_is_compiled_once_for_all_instances_and_poses_stay_unread() {
    let modes = [InstanceMode::Direct, InstanceMode::Hierarchy];
    // One parameter of the thumbs of a part, whose number is nobody else's, and one that others have, too.
    for (mode, parameter) in modes.into_iter().flat_map(|mode| [(mode, "max_stretch: 1.4"), (mode, "soft: 0.1")]) {
        let folder = tempfile::tempdir().unwrap();
        let (mut game, text) = AppBench::counting(folder.path());
        let crowd = game.crowd(folder.path(), mode);
        let before = game.program(crowd[0]).clone();
        let places: Vec<_> = crowd.iter().map(|instance| game.places(*instance)).collect();
        let hand = folder.path().join("parts/hand.rig.ron");
        let part = fs::read_to_string(&hand).unwrap();
        assert!(part.contains("weight: \"ik\""));
        fs::write(&hand, part.replacen("weight: \"ik\"", &format!("weight: \"ik\", {parameter}"), 1)).unwrap();
        let mut written = game.written_by(crowd[0], &text);
        // Joints without a hierarchy get their places: those of the two thumbs.
        if mode == InstanceMode::Direct {
            let joints = written.remove(type_name::<GlobalTransform>()).unwrap_or_default();
            assert!((1..=12 * CROWD).contains(&joints), "{joints} places are written");
        }
        assert_eq!(written, BTreeMap::new(), "{mode:?}: nothing that stays the same is written");
        let template = game.template(crowd[0]).get();
        let shared = if mode == InstanceMode::Direct { &template.lean } else { &template.whole };
        assert!(!Arc::ptr_eq(shared, &before), "it is another program");
        // Instances that remember everything run the two thumbs; a thousand of them have no time for more in a frame.
        let operations = Carry::between(&before, shared).operations_of_registers(shared);
        assert_eq!(operations, Some(2), "{mode:?}, {parameter}: of {}", shared.operations());
        assert!(crowd.iter().all(|instance| Arc::ptr_eq(game.program(*instance), shared)), "{mode:?}: one for all");
        assert!(crowd.iter().all(|instance| Arc::ptr_eq(game.template(*instance).get(), template)));
        for (instance, before) in crowd.iter().zip(places) {
            assert_eq!(game.places(*instance), before, "{mode:?}");
        }
    }
}

#[test]
fn programs_of_exposed_nodes_stay_where_a_change_does_not_reach_them() {
    let folder = tempfile::tempdir().unwrap();
    let (mut game, text) = AppBench::counting(folder.path());
    let crowd = game.crowd(folder.path(), InstanceMode::Direct);
    let nodes = &game.template(crowd[0]).get().built.nodes;
    let hand = nodes.iter().find(|node| &*node.name == "hand_ik_l").unwrap().uid;
    for instance in &crowd {
        let exposed = ExposedNodes(vec![ExposedNode::Uid(hand)]);
        game.app.world_mut().entity_mut(*instance).insert(exposed);
    }
    (0..3).for_each(|_| game.app.update());
    let program = game.program(crowd[0]).clone();
    assert!(!Arc::ptr_eq(&program, &game.template(crowd[0]).get().lean));
    game.written_by(crowd[0], &text.replacen("size: 0.573", "size: 0.6", 1));
    assert!(crowd.iter().all(|instance| Arc::ptr_eq(game.program(*instance), &program)));
    // The next program is one for all, too.
    game.written_by(crowd[0], &text.replacen("(0, 0.955, -0.006)", "(0, 1.055, -0.006)", 1));
    let next = game.program(crowd[0]).clone();
    assert!(!Arc::ptr_eq(&next, &program));
    assert!(crowd.iter().all(|instance| Arc::ptr_eq(game.program(*instance), &next)));
    assert_eq!(game.instance_report().failed, Vec::<String>::new());
}

/// A pose that limits cut off is the pose that was set again once they are gone.
#[test]
fn limits_that_are_loosened_free_the_pose_that_was_set() {
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        let folder = tempfile::tempdir().unwrap();
        let limited = |most: f32| {
            let range = format!("(-{most:?}, {most:?})");
            let limits =
                format!("control(limits: (translate: ({range}, {range}, {range})), creation: (name: \"ctl_a\"))");
            TWO.replace("control(creation: (name: \"ctl_a\"))", &limits)
        };
        let mut game = AppBench::still_game();
        let instance = game.open(&saved(folder.path(), &limited(0.1)), mode);
        let (control, end) = (game.node(instance, "ctl_a"), game.node(instance, "a_end"));
        game.app.update();
        let world = game.app.world_mut();
        match mode {
            InstanceMode::Direct => world.get_mut::<ControlPose>(control).unwrap().translation.y = 0.5,
            InstanceMode::Hierarchy => world.get_mut::<Transform>(control).unwrap().translation.y += 0.5,
        }
        game.app.update();
        let height = |game: &AppBench| game.app.world().get::<GlobalTransform>(end).unwrap().translation().y;
        assert!((height(&game) - 1.6).abs() < 1e-5, "{mode:?}: {}", height(&game));
        for (number, most) in [0.3, 0.2, 1.0].into_iter().enumerate() {
            game.offer(instance, limited(most).as_bytes());
            game.until("the update", |told| told.updated.len() == number + 1);
            game.app.update();
            // In a hierarchy the pose is the transform that stands there, which the limits have cut off.
            let expected = if mode == InstanceMode::Direct { most.min(0.5) } else { 0.1 };
            assert!((height(&game) - 1.5 - expected).abs() < 1e-5, "{mode:?}, {most}: {}", height(&game));
        }
    }
}
