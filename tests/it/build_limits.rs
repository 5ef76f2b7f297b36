//! Limits of what commands may make: a few tags that name everything cannot make more than was agreed.

use std::sync::Arc;

use rigsmith::{
    processor::{BuildLimits, BuildProblem, Builder, ModuleError, Modules},
    rig::{
        Rig, RigEdit, TagData, Uid,
        template::{read_template, write_template},
    },
};

/// One joint with commands that each make a control for everything there is.
fn doubling(commands: usize) -> Rig {
    let tags: Vec<String> = (1..=commands)
        .map(|tag| format!(r#"Command(uid: "00000000000000a{tag:x}", module: "control", params: (at: "@any"))"#))
        .collect();
    let text = format!(
        r#"(format: 1, uid: "0000000000000001", name: "n", joints: [(uid: "0000000000000002", translation: (0.0, 0.1, 0.0), tags: [{}])])"#,
        tags.join(", ")
    );
    read_template(text.as_bytes()).unwrap().rig
}

fn limited(made: usize) -> Modules {
    let mut modules = rigsmith::modules::all();
    modules.limits = BuildLimits { made, attributes: 2, ..BuildLimits::default() };
    modules
}

#[test]
fn commands_that_double_what_there_is_end_at_the_limit() {
    let rig = doubling(12);
    for (modules, limit) in [(limited(100), 100), (rigsmith::modules::all(), BuildLimits::default().made)] {
        let mut builder = Builder::new(Arc::new(modules));
        builder.sync(&rig);
        let error = builder.run_all().error.unwrap();
        assert!(
            matches!(&error.problem, BuildProblem::Module(ModuleError::TooMany { limit: found, .. }) if *found == limit),
            "{error}"
        );
        assert!(error.to_string().contains("@any"), "{error}");
    }
}

/// Commands that were refused for the limit are built when earlier commands make less, and the build is the one from nothing.
#[test]
fn a_refused_command_is_tried_again() {
    let mut rig = doubling(12);
    let modules = Arc::new(limited(100));
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    let refused = builder.run_all().error.unwrap();
    let tags = rig.joint(Uid(2)).unwrap().data.tags.clone();
    let mut inverses = Vec::new();
    for tag in tags.into_iter().skip(1).filter(|tag| tag.uid != refused.command) {
        inverses.push(rig.apply(&RigEdit::SetTag(Uid(2), Box::new(TagData { enabled: false, ..tag }))).unwrap());
    }
    builder.sync(&rig);
    assert_eq!(builder.run_all().error, None);
    assert_eq!(builder.built(), Builder::build(&rig, &modules).unwrap());
    for inverse in inverses.iter().rev() {
        rig.apply(inverse).unwrap();
    }
    builder.sync(&rig);
    assert_eq!(builder.run_all().error.unwrap(), refused);
    assert_eq!(write_template(&rig), write_template(&doubling(12)));
}
