//! Meshes of recovered work whose files have gone or changed.

use std::sync::Arc;

use rigsmith::{mesh::model::Weights, rig::SkinData};

use super::{journals::crash, *};

/// Work on a body and a hat, which was added after the save and is bound; the window ends as in a crash.
fn crashed_work(folder: &Path) -> [PathBuf; 2] {
    let body = folder.join("body.obj");
    let hat = folder.join("hat.obj");
    for path in [&body, &hat] {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
        std::fs::write(path, text).expect("written");
    }
    let mut window = Window::new(folder);
    window.open_file(&body);
    window.place(0.5);
    let project = window.save_as("dressed.rigsmith.ron");
    window.act(Action::AddMesh);
    window.answer(Answer::Path(hat.clone()));
    let (_, uid) = window.meshes_by_name().pop().expect("a hat");
    let joint = window.rig().roots()[0];
    let mut weights = Weights::default();
    (0..4).for_each(|_| weights.push([(0, 1.0)]));
    let skin = SkinData { joints: vec![joint], weights, at_rest: true, ..default() };
    window.change(Change::Do(Operation::Edits(vec![RigEdit::SetSkin(uid, Some(Arc::new(skin)))])));
    crash(window);
    [project, hat]
}

impl Window {
    fn meshes_by_name(&self) -> Vec<(String, Uid)> {
        let meshes = self.world().get::<RigMeshes>(self.base.open_rig()).expect("meshes");
        let meshes = meshes.iter().filter_map(|mesh| self.world().get::<RigMesh>(mesh));
        let mut list: Vec<(String, Uid)> = meshes.map(|mesh| (mesh.file.name.clone(), mesh.uid)).collect();
        list.sort();
        list
    }

    fn recover_beside(&mut self, project: &Path) {
        self.open_file(project);
        let Some(Question::Recover(list)) = self.question() else {
            panic!("nothing is offered beside the project: {:?}", self.notices.list)
        };
        let ours = list.iter().find(|pending| pending.path.starts_with(&self.folder));
        let ours = ours.expect("our work is offered").path.clone();
        self.answer(Answer::Recover(ours));
    }
}

#[test]
fn a_mesh_whose_file_has_gone_stays_in_the_project() {
    let folder = folder();
    let [project, hat] = crashed_work(folder.path());
    let away = folder.path().join("away");
    std::fs::rename(&hat, &away).expect("moved away");
    let mut window = Window::new(folder.path());
    window.recover_beside(&project);
    assert_eq!(window.meshes_by_name().len(), 1, "{:?}", window.notices.list);
    let told = "put the file back and recover again before you save";
    assert!(window.notices.include(Severity::Warning, told), "{:?}", window.notices.list);
    window.act(Action::Save);
    std::fs::rename(&away, &hat).expect("moved back");
    let mut other = Window::new(folder.path());
    other.open_file(&project);
    let names: Vec<String> = other.meshes_by_name().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["body", "hat"], "{:?}", other.notices.list);
}

#[test]
fn a_mesh_that_changed_before_the_recovery_is_told() {
    let folder = folder();
    let [project, hat] = crashed_work(folder.path());
    std::fs::write(&hat, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    let mut window = Window::new(folder.path());
    window.recover_beside(&project);
    let told = "has changed since it was bound: it has 3 points now";
    assert!(window.notices.include(Severity::Warning, told), "{:?}", window.notices.list);
}
