//! Birds: a trunk that hides hips and thighs, wings of other lengths and poses, drags, and faces that are missing.

use bevy::math::Vec3;
use rigsmith::{
    algo::fit_template::{FitSettings, FittedSkeleton, MeshAnalysis, refit_template},
    files::bundled_characters,
};

use super::{
    FittedFigure, all, fitted, labels, mean,
    true_joints::{Figure, template_joints},
};
use crate::random::Random;

const EAGLE: &str = "creatures/bird-eagle.glb";

fn eagle() -> Option<&'static FittedFigure> {
    all()?.iter().find(|fitted| fitted.figure.name == EAGLE)
}

/// Joints of the trunk, and those that it hides, in hundredths of the height. Before sections were taken on the plane of symmetry,
/// the hips were off by 12.5, the thighs by 7.9 and the knees by 6.5.
#[test]
fn hips_and_thighs_lie_in_the_trunk_of_a_bird() {
    let Some(eagle) = eagle() else { return };
    let bounds = [("hips", 5.7), ("chest", 2.8), ("tail", 2.4), ("thigh", 4.2), ("shin", 2.4), ("wing_1", 7.3)];
    let mut count = 0;
    for (_, label, off) in eagle.off() {
        let Some((_, bound)) = bounds.iter().find(|(start, _)| label.starts_with(start)) else { continue };
        println!("{label}: {off:.2}");
        assert!(off <= *bound, "{label}: {off}");
        count += 1;
    }
    assert_eq!(count, 9);
}

/// The furthest that a joint moves, in hundredths of the height.
fn moved(fit: &FittedSkeleton, whole: &FittedSkeleton) -> f32 {
    let pairs = fit.joints.iter().zip(&whole.joints);
    pairs.map(|(a, b)| 100.0 * a.position.distance(b.position) / whole.height).fold(0.0, f32::max)
}

/// The furthest that a joint of a figure moves where a tenth of its faces are missing, for each seed.
fn moved_by_missing(name: &str, seeds: &[u64]) -> Option<Vec<f32>> {
    let FittedFigure { figure, fit } = all()?.iter().find(|fitted| fitted.figure.name == name)?;
    let missed = |seed: &u64| {
        let mut random = Random(*seed);
        let left: Vec<[u32; 3]> = figure.triangles.iter().copied().filter(|_| random.unit() > 0.1).collect();
        let moved = moved(&fitted(&figure.points, &left, figure.template).unwrap(), fit);
        println!("{name}, {seed}: {} of {} faces, joints move by {moved:.2}", left.len(), figure.triangles.len());
        moved
    };
    Some(seeds.iter().map(missed).collect())
}

/// A tenth of the faces missing, six times: nothing moves, and 0.3 was asked for. While the faces on the other side did not tell
/// which ones are missing, shoulders moved by 5.6 and by 2.1 in two of the six, where a hole was closed along its other diagonal.
#[test]
fn a_bird_with_a_tenth_of_its_faces_missing() {
    let Some(most) = moved_by_missing(EAGLE, &[77, 1, 2, 3, 4, 5]) else { return };
    assert!(most.iter().all(|moved| *moved <= 0.05), "{most:?}");
}

/// Of sixteen such foxes one lacks the same face on both sides, and moves by 1.46; ten did while one side told nothing of the other.
#[test]
fn a_fox_with_a_tenth_of_its_faces_missing() {
    let seeds: Vec<u64> = (1..=15).chain([77]).collect();
    let Some(most) = moved_by_missing("creatures/fox-fox.glb", &seeds) else { return };
    assert!(most.iter().filter(|moved| **moved <= 0.05).count() >= 15, "{most:?}");
    assert!(most.iter().all(|moved| *moved <= 1.6), "{most:?}");
}

/// Mean distance of joints from their true places, in hundredths of the height, for the labels that are asked for.
fn mean_off(figure: &FittedFigure, fit: &FittedSkeleton, is_asked: &dyn Fn(&str) -> bool) -> f32 {
    let labels = labels(figure.figure.template);
    let off = |(label, place): &(String, Vec3)| {
        let at = labels.iter().position(|known| known == label).filter(|_| is_asked(label))?;
        Some(100.0 * fit.joints[at].position.distance(*place) / fit.height)
    };
    mean(figure.figure.truth.iter().filter_map(off))
}

/// Fit after a joint with the label is dragged to its true place.
fn dragged(figure: &FittedFigure, label: &str) -> FittedSkeleton {
    let FittedFigure { figure, fit } = figure;
    let rig = bundled_characters().into_iter().find(|rig| rig.about().name == figure.template).unwrap();
    let analysis = MeshAnalysis::new(&figure.points, &figure.triangles, None, &|_| true).unwrap();
    let at = labels(figure.template).iter().position(|known| known == label).unwrap();
    let place = figure.truth.iter().find(|(known, _)| known == label).unwrap().1;
    let settings = FitSettings { markers: vec![(at, place)], ..FitSettings::default() };
    refit_template(&analysis, &template_joints(&rig), &settings, fit).unwrap()
}

/// A drag of a shoulder or a wrist halves the error of its wing, as was asked for: the depth of the bones behind the leading edge is
/// one for all of them. While each joint followed by its distance alone, 58 and 62 % of the error were left.
#[test]
fn a_drag_of_one_joint_mends_its_wing() {
    let Some(eagle) = eagle() else { return };
    for label in ["wing_1_l", "wing_3_l"] {
        let again = dragged(eagle, label);
        let is_wing = |other: &str| other.starts_with("wing") && other.ends_with("_l");
        let (before, after) = (mean_off(eagle, &eagle.fit, &is_wing), mean_off(eagle, &again, &is_wing));
        println!("{label}: the wing is off by {after:.2}, before by {before:.2}");
        assert!(after < 0.5 * before, "{label}: {before} to {after}");
        // The other wing follows.
        let is_other = |other: &str| other.starts_with("wing") && other.ends_with("_r");
        let (before, after) = (mean_off(eagle, &eagle.fit, &is_other), mean_off(eagle, &again, &is_other));
        assert!(after < 0.5 * before, "{label}, the other wing: {before} to {after}");
    }
}

/// A drag along a trunk that lies tells little of the joints about it: hips that are put right leave 26 % of the error of their
/// neighbours in a dog and 62 % in an eagle, where 56 and 81 % were left while neighbours went along with them.
#[test]
fn a_drag_along_the_trunk_moves_the_hips_alone() {
    let Some(all) = all() else { return };
    let mut count = 0;
    for (name, most) in [("creatures/fox-dog.glb", 0.3), (EAGLE, 0.68)] {
        let Some(figure) = all.iter().find(|fitted| fitted.figure.name == name) else { continue };
        let again = dragged(figure, "hips");
        let is_near = |label: &str| {
            label == "hips"
                || label.starts_with("thigh")
                || if name == EAGLE {
                    label == "chest" || label == "tail"
                } else {
                    label == "spine_1" || label == "tail_1"
                }
        };
        let (before, after) = (mean_off(figure, &figure.fit, &is_near), mean_off(figure, &again, &is_near));
        println!("{name}: hips put right, their neighbours are off by {after:.2}, before by {before:.2}");
        assert!(after < most * before, "{name}: {before} to {after}");
        count += 1;
    }
    assert_eq!(count, 2);
}

/// Map of the points of a mesh.
type Map<'a> = &'a dyn Fn(Vec3) -> Vec3;

/// The eagle with its points and true joints where a map has them, fitted.
fn mapped(eagle: &FittedFigure, name: &str, map: Map<'_>) -> FittedFigure {
    let Figure { points, triangles, truth, .. } = &eagle.figure;
    let figure = Figure {
        name: name.to_owned(),
        points: points.iter().map(|point| map(*point)).collect(),
        triangles: triangles.clone(),
        template: eagle.figure.template,
        truth: truth.iter().map(|(label, place)| (label.clone(), map(*place))).collect(),
    };
    let fit = fitted(&figure.points, &figure.triangles, figure.template).unwrap();
    FittedFigure { figure, fit }
}

/// The place with the part of an eagle that is below its belly higher or lower by a factor.
fn with_legs(place: Vec3, share: f32) -> Vec3 {
    let below = (place.y - 0.42).min(0.0);
    Vec3::new(place.x, place.y - (1.0 - share) * below, place.z)
}

/// The place with the part of an eagle's wings beyond its trunk longer or shorter by a factor.
fn with_wings(place: Vec3, share: f32) -> Vec3 {
    let x = place.x.abs() - (1.0 - share) * (place.x.abs() - 0.25).max(0.0);
    Vec3::new(x.copysign(place.x), place.y, place.z)
}

/// The place with the trunk and the feet of an eagle wider by a factor.
fn with_width(place: Vec3, share: f32) -> Vec3 {
    let x = place.x.abs() + (share - 1.0) * place.x.abs().min(0.25);
    Vec3::new(x.copysign(place.x), place.y, place.z)
}

/// Eagles with shorter wings, a longer trunk, wings that are swept back, or a wide trunk, by a map of points and true joints. The
/// first two had their heads in the tail's feathers, off by 67 and 71; the next three were off by 8.3, 6.5 and 9.8. The wide ones
/// faced backwards, off by 100 and 106, while toes that lead out did not tell the front.
#[test]
fn birds_of_other_shapes_face_forward() {
    let Some(eagle) = eagle() else { return };
    let beyond = |x: f32| (x.abs() - 0.25).max(0.0);
    let cases: [(&str, Map<'_>, f32, f32); 7] = [
        ("very short wings", &|place| with_wings(place, 0.35), 9.8, 14.4),
        ("short wings", &|place| with_wings(place, 0.45), 7.6, 3.6),
        ("shorter wings", &|place| with_wings(place, 0.6), 6.9, 3.6),
        ("a long trunk", &|place| Vec3::new(place.x, place.y, 1.35 * place.z), 6.1, 5.3),
        ("swept wings", &|place| place - Vec3::Z * 0.4 * beyond(place.x), 8.6, 9.5),
        ("a wide trunk", &|place| with_width(place, 1.4), 8.2, 7.4),
        ("a very wide trunk", &|place| with_width(place, 1.8), 8.6, 4.0),
    ];
    for (name, map, most, most_of_tail) in cases {
        let other = mapped(eagle, name, map);
        let (body, tail) =
            (mean_off(&other, &other.fit, &|_| true), mean_off(&other, &other.fit, &|label| label == "tail"));
        println!("{name}: off by {body:.2}, the root of the tail by {tail:.2}");
        assert!(other.fit.forward.z > 0.9, "{name}: {}", other.fit.forward);
        assert!(body <= most, "{name}: {body}");
        assert!(tail <= most_of_tail, "{name}: {tail}");
    }
}

/// Of joints of birds of other shapes that are wrong by more than 5 nine in ten are doubtful (89 of 92 as measured), and of doubtful
/// ones half are wrong. In low legs flesh hides the hock, too, and hips and hocks that are off by 5.5 and 5.9 were not doubted.
#[test]
fn doubt_is_honest_in_birds_of_other_shapes() {
    let Some(eagle) = eagle() else { return };
    let cases: [(&str, Map<'_>); 11] = [
        ("very short wings", &|place| with_wings(place, 0.35)),
        ("short wings", &|place| with_wings(place, 0.45)),
        ("shorter wings", &|place| with_wings(place, 0.6)),
        ("a long trunk", &|place| Vec3::new(place.x, place.y, 1.35 * place.z)),
        ("a longer trunk", &|place| Vec3::new(place.x, place.y, 1.15 * place.z)),
        ("swept wings", &|place| place - Vec3::Z * 0.4 * (place.x.abs() - 0.25).max(0.0)),
        ("a stout trunk", &|place| place * Vec3::new(0.8, 1.15, 0.75)),
        ("low legs", &|place| with_legs(place, 0.6)),
        ("lower legs", &|place| with_legs(place, 0.8)),
        ("longer legs", &|place| with_legs(place, 1.4)),
        ("long legs", &|place| with_legs(place, 2.0)),
    ];
    let (mut wrong, mut told, mut doubtful) = (0, 0, 0);
    for (name, map) in cases {
        let other = mapped(eagle, name, map);
        for (at, label, off) in other.off() {
            let confidence = other.fit.joints[at].confidence;
            wrong += usize::from(off > 5.0);
            told += usize::from(off > 5.0 && confidence < 0.5);
            doubtful += usize::from(confidence < 0.5);
            let is_leg = label.starts_with("thigh") || label.starts_with("metatarsus");
            assert!(name != "low legs" || !is_leg || confidence < 0.5, "{label} is off by {off}, {confidence}");
        }
    }
    println!("of {wrong} wrong joints {told} are doubtful; of {doubtful} doubtful ones {told} are wrong");
    assert!(told as f32 >= 0.93 * wrong as f32, "{told} of {wrong}");
    assert!(told as f32 >= 0.5 * doubtful as f32, "{told} of {doubtful}");
}
