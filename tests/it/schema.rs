//! The schema of rigs: components that are registered for reflection, and the same ones in a game as in the editor.

use std::{
    any::TypeId,
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use bevy::{
    asset::AssetPlugin,
    ecs::{
        reflect::{AppTypeRegistry, ReflectComponent},
        resource::IsResource,
    },
    prelude::*,
};
use rigsmith::{
    files::BUNDLED_CHARACTERS,
    instance::{RigInstance, RigInstancePlugin, RigTemplate},
    plugins::{
        RigPlugins,
        commands::{BuildRequest, BuildResult, BuildStep},
        document::EditRequest,
        runtime::{InstanceMode, RigNodes, RigRuntime},
        schema::{Control, CreatedRole, Joint, NodeLabel, NodeLayer, NodeOf, NodeSlot, Null},
    },
    rig::{NodeKind, RestTransform, Rig, RigEdit, Uid, operations::Operation},
    test_app::test_app,
};

use super::bench::HANG;

/// Names of components in the first column of a table of `plugins`, without the module in front.
fn table_components(head: &str) -> BTreeSet<String> {
    let text = include_str!("../../src/plugins.rs");
    let rows = text
        .lines()
        .map(|line| line.strip_prefix("//! | "))
        .skip_while(|row| row.is_none_or(|row| !row.starts_with(head)));
    let cells = rows.map_while(|row| row?.split(" | ").next());
    let mut names = BTreeSet::new();
    for cell in cells.filter(|cell| cfg!(feature = "draw") || !cell.contains("(feature `draw`)")) {
        for piece in cell.split('`').skip(1).step_by(2) {
            let name = piece.rsplit("::").next().unwrap();
            if name.starts_with(char::is_uppercase) {
                names.insert(name.to_owned());
            }
        }
    }
    names
}

/// Components that inspectors and remote tools show.
fn reflected_components() -> BTreeSet<String> {
    table_components("component | ")
}

/// Tasks and notes of the plugins, which have no reflection.
fn hidden_components() -> BTreeSet<String> {
    table_components("component without reflection | ")
}

#[test]
fn every_component_of_the_table_is_registered() {
    let names = reflected_components();
    assert!(names.len() > 30, "the table was not read: {names:?}");
    for name in ["Rig", "NodeSlot", "BuildFailure", "RunFailure", "ParkedNode", "Constrains"] {
        assert!(names.contains(name), "the table lacks {name}");
    }
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, RigPlugins));
    let registry = app.world().resource::<AppTypeRegistry>().read();
    for name in names {
        let found = registry.get_with_short_type_path(&name);
        let found = found.unwrap_or_else(|| panic!("{name} is not registered, or several types have its name"));
        assert!(found.data::<ReflectComponent>().is_some(), "{name} is not reflected as a component");
    }
}

/// An app with the plugins of a game.
fn app_of_a_game() -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        AssetPlugin::default(),
        TransformPlugin,
        RigPlugins,
        RigInstancePlugin::default(),
    ));
    app
}

/// Every component that inspectors and remote tools can name is in the table.
#[test]
fn every_registered_component_is_told() {
    let app = app_of_a_game();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let names = reflected_components();
    let registered = registry.iter().filter(|of| of.data::<ReflectComponent>().is_some());
    // The editor's own components describe its windows, not rigs.
    let own = registered
        .map(|of| of.type_info().type_path_table())
        .filter(|table| table.path().starts_with("rigsmith::") && !table.path().starts_with("rigsmith::editor::"));
    let missing: Vec<&str> = own
        .map(|table| table.path())
        .filter(|path| {
            let name = path.rsplit("::").next().unwrap();
            !names.contains(name)
        })
        .collect();
    assert!(missing.is_empty(), "the table of `plugins` lacks {missing:?}");
    for name in ["RigInstance", "RigSource", "UpdateOffer", "RigInputs", "RigStage"] {
        assert!(registry.get_with_short_type_path(name).is_some(), "{name} is not registered");
    }
}

/// Every component of the schema is in the table, and registered.
#[test]
fn every_component_of_the_schema_is_told() {
    let text = include_str!("../../src/plugins/schema.rs");
    let mut lines = text.lines();
    let names = reflected_components();
    let mut count = 0;
    while let Some(line) = lines.next() {
        if !line.starts_with("#[derive(Component") {
            continue;
        }
        let declaration = lines.by_ref().find(|line| line.starts_with("pub struct")).unwrap();
        let name: String = declaration["pub struct ".len()..].chars().take_while(|c| c.is_alphanumeric()).collect();
        assert!(names.contains(&name), "the table of `plugins` lacks {name}");
        count += 1;
    }
    assert!(count > 25, "the schema was not read");
}

/// Components that the sources of a folder declare, with their files: public ones, and all others.
fn declared(folder: &Path, public: &mut BTreeMap<String, PathBuf>, private: &mut BTreeSet<String>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        // The window, the command line and the remote calls have components of their own, which tell nothing of rigs.
        if ["editor", "cli", "remote"].contains(&name.trim_end_matches(".rs")) {
            continue;
        }
        if path.is_dir() {
            declared(&path, public, private);
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            let derived = line.strip_prefix("#[derive(").map(|line| line.trim_end_matches(")]"));
            if !derived.is_some_and(|derived| derived.split(", ").any(|name| name == "Component")) {
                continue;
            }
            let is_declaration = |line: &&str| line.contains("struct ") || line.contains("enum ");
            let declaration = lines.by_ref().filter(|line| !line.starts_with(['#', '/'])).find(is_declaration);
            let declaration = declaration.unwrap_or_else(|| panic!("{}: {line}", path.display()));
            let (_, rest) = declaration.split_once("struct ").or_else(|| declaration.split_once("enum ")).unwrap();
            let name: String = rest.chars().take_while(|letter| letter.is_alphanumeric()).collect();
            if declaration.starts_with("pub ") {
                public.insert(name, path.clone());
            } else {
                private.insert(name);
            }
        }
    }
}

/// Every public component has a row, and so has every component that a built rig brings into the world.
#[test]
fn every_public_component_has_a_row() {
    let (mut public, mut private) = (BTreeMap::new(), BTreeSet::new());
    declared(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut public, &mut private);
    assert!(public.len() > 80 && private.len() > 5, "the sources were not read: {public:?}, {private:?}");
    let text = include_str!("../../src/plugins.rs");
    let (reflected, hidden) = (reflected_components(), hidden_components());
    assert!(hidden.contains("SkinningJob"), "{hidden:?}");
    // Without the feature `draw` its components are in no table.
    let is_told = |name: &String| {
        let is_drawn = !cfg!(feature = "draw") && text.contains(&format!("`{name}`"));
        reflected.contains(name) || hidden.contains(name) || is_drawn
    };
    let missing: Vec<_> = public.iter().filter(|(name, _)| !is_told(name)).collect();
    assert!(missing.is_empty(), "the tables of `plugins` lack {missing:?}");
    let both: Vec<&String> = reflected.intersection(&hidden).collect();
    assert!(both.is_empty(), "{both:?} are in both tables");

    let mut app = test_app();
    let rig = app.world_mut().spawn(template().1.rig().as_ref().clone()).id();
    app.world_mut().write_message(BuildRequest { rig, step: BuildStep::All });
    for _ in 0..3 {
        app.update();
    }
    let world = app.world();
    assert!(world.get::<RigRuntime>(rig).is_some());
    let mut found = BTreeSet::new();
    for entity in world.iter_entities().filter(|entity| !entity.contains::<IsResource>()) {
        for component in entity.archetype().components() {
            let name = world.components().get_name(*component).map(|name| name.to_string()).unwrap_or_default();
            if name.starts_with("rigsmith::") {
                found.insert(name.rsplit("::").next().unwrap().to_owned());
            }
        }
    }
    assert!(found.len() > 25, "{found:?}");
    let missing: Vec<_> = found.iter().filter(|name| !is_told(name) && !private.contains(*name)).collect();
    assert!(missing.is_empty(), "the tables of `plugins` lack {missing:?}, which a built rig has");
}

fn template() -> (&'static str, RigTemplate) {
    let (name, text) = BUNDLED_CHARACTERS[0];
    (name, RigTemplate::read(text.as_bytes()).unwrap())
}

/// Kinds of components that describe nodes, by name.
fn node_components(entity: EntityRef) -> BTreeSet<&'static str> {
    let kinds = [
        ("Joint", TypeId::of::<Joint>()),
        ("Null", TypeId::of::<Null>()),
        ("Control", TypeId::of::<Control>()),
        ("NodeLabel", TypeId::of::<NodeLabel>()),
        ("NodeLayer", TypeId::of::<NodeLayer>()),
        ("CreatedRole", TypeId::of::<CreatedRole>()),
        ("NodeOf", TypeId::of::<NodeOf>()),
    ];
    kinds.into_iter().filter(|(_, kind)| entity.contains_type_id(*kind)).map(|(name, _)| name).collect()
}

#[test]
fn instances_carry_the_components_of_a_built_rig() {
    let (name, template) = template();
    let mut editor = App::new();
    editor.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, RigPlugins));
    let rig = editor.world_mut().spawn(template.rig().as_ref().clone()).id();
    editor.world_mut().write_message(BuildRequest { rig, step: BuildStep::All });
    for _ in 0..4 {
        editor.update();
    }
    assert!(
        editor.world().get::<BuildResult>(rig).is_some_and(|built| !built.0.nodes.is_empty()),
        "{name} is not built"
    );
    let by_uid = |world: &World, rig: Entity| -> Vec<(Uid, Entity)> {
        let nodes = world.get::<RigNodes>(rig).unwrap();
        nodes.iter().map(|node| (*world.get::<Uid>(node).unwrap(), node)).collect()
    };
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let mut game = App::new();
        game.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, RigInstancePlugin::default()));
        game.finish();
        game.cleanup();
        let handle = game.world_mut().resource_mut::<Assets<RigTemplate>>().add(template.clone());
        let instance = game.world_mut().spawn((RigInstance(handle), mode)).id();
        let start = std::time::Instant::now();
        while game.world().get::<RigRuntime>(instance).is_none() {
            assert!(start.elapsed() < HANG, "{name} is not built for an instance");
            game.update();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let (told, played) = (editor.world(), game.world());
        let nodes = by_uid(told, rig);
        let known = by_uid(played, instance);
        assert!(known.len() > 50, "{name} has {} nodes in {mode:?}", known.len());
        for (uid, entity) in known {
            let (_, model) = nodes.iter().find(|(other, _)| *other == uid).expect("a node that the editor has, too");
            let node = played.entity(entity);
            assert_eq!(node_components(node), node_components(told.entity(*model)), "{uid} in {mode:?}");
            assert!(node.contains::<NodeSlot>());
            assert_eq!(node.get::<NodeLabel>(), told.get::<NodeLabel>(*model), "{uid} in {mode:?}");
            assert_eq!(node.get::<Control>(), told.get::<Control>(*model), "{uid} in {mode:?}");
            let built = &told.get::<BuildResult>(rig).unwrap().0;
            let rest = RestTransform::from(built.node(uid).unwrap().base);
            assert_eq!(node.get::<RestTransform>(), Some(&rest), "{uid} in {mode:?}");
            if node.contains::<CreatedRole>() {
                // Joints of a document have the rest of the document there.
                assert_eq!(told.get::<RestTransform>(*model), Some(&rest), "{uid}");
            }
            if mode == InstanceMode::Direct {
                assert!(!node.contains::<Transform>(), "{uid} needs no local transform");
            }
        }
    }
}

/// The marker of joints without weights follows the document, back and forth.
#[test]
fn nulls_follow_the_kind_of_their_joint() {
    let (_, template) = template();
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, RigPlugins));
    let rig = app.world_mut().spawn(template.rig().as_ref().clone()).id();
    app.update();
    let joint = template.rig().walk().next().unwrap().data.uid;
    let is_null = |app: &App| {
        let nodes = app.world().get::<RigNodes>(rig).unwrap();
        let node = nodes.iter().find(|node| app.world().get::<Uid>(*node) == Some(&joint)).unwrap();
        (app.world().get::<Joint>(node).is_some(), app.world().get::<Null>(node).is_some())
    };
    assert_eq!(is_null(&app), (true, false));
    for (kind, expected) in [(NodeKind::Null, true), (NodeKind::Joint, false)] {
        let edits = Operation::Edits(vec![RigEdit::SetKind(joint, kind)]);
        app.world_mut().write_message(EditRequest::operation(rig, edits));
        app.update();
        assert_eq!(is_null(&app), (true, expected));
    }
}

/// A character that stands on a joint of a rig with a document is no part of that document.
#[test]
fn instances_below_a_rig_stay_out_of_its_document() {
    let (_, template) = template();
    let mut app = app_of_a_game();
    app.finish();
    app.cleanup();
    let host = app.world_mut().spawn(template.rig().as_ref().clone()).id();
    app.update();
    let before = app.world().get::<Rig>(host).unwrap().clone();
    let joint = app.world().get::<RigNodes>(host).unwrap().iter().next().unwrap();
    let handle = app.world_mut().resource_mut::<Assets<RigTemplate>>().add(template);
    let instance = app.world_mut().spawn((RigInstance(handle), ChildOf(joint))).id();
    let start = std::time::Instant::now();
    while app.world().get::<RigNodes>(instance).is_none() {
        assert!(start.elapsed() < HANG, "the instance is not built");
        app.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    for _ in 0..4 {
        app.update();
    }
    let world = app.world();
    assert_eq!(world.get::<Rig>(host), Some(&before));
    for node in world.get::<RigNodes>(instance).unwrap().iter() {
        assert_eq!(world.get::<NodeOf>(node), Some(&NodeOf(instance)));
    }
}
