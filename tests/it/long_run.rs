//! Long runs: thousands of deeds in a head-less app with undo, reload, build, pose and play; entities are accounted for, and neither
//! the document nor what is kept beside it grows with the number of deeds.
//!
//! `RIGSMITH_DEEDS` is the number of deeds, 10,000 unless it is set. A number that is set is checked for memory, too, so such a
//! run has the process for itself.

use std::{
    collections::{BTreeMap, HashSet},
    fs,
    sync::Arc,
    time::Duration,
};

use bevy::{ecs::system::RunSystemOnce, prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    headless::headless_app,
    instance::{AcceptUpdate, RigFailed, RigInstancePlugin, RigSource, RigTemplates, TemplateFiles, UpdateOffer},
    mesh::model::Weights,
    modules,
    plugins::{
        animation::ClipPlayer,
        commands::{BuildResult, BuildStep, BuiltEntities, Processor},
        document::{Change, Selection},
        history::{MOST_STEPS, MOST_WEIGHT_BYTES, RigHistory},
        schema::{ConstraintKind, ParkedNode},
        surface::{RigMesh, SkinOf},
    },
    processor::Builder,
    rig::{
        GroupData, JointData, PoseOffset, RestTransform, Rig, RigEdit, SkinData, TagData, TagKind, Uid, UidSource,
        animation::{Key, Property, RigClip, TrackTarget},
        operations::Operation,
        update::Take,
    },
    test_app::strict_app,
};

use crate::{
    bench::RigBench,
    random::Random,
    whole::{edits::bytes, skin::cube},
};

/// Deeds without `RIGSMITH_DEEDS`.
const DEEDS: usize = 10_000;
/// Most joints of the rig.
const JOINTS: usize = 24;
/// Uid of the clip, of its layer, and of the mesh.
const CLIP: Uid = Uid(0xC1);
const LAYER: Uid = Uid(0xC2);
const MESH: Uid = Uid(0x50);

/// The template, in one of many versions.
fn template(version: usize) -> String {
    let up = 1.0 + 0.01 * (version % 50) as f32;
    format!(
        "(format: 2, name: \"long\", joints: [\n\
         (label: \"root\", translation: (0, {up:?}, 0), tags: [control(follow: false, creation: (name: \"main\")), \
         attribute(node: \"@command control/main role:control\", name: \"amount\", default: 0.5)]),\n\
         (label: \"a\", parent: \"root\", translation: (0, 0.3, 0), tags: [control(at: \"@hierarchy this\", \
         creation: (name: \"fk\"))]),\n\
         (label: \"b\", parent: \"a\", translation: (0, 0.3, 0.01), tags: [null]),\n\
         (label: \"c\", parent: \"b\", translation: (0, 0.3, 0))])\n"
    )
}

#[derive(Resource, Default)]
struct Failures(Vec<String>);

struct LongRun {
    base: RigBench,
    /// Entities that were there before the rig.
    before: HashSet<Entity>,
    version: usize,
    next: u64,
    _folder: tempfile::TempDir,
}

/// Counts at a moment.
#[derive(Debug, Clone, Copy)]
struct Counts {
    entities: usize,
    parked: usize,
    archetypes: usize,
    document: usize,
    steps: usize,
    kept: usize,
    /// Anonymous memory in KiB; 0 where the system does not tell it.
    memory: usize,
}

fn anonymous_memory() -> usize {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"));
    line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or_default()
}

impl LongRun {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("long.rig.ron");
        fs::write(&file, template(0)).unwrap();
        let mut app = headless_app(1);
        app.add_plugins(RigInstancePlugin::default())
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(20)))
            .init_resource::<Failures>()
            .add_observer(|failed: On<RigFailed>, mut told: ResMut<Failures>| told.0.push(failed.error.to_string()));
        let mut app = strict_app(app);
        app.update();
        let before = app.world().iter_entities().map(|entity| entity.id()).collect();
        let handle = app.world_mut().run_system_once(move |files: TemplateFiles| files.open(file.clone())).unwrap();
        let base = RigBench::with(app, RigSource::live(handle));
        let mut run = Self { base, before, version: 0, next: 0, _folder: folder };
        run.until("the rig", |world, rig| world.get::<BuildResult>(rig).is_some());
        let mesh = RigMesh::new(MESH, cube(), Vec::new());
        run.base.app.world_mut().spawn((mesh, SkinOf(run.base.rig)));
        let clip = RigClip { range: [0.0, 2.0], looped: true, ..RigClip::new(CLIP, LAYER, "wave") };
        run.edit(vec![RigEdit::AddClip(Box::new(clip), 0)]);
        run.base.frames(4);
        run
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&World, Entity) -> bool) {
        self.base.wait(what, |bench| is_so(bench.app.world(), bench.rig));
    }

    fn edit(&mut self, edits: Vec<RigEdit>) {
        self.base.change(Change::Do(Operation::Named { name: "deed", edits }));
    }

    fn uid(&mut self) -> Uid {
        self.next += 1;
        Uid(0xADD0_0000_0000 + self.next)
    }

    /// Joints of the template first, then those that were added.
    fn joints(&self) -> (Vec<Uid>, Vec<Uid>) {
        let is_added = |joint: &Uid| joint.0 >> 32 == 0xADD0;
        self.base.rig().walk().map(|joint| joint.data.uid).partition(|joint| !is_added(joint))
    }

    /// Controls of the template's own joints. Offsets of nodes that are gone stay in a document, so that those come back posed.
    fn controls(&self) -> Vec<Uid> {
        let (own, _) = self.joints();
        let built = &self.base.get::<BuildResult>(self.base.rig).unwrap().0;
        let is_own = |origin: &rigsmith::rig::Origin| own.contains(&origin.subject);
        let controls = built.nodes.iter().filter(|node| node.control.is_some());
        controls.filter(|node| node.origin.as_deref().is_some_and(is_own)).map(|node| node.uid).collect()
    }

    fn deed(&mut self, random: &mut Random) {
        let (own, added) = self.joints();
        let all: Vec<Uid> = own.iter().chain(&added).copied().collect();
        let (joint, number) = (random.pick(&all), random.below(1000));
        let rig = self.base.rig;
        match random.below(40) {
            0..=6 => {
                if let Some(control) = random.of(&self.controls()) {
                    let offset = PoseOffset { rotation: random.rotation(), ..PoseOffset::IDENTITY };
                    self.base.change(Change::Do(Operation::Pose(vec![(control, offset)])));
                }
            }
            7 | 8 => {
                let built = self.base.get::<BuiltEntities>(rig).unwrap();
                let entity = random.of(&self.controls()).and_then(|control| built.get(control));
                if let Some(mut transform) =
                    entity.and_then(|entity| self.base.app.world_mut().get_mut::<Transform>(entity))
                {
                    transform.translation += 0.01 * random.point();
                }
                self.base.app.update();
            }
            9 | 10 => self.edit(vec![RigEdit::SetLabel(joint, Some(format!("l{number}")))]),
            11..=13 if all.len() < JOINTS => {
                let rest = RestTransform::from_translation(random.point() * 0.2);
                let joint = JointData { uid: self.uid(), rest, ..JointData::default() };
                let parent = Some(random.pick(&all));
                self.edit(vec![RigEdit::AddJoint { joint: Box::new(joint), parent, index: number % 3 }]);
            }
            14 | 15 => {
                if let Some(gone) = random.of(&added) {
                    self.base.change(Change::Do(Operation::Delete { joints: vec![gone], keep_children: true }));
                }
            }
            16..=19 => self.base.change(Change::Undo),
            20 | 21 => self.base.change(Change::Redo),
            22 => {
                let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
                let tag = TagData { uid: self.uid(), enabled: true, comment: String::new(), kind };
                self.edit(vec![RigEdit::AddTag { joint, tag: Box::new(tag), index: 0 }]);
            }
            23 | 24 => {
                let tags = self.base.rig().walk().flat_map(|joint| {
                    let uid = joint.data.uid;
                    joint.data.tags.iter().map(move |tag| (uid, tag.uid))
                });
                let tags: Vec<(Uid, Uid)> = tags.filter(|(_, tag)| tag.0 >> 32 == 0xADD0).collect();
                if let Some((joint, tag)) = random.of(&tags) {
                    self.edit(vec![RigEdit::RemoveTag(joint, tag)]);
                }
            }
            25..=27 => {
                let step = [BuildStep::RollBack, BuildStep::Back, BuildStep::Restart, BuildStep::To(2)];
                for step in [step[number % 4].clone(), BuildStep::All] {
                    self.base.step(step);
                }
            }
            28 | 29 => {
                let player = self.base.rig().clip(CLIP).map(ClipPlayer::new);
                let mut entity = self.base.app.world_mut().entity_mut(rig);
                match player.filter(|_| number.is_multiple_of(2)) {
                    Some(player) => entity.insert(player),
                    None => entity.remove::<ClipPlayer>(),
                };
                self.base.frames(2);
            }
            30 | 31 => {
                let target = TrackTarget { node: random.pick(&own), property: Property::Rotation };
                let key = Key::rotation((number % 16) as f32 / 8.0, random.rotation());
                let clip = self.base.rig().clip(CLIP);
                let track = clip.and_then(|clip| clip.layers[0].tracks.get(&target).cloned());
                let removed: Vec<f32> = track
                    .iter()
                    .flat_map(|track| track.keys.iter().map(|key| key.time).filter(|time| *time == key.time))
                    .collect();
                self.edit(vec![RigEdit::SetKeys { clip: CLIP, layer: LAYER, target, removed, inserted: vec![key] }]);
            }
            32 => {
                if let Some(control) = self.controls().first().copied() {
                    let set = RigEdit::SetAttributeValue(control, "amount".into(), Some(random.unit()));
                    self.edit(vec![set]);
                }
            }
            33 => {
                let mut weights = Weights::default();
                (0..8).for_each(|_| weights.push([(number as u32 % own.len() as u32, 1.0)]));
                let skin = SkinData { joints: own, weights, at_rest: true, ..SkinData::default() };
                self.edit(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]);
            }
            34 => {
                let groups: Vec<Uid> = self.base.rig().groups().iter().map(|group| group.uid).collect();
                let edits = match groups.len() < 4 {
                    true => {
                        let group = GroupData { uid: self.uid(), name: "g".into(), color: [0.5; 3], enabled: true };
                        vec![RigEdit::AddLocalGroup(group.clone(), 0), RigEdit::SetGroup(joint, Some(group.uid))]
                    }
                    false => {
                        let group = groups[0];
                        let of_it = self.base.rig().walk().filter(|joint| joint.data.group == Some(group));
                        let out = of_it.map(|joint| RigEdit::SetGroup(joint.data.uid, None));
                        out.chain([RigEdit::RemoveLocalGroup(group)]).collect()
                    }
                };
                self.edit(edits);
            }
            35 => {
                self.base.app.world_mut().get_mut::<Selection>(rig).unwrap().0 = vec![joint];
                self.base.app.update();
            }
            36 if number < 200 => self.reload(),
            _ => self.base.app.update(),
        }
    }

    /// Takes over another version of the template.
    fn reload(&mut self) {
        self.version += 1;
        let content = template(self.version).into_bytes();
        let template = self.base.get::<RigSource>(self.base.rig).unwrap().template.clone();
        let before = self.base.app.world().resource::<RigTemplates>().built(&template).cloned();
        let offered = template.clone();
        self.base
            .app
            .world_mut()
            .run_system_once(move |files: TemplateFiles| files.offer(&offered, content.clone()))
            .unwrap();
        self.until("the template", |world, _| {
            let now = world.resource::<RigTemplates>().built(&template);
            !world.resource::<Failures>().0.is_empty()
                || now.zip(before.as_ref()).is_some_and(|(now, before)| !Arc::ptr_eq(now, before))
        });
        self.base.frames(4);
        if self.base.get::<UpdateOffer>(self.base.rig).is_some() {
            self.base.app.world_mut().write_message(AcceptUpdate { rig: self.base.rig, choices: Take::Theirs.into() });
            self.base.frames(4);
        }
        assert_eq!(self.base.app.world().resource::<Failures>().0, Vec::<String>::new());
    }

    /// Fails unless every entity is a part of the rig, the rig itself or its mesh, or was there before.
    fn counts(&mut self) -> Counts {
        self.base.frames(3);
        let world = self.base.app.world();
        let mut strangers: BTreeMap<String, usize> = BTreeMap::new();
        let (mut entities, mut parked, mut constraints) = (0, 0, 0);
        for entity in world.iter_entities().filter(|entity| !self.before.contains(&entity.id())) {
            entities += 1;
            parked += usize::from(entity.contains::<ParkedNode>());
            constraints += usize::from(entity.contains::<ConstraintKind>());
            if entity.contains::<Uid>() || entity.contains::<ConstraintKind>() || entity.contains::<RigMesh>() {
                continue;
            }
            if entity.id() != self.base.rig {
                let names = entity.archetype().components().iter();
                let names = names.filter_map(|id| Some(world.components().get_name(*id)?.to_string()));
                *strangers.entry(names.collect::<Vec<_>>().join(", ")).or_default() += 1;
            }
        }
        assert!(strangers.is_empty(), "entities that are no part of the rig: {strangers:?}");
        let rig = self.base.rig();
        let tags: usize = rig.walk().map(|joint| joint.data.tags.len()).sum();
        let built = &world.get::<BuildResult>(self.base.rig).unwrap().0;
        let made = built.nodes.iter().filter(|node| node.origin.is_some()).count();
        assert_eq!(constraints, built.constraints.len(), "constraints without a build");
        let known = 2 + rig.len() + tags + rig.groups().len() + made + constraints + parked;
        assert_eq!(entities, known, "entities that nothing accounts for");
        Counts {
            entities,
            parked,
            archetypes: world.archetypes().len(),
            document: bytes(rig).len(),
            steps: world.get::<RigHistory>(self.base.rig).unwrap().steps().0.len(),
            kept: world.get::<Processor>(self.base.rig).unwrap().builder().kept(),
            memory: anonymous_memory(),
        }
    }
}

#[test]
fn thousands_of_deeds_leave_nothing_behind() {
    let asked: Option<usize> =
        std::env::var("RIGSMITH_DEEDS").ok().map(|text| text.parse().expect("a number of deeds"));
    let deeds = asked.unwrap_or(DEEDS);
    let mut run = LongRun::new();
    let mut random = Random(2027);
    let mut counted: Vec<(usize, Counts)> = Vec::new();
    let mut next = 1000;
    for deed in 1..=deeds {
        run.deed(&mut random);
        if deed == next || deed == deeds {
            let counts = run.counts();
            println!("{deed} deeds: {counts:?}");
            counted.push((deed, counts));
            next *= 10;
        }
    }
    let (_, first) = counted[0];
    let (_, last) = counted[counted.len() - 1];
    // Joints, groups and keys are bounded by the deeds; tags wander by chance, and so the sizes differ by a factor, not by the
    // number of deeds.
    assert!(last.document <= 4 * first.document.max(16 << 10), "the document grows: {counted:?}");
    assert!(last.entities - last.parked <= 4 * (first.entities - first.parked).max(200), "entities grow: {counted:?}");
    assert!(last.archetypes <= 2 * first.archetypes, "archetypes grow: {counted:?}");
    assert!(last.steps <= MOST_STEPS + MOST_STEPS / 10, "the history grows: {counted:?}");
    assert!(last.kept <= 3 * 8192, "the builder grows: {counted:?}");
    // A parked node waits for a joint or command that the history can bring back.
    assert!(last.parked <= 4 * MOST_STEPS, "parked nodes grow: {counted:?}");
    if let Some((_, early)) = counted.iter().find(|(deed, _)| *deed >= 10_000).filter(|_| asked.is_some()) {
        let most = early.memory + early.memory / 10;
        assert!(last.memory <= most, "memory grows by more than a tenth: {counted:?}");
    }
    let bare = Builder::build(run.base.rig(), &Arc::new(modules::all()));
    assert_eq!(bare.ok().as_ref(), run.base.get::<BuildResult>(run.base.rig).map(|built| &*built.0));

    // Undone as far as it goes, and closed, it leaves the entities that were there before.
    let steps = run.base.steps();
    for _ in 0..steps {
        run.base.change(Change::Undo);
    }
    assert_eq!(run.base.steps(), 0);
    run.counts();
    let rig = run.base.rig;
    run.base.app.world_mut().entity_mut(rig).despawn();
    run.base.frames(4);
    let world = run.base.app.world();
    let left: Vec<Entity> =
        world.iter_entities().map(|entity| entity.id()).filter(|id| !run.before.contains(id)).collect();
    let names = |entity: &Entity| {
        let entity = world.entity(*entity);
        let components = entity.archetype().components().iter();
        components.filter_map(|id| Some(world.components().get_name(*id)?.to_string())).collect::<Vec<_>>()
    };
    // The mesh is an entity of its own, which its owner removes.
    let left: Vec<_> = left.iter().filter(|entity| world.get::<RigMesh>(**entity).is_none()).map(names).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_history_holds_its_last_steps_and_knows_that_there_were_more() {
    let mut rig = Rig::new(Uid(1), "long");
    let (mut history, mut selection, mut uids) = (RigHistory::default(), Selection::default(), UidSource::seeded(1));
    let joint = JointData { uid: Uid(2), ..JointData::default() };
    rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: 0 }).unwrap();
    let label = |number: usize| Operation::Edits(vec![RigEdit::SetLabel(Uid(2), Some(number.to_string()))]);
    let count = 2 * MOST_STEPS + 17;
    for number in 0..count {
        history.edit(&mut rig, &mut selection, &mut uids, None, &label(number)).unwrap();
        assert!(history.steps_since(None) <= MOST_STEPS + MOST_STEPS / 10);
    }
    let kept = history.steps().1;
    assert!((MOST_STEPS..=MOST_STEPS + MOST_STEPS / 10).contains(&kept), "{kept}");
    assert!(history.discarded() > 0);
    while let Some(undone) = history.undo(&mut rig, &mut selection) {
        undone.unwrap();
    }
    // As far back as the steps go, and not as it was opened.
    assert_eq!(rig.joint(Uid(2)).unwrap().data.label, Some((count - kept - 1).to_string()));
    assert!(history.last().is_some() && history.can_redo());
    for _ in 0..kept {
        history.redo(&mut rig, &mut selection).unwrap().unwrap();
    }
    assert_eq!(rig.joint(Uid(2)).unwrap().data.label, Some((count - 1).to_string()));
}

#[test]
fn a_history_holds_so_many_weights() {
    let mut weights = Weights::default();
    (0..2_000_000).for_each(|_| weights.push([(0, 1.0)]));
    let skins = [0, 1].map(|number| {
        let mut weights = weights.clone();
        weights.values[number] = 0.5;
        Arc::new(SkinData { joints: vec![Uid(2)], weights, at_rest: true, ..SkinData::default() })
    });
    let mut rig = Rig::new(Uid(1), "long");
    let joint = JointData { uid: Uid(2), ..JointData::default() };
    rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: 0 }).unwrap();
    let (mut history, mut selection, mut uids) = (RigHistory::default(), Selection::default(), UidSource::seeded(1));
    let each = RigEdit::SetSkin(MESH, Some(skins[0].clone())).weight_bytes();
    let most = MOST_WEIGHT_BYTES / each;
    for number in 0..most + 10 {
        let edit = RigEdit::SetSkin(MESH, Some(skins[number % 2].clone()));
        history.edit(&mut rig, &mut selection, &mut uids, None, &Operation::Edits(vec![edit])).unwrap();
    }
    assert!(each > 20_000_000 && (most..=most + 1).contains(&history.steps().1), "{} of {most}", history.steps().1);
}

/// A builder that has followed many joints and commands that are gone keeps few of them, and goes on where it stood.
#[test]
fn a_builder_forgets_what_is_gone() {
    let text = template(0);
    let mut rig = rigsmith::rig::template::read_template(text.as_bytes()).unwrap().rig;
    let modules = Arc::new(modules::all());
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    assert_eq!(builder.run_all().error, None);
    let root = rig.find_label("c").unwrap();
    let mut most = 0;
    for number in 0..9000u64 {
        let uid = Uid(0xADD0_0000_0000 + number);
        let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
        let tag = TagData { uid: Uid(0xADD1_0000_0000 + number), enabled: true, comment: String::new(), kind };
        let joint = JointData { uid, tags: vec![tag], ..JointData::default() };
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: Some(root), index: 0 }).unwrap();
        builder.sync(&rig);
        let place = builder.len() - usize::from(number % 5 == 0);
        let report = builder.run_to(place);
        assert_eq!((report.error, report.cursor), (None, place));
        rig.apply(&RigEdit::RemoveJoint(uid)).unwrap();
        builder.sync(&rig);
        builder.run_all();
        most = most.max(builder.kept());
        if number % 500 == 0 {
            let mut fresh = Builder::new(modules.clone());
            fresh.sync(&rig);
            fresh.run_all();
            assert_eq!(builder.built(), fresh.built(), "after {number}");
            assert_eq!(builder.list(), fresh.list());
        }
    }
    // What is gone is dropped in the very look at the document that reaches 8192, so that a few less are seen at most.
    assert!((8192 - 16..8192).contains(&most), "{most} nodes and commands are kept");
    assert_eq!(builder.built(), Builder::build(&rig, &modules).unwrap());
    assert_eq!(builder.run_all().executed, Vec::<Uid>::new(), "nothing has changed");
}
