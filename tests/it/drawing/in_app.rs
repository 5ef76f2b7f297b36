//! Drawing in an app: work of frames, labels, hidden bones and joints that deform.

use super::*;

fn drawing_app() -> (App, Entity, Entity) {
    let mut app = headless_app(1);
    app.add_plugins(AssetPlugin::default()).init_asset::<Mesh>().add_plugins(DrawingPlugin);
    let mut app = strict_app(app);
    let rig = app.world_mut().spawn(crate::bench::shipped("biped")).id();
    let target = RenderTargetInfo { physical_size: SIZE.as_uvec2(), scale_factor: 1.0 };
    let computed = ComputedCameraValues { target_info: Some(target), ..default() };
    let eye = Transform::from_xyz(0.0, 1.0, 3.0).looking_at(Vec3::Y, Vec3::Y);
    let camera = (Camera3d::default(), Camera { computed, ..default() }, RigViewport { focus: 3.0 }, eye);
    let camera = app.world_mut().spawn(camera).id();
    (app, rig, camera)
}

#[test]
fn nothing_is_built_while_nothing_changes() {
    let (mut app, rig, camera) = drawing_app();
    let counts = |app: &mut App| {
        for _ in 0..3 {
            app.update();
        }
        *app.world().resource::<DrawingCounts>()
    };
    let mut last = counts(&mut app);
    assert!(last.rigs > 0 && last.grid > 0);
    assert_eq!(counts(&mut app), last, "idle");
    let first = app.world().get::<Rig>(rig).unwrap().walk().next().unwrap().data.uid;

    type Act<'a> = Box<dyn Fn(&mut World) + 'a>;
    let acts: [(&str, Act, [u64; 4]); 7] = [
        ("hovering", Box::new(|world| world.get_mut::<HoveredNode>(rig).unwrap().0 = Some(first)), [1, 0, 0, 0]),
        ("selecting", Box::new(|world| world.get_mut::<Selection>(rig).unwrap().0 = vec![first]), [1, 0, 0, 0]),
        (
            "symmetry",
            Box::new(|world| world.get_mut::<Symmetry>(rig).unwrap().0 = Some(MirrorPlane::sagittal(1.8))),
            [0, 0, 1, 0],
        ),
        (
            "a ghost",
            Box::new(|world| {
                let joint = GhostJoint { position: Vec3::Y, parent: None, mirrored: false };
                world.resource_mut::<Ghosts>().joints = vec![joint];
            }),
            [0, 1, 0, 0],
        ),
        ("the camera", Box::new(|world| world.get_mut::<Transform>(camera).unwrap().translation.x = 0.5), [1, 1, 1, 1]),
        (
            "a pose",
            Box::new(|world| {
                let mut joints = world.query_filtered::<&mut Transform, With<rigsmith::plugins::document::Joint>>();
                joints.iter_mut(world).next().unwrap().rotation = Quat::from_rotation_x(0.3);
            }),
            [1, 0, 0, 0],
        ),
        ("no ghost", Box::new(|world| *world.resource_mut::<Ghosts>() = Ghosts::default()), [0, 1, 0, 0]),
    ];
    for (name, act, more) in acts {
        act(app.world_mut());
        let now = counts(&mut app);
        let built = [now.rigs - last.rigs, now.ghosts - last.ghosts, now.planes - last.planes, now.grid - last.grid];
        assert_eq!(built, more, "{name}: rigs, ghosts, planes, grid");
        last = now;
    }
}

#[test]
fn labels_come_on_demand() {
    let (mut app, rig, _) = drawing_app();
    app.update();
    let labels = |app: &App| app.world().get::<RigLabels>(rig).unwrap().0.clone();
    assert!(labels(&app).is_empty());
    app.world_mut().resource_mut::<RigDrawing>().labels = LabelChoice::All;
    app.update();
    let all = labels(&app);
    assert!(all.len() > 8 && all.iter().any(|(_, text)| text == "head"), "{all:?}");
    let head = app.world().get::<Rig>(rig).unwrap().find_label("head").unwrap();
    app.world_mut().get_mut::<Selection>(rig).unwrap().0 = vec![head];
    app.world_mut().resource_mut::<RigDrawing>().labels = LabelChoice::Selected;
    app.update();
    assert_eq!(labels(&app).len(), 1);
}

/// Hidden bones leave those in use: less is drawn, and only the selected joint has a label.
#[test]
fn hidden_bones_leave_the_selected_joint() {
    let (mut app, rig, _) = drawing_app();
    let head = app.world().get::<Rig>(rig).unwrap().find_label("head").unwrap();
    app.world_mut().get_mut::<Selection>(rig).unwrap().0 = vec![head];
    app.world_mut().resource_mut::<RigDrawing>().labels = LabelChoice::All;
    app.world_mut().resource_mut::<RigDrawing>().grid = false;
    let look = |app: &mut App| {
        app.update();
        app.update();
        let labels = app.world().get::<RigLabels>(rig).unwrap().0.len();
        let mut shown = app.world_mut().query::<&Mesh3d>();
        let meshes: Vec<AssetId<Mesh>> = shown.iter(app.world()).map(|mesh| mesh.id()).collect();
        let assets = app.world().resource::<Assets<Mesh>>();
        (labels, meshes.iter().filter_map(|mesh| assets.get(*mesh)).map(Mesh::count_vertices).sum::<usize>())
    };
    let all = look(&mut app);
    app.world_mut().resource_mut::<RigDrawing>().bones = false;
    let few = look(&mut app);
    assert_eq!(few.0, 1, "the selected joint keeps its label");
    assert!(all.0 > 8 && few.1 > 0 && few.1 * 4 < all.1, "{all:?} became {few:?}");
    app.world_mut().resource_mut::<RigDrawing>().bones = true;
    assert_eq!(look(&mut app), all);
}

#[test]
fn joints_that_deform_are_those_with_weights() {
    use rigsmith::{mesh::model::Weights, plugins::drawing::deforming_joints, rig::SkinData};
    let mut rig = crate::bench::shipped("biped");
    assert!(deforming_joints(&rig).is_empty());
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).take(3).collect();
    let mut weights = Weights::default();
    weights.push(vec![(0, 0.5), (2, 0.5)]);
    weights.push(vec![(2, 1.0)]);
    let skin = SkinData { joints: joints.clone(), weights, at_rest: true, ..Default::default() };
    rig.apply(&RigEdit::SetSkin(Uid(98), Some(std::sync::Arc::new(skin)))).unwrap();
    assert_eq!(
        deforming_joints(&rig),
        [joints[0], joints[2]].into(),
        "the one without an influence is bound, but moves nothing"
    );
}
