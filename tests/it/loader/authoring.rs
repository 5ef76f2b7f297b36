//! Options and sockets of a template, written in the window: each change is a step, the file has them, and uses of the part
//! set them.

use bevy_egui::egui::Key;
use rigsmith::rig::{
    RigAbout,
    part::{HeaderSocket, OptionForm, PartOption},
    template::{read_template, write_template_over},
};

use super::*;
use crate::cli_outputs::rigsmith;

/// A window in which the form is open on the limb.
fn opened() -> Studio {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.desk.resize(620.0, 2200.0);
    let limb = studio.site.join("limbs").join("limb.rig.ron");
    studio.open(OpenRequest::File(limb));
    studio.send(ActionRequest(Action::Library(LibraryAction::Save)));
    studio.desk.frames(30);
    studio
}

/// Types a text in place of that of a field.
fn type_over(studio: &mut Studio, field: &str, text: &str) {
    studio.desk.click(field);
    studio.desk.hold(egui::Modifiers::COMMAND);
    studio.desk.key(Key::A);
    studio.desk.hold(egui::Modifiers::NONE);
    studio.desk.type_text(text);
    studio.desk.frames(2);
}

/// Types a text in place of that of a field, and leaves it.
fn retype(studio: &mut Studio, field: &str, text: &str) {
    type_over(studio, field, text);
    studio.click("Author");
    studio.desk.key(Key::Escape);
    studio.settle();
}

/// Clicks the widget whose name begins with a text: entries with a menu of their own end in an arrow.
#[track_caller]
fn choose(studio: &mut Studio, entry: &str) {
    let found = studio.desk.seen.iter().find(|seen| seen.label.starts_with(entry));
    let label = found.unwrap_or_else(|| panic!("{entry:?} is not among {:?}", studio.desk.seen)).label.clone();
    studio.desk.click(&label);
    studio.desk.frames(3);
}

fn options(studio: &Studio) -> &[PartOption] {
    &studio.desk.rig().about().options
}

fn sockets(studio: &Studio) -> &[HeaderSocket] {
    &studio.desk.rig().about().sockets
}

/// Does something that is one step, which undo takes back to the byte and redo brings again.
#[track_caller]
fn step(studio: &mut Studio, change: impl FnOnce(&mut Studio)) {
    let (before, steps) = (studio.text(), studio.desk.steps().1);
    change(studio);
    studio.settle();
    assert_eq!(studio.desk.steps().1, steps + 1, "{:?}", studio.desk.told());
    let after = studio.text();
    assert_ne!(after, before);
    studio.change(Change::Undo);
    assert_eq!(studio.text(), before);
    studio.change(Change::Redo);
    assert_eq!(studio.text(), after);
}

#[test]
fn options_are_written_in_the_window_and_set_where_the_part_is_used() {
    let mut studio = opened();
    assert_eq!(options(&studio).len(), 1, "that of the file");
    let upper = studio.joint("upper_l");
    studio.desk.select(&[upper]);
    studio.settle();
    step(&mut studio, |studio| {
        studio.click("+ Option");
        choose(studio, "control/upper_l");
        choose(studio, "follow");
    });
    let added = options(&studio)[1].clone();
    assert_eq!(
        (added.name.as_str(), added.default.as_str(), &added.form),
        ("follow", "true", &Some(OptionForm::Check))
    );
    assert_eq!(added.sets, [("control/upper_l".to_owned(), "follow".to_owned())]);
    step(&mut studio, |studio| retype(studio, "Name of option follow", "walks along"));
    step(&mut studio, |studio| retype(studio, "Description of option walks along", "Moves with the limb."));
    step(&mut studio, |studio| studio.click("Default of option walks along"));
    assert_eq!(options(&studio)[1].default, "false");
    step(&mut studio, |studio| {
        studio.click("Form of option size");
        choose(studio, "Slider");
    });
    step(&mut studio, |studio| retype(studio, "Range of option size", "0.25, 2"));
    assert_eq!(options(&studio)[0].form, Some(OptionForm::Slider { min: 0.25, max: 2.0, step: None }));
    // What no file can have is refused with the reason.
    let (text, steps) = (studio.text(), studio.desk.steps());
    retype(&mut studio, "Default of option size", "7");
    assert!(studio.told("takes a number from 0.25 to 2"), "{:?}", studio.desk.told());
    retype(&mut studio, "Name of option size", "walks along");
    assert!(studio.told("options are called"), "{:?}", studio.desk.told());
    retype(&mut studio, "Range of option size", "wide");
    assert!(studio.told("stays as it was"), "{:?}", studio.desk.told());
    assert_eq!((studio.text(), studio.desk.steps()), (text, steps));

    // Saved over the file they are in its header, where the command reads them.
    let path = studio.site.join("limbs").join("limb.rig.ron");
    studio.send(SaveTemplate { path: path.clone(), replace: true, content: TemplateContent::Rig { picture: false } });
    studio.desk.until("the template", |_| fs::read_to_string(&path).unwrap().contains("walks along"));
    studio.settle();
    let written = fs::read_to_string(&path).unwrap();
    let kept = "tags: [Feature(kind: \"fk\", name: \"fk\"), control(feature: \"fk\", size: 0.5)],";
    assert!(LIMB.contains(kept) && written.contains(kept), "{written}");
    let (code, said) = rigsmith(path.parent().unwrap(), &["list", "--json"]);
    assert!(code == 0 && said.contains("\"walks along\"") && said.contains("Moves with the limb."), "{said}");
    let read = load_template(&RealDisk, &path).unwrap();
    assert_eq!(read.options, options(&studio));

    // The part with the option is put onto an arm of another rig.
    let mut studio = Studio::new(LoaderPanel::default());
    fs::copy(&path, studio.site.join("limbs").join("limb.rig.ron")).unwrap();
    let arm = studio.joint("arm_l");
    let values = vec![("walks along".to_owned(), "true".to_owned()), ("size".to_owned(), "1.5".to_owned())];
    studio.act(studio.limb(), LibraryAct::Part { joints: vec![arm], options: values });
    let tags = studio.desk.rig().joint(arm).unwrap().data.tags.clone();
    let is_set = |tag: &rigsmith::rig::TagData| match &tag.kind {
        TagKind::Command { params, .. } => params.contains("follow: true") && params.contains("size: 1.5"),
        TagKind::Feature { .. } => false,
    };
    assert!(tags.iter().any(is_set), "{tags:?} {:?}", studio.desk.told());
}

#[test]
fn sockets_are_written_in_the_window_and_others_hang_there() {
    let mut studio = opened();
    assert!(studio.desk.says("In: parent of upper_l"), "{:?}", studio.desk.seen);
    let [upper, lower] = ["upper_l", "lower_l"].map(|label| studio.joint(label));
    assert_eq!(sockets(&studio).iter().map(|socket| socket.joint).collect::<Vec<_>>(), [lower]);
    studio.desk.select(&[upper]);
    studio.settle();
    step(&mut studio, |studio| studio.click("+ Socket"));
    step(&mut studio, |studio| retype(studio, "Name of socket upper_l", "top"));
    step(&mut studio, |studio| retype(studio, "Place of socket top", "0, 0.1, 0"));
    step(&mut studio, |studio| retype(studio, "Turn of socket top", "90, 0, -12.5"));
    let top = sockets(&studio)[1].clone();
    let expected = HeaderSocket {
        name: "top".to_owned(),
        joint: upper,
        translation: Vec3::new(0.0, 0.1, 0.0),
        rotation: Vec3::new(90.0, 0.0, -12.5),
    };
    assert_eq!(top, expected);
    step(&mut studio, |studio| studio.click("Socket end onto the selected joint"));
    assert_eq!(sockets(&studio)[0].joint, upper);
    studio.change(Change::Undo);
    let (text, steps) = (studio.text(), studio.desk.steps());
    for (field, wrong) in [
        ("Place of socket top", "high"),
        ("Place of socket top", "1, x, 2, 3"),
        ("Name of socket top", "a.b"),
        ("Name of socket top", "end"),
    ] {
        retype(&mut studio, field, wrong);
    }
    for told in ["is not three numbers", "a name without points", "sockets are called"] {
        assert!(studio.told(told), "{told}: {:?}", studio.desk.told());
    }
    assert_eq!((studio.text(), studio.desk.steps()), (text, steps));

    let path = studio.site.join("limbs").join("limb.rig.ron");
    studio.send(SaveTemplate { path: path.clone(), replace: true, content: TemplateContent::Rig { picture: false } });
    studio.desk.until("the template", |_| fs::read_to_string(&path).unwrap().contains("\"top\""));
    studio.settle();
    let (code, said) = rigsmith(path.parent().unwrap(), &["list", "--json"]);
    assert!(code == 0 && said.contains("\"top\""), "{said}");
    // Another limb hangs on the socket of the first.
    let parts = "(part: \"limb.rig.ron\", name: \"first\"), \
                 (part: \"limb.rig.ron\", name: \"second\", socket: \"first.top\", prefix: \"b_\")";
    let host = path.with_file_name("two.rig.ron");
    fs::write(&host, format!("(format: 2, name: \"two\", joints: [(label: \"body\")], parts: [{parts}])")).unwrap();
    let two = load_template(&RealDisk, &host).unwrap();
    let [first, second] = ["upper_l", "b_upper_l"].map(|label| two.rig.find_label(label).unwrap());
    assert_eq!(two.rig.joint(second).unwrap().parent, Some(first));
    let place = two.rig.joint(second).unwrap().data.rest.translation;
    assert!((place - Vec3::new(0.0, 0.1, 0.0)).length() < 1e-6, "{place}");

    // Removed, they leave the file.
    step(&mut studio, |studio| studio.click("Remove socket end"));
    step(&mut studio, |studio| studio.click("Remove option size"));
    studio.send(SaveTemplate { path: path.clone(), replace: true, content: TemplateContent::Rig { picture: false } });
    studio.desk.until("the template", |_| !fs::read_to_string(&path).unwrap().contains("\"end\""));
    studio.settle();
    let read = load_template(&RealDisk, &path).unwrap();
    assert_eq!((read.sockets.len(), read.options.len()), (1, 0));
}

/// A click leaves a field in the frame in which it does what it does: neither takes the other back.
#[test]
fn a_click_keeps_what_was_typed_before_it() {
    let mut studio = opened();
    let steps = studio.desk.steps().1;
    type_over(&mut studio, "Description of option size", "How large it is.");
    studio.click("Remove socket end");
    assert_eq!(options(&studio)[0].description, "How large it is.");
    assert!(sockets(&studio).is_empty(), "{:?}", studio.desk.told());
    studio.change(Change::Undo);
    assert_eq!((sockets(&studio).len(), studio.desk.steps().1), (1, steps + 1));
    // What is removed stands above what was typed.
    type_over(&mut studio, "Name of socket end", "tip");
    studio.click("Remove option size");
    assert_eq!((options(&studio).len(), sockets(&studio)[0].name.as_str()), (0, "tip"));
    // A text that is refused does not stop the click.
    let upper = studio.joint("upper_l");
    studio.desk.select(&[upper]);
    studio.settle();
    type_over(&mut studio, "Name of socket tip", "a.b");
    studio.click("+ Socket");
    assert!(studio.told("a name without points"), "{:?}", studio.desk.told());
    let names: Vec<&str> = sockets(&studio).iter().map(|socket| socket.name.as_str()).collect();
    assert_eq!(names, ["tip", "upper_l"]);
    // A template has what was typed last, and its picture's name.
    type_over(&mut studio, "Author", "Ada");
    studio.click("Save template");
    let path = studio.site.join("limbs").join("limb.rig.ron");
    studio.desk.until("the template", |_| fs::read_to_string(&path).unwrap().contains("\"Ada\""));
    studio.settle();
    let about = load_template(&RealDisk, &path).unwrap().rig.about().clone();
    assert_eq!((about.author.as_str(), about.preview.as_deref()), ("Ada", Some("limb.png")));
}

/// A template with comments beside its lists.
const NOTED: &str = r#"// A limb.
(
    format: 2,
    name: "limb",
    kind: "part",
    sockets: [
        (name: "end", joint: "lower_l"), // Where a hand goes.
        (name: "side", joint: "upper_l", translation: (0.1, 0, 0)),
    ],
    options: [
        // How large it is.
        (name: "size", default: 0.5, sets: [(tag: "control/upper_l", param: "size")]),
    ],
    joints: [
        (label: "upper_l", tags: [control(size: 0.5)]), // It carries the rest.
        (label: "lower_l", parent: "upper_l", translation: (0, -0.3, 0)),
    ],
)
"#;

fn changed(rig: &Rig, change: impl FnOnce(&mut RigAbout)) -> Rig {
    let mut about = rig.about().clone();
    change(&mut about);
    let mut rig = rig.clone();
    rig.apply(&RigEdit::SetAbout(Box::new(about))).unwrap();
    rig
}

#[test]
fn a_save_changes_the_lists_of_a_text_and_nothing_else() {
    let rig = read_template(NOTED.as_bytes()).unwrap().rig;
    assert_eq!(write_template_over(&rig, NOTED).as_deref(), Some(NOTED), "nothing has changed");
    let upper = rig.find_label("upper_l").unwrap();
    let number = |name: &str, default: &str| PartOption {
        name: name.to_owned(),
        default: default.to_owned(),
        description: String::new(),
        form: Some(OptionForm::Number),
        sets: vec![("control/upper_l".to_owned(), "relative_size".to_owned())],
    };
    let cases: [(&str, &str, Rig); 6] = [
        ("name: \"end\"", "name: \"hand\"", changed(&rig, |about| about.sockets[0].name = "hand".to_owned())),
        ("(0.1, 0, 0)", "(0.2, 0, 0)", changed(&rig, |about| about.sockets[1].translation.x = 0.2)),
        ("joint: \"lower_l\"), //", "joint: \"upper_l\"), //", changed(&rig, |about| about.sockets[0].joint = upper)),
        ("default: 0.5", "default: 0.75", changed(&rig, |about| about.options[0].default = "0.75".to_owned())),
        (
            "        (name: \"side\", joint: \"upper_l\", translation: (0.1, 0, 0)),\n",
            "",
            changed(&rig, |about| drop(about.sockets.remove(1))),
        ),
        (
            "param: \"size\")]),\n",
            "param: \"size\")]),\n        (name: \"more\", default: 1.0, form: Number, sets: [(tag: \"control/upper_l\", param: \"relative_size\")]),\n",
            changed(&rig, |about| about.options.push(number("more", "1.0"))),
        ),
    ];
    for (before, after, rig) in cases {
        let text = write_template_over(&rig, NOTED).unwrap_or_else(|| panic!("{after}: written anew"));
        let expected = NOTED.replacen(before, after, 1);
        let same = |text: &str| text.replace("0.2, 0.0, 0.0", "0.2, 0, 0");
        assert_eq!(same(&text), expected);
        assert_eq!(read_template(text.as_bytes()).unwrap().rig.about(), rig.about());
    }
    // Into a text without lists they come before what is large, so that what lists templates finds them.
    let plain = "(\n    format: 2,\n    name: \"limb\",\n    joints: [\n        (label: \"upper_l\"),\n    ],\n)\n";
    let rig = read_template(plain.as_bytes()).unwrap().rig;
    let joint = rig.find_label("upper_l").unwrap();
    let socket = HeaderSocket { name: "end".to_owned(), joint, translation: Vec3::ZERO, rotation: Vec3::ZERO };
    let with = changed(&rig, |about| about.sockets.push(socket));
    let text = write_template_over(&with, plain).expect("the text is changed");
    assert!(text.find("sockets").unwrap() < text.find("joints").unwrap() && text.contains("format: 2"), "{text}");
    assert_eq!(read_template(text.as_bytes()).unwrap().rig.about(), with.about());
    // Written anew they are the same, and so are they taken out with some of the joints.
    let anew = read_template(write_template(&with).as_bytes()).unwrap();
    assert_eq!((anew.rig.about(), anew.sockets.len()), (with.about(), 1));
}

#[test]
fn an_update_takes_options_and_sockets_of_the_file_over() {
    let base = read_template(NOTED.as_bytes()).unwrap().rig;
    let file = changed(&base, |about| about.sockets[0].name = "hand".to_owned());
    let now = changed(&base, |about| about.options[0].default = "0.75".to_owned());
    let updated = rigsmith::rig::update::update(Some(&base), &now, &file, rigsmith::rig::update::Take::Mine).rig;
    assert_eq!(
        (updated.about().sockets[0].name.as_str(), updated.about().options[0].default.as_str()),
        ("hand", "0.75")
    );
    // Joints that are extracted bring theirs along.
    let upper = base.find_label("upper_l").unwrap();
    let part = rigsmith::rig::extract::extract(&base, &[upper], "upper", None).unwrap().rig;
    let names: Vec<&str> = part.about().sockets.iter().map(|socket| socket.name.as_str()).collect();
    assert_eq!((names, part.about().options.len()), (vec!["side"], 1));
}

#[test]
fn sockets_and_options_that_no_file_can_have_are_refused() {
    let rig = read_template(NOTED.as_bytes()).unwrap().rig;
    type Wrong = fn(&mut RigAbout);
    let cases: [(Wrong, &str); 6] = [
        (|about| about.sockets[0].name = String::new(), "a name without points"),
        (|about| about.sockets[0].name = "side".to_owned(), "two sockets are called"),
        (|about| about.sockets[0].rotation.x = f32::NAN, "not finite"),
        (|about| about.options.push(about.options[0].clone()), "two options are called"),
        (|about| about.options[0].default = "(1".to_owned(), "no value as in a file"),
        (|about| about.options[0].form = Some(OptionForm::Check), "takes true or false"),
    ];
    for (wrong, reason) in cases {
        let mut about = rig.about().clone();
        wrong(&mut about);
        let mut copy = rig.clone();
        let error = copy.apply(&RigEdit::SetAbout(Box::new(about))).unwrap_err();
        assert!(error.to_string().contains(reason), "{reason}: {error}");
        assert_eq!(copy, rig);
    }
}
