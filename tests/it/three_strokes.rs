//! A biped from three strokes: spine, arm and leg, drawn from the front by an unsteady hand with symmetry on.
//!
//! Strokes are aimed at the true joints of each body and strayed by a repeatable hand. `RIGSMITH_SEEDS` sets how many
//! hands draw each body (3 without it).

mod parents;

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use rigsmith::{
    algo::{
        stroke::{ChainChoice, StrokeSettings},
        view::{View, ViewPlane},
        weights::WeightSettings,
    },
    files::{RealDisk, load_model},
    headless::Workbench,
    mesh::{ray::Ray, surface::Surface},
    plugins::{
        document::{Selection, Symmetry},
        stroke::{ParentReason, StrokeDone, StrokeParent, StrokeRequest, nearest_parent, stroke_parent},
    },
    rig::{
        Uid,
        operations::{MirrorPlane, Operation},
    },
};

use crate::{bench::wait, prerequisites::test_data, random::Random};

/// A part of a body that has joints of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Limb {
    Middle,
    Clavicle(bool),
    Arm(bool),
    Leg(bool),
}

/// A mesh and where its bones are: positions by the names that both sources below are turned into.
pub struct Body {
    pub name: String,
    path: PathBuf,
    joints: Vec<(String, Vec3)>,
    bones: Vec<(Limb, Vec3, Vec3)>,
    /// True if left and right stand alike.
    symmetric: bool,
}

/// Names in game engines' manner, and where each bone ends.
const BONES: [(&str, &str); 13] = [
    ("pelvis", "spine_01"),
    ("spine_01", "spine_02"),
    ("spine_02", "spine_03"),
    ("spine_03", "neck_01"),
    ("neck_01", "head"),
    ("clavicle", "upperarm"),
    ("upperarm", "lowerarm"),
    ("lowerarm", "hand"),
    ("hand", "middle_01"),
    ("middle_01", "middle_02"),
    ("thigh", "calf"),
    ("calf", "foot"),
    ("foot", "ball"),
];

impl Body {
    fn new(name: &str, path: PathBuf, joints: Vec<(String, Vec3)>) -> Self {
        let mut body = Self { name: name.to_owned(), path, joints, bones: Vec::new(), symmetric: true };
        for (from, to) in BONES {
            for (side, left) in [("_l", true), ("_r", false)] {
                let limb = match from {
                    "clavicle" => Limb::Clavicle(left),
                    "upperarm" | "lowerarm" | "hand" | "middle_01" => Limb::Arm(left),
                    "thigh" | "calf" | "foot" => Limb::Leg(left),
                    _ => Limb::Middle,
                };
                let side = if limb == Limb::Middle { "" } else { side };
                let bone = (limb, body.at(&format!("{from}{side}")), body.at(&format!("{to}{side}")));
                body.bones.push(bone);
            }
        }
        let head = body.at("head");
        let up = head + (head - body.at("neck_01")).length() * 1.5 * Vec3::Y;
        body.bones.push((Limb::Middle, head, up));
        let size = head.y;
        let flip = Vec3::new(-1.0, 1.0, 1.0);
        body.symmetric = ["lowerarm", "hand", "calf", "foot"]
            .iter()
            .all(|joint| body.at(&format!("{joint}_l")).distance(body.at(&format!("{joint}_r")) * flip) < 0.02 * size);
        body
    }

    pub fn at(&self, joint: &str) -> Vec3 {
        self.joints.iter().find(|(name, _)| name == joint).unwrap_or_else(|| panic!("{} has no {joint}", self.name)).1
    }

    fn limb(&self, point: Vec3) -> Limb {
        let distance = |(_, a, b): &(Limb, Vec3, Vec3)| {
            let along = *b - *a;
            let t = ((point - *a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
            point.distance(*a + along * t)
        };
        self.bones.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap().0
    }
}

pub fn bundled() -> Body {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models");
    let text = std::fs::read_to_string(root.join("biped.rig")).unwrap();
    let name = |name: &str| match name {
        "hips" => "pelvis".to_owned(),
        "spine" => "spine_01".into(),
        "spine_1" => "spine_02".into(),
        "chest" => "spine_03".into(),
        "neck" => "neck_01".into(),
        other => other
            .replace("upper_arm", "upperarm")
            .replace("forearm", "lowerarm")
            .replace("shin", "calf")
            .replace("toe", "ball"),
    };
    let joints = text.lines().filter(|line| line.starts_with("joint ")).map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let place = Vec3::from_array([3, 4, 5].map(|i| words[i].parse().unwrap()));
        (name(words[6]), place)
    });
    Body::new("the bundled biped", root.join("biped.obj"), joints.collect())
}

/// Every body of the test data, by name.
pub fn bodies() -> Vec<Body> {
    let Some(data) = test_data() else { return Vec::new() };
    let mut folders: Vec<PathBuf> = std::fs::read_dir(data.join("bodies"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.join("joints.json").exists())
        .collect();
    folders.sort();
    assert!(folders.len() >= 7, "{folders:?}");
    let read = |folder: &PathBuf| {
        let text = std::fs::read_to_string(folder.join("joints.json")).unwrap();
        let all: serde_json::Value = serde_json::from_str(&text).unwrap();
        let joints = all["game_engine"].as_object().unwrap().iter().map(|(name, bone)| {
            (name.clone(), Vec3::from_array([0, 1, 2].map(|i| bone["head"][i].as_f64().unwrap() as f32)))
        });
        Body::new(&folder.file_name().unwrap().to_string_lossy(), folder.join("body.obj"), joints.collect())
    };
    folders.iter().map(read).collect()
}

/// A line as a hand draws it: it starts and ends a little early or late, keeps to one side, wavers and trembles, by at
/// most `stray` together.
pub fn drawn(line: &[Vec2], stray: f32, random: &mut Random) -> Vec<Vec2> {
    let total: f32 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
    let (early, late) = (random.signed() * stray, random.signed() * stray);
    let [shift, waver, tremble] = [0.45, 0.45, 0.1].map(|share| share * stray);
    let shift = shift * random.signed();
    let (swings, phase) = (1.25 + 0.75 * random.signed(), random.signed());
    let count = 70 + (30.0 * random.signed()) as usize;
    (0..count)
        .map(|i| {
            let t = i as f32 / (count - 1) as f32;
            let (at, along) = along(line, early + (total + late - early) * t);
            let side = shift + waver * (std::f32::consts::TAU * (swings * t + phase)).sin() + tremble * random.signed();
            at + along.perp() * side
        })
        .collect()
}

/// The point at a length along a polyline, which goes on straight beyond its ends, and its direction there.
fn along(line: &[Vec2], length: f32) -> (Vec2, Vec2) {
    let mut left = length;
    for (i, w) in line.windows(2).enumerate() {
        let piece = w[0].distance(w[1]);
        let along = (w[1] - w[0]) / piece;
        if left <= piece || i + 2 == line.len() {
            return (w[0] + along * left, along);
        }
        left -= piece;
    }
    (line[0], Vec2::X)
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Camera {
    Orthographic,
    Perspective,
}

/// Drawing of one try: its view, its strokes and its settings.
#[derive(Debug, Clone, Copy)]
struct Sketch {
    camera: Camera,
    /// 0 between the shoulders, 1 the neck, 2 the head.
    spine_to: usize,
    /// True if the arm ends in the hand, not at the wrist.
    to_hand: bool,
    /// Joints of spine, arm and leg, or the default threshold.
    joints: Option<[usize; 3]>,
    seed: u64,
}

pub struct Bench {
    pub bench: Workbench,
    surface: Surface,
    pub bounds: [Vec3; 2],
}

impl Bench {
    pub fn new(body: &Body) -> Self {
        let model = load_model(&RealDisk, &body.path).unwrap();
        let mut bench = Workbench::new(5, &body.name);
        let surface = Surface::build(&model.points, &model.point_triangles());
        bench.open(model, true).unwrap();
        let (low, high) = surface.bounds().unwrap();
        let rig = bench.rig_entity();
        let plane = MirrorPlane::sagittal(high.y - low.y);
        bench.app_mut().world_mut().get_mut::<Symmetry>(rig).unwrap().0 = Some(plane);
        wait(bench.app_mut(), "the surface", App::update, |app| {
            app.world().get::<rigsmith::prelude::RigSurface>(rig).is_some_and(|surface| surface.ready().is_some())
        });
        Self { bench, surface, bounds: [low, high] }
    }

    pub fn height(&self) -> f32 {
        self.bounds[1].y - self.bounds[0].y
    }

    fn plane(&self, camera: Camera) -> ViewPlane {
        let middle = 0.5 * (self.bounds[0] + self.bounds[1]);
        match camera {
            Camera::Orthographic => ViewPlane::orthographic(View::Front, self.bounds),
            Camera::Perspective => ViewPlane::perspective(View::Front, middle + Vec3::Z * 1.6 * self.height(), middle),
        }
    }

    /// Draws the three strokes with nothing clicked in between; the uids that each added, the drawn side's first.
    fn sketch(&mut self, body: &Body, sketch: Sketch) -> [Vec<Uid>; 3] {
        let all: Vec<Uid> = self.bench.rig().walk().map(|joint| joint.data.uid).collect();
        if !all.is_empty() {
            self.bench.operate(Operation::Delete { joints: all, keep_children: false }).unwrap();
        }
        let height = self.height();
        let plane = self.plane(sketch.camera);
        let seen = |p: Vec3| plane.project(p).unwrap();
        let shoulders = body.at("upperarm_l").with_x(0.0);
        let end = match sketch.spine_to {
            0 => shoulders + Vec3::Y * 0.01 * height,
            1 => body.at("neck_01").lerp(body.at("head"), 0.5),
            _ => body.at("head") + Vec3::Y * 0.03 * height,
        };
        let hand = if sketch.to_hand { body.at("hand_l").lerp(body.at("middle_01_l"), 0.5) } else { body.at("hand_l") };
        let lines = [
            vec![body.at("pelvis"), end],
            vec![body.at("upperarm_l"), body.at("lowerarm_l"), hand],
            vec![body.at("thigh_l"), body.at("calf_l"), body.at("foot_l")],
        ];
        let mut random = Random(sketch.seed.wrapping_mul(0x1234_5678_9abc_def1));
        let mut known: Vec<Uid> = Vec::new();
        let strays = [0.02, 0.015, 0.015];
        [0, 1, 2].map(|number| {
            let line: Vec<Vec2> = lines[number].iter().map(|p| seen(*p)).collect();
            let choice = match sketch.joints {
                Some(counts) => ChainChoice::Joints(counts[number]),
                None => ChainChoice::Threshold(0.02 * (self.bounds[1] - self.bounds[0]).max_element()),
            };
            self.stroke(plane, drawn(&line, strays[number] * height, &mut random), choice);
            let added: Vec<Uid> =
                self.bench.rig().walk().map(|joint| joint.data.uid).filter(|uid| !known.contains(uid)).collect();
            known.extend(&added);
            added
        })
    }

    /// Draws a stroke that becomes a chain.
    pub fn stroke(&mut self, plane: ViewPlane, points: Vec<Vec2>, choice: ChainChoice) {
        let (rig, reach) = (self.bench.rig_entity(), 0.005 * self.height());
        let app = self.bench.app_mut();
        app.world_mut().write_message(StrokeRequest {
            rig,
            plane,
            points,
            choice,
            settings: StrokeSettings::default(),
            chain_only: true,
            reach,
            parent: StrokeParent::Natural,
            chain: None,
        });
        while app.world_mut().resource_mut::<Messages<StrokeDone>>().drain().count() == 0 {
            app.update();
        }
    }

    fn inside(&self, point: Vec3) -> bool {
        let mut hits = Vec::new();
        let directions = [Vec3::new(0.31, 0.91, 0.27), Vec3::new(-0.5, 0.2, 0.84), Vec3::new(0.1, -0.6, -0.79)];
        let odd = directions.iter().filter(|direction| {
            self.surface.hits(&Ray { origin: point, direction: direction.normalize() }, &mut hits);
            hits.len() % 2 == 1
        });
        odd.count() >= 2
    }

    /// Faults of the biped that was drawn.
    fn faults(&self, body: &Body, sketch: Sketch, [spine, arm, leg]: &[Vec<Uid>; 3]) -> Vec<String> {
        let rig = self.bench.rig();
        let mut faults = Vec::new();
        let mut fault = |what: String| faults.push(what);
        let plane = MirrorPlane::sagittal(self.height());
        let joint = |uid: Uid| rig.joint(uid).unwrap();
        let chain = |limb: &[Uid], left: bool| -> Vec<Uid> {
            limb.iter().copied().filter(|uid| (rig.position(*uid).x > 0.0) == left).collect()
        };
        if rig.roots().len() != 1 || rig.roots().first() != spine.first() {
            fault(format!("{} roots", rig.roots().len()));
        }
        for uid in spine {
            if joint(*uid).data.mirror.is_some() || plane.distance(rig.position(*uid)).abs() > 1e-6 {
                fault(format!("spine joint at {:.3}", rig.position(*uid)));
            }
        }
        if let Some([count, ..]) = sketch.joints
            && spine.len() != count
        {
            fault(format!("{} spine joints", spine.len()));
        }
        for (what, limb, number) in [("arm", arm, 1), ("leg", leg, 2)] {
            let sides = [chain(limb, true), chain(limb, false)];
            if sides[0].is_empty() || sides[0].len() != sides[1].len() {
                fault(format!("{what}: {} joints left, {} right", sides[0].len(), sides[1].len()));
                continue;
            }
            if sketch.joints.is_some_and(|counts| counts[number] != sides[0].len()) {
                fault(format!("{what}: {} joints", sides[0].len()));
            }
            for (a, b) in sides[0].iter().zip(&sides[1]) {
                let apart = rig.position(*b).distance(plane.mirrored(rig.position(*a)));
                if joint(*a).data.mirror != Some(*b) || joint(*b).data.mirror != Some(*a) || apart > 1e-5 {
                    fault(format!("{what}: the pair at {:.3} is {apart:.6} apart", rig.position(*a)));
                }
            }
            for side in &sides {
                for w in side.windows(2) {
                    if joint(w[1]).parent != Some(w[0]) {
                        fault(format!("{what}: no chain"));
                    }
                }
            }
            let parent = joint(sides[0][0]).parent;
            let expected = if what == "leg" {
                parent == spine.first().copied()
            } else {
                parent.is_some_and(|parent| spine[spine.len() / 2 - 1..].contains(&parent))
            };
            if !expected || joint(sides[1][0]).parent != parent {
                fault(format!(
                    "{what}: hangs on {:?} of {spine:?}",
                    parent.and_then(|p| spine.iter().position(|s| *s == p))
                ));
            }
        }
        for (limb, joints, ok) in [
            ("spine", spine, vec![Limb::Middle]),
            ("arm", arm, vec![Limb::Arm(true), Limb::Arm(false)]),
            ("leg", leg, vec![Limb::Leg(true), Limb::Leg(false)]),
        ] {
            for uid in joints {
                let place = rig.position(*uid);
                if !body.symmetric && place.x < 0.0 {
                    continue;
                }
                let left = place.x > 0.0;
                let found = body.limb(place);
                let own = match found {
                    Limb::Middle => limb == "spine",
                    // Clavicles begin in the middle; a shoulder may lie on their outer half.
                    Limb::Clavicle(side) => {
                        limb == "spine" && place.x == 0.0
                            || limb == "arm" && side == left && place.x.abs() > 0.5 * body.at("upperarm_l").x.abs()
                    }
                    Limb::Arm(side) | Limb::Leg(side) => ok.contains(&found) && side == left,
                };
                if !own {
                    fault(format!("{limb}: joint at {place:.3} lies in {found:?}"));
                }
                if !self.inside(place) {
                    fault(format!("{limb}: joint at {place:.3} is outside"));
                }
            }
        }
        let start = arm.first().map(|uid| rig.position(*uid));
        if let Some(start) = start
            && start.distance(body.at("upperarm_l")) > 0.06 * self.height()
        {
            fault(format!("arm: starts at {start:.3}, not at {:.3}", body.at("upperarm_l")));
        }
        faults
    }
}

/// Number of hands that draw.
pub fn seeds(otherwise: u64) -> u64 {
    std::env::var("RIGSMITH_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(otherwise)
}

fn sketches() -> Vec<Sketch> {
    let mut all = Vec::new();
    let counts = [None, Some([4, 3, 3]), Some([5, 4, 4]), Some([6, 3, 4])];
    for seed in 0..seeds(3) {
        for camera in [Camera::Orthographic, Camera::Perspective] {
            for (number, joints) in counts.into_iter().enumerate() {
                let turn = seed as usize + number;
                let spine_to = turn % 3;
                all.push(Sketch {
                    camera,
                    spine_to,
                    to_hand: turn.is_multiple_of(2),
                    joints,
                    seed: 31 * seed + number as u64,
                });
            }
        }
    }
    all
}

fn check(body: &Body) -> Vec<String> {
    let mut bench = Bench::new(body);
    let mut faults = Vec::new();
    let all = sketches();
    let mut bad = 0;
    for sketch in &all {
        let limbs = bench.sketch(body, *sketch);
        let found = bench.faults(body, *sketch, &limbs);
        bad += usize::from(!found.is_empty());
        faults.extend(found.into_iter().map(|fault| format!("{}, {sketch:?}: {fault}", body.name)));
    }
    println!("{}: {bad} of {} sketches at fault, {} faults", body.name, all.len(), faults.len());
    let report = bench.bench.skin(WeightSettings::default(), Vec::new(), &mut |_| ()).unwrap().weights;
    let covered = report.by_surface + report.by_voxels + report.by_fill + report.by_nearest + report.given;
    if covered != report.points {
        faults.push(format!("{}: {covered} of {} points have weights", body.name, report.points));
    }
    faults
}

/// Fails with all faults that were found.
pub fn assert_no_faults(faults: &[String]) {
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn the_bundled_biped() {
    assert_no_faults(&check(&bundled()));
}

#[test]
fn bodies_of_all_kinds() {
    assert_no_faults(&bodies().iter().flat_map(check).collect::<Vec<_>>());
}
