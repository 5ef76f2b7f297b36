//! A project from the time when rigs had no sockets and options: a save over its template keeps those of the file.

use rigsmith::rig::{RestTransform, RigAbout, part::HeaderSocket};

use super::*;

const TEMPLATE: &str = r#"// A limb of the studio.
(
    format: 2,
    name: "limb",
    kind: "part",
    sockets: [
        (name: "end", joint: "lower"), // Where a hand goes.
        (name: "side", joint: "upper", translation: (0.1, 0, 0)),
        (name: "tip", joint: "point"),
    ],
    options: [
        // How large it is.
        (name: "size", default: 0.5, sets: [(tag: "control/upper", param: "size")]),
    ],
    joints: [
        (label: "upper", tags: [control(size: 0.5)]),
        (label: "lower", parent: "upper", translation: (0, -0.3, 0)),
        (label: "point", parent: "lower", translation: (0, -0.1, 0)),
    ],
)
"#;

/// The same rig as projects had it.
const RIG: &str = r#"(
                format: 2,
                name: "limb",
                kind: "part",
                joints: [
                    (label: "upper", tags: [control(size: 0.5)]),
                    (label: "lower", parent: "upper", translation: (0, -0.3, 0)),
                    (label: "point", parent: "lower", translation: (0, -0.1, 0)),
                ],
            )"#;

/// The project of that time; it follows its template if `follows` is true.
fn older(uid: Uid, follows: bool) -> String {
    let template = format!("(rig: \"{uid}\", path: \"own.rig.ron\", base: {RIG})");
    let templates = if follows { format!("    templates: [{template}],\n") } else { String::new() };
    format!("(\n    format: 3,\n    name: \"older\",\n    rigs: [(rig: {RIG})],\n{templates})\n")
}

/// The window with that project open, and the file of its template.
fn opened(follows: bool) -> (Studio, PathBuf) {
    let mut studio = Studio::new(LoaderPanel::default());
    let folder = studio.folder.path().to_owned();
    let (template, project) = (folder.join("own.rig.ron"), folder.join("older.rigsmith.ron"));
    fs::write(&template, TEMPLATE).unwrap();
    let uid = load_template(&RealDisk, &template).unwrap().rig.uid();
    fs::write(&project, older(uid, follows)).unwrap();
    studio.open(OpenRequest::File(project));
    assert_eq!(studio.desk.rig().uid(), uid);
    let about = studio.desk.rig().about();
    assert!(about.sockets.is_empty() && about.options.is_empty(), "the project has none");
    (studio, template)
}

fn save(studio: &mut Studio, path: &Path) -> String {
    studio.send(SaveTemplate {
        path: path.to_owned(),
        replace: true,
        content: TemplateContent::Rig { picture: false },
    });
    fs::read_to_string(path).unwrap()
}

/// Names of a file's sockets and options.
fn lists(path: &Path) -> (Vec<String>, Vec<String>) {
    let about = load_template(&RealDisk, path).unwrap().rig.about().clone();
    let sockets = about.sockets.into_iter().map(|socket| socket.name).collect();
    (sockets, about.options.into_iter().map(|option| option.name).collect())
}

#[test]
fn a_rig_of_an_older_project_leaves_the_lists_of_its_template_in_the_file() {
    for follows in [true, false] {
        let (mut studio, template) = opened(follows);
        assert_eq!(save(&mut studio, &template), TEMPLATE, "nothing was changed: {:?}", studio.desk.told());
        assert!(studio.told("the socket \"end\""), "{:?}", studio.desk.told());
        let lower = studio.joint("lower");
        let raised = RestTransform::from_translation(Vec3::new(0.0, -0.4, 0.0));
        studio.change(Change::Do(Operation::Edits(vec![RigEdit::SetRest(lower, raised)])));
        let expected = TEMPLATE.replace("(0, -0.3, 0)", "(0, -0.4, 0)");
        // The second save has the first one as its base.
        assert_eq!(save(&mut studio, &template), expected, "one line has changed");
        assert_eq!(save(&mut studio, &template), expected);
    }
}

#[test]
fn what_is_added_in_an_older_project_comes_to_what_the_file_has_and_can_be_removed() {
    let (mut studio, template) = opened(true);
    let with = |studio: &Studio, names: &[&str]| {
        let joint = studio.joint("upper");
        let socket = |name: &&str| HeaderSocket {
            name: (*name).to_owned(),
            joint,
            translation: Vec3::ZERO,
            rotation: Vec3::ZERO,
        };
        let sockets = names.iter().map(socket).collect();
        let about = RigAbout { sockets, ..studio.desk.rig().about().clone() };
        Change::Do(Operation::Edits(vec![RigEdit::SetAbout(Box::new(about))]))
    };
    let add = with(&studio, &["top"]);
    studio.change(add);
    save(&mut studio, &template);
    let all = ["end", "side", "tip", "top"].map(str::to_owned).to_vec();
    assert_eq!(lists(&template), (all.clone(), vec!["size".to_owned()]));
    let remove = with(&studio, &[]);
    studio.change(remove);
    save(&mut studio, &template);
    assert_eq!(lists(&template), (all[..3].to_vec(), vec!["size".to_owned()]), "what the document had is removed");
}

#[test]
fn a_socket_goes_with_its_joint_in_an_older_project_too() {
    let (mut studio, template) = opened(true);
    let point = studio.joint("point");
    studio.change(Change::Do(Operation::Delete { joints: vec![point], keep_children: false }));
    save(&mut studio, &template);
    let kept = ["end", "side"].map(str::to_owned).to_vec();
    assert_eq!(lists(&template), (kept, vec!["size".to_owned()]), "{:?}", studio.desk.told());
}
