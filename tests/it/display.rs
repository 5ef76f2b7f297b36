//! Meshes of a rig as they are drawn: pieces, weights, edges, colours, materials. No renderer is needed to look at it.

mod gear;
mod materials;
mod weights;

use std::{
    collections::{BTreeSet, HashSet},
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{
    asset::AssetPlugin,
    mesh::{
        MeshPlugin, VertexAttributeValues,
        skinning::{SkinnedMesh, SkinnedMeshInverseBindposes},
    },
    prelude::*,
};
use rigsmith::{
    files::{RealDisk, load_model},
    headless::headless_app,
    mesh::{
        model::{Faces, Image as ModelImage, Model, Object, Part, Weights},
        skinning::skin_points,
    },
    plugins::display::{DisplayJob, DisplayNote, DisplayPiece, DisplayPlugin, MeshDisplay, WeightColors, weight_color},
    prelude::*,
    rig::{SkinData, WeightPatch},
    test_app::strict_app,
};
use serde_json::json;

use crate::{
    bench::{HANG, RigBench},
    gestures::boxes,
};

const MESH: Uid = Uid(99);

#[derive(Resource, Default)]
struct Notes(Vec<String>);

fn gather_notes(mut messages: MessageReader<DisplayNote>, mut notes: ResMut<Notes>) {
    notes.0.extend(messages.read().map(|note| note.text.clone()));
}

struct Bench {
    bench: RigBench,
    mesh: Entity,
}

impl std::ops::Deref for Bench {
    type Target = RigBench;

    fn deref(&self) -> &RigBench {
        &self.bench
    }
}

impl std::ops::DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut RigBench {
        &mut self.bench
    }
}

impl Bench {
    /// A mesh below an empty rig that stands somewhere, all of it shown.
    fn new(model: Model) -> Self {
        let mut app = headless_app(1);
        app.add_plugins((AssetPlugin::default(), MeshPlugin));
        app.init_asset::<Image>().init_asset::<StandardMaterial>().add_plugins(DisplayPlugin);
        app.init_resource::<Notes>().add_systems(Last, gather_notes);
        let place =
            Transform::from_xyz(3.0, -1.0, 2.0).with_rotation(Quat::from_rotation_y(1.0)).with_scale(Vec3::splat(2.0));
        let bundle = (Rig::new(Uid(1), "rig"), place);
        let mut bench = RigBench::with(strict_app(app), bundle);
        let mesh = bench.app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(bench.rig))).id();
        let mut bench = Self { bench, mesh };
        bench.settle();
        bench
    }

    /// Runs until nothing is being built any more; returns the progress that was seen.
    fn settle(&mut self) -> Vec<f32> {
        let (started, mut seen) = (Instant::now(), Vec::new());
        let mut quiet = 0;
        while quiet < 6 {
            assert!(started.elapsed() < HANG, "the mesh is never shown");
            self.app.update();
            match self.app.world().get::<DisplayJob>(self.mesh) {
                Some(job) => {
                    seen.push(job.fraction());
                    quiet = 0;
                    std::thread::sleep(Duration::from_millis(1));
                }
                None => quiet += 1,
            }
        }
        seen
    }

    fn mesh_mut(&mut self) -> EntityWorldMut<'_> {
        let mesh = self.mesh;
        self.app.world_mut().entity_mut(mesh)
    }

    fn bind(&mut self, skin: SkinData) {
        self.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]));
        self.settle();
    }

    fn show(&mut self, display: MeshDisplay) {
        *self.app.world_mut().resource_mut::<MeshDisplay>() = display;
        self.settle();
    }

    fn entities(&mut self, kind: DisplayPiece) -> Vec<Entity> {
        let mut pieces = self.app.world_mut().query::<(Entity, &DisplayPiece)>();
        let found = pieces.iter(self.app.world()).filter(|(_, other)| **other == kind);
        found.map(|(entity, _)| entity).collect::<BTreeSet<_>>().into_iter().collect()
    }

    fn meshes(&mut self, kind: DisplayPiece) -> Vec<Mesh> {
        let entities = self.entities(kind);
        let assets = self.app.world().resource::<Assets<Mesh>>();
        let mesh = |entity| assets.get(&self.app.world().get::<Mesh3d>(entity).unwrap().0).unwrap().clone();
        entities.into_iter().map(mesh).collect()
    }

    fn materials(&mut self) -> Vec<StandardMaterial> {
        let entities = self.entities(DisplayPiece::Surface);
        let assets = self.app.world().resource::<Assets<StandardMaterial>>();
        let material = |entity| {
            let handle = &self.app.world().get::<MeshMaterial3d<StandardMaterial>>(entity).unwrap().0;
            assets.get(handle).unwrap().clone()
        };
        entities.into_iter().map(material).collect()
    }

    /// For each piece of the surface the matrices that the renderer makes of its joints.
    fn matrices(&mut self) -> Vec<Vec<Mat4>> {
        let entities = self.entities(DisplayPiece::Surface);
        let world = self.app.world();
        let binds = world.resource::<Assets<SkinnedMeshInverseBindposes>>();
        let of = |entity| {
            let skinned = world.get::<SkinnedMesh>(entity).expect("the piece is skinned");
            let binds = binds.get(&skinned.inverse_bindposes).unwrap();
            assert_eq!(binds.len(), skinned.joints.len());
            let globals = skinned.joints.iter().map(|joint| world.get::<GlobalTransform>(*joint).unwrap().to_matrix());
            globals.zip(binds.iter()).map(|(global, bind)| global * *bind).collect()
        };
        entities.into_iter().map(of).collect()
    }

    /// Where the renderer puts the vertices of the surface's first piece, in the world.
    fn skinned(&mut self) -> Vec<Vec3> {
        let matrices = self.matrices().swap_remove(0);
        let mesh = self.meshes(DisplayPiece::Surface).swap_remove(0);
        let (joints, weights) = influences(&mesh);
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap().as_float3().unwrap();
        let points = positions.iter().zip(joints.iter().zip(weights));
        let blend = |(position, (joints, weights)): (&[f32; 3], (&[u16; 4], [f32; 4]))| {
            let all = joints.iter().zip(weights);
            all.map(|(j, w)| matrices[*j as usize].transform_point3((*position).into()) * w).sum()
        };
        points.map(blend).collect()
    }

    /// Asserts that at rest no joint moves the surface from where the rig stands.
    fn assert_still(&mut self) {
        let place = self.app.world().get::<GlobalTransform>(self.rig).unwrap().to_matrix();
        for matrix in self.matrices().concat() {
            assert!(matrix.abs_diff_eq(place, 1e-5), "{matrix} is not {place}");
        }
    }
}

fn influences(mesh: &Mesh) -> (Vec<[u16; 4]>, Vec<[f32; 4]>) {
    let Some(VertexAttributeValues::Uint16x4(joints)) = mesh.attribute(Mesh::ATTRIBUTE_JOINT_INDEX) else {
        panic!("joint indices are missing")
    };
    let Some(VertexAttributeValues::Float32x4(weights)) = mesh.attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT) else {
        panic!("weights are missing")
    };
    (joints.clone(), weights.clone())
}

fn triangles(meshes: &[Mesh]) -> usize {
    meshes.iter().map(|mesh| mesh.indices().unwrap().len() / 3).sum()
}

fn bundled_biped() -> Model {
    load_model(&RealDisk, Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/biped.obj"))).unwrap()
}

/// A square of `side` by `side` quads with normals.
fn field(side: u32) -> Model {
    let across = side + 1;
    let points: Vec<Vec3> =
        (0..across * across).map(|i| Vec3::new((i % across) as f32, (i / across) as f32, 0.0)).collect();
    let quads = (0..side * side).map(|i| {
        let low = i / side * across + i % side;
        [low, low + 1, low + across + 1, low + across]
    });
    let quads: Vec<[u32; 4]> = quads.collect();
    let part = Part {
        vertices: (0..across * across).collect(),
        normals: vec![Vec3::Z; points.len()],
        faces: Faces { starts: (0..=quads.len() as u32).map(|i| 4 * i).collect(), corners: quads.concat() },
        triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
        ..default()
    };
    Model { points, objects: vec![Object::default()], parts: vec![part], ..default() }
}

/// One box from y = 0 to 2; its lower points follow the first joint, its upper ones both.
fn held_box(joints: &[Uid]) -> SkinData {
    let mut weights = Weights::default();
    for point in 0..8 {
        let upper = point >> 1 & 1 == 1;
        weights.push(if upper { vec![(1, 0.75), (0, 0.25)] } else { vec![(0, 1.0)] });
    }
    SkinData { joints: joints.to_vec(), weights, at_rest: true, ..Default::default() }
}

fn held_bench() -> (Bench, Vec<Uid>) {
    let mut bench = Bench::new(boxes(&[[[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]]]));
    let joints = bench.chain(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]);
    bench.bind(held_box(&joints));
    (bench, joints)
}

#[test]
fn every_triangle_is_in_a_piece() {
    let model = bundled_biped();
    let count = model.point_triangles().len();
    let mut bench = Bench::new(model);
    let meshes = bench.meshes(DisplayPiece::Surface);
    assert_eq!(triangles(&meshes), count);
    for mesh in &meshes {
        assert!(mesh.attribute(Mesh::ATTRIBUTE_NORMAL).is_some(), "a mesh is shown with normals");
        assert!(mesh.attribute(Mesh::ATTRIBUTE_JOINT_INDEX).is_none(), "nothing is bound");
    }
}

#[test]
fn large_meshes_come_in_pieces_and_say_how_far_they_are() {
    let mut bench = Bench::new(boxes(&[[[0.0; 3], [1.0; 3]]]));
    assert_eq!(triangles(&bench.meshes(DisplayPiece::Surface)), 12);
    let mesh = RigMesh::new(MESH, field(450), Vec::new());
    bench.mesh_mut().insert(mesh);
    let seen = bench.settle();
    assert!(seen.is_sorted() && seen.first() < seen.last(), "progress is {seen:?}");
    let meshes = bench.meshes(DisplayPiece::Surface);
    assert!(meshes.len() > 5, "{} pieces", meshes.len());
    assert!(meshes.iter().all(|mesh| mesh.indices().unwrap().len() <= 3 << 16));
    assert_eq!(triangles(&meshes), 450 * 450 * 2);
}

#[test]
fn edges_are_those_of_polygons() {
    let model = bundled_biped();
    let key =
        |corner: u32, part: &Part| model.points[part.vertices[corner as usize] as usize].to_array().map(f32::to_bits);
    let mut wanted = HashSet::new();
    for part in &model.parts {
        for face in part.faces.iter() {
            for corner in 0..face.len() {
                let (a, b) = (key(face[corner], part), key(face[(corner + 1) % face.len()], part));
                wanted.insert((a.min(b), a.max(b)));
            }
        }
    }
    let diagonals = model.point_triangles().len() - model.face_count();
    assert!(diagonals > 0, "the model has quads");
    let mut bench = Bench::new(model.clone());
    assert!(bench.entities(DisplayPiece::Edges).is_empty(), "edges are built when they are asked for");
    bench.show(MeshDisplay { wireframe: true, ..default() });
    let lines: usize = bench.meshes(DisplayPiece::Edges).iter().map(|mesh| mesh.indices().unwrap().len() / 2).sum();
    assert_eq!(lines, wanted.len());
    bench.show(MeshDisplay::default());
    let edges = bench.entities(DisplayPiece::Edges);
    assert!(edges.iter().all(|entity| bench.app.world().get::<Visibility>(*entity) == Some(&Visibility::Hidden)));
}

#[test]
fn joints_moved_at_rest_leave_the_mesh_alone() {
    let (mut bench, joints) = held_bench();
    // In the very frame of the edit, and of taking it back.
    bench.edit(Operation::Move { to: vec![(joints[1], Vec3::new(0.5, 1.5, 0.25))], with_children: false });
    bench.assert_still();
    bench.change(Change::Undo);
    bench.assert_still();
}

#[test]
fn a_deleted_joint_lets_go_and_comes_back() {
    let (mut bench, joints) = held_bench();
    let before = bench.skinned();
    bench.edit(Operation::Delete { joints: vec![joints[1]], keep_children: false });
    bench.settle();
    assert!(bench.rig().joint(joints[1]).is_none());
    bench.assert_still();
    let after = bench.skinned();
    assert!(before.iter().zip(&after).all(|(a, b)| a.distance(*b) < 1e-5));
    bench.change(Change::Undo);
    bench.settle();
    bench.assert_still();
    let entity = bench.joint(joints[1]);
    bench.app.world_mut().get_mut::<Transform>(entity).unwrap().rotate_local_z(1.0);
    bench.app.update();
    assert!(before.iter().zip(&bench.skinned()).any(|(a, b)| a.distance(*b) > 0.1), "the joint holds the mesh again");
}

/// Data that a frame hands to the renderer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct RenderUpload {
    mesh_bytes: usize,
    bind_poses: usize,
}

const NOTHING: RenderUpload = RenderUpload { mesh_bytes: 0, bind_poses: 0 };

impl Bench {
    /// Assets of a kind that were added or changed since the last call.
    fn changed<A: Asset>(&mut self) -> Vec<AssetId<A>> {
        let mut events = self.app.world_mut().resource_mut::<Messages<AssetEvent<A>>>();
        let changed = events.drain().filter_map(|event| match event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(id),
            _ => None,
        });
        changed.collect()
    }

    fn frame(&mut self) -> RenderUpload {
        self.app.update();
        let bind_poses = self.changed::<SkinnedMeshInverseBindposes>().len();
        let changed = self.changed::<Mesh>();
        let meshes = self.app.world().resource::<Assets<Mesh>>();
        let bytes = |mesh: &Mesh| {
            let attributes: usize = mesh.attributes().map(|(_, values)| values.get_bytes().len()).sum();
            attributes + mesh.get_index_buffer_bytes().map_or(0, <[u8]>::len)
        };
        RenderUpload { mesh_bytes: changed.into_iter().filter_map(|id| meshes.get(id)).map(bytes).sum(), bind_poses }
    }
}

#[test]
fn a_frame_hands_over_little_while_a_million_triangles_come_and_move() {
    let mut bench = Bench::new(field(1));
    let places: Vec<[f32; 3]> = (0..40).map(|i| [i as f32 * 17.0, 350.0, 0.0]).collect();
    let joints = bench.chain(&places);
    let model = field(707);
    let mut weights = Weights::default();
    for point in &model.points {
        let place = (point.x / 17.0).clamp(0.0, 38.99);
        let (first, part) = (place as u32, place.fract());
        weights.push([(first, 1.0 - part), (first + 1, part)].into_iter().filter(|(_, weight)| *weight > 0.0));
    }
    let skin = Arc::new(SkinData { joints: joints.clone(), weights, at_rest: true, ..Default::default() });
    // The pauses let pieces pile up: a frame takes some of them only.
    let until_done = |bench: &mut Bench| -> Vec<usize> {
        let (started, mut handed) = (Instant::now(), vec![bench.frame().mesh_bytes]);
        while bench.app.world().get::<DisplayJob>(bench.mesh).is_some() {
            assert!(started.elapsed() < HANG, "the mesh is never shown");
            std::thread::sleep(Duration::from_millis(50));
            handed.push(bench.frame().mesh_bytes);
        }
        (0..8).for_each(|_| handed.push(bench.frame().mesh_bytes));
        handed
    };
    // About 4 MiB for each layer, and what the last piece has more than that.
    let layer = 9 << 20;
    bench.mesh_mut().insert(RigMesh::new(MESH, model, Vec::new()));
    let loading = until_done(&mut bench);
    let bind = Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(skin))]);
    let bind = EditRequest::operation(bench.rig, bind);
    bench.app.world_mut().write_message(bind);
    let binding = until_done(&mut bench);
    *bench.app.world_mut().resource_mut::<MeshDisplay>() =
        MeshDisplay { weights: WeightColors::AllJoints, wireframe: true, ..default() };
    let coloring = until_done(&mut bench);
    for (what, handed, most) in
        [("loading", loading, layer), ("binding", binding, layer), ("colouring", coloring, 2 * layer)]
    {
        assert!(handed.iter().sum::<usize>() > most, "{what}: {handed:?}");
        assert!(handed.iter().all(|bytes| *bytes <= most), "{what}: {handed:?}");
    }
    let pieces = bench.entities(DisplayPiece::Surface).len() + bench.entities(DisplayPiece::Edges).len();
    assert!((0..20).all(|_| bench.frame() == NOTHING), "an idle frame");
    let entity = bench.joint(joints[20]);
    for _ in 0..20 {
        bench.app.world_mut().get_mut::<Transform>(entity).unwrap().rotate_local_z(0.01);
        assert_eq!(bench.frame(), NOTHING, "a pose moves joints only");
    }
    for step in 1..=20 {
        let to = vec![(joints[20], Vec3::new(340.0, 350.0, step as f32 * 0.1))];
        let operation = Operation::Move { to, with_children: false };
        let edit = EditRequest::operation(bench.rig, operation);
        bench.app.world_mut().write_message(edit);
        let handed = bench.frame();
        assert!((1..=pieces).contains(&handed.bind_poses) && handed.mesh_bytes == 0, "{handed:?} of {pieces} pieces");
    }
}
