//! Generated models through Rigsmith's readers and through readers of other people: both find the same in them.

use std::collections::BTreeMap;

use glam::{Mat4, Vec3};
use rigsmith::mesh::{
    gltf::{ExternalError, ExternalFile, read_gltf},
    model::{Channel, ChannelTarget, Interpolation, Model, Part},
    obj::{ObjSettings, read_model},
};

use crate::{
    generate::{
        Choices,
        models::{model, obj},
    },
    mutate::run_seeded,
};

#[test]
fn the_crate_gltf_finds_the_same_in_models() {
    run_seeded("peer_gltf", 300, |bytes| {
        let made = model(&mut Choices::new(bytes));
        if !made.is_bent {
            same_gltf(&made.glb);
        }
    });
}

/// The influences of a vertex, added up for each joint; without those of weight zero.
fn added(influences: impl Iterator<Item = (usize, f32)>) -> BTreeMap<usize, f32> {
    let mut sums = BTreeMap::new();
    for (joint, weight) in influences.filter(|(_, weight)| *weight > 0.0) {
        *sums.entry(joint).or_insert(0.0) += weight;
    }
    sums
}

fn same_gltf(glb: &[u8]) {
    let mut external = |_: ExternalFile| Err(ExternalError::new("there is none"));
    let ours = read_gltf(glb, "made", &mut external).unwrap();
    let theirs = ::gltf::Gltf::from_slice(glb).unwrap_or_else(|error| panic!("the other reader refuses it: {error:?}"));
    let blob = theirs.blob.as_deref().unwrap_or_default();
    let meshes: Vec<_> = theirs.nodes().filter(|node| node.mesh().is_some()).collect();
    assert_eq!(ours.objects.len(), meshes.len());
    let mut parts = ours.parts.iter();
    for (number, (node, object)) in meshes.iter().zip(&ours.objects).enumerate() {
        assert_eq!(object.skin.is_some(), node.skin().is_some());
        for primitive in node.mesh().unwrap().primitives() {
            let part = parts.next().expect("a part for each primitive");
            assert_eq!(part.object, number);
            same_primitive(&ours, part, node, &primitive, blob);
        }
    }
    assert_eq!(parts.count(), 0);
    for (binding, skin) in ours.skins.iter().zip(theirs.skins()) {
        assert_eq!(binding.joints.len(), skin.joints().count());
        let names = binding.joints.iter().map(|joint| Some(ours.nodes[*joint].name.as_str()));
        assert!(names.eq(skin.joints().collect::<Vec<_>>().iter().map(::gltf::Node::name)));
        if let Some(binds) = skin.reader(|_| Some(blob)).read_inverse_bind_matrices() {
            assert!(binds.map(|bind| Mat4::from_cols_array_2d(&bind)).eq(binding.inverse_binds.iter().copied()));
        }
    }
    assert_eq!(ours.clips.len(), theirs.animations().count());
    for (clip, animation) in ours.clips.iter().zip(theirs.animations()) {
        assert_eq!(Some(clip.name.as_str()), animation.name());
        assert_eq!(clip.channels.len(), animation.channels().count());
        for (ours_of, theirs_of) in clip.channels.iter().zip(animation.channels()) {
            same_channel(&ours, ours_of, &theirs_of, blob);
        }
    }
}

fn same_primitive(ours: &Model, part: &Part, node: &::gltf::Node, theirs: &::gltf::Primitive, blob: &[u8]) {
    let reader = theirs.reader(|_| Some(blob));
    let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from_array).collect();
    assert_eq!(part.vertices.len(), positions.len());
    let place = Mat4::from_cols_array_2d(&node.transform().matrix());
    for (vertex, position) in part.vertices.iter().zip(&positions) {
        let point = ours.points[*vertex as usize];
        match node.skin() {
            Some(_) => assert_eq!(point, *position),
            None => assert!(point.distance(place.transform_point3(*position)) <= 1e-5 * (1.0 + point.length())),
        }
    }
    // Where the object is mirrored, its triangles are turned over.
    let turned =
        |[a, b, c]: [u32; 3]| if node.skin().is_none() && place.determinant() < 0.0 { [a, c, b] } else { [a, b, c] };
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    let triangles: Vec<[u32; 3]> =
        indices.chunks_exact(3).map(|corners| turned([corners[0], corners[1], corners[2]])).collect();
    let first_is_least = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
    let round = |triangles: &[[u32; 3]]| triangles.iter().copied().map(first_is_least).collect::<Vec<_>>();
    assert_eq!(round(&part.triangles), round(&triangles));
    let uvs: Option<Vec<[f32; 2]>> = reader.read_tex_coords(0).map(|uvs| uvs.into_f32().collect());
    assert_eq!(part.uvs.first().map(|set| set.iter().map(|uv| uv.to_array()).collect()), uvs);
    let morphs: Vec<Vec<Vec3>> =
        (reader.read_morph_targets()).map(|(offsets, ..)| offsets.unwrap().map(Vec3::from_array).collect()).collect();
    assert_eq!(part.morphs.len(), morphs.len());
    for (morph, offsets) in part.morphs.iter().zip(&morphs).filter(|_| node.skin().is_some()) {
        assert_eq!(morph.positions, *offsets);
    }
    let Some(skin) = ours.objects[part.object].skin else { return };
    let weights = ours.weights.as_ref().unwrap();
    let joints = reader.read_joints(0).unwrap().into_u16();
    let shares = reader.read_weights(0).unwrap().into_f32();
    for ((vertex, joints), shares) in part.vertices.iter().zip(joints).zip(shares) {
        let node_of = |slot: u16| ours.skins[skin].joints[usize::from(slot)];
        let theirs = added(joints.into_iter().map(node_of).zip(shares));
        let found = added(weights.of(*vertex as usize).map(|(joint, weight)| (joint as usize, weight)));
        assert!(theirs.keys().eq(found.keys()), "{found:?}, {theirs:?}");
        assert!(found.iter().all(|(joint, weight)| (weight - theirs[joint]).abs() <= 1e-6), "{found:?}, {theirs:?}");
    }
}

fn same_channel(ours: &Model, channel: &Channel, theirs: &::gltf::animation::Channel, blob: &[u8]) {
    use ::gltf::animation::{Interpolation as Theirs, util::ReadOutputs};

    let reader = theirs.reader(|_| Some(blob));
    assert!(reader.read_inputs().unwrap().eq(channel.times.iter().copied()));
    let (target, values): (_, Vec<f32>) = match reader.read_outputs().unwrap() {
        ReadOutputs::Translations(list) => (0, list.flatten().collect()),
        ReadOutputs::Rotations(list) => (1, list.into_f32().flatten().collect()),
        ReadOutputs::Scales(list) => (2, list.flatten().collect()),
        ReadOutputs::MorphTargetWeights(list) => (3, list.into_f32().collect()),
    };
    let (kind, node) = match channel.target {
        ChannelTarget::Translation(node) => (0, node),
        ChannelTarget::Rotation(node) => (1, node),
        ChannelTarget::Scale(node) => (2, node),
        ChannelTarget::MorphWeights(object) => (3, object),
    };
    assert_eq!((kind, Some(ours.nodes[node].name.as_str())), (target, theirs.target().node().name()));
    assert_eq!(channel.values.len(), values.len());
    assert!(channel.values.iter().zip(&values).all(|(ours, theirs)| (ours - theirs).abs() <= 1e-6), "{values:?}");
    let interpolation = match theirs.sampler().interpolation() {
        Theirs::Linear => Interpolation::Linear,
        Theirs::Step => Interpolation::Step,
        Theirs::CubicSpline => Interpolation::CubicSpline,
    };
    assert_eq!(channel.interpolation, interpolation);
}

#[test]
fn the_crate_tobj_finds_the_same_in_models() {
    run_seeded("peer_obj", 400, |bytes| same_obj(&obj(&mut Choices::new(bytes))));
}

/// A polygon: the places of its corners and their texture coordinates, to the bit.
type Polygon = Vec<([u32; 3], Option<[u32; 2]>)>;

fn same_obj(text: &str) {
    let ours = read_model(text.as_bytes(), "made", &ObjSettings::default(), &mut |_| None).unwrap();
    let mut found: Vec<Polygon> = ours.parts.iter().flat_map(|part| polygons(&ours, part)).collect();
    let none = |_: &std::path::Path| Err(::tobj::LoadError::OpenFileFailed);
    let read = ::tobj::load_obj_buf(&mut text.as_bytes(), &::tobj::LoadOptions::default(), none);
    let (models, _) = read.unwrap_or_else(|error| panic!("the other reader refuses it: {error}\n{text}"));
    let mut theirs: Vec<Polygon> = models.iter().flat_map(|model| polygons_of_other(&model.mesh)).collect();
    // Objects and materials are cut in other ways; faces are the same in any order.
    found.sort();
    theirs.sort();
    assert!(!found.is_empty());
    assert_eq!(found, theirs, "{text}");
    let places: Vec<Vec<f32>> = ours.points.iter().map(|point| point.to_array().to_vec()).collect();
    let lines = text.lines().filter_map(|line| line.strip_prefix("v "));
    let written: Vec<Vec<f32>> =
        lines.map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect();
    assert_eq!(places, written, "{text}");
}

fn polygons(model: &Model, part: &Part) -> Vec<Polygon> {
    let corner = |vertex: &u32| {
        let place = model.points[part.vertices[*vertex as usize] as usize].to_array().map(f32::to_bits);
        let uv = part.uvs.first().map(|set| set[*vertex as usize].to_array().map(f32::to_bits));
        (place, uv)
    };
    if part.faces.is_empty() {
        return part.triangles.iter().map(|triangle| triangle.iter().map(corner).collect()).collect();
    }
    part.faces.iter().map(|face| face.iter().map(corner).collect()).collect()
}

fn polygons_of_other(mesh: &::tobj::Mesh) -> Vec<Polygon> {
    let has_uvs = !mesh.texcoords.is_empty();
    let corner = |at: usize| {
        let place = 3 * mesh.indices[at] as usize;
        let place = [0, 1, 2].map(|axis| mesh.positions[place + axis].to_bits());
        // Its origin is at the bottom left.
        let uv = has_uvs.then(|| {
            let at = 2 * mesh.texcoord_indices[at] as usize;
            [mesh.texcoords[at], 1.0 - mesh.texcoords[at + 1]].map(f32::to_bits)
        });
        (place, uv)
    };
    let mut arities: Vec<usize> = mesh.face_arities.iter().map(|arity| *arity as usize).collect();
    if arities.is_empty() {
        arities = vec![3; mesh.indices.len() / 3];
    }
    let mut next = 0..;
    arities.into_iter().map(|arity| next.by_ref().take(arity).map(corner).collect()).collect()
}
