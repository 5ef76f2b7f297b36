//! Work of a review of many failing commands, and of commands that are switched on and off: counted in joints that a builder compares
//! with those of the document.

use std::sync::Arc;

use rigsmith::{
    processor::{Builder, Modules, review_with},
    rig::{Rig, RigEdit, TagData, template::read_template},
};

/// Largest growth for twice the size.
const GROWTH: f64 = 2.3;

/// Chain of so many joints, each with a command.
fn chain(count: usize, command: &str) -> Rig {
    let joint = |number: usize| {
        let parent = number.checked_sub(1).map(|above| format!(", parent: \"j{above}\"")).unwrap_or_default();
        format!("(label: \"j{number}\"{parent}, translation: (0, 0.1, 0), tags: [{command}])")
    };
    let joints: Vec<String> = (0..count).map(joint).collect();
    read_template(format!("(format: 2, name: \"n\", joints: [{}])", joints.join(", ")).as_bytes()).unwrap().rig
}

fn modules() -> Arc<Modules> {
    Arc::new(rigsmith::modules::all())
}

#[test]
fn failing_commands_are_left_out_without_a_look_at_all_joints() {
    let modules = modules();
    let counts = [50, 100, 200];
    let works = counts.map(|count| {
        let rig = chain(count, "Command(module: \"control\", params: (at: \"@this\", size: -1.0))");
        let mut builder = Builder::new(modules.clone());
        let problems = review_with(&rig, &modules, &mut builder);
        assert_eq!(problems.len(), count, "{:?}", problems.first());
        builder.followed()
    });
    for (pair, count) in works.windows(2).zip(counts) {
        let most = 8 * count as u64;
        assert!(pair[0] > 0 && pair[0] <= most && pair[1] as f64 <= GROWTH * pair[0] as f64, "{works:?}");
    }
}

#[test]
fn a_switched_command_is_taken_over_alone() {
    let modules = modules();
    let mut rig = chain(20, "Command(module: \"control\", params: (at: \"@this\"))");
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    assert_eq!(builder.run_all().error, None);
    let before = builder.followed();
    let tags: Vec<_> =
        rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone()))).collect();
    for enabled in [false, true] {
        for (joint, tag) in tags.iter().step_by(3) {
            let edit = RigEdit::SetTag(*joint, Box::new(TagData { enabled, ..tag.clone() }));
            rig.apply(&edit).unwrap();
            builder.touch(&rig, &edit);
            assert_eq!(builder.run_all().error, None);
            assert_eq!(builder.built(), Builder::build(&rig, &modules).unwrap(), "switched to {enabled}");
        }
    }
    assert_eq!(builder.followed(), before);
}
