//! Expressions: their files, and what they do to real heads.

mod mixes;

use glam::Vec3;
use rigsmith::{
    algo::face::{
        auto::{AutoFace, AutoSettings, FaceAnalysis},
        axes::HeadAxes,
        bones::FaceBone,
        expression::{
            BonePose, Expression, ExpressionSet, FittedFace, Mix, Sides, Unit, UnitSet, apply, pose, pose_sampled,
        },
        grouping::group_head,
        head_bones::head_bones,
        landmarks::{Landmarks, find_landmarks},
        shells::{ShellKind, Shells, find_shells},
    },
    mesh::model::Weights,
};

use crate::{
    heads::{self, HEADS},
    prerequisites::test_data,
};

/// A head with bones at its true landmarks.
struct Head {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    landmarks: Landmarks,
    marks: Vec<usize>,
    mask: Vec<bool>,
    bones: Vec<FaceBone>,
    weights: Weights,
}

/// A head of the test data; `None` where there is none.
#[track_caller]
fn head(name: &str, density: usize) -> Option<Head> {
    let folder = test_data()?;
    let mesh = heads::mesh(&folder.join(format!("heads/{name}.obj")));
    let marks = heads::truth(&folder);
    let landmarks = heads::true_landmarks(&mesh.0, &marks);
    let shells = find_shells(&mesh.0, &mesh.1);
    Some(rigged(mesh, shells, landmarks, marks, density))
}

/// A head of the test data with bones at the landmarks that are found on it, and the points of the true ones; `None` where
/// there is none.
#[track_caller]
fn found(name: &str, density: usize) -> Option<Head> {
    let folder = test_data()?;
    let mesh = heads::mesh(&folder.join(format!("heads/{name}.obj")));
    let shells = find_shells(&mesh.0, &mesh.1);
    let landmarks = find_landmarks(&mesh.0, &mesh.1, &shells).unwrap();
    Some(rigged(mesh, shells, landmarks, heads::truth(&folder), density))
}

/// The bundled head, with bones at the landmarks that are found on it.
fn bundled(density: usize) -> Head {
    let mesh = heads::bundled();
    let shells = find_shells(&mesh.0, &mesh.1);
    let landmarks = find_landmarks(&mesh.0, &mesh.1, &shells).unwrap();
    let nearest = |mark: &Vec3| {
        let skin = (0..mesh.0.len()).filter(|point| shells.kind(*point) == ShellKind::Skin);
        let distance = |point: &usize| mesh.0[*point].distance_squared(*mark);
        skin.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    };
    let marks = landmarks.points.iter().map(nearest).collect();
    rigged(mesh, shells, landmarks, marks, density)
}

/// The scan of the test data, whose lips touch, with bones at the landmarks that are found on it; `None` where there is none.
/// Points of a lip face the other lip: without that the points nearest to two landmarks would lie on one lip both.
#[track_caller]
fn scan(density: usize) -> Option<Head> {
    let folder = test_data()?;
    let mesh = heads::mesh(&folder.join("heads/lee_perry_smith.obj"));
    let shells = find_shells(&mesh.0, &mesh.1);
    let landmarks = find_landmarks(&mesh.0, &mesh.1, &shells).unwrap();
    let mut normals = vec![Vec3::ZERO; mesh.0.len()];
    for corners in &mesh.1 {
        let [a, b, c] = corners.map(|corner| mesh.0[corner as usize]);
        corners.iter().for_each(|corner| normals[*corner as usize] += (b - a).cross(c - a));
    }
    let nearest = |(mark, place): (usize, &Vec3)| {
        let faces_other_lip = |point: &usize| match mark {
            61..=63 => normals[*point].y < 0.0,
            65..=67 => normals[*point].y > 0.0,
            _ => true,
        };
        let distance = |point: &usize| mesh.0[*point].distance_squared(*place);
        let fitting = (0..mesh.0.len()).filter(faces_other_lip);
        fitting.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    };
    let marks = landmarks.points.iter().enumerate().map(nearest).collect();
    Some(rigged(mesh, shells, landmarks, marks, density))
}

fn rigged(
    (points, triangles): heads::Mesh,
    shells: Shells,
    landmarks: Landmarks,
    marks: Vec<usize>,
    density: usize,
) -> Head {
    let groups = group_head(&points, &triangles, &shells, &landmarks, None, &|_| true).unwrap();
    let analysis = FaceAnalysis {
        axes: HeadAxes { up: Vec3::Y, forward: Vec3::Z },
        certain: true,
        part: None,
        mesh_points: points.len(),
        head_bones: head_bones(&points, &triangles, &groups, &landmarks).unwrap(),
        points,
        triangles,
        shells,
        landmarks,
        groups,
    };
    let settings = AutoSettings { bones: density, ..AutoSettings::default() };
    let face = analysis.rig(&[], &settings, ExpressionSet::bundled(), &|_, _| true).unwrap();
    let AutoFace { bones, weights, .. } = face;
    let FaceAnalysis { points, triangles, landmarks, groups, .. } = analysis;
    Head { points, triangles, landmarks, marks, mask: groups.mask, bones, weights }
}

/// Movements of units are solved once and summed; the order in which units are first used makes no difference.
#[test]
fn a_kept_face_poses_like_a_new_one() {
    let head = bundled(40);
    let set = ExpressionSet::bundled();
    let units = set.unit_set();
    let Head { points, triangles, mask, weights, bones, landmarks, .. } = &head;
    let fitted = || FittedFace::new(points, triangles, mask, weights, bones, landmarks, units);
    let kept = fitted();
    let names: Vec<&str> = set.six().map(|expression| expression.name.as_str()).collect();
    for pair in names.windows(2) {
        let blend: Vec<_> = pair.iter().map(|name| (set.find(name).unwrap(), 0.6)).collect();
        let blend: Vec<_> = blend.iter().map(|(expression, strength)| (expression.as_ref(), *strength)).collect();
        let mix = Mix::of(&blend, units);
        assert_eq!(kept.pose(&mix), fitted().pose(&mix), "{pair:?}");
        assert_eq!(kept.pose(&mix), kept.pose(&mix), "{pair:?}");
    }
    assert!(kept.pose(&Mix::rest(units)).iter().all(|pose| *pose == BonePose::REST));
}

/// Skin that folds in a blend is mended at the price of a twentieth of each unit at most, not of the strongest one: where few bones
/// make folds, a weak unit beside a strong one keeps its movement.
#[test]
fn mending_takes_a_twentieth_of_each_unit_at_most() {
    let set = ExpressionSet::bundled();
    let units = set.unit_set();
    let mut most = 0.0_f32;
    for density in [12, 40] {
        let Head { points, triangles, mask, weights, bones, landmarks, .. } = &bundled(density);
        let face = FittedFace::new(points, triangles, mask, weights, bones, landmarks, units);
        let blend = |expression: &Expression| {
            let mut mix = Mix::of(&[(expression, 1.5)], units);
            mix.add("jaw_open", Sides::Both, 1.0, units);
            mix.add("brow_down", Sides::Left, 0.2, units);
            (expression.name.clone(), mix)
        };
        // All units at once fold any skin.
        let all = Mix { strengths: units.units().iter().map(|unit| [unit.limit; 2]).collect() };
        for (name, mix) in set.six().map(blend).chain([("all".to_owned(), all)]) {
            for (unit, taken) in units.units().iter().zip(face.taken(&mix)) {
                let taken = taken[0].max(taken[1]);
                most = most.max(taken);
                assert!(taken <= 0.0501, "{taken} of {} in {name} with {density} bones", unit.name);
            }
        }
    }
    assert!(most > 0.0, "nothing was mended, so that nothing was tested");
}

impl Head {
    fn moved(&self, name: &str, strength: f32) -> Vec<Vec3> {
        let set = ExpressionSet::bundled();
        let expression = set.find(name).unwrap();
        let units = set.unit_set();
        let Self { points, triangles, mask, weights, bones, landmarks, .. } = self;
        let face = FittedFace::new(points, triangles, mask, weights, bones, landmarks, units);
        apply(points, weights, bones, &face.pose(&Mix::of(&[(expression.as_ref(), strength)], units)))
    }

    fn folds(&self, moved: &[Vec3]) -> usize {
        let normal = |points: &[Vec3], triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| points[corner as usize]);
            ((b - a).cross(c - a), (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared()))
        };
        let folds = |triangle: &&[u32; 3]| {
            let (rest, longest) = normal(&self.points, triangle);
            rest.length() > 1e-3 * longest && rest.dot(normal(moved, triangle).0) < 0.0
        };
        self.triangles.iter().filter(folds).count()
    }

    fn facial_triangles(&self) -> usize {
        self.triangles.iter().filter(|corners| corners.iter().all(|corner| self.mask[*corner as usize])).count()
    }

    /// Goals of an expression, in eye distances (lids: in their opening), as (what, reached, least).
    fn reached(&self, name: &str, moved: &[Vec3]) -> Vec<(String, f32, f32)> {
        let scale = 1.0 / self.landmarks.eye_distance();
        let at = |points: &[Vec3], mark: usize| points[self.marks[mark]];
        let up = |mark: usize, least: f32| {
            (format!("{mark} up"), (at(moved, mark).y - at(&self.points, mark).y) * scale, least)
        };
        let down = |mark: usize, least: f32| (format!("{mark} down"), -up(mark, least).1, least);
        let distance = |points: &[Vec3], a, b| at(points, a).distance(at(points, b));
        let apart = |a: usize, b: usize, least: f32| {
            (format!("{a}-{b} apart"), (distance(moved, a, b) - distance(&self.points, a, b)) * scale, least)
        };
        let wider = |a: usize, b: usize| distance(moved, a, b) / distance(&self.points, a, b) - 1.0;
        let lids = [(37, 41), (44, 46)];
        match name {
            "happiness" => vec![up(48, 0.03), up(54, 0.03), apart(48, 54, 0.02)],
            "sadness" => vec![up(21, 0.02), up(22, 0.02), down(48, 0.015), down(54, 0.015)],
            "anger" => {
                let together = ("21-22 together".into(), -apart(21, 22, 0.0).1, 0.015);
                let mut all = vec![down(21, 0.02), down(22, 0.02), together];
                all.extend(lids.map(|(a, b)| (format!("lids {a}-{b} closer"), -wider(a, b), 0.1)));
                all
            }
            "fear" => {
                let mut all = vec![up(19, 0.025), up(24, 0.025), apart(62, 66, 0.02)];
                all.extend(lids.map(|(a, b)| (format!("lids {a}-{b} apart"), wider(a, b), 0.1)));
                all
            }
            "disgust" => vec![up(51, 0.015), up(31, 0.01), up(35, 0.01)],
            _ => vec![up(19, 0.04), up(24, 0.04), apart(62, 66, 0.08)],
        }
    }
}

#[track_caller]
fn check_head(name: &str, density: usize, most_folds: usize) {
    if let Some(head) = head(name, density) {
        check_six(&head, name, density, most_folds);
    }
}

/// Each of the six expressions reaches what it must, folds no more triangles than a thousandth of the mask (the true
/// shapes of the heads fold up to five of a thousand) and keeps lips and lids apart.
#[track_caller]
fn check_six(head: &Head, name: &str, density: usize, most_folds: usize) {
    for expression in ExpressionSet::bundled().six() {
        let moved = head.moved(&expression.name, 1.0);
        // Lips that are closed in the mesh cannot part.
        let can_part = |what: &str| head.landmarks.mouth_open || !what.starts_with("62-66");
        let reached = head.reached(&expression.name, &moved);
        for (what, reached, least) in reached.into_iter().filter(|(what, ..)| can_part(what)) {
            println!("{name}, {density} bones, {}: {what} share {:.2}", expression.name, reached / least);
            assert!(reached >= least, "{name}, {density} bones, {}: {what} {reached:.4} < {least}", expression.name);
        }
        let folds = head.folds(&moved);
        println!("{name}, {density} bones, {}: {folds} folds of {}", expression.name, head.facial_triangles());
        assert!(folds <= most_folds, "{name}, {density} bones, {}: {folds} triangles fold", expression.name);
        for (above, below) in [(61, 67), (62, 66), (63, 65), (37, 41), (38, 40), (43, 47), (44, 46)] {
            let gap = |points: &[Vec3]| points[head.marks[above]].y - points[head.marks[below]].y;
            // Lips may overlap in the mesh itself.
            let least = gap(&head.points).min(0.0) - 0.003 * head.landmarks.eye_distance();
            assert!(gap(&moved) >= least, "{name}, {density} bones, {}: {above} below {below}", expression.name);
        }
    }
}

#[test]
fn the_bundled_head_shows_the_six() {
    check_six(&bundled(40), "the bundled head", 40, 5);
}

#[test]
fn few_bones_show_the_six() {
    check_head(HEADS[0], 20, 8);
}

#[test]
fn forty_bones_show_the_six() {
    HEADS.into_iter().for_each(|name| check_head(name, 40, 13));
}

#[test]
fn many_bones_show_the_six() {
    check_head(HEADS[2], 80, 13);
}

#[test]
fn strength_nothing_is_rest_and_one_side_leaves_the_other() {
    for head in [bundled(40)].into_iter().chain(head(HEADS[0], 40)) {
        let still = head.moved("happiness", 0.0);
        assert!(still.iter().zip(&head.points).all(|(a, b)| a.distance(*b) < 1e-5));
        let moved = head.moved("mouth_smile_l", 1.0);
        let way = |mark: usize| moved[head.marks[mark]].distance(head.points[head.marks[mark]]);
        assert!(way(54) > 0.03 * head.landmarks.eye_distance(), "{}", way(54));
        assert!(way(48) < 0.15 * way(54), "{} {}", way(48), way(54));
    }
}

#[test]
fn every_bundled_file_parses_and_comes_back() {
    let files: Vec<_> = ExpressionSet::bundled_files().collect();
    let set = ExpressionSet::parse(&files).unwrap();
    assert_eq!(&set, ExpressionSet::bundled());
    assert_eq!(set.six().count(), 6);
    assert_eq!(set.expressions().len(), 26);
    assert_eq!(set.unit_set().arkit_shapes().count(), 52);
    for (file, text) in files {
        if file.ends_with(".units.ron") {
            let units = Unit::parse_list(text, file).unwrap();
            assert_eq!(units, Unit::parse_list(&Unit::list_to_text(&units).unwrap(), file).unwrap());
        } else {
            let expression = Expression::parse(text, file).unwrap();
            assert_eq!(expression, Expression::parse(&expression.to_text().unwrap(), file).unwrap());
        }
    }
    assert!(set.find("mouth_smile_r").is_some_and(|unit| unit.units[0].side == Sides::Right));
    assert!(set.find("no_such_unit").is_none());
}

#[test]
fn malformed_files_say_where() {
    let check = |file: &str, text: &str, line: usize, says: &str| {
        let error = ExpressionSet::parse(&[(file, text)]).unwrap_err();
        assert!(error.file == file && error.line == line && error.message.contains(says), "{error}");
    };
    check("a.expr.ron", "", 1, "empty");
    check("a.expr.ron", "(\n name: \"a\",\n units: [(unit: \"none\")],\n)", 3, "no unit");
    check("a.expr.ron", "(\n name: \"A b\",\n units: [],\n)", 2, "a-z");
    check("a.expr.ron", "(\n name: \"a\",\n units: [(unit: \"b\", strength: 1.6)],\n)", 3, "strength");
    check("a.expr.ron", "(\n name: \"a\",\n colour: 1,\n units: [],\n)", 3, "colour");
    check("a.expr.ron", &" ".repeat(300 << 10), 1, "KiB");
    let unit = |inside: &str| format!("[\n (name: \"a\", moves: [\n  ({inside}, reach: (0.1, 0.1)),\n ]),\n]");
    check("a.units.ron", &unit("at: [68], by: (0.0, 0.0, 0.0)"), 3, "landmark");
    check("a.units.ron", &unit("at: [], by: (0.0, 0.0, 0.0)"), 3, "landmarks");
    check("a.units.ron", &unit("at: [1], by: (0.0, NaN, 0.0)"), 3, "NaN");
    check("a.units.ron", &unit("at: [1], by: (inf, 0.0, 0.0)"), 3, "inf");
    check("a.units.ron", "[\n (name: \"a\"),\n (name: \"a\"),\n]", 3, "second");
}

/// A face as plain as can be, for what needs no head.
fn plain() -> Landmarks {
    let mut points = [Vec3::ZERO; 68];
    for (mark, point) in points.iter_mut().enumerate() {
        let across = (mark as f32 * 0.7).sin();
        *point = Vec3::new(across * 0.5, mark as f32 * -0.02, 0.1 - across * across * 0.1);
    }
    points[36] = Vec3::new(-0.5, 0.0, 0.0);
    points[45] = Vec3::new(0.5, 0.0, 0.0);
    Landmarks { points, middle: 0.0, symmetric: true, confidence: 1.0, mouth_open: false }
}

#[test]
fn blends_add_up_to_the_limit() {
    let set = ExpressionSet::bundled();
    let units: &UnitSet = set.unit_set();
    let smile = set.get("happiness").unwrap();
    let once = Mix::of(&[(smile, 1.0)], units);
    assert!(Mix::of(&[(smile, 0.0)], units).is_rest());
    assert!(Mix::of(&[(smile, f32::NAN)], units).is_rest());
    let halves = Mix::of(&[(smile, 0.5), (smile, 0.5)], units);
    for (a, b) in once.strengths.iter().flatten().zip(halves.strengths.iter().flatten()) {
        assert!((a - b).abs() < 1e-6);
    }
    let thrice = Mix::of(&[(smile, 1.0), (smile, 1.0), (smile, 7.0)], units);
    for (unit, strengths) in set.units().iter().zip(thrice.strengths) {
        assert!(strengths.iter().all(|strength| (0.0..=unit.limit).contains(strength)), "{}", unit.name);
    }
}

#[test]
fn what_does_not_fit_together_is_survived() {
    let set = ExpressionSet::bundled();
    let wanted = [(set.get("surprise").unwrap(), 1.0)];
    let mut landmarks = plain();
    assert!(pose(set, &wanted, &[], &Weights::default(), &[], &landmarks).is_empty());
    let bone = rigsmith::algo::face::bones::FaceBone {
        position: landmarks.points[22],
        kind: rigsmith::algo::face::bones::FaceBoneKind::Skin,
        region: rigsmith::algo::face::bones::Region::Brow,
        side: rigsmith::algo::face::bones::Side::Left,
        label: "brow_01_l".into(),
        pair: None,
        fixed: None,
    };
    let bones = [bone];
    let mix = Mix::of(&wanted, set.unit_set());
    assert_ne!(pose_sampled(&mix, set.unit_set(), &bones, &landmarks)[0], BonePose::REST);
    let points = [Vec3::ZERO, Vec3::X];
    let mut weights = Weights::default();
    weights.push([(2, 0.5), (9, 0.5)]);
    let units = set.unit_set();
    let poses = FittedFace::new(&points, &[[0, 1, 7]], &[true], &weights, &bones, &landmarks, units).pose(&mix);
    assert!(poses.len() == 1 && poses[0].translation.is_finite());
    assert_eq!(apply(&points, &weights, &bones, &[]).len(), 2);
    landmarks.points[45] = landmarks.points[36];
    assert_eq!(pose_sampled(&mix, set.unit_set(), &bones, &landmarks), [BonePose::REST]);
    landmarks.points[3].x = f32::NAN;
    assert_eq!(pose(set, &wanted, &bones, &weights, &points, &landmarks), [BonePose::REST]);
}
