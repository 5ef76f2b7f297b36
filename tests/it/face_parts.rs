//! Parts of a head beside its skin: eyes, lids over them, teeth, tongue, brows and hair that are meshes of their own.

use glam::Vec3;
use rigsmith::algo::face::{
    auto::{AutoFace, AutoSettings, FaceAnalysis},
    bones::{FaceBoneKind, Side},
    expression::{ExpressionSet, Eyeball, FittedFace, Mix, Sides, apply},
    shells::ShellKind,
};

use crate::{heads, prerequisites::test_data};

/// A mesh with a face.
struct Rigged {
    analysis: FaceAnalysis,
    face: AutoFace,
}

impl Rigged {
    fn new((points, triangles): &heads::Mesh) -> Self {
        let settings = AutoSettings { bones: 40, up: Some(Vec3::Y), forward: Some(Vec3::Z), ..AutoSettings::default() };
        let analysis = FaceAnalysis::new(points, triangles, &settings, &|_, _| true).unwrap();
        let face = analysis.rig(&[], &settings, ExpressionSet::bundled(), &|_, _| true).unwrap();
        Self { analysis, face }
    }

    /// A body of the test data with its eyes, teeth and tongue.
    #[track_caller]
    fn full_body() -> Option<(heads::Mesh, Self)> {
        let mesh = heads::mesh(&test_data()?.join("bodies/female_young/full.obj"));
        let rigged = Self::new(&mesh);
        Some((mesh, rigged))
    }

    /// The index in the analysis of a point of the mesh.
    fn at(&self, point: usize) -> usize {
        (0..self.analysis.points.len()).find(|own| self.analysis.mesh_point(*own) == point).unwrap()
    }

    /// Weight of the bones of a kind, on one side if there is one, at a point of the mesh.
    fn weight(&self, point: usize, kind: FaceBoneKind, side: Option<Side>) -> f32 {
        let is = |joint: u32| {
            let bone = (joint as usize).checked_sub(2).map(|bone| &self.face.bones[bone]);
            bone.is_some_and(|bone| bone.kind == kind && side.is_none_or(|side| bone.side == side))
        };
        self.face.weights.of(self.at(point)).filter(|(joint, _)| is(*joint)).map(|(_, weight)| weight).sum()
    }

    fn fitted(&self, eyeballs: bool) -> FittedFace {
        let units = ExpressionSet::bundled().unit_set();
        let Self { analysis, face } = self;
        match eyeballs {
            true => analysis.fitted(&face.bones, &face.weights, units),
            false => analysis.fitted(&face.bones, &face.weights, units).with_eyeballs(&[]),
        }
    }

    /// The points of the analysis with a unit at some strength.
    fn posed(&self, fitted: &FittedFace, unit: &str, strength: f32) -> Vec<Vec3> {
        let units = ExpressionSet::bundled().unit_set();
        let mut mix = Mix::rest(units);
        assert!(mix.add(unit, Sides::Both, strength, units), "{unit}");
        apply(&self.analysis.points, &self.face.weights, &self.face.bones, &fitted.pose(&mix))
    }

    /// Points of the lids of an eyeball: skin near it and in front, which bones of skin move.
    fn lids(&self, ball: &Eyeball) -> Vec<usize> {
        let of_skin = |point: usize| {
            let own = self.face.weights.of(point).filter(|(joint, _)| {
                let bone = (*joint as usize).checked_sub(2).map(|bone| &self.face.bones[bone]);
                bone.is_some_and(|bone| bone.kind == FaceBoneKind::Skin)
            });
            own.map(|(_, weight)| weight).sum::<f32>() > 0.4
        };
        let near = |point: &usize| {
            let at = self.analysis.points[*point];
            at.distance(ball.center) < 1.3 * ball.radius && at.z > ball.center.z && of_skin(*point)
        };
        (0..self.analysis.points.len()).filter(near).collect()
    }

    /// Largest depth, in radii, by which a blink sinks a lid into an eyeball, beyond its depth at rest.
    fn sinks(&self, eyeballs: bool) -> f32 {
        let fitted = self.fitted(eyeballs);
        let balls = self.analysis.eyeballs();
        assert_eq!(balls.len(), 2);
        let mut deepest = 0.0_f32;
        for strength in [0.25, 0.5, 0.75, 1.0] {
            let posed = self.posed(&fitted, "eye_blink", strength);
            for ball in &balls {
                let lids = self.lids(ball);
                assert!(lids.len() > 20, "{} points of lids", lids.len());
                for point in lids {
                    let far = |points: &[Vec3]| points[point].distance(ball.center) / ball.radius;
                    deepest = deepest.max(far(&self.analysis.points).min(1.0) - far(&posed));
                }
            }
        }
        deepest
    }
}

#[test]
fn eyes_teeth_and_tongue_follow_their_bones() {
    let Some((mesh, rigged)) = Rigged::full_body() else { return };
    let middle = rigged.analysis.landmarks.middle;
    for eye in [13606..13678, 13678..13750] {
        let side = if mesh.0[eye.start].x > middle { Side::Left } else { Side::Right };
        for point in eye {
            assert!(rigged.weight(point, FaceBoneKind::Eye, Some(side)) > 0.999, "point {point} of {side:?}");
        }
    }
    let height = |range: std::ops::Range<usize>| range.map(|point| mesh.0[point].y).sum::<f32>();
    let (one, other) = (13750..13818, 13818..13886);
    let (upper, lower) = if height(one.clone()) > height(other.clone()) { (one, other) } else { (other, one) };
    for point in upper {
        assert_eq!(rigged.weight(point, FaceBoneKind::Jaw, None), 0.0, "upper tooth {point}");
    }
    for point in lower.chain(13380..13606) {
        let jaw = rigged.weight(point, FaceBoneKind::Jaw, None);
        assert!(jaw >= 0.95, "point {point} of lower teeth or tongue follows the jaw by {jaw}");
    }
}

#[test]
fn eyes_turn_about_their_centres() {
    for (name, mesh) in heads::bundled_and("ict_neutral") {
        let rigged = Rigged::new(&mesh);
        let posed = rigged.posed(&rigged.fitted(true), "eye_look_out", 1.0);
        let mut turned = 0;
        for (ball, kind) in rigged.analysis.eyeballs().iter().zip([ShellKind::LeftEye, ShellKind::RightEye]) {
            for (point, rest) in rigged.analysis.points.iter().enumerate() {
                if rigged.analysis.shells.kind(point) != kind {
                    continue;
                }
                let [before, after] = [*rest, posed[point]].map(|at| at.distance(ball.center));
                assert!((before - after).abs() < 1e-3 * ball.radius, "{name}: {before} {after}");
                turned += usize::from(rest.distance(posed[point]) > 0.2 * ball.radius);
            }
        }
        assert!(turned > 100, "{name}: {turned} points of eyes turn");
    }
}

/// Lids slide over the eyeballs. A tenth above what was measured.
#[test]
fn a_blink_does_not_sink_into_the_eyes() {
    let mut all = heads::bundled_and("ict_neutral");
    all.extend(test_data().map(|data| ("a body".to_owned(), heads::mesh(&data.join("bodies/female_young/full.obj")))));
    for (name, mesh) in all {
        let rigged = Rigged::new(&mesh);
        let (with, without) = (rigged.sinks(true), rigged.sinks(false));
        println!("{name}: lids sink {with:.4} radii, without eyeballs {without:.4}");
        assert!(with < 0.02, "{name}: {with}");
    }
}

/// The triangles of a mesh that `is_part` takes, again as a part of its own that lies `away` outside of the first one.
fn doubled((points, triangles): &heads::Mesh, is_part: impl Fn(Vec3) -> bool, away: f32) -> (heads::Mesh, usize) {
    let mut normals = vec![Vec3::ZERO; points.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        corners.iter().for_each(|corner| normals[*corner as usize] += (b - a).cross(c - a));
    }
    let (mut all, mut faces) = (points.clone(), triangles.clone());
    let mut copy_of = vec![u32::MAX; points.len()];
    for corners in triangles.iter().filter(|corners| corners.iter().all(|corner| is_part(points[*corner as usize]))) {
        faces.push(corners.map(|corner| {
            let copy = &mut copy_of[corner as usize];
            if *copy == u32::MAX {
                *copy = all.len() as u32;
                all.push(points[corner as usize] + normals[corner as usize].normalize_or_zero() * away);
            }
            *copy
        }));
    }
    let count = all.len() - points.len();
    ((all, faces), count)
}

/// Largest distance of the landmarks of two heads, in eye distances.
fn landmarks_differ(a: &FaceAnalysis, b: &FaceAnalysis) -> f32 {
    let pairs = a.landmarks.points.iter().zip(&b.landmarks.points);
    pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f32::max) / a.landmarks.eye_distance()
}

#[test]
fn brows_and_hair_of_their_own_ride_along() {
    let Some(folder) = test_data() else { return };
    let plain = heads::mesh(&folder.join("heads/ict_neutral.obj"));
    // The skin of the face alone, so that nothing inside is doubled.
    let skin =
        (plain.0[..9409].to_vec(), plain.1.clone().into_iter().filter(|t| t.iter().all(|c| *c < 9409)).collect());
    let bare = Rigged::new(&skin);
    let landmarks = &bare.analysis.landmarks;
    let e = landmarks.eye_distance();
    let near_brow = |at: Vec3| (17..27).any(|mark: usize| landmarks.points[mark].distance(at) < 0.09 * e);
    let (with_brows, brows) = doubled(&skin, near_brow, 0.02 * e);
    assert!(brows > 40, "{brows} points of brows");
    let highest = landmarks.points[17..27].iter().map(|mark| mark.y).fold(f32::MIN, f32::max);
    let ears = landmarks.points[0].z;
    let on_scalp = |at: Vec3| at.y > highest + 0.5 * e || (at.z < ears - 0.3 * e && at.y > highest - 0.5 * e);
    let (mesh, hair) = doubled(&with_brows, on_scalp, 0.06 * e);
    assert!(hair > 200, "{hair} points of hair");
    let rigged = Rigged::new(&mesh);
    assert!(rigged.analysis.part.is_none());
    let differ = landmarks_differ(&bare.analysis, &rigged.analysis);
    println!("landmarks differ by {differ}");
    assert!(differ < 0.02, "landmarks move by {differ}");
    let (first, last) = (skin.0.len(), mesh.0.len());
    for point in first..last {
        assert_eq!(rigged.analysis.shells.kind(point), ShellKind::Cover, "point {point}");
        assert!(!rigged.analysis.groups.mask[point]);
    }
    let raised = rigged.posed(&rigged.fitted(true), "brow_outer_up", 1.0);
    let rest = &rigged.analysis.points;
    // Hair stays with the skull.
    for point in first + brows..last {
        assert!(raised[point].distance(rest[point]) < 0.002 * e, "hair at {} moves", rest[point]);
    }
    let moves = (first..first + brows).map(|point| raised[point].distance(rest[point])).fold(0.0, f32::max);
    assert!(moves > 0.04 * e, "brows move by {moves}");
    for point in first..first + brows {
        let near = (0..first).min_by(|a, b| rest[*a].distance(rest[point]).total_cmp(&rest[*b].distance(rest[point])));
        let skin = near.unwrap();
        let apart = (raised[point] - rest[point]).distance(raised[skin] - rest[skin]);
        assert!(apart < 1e-3 * e, "a brow leaves the skin by {apart}");
    }
}

#[test]
fn a_body_with_hair_keeps_its_head() {
    let Some((mesh, bare)) = Rigged::full_body() else { return };
    let landmarks = &bare.analysis.landmarks;
    let e = landmarks.eye_distance();
    let highest = landmarks.points[17..27].iter().map(|mark| mark.y).fold(f32::MIN, f32::max);
    let body = 13380;
    let skin = (mesh.0.clone(), mesh.1.iter().filter(|t| t.iter().all(|c| *c < body)).copied().collect());
    let (capped, hair) = doubled(&skin, |at| at.y > highest + 0.35 * e, 0.15 * e);
    assert!(hair > 30, "{hair} points of hair");
    let mut faces = mesh.1.clone();
    faces.extend_from_slice(&capped.1[skin.1.len()..]);
    let rigged = Rigged::new(&(capped.0, faces));
    let (before, after) = (bare.analysis.points.len(), rigged.analysis.points.len());
    println!("{before} points of the head, {hair} of hair, {after} together");
    assert_eq!(after, before + hair, "the head, and all of the hair");
    assert!(landmarks_differ(&bare.analysis, &rigged.analysis) < 0.02);
    for point in mesh.0.len()..mesh.0.len() + hair {
        let own = rigged.face.weights.of(rigged.at(point)).filter(|(joint, _)| *joint < 2).map(|(_, weight)| weight);
        assert!(own.sum::<f32>() > 0.999, "point {point} of the hair follows the head");
    }
}
