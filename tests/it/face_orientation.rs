//! Orientation of heads: tilted and sheared ones, heads under hair on a body, closed lids and open jaws.

use glam::{Quat, Vec3, vec3};
use rigsmith::algo::face::{
    auto::{AutoSettings, FaceAnalysis},
    expression::{ExpressionSet, Mix, Sides, apply},
    head_part::head_part,
};

use crate::{
    face_units::true_shapes,
    heads::{Mesh, mesh, truth},
    prerequisites::test_data,
};

/// The face of a mesh about which nothing is told.
fn analysed((points, triangles): &Mesh) -> FaceAnalysis {
    FaceAnalysis::new(points, triangles, &AutoSettings::default(), &|_, _| true).unwrap()
}

/// Errors of the landmarks in percent of the eye distance, in the mesh's space.
fn errors(mesh: &Mesh, truth: &[usize]) -> (FaceAnalysis, Vec<f32>) {
    let analysis = analysed(mesh);
    let to_mesh = analysis.to_mesh();
    let eyes = mesh.0[truth[36]].distance(mesh.0[truth[45]]);
    let off = |(index, mark): (&usize, &Vec3)| 100.0 * (to_mesh * *mark).distance(mesh.0[*index]) / eyes;
    let errors = truth.iter().zip(&analysis.landmarks.points).map(off).collect();
    (analysis, errors)
}

fn mean(errors: &[f32]) -> f32 {
    errors.iter().sum::<f32>() / errors.len() as f32
}

#[test]
fn tilted_heads_have_axes_of_their_own() {
    let Some(folder) = test_data() else { return };
    let truth = truth(&folder);
    for name in ["ict_neutral", "ict_identity_3"] {
        let (points, triangles) = mesh(&folder.join(format!("heads/{name}.obj")));
        for (tilt, turn) in [(20.0f32, 0.0f32), (-15.0, 0.0), (0.0, 30.0), (10.0, 10.0), (15.0, -15.0)] {
            let rotation = Quat::from_rotation_y(turn.to_radians()) * Quat::from_rotation_z(tilt.to_radians());
            let turned: Mesh = (points.iter().map(|point| rotation * *point).collect(), triangles.clone());
            let (analysis, errors) = errors(&turned, &truth);
            let told = format!("{name} tilted by {tilt} and turned by {turn}");
            assert!(mean(&errors) < 4.0, "{told}: mean error {} %", mean(&errors));
            // The direction across the face: a head may nod.
            let left = analysis.axes.up.cross(analysis.axes.forward);
            let off = left.angle_between(rotation * Vec3::X).to_degrees();
            assert!(off < 5.0, "{told}: axes are off by {off} degrees");
        }
    }
}

#[test]
fn a_sheared_head_lies_on_its_back() {
    let Some(folder) = test_data() else { return };
    let truth = truth(&folder);
    for name in ["ict_neutral", "ict_identity_3"] {
        let (points, triangles) = mesh(&folder.join(format!("heads/{name}.obj")));
        let sheared = points.iter().map(|p| vec3(p.x + 0.08 * p.y, -p.z, p.y + 0.05 * p.x)).collect();
        let (analysis, errors) = errors(&(sheared, triangles), &truth);
        assert!(mean(&errors) < 7.0 && analysis.landmarks.confidence > 0.5, "{name}: mean error {} %", mean(&errors));
    }
}

/// Adds half of an ellipsoid as a part of its own.
fn add_dome((points, triangles): &mut Mesh, center: Vec3, radii: Vec3) {
    let (rings, around) = (8_u32, 24_u32);
    let first = points.len() as u32;
    for ring in 0..=rings {
        let (height, width) = (90.0_f32 * ring as f32 / rings as f32).to_radians().sin_cos();
        let turns = (0..around).map(|step| std::f32::consts::TAU * step as f32 / around as f32);
        points.extend(turns.map(|turn| center + radii * vec3(width * turn.sin(), height, width * turn.cos())));
    }
    for (ring, step) in (0..rings).flat_map(|ring| (0..around).map(move |step| (ring, step))) {
        let at = |ring: u32, step: u32| first + ring * around + step % around;
        let [a, b, c, d] = [at(ring, step), at(ring, step + 1), at(ring + 1, step + 1), at(ring + 1, step)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
}

fn bounds<'a>(points: impl Iterator<Item = &'a Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::MAX, Vec3::MIN), |(low, high), point| (low.min(*point), high.max(*point)))
}

#[test]
fn a_cap_is_not_the_whole_head_of_a_body() {
    let Some(folder) = test_data() else { return };
    let mut body = mesh(&folder.join("bodies/female_young/body.obj"));
    let bare = head_part(&body.0, &body.1).unwrap();
    let own: Vec<Vec3> = body.0.iter().zip(&bare.points).filter(|(_, own)| **own).map(|(point, _)| *point).collect();
    let (low, high) = bounds(own.iter());
    let brim = low.y + 0.6 * (high.y - low.y);
    let (low, high) = bounds(own.iter().filter(|point| point.y > brim));
    let center = ((low + high) / 2.0).with_y(brim);
    add_dome(&mut body, center, 1.12 * (high - center).max(center - low));
    let capped = head_part(&body.0, &body.1).unwrap();
    let kept = bare.points.iter().zip(&capped.points).filter(|(bare, capped)| **bare && **capped).count();
    assert!(capped.is_part && kept * 10 > own.len() * 9, "{kept} of {} points are left under a cap", own.len());
    let more = bare.points.iter().zip(&capped.points).filter(|(bare, capped)| !**bare && **capped).count();
    assert!(more * 4 < own.len(), "{more} points of the body are in the head");
}

#[test]
fn closed_lids_and_open_jaws() {
    let Some(folder) = test_data() else { return };
    let truth = truth(&folder);
    let shapes = true_shapes(&folder, "ict_expressions");
    for name in ["ict_neutral", "ict_identity_1"] {
        let (points, triangles) = mesh(&folder.join(format!("heads/{name}.obj")));
        let shown = |names: &[&str]| {
            let mut shown = points.clone();
            for (_, shape) in shapes.iter().filter(|(name, _)| names.contains(&name.as_str())) {
                shown.iter_mut().zip(shape).for_each(|(point, moved)| *point += *moved);
            }
            (shown, triangles.clone())
        };
        let (_, closed) = errors(&shown(&["eyeBlink_L", "eyeBlink_R"]), &truth);
        let lids = mean(&closed[36..48]);
        assert!(mean(&closed) < 4.0 && lids < 7.0, "{name}, closed eyes: {} %, lids {lids} %", mean(&closed));
        let (_, open) = errors(&shown(&["jawOpen"]), &truth);
        assert!(mean(&open) < 4.0, "{name}, open jaw: {} %", mean(&open));
        assert!(name != "ict_neutral" || open[8] < 9.0, "{name}, open jaw: the chin is off by {} %", open[8]);
    }
}

#[test]
fn expressions_of_a_tilted_head_are_tilted() {
    let Some(folder) = test_data() else { return };
    let (points, triangles) = mesh(&folder.join("heads/ict_identity_1.obj"));
    let tilt = Quat::from_rotation_z(15_f32.to_radians());
    let tilted: Mesh = (points.iter().map(|point| tilt * *point).collect(), triangles.clone());
    let upright = (points, triangles);
    let units = ExpressionSet::bundled().unit_set();
    let moved = |mesh: &Mesh, unit: &str| -> Vec<Vec3> {
        let analysis = analysed(mesh);
        let face = analysis.rig(&[], &AutoSettings::default(), ExpressionSet::bundled(), &|_, _| true).unwrap();
        let mut mix = Mix::rest(units);
        mix.add(unit, Sides::Both, 1.0, units);
        let pose = analysis.fitted(&face.bones, &face.weights, units).pose(&mix);
        let posed = apply(&analysis.points, &face.weights, &face.bones, &pose);
        posed.iter().zip(&analysis.points).map(|(posed, rest)| analysis.to_mesh() * (*posed - *rest)).collect()
    };
    for unit in ["mouth_smile", "jaw_open"] {
        let (plain, turned) = (moved(&upright, unit), moved(&tilted, unit));
        let square = plain.iter().map(|moved| moved.length_squared()).sum::<f32>();
        let off = plain.iter().zip(&turned).map(|(a, b)| (tilt * *a).distance_squared(*b)).sum::<f32>();
        let share = (off / square).sqrt();
        assert!(share < 0.1, "{unit}: {share} of the movement differs");
    }
}
