//! Drawing on a graphics card, or a software one: the rig is seen over the mesh from every angle.
//!
//! `RIGSMITH_PICTURES` names a folder to keep the pictures in, to look at.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::PathBuf,
};

use bevy::{
    asset::RenderAssetUsages,
    camera::RenderTarget,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
    render::{
        render_resource::TextureFormat,
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
};
use rigsmith::{
    mesh::obj::{ObjSettings, read_model},
    plugins::{
        document::HoveredNode,
        drawing::{BACKGROUND, DrawingPlugin, GhostJoint, Ghosts, LabelChoice, RigDrawing},
        viewport::{RigViewport, Sight},
    },
    prelude::*,
    render::bevy_plugins,
    rig::operations::MirrorPlane,
};

use crate::{
    bench::{RigBench, shipped},
    prerequisites::skip,
};

/// Size of the pictures: small, unless somebody wants to look at them.
fn size() -> UVec2 {
    let kept = std::env::var_os("RIGSMITH_PICTURES").is_some();
    if kept { UVec2::new(960, 720) } else { UVec2::new(480, 360) }
}

/// The last picture taken.
#[derive(Resource, Default)]
struct LastPicture(Option<Image>);

struct Studio {
    base: RigBench,
    camera: Entity,
    target: Handle<Image>,
    folder: Option<PathBuf>,
}

impl Studio {
    fn build() -> Self {
        let mut app = App::new();
        app.add_plugins((bevy_plugins(), RigPlugins, DrawingPlugin)).init_resource::<LastPicture>();
        app.insert_resource(ClearColor(BACKGROUND));
        app.finish();
        app.cleanup();
        let world = app.world_mut();
        let rig = world.spawn(shipped("biped")).id();
        let target = Image::new_target_texture(size().x, size().y, TextureFormat::Rgba8UnormSrgb, None);
        let target = world.resource_mut::<Assets<Image>>().add(target);
        let camera = (
            Camera3d::default(),
            RenderTarget::from(target.clone()),
            RigViewport::default(),
            Projection::Perspective(PerspectiveProjection { fov: 0.6, ..default() }),
        );
        let camera = world.spawn(camera).id();
        let light = DirectionalLight { illuminance: 6_000.0, ..default() };
        world.spawn((light, Transform::from_xyz(-2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
        world.insert_resource(bevy::light::GlobalAmbientLight { brightness: 400.0, ..default() });
        let mesh = biped();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let clay =
            StandardMaterial { base_color: Color::srgb(0.62, 0.6, 0.58), perceptual_roughness: 0.9, ..default() };
        let clay = world.resource_mut::<Assets<StandardMaterial>>().add(clay);
        world.spawn((Mesh3d(mesh), MeshMaterial3d(clay)));
        let base = RigBench { app, rig };
        Self { base, camera, target, folder: std::env::var_os("RIGSMITH_PICTURES").map(PathBuf::from) }
    }

    /// Looks at `target` from `eye`; `height` makes the view orthographic and that high.
    fn look(&mut self, eye: Vec3, target: Vec3, height: Option<f32>) {
        let up = if (target - eye).normalize().y.abs() > 0.999 { Vec3::NEG_Z } else { Vec3::Y };
        let focus = eye.distance(target);
        let projection = match height {
            None => Projection::Perspective(PerspectiveProjection { fov: 0.6, ..default() }),
            Some(height) => {
                let scaling_mode = bevy::camera::ScalingMode::FixedVertical { viewport_height: height };
                Projection::Orthographic(OrthographicProjection {
                    scaling_mode,
                    ..OrthographicProjection::default_3d()
                })
            }
        };
        let place = Transform::from_translation(eye).looking_at(target, up);
        self.base.app.world_mut().entity_mut(self.camera).insert((place, projection, RigViewport { focus }));
    }

    /// Renders, and keeps the picture if that was asked for.
    fn take(&mut self, name: &str) -> Image {
        for _ in 0..3 {
            self.base.app.update();
        }
        let world = self.base.app.world_mut();
        world.resource_mut::<LastPicture>().0 = None;
        world.spawn(Screenshot::image(self.target.clone())).observe(
            |shot: On<ScreenshotCaptured>, mut taken: ResMut<LastPicture>| {
                taken.0 = Some(shot.image.clone());
            },
        );
        let what = format!("the picture of {name}");
        self.base.app.update();
        self.base.wait(&what, |base| base.app.world().resource::<LastPicture>().0.is_some());
        let image = self.base.app.world_mut().resource_mut::<LastPicture>().0.take().expect("it is there");
        if let Some(folder) = &self.folder {
            let path = folder.join(format!("{name}.png"));
            image.clone().try_into_dynamic().unwrap().to_rgb8().save(path).unwrap();
        }
        image
    }

    fn set(&mut self, change: impl FnOnce(&mut RigDrawing)) {
        change(&mut self.base.app.world_mut().resource_mut::<RigDrawing>());
    }

    fn uid(&self, label: &str) -> Uid {
        self.base.rig().find_label(label).unwrap_or_else(|| panic!("no {label}"))
    }

    fn position(&self, label: &str) -> Vec3 {
        self.base.rig().position(self.uid(label))
    }

    fn sight(&self) -> Sight {
        let world = self.base.app.world();
        let camera = world.entity(self.camera);
        let (eye, projection) = (camera.get::<GlobalTransform>().unwrap(), camera.get::<Projection>().unwrap());
        Sight::new(eye, projection, camera.get().unwrap(), size().as_vec2(), &GlobalTransform::IDENTITY).unwrap()
    }
}

/// The bundled character as a plain mesh.
fn biped() -> Mesh {
    let bytes = include_bytes!("../../assets/models/biped.obj");
    let model = read_model(&bytes[..], "biped", &ObjSettings::default(), &mut |_| None).unwrap();
    let triangles = model.point_triangles();
    let positions: Vec<[f32; 3]> = model.points.iter().map(|point| point.to_array()).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U32(triangles.into_iter().flatten().collect()))
        .with_computed_smooth_normals()
}

/// A studio, or `None` with the reason printed where there is no graphics card, not even a software one.
fn studio() -> Option<Studio> {
    match catch_unwind(AssertUnwindSafe(Studio::build)) {
        Ok(studio) => Some(studio),
        Err(reason) if std::env::var_os("RIGSMITH_REQUIRE_GPU").is_some_and(|value| value == "1") => {
            std::panic::resume_unwind(reason)
        }
        Err(_) => {
            skip("there is no graphics card, not even a software one", "RIGSMITH_REQUIRE_GPU");
            None
        }
    }
}

/// Pixels in which two pictures differ.
fn changed(a: &Image, b: &Image) -> usize {
    let [a, b] = [a, b].map(|image| image.data.as_ref().unwrap().chunks(4));
    a.zip(b).filter(|(a, b)| a != b).count()
}

fn at(image: &Image, pixel: Vec2) -> [u8; 4] {
    image.get_color_at(pixel.x as u32, pixel.y as u32).unwrap().to_srgba().to_u8_array()
}

#[test]
fn a_rig_is_seen_over_the_mesh_from_every_angle_on_a_gpu() {
    let Some(mut studio) = studio() else { return };
    let middle = Vec3::new(0.0, 0.92, 0.0);
    let views: [(&str, Vec3, Option<f32>); 6] = [
        ("front", Vec3::new(0.0, 1.0, 3.6), None),
        ("back", Vec3::new(-0.8, 1.2, -3.4), None),
        ("angle", Vec3::new(2.2, 1.7, 2.6), None),
        ("side_flat", Vec3::new(4.0, 0.92, 0.0), Some(2.1)),
        ("front_flat", Vec3::new(0.0, 0.92, 4.0), Some(2.1)),
        ("top_flat", Vec3::new(0.0, 4.0, 0.0), Some(1.6)),
    ];
    for (name, eye, height) in views {
        studio.look(eye, middle, height);
        studio.set(|settings| (settings.rig, settings.grid) = (false, true));
        let bare = studio.take(&format!("{name}_bare"));
        studio.set(|settings| settings.rig = true);
        let rigged = studio.take(name);
        let sight = studio.sight();
        let rig = studio.base.rig();
        let places: Vec<Vec2> =
            rig.rest_globals().iter().filter_map(|(_, global)| sight.project(global.translation)).collect();
        assert!(places.len() > 40);
        let hidden = places.iter().filter(|place| at(&bare, **place) == at(&rigged, **place)).count();
        assert_eq!(hidden, 0, "{name}: joints that are not seen, of {}", places.len());
    }
}

#[test]
fn states_ghosts_and_labels_are_seen_on_a_gpu() {
    let Some(mut studio) = studio() else { return };
    let (hips, chest, arm) = (studio.uid("hips"), studio.uid("chest"), studio.uid("head"));
    studio.look(Vec3::new(0.9, 1.3, 1.9), Vec3::new(0.1, 1.15, 0.0), None);
    let plain = studio.take("near_plain");
    let rig = studio.base.rig;
    studio.base.app.world_mut().get_mut::<Selection>(rig).unwrap().0 = vec![hips, chest];
    studio.base.app.world_mut().get_mut::<HoveredNode>(rig).unwrap().0 = Some(arm);
    let states = studio.take("near_states");
    for (label, what) in [("hips", "selected"), ("chest", "active"), ("head", "hovered")] {
        let place = studio.sight().project(studio.position(label)).unwrap();
        assert_ne!(at(&plain, place), at(&states, place), "{what}");
    }
    studio.set(|settings| settings.axes = true);
    let axes = studio.take("near_axes");
    assert!(changed(&states, &axes) > 50, "axes change {} pixels", changed(&states, &axes));
    studio.set(|settings| settings.labels = LabelChoice::All);
    let labels = studio.take("near_labels");
    let near = changed(&axes, &labels);
    assert!(near > 300, "labels change {near} pixels");
    studio.set(|settings| (settings.axes, settings.labels) = (false, LabelChoice::None));
    studio.look(Vec3::new(0.0, 1.0, 3.6), Vec3::new(0.0, 0.92, 0.0), None);
    let plain = studio.take("front_plain");
    studio.set(|settings| settings.labels = LabelChoice::All);
    let labels = studio.take("front_labels");
    let front = changed(&plain, &labels);
    assert!(front > 300, "labels change {front} pixels from the front");
    studio.set(|settings| settings.labels = LabelChoice::None);
    let (from, to) = (studio.position("chest"), Vec3::new(0.32, 1.5, 0.05));
    let mirrored = |place: Vec3| Vec3::new(-place.x, place.y, place.z);
    let step = |part: f32| from.lerp(to, part);
    let joints: Vec<GhostJoint> = [(0.5, 0.0), (1.0, 0.5)]
        .into_iter()
        .flat_map(|(at, parent)| {
            let joint = GhostJoint { position: step(at), parent: Some(step(parent)), mirrored: false };
            let other =
                GhostJoint { position: mirrored(joint.position), parent: joint.parent.map(mirrored), mirrored: true };
            [joint, other]
        })
        .collect();
    let wave = |n: usize| Vec3::new(0.2 + 0.02 * n as f32, 1.2 + 0.05 * (n as f32 * 0.7).sin(), 0.2);
    let ghosts = Ghosts {
        rig: None,
        depth_span: Some((joints[0].position + Vec3::Z * 0.12, joints[0].position - Vec3::Z * 0.1)),
        joints,
        stroke: (0..20).map(wave).collect(),
    };
    studio.base.app.world_mut().insert_resource(ghosts);
    studio.base.app.world_mut().get_mut::<Symmetry>(rig).unwrap().0 = Some(MirrorPlane::sagittal(1.8));
    studio.look(Vec3::new(1.3, 1.4, 1.9), Vec3::new(0.1, 1.2, 0.0), None);
    let ghosts = studio.take("near_ghosts");
    let place = studio.sight().project(to).unwrap();
    studio.base.app.world_mut().insert_resource(Ghosts::default());
    let gone = studio.take("near_ghosts_gone");
    assert_ne!(at(&ghosts, place), at(&gone, place));
    let hand = studio.base.rig().walk().map(|joint| joint.data.uid).collect::<Vec<_>>();
    let positions: Vec<Vec3> = hand.iter().map(|uid| studio.base.rig().position(*uid)).collect();
    let far = positions.into_iter().max_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
    studio.look(far + Vec3::new(0.25, 0.25, 0.45), far - Vec3::X * 0.06, None);
    let [hand, far] = [("hand", None), ("far", Some(Vec3::new(6.0, 5.0, 9.0)))].map(|(name, eye)| {
        if let Some(eye) = eye {
            studio.look(eye, Vec3::ZERO, None);
        }
        let rigged = studio.take(name);
        studio.set(|settings| settings.rig = false);
        let bare = studio.take(&format!("{name}_bare"));
        studio.set(|settings| settings.rig = true);
        changed(&rigged, &bare)
    });
    assert!(hand > 1000, "the rig covers {hand} pixels of a hand");
    assert!(far > 100 && far < hand, "the rig covers {far} pixels from afar");
}
