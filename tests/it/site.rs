//! Folders of the site, and versions of templates.

use std::{cmp::Ordering, fs, path::Path};

use rigsmith::{
    files::{
        ExpressionFileError, LeftOut, PartFiles, RealDisk, SITE_FILE, SearchPaths, SiteError, TemplateWatch,
        files_below, is_expression_file, load_expressions,
    },
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

/// Templates from elsewhere name no files of the machine, as projects do not: an absolute path leads below the template's
/// folder or below one of the site's.
#[test]
fn absolute_paths_of_parts_stay_in_the_folders() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for place in ["project/parts", "site", "away"] {
        fs::create_dir_all(at(place)).unwrap();
        fs::write(at(place).join("p.rig.ron"), PART).unwrap();
    }
    let site = SearchPaths { folders: vec![at("site")] };
    let read = |part: &Path| {
        let text =
            format!("(format: 2, name: \"t\", joints: [(label: \"b\")], parts: [(part: {part:?}, parent: \"b\")])");
        PartFiles::new(&RealDisk).with_site(site.clone()).complete(&at("project/t.rig.ron"), text.as_bytes())
    };
    for inside in [at("project/parts/p.rig.ron"), at("site/p.rig.ron"), "../away/p.rig.ron".into()] {
        assert!(read(&inside).unwrap().rig.find_label("a").is_some(), "{inside:?}");
    }
    let refused = |part: &Path| {
        let error = read(part).unwrap_err();
        let (path, folder) = (part.display().to_string(), at("project").display().to_string());
        let is_told =
            [path.as_str(), folder.as_str(), "RIGSMITH_TEMPLATES"].iter().all(|word| error.message.contains(word));
        assert!(is_told && error.message.contains("is not read"), "{error}");
    };
    refused(&at("away/p.rig.ron"));
    refused(&at("project/../away/p.rig.ron"));
    refused(&at("away/nothing.rig.ron"));
    // A part of the site is no way out.
    let nested = PART.replace(
        "joints:",
        &format!("parts: [(part: {:?}, parent: \"a\", prefix: \"q_\")], joints:", at("away/p.rig.ron")),
    );
    fs::write(at("site/n.rig.ron"), nested).unwrap();
    let error = read(Path::new("n.rig.ron")).unwrap_err();
    assert!(error.to_string().contains("is not read"), "{error}");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(at("away/p.rig.ron"), at("project/parts/link.rig.ron")).unwrap();
        refused(&at("project/parts/link.rig.ron"));
    }
}

/// A folder that is too full gives its first files, in order, and says which ones are left out.
#[test]
fn files_that_are_left_out_of_a_folder_are_told() {
    let full = tempfile::tempdir().unwrap();
    let at = |name: &str| full.path().join(name);
    fs::create_dir(at("a")).unwrap();
    fs::write(at("a/below.expr.ron"), "").unwrap();
    (0..1003).for_each(|number| fs::write(at(&format!("e{number:04}.expr.ron")), "").unwrap());
    let found = files_below(&RealDisk, full.path(), 3, &is_expression_file);
    let files: Vec<_> = (0..1000).map(|number| at(&format!("e{number:04}.expr.ron"))).collect();
    assert!(found.files == files, "{} files, first {:?}", found.files.len(), found.files.first());
    let first = at("e1000.expr.ron");
    assert_eq!(found.left_out, [LeftOut::Files { folder: full.path().to_owned(), first }]);

    let many = tempfile::tempdir().unwrap();
    (0..10_000).for_each(|number| fs::write(many.path().join(format!("a{number:05}.txt")), "").unwrap());
    fs::write(many.path().join("z.expr.ron"), "(").unwrap();
    let found = files_below(&RealDisk, many.path(), 3, &is_expression_file);
    assert_eq!((found.files.len(), found.left_out.len()), (0, 1), "{found:?}");
    let folders = [many.path().to_owned()];
    let told = |faults: &[ExpressionFileError]| faults.iter().map(ToString::to_string).collect::<Vec<_>>();
    let faults = told(&load_expressions(&RealDisk, &folders).1);
    let name = many.path().display().to_string();
    assert!(matches!(&faults[..], [one] if one.contains(&name) && one.contains("`a09999.txt`")), "{faults:?}");
    // With one name less the file is looked at.
    fs::remove_file(many.path().join("a00000.txt")).unwrap();
    let faults = told(&load_expressions(&RealDisk, &folders).1);
    assert!(matches!(&faults[..], [one] if one.contains("z.expr.ron")), "{faults:?}");
}
