//! Listings of folders: templates found by words, their pictures, headers that are remembered, and folders of too many names.

use std::time::SystemTime;

use rigsmith::files::{HeaderMemory, list_templates};

use super::*;

#[test]
fn templates_are_found_by_words_and_folder_and_are_those_of_the_command() {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.settle();
    let seen = studio.tiles();
    for tile in ["Template man", "Template tall man", "Part limb", "Template biped", "Part arm"] {
        assert!(seen.contains(&tile), "{tile} is not among {seen:?}");
    }
    let find = |studio: &mut Studio, words: &str| -> Vec<String> {
        studio.desk.click("Search templates");
        studio.desk.type_text(words);
        studio.settle();
        let found = studio.tiles().into_iter().map(str::to_owned).collect();
        studio.desk.click("Clear search templates");
        studio.settle();
        found
    };
    assert_eq!(find(&mut studio, "limb upper"), ["Part limb"], "by name and description");
    assert_eq!(find(&mut studio, "ANNA"), ["Part limb"], "by author");
    assert_eq!(find(&mut studio, "tall"), ["Template tall man"]);
    assert_eq!(find(&mut studio, "nothing like this"), [""; 0]);
    // The command lists the same in the folder of the site.
    let listing = studio.world().resource::<TemplateLibrary>().listing().clone();
    let of_site = &listing.folders[1];
    assert_eq!(of_site.name, studio.site.display().to_string());
    let names: Vec<String> = of_site.templates.iter().map(|listed| listed.name()).collect();
    assert_eq!(names, ["limb", "tall_man"]);
    #[cfg(feature = "cli")]
    {
        let (code, said) = crate::cli_outputs::rigsmith(studio.folder.path(), &["list", "site", "--json"]);
        let start = said.find('{').unwrap();
        let value: serde_json::Value =
            serde_json::Deserializer::from_str(&said[start..]).into_iter().next().unwrap().unwrap();
        let listed = value["templates"].as_array().unwrap();
        let of_command: Vec<&str> = listed.iter().filter_map(|one| one["name"].as_str()).collect();
        assert_eq!((code, of_command), (0, names.iter().map(String::as_str).collect()));
    }
    // A file that is no template is there, with its reason.
    fs::write(studio.site.join("broken.rig.ron"), "(format: 2, nam").unwrap();
    studio.click("List the templates again");
    assert!(studio.tiles().contains(&"Template broken"), "{:?}", studio.tiles());
    // Pictures come by themselves: skeletons, and the reason in place of a broken one.
    let pictured = |desk: &Desk, name: &str| {
        let world = desk.app.world();
        let listing = world.resource::<TemplateLibrary>().listing();
        let listed = listing.templates().find(|listed| listed.name() == name)?;
        world.resource::<LibraryPictures>().get(listed).cloned()
    };
    studio
        .desk
        .until("the pictures", |desk| ["limb", "biped", "broken"].iter().all(|name| pictured(desk, name).is_some()));
    let Some(TemplatePicture::Bones(bones)) = pictured(&studio.desk, "limb") else { panic!("the limb has no picture") };
    assert_eq!((bones.joints.len(), bones.bones.len()), (2, 1));
    assert!(matches!(pictured(&studio.desk, "broken"), Some(TemplatePicture::Nothing)));
}

/// Several templates may have one name: those of the program and copies of them, or two parts of the program.
#[test]
fn tiles_of_one_name_tell_their_difference() {
    let mut studio = Studio::new(LoaderPanel::default());
    let biped = MAN.replace("name: \"man\"", "name: \"biped\"");
    fs::write(studio.site.join("biped.rig.ron"), &biped).unwrap();
    let limbs = studio.site.join("limbs");
    fs::write(limbs.join("first.rig.ron"), biped.replace("name: \"biped\"", "name: \"twin\"")).unwrap();
    fs::write(limbs.join("second.rig.ron"), biped.replace("name: \"biped\"", "name: \"twin\"")).unwrap();
    fs::write(limbs.join("man.rig.ron"), LIMB.replace("name: \"limb\"", "name: \"man\"")).unwrap();
    studio.settle();
    studio.click("List the templates again");
    studio.settle();
    let find = |studio: &mut Studio, words: &str| -> Vec<String> {
        studio.desk.click("Search templates");
        studio.desk.type_text(words);
        studio.settle();
        let mut found: Vec<String> = studio.tiles().into_iter().map(str::to_owned).collect();
        found.sort();
        studio.desk.click("Clear search templates");
        studio.settle();
        found
    };
    let bipeds = find(&mut studio, "biped.rig");
    assert_eq!(bipeds, ["Template biped"], "alone among what is shown, its name is enough");
    let bipeds = find(&mut studio, "biped");
    for wanted in ["Template biped, site", "Template biped, Rigsmith"] {
        assert!(bipeds.iter().any(|tile| tile == wanted), "{wanted} is not among {bipeds:?}");
    }
    assert_eq!(find(&mut studio, "twin"), ["Template twin, first", "Template twin, second"]);
    let hands: Vec<String> = find(&mut studio, "left hand").into_iter().filter(|tile| tile.contains("hand")).collect();
    assert!(hands.len() >= 2, "{hands:?}");
    let mut different = hands.clone();
    different.sort();
    different.dedup();
    assert_eq!(different.len(), hands.len(), "{hands:?}");
    // A template and a part of one name, which screen readers tell apart already.
    let men = find(&mut studio, "man");
    assert!(men.iter().any(|tile| tile == "Template man") && men.iter().any(|tile| tile == "Part man"), "{men:?}");
}

#[test]
fn headers_are_read_again_only_where_the_file_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("man.rig.ron");
    let list = |known: &HeaderMemory| {
        let listing = list_templates(&RealDisk, folder.path(), 0, &SearchPaths::default(), known).unwrap();
        let name = listing.templates[0].header.as_ref().unwrap().name.clone();
        (listing, name)
    };
    let write = |name: &str, time: SystemTime| {
        fs::write(&path, MAN.replace("name: \"man\"", &format!("name: \"{name}\""))).unwrap();
        fs::File::options().write(true).open(&path).unwrap().set_modified(time).unwrap();
    };
    let time = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
    write("man", time);
    let mut known = HeaderMemory::default();
    let (listing, name) = list(&known);
    assert_eq!(name, "man");
    known.remember(&listing.templates);
    // Another content of the same length and time is not looked at; one of another time is.
    write("cat", time);
    assert_eq!(list(&known).1, "man");
    write("cat", time + Duration::from_secs(1));
    assert_eq!(list(&known).1, "cat");
}

#[test]
fn a_folder_of_too_many_names_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let list =
        || list_templates(&RealDisk, folder.path(), 0, &SearchPaths::default(), &HeaderMemory::default()).unwrap();
    fs::write(at("a.rig.ron"), MAN).unwrap();
    (1..10_000).for_each(|number| fs::write(at(&format!("n{number:05}.txt")), "").unwrap());
    let listing = list();
    assert_eq!((listing.templates.len(), listing.left_out.len()), (1, 0));
    fs::write(at("z.rig.ron"), MAN).unwrap();
    let listing = list();
    let told: Vec<String> = listing.left_out.iter().map(ToString::to_string).collect();
    assert_eq!((listing.templates.len(), told.len()), (1, 1), "{told:?}");
    assert!(told[0].contains("more than 10000 names"), "{told:?}");
}
