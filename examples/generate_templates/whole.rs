//! Whole characters: skeletons of the bundled models, and parts put together.

mod bird;
mod creature;
mod quadruped;

use std::path::Path;

use bevy::math::Vec3;
use rigsmith::{
    files::{RealDisk, load_rig_text},
    rig::{Rig, UidSource, character::import_rig_text, operations::Operation},
};

use super::parts::{self, Around};
use super::writer::{CENTER, Failure, LEFT, RIGHT, Writer};

/// Every whole template with its name.
pub const ALL: &[(&str, fn() -> Result<Writer, Failure>)] =
    &[("biped", biped), ("bird", bird::bird), ("hand", hand), ("quadruped", quadruped::quadruped)];

fn biped() -> Result<Writer, Failure> {
    let mut writer = skeleton("biped", 0x0b1e_ed00)?;
    writer.about("character", "A human with five fingers a hand, at rest in an A-pose, with controls for all of it.");
    let names = |list: &[&str], side: &str| list.iter().map(|name| format!("{name}{side}")).collect::<Vec<_>>();
    let fingers: Vec<String> = parts::hand::FINGERS
        .iter()
        .flat_map(|(finger, _)| ["01", "02", "03"].map(|number| format!("{finger}_{number}")))
        .collect();
    let fingers: Vec<&str> = fingers.iter().map(String::as_str).collect();
    writer.members("spine", CENTER, &names(&["hips", "spine", "spine_1", "chest"], ""));
    writer.members("head", [0.8, 0.47, 0.65], &names(&["neck", "head"], ""));
    for (side, color, paler) in [("_l", LEFT, [0.0, 0.62, 0.45]), ("_r", RIGHT, [0.9, 0.62, 0.0])] {
        parts::hand::orient(&mut writer, side);
        let arm = names(&["clavicle", "upper_arm", "forearm", "hand"], side);
        writer.members(&format!("arm{side}"), color, &arm);
        writer.members(&format!("hand{side}"), paler, &names(&fingers, side));
        writer.members(&format!("leg{side}"), color, &names(&["thigh", "shin", "foot", "toe"], side));
    }
    root(&mut writer, "hips");
    let space = |name, node: &str| (name, node.to_owned());
    let around = |spaces| Around { root: "@command root role:control".to_owned(), spaces };
    let [world, hips, chest, head] = [
        space("root", "@command root role:control"),
        space("hips", "@joint hips"),
        space("chest", "@joint chest"),
        space("head", "@joint head"),
    ];
    writer.part("spine", |writer| parts::spine::tags(writer, &around(vec![world.clone()])));
    writer.part("head", |writer| parts::neck_head::tags(writer, &around(vec![chest.clone(), world.clone()])));
    writer.part("arm", |writer| {
        parts::arm::tags(writer, &around(vec![world.clone(), chest.clone(), hips.clone(), head.clone()]));
    });
    writer.part("hand", |writer| parts::hand::tags(writer, "@command root role:control"));
    writer.part("leg", |writer| parts::leg::tags(writer, &around(vec![world.clone(), hips.clone(), chest.clone()])));
    writer.mirror();
    Ok(writer)
}

/// A control on the ground that everything stands on, and that scales everything. Alias: `root`.
pub fn root(writer: &mut Writer, joint: &str) {
    let at = writer.rig().find_label(joint).map_or(Vec3::ZERO, |joint| writer.rig().position(joint));
    let down = format!("({:?}, {:?}, {:?})", -at.x, -at.y, -at.z);
    let size = 0.6 * at.y;
    writer
        .command(
            joint,
            "origin",
            "null",
            format!("(world: true, orient: false, translate: {down}, creation: (name: \"origin\"))"),
        )
        .command(
            joint,
            "root",
            "control",
            format!(
                "(at: \"@command origin\", parent: \"@command origin\", follow: false, shape: \"four_arrows\", size: Some({size:?}), \
                 creation: (name: \"root\"))"
            ),
        )
        .command(
            joint,
            "stand",
            "null",
            "(parent: \"@command root role:control\", insert: true, creation: (name: \"skeleton\"))",
        );
}

fn hand() -> Result<Writer, Failure> {
    let mut writer = skeleton("hand", 0x0b1e_ed01)?;
    writer.about("part", "A left hand with its forearm: a control for each joint of five fingers, curl and spread.");
    writer.members("arm_l", LEFT, &["forearm_l".to_owned(), "hand_l".to_owned()]);
    let others: Vec<String> = writer.rig().walk().skip(2).filter_map(|joint| joint.data.label.clone()).collect();
    writer.members("hand_l", [0.0, 0.62, 0.45], &others);
    parts::hand::orient(&mut writer, "_l");
    writer.part("hand", |writer| {
        let around = Around::make(writer, "forearm_l", "arm");
        parts::hand::tags(writer, &around.root);
    });
    // After what stands still: this is the control that carries what is dropped onto the hand.
    writer.command("forearm_l", "wrist", "control", "(at: \"@joint forearm_l + @joint hand_l\")");
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
