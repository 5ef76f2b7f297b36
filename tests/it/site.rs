//! Folders of the site, and versions of templates.

use std::{cmp::Ordering, fs, path::Path};

use rigsmith::{
    files::{PartFiles, RealDisk, SITE_FILE, SearchPaths, SiteError, TemplateWatch},
    rig::{
        RigAbout,
        template::{read_template, write_template},
        version::{VersionChange, compare},
    },
};

#[test]
fn versions_are_compared_by_their_numbers() {
    let rising =
        ["", "0.9", "1.0-alpha", "1.0-beta", "1.0-beta.2", "1.0", "1.0.1", "1.2", "1.10", "2", "10.0", "2026.11"];
    for (a, first) in rising.iter().enumerate() {
        for (b, second) in rising.iter().enumerate() {
            assert_eq!(compare(first, second), a.cmp(&b), "{first} {second}");
        }
    }
    let same =
        [("1", "1.0.0"), ("v1.2", "1.2"), ("1_2", "1.2"), ("01.02", "1.2"), (" 1.2 ", "1.2"), ("1.0-Beta", "1.0-beta")];
    for (a, b) in same {
        assert_eq!(compare(a, b), Ordering::Equal, "{a} {b}");
    }
    let long = "9".repeat(400);
    assert_eq!(compare(&long, &format!("1{}", "0".repeat(400))), Ordering::Less);
    let about = |version: &str| RigAbout { version: version.to_owned(), ..RigAbout::default() };
    let said = |from, to| VersionChange::between(&about(from), &about(to)).map(|change| change.to_string());
    assert_eq!(said("1.0", "1.2").as_deref(), Some("1.0 to 1.2"));
    assert_eq!(said("1.2", "1.0").as_deref(), Some("1.2 to 1.0, which is older"));
    assert_eq!(said("", "1.0").as_deref(), Some("no version to 1.0"));
    assert_eq!(said("1", "1.0"), None);
}

#[test]
fn the_folders_are_those_of_the_variable_and_of_the_site_file() {
    let folder = tempfile::tempdir().unwrap();
    let read = |variable: &[&str]| {
        let variable = std::env::join_paths(variable).unwrap();
        SearchPaths::read(&RealDisk, Some(variable), Some(folder.path()))
    };
    assert_eq!(read(&[]).unwrap(), SearchPaths::default(), "no site file is no error");
    fs::write(folder.path().join(SITE_FILE), "(\n    templates: [\"rigs\", \"/srv/rigs\"], // ours\n)\n").unwrap();
    let folders = read(&["/a", "/srv/rigs", "/b"]).unwrap().folders;
    let expected = [Path::new("/a"), Path::new("/srv/rigs"), Path::new("/b"), &folder.path().join("rigs")];
    assert_eq!(folders, expected);
    fs::write(folder.path().join(SITE_FILE), "(\n    template: [\"rigs\"],\n)\n").unwrap();
    let error = read(&[]).unwrap_err();
    assert!(matches!(&error, SiteError::Source { source, .. } if source.line == 2), "{error}");
    assert!(error.to_string().contains(SITE_FILE) && error.to_string().contains("template"), "{error}");
    let paths = SearchPaths { folders: vec!["/a".into(), "/b".into()] };
    let names: Vec<_> = paths.candidates(Path::new("x.rig.ron")).collect();
    assert_eq!(names, [Path::new("/a/x.rig.ron"), Path::new("/b/x.rig.ron")]);
    assert_eq!(paths.candidates(Path::new("/x.rig.ron")).count(), 0);
}

const PART: &str = "(format: 2, name: \"NAME\", kind: \"part\", joints: [(label: \"a\", tags: [control])])";

#[test]
fn parts_are_found_in_the_project_then_in_the_site_and_each_place_is_watched() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for place in ["project", "first", "second"] {
        fs::create_dir(at(place)).unwrap();
    }
    let template = "(format: 2, name: \"t\", joints: [(label: \"body\")], parts: [(part: \"p.rig.ron\", parent: \"body\", prefix: \"x_\")])";
    fs::write(at("project/t.rig.ron"), template).unwrap();
    let site = SearchPaths { folders: vec![at("first"), at("second")] };
    let load = || {
        let mut files = PartFiles::new(&RealDisk).with_site(site.clone());
        let read = files.complete(&at("project/t.rig.ron"), template.as_bytes());
        (read, files.asked)
    };
    let candidates = [at("first/p.rig.ron"), at("project/p.rig.ron"), at("second/p.rig.ron")];
    let (read, asked) = load();
    let error = read.unwrap_err();
    assert!(error.message.contains("2 of the site's folders"), "{error}");
    assert_eq!(asked.keys().collect::<Vec<_>>(), candidates.iter().collect::<Vec<_>>());
    // The lower the place of a file, the later it is looked at; the ones before it are asked for, and watched.
    let mut watch = TemplateWatch::new(&at("project/t.rig.ron"));
    watch.read(&RealDisk).unwrap();
    watch.follow(asked, false);
    for (name, count) in [("second", 3), ("first", 2), ("project", 1)] {
        let label = format!("{name}_joint");
        fs::write(at(name).join("p.rig.ron"), PART.replace("label: \"a\"", &format!("label: \"{label}\""))).unwrap();
        let seen = (0..200).any(|_| {
            std::thread::sleep(std::time::Duration::from_millis(2));
            watch.look(&RealDisk).is_some()
        });
        assert!(seen, "{name}");
        let (read, asked) = load();
        let rig = read.unwrap().rig;
        assert!(rig.find_label(&format!("x_{label}")).is_some(), "{}", write_template(&rig));
        assert_eq!(asked.len(), count);
        watch.follow(asked, true);
    }
    // A file that is there, and is no part, is an error, not passed over.
    fs::write(at("project/p.rig.ron"), "(format: 2, nam").unwrap();
    assert!(load().0.is_err());
    // A part of the site finds its own parts beside it, and in the site.
    fs::remove_file(at("project/p.rig.ron")).unwrap();
    let nested = PART.replace("joints:", "parts: [(part: \"q.rig.ron\", parent: \"a\", prefix: \"q_\")], joints:");
    fs::write(at("first/p.rig.ron"), nested).unwrap();
    fs::write(at("second/q.rig.ron"), PART).unwrap();
    let rig = load().0.unwrap().rig;
    assert_eq!(rig.len(), 3, "{}", write_template(&rig));
    // A part of itself is told.
    fs::remove_file(at("second/p.rig.ron")).unwrap();
    fs::write(
        at("second/q.rig.ron"),
        PART.replace("joints:", "parts: [(part: \"p.rig.ron\", parent: \"a\")], joints:"),
    )
    .unwrap();
    let error = load().0.unwrap_err();
    assert!(error.message.contains("part of itself"), "{error}");
    assert_eq!(read_template(template.as_bytes()).unwrap().parts.len(), 1);
}
