//! Templates that the panel writes: merged, injected and extracted ones, headers and pictures.

use super::*;

#[test]
fn templates_are_merged_injected_and_extracted() {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.settle();
    let before = studio.desk.rig().clone();
    let elbow = studio.joint("elbow_l");
    studio.desk.select(&[elbow]);
    studio.click("Template tall man");
    studio.click("Merge");
    let merged = studio.joint("tall_man_hips");
    assert_eq!((studio.desk.rig().len(), studio.desk.parent(merged)), (10, Some(elbow)));
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
    // The tags of the limb go onto the joints in the order in which they were selected.
    let joints = [studio.joint("arm_r"), studio.joint("elbow_r")];
    studio.desk.select(&joints);
    studio.click("Part limb");
    studio.click("Inject");
    let tags = |studio: &Studio, joint: Uid| studio.desk.rig().joint(joint).unwrap().data.tags.len();
    assert_eq!(joints.map(|joint| tags(&studio, joint)), [2, 1], "{:?}", studio.desk.told());
    assert!(studio.desk.rig().dropped_parts().is_empty(), "its tags are the rig's own");
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
    // Selected joints become a part of their own, which the list has then.
    studio.desk.select(&joints);
    let path = studio.site.join("arm_of_man");
    let content = TemplateContent::Joints(joints.to_vec());
    studio.send(SaveTemplate { path: path.clone(), replace: false, content });
    let file = studio.site.join("arm_of_man.rig.ron");
    let part = load_template(&RealDisk, &file).unwrap().rig;
    assert_eq!((part.len(), part.about().kind.as_str()), (2, "part"));
    assert!(studio.tiles().contains(&"Part arm of man"), "{:?}", studio.tiles());
    // A file that is there is replaced only if that was said.
    let text = fs::read(&file).unwrap();
    let all: Vec<Uid> = studio.desk.rig().walk().map(|joint| joint.data.uid).collect();
    let content_of_all = TemplateContent::Joints(all);
    studio.send(SaveTemplate { path: path.clone(), replace: false, content: content_of_all.clone() });
    assert!(fs::read(&file).unwrap() == text && studio.told("tick Replace"), "{:?}", studio.desk.told());
    studio.send(SaveTemplate { path, replace: true, content: content_of_all });
    assert_eq!(load_template(&RealDisk, &file).unwrap().rig.len(), 5);
    // Without a typed path it is a file of the first joint's name; the template that is open stays as it is.
    let text = fs::read(studio.man()).unwrap();
    studio.send(ActionRequest(Action::Library(LibraryAction::Save)));
    studio.desk.frames(30);
    studio.click("Extract selected");
    let file = studio.man().with_file_name("arm_r.rig.ron");
    assert_eq!(load_template(&RealDisk, &file).unwrap().rig.len(), 2);
    let path = studio.man();
    studio.send(SaveTemplate { path, replace: false, content: TemplateContent::Joints(joints.to_vec()) });
    assert!(fs::read(studio.man()).unwrap() == text);
}

#[test]
fn a_template_is_written_with_its_header_and_a_picture() {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.send(ActionRequest(Action::Library(LibraryAction::Save)));
    assert!(studio.world().resource::<TemplateDraft>().is_open);
    studio.desk.frames(30);
    let steps = studio.desk.steps().1;
    for (field, text) in [("Author", "Ben"), ("Kind", "character"), ("Description", "A man of sticks.")] {
        studio.desk.click(field);
        studio.desk.type_text(text);
        studio.desk.frames(2);
    }
    studio.desk.click("Name");
    studio.desk.frames(2);
    assert_eq!(studio.desk.steps().1, steps + 3, "each field is a step");
    let path = studio.site.join("sticks.rig.ron");
    studio.desk.click("Template file");
    studio.desk.type_text(&path.display().to_string());
    studio.desk.frames(2);
    studio.click("Save template");
    studio.desk.until("the template", |_| path.exists());
    studio.settle();
    let header = read_header(&fs::read(&path).unwrap()).unwrap();
    let of = (header.name.as_str(), header.author.as_str(), header.kind.as_str(), header.description.as_str());
    assert_eq!(of, ("man", "Ben", "character", "A man of sticks."));
    assert_eq!(header.preview.as_deref(), Some("sticks.png"));
    let shown = |desk: &Desk| {
        let world = desk.app.world();
        let listing = world.resource::<TemplateLibrary>().listing();
        let listed = listing.find(&TemplatePlace::File(path.clone()))?;
        world.resource::<LibraryPictures>().get(listed).cloned()
    };
    studio.desk.until("its picture in the list", |desk| matches!(shown(desk), Some(TemplatePicture::Image(_))));
    let picture = fs::read(studio.site.join("sticks.png")).unwrap();
    let picture = image::load_from_memory(&picture).unwrap().to_rgba8();
    let drawn = picture.pixels().filter(|pixel| pixel.0[3] > 0).count();
    assert!(picture.width() == picture.height() && drawn > 100, "{drawn} pixels");
    assert_eq!(load_template(&RealDisk, &path).unwrap().rig.len(), 5);
    // Undo of the header's steps gives the rig of before.
    (0..4).for_each(|_| studio.change(Change::Undo));
    assert_eq!(studio.desk.rig().about().author, "");
}

#[test]
fn a_picture_that_cannot_be_written_leaves_neither_a_file_nor_its_name() {
    let mut studio = Studio::new(LoaderPanel::default());
    let (picture, path) = (studio.site.join("hero.png"), studio.site.join("hero.rig.ron"));
    fs::create_dir(&picture).unwrap();
    let (before, done) = (studio.desk.rig().clone(), studio.desk.steps().1);
    studio.send(SaveTemplate { path: path.clone(), replace: true, content: TemplateContent::Rig { picture: true } });
    assert!(studio.told("Could not write hero.rig.ron"), "{:?}", studio.desk.told());
    assert!(picture.is_dir() && !path.exists());
    assert_eq!((studio.desk.rig(), studio.desk.steps().1), (&before, done), "the header is as before");
}

/// Stop ends the work on a template whenever it comes, also between its picture and its file.
#[test]
fn a_template_that_is_being_written_can_be_stopped() {
    let mut studio = Studio::new(LoaderPanel::default());
    let path = studio.site.join("hero.rig.ron");
    let (before, done) = (studio.text(), studio.desk.steps().1);
    let request = SaveTemplate { path: path.clone(), replace: true, content: TemplateContent::Rig { picture: true } };
    studio.desk.app.world_mut().write_message(request.clone());
    studio.desk.frame();
    let (words, kind) = running(studio.world()).expect("it is being written");
    assert_eq!((words.as_str(), kind), ("Saving hero.rig.ron", Some(StoppableWork::Saving)));
    studio.send(StopWork(StoppableWork::Saving));
    assert!(studio.told("hero.rig.ron is not written: it was stopped"), "{:?}", studio.desk.told());
    assert!(!path.exists() && running(studio.world()).is_none());
    assert_eq!((studio.text(), studio.desk.steps().1), (before, done), "the header names no picture");
    studio.send(request);
    assert!(path.exists(), "the next one is written: {:?}", studio.desk.told());
}

#[test]
fn a_picture_that_is_not_the_templates_is_replaced_only_if_that_was_said() {
    let mut studio = Studio::new(LoaderPanel::default());
    // A texture that is called as the character is.
    let texture = studio.site.join("hero.png");
    fs::write(&texture, b"a texture").unwrap();
    let path = studio.site.join("hero.rig.ron");
    let content = TemplateContent::Rig { picture: true };
    let steps = studio.desk.steps();
    let save = |replace: bool| SaveTemplate { path: path.clone(), replace, content: content.clone() };
    studio.send(save(false));
    assert!(studio.told("a picture hero.png already"), "{:?}", studio.desk.told());
    assert!(fs::read(&texture).unwrap() == b"a texture" && !path.exists() && studio.desk.steps() == steps);
    studio.send(save(true));
    assert!(path.exists() && fs::read(&texture).unwrap() != b"a texture", "{:?}", studio.desk.told());
    // In the form the tick is for one file.
    studio.desk.app.insert_resource(TemplateDraft {
        is_open: true,
        path: path.display().to_string(),
        replace: true,
        ..TemplateDraft::default()
    });
    studio.desk.frames(30);
    fs::write(&texture, b"a texture").unwrap();
    studio.click("Save template");
    assert!(fs::read(&texture).unwrap() != b"a texture", "{:?}", studio.desk.told());
    assert!(!studio.world().resource::<TemplateDraft>().replace);
    // The template that is open has its own picture, which goes with it.
    let own = SaveTemplate { path: studio.man(), replace: false, content };
    studio.send(own.clone());
    let picture = studio.man().with_file_name("man.png");
    fs::write(&picture, b"an older picture").unwrap();
    studio.send(own);
    assert!(fs::read(&picture).unwrap() != b"an older picture", "{:?}", studio.desk.told());
}
