//! Time of a frame while somebody works on a mesh of a million triangles.
//!
//! ```text
//! cargo bench --bench viewport --no-default-features [--features draw]
//! ```
//!
//! A scripted session on the bundled character, each triangle cut into 36, in an app with `RigPlugins` and no window:
//! prints the median and the longest time of `App::update` for each thing people do, in milliseconds, and how far the
//! surface lags behind a joint that moves. While loading and posing, background tasks run beside; all other phases wait for
//! them first. Between frames the thread sleeps for the rest of 8 ms, as it would wait for a screen. With the feature `draw`
//! frames that show such a mesh and draw a thousand joints follow.

#[cfg(feature = "draw")]
#[path = "viewport/display.rs"]
mod display;

use std::{
    collections::HashMap,
    time::{Duration, Instant},
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, futures::check_ready},
};
use rigsmith::{
    algo::view::ViewPlane,
    files::{RealDisk, load_template},
    headless::headless_app,
    mesh::{
        model::{Model, Object, Part, Weights},
        obj::{ObjSettings, read_model},
    },
    plugins::{document::JointEntities, stroke::FollowedStroke},
    prelude::*,
    rig::SkinData,
};

/// Parts that each side of a triangle is cut into.
const CUTS: usize = 6;
const MESH: Uid = Uid(99);
const FRAME: Duration = Duration::from_millis(8);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/assets");
    let template = load_template(&RealDisk, format!("{assets}/templates/biped.rig.ron").as_ref())?;
    let obj = std::fs::read(format!("{assets}/models/biped.obj"))?;
    let model = cut(&read_model(obj.as_slice(), "biped", &ObjSettings::default(), &mut |_| None)?);
    println!("{} triangles, {} points", model.parts[0].triangles.len(), model.points.len());
    let skin = near_weights(&template.rig, &model.points);

    let mut app = headless_app(1);
    app.finish();
    app.cleanup();
    let rig = app.world_mut().spawn(template.rig).id();
    let mut session = Session { app, rig, times: Vec::new() };
    println!("{:<44} {:>8} {:>8} {:>8}", "milliseconds a frame", "median", "99 %", "longest");
    session.run(model, skin);
    #[cfg(feature = "draw")]
    display::run();
    Ok(())
}

struct Session {
    app: App,
    rig: Entity,
    times: Vec<Duration>,
}

impl Session {
    fn run(&mut self, model: Model, skin: SkinData) {
        self.load(model);
        for _ in 0..200 {
            self.frame();
        }
        self.report("idle");
        self.point();
        self.edit();
        self.stroke();
        let bind = Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(skin.into()))]);
        self.send(EditRequest::operation(self.rig, bind));
        self.report("bind given weights");
        self.settle();
        self.pose();
        self.many_joints();
        let mesh = self.app.world_mut().query_filtered::<Entity, With<RigMesh>>().single(self.app.world());
        self.times.clear();
        if let Ok(mesh) = mesh {
            self.app.world_mut().despawn(mesh);
        }
        let started = Instant::now();
        self.app.update();
        self.times.push(started.elapsed());
        self.report("close the mesh");
    }

    fn load(&mut self, model: Model) {
        let loading = Instant::now();
        let mut task = AsyncComputeTaskPool::get().spawn(async move { RigMesh::new(MESH, model, Vec::new()) });
        while self.surface().is_none_or(|surface| surface.is_stale()) {
            if !task.is_finished() || self.surface().is_some() {
                self.frame();
            } else if let Some(mesh) = check_ready(&mut task) {
                self.app.world_mut().spawn((mesh, SkinOf(self.rig)));
                self.frame();
            }
        }
        let label = format!("load, {:.0} ms until it is ready", loading.elapsed().as_secs_f64() * 1e3);
        self.report(&label);
    }

    /// Hovering, orbiting, picking, placing.
    fn point(&mut self) {
        let front = self.plane(0.0);
        self.phase("hover", 400, |session, i| session.hover(front, spot(i)));
        self.phase("hover while orbiting", 400, |session, i| session.hover(session.plane(i as f32), spot(i)));
        self.send(HoverRequest { rig: self.rig, what: None });
        self.phase("select by click", 200, |session, i| {
            let what = Pick::Click { plane: front, point: spot(i), reach: 0.01 };
            session.write(PickRequest { rig: session.rig, what, add: false });
        });
        self.phase("place", 100, |session, i| {
            let ray = front.ray(spot(i));
            session.write(PlaceRequest { rig: session.rig, ray, settings: PlaceSettings::default() });
        });
        let undo = EditRequest { rig: self.rig, change: Change::Undo };
        self.phase("undo", 100, |session, _| session.write(undo.clone()));
    }

    fn edit(&mut self) {
        let joint = self.joint("hand_l");
        let place = self.joint_place(joint);
        self.phase("move a joint at rest", 200, |session, i| {
            let to = vec![(joint, place + Vec3::X * (0.001 * i as f32))];
            session.write(EditRequest::operation(session.rig, Operation::Move { to, with_children: true }));
        });
        let to = vec![(joint, place)];
        self.send(EditRequest::operation(self.rig, Operation::Move { to, with_children: true }));
    }

    fn stroke(&mut self) {
        let front = self.plane(0.0);
        let arm: Vec<Vec2> = ["clavicle_l", "upper_arm_l", "forearm_l", "hand_l"]
            .windows(2)
            .flat_map(|ends| {
                let [a, b] = [0, 1].map(|end| self.joint_place(self.joint(ends[end])).truncate());
                (0..100).map(move |i| a.lerp(b, i as f32 / 100.0))
            })
            .collect();
        let Some(surface) = self.surface().and_then(RigSurface::shared) else { return };
        let points = arm.clone();
        let settings = StrokeSettings::default();
        let started = Instant::now();
        let follow = async move { (FollowedStroke::new(surface, &front, &points, settings), started.elapsed()) };
        let mut task = AsyncComputeTaskPool::get().spawn(follow);
        let (stroke, time) = loop {
            self.frame();
            if let Some(found) = check_ready(&mut task) {
                break found;
            }
        };
        self.report(&format!("follow a stroke ({:.1} ms in a task)", time.as_secs_f64() * 1e3));
        let Ok(stroke) = stroke else { return };
        for i in 0..200 {
            let started = Instant::now();
            std::hint::black_box(stroke.chain(ChainChoice::Joints(2 + i % 8)));
            self.times.push(started.elapsed());
        }
        self.report("preview of the stroke: 2 to 9 joints");
        for i in 0..200 {
            let started = Instant::now();
            std::hint::black_box(stroke.chain(ChainChoice::Threshold(0.0005 * i as f32)));
            self.times.push(started.elapsed());
        }
        self.report("preview of the stroke: thresholds");
        let request = StrokeRequest {
            rig: self.rig,
            plane: front,
            points: arm,
            choice: ChainChoice::Joints(3),
            settings,
            chain_only: true,
            reach: 0.0,
            parent: StrokeParent::default(),
            chain: None,
        };
        self.phase("stroke requests", 200, |session, i| {
            if i % 10 == 0 {
                session.write(request.clone());
            }
        });
        let undo = EditRequest { rig: self.rig, change: Change::Undo };
        self.phase("undo", 20, |session, _| session.write(undo.clone()));
    }

    fn pose(&mut self) {
        let (arm, leg) = (self.joint("upper_arm_l"), self.joint("thigh_r"));
        let mut lags = Vec::new();
        let mut asked: Vec<(u64, Instant)> = Vec::new();
        let front = self.plane(0.0);
        for hovering in [false, true] {
            for i in 0..250 {
                for joint in [arm, leg] {
                    self.turn(joint, Quat::from_rotation_z(0.004 * i as f32));
                }
                if hovering {
                    self.hover(front, spot(i));
                }
                let now = Instant::now();
                self.frame();
                if let Some(surface) = self.surface() {
                    asked.push((surface.wanted(), now));
                    let shown = asked.iter().filter(|(number, _)| surface.shows(*number));
                    lags.extend(shown.map(|(_, at)| at.elapsed()));
                    asked.retain(|(number, _)| !surface.shows(*number));
                }
            }
            self.report(if hovering { "pose and hover" } else { "pose: two limbs turn every frame" });
        }
        lags.sort_unstable();
        let at = |part: usize| lags.get(lags.len() * part / 100).map_or(0.0, |lag| lag.as_secs_f64() * 1e3);
        println!("{:<44} {:>8.2} {:>8.2}", "  the surface is behind by", at(50), at(99));
        self.settle();
    }

    /// A rig of a thousand joints, hanging on the same mesh.
    fn many_joints(&mut self) {
        let count = 1000 - self.app.world().get::<Rig>(self.rig).map_or(0, Rig::len);
        let positions: Vec<Vec3> = (0..count).map(|i| Vec3::new(0.0, 0.002 * i as f32, 0.0)).collect();
        let chains = positions.chunks(25);
        let chains: Vec<Vec<Vec3>> = chains.map(<[Vec3]>::to_vec).collect();
        for positions in chains {
            self.send(EditRequest::operation(self.rig, Operation::Chain { positions, parent: None }));
        }
        self.settle();
        self.times.clear();
        self.phase("1000 joints: idle", 100, |_, _| {});
        let thumb = self.joint("thumb_03_l");
        self.phase("1000 joints: rename", 100, |session, i| {
            let names = vec![(thumb, format!("thumb {i}"))];
            session.write(EditRequest::operation(session.rig, Operation::Labels(names)));
        });
        self.edit();
        let front = self.plane(0.0);
        self.phase("1000 joints: hover", 200, |session, i| session.hover(front, spot(i)));
    }

    fn phase(&mut self, name: &str, frames: usize, act: impl Fn(&mut Self, usize)) {
        self.times.clear();
        for i in 0..frames {
            act(self, i);
            self.frame();
        }
        self.report(name);
    }

    fn frame(&mut self) {
        let started = Instant::now();
        self.app.update();
        let time = started.elapsed();
        self.times.push(time);
        std::thread::sleep(FRAME.saturating_sub(time));
    }

    fn report(&mut self, name: &str) {
        self.times.sort_unstable();
        let at = |part: usize| self.times[(self.times.len() - 1) * part / 100].as_secs_f64() * 1e3;
        println!("{name:<44} {:>8.3} {:>8.3} {:>8.3}", at(50), at(99), at(100));
        self.times.clear();
    }

    fn settle(&mut self) {
        while self.surface().is_some_and(RigSurface::is_stale) {
            self.frame();
        }
        self.times.clear();
    }

    fn write<M: Message>(&mut self, message: M) {
        self.app.world_mut().write_message(message);
    }

    fn send<M: Message>(&mut self, message: M) {
        self.times.clear();
        self.write(message);
        self.frame();
    }

    fn hover(&mut self, plane: ViewPlane, point: Vec2) {
        self.write(HoverRequest { rig: self.rig, what: Some((plane, point, 0.01)) });
    }

    fn turn(&mut self, joint: Uid, rotation: Quat) {
        let world = self.app.world_mut();
        let entity = world.get::<JointEntities>(self.rig).and_then(|entities| entities.get(joint));
        if let Some(mut transform) = entity.and_then(|entity| world.get_mut::<Transform>(entity)) {
            transform.rotation = rotation;
        }
    }

    fn surface(&self) -> Option<&RigSurface> {
        self.app.world().get(self.rig)
    }

    fn plane(&self, yaw: f32) -> ViewPlane {
        let bounds = self.surface().map_or([Vec3::ZERO, Vec3::ONE], RigSurface::bounds);
        ViewPlane::orthographic(View::Orbit(yaw, 0.0), bounds)
    }

    fn joint(&self, label: &str) -> Uid {
        self.app.world().get::<Rig>(self.rig).and_then(|rig| rig.find_label(label)).unwrap_or(Uid(0))
    }

    fn joint_place(&self, joint: Uid) -> Vec3 {
        self.app.world().get::<Rig>(self.rig).map_or(Vec3::ZERO, |rig| rig.position(joint))
    }
}

/// Points of a path over the character: mostly on it, sometimes beside it.
fn spot(i: usize) -> Vec2 {
    let t = i as f32 * 0.05;
    Vec2::new(0.3 * t.sin(), 0.9 + 0.75 * (0.37 * t).cos())
}

/// Every triangle in `CUTS` * `CUTS`, neighbours joined.
fn cut(model: &Model) -> Model {
    let mut points = model.points.clone();
    let mut known: HashMap<[(u32, usize); 3], u32> = HashMap::new();
    let mut triangles = Vec::new();
    for corners in model.point_triangles() {
        let mut at = |i: usize, j: usize| {
            let weights = [CUTS - i - j, i, j];
            // A point on an edge is named by its ends, so that both sides of the edge find it.
            let mut name = [0, 1, 2].map(|k| if weights[k] == 0 { (u32::MAX, 0) } else { (corners[k], weights[k]) });
            name.sort_unstable();
            if name[0].1 == CUTS {
                return name[0].0;
            }
            *known.entry(name).or_insert_with(|| {
                let sum = name.iter().filter(|(_, weight)| *weight > 0);
                let sum: Vec3 = sum.map(|(corner, weight)| model.points[*corner as usize] * *weight as f32).sum();
                points.push(sum / CUTS as f32);
                points.len() as u32 - 1
            })
        };
        for i in 0..CUTS {
            for j in 0..CUTS - i {
                triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < CUTS {
                    triangles.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    let vertices = (0..points.len() as u32).collect();
    Model {
        name: model.name.clone(),
        objects: vec![Object { name: "body".into(), ..default() }],
        parts: vec![Part { vertices, triangles, ..default() }],
        points,
        ..default()
    }
}

/// Weights of the four nearest joints.
fn near_weights(rig: &Rig, points: &[Vec3]) -> SkinData {
    let joints = rig.rest_globals();
    let mut weights = Weights::default();
    for point in points {
        let mut near = [(f32::INFINITY, 0); 4];
        for (number, (_, joint)) in joints.iter().enumerate() {
            let squared = joint.translation.distance_squared(*point);
            if squared < near[3].0 {
                near[3] = (squared, number as u32);
                near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            }
        }
        weights.push([(near[0].1, 0.7), (near[1].1, 0.2), (near[2].1, 0.07), (near[3].1, 0.03)]);
    }
    SkinData { joints: joints.into_iter().map(|(uid, _)| uid).collect(), weights, at_rest: true, ..Default::default() }
}
