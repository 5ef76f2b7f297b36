//! Documents with several meshes: body, clothes and hair of one character.

use std::sync::Arc;

use rigsmith::{
    editor::{files::RemoveMeshRequest, next_step::next_step},
    mesh::model::{Model, Weights},
    rig::SkinData,
};

use super::{journals::crash, *};

/// A tetrahedron in an object with a material of that name, `x` to the side.
fn write_mesh(folder: &Path, name: &str, x: f32) -> PathBuf {
    std::fs::write(folder.join(format!("{name}.mtl")), format!("newmtl {name}\nKd 1 0 0\nmap_Kd {name}.png\n"))
        .expect("written");
    std::fs::write(folder.join(format!("{name}.png")), b"\x89PNG\r\n\x1a\n".as_slice()).expect("written");
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let corners = corners.map(|[a, b, c]: [f32; 3]| format!("v {} {b} {c}\n", a + x)).concat();
    let faces = "f 1/1 3/1 2/1\nf 1/1 2/1 4/1\nf 2/1 3/1 4/1\nf 3/1 1/1 4/1\n";
    let text = format!("mtllib {name}.mtl\no {name}\n{corners}vt 0 0\nusemtl {name}\n{faces}");
    let path = folder.join(format!("{name}.obj"));
    std::fs::write(&path, text).expect("written");
    path
}

impl Window {
    fn add_mesh(&mut self, path: &Path) {
        self.act(Action::AddMesh);
        assert!(matches!(self.question(), Some(Question::Mesh)), "{:?}", self.question());
        self.answer(Answer::Path(path.to_owned()));
    }

    /// Drops files on the window, together.
    fn drop_files(&mut self, paths: &[&Path]) {
        for path in paths {
            let dropped = FileDragAndDrop::DroppedFile { window: Entity::PLACEHOLDER, path_buf: (*path).to_owned() };
            self.base.app.world_mut().write_message(dropped);
        }
        self.settle();
    }

    /// Names and uids of the open meshes, by name.
    fn meshes(&self) -> Vec<(String, Uid)> {
        let meshes = self.world().get::<RigMeshes>(self.base.open_rig());
        let meshes = meshes.iter().flat_map(|meshes| meshes.iter());
        let meshes = meshes.filter_map(|mesh| self.world().get::<RigMesh>(mesh));
        let mut list: Vec<(String, Uid)> = meshes.map(|mesh| (mesh.file.name.clone(), mesh.uid)).collect();
        list.sort();
        list
    }

    /// Binds all four points of a mesh to a joint.
    fn bind(&mut self, mesh: Uid, joint: Uid) {
        let mut weights = Weights::default();
        (0..4).for_each(|_| weights.push([(0, 1.0)]));
        let skin = SkinData { joints: vec![joint], weights, at_rest: true, ..default() };
        self.change(Change::Do(Operation::Edits(vec![RigEdit::SetSkin(mesh, Some(Arc::new(skin)))])));
    }
}

/// A body with a coat beside it, each of which has a joint of its own.
fn dressed(folder: &Path) -> (Window, [(Uid, Uid); 2]) {
    let mut window = Window::new(folder);
    window.open_file(&write_mesh(folder, "body", 0.0));
    window.place(0.5);
    window.place(1.0);
    window.add_mesh(&write_mesh(folder, "coat", 10.0));
    let joints: Vec<Uid> = window.rig().walk().map(|joint| joint.data.uid).collect();
    let meshes = window.meshes();
    assert_eq!((joints.len(), meshes.len()), (2, 2), "{:?}", window.notices.list);
    (window, [(meshes[0].1, joints[0]), (meshes[1].1, joints[1])])
}

/// Objects with what hangs on them: the name, the name of the material, the least x, and the joints that move it.
fn objects(model: &Model) -> Vec<(String, String, f32, Vec<String>)> {
    let weights = model.weights.as_ref().expect("weights");
    assert_eq!(weights.len(), model.points.len());
    let of_part = |part: &rigsmith::mesh::model::Part| {
        let material = &model.material_set.materials[part.material.expect("a material")];
        let least = part.vertices.iter().map(|point| model.points[*point as usize].x).fold(f32::INFINITY, f32::min);
        let influences = part.vertices.iter().flat_map(|point| weights.of(*point as usize));
        let mut joints: Vec<String> = influences.map(|(node, _)| model.nodes[node as usize].name.clone()).collect();
        joints.sort();
        joints.dedup();
        let material = material["name"].as_str().expect("a name").to_owned();
        (model.objects[part.object].name.clone(), material, least, joints)
    };
    let mut list: Vec<_> = model.parts.iter().map(of_part).collect();
    list.sort_by(|a, b| a.0.cmp(&b.0));
    list
}

#[test]
fn all_meshes_are_in_one_exported_file() {
    let folder = folder();
    let (mut window, [body, coat]) = dressed(folder.path());
    window.bind(body.0, body.1);
    let next = next_step(window.world()).expect("a next step");
    assert!(next.starts_with("coat has no weights yet"), "{next}");
    let path = window.export("half.glb");
    let loose = "joints do not move \"coat\", without weights";
    assert!(window.notices.include(Severity::Warning, loose), "{:?}", window.notices.list);
    let half = load_model(&RealDisk, &path).expect("a model");
    let skins: Vec<bool> = half.objects.iter().map(|object| object.skin.is_some()).collect();
    assert_eq!(skins.iter().filter(|is_skinned| **is_skinned).count(), 1, "{skins:?}");
    assert_eq!(skins.len(), 2, "a mesh without weights is there, too");

    window.bind(coat.0, coat.1);
    assert!(next_step(window.world()).is_some_and(|next| !next.contains("coat")));
    let labels: Vec<String> = [body.1, coat.1]
        .iter()
        .map(|joint| window.rig().joint(*joint).and_then(|joint| joint.data.label.clone()).expect("a label"))
        .collect();
    for name in ["both.glb", "both.gltf"] {
        let path = window.export(name);
        let model = load_model(&RealDisk, &path).expect("a model");
        let wanted = [("body", 0.0_f32, &labels[0]), ("coat", 10.0, &labels[1])]
            .map(|(name, x, label)| (name.to_owned(), name.to_owned(), x, vec![label.clone()]));
        assert_eq!(objects(&model), wanted, "{name}");
        assert_eq!(model.skins.len(), 1, "both have one bind pose");
        assert!(model.objects.iter().all(|object| object.skin == Some(0)), "{name}");
        // Each material has the texture and the image of its own mesh.
        let set = &model.material_set;
        assert_eq!((set.materials.len(), set.textures.len(), set.images.len()), (2, 2, 2), "{name}");
        for material in &set.materials {
            let texture = material["pbrMetallicRoughness"]["baseColorTexture"]["index"].as_u64().expect("a texture");
            let image = set.textures[texture as usize]["source"].as_u64().expect("an image");
            let wanted = material["name"].as_str().expect("a name");
            assert!(set.images[image as usize].name.starts_with(wanted), "{name}: {wanted}");
        }
    }
    let model = load_model(&RealDisk, &window.export("both.obj")).expect("a model");
    assert_eq!((model.points.len(), model.objects.len()), (8, 2));

    window.notices.list.clear();
    window.export("both.rig.ron");
    assert!(window.notices.list.iter().all(|notice| !notice.text.contains("mesh")), "{:?}", window.notices.list);
    window.export("one.skin");
    let (written, left) = if body.0 < coat.0 { ("body", "coat") } else { ("coat", "body") };
    let told = format!("a .skin file is of one mesh, \"{written}\": the weights of \"{left}\" are not in it");
    assert!(window.notices.include(Severity::Warning, &told), "{:?}", window.notices.list);
}

#[test]
fn files_that_are_dropped_together_are_one_document() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let (body, coat) = (write_mesh(folder.path(), "body", 0.0), write_mesh(folder.path(), "coat", 10.0));
    let mut window = Window::new(folder.path());
    let names = |window: &Window| -> Vec<String> { window.meshes().into_iter().map(|(name, _)| name).collect() };
    // People drop all files of a mesh, the textures first.
    window.drop_files(&[&at("body.png"), &at("body.mtl"), &body, &coat]);
    assert_eq!(names(&window), ["body", "coat"], "{:?}", window.notices.list);
    assert!(window.notices.list.iter().all(|notice| notice.severity != Severity::Error), "{:?}", window.notices.list);
    assert!(title(window.world()).starts_with("body"), "the first one is the document");
    window.change(Change::Undo);
    assert_eq!(names(&window), ["body"], "the other one came to it as a step");

    window.place(0.5);
    let before = (window.rig(), window.meshes());
    window.drop_files(&[&coat, &body]);
    assert!(matches!(window.question(), Some(Question::Unsaved { .. })), "{:?}", window.notices.list);
    window.answer(Answer::Cancel);
    assert_eq!((window.rig(), window.meshes()), before, "nothing comes to the document that stays");
    window.drop_files(&[&coat, &body]);
    window.answer(Answer::Discard);
    assert_eq!((names(&window), window.rig().len()), (vec!["body".to_owned(), "coat".to_owned()], 0));
    assert!(title(window.world()).starts_with("coat"));

    let project = window.save_as("dressed.rigsmith.ron");
    let before = window.meshes();
    std::fs::write(at("broken.glb"), b"hello").expect("written");
    window.drop_files(&[&at("broken.glb"), &body]);
    assert!(window.notices.include(Severity::Error, "broken.glb"), "{:?}", window.notices.list);
    let told = "The files beside broken.glb were not opened, either";
    assert!(window.notices.include(Severity::Info, told), "{:?}", window.notices.list);
    assert_eq!(window.meshes(), before);
    // A mesh that is dropped with a project comes to it.
    window.drop_files(&[&write_mesh(folder.path(), "hat", 20.0), &project]);
    assert_eq!(names(&window), ["body", "coat", "hat"], "{:?}", window.notices.list);
}

/// A window that goes on with the work on a project that a crash left.
fn recovered(folder: &Path, project: &Path) -> Window {
    let mut window = Window::new(folder);
    window.open_file(project);
    let Some(Question::Recover(list)) = window.question() else {
        panic!("nothing is offered beside the project: {:?}", window.notices.list)
    };
    let ours = list.iter().find(|pending| pending.path.starts_with(folder)).expect("our work is offered");
    let ours = ours.path.clone();
    window.answer(Answer::Recover(ours));
    window
}

#[test]
fn meshes_come_and_go_as_steps() {
    let folder = folder();
    let (mut window, [body, coat]) = dressed(folder.path());
    let alone = (window.rig(), vec![window.meshes()[0].clone()]);
    window.change(Change::Undo);
    assert_eq!((window.rig(), window.meshes()), alone, "undo takes the added mesh away");
    window.change(Change::Redo);
    assert_eq!(window.meshes().len(), 2);
    window.bind(body.0, body.1);
    window.bind(coat.0, coat.1);
    let project = window.save_as("dressed.rigsmith.ron");
    let both = (window.rig(), window.meshes());
    window.send(RemoveMeshRequest(coat.0));
    let one = (window.rig(), window.meshes());
    assert_eq!((one.0.skins().count(), one.1.len()), (1, 1));
    window.change(Change::Undo);
    assert_eq!((window.rig(), window.meshes()), both, "undo brings the mesh back with its weights");
    assert!(!window.is_unsaved(), "as it was saved");
    window.change(Change::Redo);
    assert!((window.rig(), window.meshes()) == one && window.is_unsaved());

    // A removed mesh is away after a crash, too, and undo brings it back there.
    crash(window);
    let mut window = recovered(folder.path(), &project);
    assert_eq!((window.rig(), window.meshes()), one, "{:?}", window.notices.list);
    window.change(Change::Undo);
    assert_eq!((window.rig(), window.meshes()), both, "{:?}", window.notices.list);
    window.change(Change::Redo);
    window.act(Action::Save);
    assert!(!window.is_unsaved(), "{:?}", window.notices.list);
    // The file does not have the mesh, which an undo after the save brings back.
    window.change(Change::Undo);
    assert_eq!((window.rig(), window.meshes()), both);
    crash(window);
    let window = recovered(folder.path(), &project);
    assert_eq!((window.rig(), window.meshes()), both, "{:?}", window.notices.list);
}

#[test]
fn added_meshes_are_saved_recovered_and_removed() {
    let folder = folder();
    let (mut window, [_, coat]) = dressed(folder.path());
    assert!(
        window.is_unsaved() && window.notices.include(Severity::Done, "Added coat.obj: the Skinning panel binds it")
    );
    window.bind(coat.0, coat.1);
    let project = window.save_as("dressed.rigsmith.ron");
    assert!(!window.is_unsaved(), "{:?}", window.notices.list);
    // A mesh that is added after the save is in the journal alone.
    window.add_mesh(&write_mesh(folder.path(), "hat", 20.0));
    window.place(1.5);
    let (rig, meshes) = (window.rig(), window.meshes());
    assert_eq!(meshes.len(), 3);
    crash(window);
    let mut window = recovered(folder.path(), &project);
    assert_eq!((window.rig(), window.meshes()), (rig, meshes), "{:?}", window.notices.list);

    // What is removed takes its weights along.
    window.send(RemoveMeshRequest(coat.0));
    let names: Vec<String> = window.meshes().into_iter().map(|(name, _)| name).collect();
    assert_eq!((names, window.rig().skin(coat.0)), (vec!["body".to_owned(), "hat".to_owned()], None));
    assert!(window.is_unsaved() && window.notices.include(Severity::Done, "Removed the mesh coat"));
    window.act(Action::Save);
    let mut other = Window::new(folder.path());
    other.open_file(&project);
    assert_eq!((other.rig(), other.meshes()), (window.rig(), window.meshes()), "{:?}", other.notices.list);
}

#[test]
fn added_meshes_keep_their_weights_for_joints_of_the_same_names() {
    let folder = folder();
    let (mut window, [body, coat]) = dressed(folder.path());
    window.bind(body.0, body.1);
    window.bind(coat.0, coat.1);
    let file = window.export("character.glb");

    let mut other = Window::new(folder.path());
    other.base.app.insert_resource(UidSource::seeded(99));
    other.open_file(&folder.path().join("body.obj"));
    other.place(0.5);
    other.place(1.0);
    let joints: Vec<Uid> = other.rig().walk().map(|joint| joint.data.uid).collect();
    let before = other.rig();
    other.add_mesh(&file);
    assert!(other.notices.include(Severity::Done, "Added character.glb with its weights"), "{:?}", other.notices.list);
    let rig = other.rig();
    let (_, skin) = rig.skins().next().expect("weights");
    assert_eq!((rig.len(), skin.joints.clone()), (2, joints));
    other.change(Change::Undo);
    assert_eq!((other.rig(), other.meshes().len()), (before.clone(), 1), "it comes with its weights as one step");

    // Weights for joints of other names would be for nothing.
    let joint = before.roots()[0];
    other.change(Change::Do(Operation::Edits(vec![RigEdit::SetLabel(joint, Some("tail".to_owned()))])));
    other.add_mesh(&file);
    let told = "Added character.glb without its weights";
    assert!(other.notices.include(Severity::Done, told), "{:?}", other.notices.list);
    assert_eq!(other.rig().skins().count(), 0);
    other.add_mesh(&folder.path().join("body.rig.ron"));
    assert!(other.notices.include(Severity::Error, "body.rig.ron is no mesh"), "{:?}", other.notices.list);
}
