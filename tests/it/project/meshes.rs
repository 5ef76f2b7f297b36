//! Projects with meshes: weights beside them, meshes that changed or are missing, and disks that fail.

use super::*;

/// Project that the editor would save after opening.
fn to_save(loaded: LoadedProject) -> ProjectToSave {
    let meshes = loaded.meshes.into_iter().map(|mesh| MeshToSave {
        uid: mesh.uid,
        rig: mesh.rig,
        path: mesh.path,
        nodes: mesh.nodes,
        shape: match mesh.shape {
            MeshState::Open { model, .. } => open_shape(&model),
            MeshState::Missing { shape, .. } => shape,
        },
    });
    let meshes = meshes.collect();
    let LoadedProject { name, rigs, templates, view, journal, .. } = loaded;
    ProjectToSave { name, rigs, meshes, templates, view, journal, ..Default::default() }
}

#[test]
fn what_is_saved_is_opened_and_saving_that_changes_nothing() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    assert_eq!(folder.save(&project), Vec::<String>::new());
    let names: Vec<String> = {
        let mut names: Vec<String> = fs::read_dir(folder.0.path().join("work"))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name != "meshes")
            .collect();
        names.sort();
        names
    };
    assert_eq!(names.len(), 2);
    assert!(names[0].starts_with("hero.") && names[0].ends_with(".skin") && names[1] == "hero.rigsmith.ron");
    assert!(folder.text().contains("path: \"meshes/cube.obj\""), "{}", folder.text());
    let text = folder.text();
    let loaded = folder.load();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    assert_eq!((&loaded.name, &loaded.view, &loaded.journal), (&project.name, &project.view, &project.journal));
    assert!(matches!(&loaded.meshes[0].shape, MeshState::Open { changed: false, .. }));
    folder.save(&to_save(loaded));
    assert_eq!(folder.text(), text);

    // The whole folder moved elsewhere.
    let moved = tempfile::tempdir().unwrap();
    fs::rename(folder.0.path().join("work"), moved.path().join("work")).unwrap();
    let loaded = load_project(&RealDisk, &moved.path().join("work/hero.rigsmith.ron")).unwrap();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    assert_eq!(FileKind::of(&folder.project()), Some(FileKind::Project));
    assert_eq!(stem(&folder.project()), "hero");
}

#[test]
fn weights_follow_a_mesh_that_has_changed() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    folder.save(&project);
    // The same cube with another point in its top, in another order.
    let changed = CUBE.replacen("f 3 4 8 7\n", "v 0.5 1 0.5\nf 3 4 9\nf 4 8 9\nf 8 7 9\nf 7 3 9\n", 1);
    fs::write(folder.mesh(), changed).unwrap();
    let loaded = folder.load();
    assert!(matches!(&loaded.meshes[0].shape, MeshState::Open { changed: true, .. }));
    assert!(loaded.notes.iter().any(|note| matches!(note, ProjectNote::MeshChanged(_))), "{:?}", loaded.notes);
    assert!(loaded.notes.iter().any(|note| note.to_string().contains("8 points copied")), "{:?}", loaded.notes);
    let skin = loaded.rigs[0].skin(Uid(0x50)).unwrap();
    assert_eq!(skin.weights.len(), 9);
    let before = project.rigs[0].skin(Uid(0x50)).unwrap();
    for point in 0..8 {
        let pairs = skin.weights.of(point).zip(before.weights.of(point));
        assert!(pairs.into_iter().all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-6));
    }
    folder.save(&to_save(folder.load()));
    assert!(folder.load().notes.is_empty(), "saved, it is the project's mesh");
}

#[test]
fn a_missing_mesh_loses_nothing() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    folder.save(&project);
    let text = folder.text();
    let skin = fs::read(folder.skin()).unwrap();
    let away = folder.0.path().join("work/meshes/elsewhere.obj");
    fs::rename(folder.mesh(), &away).unwrap();
    let loaded = folder.load();
    assert_eq!(loaded.rigs, project.rigs, "weights and poses included");
    let note = loaded.notes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    assert!(note.contains("cube.obj") && note.contains("put it back"), "{note}");
    let MeshState::Missing { error, .. } = &loaded.meshes[0].shape else { panic!("{:?}", loaded.meshes[0].shape) };
    assert!(matches!(**error, LoadError::Read(_)));
    folder.save(&to_save(loaded));
    assert_eq!(folder.text(), text);
    assert_eq!(fs::read(folder.skin()).unwrap(), skin);
    fs::rename(&away, folder.mesh()).unwrap();
    assert!(folder.load().notes.is_empty());
}

#[test]
fn broken_weights_are_told_and_the_rest_opens() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    folder.save(&project);
    let (skin, text) = (folder.skin(), folder.text());
    let name = skin.file_stem().unwrap().to_str().unwrap();
    let whole = fs::read(&skin).unwrap();
    let missing = || fs::remove_file(&skin).unwrap();
    let cut = || fs::write(&skin, &whole[..whole.len() / 2]).unwrap();
    let outside = || fs::write(folder.project(), text.replacen(name, &format!("../work/{name}"), 1)).unwrap();
    for (break_it, about) in [(&missing as &dyn Fn(), "no file"), (&cut, "skin"), (&outside, "below the project")] {
        let _ = fs::remove_file(&skin);
        folder.save(&project);
        break_it();
        let loaded = folder.load();
        assert_eq!(loaded.notes.len(), 1, "{:?}", loaded.notes);
        assert!(loaded.notes[0].to_string().contains(about), "{:?}", loaded.notes);
        assert!(loaded.rigs[0].skins().next().is_none());
        assert_eq!(loaded.rigs[0].stored_poses(), project.rigs[0].stored_poses());
        assert!(matches!(&loaded.meshes[0].shape, MeshState::Open { changed: false, .. }));
    }
    // A link that leads out of the project's folder is as good as a path that does.
    #[cfg(unix)]
    {
        fs::remove_file(folder.project()).unwrap();
        let _ = fs::remove_file(&skin);
        folder.save(&project);
        let elsewhere = folder.0.path().join("elsewhere.skin");
        fs::rename(&skin, &elsewhere).unwrap();
        std::os::unix::fs::symlink(&elsewhere, &skin).unwrap();
        let loaded = folder.load();
        assert!(loaded.notes[0].to_string().contains("below the project"), "{:?}", loaded.notes);
        assert!(loaded.rigs[0].skins().next().is_none());
    }
    // Weights of another save: still those of this mesh.
    let _ = fs::remove_file(&skin);
    folder.save(&project);
    let hash = text.split(".skin\", hash: \"").nth(1).unwrap()[..16].to_owned();
    fs::write(folder.project(), text.replace(&format!("hash: \"{hash}\""), "hash: \"0000000000000000\"")).unwrap();
    let loaded = folder.load();
    assert!(loaded.notes.len() == 1 && loaded.notes[0].to_string().contains("another time"), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
}

#[test]
fn a_disk_that_fails_leaves_the_old_project_or_the_finished_one() {
    let folder = Folder::new();
    let old = cube(&folder.mesh());
    let mut new = cube(&folder.mesh());
    new.name = "another".into();
    let root = new.rigs[0].roots()[0];
    new.rigs[0].apply(&RigEdit::SetLabel(root, Some("root".into()))).unwrap();
    let counted = FaultyDisk::new(RealDisk, None);
    folder.save(&old);
    store_project(&counted, &folder.project(), &new).unwrap();
    for at in 0..counted.operations() {
        for fault in Fault::ALL {
            folder.save(&old);
            let disk = FaultyDisk::new(RealDisk, Some(FaultPlan { at, fault, lasting: true }));
            let saved = store_project(&disk, &folder.project(), &new);
            let loaded = folder.load();
            let context = format!("{at} {fault:?} {saved:?} {:?}", loaded.notes);
            assert!(loaded.name == old.name || loaded.name == new.name, "{context}");
            if saved.is_ok() {
                assert_eq!(loaded.rigs, new.rigs, "{context}");
            }
            let expected = if loaded.name == new.name { &new } else { &old };
            assert_eq!(loaded.rigs[0].rest_globals(), expected.rigs[0].rest_globals(), "{context}");
            assert_eq!(loaded.rigs[0].skins().count(), 1, "{context}");
        }
    }
}

#[test]
fn weights_of_a_mesh_that_is_not_open_are_told() {
    let folder = Folder::new();
    let mut project = cube(&folder.mesh());
    project.meshes.clear();
    let notes = folder.save(&project);
    assert!(notes.len() == 1 && notes[0].contains("0000000000000050"), "{notes:?}");
    assert_eq!(folder.load().meshes.len(), 0);
}

/// Files that a project names outside of its folder are refused and told, and come back from a copy in the folder.
#[test]
fn meshes_outside_of_the_folder_are_refused() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    folder.save(&project);
    let text = folder.text();
    let away = folder.0.path().join("cube.obj");
    fs::rename(folder.mesh(), &away).unwrap();
    let mut named = vec![away.display().to_string(), "../cube.obj".to_owned(), "meshes/../../cube.obj".to_owned()];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&away, folder.mesh().with_file_name("link.obj")).unwrap();
        named.push("meshes/link.obj".to_owned());
    }
    for name in named {
        fs::write(folder.project(), text.replace("meshes/cube.obj", &name)).unwrap();
        let loaded = folder.load();
        assert_eq!(loaded.rigs, project.rigs, "{name}: weights and poses are kept");
        let [ProjectNote::MeshOutside(error)] = &loaded.notes[..] else { panic!("{name}: {:?}", loaded.notes) };
        assert!(matches!(**error, LoadError::Outside { .. }) && error.to_string().contains("copy it"), "{error}");
        assert!(matches!(loaded.meshes[0].shape, MeshState::Missing { .. }), "{name}");
        assert!(loaded.notes[0].is_serious());
        // Saved again, the project names it as before, and says what will come of it.
        let told = folder.save(&to_save(loaded));
        assert!(told.len() == 1 && told[0].contains("outside"), "{name}: {told:?}");
    }
    fs::write(folder.project(), text.replace("meshes/cube.obj", "../cube.obj")).unwrap();
    fs::copy(&away, folder.project().with_file_name("cube.obj")).unwrap();
    let loaded = folder.load();
    assert!(matches!(&loaded.notes[..], [ProjectNote::FileBeside { .. }]), "{:?}", loaded.notes);
    assert!(matches!(loaded.meshes[0].shape, MeshState::Open { changed: false, .. }));
    folder.save(&to_save(loaded));
    assert!(folder.load().notes.is_empty() && folder.text().contains("path: \"cube.obj\""), "{}", folder.text());
}

/// A template outside of the project's folder is not followed, and the version that the rig took over is kept.
#[test]
fn templates_outside_of_the_folder_are_not_followed() {
    let folder = Folder::new();
    let mut project = cube(&folder.mesh());
    let file = folder.0.path().join("t.rig.ron");
    fs::write(&file, "(format: 1)").unwrap();
    let base = Arc::new(read_project(FOLLOWS.as_bytes()).unwrap().project.templates[0].base.clone());
    let base = base.into();
    project.templates = vec![ProjectTemplate { rig: project.rigs[0].uid(), path: file.clone(), base }];
    let told = folder.save(&project);
    assert!(told.len() == 1 && told[0].contains("RIGSMITH_TEMPLATES"), "{told:?}");
    let loaded = folder.load();
    assert!(matches!(&loaded.notes[..], [ProjectNote::TemplateOutside(_)]), "{:?}", loaded.notes);
    let inside = folder.project().with_file_name("t.rig.ron");
    assert_eq!(loaded.templates[0].path, inside);
    assert_eq!(loaded.templates[0].base, project.templates[0].base);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&file, &inside).unwrap();
        let loaded = folder.load();
        assert!(loaded.templates.is_empty() && loaded.notes.len() == 1, "{:?}", loaded.notes);
    }
}

#[test]
fn a_character_with_a_skeleton_of_its_own_goes_through_a_project() {
    let folder = Folder::new();
    let posed = cube(&folder.mesh());
    let model = load_model(&RealDisk, &folder.mesh()).unwrap();
    let parts = Character {
        rig: &posed.rigs[0],
        built: None,
        file: &model,
        rest: &model,
        nodes: &[],
        skin: posed.rigs[0].skin(Uid(0x50)).map(|skin| &**skin),
    };
    let path = folder.0.path().join("work/meshes/cube.glb");
    store_model(&RealDisk, &path, &character(&parts), &GltfWriteSettings::default()).unwrap();

    let model = load_model(&RealDisk, &path).unwrap();
    let mut uids = UidSource::seeded(9);
    let mut rig = Rig::new(uids.next_uid(), "cube");
    let skeleton = import_skeleton(&model, &mut uids);
    assert!(!skeleton.nodes.is_empty() && skeleton.skin.is_some());
    skeleton.edits.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
    let uid = uids.next_uid();
    rig.apply(&RigEdit::SetSkin(uid, skeleton.skin)).unwrap();
    let nodes = skeleton.nodes.into();
    let mesh = MeshToSave { uid, rig: rig.uid(), path: path.clone(), nodes, shape: open_shape(&model) };
    let project = ProjectToSave { name: "cube".into(), rigs: vec![rig], meshes: vec![mesh], ..Default::default() };
    folder.save(&project);
    let loaded = folder.load();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    assert!(!loaded.rigs[0].skin(uid).unwrap().at_rest, "the file's own bind pose");
    assert_eq!(loaded.meshes[0].nodes[..], project.meshes[0].nodes[..]);
}

/// Weights of some points, with a joint that joins the list, are saved with the others; taking them back gives the first
/// file.
#[test]
fn painted_weights_are_saved_with_the_project() {
    let folder = Folder::new();
    let mut project = cube(&folder.mesh());
    folder.save(&project);
    let text = folder.text();
    let mesh = project.meshes[0].uid;
    let before = project.rigs[0].skin(mesh).unwrap().clone();
    let mut rows = Weights { starts: vec![0], ..Weights::default() };
    rows.push([(3, 0.75), (0, 0.25)]);
    rows.push([(1, 1.0)]);
    let patch = WeightPatch::new(&before, vec![(Uid(0x77), Some(before.joints[0]))], vec![2, 7], rows);
    let inverse = project.rigs[0].apply(&RigEdit::SetWeights(mesh, Box::new(patch))).unwrap();
    folder.save(&project);
    assert_ne!(folder.text(), text, "the file names other weights");
    let loaded = folder.load();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    project.rigs[0].apply(&inverse).unwrap();
    folder.save(&project);
    assert_eq!((folder.text(), folder.load().rigs), (text, project.rigs));
}
