//! Expressions of a face: the time of one, crossing of lips and lids, and folds in the facial mask and beside it; and the
//! largest distance of baked shapes of ARKit from skinning by the bones.

use std::{error::Error, time::Instant};

use bevy::math::{Affine3A, Vec3};
use rigsmith::{
    algo::face::{
        auto::{AutoSettings, FaceAnalysis},
        expression::{ExpressionSet, MAX_STRENGTH, Mix, apply},
    },
    headless::Workbench,
    mesh::{influences::keep_strongest, model::Weights, skinning::skin_points},
    rig::RigEdit,
};

/// Influences of a point in a written file.
const INFLUENCES: usize = 4;
/// Landmarks of which the first stays above the second: lips and lids.
const APART: [[usize; 2]; 7] = [[61, 67], [62, 66], [63, 65], [37, 41], [38, 40], [43, 47], [44, 46]];

/// Prints the measures of all expressions, and the folds of the units, of a placed face with so many bones.
///
/// # Errors
/// No face was placed, or its bones cannot be placed.
pub fn print_expressions(name: &str, bench: &Workbench, bones: usize) -> Result<(), Box<dyn Error>> {
    let analysis = &bench.placed_face().ok_or("no face was placed")?.analysis;
    let set = ExpressionSet::bundled();
    let settings = AutoSettings { bones, ..AutoSettings::default() };
    let face = analysis.rig(&[], &settings, set, &|_, _| true)?;
    let start = Instant::now();
    let fitted = analysis.fitted(&face.bones, &face.weights, set.unit_set());
    let prepared = start.elapsed().as_secs_f64() * 1e3;
    let marks = marks(analysis);
    let pose = |expression: &str, strength: f32| {
        let mixed = set.find(expression).map(|known| Mix::of(&[(known.as_ref(), strength)], set.unit_set()));
        let poses = mixed.map(|mix| fitted.pose(&mix)).unwrap_or_default();
        apply(&analysis.points, &face.weights, &face.bones, &poses)
    };
    let (mut first, mut again, mut crossed) = (Vec::new(), Vec::new(), 0);
    for expression in set.expressions() {
        for times in [&mut first, &mut again] {
            let start = Instant::now();
            let posed = pose(&expression.name, 1.0);
            times.push(start.elapsed().as_secs_f64() * 1e3);
            assert_eq!(posed.len(), analysis.points.len());
        }
        for strength in [1.0, MAX_STRENGTH] {
            let crossings = crossings(analysis, &marks, &pose(&expression.name, strength));
            crossed += crossings;
            if crossings > 0 {
                println!("{name}, {bones} bones: {} of {strength} crosses {crossings} pairs", expression.name);
            }
        }
    }
    for times in [&mut first, &mut again] {
        times.sort_by(f64::total_cmp);
    }
    let (median, longest) = (again[again.len() / 2], again[again.len() - 1]);
    let slowest_first = first[first.len() - 1];
    println!(
        "{name}, {bones} bones: an expression {median:.2} ms, {longest:.2} at most, {slowest_first:.2} when its units are \
         first used, {prepared:.1} ms of preparation; {crossed} pairs of lips and lids cross in {} expressions of 1 and \
         {MAX_STRENGTH}",
        set.expressions().len()
    );
    let mut folding = Vec::new();
    for unit in set.units() {
        let [inside, beside] = folds(analysis, &pose(&unit.name, 1.0));
        if inside + beside > 0 {
            folding.push(format!("{} {inside} + {beside}", unit.name));
        }
    }
    println!("{name}, {bones} bones: folds of units in the mask + beside it: {}", folding.join(", "));
    println!(
        "{{\"head\": \"{name}\", \"bones\": {bones}, \"expression_ms\": {median:.3}, \"longest_ms\": {longest:.3}, \
         \"first_ms\": {slowest_first:.3}, \"prepare_ms\": {prepared:.2}, \"crossed\": {crossed}}}"
    );
    Ok(())
}

/// Points of the mask that are nearest to the landmarks.
fn marks(analysis: &FaceAnalysis) -> Vec<usize> {
    let facial: Vec<usize> = (0..analysis.points.len()).filter(|point| analysis.groups.mask[*point]).collect();
    let nearest = |mark: &Vec3| {
        let distance = |point: &usize| analysis.points[*point].distance_squared(*mark);
        facial.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or_default()
    };
    analysis.landmarks.points.iter().map(nearest).collect()
}

/// Number of pairs of lips and lids whose upper point is below the lower one.
fn crossings(analysis: &FaceAnalysis, marks: &[usize], posed: &[Vec3]) -> usize {
    let slack = 0.003 * analysis.landmarks.eye_distance();
    let is_crossed = |[above, below]: &[usize; 2]| {
        let gap = |points: &[Vec3]| points[marks[*above]].y - points[marks[*below]].y;
        // Lips may overlap in the mesh itself.
        gap(posed) < gap(&analysis.points).min(0.0) - slack
    };
    APART.iter().filter(|pair| is_crossed(pair)).count()
}

/// Numbers of triangles that turn by more than a right angle, in the facial mask and beside it.
fn folds(analysis: &FaceAnalysis, posed: &[Vec3]) -> [usize; 2] {
    let mut folds = [0; 2];
    for corners in &analysis.triangles {
        let normal = |points: &[Vec3]| {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
            ((b - a).cross(c - a), longest)
        };
        let ((rest, longest), (turned, _)) = (normal(&analysis.points), normal(posed));
        // Slivers have no orientation.
        if rest.length() > 1e-3 * longest && rest.dot(turned) < 0.0 {
            let is_facial = corners.iter().all(|corner| analysis.groups.mask[*corner as usize]);
            folds[usize::from(!is_facial)] += 1;
        }
    }
    folds
}

/// Prints the number of baked shapes of ARKit, and their largest distance from skinning by the poses of the bones.
///
/// # Errors
/// No face was placed and bound.
pub fn print_bake(name: &str, bench: &Workbench, bones: usize) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    let shapes = bench.arkit_shapes(INFLUENCES)?;
    let baked = start.elapsed().as_secs_f64() * 1e3;
    let (mesh, skin) = bench.mesh().zip(bench.weights()).ok_or("the head is not bound")?;
    let mut weights = Weights::default();
    for point in 0..skin.weights.len() {
        let mut influences: Vec<(u32, f32)> = skin.weights.of(point).collect();
        keep_strongest(&mut influences, INFLUENCES, 0.0);
        weights.push(influences);
    }
    let rest = &mesh.rest.points;
    let (mut posed, mut furthest, mut worst) = (Vec::new(), 0.0_f32, "");
    for shape in &shapes {
        let mut rig = bench.rig().clone();
        for (joint, offset) in &shape.pose {
            rig.apply(&RigEdit::SetOffset(*joint, Some(*offset)))?;
        }
        let matrix = |joint| Affine3A::from(rig.posed_global(joint)) * Affine3A::from(rig.rest_global(joint)).inverse();
        let matrices: Vec<Affine3A> = skin.joints.iter().map(|joint| matrix(*joint)).collect();
        skin_points(rest, &weights, &matrices, &mut posed);
        for ((posed, rest), point) in posed.iter().zip(rest).zip(0..) {
            let distance = (*posed - *rest).distance(shape.offset(point));
            if distance > furthest {
                (furthest, worst) = (distance, shape.name.as_str());
            }
        }
    }
    let eyes = bench.placed_face().ok_or("no face was placed")?.analysis.landmarks.eye_distance();
    println!(
        "{name}, {bones} bones: {} shapes of ARKit in {baked:.0} ms, at most {furthest:.2e} from the bones' own skinning \
         ({worst}), {:.1e} of the distance of the eyes",
        shapes.len(),
        furthest / eyes
    );
    println!(
        "{{\"head\": \"{name}\", \"bones\": {bones}, \"arkit\": {}, \"bake_ms\": {baked:.1}, \"furthest\": {furthest:e}}}",
        shapes.len()
    );
    Ok(())
}
