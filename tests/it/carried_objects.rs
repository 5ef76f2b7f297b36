//! Objects that hang on a joint of an imported character, as swords and helmets: they follow it alone where rays meet the
//! surface, in weights and in exports, until somebody binds them otherwise. Joints of both sides are pairs.

use std::{f32::consts::FRAC_PI_2, sync::Arc};

use bevy::{
    app::App,
    math::{Mat4, Quat, Vec3},
};
use rigsmith::{
    algo::weights::WeightSettings,
    files::{RealDisk, load_model, store_model},
    headless::Workbench,
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Node, SkinBinding, Trs, Weights},
    },
    plugins::surface::RigSurface,
    rig::{PoseOffset, RigEdit, SkinData, Uid, operations::Operation},
};

use crate::gestures::boxes;

/// Number of points of a box.
const BOX: usize = 8;
/// Highest corner of the sword, at rest and with the hand turned as [`turned`] has it.
const TIP: [Vec3; 2] = [Vec3::new(0.4, 1.6, 0.05), Vec3::new(-0.7, 1.3, 0.05)];

/// A body that the hips hold, and a sword without a skin that hangs on the hand.
pub fn armed() -> Model {
    let mut model = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]], [[0.3, 0.8, -0.05], [0.4, 1.6, 0.05]]]);
    let node = |name: &str, parent, y| {
        let rest = Trs { translation: Vec3::new(0.0, y, 0.0), ..Trs::IDENTITY };
        Node { name: name.into(), parent, rest, joint: true, ..Node::default() }
    };
    model.nodes = vec![node("hips", None, 0.1), node("hand", Some(0), 0.8)];
    let inverse_binds = [0.1, 0.9].map(|y| Mat4::from_translation(Vec3::new(0.0, -y, 0.0))).to_vec();
    model.skins = vec![SkinBinding { name: "skin".into(), joints: vec![0, 1], inverse_binds }];
    (model.objects[0].skin, model.objects[1].node) = (Some(0), Some(1));
    let mut weights = Weights::default();
    (0..BOX).for_each(|_| weights.push([(0, 1.0)]));
    (0..BOX).for_each(|_| weights.push([]));
    model.weights = Some(weights);
    model
}

/// A quarter turn of the hand, which takes the sword's highest corner to the second of [`TIP`].
pub fn turned() -> PoseOffset {
    PoseOffset { rotation: Quat::from_rotation_z(FRAC_PI_2), ..PoseOffset::IDENTITY }
}

fn opened(model: Model) -> Workbench {
    let mut bench = Workbench::new(3, "armed");
    bench.open(model, false).unwrap();
    bench
}

/// The joints that hold the points of the sword.
fn holders(skin: &SkinData) -> Vec<Vec<(Uid, f32)>> {
    let row = |point| skin.weights.of(point).map(|(joint, weight)| (skin.joints[joint as usize], weight)).collect();
    (BOX..2 * BOX).map(row).collect()
}

#[test]
fn what_hangs_on_a_joint_follows_it_where_rays_meet_it() {
    let mut bench = opened(armed());
    let hand = bench.rig().find_label("hand").unwrap();
    bench.operate(Operation::Edits(vec![RigEdit::SetOffset(hand, Some(turned()))])).unwrap();
    let rig = bench.rig_entity();
    let app = bench.app_mut();
    app.update();
    crate::bench::wait(app, "the surface", App::update, |app| {
        let surface = app.world().get::<RigSurface>(rig);
        surface.is_some_and(|surface| surface.ready().is_some() && !surface.is_stale())
    });
    let surface = app.world().get::<RigSurface>(rig).unwrap().ready().unwrap();
    let off = |place: Vec3| surface.closest_point(place).unwrap().distance;
    assert!(off(TIP[1]) < 1e-4, "the sword is {} from where the hand holds it", off(TIP[1]));
    assert!(off(TIP[0]) > 0.3, "nothing is left where the sword was");
    assert!(off(Vec3::new(0.2, 1.0, 0.2)) < 1e-4, "the body stays");
}

#[test]
fn what_hangs_on_a_joint_hangs_on_it_in_weights_and_exports_until_it_is_bound_otherwise() {
    let mut bench = opened(armed());
    let hand = bench.rig().find_label("hand").unwrap();
    assert!(holders(bench.weights().unwrap()).iter().all(|row| *row == [(hand, 1.0)]));
    // As in its file: without a skin, below the joint.
    let before = armed();
    let written = bench.character();
    assert_eq!((written.objects[1].skin, written.objects[1].node), (None, before.objects[1].node));
    assert_eq!((written.skins.len(), &written.weights), (1, &before.weights));
    // Weights that are computed anew leave it to the hand.
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    assert!(holders(bench.weights().unwrap()).iter().all(|row| *row == [(hand, 1.0)]));

    // Bound to the hips beside the weights of the file, it has a skin, and rests where it was.
    let mut bench = opened(armed());
    let mut skin = bench.weights().unwrap().clone();
    let [hips, hand] = ["hips", "hand"].map(|label| {
        let joint = bench.rig().find_label(label).unwrap();
        skin.joints.iter().position(|other| *other == joint).unwrap() as u32
    });
    let mut weights = Weights::default();
    (0..BOX).for_each(|_| weights.push([(hips, 1.0)]));
    (0..BOX).for_each(|_| weights.push([(hips, 0.75), (hand, 0.25)]));
    skin.weights = weights;
    let mesh = bench.mesh().unwrap().uid;
    bench.operate(Operation::Edits(vec![RigEdit::SetSkin(mesh, Some(Arc::new(skin)))])).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bound.glb");
    store_model(&RealDisk, &path, &bench.character(), &GltfWriteSettings::default()).unwrap();
    let read = load_model(&RealDisk, &path).unwrap();
    let sword = read.objects.iter().position(|object| object.name == "object 1").unwrap();
    assert!(read.objects[sword].skin.is_some() && read.objects[sword].node.is_none());
    let (rest, weights) = (read.at_rest(), read.weights.as_ref().unwrap());
    let points = read.parts.iter().filter(|part| part.object == sword).flat_map(|part| &part.vertices);
    let mut highest = f32::MIN;
    for point in points.map(|point| *point as usize) {
        let row: Vec<(u32, f32)> = weights.of(point).collect();
        let is_hips = read.nodes[row[0].0 as usize].name == "hips";
        assert!(row.len() == 2 && is_hips && (row[0].1 - 0.75).abs() < 1e-4, "{row:?}");
        highest = highest.max(rest.points[point].y);
    }
    assert!((highest - TIP[0].y).abs() < 1e-5, "{highest}");
}

/// Joints whose names differ in their side alone are pairs of each other from the moment they are imported.
#[test]
fn joints_of_both_sides_are_imported_as_pairs() {
    let mut model = armed();
    let names = ["hips", "arm.l", "arm.r", "foot_L", "foot_R", "LeftHand", "RightHand", "tail.l"];
    let node = |(number, name): (usize, &&str)| Node {
        name: (*name).into(),
        parent: (number > 0).then_some(0),
        joint: true,
        ..Node::default()
    };
    model.nodes = names.iter().enumerate().map(node).collect();
    model.skins[0].joints = (0..names.len()).collect();
    model.skins[0].inverse_binds = vec![Mat4::IDENTITY; names.len()];
    let bench = opened(model);
    let joint = |label: &str| bench.rig().find_label(label).unwrap();
    let partner = |label: &str| bench.rig().joint(joint(label)).unwrap().data.mirror;
    for [left, right] in [["arm.l", "arm.r"], ["foot_L", "foot_R"], ["LeftHand", "RightHand"]] {
        assert_eq!((partner(left), partner(right)), (Some(joint(right)), Some(joint(left))));
    }
    assert_eq!((partner("hips"), partner("tail.l")), (None, None));
}
