//! Whole characters: skeletons of the bundled models, and parts put together.

mod bird;
mod creature;
mod quadruped;

use std::path::Path;

use rigsmith::{
    files::{RealDisk, load_rig_text},
    rig::{Rig, UidSource, character::import_rig_text, operations::Operation},
};

use super::writer::{CENTER, Failure, LEFT, RIGHT, Writer};

/// Every whole template with its name.
pub const ALL: &[(&str, fn() -> Result<Writer, Failure>)] =
    &[("biped", biped), ("bird", bird::bird), ("hand", hand), ("quadruped", quadruped::quadruped)];

fn biped() -> Result<Writer, Failure> {
    let mut writer = skeleton("biped", 0x0b1e_ed00)?;
    writer.about("character", "A human skeleton with five fingers a hand, at rest in an A-pose.");
    sides(&mut writer);
    Ok(writer)
}

fn hand() -> Result<Writer, Failure> {
    let mut writer = skeleton("hand", 0x0b1e_ed01)?;
    writer.about("part", "A left hand with its forearm: five fingers.");
    sides(&mut writer);
    Ok(writer)
}

/// The joints that come with a bundled model, oriented along their bones and paired.
pub fn skeleton(name: &str, seed: u64) -> Result<Writer, Failure> {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let skeleton = load_rig_text(&RealDisk, &assets.join(format!("models/{name}.rig")))?;
    let mut uids = UidSource::seeded(seed);
    let mut rig = Rig::new(uids.next_uid(), name);
    Operation::Edits(import_rig_text(&skeleton, &mut uids).0).run(&mut rig, &mut uids, None)?;
    let mut writer = Writer::from_rig(rig);
    writer.pair().orient();
    Ok(writer)
}

/// A local group for each side.
pub fn sides(writer: &mut Writer) {
    let labels: Vec<String> = writer.rig().walk().filter_map(|joint| joint.data.label.clone()).collect();
    for (name, side, color) in [("center", 0, CENTER), ("left", 1, LEFT), ("right", -1, RIGHT)] {
        let of = |label: &&String| rigsmith::rig::label::label_side(label) == side;
        let members: Vec<String> = labels.iter().filter(of).cloned().collect();
        if !members.is_empty() {
            writer.members(name, color, &members);
        }
    }
}
