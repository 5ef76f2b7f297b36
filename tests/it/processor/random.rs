//! Random rigs under random edits: building what changed gives what building from nothing gives, bit for bit.

use std::collections::BTreeSet;

use super::*;
use crate::random::Random;

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

    fn tags(rig: &Rig) -> Vec<(Uid, TagData)> {
        rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone()))).collect()
    }

    fn reference(&mut self, rig: &Rig, nodes: bool) -> String {
        let commands: Vec<Uid> = Self::tags(rig)
            .into_iter()
            .filter(|(_, tag)| matches!(&tag.kind, TagKind::Command { module, .. } if module == "mark"))
            .map(|(_, tag)| tag.uid)
            .collect();
        match self.random.below(if nodes { 10 } else { 4 }) {
            0 => "@this".to_owned(),
            1 | 2 => format!("@joint #{}", self.joint(rig)),
            3 => format!("@hierarchy #{} pick:{}", self.joint(rig), self.random.pick(&["START", "MIDDLE", "END"])),
            4 => format!("@joints label:#{}", self.joint(rig)),
            5 => "@module mark pick:START,END".to_owned(),
            6 => format!("@any label:#{} type:null + @this", self.joint(rig)),
            7 => "@any group:own type:null,joint pick:MIDDLE".to_owned(),
            8 => "@root + @this".to_owned(),
            _ if commands.is_empty() => "@this".to_owned(),
            _ => format!("@command #{} pick:START", self.random.pick(&commands)),
        }
    }

    /// A joint and one that lies `bones` below it.
    fn chain(&mut self, rig: &Rig, bones: usize) -> Option<(Uid, Uid)> {
        let ends: Vec<(Uid, Uid)> = rig
            .walk()
            .filter_map(|end| Some((rig.ancestors(end.data.uid).nth(bones - 1)?.data.uid, end.data.uid)))
            .collect();
        (!ends.is_empty()).then(|| self.random.pick(&ends))
    }

    /// A node that commands of a module made, or a joint if there is none.
    fn created_node(&mut self, rig: &Rig, by: &str) -> String {
        let commands: Vec<Uid> = Self::tags(rig)
            .into_iter()
            .filter(|(_, tag)| matches!(&tag.kind, TagKind::Command { module, .. } if module == by))
            .map(|(_, tag)| tag.uid)
            .collect();
        match commands.is_empty() {
            true => format!("@joint #{}", self.joint(rig)),
            false => format!("@command #{} pick:START", self.random.pick(&commands)),
        }
    }

    fn number(&mut self) -> f32 {
        self.random.below(40) as f32 / 8.0
    }

    fn command(&mut self, rig: &Rig) -> (String, String) {
        const MODULES: &[&str] = &[
            "mark",
            "mark",
            "mark",
            "nudge",
            "nudge",
            "follow",
            "attribute",
            "null",
            "control",
            "control",
            "control",
            "layer",
            "insert_joints",
            "mirror_joints",
            "orient_joints",
            "duplicate_chain",
            "parent",
            "point",
            "orient",
            "scale",
            "aim",
            "pole_vector",
            "blend",
            "limit",
            "ik_handle",
            "ik_fk_switch",
            "spline_ik",
            "space_switch",
            "reverse_foot",
            "twist",
            "half_joint",
            "stretch",
            "spring",
            "driven_key",
            "expression",
            "morph",
            "cone_reader",
            "rbf_reader",
            "piston",
            "wheel",
            "path",
            "rivet",
        ];
        let module = self.random.pick(MODULES);
        let (any, joint) = (self.reference(rig, true), self.reference(rig, false));
        let control = self.created_node(rig, "control");
        let other = self.created_node(rig, "null");
        let (a, b) = self.chain(rig, 2).unwrap_or((Uid(0), Uid(0)));
        let middle = rig.joint(b).and_then(|joint| joint.parent).unwrap_or(Uid(0));
        let number = self.number();
        let name = format!("a{}", self.random.below(1000));
        let params = match module {
            "mark" => {
                let label = if self.random.chance(4) { ", create: (label: \"made\")" } else { "" };
                format!("(at: {any:?}, below: {}, up: {number:?}{label})", self.random.chance(2))
            }
            "nudge" => format!("(node: {any:?}, by: {number:?})"),
            "follow" => format!("(node: {joint:?}, targets: {any:?})"),
            "attribute" => format!("(node: {any:?}, name: \"{name}\", default: {number:?})"),
            "null" => format!("(at: {any:?}, world: {}, translate: (0.0, {number:?}, 0.0))", self.random.chance(2)),
            "control" => {
                let (follow, hierarchy) = (self.random.chance(3), self.random.chance(2));
                let size = if self.random.chance(2) { format!(", size: {:?}", number + 0.1) } else { String::new() };
                format!("(at: {joint:?}, follow: {follow}, hierarchy: {hierarchy}{size})")
            }
            "layer" => format!("(nodes: {any:?}, name: \"l{}\", use_existing: true)", self.random.below(3)),
            "insert_joints" => format!("(joint: \"@joint #{a}\", count: {})", 1 + self.random.below(3)),
            "mirror_joints" | "orient_joints" => format!("(joints: \"@hierarchy #{a}\")"),
            "duplicate_chain" => format!("(joints: \"@hierarchy #{a}\", suffix: \"copy\")"),
            "parent" | "point" | "orient" | "scale" => {
                let keep = self.random.chance(2);
                format!("(node: {joint:?}, targets: {:?}, keep_offset: {keep})", format!("{control} + {other}"))
            }
            "aim" => format!("(node: {joint:?}, targets: {control:?})"),
            "pole_vector" => {
                let chain = format!("@joint #{a} + @joint #{middle} + @joint #{b}");
                format!("(chain: {chain:?}, prefer: (0.0, 0.0, 1.0))")
            }
            "blend" => {
                let (nodes, ends) = (format!("@joint #{b}"), [&control, &other]);
                format!("(nodes: {nodes:?}, a: {:?}, b: {:?}, blend: 0.5)", ends[0], ends[1])
            }
            "limit" => format!("(nodes: {joint:?}, limits: (rotate: ((0.0, {number:?}), (None, None), (None, None))))"),
            "ik_handle" => format!(
                "(start: \"@joint #{a}\", end: \"@joint #{b}\", goal: {control:?}, prefer: (0.0, 0.0, 1.0), stretch: {:?})",
                number / 5.0
            ),
            "ik_fk_switch" => {
                let fk = format!("{control} + {other} + @module mark pick:START");
                format!(
                    "(start: \"@joint #{a}\", end: \"@joint #{b}\", fk: {fk:?}, goal: {other:?}, control: {control:?}, \
                     attribute: \"{name}\", prefer: (0.0, 0.0, 1.0))"
                )
            }
            "spline_ik" => {
                let points = format!("{control} + {other}");
                format!("(start: \"@joint #{a}\", end: \"@joint #{b}\", points: {points:?})")
            }
            "space_switch" => {
                let spaces = format!("{joint} + {other}");
                format!("(control: {control:?}, spaces: {spaces:?}, attribute: \"{name}\")")
            }
            "reverse_foot" => format!(
                "(ankle: \"@joint #{a}\", ball: \"@joint #{middle}\", toe: \"@joint #{b}\", control: {control:?})"
            ),
            "twist" => format!("(start: \"@joint #{middle}\", end: \"@joint #{b}\", count: 2)"),
            "half_joint" => format!("(at: {joint:?}, share: 0.5)"),
            "stretch" => format!("(start: {control:?}, end: {other:?}, driven: \"@joint #{b}\")"),
            "spring" => format!("(nodes: {joint:?}, frequency: 3.0)"),
            "driven_key" => format!(
                "(driver: {control:?}, driver_channel: RotateX, keys: [(0.0, 0.0), (1.0, {number:?})], \
                 output: {joint:?}, output_channel: RotateY)"
            ),
            "expression" => format!(
                "(text: \"x * {number:?}\", inputs: [(name: \"x\", node: {control:?}, channel: TranslateX)], \
                 output: {joint:?}, output_channel: TranslateZ)"
            ),
            "cone_reader" => format!(
                "(source: {joint:?}, towards: (0.0, 1.0, 0.0), outer: 60.0, output: {control:?}, output_channel: RotateY)"
            ),
            "rbf_reader" => format!(
                "(source: {joint:?}, poses: [(attribute: \"{name}\"), (rotate: (0.0, 80.0, {number:?}), channel: RotateX)], \
                 output: {other:?})"
            ),
            "piston" => format!("(first: {control:?}, second: {other:?})"),
            "wheel" => format!("(source: {control:?}, radius: {:?}, output: {joint:?})", number + 0.1),
            "path" => {
                let points = format!("{control} + {other}");
                format!("(node: {joint:?}, points: {points:?}, share: {:?})", number / 5.0)
            }
            "rivet" => {
                let corners = format!("{control} + {other} + @joint #{b}");
                format!("(node: {joint:?}, corners: {corners:?})")
            }
            _ => format!("(control: {control:?}, morph: \"smile\", attribute: \"{name}\")"),
        };
        (module.to_owned(), params)
    }

    fn tag(&mut self, rig: &Rig) -> TagData {
        let (module, params) = self.command(rig);
        let features = Self::tags(rig).into_iter().filter(|(_, tag)| matches!(tag.kind, TagKind::Feature { .. }));
        let features: Vec<Uid> = features.map(|(_, tag)| tag.uid).collect();
        let feature = (!features.is_empty() && self.random.chance(4)).then(|| self.random.pick(&features));
        TagData {
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
            let kind = TagKind::Feature {
                kind: "generic".into(),
                name: "f".into(),
                switch: String::new(),
                choice: String::new(),
            };
            let tag = TagData { uid: self.uid(), enabled: !self.random.chance(3), comment: String::new(), kind };
            let joint = self.joint(&rig);
            rig.apply(&RigEdit::AddTag { joint, tag: Box::new(tag), index: 0 }).unwrap();
        }
        let mut tries = 0;
        while Self::tags(&rig).len() < COMMANDS + 4 && tries < 16 * COMMANDS {
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
            6 => RigEdit::SetTag(bearer, Box::new(TagData { enabled: !tag.enabled, ..tag })),
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
                RigEdit::SetTag(bearer, Box::new(TagData { kind, ..tag }))
            }
        }
    }
}

/// `RIGSMITH_SEEDS` rigs (40 by default), 30 edits each.
#[test]
fn building_what_changed_is_building_from_nothing() {
    let seeds = std::env::var("RIGSMITH_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(40);
    let (mut ran, mut all, mut failing) = (0, 0, 0);
    let mut used: BTreeSet<String> = BTreeSet::new();
    for seed in 0..seeds {
        let mut maker = Maker { random: Random(seed), next: seed << 32 };
        let mut rig = maker.rig();
        let mut builder = started_builder(&rig);
        let report = builder.run_all();
        assert_eq!((report.error, builder.len() >= COMMANDS), (None, true), "seed {seed}");
        used.extend(builder.list().iter().map(|entry| entry.module.to_string()));
        for step in 0..30 {
            let edit = maker.edit(&rig);
            let Ok(undo) = rig.apply(&edit) else { continue };
            builder.touch(&rig, &edit);
            let report = builder.run_all();
            let context = format!("seed {seed}, step {step}: {edit:?}");
            let mut fresh = started_builder(&rig);
            let full = fresh.run_all();
            assert_eq!(report.error, full.error, "{context}");
            assert_eq!(builder.cursor(), fresh.cursor(), "{context}");
            let (ours, theirs) = (builder.built(), fresh.built());
            let differs = ours.nodes.iter().zip(&theirs.nodes).find(|(a, b)| a != b);
            assert!(ours == theirs, "{context}: {differs:#?}");
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
    let modules = modules();
    let unused: Vec<&str> = modules.iter().map(|module| module.name).filter(|name| !used.contains(*name)).collect();
    assert!(ran * 3 < all && failing > 0 && (unused.is_empty() || seeds < 40), "not one rig has {unused:?}");
}

/// 1000 random rigs with `RIGSMITH_SEEDS=1000`; 60 by default.
#[test]
fn rolled_back_and_built_again_is_the_same() {
    let seeds = std::env::var("RIGSMITH_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(60);
    for seed in 0..seeds {
        let mut maker = Maker { random: Random(1_000_000 + seed), next: seed << 32 };
        let rig = maker.rig();
        let mut builder = started_builder(&rig);
        let bare = builder.built();
        builder.run_all();
        let built = builder.built();
        // To some places on the way, and back.
        for _ in 0..4 {
            let place = maker.random.below(builder.len() + 1);
            builder.run_to(place);
            let mut fresh = started_builder(&rig);
            fresh.run_to(place);
            assert_eq!(builder.built(), fresh.built(), "seed {seed}, place {place}");
        }
        builder.roll_back();
        assert_eq!(builder.built(), bare, "seed {seed}");
        assert!(builder.run_all().executed.is_empty(), "nothing has changed");
        assert_eq!(builder.built(), built, "seed {seed}");
    }
}
