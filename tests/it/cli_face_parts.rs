//! Heads of several parts on the command line: eyes, teeth, tongue, brows and hair, read back from the written file.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use glam::Vec3;
use rigsmith::{
    algo::face::auto::{AutoSettings, FaceAnalysis},
    files::{RealDisk, load_model},
};

use crate::{cli_build::rigsmith, face_arkit::skinned, heads, prerequisites::test_data};

/// A point at rest and posed.
type Moved = [Vec3; 2];

/// Points of the written character by object.
fn posed(mesh: &Path, expressions: &[&str]) -> BTreeMap<String, Vec<Moved>> {
    let folder = tempfile::tempdir().unwrap();
    let exports = std::env::var_os("RIGSMITH_EXPORTS").map(PathBuf::from);
    // Tests run side by side, and each reads its own file.
    let name = format!("{}_{}.glb", mesh.file_stem().unwrap().display(), expressions.join("_").replace('=', "_"));
    let glb = exports.unwrap_or_else(|| folder.path().to_owned()).join(name);
    let (mesh, glb) = (mesh.display().to_string(), glb.display().to_string());
    let mut args = vec!["face", &mesh, "-o", &glb];
    args.extend(expressions.iter().flat_map(|expression| ["--expression", *expression]));
    let answer = rigsmith(folder.path(), &args);
    assert_eq!(answer.code, 0, "{}", answer.err);
    let model = load_model(&RealDisk, Path::new(&glb)).unwrap();
    let moved = skinned(&model);
    let mut objects: BTreeMap<String, Vec<Moved>> = BTreeMap::new();
    for part in &model.parts {
        let points = part.vertices.iter().map(|point| [model.points[*point as usize], moved[*point as usize]]);
        objects.entry(model.objects[part.object].name.clone()).or_default().extend(points);
    }
    objects
}

fn furthest(points: &[Moved]) -> f32 {
    points.iter().map(|[rest, moved]| rest.distance(*moved)).fold(0.0, f32::max)
}

/// Largest change of the distance of two points.
fn bent(points: &[Moved]) -> f32 {
    let anchors: Vec<&Moved> = points.iter().step_by(points.len() / 8 + 1).collect();
    let change = |point: &Moved, anchor: &Moved| (point[0].distance(anchor[0]) - point[1].distance(anchor[1])).abs();
    points.iter().flat_map(|point| anchors.iter().map(|anchor| change(point, anchor))).fold(0.0, f32::max)
}

#[test]
fn eyes_teeth_and_tongue_are_stiff() {
    let Some(data) = test_data() else { return };
    let objects = posed(&data.join("bodies/female_young/full.obj"), &["jawOpen=1", "eyeLookUpLeft=1"]);
    let [left, right, upper, lower, tongue] =
        ["helper-l-eye", "helper-r-eye", "helper-upper-teeth", "helper-lower-teeth", "helper-tongue"]
            .map(|name| objects.get(name).unwrap_or_else(|| panic!("no object {name} in {:?}", objects.keys())));
    // In metres.
    for (name, points) in [("eye", left), ("upper teeth", upper), ("lower teeth", lower), ("tongue", tongue)] {
        println!("{name}: moves {:.5}, bent {:.6}", furthest(points), bent(points));
        assert!(bent(points) < 2e-5, "{name} is bent by {}", bent(points));
    }
    for (name, points) in [("the other eye", right), ("upper teeth", upper)] {
        assert!(furthest(points) < 2e-5, "{name} moves by {}", furthest(points));
    }
    for (name, points) in [("lower teeth", lower), ("tongue", tongue)] {
        assert!(furthest(points) > 0.005, "{name} moves by {}", furthest(points));
    }
    let middle = |at: usize| left.iter().map(|point| point[at]).sum::<Vec3>() / left.len() as f32;
    let shift = middle(0).distance(middle(1));
    assert!(furthest(left) > 0.002 && shift < 0.5 * furthest(left), "the eye turns: {} {shift}", furthest(left));
}

/// Largest difference of the posed points of an object.
fn apart(one: &[Moved], other: &[Moved]) -> f32 {
    one.iter().zip(other).map(|(a, b)| a[1].distance(b[1])).fold(0.0, f32::max)
}

/// The tongue is told by its name, and without names by its shape and place, and comes out with the jaw below it.
#[test]
fn a_tongue_comes_out_of_an_open_mouth() {
    let Some(data) = test_data() else { return };
    let named = data.join("bodies/female_young/full.obj");
    let folder = tempfile::tempdir().unwrap();
    let unnamed = folder.path().join("unnamed.obj");
    let mut text = fs::read_to_string(&named).unwrap();
    for (number, name) in ["l-eye", "r-eye", "upper-teeth", "lower-teeth", "tongue"].iter().enumerate() {
        text = text.replace(&format!("helper-{name}"), &format!("piece-{number}"));
    }
    fs::write(&unnamed, text).unwrap();
    for (mesh, tongue) in [(&named, "helper-tongue"), (&unnamed, "piece-4")] {
        let (open, out) = (posed(mesh, &["jawOpen=1"]), posed(mesh, &["jawOpen=1", "tongueOut=1"]));
        let tip = |objects: &BTreeMap<String, Vec<Moved>>| {
            objects[tongue].iter().max_by(|a, b| a[0].z.total_cmp(&b[0].z)).map(|[_, moved]| *moved).unwrap()
        };
        let moved = tip(&out) - tip(&open);
        println!("{tongue}: the tip moves by {moved}");
        // In metres.
        assert!(moved.z > 0.02 && moved.y < 0.0 && moved.x.abs() < 1e-3, "{tongue} moves by {moved}");
        for (name, points) in out.iter().filter(|(name, _)| *name != tongue) {
            let most = apart(points, &open[name]);
            assert!(most < 1e-4, "{name} moves by {most} with the tongue");
        }
    }
}

/// The tongue comes between the teeth in the viseme of th, further than the jaw carries it.
#[test]
fn th_brings_the_tongue_to_the_front() {
    let Some(data) = test_data() else { return };
    let mesh = data.join("bodies/female_young/full.obj");
    let tip = |expression: &str| {
        let objects = posed(&mesh, &[expression]);
        objects["helper-tongue"].iter().max_by(|a, b| a[0].z.total_cmp(&b[0].z)).map(|[_, moved]| *moved).unwrap()
    };
    let (between, behind) = (tip("viseme_th=1"), tip("viseme_kk=1"));
    println!("the tip of th is {} before that of kk", between - behind);
    // In metres.
    assert!(between.z - behind.z > 0.005, "{between} {behind}");
}

#[test]
fn a_face_with_a_tongue_has_all_shapes_of_arkit() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (mesh, glb) = (data.join("bodies/female_young/full.obj"), folder.path().join("tongue.glb"));
    let (mesh, file) = (mesh.display().to_string(), glb.display().to_string());
    let answer = rigsmith(folder.path(), &["face", &mesh, "--arkit", "-o", &file, "--json"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    assert_eq!(answer.json()["arkit"].as_array().unwrap().len(), 52);
    assert_eq!(answer.json()["arkit_left_out"], serde_json::json!([]));
    let model = load_model(&RealDisk, &glb).unwrap();
    assert!(model.clips.iter().any(|clip| clip.name == "tongueOut"));
    let mut furthest: BTreeMap<&str, f32> = BTreeMap::new();
    for part in &model.parts {
        let object = &model.objects[part.object];
        let Some(number) = object.morph_names.iter().position(|name| name == "tongueOut") else { continue };
        let most = part.morphs[number].positions.iter().map(|offset| offset.length()).fold(0.0, f32::max);
        let known = furthest.entry(&object.name).or_default();
        *known = known.max(most);
    }
    let tongue = furthest.remove("helper-tongue");
    assert!(tongue.is_some_and(|most| most > 0.02), "the tongue moves by {tongue:?}");
    assert!(furthest.values().all(|most| *most < 1e-5), "{furthest:?}");
}

/// A copy of the triangles whose corners are all kept, with its points moved, as an object of an OBJ file.
fn object(
    text: &mut String,
    name: &str,
    (points, triangles): &heads::Mesh,
    first: &mut usize,
    place: impl Fn(Vec3) -> Option<Vec3>,
) {
    writeln!(text, "o {name}").unwrap();
    let mut numbers: BTreeMap<u32, usize> = BTreeMap::new();
    let mut faces = String::new();
    for corners in triangles {
        if corners.iter().any(|corner| place(points[*corner as usize]).is_none()) {
            continue;
        }
        faces.push('f');
        for corner in corners {
            let number = *numbers.entry(*corner).or_insert_with(|| {
                let at = place(points[*corner as usize]).unwrap();
                writeln!(text, "v {} {} {}", at.x, at.y, at.z).unwrap();
                *first += 1;
                *first
            });
            write!(faces, " {number}").unwrap();
        }
        faces.push('\n');
    }
    text.push_str(&faces);
}

/// Largest difference between the ways of some points and of the skin nearest to them.
fn off_skin(points: &[Moved], skin: &[Moved]) -> f32 {
    let off = |point: &Moved| {
        let nearest =
            skin.iter().min_by(|a, b| a[0].distance_squared(point[0]).total_cmp(&b[0].distance_squared(point[0])));
        let below = nearest.map_or(Vec3::ZERO, |[rest, moved]| *moved - *rest);
        (point[1] - point[0]).distance(below)
    };
    points.iter().map(off).fold(0.0, f32::max)
}

/// Brows and hair that are meshes of their own move as the skin under them does, and hair does not turn the head over.
#[test]
fn brows_and_hair_ride_along() {
    let mesh = heads::bundled();
    let analysis = FaceAnalysis::new(&mesh.0, &mesh.1, &AutoSettings::default(), &|_, _| true).unwrap();
    let (eyes, marks) = (analysis.landmarks.eye_distance(), &analysis.landmarks.points);
    let center = mesh.0.iter().sum::<Vec3>() / mesh.0.len() as f32;
    let brow = |point: Vec3| {
        let away = marks[17..27].iter().map(|mark| mark.truncate().distance(point.truncate())).fold(f32::MAX, f32::min);
        (away < 0.06 * eyes && point.z > marks[36].z - 0.1 * eyes).then(|| point + 0.012 * eyes * Vec3::Z)
    };
    let hair = |point: Vec3| {
        let is_top = point.y > marks[19].y.max(marks[24].y) + 0.45 * eyes;
        let is_back = point.z < marks[0].z - 0.2 * eyes && point.y > marks[30].y;
        (is_top || is_back).then(|| point + 0.06 * eyes * (point - center).normalize_or_zero())
    };
    let (mut text, mut first) = (String::new(), 0);
    object(&mut text, "head", &mesh, &mut first, Some);
    object(&mut text, "brows", &mesh, &mut first, brow);
    object(&mut text, "hair", &mesh, &mut first, hair);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("dressed.obj");
    fs::write(&file, text).unwrap();
    let objects = posed(&file, &["surprise=1"]);
    let head = &objects["head"];
    for (name, least, most) in [("brows", 0.05, 0.03), ("hair", 0.0, 0.06)] {
        let points = &objects[name];
        assert!(points.len() > 100, "{name} has {} points", points.len());
        let worst = off_skin(points, head) / eyes;
        let moved = furthest(points) / eyes;
        println!("{name}: moves {moved:.3} eye distances, {worst:.3} off the skin");
        assert!(moved >= least && worst <= most, "{name}: moves {moved}, {worst} off the skin");
    }
}

/// Triangles as shells of their own, smaller than they were, as an object of an OBJ file.
fn strands(
    text: &mut String,
    name: &str,
    (points, triangles): &heads::Mesh,
    first: &mut usize,
    is_kept: impl Fn(Vec3) -> bool,
) {
    writeln!(text, "o {name}").unwrap();
    for corners in triangles {
        let places = corners.map(|corner| points[corner as usize]);
        if !places.iter().all(|place| is_kept(*place)) {
            continue;
        }
        let middle = places.iter().sum::<Vec3>() / 3.0;
        for place in places {
            let at = place.lerp(middle, 0.2);
            writeln!(text, "v {} {} {}", at.x, at.y, at.z).unwrap();
        }
        writeln!(text, "f {} {} {}", *first + 1, *first + 2, *first + 3).unwrap();
        *first += 3;
    }
}

/// Moustaches and strands of beards that are meshes of their own move as the skin under them does, although they are beside
/// the lips, where teeth belong to the jaw or to the skull.
#[test]
fn hair_on_the_face_rides_along() {
    let mesh = heads::bundled();
    let analysis = FaceAnalysis::new(&mesh.0, &mesh.1, &AutoSettings::default(), &|_, _| true).unwrap();
    let (eyes, marks) = (analysis.landmarks.eye_distance(), &analysis.landmarks.points);
    let moustache = |point: Vec3| {
        let is_high = point.y > marks[51].y + 0.02 * eyes && point.y < marks[33].y - 0.02 * eyes;
        let is_on_lip = is_high && (point.x - marks[51].x).abs() < 0.15 * eyes && point.z > marks[48].z;
        is_on_lip.then(|| point + 0.01 * eyes * Vec3::Z)
    };
    let chin = 0.5 * (marks[57] + marks[8]);
    let beard = |point: Vec3| point.distance(chin) < 0.15 * eyes && point.y < marks[57].y && point.z > marks[48].z;
    let (mut text, mut first) = (String::new(), 0);
    object(&mut text, "head", &mesh, &mut first, Some);
    object(&mut text, "moustache", &mesh, &mut first, moustache);
    strands(&mut text, "beard", &mesh, &mut first, beard);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bearded.obj");
    fs::write(&file, text).unwrap();
    let objects = posed(&file, &["jawOpen=1", "mouthPucker=1"]);
    let head = &objects["head"];
    for (name, least) in [("moustache", 0.03), ("beard", 0.2)] {
        let points = &objects[name];
        assert!(points.len() > 20, "{name} has {} points", points.len());
        let (moved, off) = (furthest(points) / eyes, off_skin(points, head) / eyes);
        println!("{name}: {} points move {moved:.3} eye distances, {off:.3} off the skin", points.len());
        assert!(moved >= least && off <= 0.04, "{name}: moves {moved}, {off} off the skin");
    }
}

/// Names of loose parts and what they follow, as the command tells them.
fn told_parts(mesh: &Path) -> Vec<(String, String)> {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh.display().to_string();
    let args = ["face", &mesh, "--bones", "12", "-o", "face.rig.ron"];
    let answer = rigsmith(folder.path(), &[&args[..], &["--json"]].concat());
    assert_eq!(answer.code, 0, "{}", answer.err);
    let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
    let told: Vec<(String, String)> = answer.json()["parts"]
        .as_array()
        .unwrap()
        .iter()
        .map(|part| (text(&part["part"]), text(&part["follows"])))
        .collect();
    let lines = rigsmith(folder.path(), &args).out;
    for (part, joint) in &told {
        let is_told = |line: &str| line.starts_with(&format!("following {joint}: ")) && line.contains(part.as_str());
        assert!(lines.lines().any(is_told), "{part} follows {joint} in {lines}");
    }
    told
}

/// Loose parts of a head are told with the joints that they follow, by the names of their objects.
#[test]
fn what_loose_parts_follow_is_told() {
    let own = |list: &[(&str, &str)]| -> Vec<(String, String)> {
        list.iter().map(|(part, joint)| ((*part).to_owned(), (*joint).to_owned())).collect()
    };
    let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj");
    assert_eq!(told_parts(&bundled), own(&[("eyes", "eye_l"), ("eyes", "eye_r")]));
    let Some(data) = test_data() else { return };
    let mut told = told_parts(&data.join("bodies/female_young/full.obj"));
    told.sort();
    let expected = [
        ("helper-l-eye", "eye_l"),
        ("helper-lower-teeth", "jaw"),
        ("helper-r-eye", "eye_r"),
        ("helper-tongue", "tongue"),
        ("helper-upper-teeth", "head"),
    ];
    assert_eq!(told, own(&expected));
}

/// Furthest way down of some points.
fn lowered(points: &[Moved]) -> f32 {
    points.iter().map(|[rest, moved]| rest.y - moved.y).fold(0.0, f32::max)
}

/// Lashes that are a mesh of their own go down with the lid that they stand on.
#[test]
fn lashes_follow_their_lid() {
    let mesh = heads::bundled();
    let analysis = FaceAnalysis::new(&mesh.0, &mesh.1, &AutoSettings::default(), &|_, _| true).unwrap();
    let (eyes, marks) = (analysis.landmarks.eye_distance(), &analysis.landmarks.points);
    let lash = |point: Vec3| {
        let is_on_lid = |mark: &Vec3| mark.distance(point) < 0.07 * eyes && point.y > mark.y;
        marks[43..45].iter().any(is_on_lid).then(|| point + 0.015 * eyes * Vec3::Z)
    };
    let (mut text, mut first) = (String::new(), 0);
    object(&mut text, "head", &mesh, &mut first, Some);
    object(&mut text, "lashes", &mesh, &mut first, lash);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("lashes.obj");
    fs::write(&file, text).unwrap();
    let objects = posed(&file, &["eyeBlinkLeft=1"]);
    let (head, lashes) = (&objects["head"], &objects["lashes"]);
    assert!(lashes.len() > 6, "{} points are lashes", lashes.len());
    let (moved, down) = (furthest(lashes) / eyes, lowered(lashes) / eyes);
    // Skin further up stays, and that of the eye's socket does.
    let is_rim = |[rest, _]: &Moved| marks[43..45].iter().any(|mark| mark.distance(*rest) < 0.035 * eyes);
    let rim: Vec<Moved> = head.iter().copied().filter(is_rim).collect();
    let lid = lowered(&rim) / eyes;
    println!("{} points of lashes move {moved:.3} eye distances, {down:.3} down, their lid {lid:.3}", lashes.len());
    assert!(down > 0.03 && (down - lid).abs() < 0.2 * lid, "lashes move {moved}, {down} down, their lid {lid}");
}
