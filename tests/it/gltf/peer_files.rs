//! Real files through Rigsmith's reader and through the crate `gltf`, with which Bevy's loader reads: both find the same
//! vertices, triangles, joints, bind poses and weights, and put them to the same places of the world.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use glam::{Affine3A, Mat4, Vec3};
use rigsmith::mesh::model::{Model, Part};

use super::data::{read_file, skinned_files};
use crate::prerequisites::test_data;

/// Largest difference, in proportion to the size of what is compared.
const CLOSE: f32 = 1e-5;

/// A file as the other reader finds it.
struct OtherFile {
    file: ::gltf::Gltf,
    buffers: Vec<Vec<u8>>,
    /// Transform of each node to the world.
    worlds: Vec<Mat4>,
    /// Joints of each skin, as nodes, with their inverse bind matrices.
    skins: Vec<Vec<(usize, Mat4)>>,
}

impl OtherFile {
    fn read(path: &Path) -> Self {
        let file = ::gltf::Gltf::from_slice_without_validation(&fs::read(path).unwrap()).unwrap();
        let content = |buffer: ::gltf::Buffer| match buffer.source() {
            ::gltf::buffer::Source::Bin => file.blob.clone().unwrap(),
            ::gltf::buffer::Source::Uri(uri) => match uri.split_once(";base64,") {
                Some((_, text)) => base64(text),
                None => fs::read(path.with_file_name(uri)).unwrap(),
            },
        };
        let buffers: Vec<Vec<u8>> = file.buffers().map(content).collect();
        let locals: Vec<Mat4> = file.nodes().map(|node| Mat4::from_cols_array_2d(&node.transform().matrix())).collect();
        let mut parents = vec![None; locals.len()];
        for node in file.nodes() {
            for child in node.children() {
                parents[child.index()] = Some(node.index());
            }
        }
        let world = |node: usize| {
            let (mut matrix, mut above) = (locals[node], parents[node]);
            while let Some(parent) = above {
                matrix = locals[parent] * matrix;
                above = parents[parent];
            }
            matrix
        };
        let worlds = (0..locals.len()).map(world).collect();
        let bytes = |buffer: ::gltf::Buffer| Some(buffers[buffer.index()].as_slice());
        let mut skins = Vec::new();
        for skin in file.skins() {
            let binds = skin.reader(bytes).read_inverse_bind_matrices().unwrap();
            let binds: Vec<Mat4> = binds.map(|bind| Mat4::from_cols_array_2d(&bind)).collect();
            assert_eq!(binds.len(), skin.joints().count());
            skins.push(skin.joints().map(|joint| joint.index()).zip(binds).collect());
        }
        Self { file, buffers, worlds, skins }
    }
}

/// Bytes of a text in Base64.
fn base64(text: &str) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let (mut bytes, mut bits, mut count) = (Vec::new(), 0_u32, 0);
    for letter in text.bytes().take_while(|letter| *letter != b'=') {
        let value = LETTERS.iter().position(|known| *known == letter).unwrap() as u32;
        (bits, count) = ((bits << 6) | value, count + 6);
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    bytes
}

/// Characters, creatures, hands, bodies and the files of other programs.
fn files(data: PathBuf) -> Vec<PathBuf> {
    let characters = fs::read_dir(data.join("characters")).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        characters.filter(|path| path.extension().is_some_and(|extension| extension == "glb")).collect();
    assert!(!files.is_empty(), "no characters");
    files.sort();
    files.extend(skinned_files(data));
    files
}

#[test]
fn real_files_hold_the_same_for_both_readers() {
    for path in test_data().into_iter().flat_map(files) {
        same_file(&read_file(&path), &OtherFile::read(&path), &path.display().to_string());
    }
}

fn same_file(ours: &Model, theirs: &OtherFile, name: &str) {
    let globals = ours.rest_globals();
    assert_eq!(ours.skins.len(), theirs.skins.len(), "{name}: skins");
    let names: Vec<&str> = theirs.file.nodes().map(|node| node.name().unwrap_or_default()).collect();
    for (binding, skin) in ours.skins.iter().zip(&theirs.skins) {
        assert_eq!((binding.joints.len(), binding.inverse_binds.len()), (skin.len(), skin.len()), "{name}: joints");
        for ((joint, bind), (node, other_bind)) in binding.joints.iter().zip(&binding.inverse_binds).zip(skin) {
            assert_eq!(ours.nodes[*joint].name, names[*node], "{name}: joints");
            assert!(is_close(Mat4::from(globals[*joint]), theirs.worlds[*node]), "{name}: {} at rest", names[*node]);
            assert!(is_close(*bind, *other_bind), "{name}: {} when bound", names[*node]);
        }
    }
    let placed: Vec<_> = theirs.file.nodes().filter(|node| node.mesh().is_some()).collect();
    assert_eq!(ours.objects.len(), placed.len(), "{name}: objects");
    let mut parts = ours.parts.iter();
    for (number, node) in placed.iter().enumerate() {
        let skin = node.skin().map(|skin| skin.index());
        assert_eq!(ours.objects[number].skin, skin, "{name}: skin of object {number}");
        for primitive in node.mesh().unwrap().primitives() {
            let part = parts.next().unwrap_or_else(|| panic!("{name}: a part is missing"));
            assert_eq!(part.object, number, "{name}: object of a part");
            same_part((ours, globals.as_slice()), part, theirs, (node.index(), skin), &primitive, name);
        }
    }
    assert_eq!(parts.count(), 0, "{name}: parts");
}

/// True for matrices whose numbers differ by rounding.
fn is_close(one: Mat4, other: Mat4) -> bool {
    let most = one.to_cols_array().iter().fold(1.0_f32, |most, number| most.max(number.abs()));
    one.abs_diff_eq(other, CLOSE * most)
}

fn same_part(
    (ours, globals): (&Model, &[Affine3A]),
    part: &Part,
    theirs: &OtherFile,
    (node, skin): (usize, Option<usize>),
    primitive: &::gltf::Primitive,
    name: &str,
) {
    let bytes = |buffer: ::gltf::Buffer| Some(theirs.buffers[buffer.index()].as_slice());
    let reader = primitive.reader(bytes);
    let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from_array).collect();
    assert_eq!(part.vertices.len(), positions.len(), "{name}: vertices");
    let indices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..positions.len() as u32).collect(),
    };
    assert_eq!(part.triangles.len() * 3, indices.len(), "{name}: triangles");
    assert!(part.triangles.iter().flatten().eq(&indices), "{name}: triangles differ");
    // Shares of the joints of a skin, by their numbers there.
    let mut shares: Vec<BTreeMap<usize, f32>> = vec![BTreeMap::new(); positions.len()];
    for set in 0.. {
        let (Some(joints), Some(weights)) = (reader.read_joints(set), reader.read_weights(set)) else { break };
        for (share, (joints, weights)) in shares.iter_mut().zip(joints.into_u16().zip(weights.into_f32())) {
            for (joint, weight) in joints.into_iter().zip(weights).filter(|(_, weight)| *weight > 0.0) {
                *share.entry(usize::from(joint)).or_insert(0.0) += weight;
            }
        }
    }
    let mut size = 1.0_f32;
    let mut farthest = 0.0_f32;
    for ((vertex, position), share) in part.vertices.iter().zip(&positions).zip(&shares) {
        let point = ours.points[*vertex as usize];
        let (found, wanted) = match skin {
            None => (point, theirs.worlds[node].transform_point3(*position)),
            Some(skin) => {
                let binding = &ours.skins[skin];
                let total: f32 = share.values().sum();
                let influences: BTreeMap<usize, f32> =
                    ours.weights.as_ref().unwrap().of(*vertex as usize).map(|(joint, w)| (joint as usize, w)).collect();
                assert_eq!(influences.len(), share.len(), "{name}: influences of vertex {vertex}");
                let (mut found, mut wanted) = (Vec3::ZERO, Vec3::ZERO);
                for (slot, weight) in share {
                    let (joint, weight) = (binding.joints[*slot], weight / total);
                    let own = influences.get(&joint).copied().unwrap_or_default();
                    assert!((own - weight).abs() <= CLOSE, "{name}: vertex {vertex} has {own} in place of {weight}");
                    let bound = Affine3A::from_mat4(binding.inverse_binds[*slot]).transform_point3(point);
                    found += own * globals[joint].transform_point3(bound);
                    let (other, bind) = theirs.skins[skin][*slot];
                    wanted += weight * theirs.worlds[other].transform_point3(bind.transform_point3(*position));
                }
                (found, wanted)
            }
        };
        size = size.max(wanted.length());
        farthest = farthest.max(found.distance(wanted));
    }
    assert!(farthest <= CLOSE * size, "{name}: a vertex is {farthest} away, in a mesh of size {size}");
}
