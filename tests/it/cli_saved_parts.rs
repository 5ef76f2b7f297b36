//! Commands that save over templates with parts: the parts stay parts.

use std::{fs, path::Path};

use super::{cli_outputs::rigsmith, part_instances::load};

fn biped() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    fs::read_to_string(path).unwrap()
}

#[test]
fn an_update_of_the_hips_places_the_parts_of_the_biped_anew() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let hips = |height: &str| biped().replace("(0, 0.955, -0.006)", &format!("(0, {height}, -0.006)"));
    fs::write(at("b.rig.ron"), biped()).unwrap();
    fs::write(at("n.rig.ron"), hips("1.0")).unwrap();
    let update = ["update", "b.rig.ron", "--from", "n.rig.ron", "--base", "b.rig.ron", "-o", "o.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &update);
    assert_eq!(code, 0, "{said}");
    assert_eq!(fs::read_to_string(at("o.rig.ron")).unwrap(), hips("1.0"));
    // The next move of the hips places neck, arms and legs again.
    fs::write(at("m.rig.ron"), hips("1.1")).unwrap();
    let update = ["update", "o.rig.ron", "--from", "m.rig.ron", "--base", "n.rig.ron", "-o", "p.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &update);
    assert_eq!(code, 0, "{said}");
    assert_eq!(fs::read_to_string(at("p.rig.ron")).unwrap(), hips("1.1"));
    let (_, said) = rigsmith(folder.path(), &["diff", "p.rig.ron", "m.rig.ron"]);
    assert!(said.contains("no differences"), "{said}");
}

#[test]
fn rigs_that_are_merged_below_joints_of_parts_leave_the_parts() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("biped.rig.ron"), biped()).unwrap();
    let tail = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/parts/tail.rig.ron");
    fs::copy(tail, at("tail.rig.ron")).unwrap();
    let ring = "(format: 2, name: \"ring\", joints: [(label: \"ring\", translation: (0.7, 1, 0), tags: [control()])])";
    fs::write(at("ring.rig.ron"), ring).unwrap();
    for (other, parent) in [("ring.rig.ron", "hand_l"), ("tail.rig.ron", "hips"), ("tail.rig.ron", "chest")] {
        let (code, said) =
            rigsmith(folder.path(), &["merge", "biped.rig.ron", other, "--parent", parent, "-o", "all.rig.ron"]);
        assert!(code == 0 && !said.contains("written out"), "{other} on {parent}: {said}");
        let text = fs::read_to_string(at("all.rig.ron")).unwrap();
        let parts = |text: &str| text[text.find("    parts: [").unwrap()..].to_owned();
        assert_eq!(parts(&text), parts(&biped()), "{other} on {parent}");
        assert!(text.starts_with("// A human.") && text.contains(&format!("parent: \"{parent}\",")), "{text}");
        let (whole, alone) = (load(&at("all.rig.ron")), load(&at(other)));
        assert_eq!(whole.len(), 52 + alone.len());
        let first = alone.walk().next().unwrap().data.uid;
        assert_eq!(whole.joint(first).unwrap().parent, whole.find_label(parent));
        assert!(whole.position(first).distance(alone.position(first)) < 1e-5, "it stays where it was");
        fs::remove_file(at("all.rig.ron")).unwrap();
    }
    // A tag of what was merged has the short form of the file, and no uid that follows from its names.
    let merge = ["merge", "biped.rig.ron", "ring.rig.ron", "--parent", "hand_l", "-o", "all.rig.ron"];
    assert_eq!(rigsmith(folder.path(), &merge).0, 0);
    let text = fs::read_to_string(at("all.rig.ron")).unwrap();
    assert!(text.contains("tags: [control()]") && !text.contains("Command("), "{text}");
}

/// A template that is saved through a link into another folder is whole from the link and from the file that it leads to.
#[cfg(unix)]
#[test]
fn parts_of_a_template_are_found_from_both_ends_of_a_link() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["own/parts", "links", "far/away"] {
        fs::create_dir_all(at(name)).unwrap();
    }
    let arm = "(format: 2, name: \"arm\", kind: \"part\", joints: [(label: \"a\", translation: (1, 0, 0))])";
    let man = "(format: 2, name: \"man\", uid: \"00000000000000aa\", joints: [(label: \"body\")],\n    \
               parts: [(part: \"parts/arm.rig.ron\", name: \"l\", parent: \"body\")])";
    let ring = "(format: 2, name: \"ring\", joints: [(label: \"ring\")])";
    for (name, text) in [("own/parts/arm.rig.ron", arm), ("own/man.rig.ron", man), ("own/ring.rig.ron", ring)] {
        fs::write(at(name), text).unwrap();
    }
    std::os::unix::fs::symlink("../far/away/real.rig.ron", at("links/man.rig.ron")).unwrap();
    let merge = ["merge", "own/man.rig.ron", "own/ring.rig.ron", "-o", "links/man.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &merge);
    assert_eq!(code, 0, "{said}");
    let real = fs::read_to_string(at("far/away/real.rig.ron")).unwrap();
    assert!(real.contains("own/parts/arm.rig.ron"), "{real}");
    let whole = load(&at("links/man.rig.ron"));
    assert_eq!(whole, load(&at("far/away/real.rig.ron")));
    assert_eq!(whole.walk().filter_map(|joint| joint.data.label.as_deref()).collect::<Vec<_>>(), ["body", "a", "ring"]);
    // A part beside the file is found through the link, and one beside the link goes first.
    fs::create_dir(at("far/away/parts")).unwrap();
    fs::write(at("far/away/parts/arm.rig.ron"), arm.replace("\"a\"", "\"there\"")).unwrap();
    fs::write(at("far/away/real.rig.ron"), man).unwrap();
    assert!(load(&at("links/man.rig.ron")).find_label("there").is_some());
    fs::create_dir(at("links/parts")).unwrap();
    fs::write(at("links/parts/arm.rig.ron"), arm.replace("\"a\"", "\"here\"")).unwrap();
    assert!(load(&at("links/man.rig.ron")).find_label("here").is_some());
    assert!(load(&at("far/away/real.rig.ron")).find_label("there").is_some());
}
