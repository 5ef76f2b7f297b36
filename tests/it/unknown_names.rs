//! Templates with thousands of names that nothing has, or that many things have: what is told of them grows with their number, and
//! so does the work of finding similar names.

use rigsmith::rig::{
    Rig, Uid,
    part::{Part, PartChange, PartInstance},
    reference::MOST_COMPARED,
    template::{read_template, survey_template},
};

fn template(joints: impl Iterator<Item = String>) -> String {
    format!("(format: 2, name: \"n\", joints: [{}])", joints.collect::<Vec<String>>().join(", "))
}

fn null(at: &str) -> String {
    format!("tags: [Command(module: \"null\", params: (at: \"{at}\"))]")
}

/// Number of messages, and how many of them name something similar.
fn told<'a>(messages: impl Iterator<Item = &'a String>) -> (usize, usize) {
    let all: Vec<&String> = messages.filter(|message| message.contains("there is no")).collect();
    (all.len(), all.iter().filter(|message| message.contains("did you mean")).count())
}

/// Similar names of a few unknown ones are told, and those of thousands are not looked for.
#[test]
fn unknown_names_are_compared_with_a_bounded_number_of_others() {
    for count in [20, 3_000] {
        let referring =
            |number: usize| format!("(label: \"joint_{number}\", {})", null(&format!("@joint joint_{number}x")));
        let read = read_template(template((0..count).map(referring)).as_bytes()).unwrap();
        let references = told(read.notes.iter());
        let hanging = |number: usize| format!("(label: \"joint_{number}\", parent: \"joint_{number}x\")");
        let text = template((0..count).map(hanging));
        let (Ok((_, faults)) | Err(faults)) = survey_template(text.as_bytes());
        let parents = told(faults.iter().map(|fault| &fault.message));
        for (all, similar) in [references, parents] {
            assert_eq!(all, count);
            assert!(similar > 0 && (similar - 1) * count <= MOST_COMPARED, "{similar} of {count}");
            assert!(count > 20 || similar == count, "{similar} of {count}");
        }
    }
}

/// An instance may change everything in its part: each change finds its own, and unknown ones are compared within the budget.
#[test]
fn changes_of_thousands_of_tags_and_joints_find_their_own() {
    for count in [20, 2_000] {
        let joint = |number: usize| format!("(label: \"joint_{number}\", {})", null(&format!("@joint joint_{number}")));
        let part = Part::from(read_template(template((0..count).map(joint)).as_bytes()).unwrap());
        let of_number = |number: usize| {
            ["", "x"].into_iter().flat_map(move |end| {
                let tag = Some(format!("null/joint_{number}{end}"));
                let joint = Some(format!("joint_{number}{end}"));
                [
                    PartChange { tag, enabled: Some(false), ..PartChange::default() },
                    PartChange { joint, locked: Some(true), ..PartChange::default() },
                ]
            })
        };
        let changes = (0..count).flat_map(of_number).collect();
        let instance = PartInstance { uid: Uid(7), changes, ..PartInstance::default() };
        let fitted = instance.fitted(&part, &|_, _| None).unwrap();
        let mut rig = Rig::new(Uid(1), "host");
        let report = instance.put_into(&mut rig, &part, &fitted, &|_, _| None, None).unwrap();
        let is_changed = rig.walk().map(|joint| joint.data.locked && joint.data.tags.iter().all(|tag| !tag.enabled));
        assert_eq!(is_changed.filter(|is_changed| *is_changed).count(), count);
        assert_eq!(report.faults.len(), 2 * count);
        let similar = report.faults.iter().filter(|(_, fault)| fault.to_string().contains("did you mean")).count();
        assert!(similar > 0 && (similar - 1) * count <= MOST_COMPARED, "{similar} of {count}");
        assert!(count > 20 || similar == 2 * count, "{similar} of {count}");
    }
}

/// Bytes of what is told of references to a name that all joints have, and of parents with that name.
fn told_of_equal_names(count: usize) -> [usize; 2] {
    let joint = |number: usize, rest: &str| format!("(uid: \"{:016x}\", label: \"j\", {rest})", 0x1000 + number);
    let referring = template((0..count).map(|number| joint(number, &null("@joint j"))));
    let notes = read_template(referring.as_bytes()).unwrap().notes;
    assert_eq!(notes.len(), count);
    let (Ok((_, faults)) | Err(faults)) =
        survey_template(template((0..count).map(|number| joint(number, "parent: \"j\""))).as_bytes());
    assert_eq!(faults.len(), count);
    let (notes, faults) = (notes.iter().map(String::len), faults.iter().map(|fault| fault.message.len()));
    [notes.sum(), faults.sum()]
}

#[test]
fn names_of_many_joints_do_not_list_all_of_them_each_time() {
    let [few, many] = [150, 300].map(told_of_equal_names);
    for (few, many) in few.into_iter().zip(many) {
        assert!(few > 150 * 20 && many as f64 <= 2.3 * few as f64, "{few} and {many} bytes");
    }
}

/// A part may have a socket on each of its joints: each finds its own, and labels that no joint has are compared within the budget.
#[test]
fn sockets_of_thousands_of_joints_find_their_own() {
    for count in [20, 1_000] {
        let text = |end: &str| {
            let socket = |number: usize| format!("(name: \"s{number}\", joint: \"joint_{number}{end}\")");
            let sockets: Vec<String> = (0..count).map(socket).collect();
            let joints: Vec<String> = (0..count).map(|number| format!("(label: \"joint_{number}\")")).collect();
            let (sockets, joints) = (sockets.join(", "), joints.join(", "));
            format!("(format: 2, name: \"n\", kind: \"part\", sockets: [{sockets}], joints: [{joints}])")
        };
        let rig = read_template(text("").as_bytes()).unwrap().rig;
        assert_eq!(rig.about().sockets.len(), count);
        for (number, socket) in rig.about().sockets.iter().enumerate() {
            let label = rig.joint(socket.joint).and_then(|joint| joint.data.label.clone());
            assert_eq!((&*socket.name, label), (&*format!("s{number}"), Some(format!("joint_{number}"))));
        }
        let (Ok((_, faults)) | Err(faults)) = survey_template(text("x").as_bytes());
        let missing = || faults.iter().filter(|fault| fault.message.contains("which is not there"));
        let similar = missing().filter(|fault| fault.message.contains("did you mean")).count();
        assert_eq!(missing().count(), count);
        assert!(similar > 0 && (similar - 1) * count <= MOST_COMPARED, "{similar} of {count}");
        assert!(count > 20 || similar == count, "{similar} of {count}");
    }
}
