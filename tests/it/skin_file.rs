//! The `*.skin` file: identity of load and save, and what damaged files get.

use glam::Vec3;
use proptest::prelude::*;
use rigsmith::{
    mesh::model::Weights,
    rig::skin::{SKIN_FORMAT, SkinError, SkinFile, SkinFileError, SkinJoint, content_hash, mesh_hash},
};

fn weights(points: &[&[(u32, f32)]]) -> Weights {
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for point in points {
        weights.push(point.iter().copied());
    }
    weights
}

fn joints(count: u64) -> Vec<SkinJoint> {
    let joint = |i| SkinJoint { uid: i * 0x0123_4567_89AB + 1, label: format!("joint ü {i}"), subject: None };
    (0..count).map(joint).collect()
}

/// Weights of four points, with or without the mesh that they belong to.
pub fn sample(keep_mesh: bool) -> SkinFile {
    let points = [Vec3::ZERO, Vec3::X, Vec3::new(0.1, f32::MIN_POSITIVE, -3e7), Vec3::ONE];
    let weights = weights(&[&[(0, 1.0)], &[(1, 0.75), (0, 0.25)], &[], &[(2, 0.999_999_94), (0, 1e-30)]]);
    SkinFile::new(joints(3), weights, &points, &[[0, 1, 2], [2, 1, 3]], keep_mesh).unwrap()
}

/// The bytes with a checksum that fits, so that a change gets past it.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 8;
    let length = (bytes.len() as u64).to_le_bytes();
    bytes[16..24].copy_from_slice(&length);
    let checksum = content_hash(&bytes[..end]);
    bytes[end..].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

#[test]
fn load_and_save_are_the_identity() {
    for keep_mesh in [false, true] {
        let skin = sample(keep_mesh);
        let bytes = skin.write();
        let read = SkinFile::read(&bytes).unwrap();
        assert_eq!(read, skin);
        assert_eq!(read.write(), bytes);
        assert_eq!(read.mesh().is_some(), keep_mesh);
        assert_eq!(read.joints()[2].label, "joint ü 2");
    }
    let empty = SkinFile::new(vec![], Weights::default(), &[], &[], true).unwrap();
    assert_eq!(SkinFile::read(&empty.write()).unwrap(), empty);
}

#[test]
fn the_bytes_of_format_1_stay_readable() {
    // Written once by format 1; every later version must read it.
    let frozen = include_bytes!("../frozen/format_1.skin");
    assert_eq!(SkinFile::read(frozen).unwrap(), sample(true));
}

#[test]
fn fits_only_the_same_mesh() {
    let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let skin = SkinFile::new(joints(1), weights(&[&[(0, 1.0)][..]; 3]), &points, &[[0, 1, 2]], false).unwrap();
    assert!(skin.fits(&points, &[[0, 1, 2]]));
    assert!(skin.fits(&[Vec3::new(-0.0, 0.0, 0.0), Vec3::X, Vec3::Y], &[[0, 1, 2]]), "the sign of zero is no change");
    assert!(!skin.fits(&points, &[[0, 2, 1]]), "a flipped triangle is a change");
    assert!(!skin.fits(&[Vec3::ZERO, Vec3::X, Vec3::Y * 1.000_000_1], &[[0, 1, 2]]), "a moved point is a change");
    assert!(!skin.fits(&[Vec3::X, Vec3::ZERO, Vec3::Y], &[[0, 1, 2]]), "another order is a change");
    assert!(!skin.fits(&points[..2], &[]), "fewer points are a change");
}

#[test]
fn mesh_hashes_are_stable_and_spread() {
    assert_eq!(mesh_hash(&[], &[]), mesh_hash(&[], &[]));
    let mut seen = std::collections::BTreeSet::new();
    for i in 0..20_000u32 {
        let point = Vec3::new(f32::from_bits(0x3f80_0000 + i), 0.0, 1.0);
        assert!(seen.insert(mesh_hash(&[point], &[])));
        assert!(seen.insert(mesh_hash(&[Vec3::ZERO, Vec3::new(0.0, 0.0, i as f32 + 1.0)], &[[i, 0, 1]])));
    }
}

#[test]
fn weights_that_are_not_whole_are_refused() {
    let points = [Vec3::ZERO; 2];
    let make = |weights: Weights, triangles: &[[u32; 3]]| SkinFile::new(joints(1), weights, &points, triangles, false);
    assert!(matches!(make(weights(&[&[(0, 1.0)]]), &[]), Err(SkinError::PointCount { points: 2, weights: 1 })));
    assert!(matches!(
        make(weights(&[&[(0, 1.0)], &[(1, 1.0)]]), &[]),
        Err(SkinError::Joint { point: 1, joint: 1, .. })
    ));
    for bad in [0.0, -0.5, f32::NAN, f32::INFINITY] {
        assert!(matches!(make(weights(&[&[(0, bad)], &[]]), &[]), Err(SkinError::Weight { point: 0, .. })), "{bad}");
    }
    assert!(matches!(make(weights(&[&[], &[]]), &[[0, 1, 2]]), Err(SkinError::Triangle { triangle: 0, point: 2, .. })));
    for starts in [vec![0, 2, 1], vec![0, 1, 9], vec![1, 1, 1], vec![0, 0, 0]] {
        let broken = Weights { starts: starts.clone(), joints: vec![0], values: vec![1.0] };
        assert!(matches!(make(broken, &[]), Err(SkinError::Layout { .. })), "{starts:?}");
    }
}

#[test]
fn damage_is_named() {
    let good = sample(true).write();
    let edit = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        bytes
    };
    assert_eq!(SkinFile::read(b""), Err(SkinFileError::NotASkin));
    assert_eq!(SkinFile::read(b"PK\x03\x04 something else entirely"), Err(SkinFileError::NotASkin));
    let newer = SkinFile::read(&edit(8, 9));
    assert_eq!(newer, Err(SkinFileError::Newer { found: 9, known: SKIN_FORMAT }));
    assert!(matches!(SkinFile::read(&sealed(edit(8, 0))), Err(SkinFileError::Damaged { offset: 8, .. })));
    assert!(matches!(SkinFile::read(&sealed(edit(12, 3))), Err(SkinFileError::Damaged { offset: 12, .. })));
    assert!(matches!(SkinFile::read(&sealed(edit(24, !good[24]))), Err(SkinFileError::Damaged { offset: 24, .. })));
    // Counts that promise four thousand million joints, points, influences, triangles.
    for at in [43, 47, 51, 55] {
        let lie = SkinFile::read(&sealed(edit(at, 0xff)));
        assert!(matches!(lie, Err(SkinFileError::Damaged { offset: 40, .. })), "{at}: {lie:?}");
    }
    for length in 0..good.len() {
        assert!(SkinFile::read(&good[..length]).is_err(), "cut at {length}");
    }
    let mut longer = good.clone();
    longer.push(0);
    assert!(matches!(SkinFile::read(&longer), Err(SkinFileError::Length { .. })));
    // Any flipped bit is noticed.
    for (at, byte) in good.iter().enumerate() {
        for bit in 0..8 {
            assert!(SkinFile::read(&edit(at, byte ^ 1 << bit)).is_err(), "byte {at} bit {bit}");
        }
    }
}

fn any_skin() -> impl Strategy<Value = SkinFile> {
    let point = prop::collection::vec((0u32..300, 1e-6f32..1.0), 0..9);
    let points = prop::collection::vec((point, prop::array::uniform3(-1e6f32..1e6)), 0..40);
    let subject = prop::option::weighted(0.003, 1..u64::MAX);
    let labels = prop::collection::vec((any::<u64>(), ".{0,12}", subject), 300);
    (points, labels, prop::collection::vec(any::<[u32; 3]>(), 0..40), any::<bool>()).prop_map(
        |(points, labels, triangles, keep_mesh)| {
            let mut weights = Weights { starts: vec![0], ..Weights::default() };
            for (influences, _) in &points {
                let lone = influences.len() == 1;
                weights.push(influences.iter().map(|&(j, w)| (j, if lone && w > 0.5 { 1.0 } else { w })));
            }
            let places: Vec<Vec3> = points.iter().map(|(_, p)| Vec3::from_array(*p)).collect();
            let count = places.len() as u32;
            let triangles: Vec<_> =
                triangles.iter().filter(|_| count > 0).map(|t| t.map(|c| c % count.max(1))).collect();
            let joints = labels.into_iter().map(|(uid, label, subject)| SkinJoint { uid, label, subject }).collect();
            SkinFile::new(joints, weights, &places, &triangles, keep_mesh).unwrap()
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_skin_comes_back_exactly(skin in any_skin()) {
        let bytes = skin.write();
        let read = SkinFile::read(&bytes).unwrap();
        prop_assert_eq!(&read, &skin);
        prop_assert_eq!(read.write(), bytes);
    }
}

#[test]
fn subjects_of_created_joints_need_the_second_format() {
    let points = [Vec3::ZERO, Vec3::X];
    let weights = weights(&[&[(0, 0.5), (1, 0.5)], &[(1, 1.0)]]);
    let of = |subject| {
        let mut joints = joints(2);
        joints[1].subject = subject;
        SkinFile::new(joints, weights.clone(), &points, &[], false).unwrap()
    };
    let format = |skin: &SkinFile| skin.write()[8];
    assert_eq!((format(&of(None)), format(&of(Some(0))), format(&of(Some(1)))), (1, 1, 2));
    assert_eq!(of(Some(0)), of(None), "there is no node zero");
    let read = SkinFile::read(&of(Some(1)).write()).unwrap();
    assert_eq!(read.joints().iter().map(|joint| joint.subject).collect::<Vec<_>>(), [None, Some(1)]);
}
