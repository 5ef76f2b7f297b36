//! Real characters, read and written: nothing moves.

use std::path::{Path, PathBuf};

use super::writing::there_and_back;
use glam::{Affine3A, Quat, Vec3, Vec4};
use rigsmith::mesh::{
    gltf::{ExternalError, ExternalFile, GltfWriteSettings, read_gltf, write_glb},
    model::{Channel, ChannelTarget, Clip, Interpolation, Model},
};

use crate::prerequisites::test_data;

/// Files with skins below a folder of test meshes.
pub fn skinned_files(data: PathBuf) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let is_gltf = |path: &Path| path.extension().is_some_and(|extension| extension == "glb" || extension == "gltf");
    for folder in ["creatures", "gltf_skinned", "hands"].map(|folder| data.join(folder)) {
        files
            .extend(std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).filter(|path| is_gltf(path)));
    }
    for body in std::fs::read_dir(data.join("bodies")).unwrap() {
        files.extend(Some(body.unwrap().path().join("body_gt.glb")).filter(|path| path.exists()));
    }
    files.sort();
    assert!(files.len() >= 10, "{files:?}");
    files
}

pub fn read_file(path: &Path) -> Model {
    let folder = path.parent().unwrap();
    let mut load =
        |ExternalFile { path: uri, .. }: ExternalFile| std::fs::read(folder.join(uri)).map_err(ExternalError::new);
    read_gltf(&std::fs::read(path).unwrap(), &path.display().to_string(), &mut load).unwrap()
}

/// Folder and file in one word.
fn name_of(path: &Path) -> String {
    let folder = path.parent().and_then(Path::file_name).unwrap().to_string_lossy();
    format!("{folder}_{}", path.file_name().unwrap().to_string_lossy()).replace('.', "_")
}

/// A channel's value at a time: numbers between keys, or a turned quaternion.
fn sample(channel: &Channel, time: f32) -> Vec<f32> {
    let cubic = channel.interpolation == Interpolation::CubicSpline;
    let width = channel.values.len() / channel.times.len() / if cubic { 3 } else { 1 };
    let key = |i: usize| {
        if cubic { &channel.values[(3 * i + 1) * width..][..width] } else { &channel.values[i * width..][..width] }
    };
    let next = channel.times.partition_point(|at| *at <= time);
    if next == 0 || next == channel.times.len() {
        return key(next.saturating_sub(1)).to_vec();
    }
    let step = channel.times[next] - channel.times[next - 1];
    let t = (time - channel.times[next - 1]) / step;
    let (a, b) = (key(next - 1), key(next));
    match channel.interpolation {
        Interpolation::Step => a.to_vec(),
        Interpolation::Linear if width == 4 => {
            let turned = Quat::from_slice(a).slerp(Quat::from_slice(b), t);
            turned.to_array().to_vec()
        }
        Interpolation::Linear => a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect(),
        Interpolation::CubicSpline => {
            let (out, into) = (&channel.values[(3 * (next - 1) + 2) * width..], &channel.values[3 * next * width..]);
            let (t2, t3) = (t * t, t * t * t);
            let at = |i: usize| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                    + step * (t3 - 2.0 * t2 + t) * out[i]
                    + (3.0 * t2 - 2.0 * t3) * b[i]
                    + step * (t3 - t2) * into[i]
            };
            (0..width).map(at).collect()
        }
    }
}

/// Corners of all triangles, posed by a clip.
fn posed(model: &Model, clip: Option<&Clip>, time: f32) -> Vec<Vec3> {
    let mut rest: Vec<_> = model.nodes.iter().map(|node| node.rest).collect();
    let mut morphs: Vec<Vec<f32>> = model.objects.iter().map(|object| object.morph_weights.clone()).collect();
    for channel in clip.into_iter().flat_map(|clip| &clip.channels) {
        let value = sample(channel, time);
        match channel.target {
            ChannelTarget::Translation(node) => rest[node].translation = Vec3::from_slice(&value),
            ChannelTarget::Rotation(node) => {
                rest[node].rotation = Quat::from_vec4(Vec4::from_slice(&value)).normalize()
            }
            ChannelTarget::Scale(node) => rest[node].scale = Vec3::from_slice(&value),
            ChannelTarget::MorphWeights(object) => morphs[object] = value,
        }
    }
    let mut globals: Vec<Affine3A> = Vec::new();
    for (node, rest) in model.nodes.iter().zip(&rest) {
        globals.push(node.parent.map_or(Affine3A::IDENTITY, |parent| globals[parent]) * rest.affine());
    }
    let at_rest = model.rest_globals();
    let mut corners = Vec::new();
    for part in &model.parts {
        let object = &model.objects[part.object];
        let binds = object.skin.map(|skin| {
            let skin = &model.skins[skin];
            let mut of_node = vec![Affine3A::IDENTITY; model.nodes.len()];
            for (joint, bind) in skin.joints.iter().zip(&skin.inverse_binds) {
                of_node[*joint] = globals[*joint] * Affine3A::from_mat4(*bind);
            }
            of_node
        });
        for vertex in part.triangles.iter().flatten().map(|vertex| *vertex as usize) {
            let mut point = model.points[part.vertices[vertex] as usize];
            for (morph, weight) in part.morphs.iter().zip(&morphs[part.object]) {
                point += morph.positions.get(vertex).copied().unwrap_or_default() * *weight;
            }
            corners.push(match (&binds, object.node) {
                (Some(binds), _) => {
                    let influences = model.weights.as_ref().unwrap().of(part.vertices[vertex] as usize);
                    influences.map(|(joint, weight)| weight * binds[joint as usize].transform_point3(point)).sum()
                }
                (None, Some(node)) => (globals[node] * at_rest[node].inverse()).transform_point3(point),
                (None, None) => point,
            });
        }
    }
    corners
}

#[test]
fn characters_pose_the_same() {
    let settings = GltfWriteSettings { max_influences: 8, bind_unweighted: true, ..Default::default() };
    for path in test_data().into_iter().flat_map(skinned_files) {
        let model = read_file(&path);
        let name = name_of(&path);
        let again = there_and_back(&format!("data_{name}"), &model, &settings);
        assert_eq!(again.clips.len(), model.clips.len(), "{name}");
        let clips = model.clips.iter().zip(&again.clips).map(|(before, after)| (Some(before), Some(after)));
        for (before, after) in [(None, None)].into_iter().chain(clips.take(4)) {
            for time in [0.0, 0.37, 1.0] {
                let (expected, found) = (posed(&model, before, time), posed(&again, after, time));
                assert_eq!(expected.len(), found.len());
                let size = expected.iter().fold(0.0_f32, |size, point| size.max(point.length()));
                let off = expected.iter().zip(&found).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
                assert!(off <= 3e-6 * size, "{name}, {:?} at {time}: {off} of {size}", before.map(|clip| &clip.name));
            }
        }
    }
}

/// Points and weights of skinned meshes, bind matrices, and key times.
type OtherView = (Vec<Vec3>, Vec<[f32; 4]>, Vec<[[f32; 4]; 4]>, Vec<f32>);

/// Content that the crate `gltf` reads from a file that is known to be good.
fn view_of_other_reader(glb: &[u8]) -> OtherView {
    let file = ::gltf::Gltf::from_slice(glb).unwrap();
    let bytes = |_: ::gltf::Buffer| file.blob.as_deref();
    let (mut points, mut weights, mut binds, mut times) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for node in file.nodes().filter(|node| node.skin().is_some()) {
        for primitive in node.mesh().unwrap().primitives() {
            let reader = primitive.reader(bytes);
            points.extend(reader.read_positions().unwrap().map(Vec3::from_array));
            weights.extend(reader.read_weights(0).unwrap().into_f32());
        }
    }
    for skin in file.skins() {
        binds.extend(skin.reader(bytes).read_inverse_bind_matrices().unwrap());
    }
    for channel in file.animations().flat_map(|animation| animation.channels().collect::<Vec<_>>()) {
        times.extend(channel.reader(bytes).read_inputs().unwrap());
    }
    (points, weights, binds, times)
}

#[test]
fn another_reader_sees_the_same() {
    let settings = GltfWriteSettings { all_joints: true, bind_unweighted: true, ..Default::default() };
    for path in test_data()
        .into_iter()
        .flat_map(skinned_files)
        .filter(|path| path.extension().is_some_and(|kind| kind == "glb"))
    {
        let model = read_file(&path);
        let (points, weights, binds, times) = view_of_other_reader(&std::fs::read(&path).unwrap());
        let skinned: Vec<Vec3> = (model.parts.iter().filter(|part| model.objects[part.object].skin.is_some()))
            .flat_map(|part| part.vertices.iter().map(|point| model.points[*point as usize]))
            .collect();
        assert_eq!(points, skinned, "{}", path.display());
        assert_eq!(
            binds,
            model
                .skins
                .iter()
                .flat_map(|skin| &skin.inverse_binds)
                .map(|bind| bind.to_cols_array_2d())
                .collect::<Vec<_>>()
        );
        assert_eq!(
            times,
            model
                .clips
                .iter()
                .flat_map(|clip| &clip.channels)
                .flat_map(|channel| channel.times.clone())
                .collect::<Vec<_>>()
        );

        let glb = write_glb(&model, &settings).unwrap();
        let (points_after, weights_after, binds_after, times_after) = view_of_other_reader(&glb);
        assert!(points_after == points && binds_after == binds && times_after == times, "{}", path.display());
        assert_eq!(weights_after.len(), weights.len());
        for (after, before) in weights_after.iter().zip(&weights).filter(|_| !path.ends_with("body_gt.glb")) {
            // The strongest come first, and the sum is one: both orders add up to the same.
            let sorted = |weights: &[f32; 4]| {
                let mut weights = weights.to_vec();
                weights.sort_by(|a, b| b.total_cmp(a));
                let sum: f32 = weights.iter().sum();
                weights.iter().map(|weight| weight / sum).collect::<Vec<_>>()
            };
            assert!(
                sorted(after).iter().zip(sorted(before)).all(|(a, b)| (a - b).abs() < 1e-6),
                "{after:?} {before:?}"
            );
        }
    }
}

#[test]
fn characters_come_back_whole() {
    let settings =
        GltfWriteSettings { max_influences: 8, all_joints: true, bind_unweighted: true, ..Default::default() };
    for path in test_data().into_iter().flat_map(skinned_files) {
        let model = read_file(&path);
        let name = name_of(&path);
        let again = there_and_back(&format!("data_all_{name}"), &model, &settings);
        assert_eq!((&again.nodes, &again.skins, &again.clips), (&model.nodes, &model.skins, &model.clips), "{name}");
        assert_eq!(again.material_set, model.material_set, "{name}");
        let weighted = |model: &Model| model.weights.as_ref().unwrap().values.clone();
        assert_eq!(weighted(&again), weighted(&model), "{name}");
        let rigid = model.objects.iter().any(|object| object.node.is_some());
        if !rigid {
            assert_eq!(
                (&again.points, &again.parts, &again.objects),
                (&model.points, &model.parts, &model.objects),
                "{name}"
            );
        }
    }
}
