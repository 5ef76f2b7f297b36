//! Weights of a displayed mesh: how it is held, and how weights are coloured.

use super::*;

fn colors(mesh: &Mesh) -> Option<Vec<[f32; 4]>> {
    match mesh.attribute(Mesh::ATTRIBUTE_COLOR)? {
        VertexAttributeValues::Float32x4(colors) => Some(colors.clone()),
        other => panic!("colours are {}", other.enum_variant_name()),
    }
}

#[test]
fn weights_hold_the_mesh_as_they_hold_its_surface() {
    let (mut bench, joints) = held_bench();
    bench.assert_still();
    let bend = Quat::from_rotation_z(0.7);
    let entity = bench.joint(joints[1]);
    bench.app.world_mut().get_mut::<Transform>(entity).unwrap().rotate_local(bend);
    bench.app.update();
    let place = bench.app.world().get::<GlobalTransform>(bench.rig).unwrap().affine();
    let moves: Vec<_> = joints
        .iter()
        .map(|uid| {
            let global = bench.app.world().get::<GlobalTransform>(bench.joint(*uid)).unwrap().affine();
            let rest: bevy::math::Affine3A = bench.rig().rest_global(*uid).into();
            place.inverse() * global * rest.inverse()
        })
        .collect();
    let mesh = bench.app.world().get::<RigMesh>(bench.mesh).unwrap().clone();
    let mut posed = Vec::new();
    skin_points(&mesh.rest.points, &held_box(&joints).weights, &moves, &mut posed);
    let on_screen = bench.skinned();
    assert!(on_screen.len() >= posed.len());
    for wanted in posed.iter().map(|point| place.transform_point3(*point)) {
        assert!(on_screen.iter().any(|point| point.distance(wanted) < 1e-5), "nothing is shown at {wanted}");
    }
    let moved = posed.iter().zip(&mesh.rest.points).filter(|(a, b)| a.distance(**b) > 0.1);
    assert_eq!(moved.count(), 4, "the upper half is bent");
}

#[test]
fn the_four_strongest_influences_count() {
    let mut bench = Bench::new(boxes(&[[[-1.0; 3], [1.0; 3]]]));
    let places: Vec<[f32; 3]> = (0..6).map(|i| [0.0, i as f32 * 0.2, 0.0]).collect();
    let joints = bench.chain(&places);
    let mut weights = Weights::default();
    weights.push([(5, 0.4), (4, 0.2), (3, 0.2), (2, 0.1), (1, 0.06), (0, 0.04)]);
    (1..8).for_each(|_| weights.push([]));
    bench.bind(SkinData { joints, weights, at_rest: true, ..Default::default() });
    let mesh = bench.meshes(DisplayPiece::Surface).swap_remove(0);
    let (_, weights) = influences(&mesh);
    let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
    for (position, weights) in positions.iter().zip(weights) {
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let wanted = if *position == [-1.0; 3] { [0.4, 0.2, 0.2, 0.1].map(|w| w / 0.9) } else { [1.0, 0.0, 0.0, 0.0] };
        assert!(weights.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{weights:?} at {position:?}");
    }
    bench.assert_still();
}

#[test]
fn rebinding_keeps_what_is_on_the_screen() {
    let (mut bench, joints) = held_bench();
    let entities = bench.entities(DisplayPiece::Surface);
    let mut skin = held_box(&joints);
    skin.weights = Weights::default();
    (0..8).for_each(|_| skin.weights.push([(2, 1.0)]));
    bench.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]));
    assert_eq!(bench.entities(DisplayPiece::Surface), entities, "pieces are filled again where they are alike");
    bench.assert_still();
    bench.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, None)]));
    assert!(bench.entities(DisplayPiece::Surface).len() > entities.len(), "both are there until the renderer is ready");
    bench.settle();
    let entities = bench.entities(DisplayPiece::Surface);
    assert_eq!(entities.len(), 1);
    assert!(bench.app.world().get::<SkinnedMesh>(entities[0]).is_none());
}

#[test]
fn weights_have_colours() {
    let (mut bench, joints) = held_bench();
    assert!(colors(&bench.meshes(DisplayPiece::Surface)[0]).is_none());
    let cases = [
        (WeightColors::Joint(joints[0]), [1.0, 0.25]),
        (WeightColors::Joint(joints[1]), [0.0, 0.75]),
        (WeightColors::Joint(Uid(12345)), [0.0, 0.0]),
    ];
    for (weights, [lower, upper]) in cases {
        bench.show(MeshDisplay { weights, ..default() });
        let mesh = bench.meshes(DisplayPiece::Surface).swap_remove(0);
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
        for (position, color) in positions.iter().zip(colors(&mesh).unwrap()) {
            let weight = if position[1] > 1.0 { upper } else { lower };
            let wanted = weight_color(weight).to_linear().to_f32_array();
            assert!(color.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{weights:?} at {position:?}");
        }
    }
    bench.show(MeshDisplay { weights: WeightColors::AllJoints, ..default() });
    let mesh = bench.meshes(DisplayPiece::Surface).swap_remove(0);
    let kinds: BTreeSet<[u32; 4]> = colors(&mesh).unwrap().iter().map(|color| color.map(f32::to_bits)).collect();
    assert_eq!(kinds.len(), 2, "one colour for the lower points and one for the upper");
    bench.show(MeshDisplay::default());
    assert!(colors(&bench.meshes(DisplayPiece::Surface)[0]).is_none());
    assert_eq!(bench.entities(DisplayPiece::Surface).len(), 1);
}

/// Under a brush the weights change in every frame: a large mesh is repainted meanwhile, and at last as it is.
#[test]
fn weights_that_change_with_every_frame_are_shown_meanwhile() {
    let mut bench = Bench::new(field(250));
    let joints = bench.chain(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let count = bench.app.world().get::<RigMesh>(bench.mesh).unwrap().rest.points.len();
    let skins: Vec<Arc<SkinData>> = [0.25, 0.5, 0.75]
        .into_iter()
        .map(|share| {
            let mut weights = Weights::default();
            (0..count).for_each(|_| weights.push([(0, 1.0 - share), (1, share)]));
            Arc::new(SkinData { joints: joints.clone(), weights, at_rest: true, ..Default::default() })
        })
        .collect();
    bench.bind((*skins[0]).clone());
    bench.show(MeshDisplay { weights: WeightColors::Joint(joints[1]), ..default() });
    let shown = |bench: &mut Bench| {
        let entities = bench.entities(DisplayPiece::Surface);
        let mesh = |entity| bench.app.world().get::<Mesh3d>(entity).unwrap().0.id();
        entities.into_iter().map(mesh).collect::<Vec<_>>()
    };
    let before = shown(&mut bench);
    let (started, mut frame) = (Instant::now(), 0);
    while shown(&mut bench) == before {
        assert!(started.elapsed() < HANG, "no picture is ever finished");
        frame += 1;
        bench.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(skins[frame % 3].clone()))]));
        std::thread::sleep(Duration::from_millis(1));
    }
    bench.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(skins[2].clone()))]));
    bench.settle();
    let wanted = weight_color(0.75).to_linear().to_f32_array();
    for mesh in bench.meshes(DisplayPiece::Surface) {
        for color in colors(&mesh).unwrap() {
            assert!(color.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5), "{color:?} is not {wanted:?}");
        }
    }
    // One point is in one piece: the others stay on the screen as they are.
    let before = shown(&mut bench);
    assert!(before.len() > 1);
    let mut row = Weights { starts: vec![0], ..Weights::default() };
    row.push([(0, 1.0)]);
    let patch = WeightPatch::new(bench.rig().skin(MESH).unwrap(), Vec::new(), vec![0], row);
    bench.edit(Operation::Edits(vec![RigEdit::SetWeights(MESH, Box::new(patch))]));
    bench.settle();
    let after = shown(&mut bench);
    assert_eq!(before.iter().zip(&after).filter(|(before, after)| before != after).count(), 1);
    let grey = weight_color(0.0).to_linear().to_f32_array();
    let all: Vec<[f32; 4]> =
        bench.meshes(DisplayPiece::Surface).iter().flat_map(|mesh| colors(mesh).unwrap()).collect();
    assert_eq!(all.iter().filter(|color| **color == grey).count(), 1);
    // A picture that waits does not keep an idle app busy.
    bench.app.update();
    assert!(bench.app.world().get::<DisplayJob>(bench.mesh).is_none());
}

#[test]
fn the_ramp_gets_lighter_with_the_weight() {
    let lightness = |weight: f32| Oklaba::from(weight_color(weight).to_linear()).lightness;
    let steps: Vec<f32> = (1..=20).map(|step| lightness(step as f32 / 20.0)).collect();
    assert!(steps.is_sorted(), "{steps:?}");
    assert_ne!(weight_color(0.0), weight_color(1e-6));
    assert_eq!(weight_color(f32::NAN), weight_color(0.0));
}
