//! Makes `assets/templates/*.rig.ron` from the skeletons that come with the bundled models.
//!
//! `cargo run --release --example generate_templates`: joints oriented along their bones, sides paired, groups coloured.

use std::{error::Error, path::Path};

use rigsmith::{
    files::{RealDisk, load_rig_text, store_rig},
    rig::{
        Rig, RigAbout, RigEdit, Uid, UidSource,
        character::import_rig_text,
        label::{label_side, mirrored_label},
        operations::{Axis, Operation},
    },
};

fn main() -> Result<(), Box<dyn Error>> {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let about = [
        ("biped", "character", "A human skeleton with five fingers a hand, at rest in an A-pose."),
        ("hand", "part", "A left hand with its forearm: five fingers."),
    ];
    for (seed, (name, kind, description)) in about.into_iter().enumerate() {
        let skeleton = load_rig_text(&RealDisk, &assets.join(format!("models/{name}.rig")))?;
        let mut uids = UidSource::seeded(0x0b1e_ed00 + seed as u64);
        let mut rig = Rig::new(uids.next_uid(), name);
        let about = RigAbout {
            name: name.to_owned(),
            version: "1.0.0".to_owned(),
            kind: kind.to_owned(),
            author: "Rigsmith".to_owned(),
            description: description.to_owned(),
            preview: None,
        };
        let mut edits = import_rig_text(&skeleton, &mut uids).0;
        edits.push(RigEdit::SetAbout(Box::new(about)));
        Operation::Edits(edits).run(&mut rig, &mut uids, None)?;
        finish(&mut rig, &mut uids)?;
        store_rig(&RealDisk, &assets.join(format!("templates/{name}.rig.ron")), &rig)?;
        println!("{name}: {} joints", rig.len());
    }
    Ok(())
}

fn finish(rig: &mut Rig, uids: &mut UidSource) -> Result<(), Box<dyn Error>> {
    let joints: Vec<(Uid, String)> =
        rig.walk().map(|joint| (joint.data.uid, joint.data.label.clone().unwrap_or_default())).collect();
    let pairs = joints.iter().filter_map(|(joint, label)| {
        let partner = rig.find_label(&mirrored_label(label)?)?;
        Some(RigEdit::SetMirror(*joint, Some(partner)))
    });
    let pairs = pairs.collect();
    Operation::Edits(pairs).run(rig, uids, None)?;
    let all: Vec<Uid> = joints.iter().map(|(joint, _)| *joint).collect();
    Operation::Orient { joints: all, along: Axis::Y }.run(rig, uids, None)?;
    let sides = [("center", 0, [0.94, 0.89, 0.26]), ("left", 1, [0.34, 0.71, 0.91]), ("right", -1, [0.84, 0.37, 0.0])];
    for (name, side, color) in sides {
        let members: Vec<Uid> = joints.iter().filter(|(_, label)| label_side(label) == side).map(|(j, _)| *j).collect();
        if !members.is_empty() {
            Operation::Group { joints: members, name: name.to_owned(), color: Some(color) }.run(rig, uids, None)?;
        }
    }
    Ok(())
}
