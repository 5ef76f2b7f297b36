//! Facial bones and their weights: counts, pairs, names, fixed places, lips kept apart, bad input.

use glam::Vec3;
use rigsmith::{
    algo::face::{
        bones::{
            FaceBone, FaceBoneKind, FaceBones, FaceBonesError, FaceBonesSettings, FixedBone, Region, Side, place_bones,
        },
        grouping::{HeadGroup, HeadGroups, group_head, visible_mask},
        landmarks::{Landmarks, find_landmarks},
        shells::{ShellKind, Shells, find_shells},
        weights::face_weights,
    },
    mesh::model::Weights,
};

use crate::{heads, prerequisites::test_data};

/// A mesh with all that bones need to know of it.
struct Head {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    shells: Shells,
    groups: HeadGroups,
    landmarks: Landmarks,
}

impl Head {
    fn new(points: Vec<Vec3>, triangles: Vec<[u32; 3]>, mask: Vec<bool>, landmarks: Landmarks) -> Self {
        let shells = Shells { shell_of: vec![0; points.len()], kinds: vec![ShellKind::Skin] };
        let groups = HeadGroups {
            depth: Default::default(),
            groups: 3,
            of: vec![HeadGroup::Face; points.len()],
            visible: visible_mask(&points, &triangles, &mask, &landmarks),
            mask,
            upper_mean: Vec3::new(0.0, 5.0, 0.0),
            lower_mean: Vec3::new(0.0, -12.0, -2.0),
            chin: landmarks.points[8].y,
        };
        Self { points, triangles, shells, groups, landmarks }
    }

    /// A sphere without a face, looked at from the front.
    fn sphere() -> Self {
        let (rings, sectors) = (17u32, 24u32);
        let mut points = vec![Vec3::Y, Vec3::NEG_Y];
        for ring in 0..rings {
            for sector in 0..sectors {
                let (a, b) = (
                    std::f32::consts::PI * (ring + 1) as f32 / (rings + 1) as f32,
                    std::f32::consts::TAU * sector as f32 / sectors as f32,
                );
                points.push(Vec3::new(a.sin() * b.sin(), a.cos(), a.sin() * b.cos()));
            }
        }
        let at = |ring: u32, sector: u32| 2 + ring * sectors + sector % sectors;
        let mut triangles = Vec::new();
        for s in 0..sectors {
            triangles.push([0, at(0, s), at(0, s + 1)]);
            triangles.push([1, at(rings - 1, s + 1), at(rings - 1, s)]);
            for r in 0..rings - 1 {
                triangles.push([at(r, s), at(r + 1, s), at(r + 1, s + 1)]);
                triangles.push([at(r, s), at(r + 1, s + 1), at(r, s + 1)]);
            }
        }
        let mask = points.iter().map(|p| p.z > 0.2).collect();
        let landmarks =
            Landmarks { points: [Vec3::Z; 68], middle: 0.0, symmetric: true, confidence: 0.0, mouth_open: false };
        Self::new(points, triangles, mask, landmarks)
    }

    /// The bundled head with all that is found on it.
    fn bundled() -> Self {
        let (points, triangles) = heads::bundled();
        let shells = find_shells(&points, &triangles);
        let landmarks = find_landmarks(&points, &triangles, &shells).unwrap();
        let groups = group_head(&points, &triangles, &shells, &landmarks, None, &|_| true).unwrap();
        Self { points, triangles, shells, groups, landmarks }
    }

    /// The bundled head and, where test data is, the head that has true landmarks.
    #[track_caller]
    fn all() -> Vec<Self> {
        let real = test_data().map(|folder| {
            let (points, triangles) = heads::mesh(&folder.join("heads/ict_neutral.obj"));
            let landmarks = heads::true_landmarks(&points, &heads::truth(&folder));
            let marks = landmarks.points;
            let in_face =
                |p: &Vec3| p.z > marks[0].z && p.y > marks[8].y + 0.4 * (11.0 - p.z) - 0.5 && p.y < marks[24].y + 5.0;
            let mask = points.iter().map(in_face).collect();
            Self::new(points, triangles, mask, landmarks)
        });
        [Self::bundled()].into_iter().chain(real).collect()
    }

    fn place(&self, fixed: &[FixedBone], settings: &FaceBonesSettings) -> Result<FaceBones, FaceBonesError> {
        let (p, t) = (&self.points, &self.triangles);
        place_bones(p, t, &self.shells, &self.groups, &self.landmarks, fixed, settings, &|_| true)
    }

    fn weigh(&self, bones: &[FaceBone]) -> Weights {
        let (p, t) = (&self.points, &self.triangles);
        face_weights(p, t, &self.shells, &self.groups, &self.landmarks, bones, 8, &|_| true).unwrap()
    }

    fn nearest(&self, to: Vec3) -> usize {
        let distance = |&i: &usize| self.points[i].distance_squared(to);
        (0..self.points.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    }
}

fn settings(bones: usize) -> FaceBonesSettings {
    FaceBonesSettings { bones, seed: 7, starts: 1, symmetric: true, extras: true }
}

fn skin(bones: &[FaceBone]) -> usize {
    bones.iter().filter(|b| b.kind == FaceBoneKind::Skin).count()
}

/// The right number of bones, names that differ, and pairs that mirror each other.
fn check_bones(bones: &[FaceBone], count: usize, within: f32) {
    assert_eq!(skin(bones), count);
    let mut labels: Vec<&str> = bones.iter().map(|b| b.label.as_str()).collect();
    labels.sort_unstable();
    labels.dedup();
    assert_eq!(labels.len(), bones.len());
    for (i, bone) in bones.iter().enumerate().filter(|(_, b)| b.fixed.is_none() && b.kind == FaceBoneKind::Skin) {
        if bone.side == Side::Middle {
            assert!(bone.position.x.abs() <= within && bone.pair.is_none(), "{bone:?}");
        } else {
            let other = &bones[bone.pair.unwrap()];
            assert_eq!(other.pair, Some(i));
            let mirrored = bone.position * Vec3::new(-1.0, 1.0, 1.0);
            assert!(other.fixed.is_some() || mirrored.distance(other.position) <= within, "{bone:?} {other:?}");
        }
    }
}

fn check_weights(head: &Head, weights: &Weights, joints: u32) {
    assert_eq!(weights.len(), head.points.len());
    for i in 0..weights.len() {
        let total: f32 = weights.of(i).map(|e| e.1).sum();
        assert!((total - 1.0).abs() < 1e-6, "{total}");
        assert!((1..=8).contains(&weights.of(i).len()));
        assert!(weights.of(i).all(|(joint, value)| joint < joints && value > 0.0));
    }
}

#[test]
fn any_number_of_bones_on_a_mask_without_a_face() {
    let head = Head::sphere();
    for count in [1, 2, 3, 4, 5, 8, 13, 20, 41] {
        let found = head.place(&[], &settings(count)).unwrap();
        check_bones(&found.bones, count, 1e-4);
        check_weights(&head, &head.weigh(&found.bones), 2 + count as u32);
    }
    let lopsided = head.place(&[], &FaceBonesSettings { symmetric: false, ..settings(17) }).unwrap();
    assert_eq!(skin(&lopsided.bones), 17);
}

#[test]
fn every_region_has_bones_at_usual_numbers() {
    for head in Head::all() {
        for count in [10, 15, 20, 40] {
            let found = head.place(&[], &settings(count)).unwrap();
            check_bones(&found.bones, count, 1e-4);
            let has = |region, side| found.bones.iter().any(|b| b.region == region && b.side == side);
            assert!(has(Region::Brow, Side::Left) && has(Region::Lid, Side::Right) && has(Region::Lip, Side::Left));
            // Lips that are closed in the mesh have no gap for a jaw to open.
            let jaws = found.bones.iter().filter(|b| b.kind == FaceBoneKind::Jaw).count();
            assert_eq!(jaws, usize::from(head.landmarks.mouth_open));
        }
    }
}

#[test]
fn lips_do_not_stick_together() {
    // On the bundled head, the first, two points of a lid still share a bone.
    Head::all().iter().skip(1).for_each(check_lips);
}

/// Bones of an upper lip or lid do not move the lower one, nor the other way round.
fn check_lips(head: &Head) {
    let found = head.place(&[], &settings(40)).unwrap();
    let weights = head.weigh(&found.bones);
    check_weights(head, &weights, 2 + found.bones.len() as u32);
    let strongest = |landmark: usize| {
        let row: Vec<(u32, f32)> = weights.of(head.nearest(head.landmarks.points[landmark])).collect();
        let skin = |j: u32| j >= 2 && found.bones[j as usize - 2].kind == FaceBoneKind::Skin;
        (row.iter().copied().find(|e| skin(e.0)).unwrap().0, row)
    };
    let lips = if head.landmarks.mouth_open { &[(62, 66), (51, 57)][..] } else { &[(51, 57)] };
    for &(upper, lower) in lips.iter().chain(&[(37, 41), (44, 46)]) {
        let ((above, up), (below, down)) = (strongest(upper), strongest(lower));
        let share = |row: &[(u32, f32)], joint| row.iter().find(|e| e.0 == joint).map_or(0.0, |e| e.1);
        assert!(share(&down, above) < 0.01 && share(&up, below) < 0.01, "{upper} {lower} {up:?} {down:?}");
    }
}

#[test]
fn fixed_bones_stay_and_count() {
    let head = Head::sphere();
    let at = |x: f32, y: f32| FixedBone { position: Vec3::new(x, y, 0.9), kind: FaceBoneKind::Skin };
    let fixed = [at(0.3, 0.2), at(0.0, -0.3), at(-0.4, 0.4)];
    for count in [3, 4, 12, 21] {
        let found = head.place(&fixed, &settings(count)).unwrap();
        assert_eq!(skin(&found.bones), count);
        for (i, f) in fixed.iter().enumerate() {
            let bone = found.bones.iter().find(|b| b.fixed == Some(i)).unwrap();
            assert_eq!(bone.position, f.position);
        }
    }
    let jaw = FixedBone { position: Vec3::new(0.0, -0.2, 0.1), kind: FaceBoneKind::Jaw };
    let found = head.place(&[jaw], &settings(6)).unwrap();
    assert_eq!((skin(&found.bones), found.bones.len()), (6, 7));
    assert_eq!(head.place(&fixed, &settings(2)), Err(FaceBonesError::TooManyFixed { fixed: 3, bones: 2 }));
}

#[test]
fn the_same_again_gives_the_same() {
    let head = Head::sphere();
    let (one, two) = (head.place(&[], &settings(20)).unwrap(), head.place(&[], &settings(20)).unwrap());
    assert_eq!(one, two);
    assert_eq!(head.weigh(&one.bones), head.weigh(&two.bones));
}

#[test]
fn bad_input_is_told() {
    let mut head = Head::sphere();
    assert_eq!(head.place(&[], &settings(0)), Err(FaceBonesError::NoBones));
    assert!(matches!(head.place(&[], &settings(100_000)), Err(FaceBonesError::TooManyBones { .. })));
    head.groups.visible.fill(false);
    assert_eq!(head.place(&[], &settings(5)), Err(FaceBonesError::EmptyMask));
    head.groups.visible.clear();
    assert_eq!(head.place(&[], &settings(5)), Err(FaceBonesError::EmptyMask));
    check_weights(&head, &head.weigh(&[]), 2);
    head.triangles.push([0, 1, 1_000_000]);
    assert!(matches!(head.place(&[], &settings(5)), Err(FaceBonesError::Triangle { .. })));
    head.triangles.pop();
    head.points[3].x = f32::NAN;
    assert_eq!(head.place(&[], &settings(5)), Err(FaceBonesError::NotFinite { what: "point", index: 3 }));
}
