//! A disk that fails at any one of its operations, in ten ways: what is saved, cleared away and watched meanwhile.

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use rigsmith::{
    files::{
        Disk, Fault, FaultPlan, FaultyDisk, FileWatch, PartFiles, RealDisk, SaveError, SearchPaths, StoreError,
        TemplateWatch, load_template, remove_stale_temps, store_animation, store_model, store_packed_clips, store_rig,
        store_rig_over, store_skin,
    },
    mesh::{gltf::GltfWriteSettings, model::Trs},
    rig::{JointData, Rig, RigEdit, Uid, animation::RigClip},
    solve::packed_clip::{PackedNode, PackedSkeleton},
};
use tempfile::TempDir;

use crate::{
    files_set::{Kind, copy, furnished, names, temps, triangle},
    part_instances::{FINGER, hand},
    skin_file::sample,
};

/// Ways in which an operation fails: once, or from then on.
pub const WAYS: [(Fault, bool); 10] = [
    (Fault::NoSpace, false),
    (Fault::NoSpace, true),
    (Fault::Io, false),
    (Fault::Io, true),
    (Fault::NoAccess, false),
    (Fault::NoAccess, true),
    (Fault::Short, false),
    (Fault::Short, true),
    (Fault::Crash, true),
    (Fault::PowerLoss, true),
];

/// Every one of some operations fails in every way.
pub fn plans(operations: usize) -> impl Iterator<Item = FaultPlan> {
    (0..operations).flat_map(|at| WAYS.map(|(fault, lasting)| FaultPlan { at, fault, lasting }))
}

/// True if the disk is as good as before, once the fault is over.
pub fn is_passing(plan: FaultPlan) -> bool {
    !plan.lasting && !plan.fault.is_crash()
}

/// Files that are saved one by one.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Single {
    Template,
    Skeleton,
    /// A template whose text is changed where the rig is another.
    Over,
    /// The same of one with a part.
    OverWithPart,
    /// A template whose text is that of another file, changed.
    Elsewhere,
    Weights,
    Clips,
    Packed,
    Character,
}

/// A comment in the template that people have written.
const COMMENT: &str = "// The palm.";

/// A template that people have written.
fn written(has_part: bool) -> String {
    hand("hero", usize::from(has_part), false, "")
}

fn rig(version: u32) -> Rig {
    let mut rig = Rig::new(Uid(1), "hero");
    let mut joint = JointData { uid: Uid(10), label: Some("hips".into()), ..JointData::default() };
    joint.rest.translation.y = version as f32;
    rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: 0 }).unwrap();
    rig
}

/// The rig of the template that people have written, with another place of its first joint.
fn changed(folder: &Path, name: &str, version: u32) -> Rig {
    let mut rig = load_template(&RealDisk, &folder.join(name)).unwrap().rig;
    let palm = rig.find_label("palm").unwrap();
    let mut rest = rig.joint(palm).unwrap().data.rest;
    rest.translation.y = version as f32;
    rig.apply(&RigEdit::SetRest(palm, rest)).unwrap();
    rig
}

fn clip(version: u32) -> RigClip {
    RigClip {
        uid: Uid(0xC11),
        name: format!("clip {version}"),
        frame_rate: 24.0,
        range: [0.0, version as f32],
        looped: false,
        markers: Vec::new(),
        layers: Vec::new(),
        ..RigClip::new(Uid(0xC11), Uid(0), "")
    }
}

fn packed(version: u32) -> PackedSkeleton {
    let name = format!("hips {version}");
    let node = PackedNode { uid: Uid(10), name, parent: None, rest: Trs::IDENTITY };
    PackedSkeleton { nodes: vec![node], clips: Vec::new() }
}

impl Single {
    const ALL: [Self; 9] = [
        Self::Template,
        Self::Skeleton,
        Self::Over,
        Self::OverWithPart,
        Self::Elsewhere,
        Self::Weights,
        Self::Clips,
        Self::Packed,
        Self::Character,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Template | Self::Over | Self::OverWithPart | Self::Elsewhere => "hero.rig.ron",
            Self::Skeleton => "hero.rig",
            Self::Weights => "hero.skin",
            Self::Clips => "hero.anim.ron",
            Self::Packed => "hero.rigclip",
            Self::Character => "hero.glb",
        }
    }

    fn is_over(self) -> bool {
        matches!(self, Self::Over | Self::OverWithPart | Self::Elsewhere)
    }

    /// A folder with the files that are there before the save.
    fn folder(self, existed: bool) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        match self {
            Self::Over | Self::OverWithPart => {
                fs::write(at("finger.rig.ron"), FINGER).unwrap();
                fs::write(at(self.name()), written(self == Self::OverWithPart)).unwrap();
            }
            Self::Elsewhere => fs::write(at("source.rig.ron"), written(false)).unwrap(),
            _ if existed => drop(self.save(&RealDisk, folder.path(), 1).unwrap()),
            _ => {}
        }
        folder
    }

    fn save(self, disk: &dyn Disk, folder: &Path, version: u32) -> Result<Vec<String>, StoreError> {
        let path = folder.join(self.name());
        match self {
            Self::Template | Self::Skeleton => store_rig(disk, &path, rig(version)),
            Self::Over | Self::OverWithPart => {
                let rig = changed(folder, self.name(), version);
                store_rig_over(disk, &path, &rig, &[&path])
            }
            Self::Elsewhere => {
                let rig = changed(folder, "source.rig.ron", version);
                store_rig_over(disk, &path, &rig, &[&path, &folder.join("source.rig.ron")])
            }
            Self::Weights => store_skin(disk, &path, &sample(version == 1)).map(|()| Vec::new()),
            Self::Clips => store_animation(disk, &path, &rig(1), None, &[clip(version)]).map(|()| Vec::new()),
            Self::Packed => store_packed_clips(disk, &path, &packed(version)).map(|()| Vec::new()),
            Self::Character => store_model(disk, &path, &triangle(version), &GltfWriteSettings::default()),
        }
    }
}

#[test]
fn every_kind_of_file_is_the_old_or_the_finished_one() {
    for single in Single::ALL {
        let both = [true, false];
        let cases = match single {
            Single::Over | Single::OverWithPart => &both[..1],
            Single::Elsewhere => &both[1..],
            _ => &both[..],
        };
        for existed in cases {
            check_single(single, *existed);
        }
    }
}

fn check_single(single: Single, existed: bool) {
    let dry = single.folder(existed);
    let counted = FaultyDisk::new(RealDisk, None);
    let before = fs::read(dry.path().join(single.name())).ok();
    assert_eq!(before.is_some(), existed);
    let loss = single.save(&counted, dry.path(), 2).unwrap();
    let after = fs::read(dry.path().join(single.name())).unwrap();
    if single.is_over() {
        assert!(String::from_utf8_lossy(&after).contains(COMMENT), "{single:?} keeps comments");
    }
    let mut rewritten = 0;
    // A short write or read brings one more of them.
    for plan in plans(counted.operations() + 1) {
        let folder = single.folder(existed);
        let path = folder.path().join(single.name());
        let disk = FaultyDisk::new(RealDisk, Some(plan));
        let result = single.save(&disk, folder.path(), 2);
        let now = fs::read(&path).ok();
        let context = format!("{single:?}, existed {existed}, {plan:?}, {result:?}, {:?}", disk.log());
        match &result {
            Ok(notes) if now.as_ref() == Some(&after) => assert_eq!(*notes, loss, "{context}"),
            // Another text says the same. What people have written is gone only if that is told.
            Ok(notes) => {
                assert!(single.is_over(), "{context}");
                let read = load_template(&RealDisk, &path).unwrap().rig;
                let palm = read.find_label("palm").and_then(|palm| read.joint(palm)).unwrap();
                assert_eq!(palm.data.rest.translation.y, 2.0, "{context}");
                let has_comments = now.is_some_and(|text| String::from_utf8_lossy(&text).contains(COMMENT));
                assert!(has_comments || !notes.is_empty(), "{context}");
                rewritten += usize::from(!has_comments);
            }
            Err(StoreError::Save(SaveError::Unconfirmed { .. })) => assert!(now.as_ref() == Some(&after), "{context}"),
            Err(error) => {
                assert!(now == before, "{context}");
                assert_eq!(error.path(), path, "{context}");
                assert!(error.to_string().contains(single.name()), "{context}");
            }
        }
        assert!(result.is_ok() || (disk.has_failed() && plan.fault != Fault::Short), "{context}");
        if is_passing(plan) {
            assert_eq!(temps(folder.path()), 0, "{context}");
        }
        // What a crash left does not stand in the way of the next save.
        drop(disk);
        single.save(&RealDisk, folder.path(), 2).unwrap_or_else(|error| panic!("{context}: {error}"));
        assert_eq!(temps(folder.path()), 0, "{context}");
    }
    // The text of the file itself is never lost for want of reading it.
    assert!(single != Single::Over || rewritten == 0, "{rewritten}");
    assert!(
        single != Single::Elsewhere || rewritten > 0,
        "a source that cannot be read does not keep people from saving"
    );
}

#[test]
fn what_dead_saves_left_is_cleared_away_whatever_fails_meanwhile() {
    for step in ["hard_link", "rename"] {
        let before = furnished();
        Kind::Gltf.save(&RealDisk, before.path(), 1).unwrap();
        let dry = copy(before.path());
        let counted = FaultyDisk::new(RealDisk, None);
        Kind::Gltf.save(&counted, dry.path(), 2).unwrap();
        let at = counted.log().iter().rposition(|name| *name == step).unwrap();
        // The last companion is in place, or all is ready but for the main file.
        let left = copy(before.path());
        let plan = FaultPlan { at: at + usize::from(step == "hard_link"), fault: Fault::Crash, lasting: true };
        Kind::Gltf.save(&FaultyDisk::new(RealDisk, Some(plan)), left.path(), 2).unwrap_err();
        let (clean, dirty) = (names(before.path()), names(left.path()));
        assert!(dirty.len() > clean.len(), "{dirty:?}");
        let dry = copy(left.path());
        let counted = FaultyDisk::new(RealDisk, None);
        assert!(remove_stale_temps(&counted, dry.path()).unwrap() > 0);
        assert_eq!(names(dry.path()), clean, "{:?}", counted.log());
        for plan in plans(counted.operations() + 1) {
            let folder = copy(left.path());
            let disk = FaultyDisk::new(RealDisk, Some(plan));
            let result = remove_stale_temps(&disk, folder.path());
            let context = format!("{step}, {plan:?}, {result:?}, {:?}", disk.log());
            assert_eq!(Kind::Gltf.load(folder.path()), Ok(1), "{context}");
            let now = names(folder.path());
            assert!(clean.is_subset(&now) && now.is_subset(&dirty), "{now:?}, {context}");
            remove_stale_temps(&RealDisk, folder.path()).unwrap();
            assert_eq!(names(folder.path()), clean, "{context}");
        }
    }
}

/// Time between two looks, so long that every look reads the file.
const PAUSE: Duration = Duration::from_millis(600);
/// Looks between two saves: enough for a content to be given out, and for once more after a fault.
const PHASE: u32 = 6;

#[test]
fn a_watched_file_is_given_out_once_and_whole_whatever_fails_meanwhile() {
    let content = |letter: u8| vec![letter; 10_000 + usize::from(letter)];
    // All that is given out on a disk, with the number of operations up to the last phase.
    let watched = |disk: &FaultyDisk| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, content(b'a')).unwrap();
        let mut watch = FileWatch::new(&path, 1 << 20);
        watch.know(content(b'a'));
        let (start, mut given, mut operations) = (Instant::now(), Vec::new(), 0);
        for look in 0..5 * PHASE {
            // Saved in two pieces, and in one.
            if look == PHASE {
                fs::write(&path, &content(b'b')[..5_000]).unwrap();
            } else if look == PHASE + 1 {
                fs::write(&path, content(b'b')).unwrap();
            } else if look == 3 * PHASE {
                fs::write(&path, content(b'c')).unwrap();
            } else if look == 4 * PHASE {
                operations = disk.operations();
            }
            given.extend(watch.look_at(disk, start + PAUSE * look).map(<[u8]>::to_vec));
        }
        (given, operations)
    };
    let counted = FaultyDisk::new(RealDisk, None);
    let (all, operations) = watched(&counted);
    assert!(all == [content(b'b'), content(b'c')], "{}", all.len());
    for plan in plans(operations) {
        let (given, _) = watched(&FaultyDisk::new(RealDisk, Some(plan)));
        assert!(all.starts_with(&given), "{plan:?}: {} contents", given.len());
        assert!(!is_passing(plan) || given.len() == all.len(), "{plan:?}: {} contents", given.len());
    }
}

/// Puts a template with a part into a folder. The part has the name of one that comes with Rigsmith.
fn put(folder: &Path, own: &str, part: &str) -> PathBuf {
    let path = folder.join("hand.rig.ron");
    fs::create_dir_all(folder.join("parts")).unwrap();
    fs::write(folder.join(PART), part).unwrap();
    fs::write(&path, own).unwrap();
    path
}

const PART: &str = "parts/tail.rig.ron";

/// The versions of a template's own text and of its part that are saved one after the other.
fn versions() -> [(String, String); 3] {
    let own = |y: &str| hand("hand", 1, false, "").replace("finger.rig.ron", PART).replace("(0.5, 1, 0)", y);
    let part = |length: &str| FINGER.replace("0.04", length);
    [(own("(0.5, 1, 0)"), part("0.04")), (own("(0.5, 1.25, 0)"), part("0.04")), (own("(0.5, 1.25, 0)"), part("0.0625"))]
}

#[test]
fn a_watched_template_is_never_built_of_anything_else_whatever_fails_meanwhile() {
    let versions = versions();
    let whole = versions.each_ref().map(|(own, part)| {
        let folder = tempfile::tempdir().unwrap();
        let path = put(folder.path(), own, part);
        let mut files = PartFiles::new(&RealDisk).with_site(SearchPaths::default());
        files.complete(&path, own.as_bytes()).unwrap().rig
    });
    // All that is read on a disk, with the number of operations up to the last phase.
    let watched = |disk: &FaultyDisk| {
        let folder = tempfile::tempdir().unwrap();
        let path = put(folder.path(), &versions[0].0, &versions[0].1);
        let mut watch = TemplateWatch::new(&path);
        let (start, mut read, mut operations) = (Instant::now(), Vec::new(), 0);
        for look in 0..4 * PHASE {
            if look % PHASE == 0 {
                match (look / PHASE) as usize {
                    3 => operations = disk.operations(),
                    phase => drop(put(folder.path(), &versions[phase].0, &versions[phase].1)),
                }
            }
            let Some(content) = watch.look_at(disk, start + PAUSE * look) else { continue };
            let mut files = PartFiles::new(disk).with_site(SearchPaths::default());
            let template = files.complete(&path, &content);
            watch.follow(files.asked, template.is_ok());
            read.extend(template.map(|template| template.rig));
        }
        (read, operations)
    };
    let counted = FaultyDisk::new(RealDisk, None);
    let (all, operations) = watched(&counted);
    assert!(all == whole, "{} of {}", all.len(), whole.len());
    for plan in plans(operations) {
        let (read, _) = watched(&FaultyDisk::new(RealDisk, Some(plan)));
        let places: Vec<_> = read.iter().map(|rig| whole.iter().position(|known| known == rig)).collect();
        assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{plan:?}: {places:?}");
        assert!(!is_passing(plan) || places.last() == Some(&Some(2)), "{plan:?}: {places:?}");
    }
}

#[test]
fn a_part_that_cannot_be_read_is_told_and_no_other_one_is_taken_for_it() {
    let [(own, part), ..] = versions();
    let (folder, site) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = put(folder.path(), &own, &part);
    put(site.path(), &own, &part.replace("bone", "foreign"));
    let complete = |disk: &dyn Disk| {
        let site = SearchPaths { folders: vec![site.path().to_owned()] };
        PartFiles::new(disk).with_site(site).complete(&path, own.as_bytes())
    };
    let counted = FaultyDisk::new(RealDisk, None);
    let right = complete(&counted).unwrap().rig;
    for plan in plans(counted.operations()) {
        let disk = FaultyDisk::new(RealDisk, Some(plan));
        match complete(&disk) {
            Ok(template) => assert_eq!(template.rig, right, "{plan:?}"),
            Err(error) => {
                assert!(error.message.contains("tail.rig.ron"), "{plan:?}: {error}");
                assert_ne!(plan.fault, Fault::Short, "{error}");
            }
        }
    }
    // One that is not there is looked for elsewhere.
    fs::remove_file(folder.path().join(PART)).unwrap();
    assert!(complete(&RealDisk).unwrap().rig.find_label("f0_foreign_1").is_some());
}
