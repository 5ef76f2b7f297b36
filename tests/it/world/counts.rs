//! Counts of written components: a build that executes nothing writes nothing, an edit writes what it changes and no
//! value that stays the same.

use std::collections::{BTreeMap, BTreeSet};

use bevy::{
    ecs::{change_detection::Tick, component::ComponentId, reflect::ReflectComponent},
    prelude::*,
    reflect::{PartialReflect, TypeRegistry},
};
use rigsmith::{
    plugins::{
        commands::{BuildResult, BuildStep, CommandReport},
        runtime::RigRuntime,
        schema::{Constrains, Control, GroupOf, NodeOf, TagOf},
    },
    prelude::*,
    rig::{NodeType, TagData, TagKind},
};

use super::{RigBench, shipped};

/// The built biped, some frames later.
fn biped() -> RigBench {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let mut stage = RigBench::of_built(rig);
    (0..3).for_each(|_| stage.app.update());
    stage
}

/// Entities of nodes, tags, groups and constraints of all rigs, and of the rigs.
fn of_rigs(world: &World) -> Vec<EntityRef<'_>> {
    let is_part = |entity: &EntityRef| {
        entity.contains::<NodeOf>()
            || entity.contains::<TagOf>()
            || entity.contains::<GroupOf>()
            || entity.contains::<Constrains>()
            || entity.contains::<Rig>()
    };
    world.iter_entities().filter(is_part).collect()
}

/// Components of the rigs' entities that were written after a tick, with their names.
fn writes_since(stage: &RigBench, tick: Tick) -> Vec<(Entity, ComponentId, String)> {
    let world = stage.app.world();
    let now = world.read_change_tick();
    let mut found = Vec::new();
    for entity in of_rigs(world) {
        for component in entity.archetype().components() {
            let ticks = entity.get_change_ticks_by_id(*component);
            if ticks.is_some_and(|ticks| ticks.is_changed(tick, now)) {
                let name = world.components().get_name(*component).map(|name| name.to_string()).unwrap_or_default();
                found.push((entity.id(), *component, name));
            }
        }
    }
    found
}

/// The same for the parts of the rigs, without the rigs' own entities.
fn parts_written_since(stage: &RigBench, tick: Tick) -> Vec<(Entity, String)> {
    let written = writes_since(stage, tick).into_iter().filter(|(entity, ..)| *entity != stage.rig);
    written.map(|(entity, _, name)| (entity, name)).collect()
}

#[test]
fn a_build_that_executes_nothing_writes_nothing() {
    let mut stage = biped();
    let tick = stage.app.world().read_change_tick();
    stage.step(BuildStep::All);
    let world = stage.app.world();
    let rig = world.entity(stage.rig);
    let since = |ticks: Option<bevy::ecs::change_detection::ComponentTicks>| {
        ticks.is_some_and(|ticks| ticks.is_changed(tick, world.read_change_tick()))
    };
    assert!(!since(rig.get_change_ticks::<BuildResult>()) && !since(rig.get_change_ticks::<RigRuntime>()));
    let written = parts_written_since(&stage, tick);
    assert!(written.is_empty(), "{} components were written: {written:?}", written.len());
}

/// An edit of one tag writes the components of that tag and of what it made, and no other.
#[test]
fn an_edit_of_one_tag_touches_only_what_changed() {
    let mut stage = biped();
    let (joint, mut tag) = command(&stage, |module, params| module == "control" && params.contains("shape_scale"));
    let TagKind::Command { params, .. } = &mut tag.kind else { unreachable!() };
    let start = params.find("shape_scale").unwrap();
    let end = start + params[start..].find(')').unwrap();
    params.replace_range(start..=end, "shape_scale: (1.5, 1.25, 1.75)");
    let uid = tag.uid;
    let built = stage.get::<BuildResult>(stage.rig).unwrap().0.clone();
    let of_tag = |node: Uid| {
        let origin = built.node(node).and_then(|node| node.origin.clone());
        origin.is_some_and(|origin| origin.command == uid)
    };
    let tick = stage.app.world().read_change_tick();
    stage.apply(RigEdit::SetTag(joint, Box::new(tag)));
    let written = parts_written_since(&stage, tick);
    let controls = written.iter().filter(|(_, name)| name.ends_with("schema::Control")).count();
    assert!(controls > 0, "the control's shape is written: {written:?}");
    for (entity, name) in &written {
        let node = *stage.get::<Uid>(*entity).unwrap();
        assert!(node == uid || of_tag(node), "{name} of {node}, which the tag did not make");
        assert!(!name.contains("Transform"), "{name} of {node}: nothing moved");
    }

    // A pose moves what hangs on it and touches nothing else.
    let control = stage.control("hand_ik_l");
    stage.app.update();
    let tick = stage.app.world().read_change_tick();
    stage.app.world_mut().get_mut::<Transform>(control).unwrap().translation.y += 0.01;
    stage.app.update();
    let written = parts_written_since(&stage, tick);
    for (entity, name) in &written {
        assert!(name.contains("Transform"), "a pose writes {name} of {entity}");
    }
    let entities: BTreeSet<Entity> = written.iter().map(|(entity, _)| *entity).collect();
    assert!(entities.len() < built.nodes.len() / 2, "{} of {} nodes", entities.len(), built.nodes.len());
}

/// The first command that fits, with its joint.
fn command(stage: &RigBench, is_meant: impl Fn(&str, &str) -> bool) -> (Uid, TagData) {
    let rig = stage.rig();
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone())));
    let fits = |(_, tag): &(Uid, TagData)| match &tag.kind {
        TagKind::Command { module, params, .. } => is_meant(module, params),
        TagKind::Feature { .. } => false,
    };
    tags.collect::<Vec<_>>().into_iter().find(fits).expect("a command that fits")
}

/// Values of all reflected components of a rig's entities.
type Values = BTreeMap<(Entity, ComponentId), Box<dyn PartialReflect>>;

fn values(stage: &RigBench, registry: &TypeRegistry) -> Values {
    let world = stage.app.world();
    let mut values = Values::new();
    for entity in of_rigs(world) {
        for component in entity.archetype().components() {
            let info = world.components().get_info(*component).and_then(|info| info.type_id());
            let reflected = info.and_then(|id| registry.get_type_data::<ReflectComponent>(id));
            if let Some(value) = reflected.and_then(|reflected| reflected.reflect(entity)) {
                values.insert((entity.id(), *component), value.to_dynamic());
            }
        }
    }
    values
}

/// State of the rig itself, with more in it than its reflected value shows.
const STATES: [&str; 8] = [
    "::RigHistory",
    "::RigRuntime",
    "::Processor",
    "::RigSurface",
    "::JointEntities",
    "::TagEntities",
    "::GroupEntities",
    "::BuiltEntities",
];

/// Components that an edit wrote although their values are the same as before, and how many it wrote in all. Markers
/// without a value, such as those of Bevy's propagation of transforms, do not count.
fn unchanged_writes(stage: &mut RigBench, edit: impl FnOnce(&mut RigBench)) -> (Vec<String>, usize) {
    let registry = stage.app.world().resource::<AppTypeRegistry>().clone();
    let before = values(stage, &registry.read());
    let reports: BTreeMap<Entity, CommandReport> = of_rigs(stage.app.world())
        .into_iter()
        .filter_map(|entity| Some((entity.id(), entity.get::<CommandReport>()?.clone())))
        .collect();
    let tick = stage.app.world().read_change_tick();
    edit(stage);
    let after = values(stage, &registry.read());
    let mut same = Vec::new();
    let written = writes_since(stage, tick);
    for (entity, component, name) in &written {
        let key = (*entity, *component);
        let is_of_ours = name.starts_with("rigsmith::");
        // Bevy writes the root of a hierarchy in which something moved.
        let is_root = *entity == stage.rig && name.ends_with("GlobalTransform");
        let is_of_bevy = !is_root
            && ["::Transform", "GlobalTransform", "Name", "ChildOf", "Children"].iter().any(|end| name.ends_with(*end));
        let is_state = *entity == stage.rig && STATES.iter().any(|state| name.ends_with(state));
        let is_same = match (before.get(&key), after.get(&key)) {
            _ if is_state => false,
            (Some(before), Some(after)) => {
                before.reflect_partial_eq(&**after).unwrap_or_else(|| format!("{before:?}") == format!("{after:?}"))
            }
            (None, Some(_)) => false,
            // State of the rig itself, such as its history and its program: nobody else sees it change.
            _ if *entity == stage.rig => false,
            _ if name.ends_with("CommandReport") => reports.get(entity) == stage.get::<CommandReport>(*entity),
            _ if is_of_ours => panic!("{name} has no value that could be compared"),
            _ => false,
        };
        if is_same && (is_of_ours || is_of_bevy) {
            same.push(format!("{name} of {:?}", stage.get::<Name>(*entity)));
        }
    }
    (same, written.len())
}

/// An edit of one parameter, and undoing it, writes no component whose value stays the same.
#[test]
fn no_value_that_stays_the_same_is_written() {
    let mut stage = biped();
    let text = |module: &'static str, part: &'static str| move |m: &str, p: &str| m == module && p.contains(part);
    // Commands by module and a part of their parameters, and what takes the place of that part.
    let table = [
        ("control", "shape: \"cube\"", "shape: \"sphere\""),
        ("control", "shape: \"circle\"", "shape: \"circle\", size: 0.123"),
        ("control", "shape: \"cog\"", "shape: \"cog\", color: Some((0.1, 0.2, 0.3))"),
        ("half_joint", "push: ", "fit_push: false, push: 1"),
        ("attribute", "default: 1.0", "default: 0.75"),
        ("attribute", "max: Some(1.0)", "max: Some(2.0)"),
        ("twist", "count: 4", "count: 3"),
        ("twist", "counter: true", "counter: false"),
        ("null", "(creation", "(orient: false, creation"),
        ("space_switch", "[\"world\", \"chest\"]", "[\"here\", \"there\"]"),
        ("ik_fk_switch", "stretch: \"stretch\"", "stretch: \"stretch\", hide: false"),
    ];
    let mut edited = 0;
    for (module, part, by) in table {
        let found = stage.rig().walk().any(|joint| {
            joint.data.tags.iter().any(|tag| match &tag.kind {
                TagKind::Command { module: m, params, .. } => text(module, part)(m, params),
                TagKind::Feature { .. } => false,
            })
        });
        if !found {
            continue;
        }
        edited += 1;
        let (joint, mut tag) = command(&stage, text(module, part));
        if let TagKind::Command { params, .. } = &mut tag.kind {
            *params = params.replacen(part, by, 1);
        }
        let what = format!("{module}: {by}");
        let (same, count) =
            unchanged_writes(&mut stage, |stage| stage.apply_all(vec![RigEdit::SetTag(joint, Box::new(tag))]));
        assert!(count > 0, "{what}: the edit is seen");
        assert_eq!(same, Vec::<String>::new(), "{what}");
        let (same, count) = unchanged_writes(&mut stage, |stage| stage.change(Change::Undo));
        assert!(count > 0, "{what}: undoing is seen");
        assert_eq!(same, Vec::<String>::new(), "{what}, undone");
    }
    assert!(edited >= 7, "{edited} of the parameters are those of the biped");
    // A pose, too.
    let control = stage.control("hand_ik_l");
    let (same, count) = unchanged_writes(&mut stage, |stage| {
        stage.app.world_mut().get_mut::<Transform>(control).unwrap().translation.y += 0.01;
        stage.app.update();
    });
    assert!(count > 0);
    assert_eq!(same, Vec::<String>::new(), "a pose");
    assert!(stage.get::<Control>(control).is_some());
    let built = &stage.get::<BuildResult>(stage.rig).unwrap().0;
    assert!(built.nodes.iter().any(|node| node.kind == NodeType::Control));
}
