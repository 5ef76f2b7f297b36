//! Elbows and knees of fitted rigs: they are bent, and bend on, the way that a body can.

use std::{path::Path, sync::Arc};

use bevy::math::Vec3;
use rigsmith::{
    files::{RealDisk, bundled_characters, load_model},
    headless::Workbench,
    mesh::model::Model,
    plugins::fit::{FitRequest, FitTemplate, FitTemplates},
    rig::Rig,
};

use crate::prerequisites::{BODIES, test_data};

/// Hinge of a limb, without the ending of its side.
struct Hinge {
    above: &'static str,
    joint: &'static str,
    below: &'static str,
    /// Sign of the flexion about the joint's X axis.
    flexion: f32,
    /// Sign of the direction in which a straight limb flexes: 1 forwards, -1 backwards.
    forwards: f32,
}

const ARM: Hinge = Hinge { above: "upper_arm", joint: "forearm", below: "hand", flexion: 1.0, forwards: 1.0 };
const LEG: Hinge = Hinge { above: "thigh", joint: "shin", below: "foot", flexion: -1.0, forwards: -1.0 };
const FRONT_LEG: Hinge = Hinge { below: "carpus", ..ARM };
const HIND_LEG: Hinge = Hinge { below: "metatarsus", ..LEG };

/// Bend in degrees from which on it says more than the front of the body: the arm may point anywhere.
const BENT: f32 = 25.0;
/// Bend in degrees below which a limb counts as straight.
const STRAIGHT: f32 = 3.0;

/// Flexion axis of a hinge in the rig's space, and the limb's bones above and below it, of unit length.
fn hinge(rig: &Rig, hinge: &Hinge, side: &str) -> (Vec3, Vec3, Vec3) {
    let joint = |name: &str| {
        let label = format!("{name}_{side}");
        rig.find_label(&label).unwrap_or_else(|| panic!("no joint {label}"))
    };
    let [above, at, below] = [hinge.above, hinge.joint, hinge.below].map(joint);
    let axis = hinge.flexion * rig.rest_global(at).matrix3.x_axis.normalize();
    let upper = (rig.position(at) - rig.position(above)).normalize();
    let lower = (rig.position(below) - rig.position(at)).normalize();
    (axis, upper, lower)
}

#[track_caller]
fn check(name: &str, rig: &Rig, hinges: &[Hinge], forward: Vec3, is_symmetric: bool) {
    for of in hinges {
        let sides = ["l", "r"].map(|side| (side, hinge(rig, of, side)));
        for (side, (axis, upper, lower)) in sides {
            let label = format!("{name}: {}_{side}", of.joint);
            assert!(axis.dot(lower).abs() < 0.05, "{label}: the axis is not across the bone");
            // The limb bends about the axis already, in its sense.
            let bend = upper.angle_between(lower).to_degrees();
            if bend > STRAIGHT {
                let agreement = axis.dot(upper.cross(lower).normalize());
                assert!(agreement > 0.5, "{label} is bent the wrong way: {agreement} at {bend} degrees");
            }
            // By a right angle more, the forearm comes to the front and the shin to the back, towards the bone above.
            let flexed = axis.cross(lower);
            if bend < BENT {
                let ahead = of.forwards * flexed.dot(forward);
                assert!(ahead > 0.5, "{label} flexes to {flexed}, {ahead}");
            } else {
                assert!(flexed.dot(-upper) > 0.0, "{label} flexes away from the bone above, to {flexed}");
            }
        }
        // A rotation's axis is mirrored with its sense.
        let [(_, (left, ..)), (_, (right, ..))] = sides;
        let mirrored = Vec3::new(left.x, -left.y, -left.z);
        if is_symmetric {
            assert!(right.dot(mirrored) > 0.99, "{name}: {}: {left} and {right} are no pair", of.joint);
        }
    }
}

fn character(name: &str) -> Arc<Rig> {
    bundled_characters().into_iter().find(|rig| rig.about().name == name).unwrap()
}

/// Fits the template whose limbs the mesh shows, and checks its hinges.
#[track_caller]
fn check_fit(path: &Path, template: &str, hinges: &[Hinge]) {
    check_model(load_model(&RealDisk, path).unwrap(), path, template, hinges);
}

#[track_caller]
fn check_model(model: Model, path: &Path, template: &str, hinges: &[Hinge]) {
    let mut bench = Workbench::new(7, "hinges");
    bench.open(model, true).unwrap();
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    let ask = |request: &mut FitRequest| request.template = FitTemplate::Choose;
    let report = bench.fit(ask, &mut |_| ()).unwrap();
    assert_eq!(report.template, template, "{}: {}", path.display(), report.choice);
    check(&path.display().to_string(), bench.rig(), hinges, report.fit.forward, report.fit.is_symmetric());
}

#[test]
fn templates_bend_as_bodies_do() {
    check("biped", &character("biped"), &[ARM, LEG], Vec3::Z, true);
    check("quadruped", &character("quadruped"), &[FRONT_LEG, HIND_LEG], Vec3::Z, true);
}

#[test]
fn the_bundled_body_bends_as_bodies_do() {
    check_fit(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj"), "biped", &[ARM, LEG]);
}

#[test]
fn fitted_bodies_bend_as_bodies_do() {
    let Some(data) = test_data() else { return };
    for name in BODIES {
        check_fit(&data.join("bodies").join(name).join("body.obj"), "biped", &[ARM, LEG]);
    }
}

/// Figures of other makers, in armour and with short limbs; the bends of stout limbs are within their thickness.
const CHARACTERS: [&str; 3] = ["characters/Mage.glb", "gltf_skinned/CesiumMan.glb", "gltf_skinned/RobotExpressive.glb"];

#[test]
fn fitted_characters_bend_as_bodies_do() {
    let Some(data) = test_data() else { return };
    for name in CHARACTERS {
        check_fit(&data.join(name), "biped", &[ARM, LEG]);
    }
}

/// The same figures stouter, thinner, and with shorter and longer legs.
#[test]
fn figures_of_other_builds_bend_as_bodies_do() {
    let Some(data) = test_data() else { return };
    // Factors of what is across the height, and of the legs' length.
    let builds = [("stout", 1.25, 1.0), ("thin", 0.8, 1.0), ("short legs", 1.0, 0.65), ("long legs", 1.0, 1.35)];
    for (name, hip) in [("characters/Mage.glb", 0.17), ("gltf_skinned/CesiumMan.glb", 0.35)] {
        let whole = load_model(&RealDisk, &data.join(name)).unwrap();
        let gear = whole.gear();
        for (build, wide, long) in builds {
            let mut model = whole.at_rest();
            // Without its skins, gear is no longer known as such.
            model.parts.retain(|part| !gear.contains(&part.object));
            model.weights = None;
            let used = model.point_triangles().into_iter().flatten().map(|corner| model.points[corner as usize].y);
            let (low, high) = used.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)));
            let hip = low + hip * (high - low);
            let of = |point: Vec3| {
                let y = if point.y < hip { hip + (point.y - hip) * long } else { point.y };
                Vec3::new(point.x * wide, y, point.z * wide)
            };
            model.points.iter_mut().for_each(|point| *point = of(*point));
            println!("{name}, {build}");
            check_model(model, &data.join(name), "biped", &[ARM, LEG]);
        }
    }
}

/// A dog that is as wide as a lying figure is still one that stands on four legs.
#[test]
fn a_wide_dog_gets_the_template_of_an_animal() {
    let Some(data) = test_data() else { return };
    let mut model = load_model(&RealDisk, &data.join("creatures/fox-dog.glb")).unwrap().at_rest();
    model.weights = None;
    model.points.iter_mut().for_each(|point| *point *= Vec3::new(1.25, 1.0, 1.25));
    let mut bench = Workbench::new(7, "dog");
    bench.open(model, true).unwrap();
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    let report = bench.fit(|request: &mut FitRequest| request.template = FitTemplate::Choose, &mut |_| ()).unwrap();
    assert_eq!(report.template, "quadruped", "{}", report.choice);
}

#[test]
fn fitted_animals_bend_as_animals_do() {
    let Some(data) = test_data() else { return };
    for name in ["fox-fox.glb", "fox-dog.glb"] {
        check_fit(&data.join("creatures").join(name), "quadruped", &[FRONT_LEG, HIND_LEG]);
    }
}
