//! Projects keep the version of the template that a rig took over with its parts, so that the next version is compared with it.

use std::{fs, path::PathBuf, sync::Arc};

use rigsmith::{
    files::{
        LoadedProject, ProjectTemplate, ProjectToSave, RealDisk, TemplateBase, TemplateVersion, load_project,
        store_project,
    },
    rig::{Rig, RigEdit, Uid},
};

use super::{
    cli_outputs::rigsmith,
    part_fields::{BASE, PART},
    saved_text::joints,
};

/// A folder with a hand, and with a project whose rig follows it.
struct Shot {
    folder: tempfile::TempDir,
    /// The rig of the project, in which a person has locked a joint of the finger.
    rig: Rig,
    /// The part instance.
    part: Uid,
}

impl Shot {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("finger.rig.ron"), PART).unwrap();
        fs::write(at("hand.rig.ron"), BASE).unwrap();
        let version = TemplateVersion::read(&RealDisk, &at("hand.rig.ron")).unwrap();
        let mut rig = version.rig().clone();
        let joint = rig.find_label("a_bone_3").unwrap();
        rig.apply(&RigEdit::SetLocked(joint, true)).unwrap();
        let base = TemplateBase { rig: Arc::new(version.rig().clone()), text: version.text_with_parts() };
        let template = ProjectTemplate { rig: rig.uid(), path: at("hand.rig.ron"), base };
        let (rigs, templates) = (vec![rig.clone()], vec![template]);
        let project = ProjectToSave { name: "shot".into(), rigs, templates, ..ProjectToSave::default() };
        store_project(&RealDisk, &at("shot.rigsmith.ron"), &project).unwrap();
        let part = version.parts()[0].uid;
        Self { folder, rig, part }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Updates a project to the file of the template. Returns the new project and what was said.
    fn updated(&self, from: &str, to: &str) -> (LoadedProject, String) {
        let (code, said) = rigsmith(self.folder.path(), &["update", from, "--from", "hand.rig.ron", "-o", to]);
        assert_eq!(code, 0, "{said}");
        let project = load_project(&RealDisk, &self.at(to)).unwrap();
        assert_eq!(project.notes.len(), 0, "{:?}", project.notes);
        for joint in self.rig.walk() {
            let now = project.rigs[0].joint(joint.data.uid);
            assert!(now.is_some_and(|now| now.data.locked == joint.data.locked), "{:?}: {said}", joint.data.label);
        }
        (project, said)
    }
}

#[test]
fn a_project_is_opened_with_the_parts_of_the_version_that_its_rig_follows() {
    let shot = Shot::new();
    let template = load_project(&RealDisk, &shot.at("shot.rigsmith.ron")).unwrap().templates.remove(0);
    assert_eq!(template.base.text.as_deref(), Some(BASE));
    let version = template.base.version(&RealDisk, &template.path).unwrap();
    assert_eq!((version.parts()[0].uid, version.parts().len()), (shot.part, 1));
    // What a part brought then is in the rig alone once its file is another.
    fs::write(shot.at("finger.rig.ron"), PART.replace("(0, 1, 0)", "(0, 2, 0)")).unwrap();
    assert!(template.base.version(&RealDisk, &template.path).is_none());
    assert_eq!(template.base.parts()[0].uid, shot.part);
}

#[test]
fn fields_of_parts_are_merged_with_the_version_that_a_project_keeps() {
    let shot = Shot::new();
    fs::write(shot.at("hand.rig.ron"), BASE.replace("prefix: \"a_\",", "prefix: \"a_\", count: 5,")).unwrap();
    let (project, said) = shot.updated("shot.rigsmith.ron", "next.rigsmith.ron");
    assert!(said.contains("changed  part index count: nothing to 5") && !said.contains("conflict"), "{said}");
    assert_eq!(project.rigs[0].len(), shot.rig.len() + 2);
    // The version that was taken over is kept in turn.
    fs::write(shot.at("hand.rig.ron"), BASE.replace("prefix: \"a_\",", "prefix: \"a_\", count: 4,")).unwrap();
    let (_, said) = shot.updated("next.rigsmith.ron", "last.rigsmith.ron");
    assert!(said.contains("changed  part index count: 5 to 4"), "{said}");
}

#[test]
fn a_part_that_got_another_name_is_the_same_one_for_a_project_though_its_file_has_changed() {
    let shot = Shot::new();
    fs::write(shot.at("hand.rig.ron"), BASE.replace("\"index\"", "\"pointer\"")).unwrap();
    fs::write(shot.at("finger.rig.ron"), PART.replace("(0, 1, 0)", "(0, 2, 0)")).unwrap();
    let (project, said) = shot.updated("shot.rigsmith.ron", "next.rigsmith.ron");
    assert!(said.contains("renamed  part index to pointer?") && !said.contains("removed"), "{said}");
    let rig = &project.rigs[0];
    let tip = rig.joint(rig.find_label("a_bone_3").unwrap()).unwrap();
    assert_eq!((rig.len(), tip.data.rest.translation.y), (shot.rig.len(), 2.0));
    let part = &project.templates[0].base.parts()[0];
    assert_eq!((part.uid, part.name.as_str()), (shot.part, "pointer"));
    // The same file again changes nothing.
    let (again, said) = shot.updated("next.rigsmith.ron", "last.rigsmith.ron");
    assert!(!said.contains("renamed") && !said.contains("added"), "{said}");
    assert_eq!(joints(&again.rigs[0]), joints(rig));
}
