//! Random rigs under random edits: building what changed gives what building from nothing gives, bit for bit.

use super::*;
use crate::mutate::Random;

/// Joints of a random rig, at least.
const JOINTS: usize = 20;
/// Commands of a random rig, at least.
const COMMANDS: usize = 40;

struct Maker {
    random: Random,
    next: u64,
}

impl Maker {
    fn uid(&mut self) -> Uid {
        self.next += 1;
        Uid(self.next)
    }

    fn joint(&mut self, rig: &Rig) -> Uid {
        let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
        self.random.pick(&joints)
    }

    fn tags(rig: &Rig) -> Vec<(Uid, Tag)> {
        rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone()))).collect()
    }

    fn reference(&mut self, rig: &Rig, nodes: bool) -> String {
        let commands: Vec<Uid> = Self::tags(rig)
            .into_iter()
            .filter(|(_, tag)| matches!(&tag.kind, TagKind::Command { module, .. } if module == "mark"))
            .map(|(_, tag)| tag.uid)
            .collect();
        match self.random.below(if nodes { 9 } else { 4 }) {
            0 => "@this".to_owned(),
            1 | 2 => format!("@joint #{}", self.joint(rig)),
            3 => format!("@hierarchy #{} pick:{}", self.joint(rig), self.random.pick(&["START", "MIDDLE", "END"])),
            4 => format!("@joints label:#{}", self.joint(rig)),
            5 => "@module mark pick:START,END".to_owned(),
            6 => format!("@any label:#{} type:null + @this", self.joint(rig)),
            7 => "@any group:own type:null,joint pick:MIDDLE".to_owned(),
            _ if commands.is_empty() => "@this".to_owned(),
            _ => format!("@command #{} pick:START", self.random.pick(&commands)),
        }
    }

    fn command(&mut self, rig: &Rig) -> (String, String) {
        let number = |maker: &mut Self| maker.random.below(40) as f32 / 8.0;
        match self.random.below(6) {
            0 | 1 => {
                let below = self.random.chance(2);
                let label = if self.random.chance(4) { ", create: (label: \"made\")" } else { "" };
                let (at, up) = (self.reference(rig, true), number(self));
                ("mark".into(), format!("(at: {at:?}, below: {below}, up: {up:?}{label})"))
            }
            2 | 3 => {
                let (node, by) = (self.reference(rig, true), number(self));
                ("nudge".into(), format!("(node: {node:?}, by: {by:?})"))
            }
            4 => {
                let (node, targets) = (self.reference(rig, false), self.reference(rig, true));
                ("follow".into(), format!("(node: {node:?}, targets: {targets:?})"))
            }
            _ => {
                let (node, name) = (self.reference(rig, false), self.random.below(1000));
                ("attribute".into(), format!("(node: {node:?}, name: \"a{name}\", default: {:?})", number(self)))
            }
        }
    }

    fn tag(&mut self, rig: &Rig) -> Tag {
        let (module, params) = self.command(rig);
        let features = Self::tags(rig).into_iter().filter(|(_, tag)| matches!(tag.kind, TagKind::Feature { .. }));
        let features: Vec<Uid> = features.map(|(_, tag)| tag.uid).collect();
        let feature = (!features.is_empty() && self.random.chance(4)).then(|| self.random.pick(&features));
        Tag {
            uid: self.uid(),
            enabled: !self.random.chance(10),
            comment: String::new(),
            kind: TagKind::Command { module, params, feature },
        }
    }

    fn new_joint(&mut self, rig: &Rig) -> RigEdit {
        let parent = (!rig.is_empty() && !self.random.chance(8)).then(|| self.joint(rig));
        let groups: Vec<Uid> = rig.groups().iter().map(|group| group.uid).collect();
        let group = (!groups.is_empty() && self.random.chance(2)).then(|| self.random.pick(&groups));
        let at = [self.random.below(9) as f32 / 4.0, 1.0, self.random.below(5) as f32];
        let label = (!self.random.chance(4)).then(|| format!("j{}", self.random.below(30)));
        let rest = RestTransform::from_translation(at.into());
        let joint = JointData { uid: self.uid(), label, group, rest, ..Default::default() };
        RigEdit::AddJoint { joint: Box::new(joint), parent, index: self.random.below(4) }
    }

    /// A rig that builds: commands that fail are dropped.
    fn rig(&mut self) -> Rig {
        let mut rig = Rig::new(self.uid(), "random");
        for number in 0..3 {
            let group = GroupData { uid: self.uid(), name: format!("g{number}"), color: [0.5; 3], enabled: number < 2 };
            rig.apply(&RigEdit::AddLocalGroup(group, 0)).unwrap();
        }
        while rig.len() < JOINTS + self.random.below(4) {
            let edit = self.new_joint(&rig);
            rig.apply(&edit).unwrap();
        }
        for _ in 0..4 {
            let kind = TagKind::Feature { kind: "generic".into(), name: "f".into(), switch: String::new() };
            let tag = Tag { uid: self.uid(), enabled: !self.random.chance(3), comment: String::new(), kind };
            let joint = self.joint(&rig);
            rig.apply(&RigEdit::AddTag { joint, tag: Box::new(tag), index: 0 }).unwrap();
        }
        let mut tries = 0;
        while Self::tags(&rig).len() < COMMANDS + 4 && tries < 4 * COMMANDS {
            tries += 1;
            let (joint, tag) = (self.joint(&rig), self.tag(&rig));
            let undo = rig.apply(&RigEdit::AddTag { joint, tag: Box::new(tag), index: usize::MAX }).unwrap();
            if Builder::build(&rig, &modules()).is_err() {
                rig.apply(&undo).unwrap();
            }
        }
        rig
    }

    /// An edit of any kind; it may not apply, and the rig may fail to build with it.
    fn edit(&mut self, rig: &Rig) -> RigEdit {
        let joint = self.joint(rig);
        let tags = Self::tags(rig);
        let (bearer, tag) = self.random.pick(&tags);
        match self.random.below(12) {
            0 => self.new_joint(rig),
            1 => RigEdit::RemoveJoint(joint),
            2 => RigEdit::SetParent { joint, parent: Some(self.joint(rig)), index: self.random.below(3) },
            3 => RigEdit::SetLabel(joint, Some(format!("j{}", self.random.below(30)))),
            4 => {
                RigEdit::SetRest(joint, RestTransform::from_translation([0.0, self.random.below(9) as f32, 0.0].into()))
            }
            5 => {
                let group = self.random.pick(rig.groups());
                let enabled = !group.enabled;
                RigEdit::SetLocalGroup(GroupData { enabled, ..group })
            }
            6 => RigEdit::SetTag(bearer, Box::new(Tag { enabled: !tag.enabled, ..tag })),
            7 => {
                let index = self.random.below(4);
                RigEdit::Batch(vec![
                    RigEdit::RemoveTag(bearer, tag.uid),
                    RigEdit::AddTag { joint: self.joint(rig), tag: Box::new(tag), index },
                ])
            }
            8 => RigEdit::RemoveTag(bearer, tag.uid),
            9 => RigEdit::AddTag { joint, tag: Box::new(self.tag(rig)), index: self.random.below(4) },
            10 => {
                let groups: Vec<Uid> = rig.groups().iter().map(|group| group.uid).collect();
                RigEdit::SetGroup(joint, Some(self.random.pick(&groups)))
            }
            _ => {
                let kind = match &tag.kind {
                    TagKind::Command { feature, .. } => {
                        let (module, params) = self.command(rig);
                        TagKind::Command { module, params, feature: *feature }
                    }
                    feature => feature.clone(),
                };
                RigEdit::SetTag(bearer, Box::new(Tag { kind, ..tag }))
            }
        }
    }
}

/// `RIGSMITH_SEEDS` rigs (40 by default), 30 edits each.
#[test]
fn building_what_changed_is_building_from_nothing() {
    let seeds = std::env::var("RIGSMITH_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(40);
    let (mut ran, mut all, mut failing) = (0, 0, 0);
    for seed in 0..seeds {
        let mut maker = Maker { random: Random::new(seed), next: seed << 32 };
        let mut rig = maker.rig();
        let mut builder = started(&rig);
        let report = builder.run_all();
        assert_eq!((report.error, builder.len() >= COMMANDS / 2), (None, true), "seed {seed}");
        for step in 0..30 {
            let edit = maker.edit(&rig);
            let Ok(undo) = rig.apply(&edit) else { continue };
            builder.touch(&rig, &edit);
            let report = builder.run_all();
            let context = format!("seed {seed}, step {step}: {edit:?}");
            let mut fresh = started(&rig);
            let full = fresh.run_all();
            assert_eq!(report.error, full.error, "{context}");
            assert_eq!(builder.cursor(), fresh.cursor(), "{context}");
            assert_eq!(builder.built(), fresh.built(), "{context}");
            ran += report.executed.len();
            all += full.executed.len();
            if report.error.is_some() {
                failing += 1;
                rig.apply(&undo).unwrap();
                builder.touch(&rig, &undo);
                assert_eq!(builder.run_all().error, None, "{context}, undone");
            }
        }
    }
    println!("{ran} commands ran where building from nothing runs {all}; {failing} edits failed to build");
    assert!(ran * 3 < all && failing > 0);
}

/// 1000 random rigs with `RIGSMITH_SEEDS=1000`; 60 by default.
#[test]
fn rolled_back_and_built_again_is_the_same() {
    let seeds = std::env::var("RIGSMITH_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(60);
    for seed in 0..seeds {
        let mut maker = Maker { random: Random::new(1_000_000 + seed), next: seed << 32 };
        let rig = maker.rig();
        let mut builder = started(&rig);
        let bare = builder.built();
        builder.run_all();
        let built = builder.built();
        // To some places on the way, and back.
        for _ in 0..4 {
            let place = maker.random.below(builder.len() + 1);
            builder.run_to(place);
            let mut fresh = started(&rig);
            fresh.run_to(place);
            assert_eq!(builder.built(), fresh.built(), "seed {seed}, place {place}");
        }
        builder.roll_back();
        assert_eq!(builder.built(), bare, "seed {seed}");
        assert!(builder.run_all().executed.is_empty(), "nothing has changed");
        assert_eq!(builder.built(), built, "seed {seed}");
    }
}
