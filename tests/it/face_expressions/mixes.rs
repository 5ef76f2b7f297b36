//! Expressions beside the six, and positions of the mouth for speech: the regions that they move, and the directions; and
//! lips and lids in caricature.

use std::ops::RangeInclusive;

use glam::{Vec3, vec3};
use rigsmith::algo::face::expression::{ExpressionSet, FittedFace, MAX_STRENGTH, Mix, apply};

use super::{Head, bundled, found, head, scan};
use crate::heads::HEADS;

/// Upper and lower lids of an eye.
const LEFT_LIDS: [[usize; 2]; 2] = [[43, 47], [44, 46]];
const RIGHT_LIDS: [[usize; 2]; 2] = [[37, 41], [38, 40]];
/// Landmarks of which the first stays above the second: lips and lids.
const APART: [[usize; 2]; 7] = [[61, 67], [62, 66], [63, 65], [37, 41], [38, 40], [43, 47], [44, 46]];

/// A head that is posed many times.
struct Posable {
    name: &'static str,
    head: Head,
    face: FittedFace,
}

impl Posable {
    fn new(name: &'static str, head: Head) -> Self {
        let Head { points, triangles, mask, weights, bones, landmarks, .. } = &head;
        let units = ExpressionSet::bundled().unit_set();
        let face = FittedFace::new(points, triangles, mask, weights, bones, landmarks, units);
        Self { name, head, face }
    }

    /// The bundled head and, where test data is, one with true landmarks.
    fn all() -> Vec<Self> {
        let real = head(HEADS[0], 40).map(|real| Self::new(HEADS[0], real));
        [Self::new("the bundled head", bundled(40))].into_iter().chain(real).collect()
    }

    /// The heads of the test data with bones at the landmarks that are found on them, few, some and many.
    fn all_found() -> Vec<Self> {
        let names = ["ict_neutral", "ict_identity_1", "ict_identity_2", "ict_identity_3"];
        let densities = |name| [20, 40, 80].map(|density| Some(Self::new(name, found(name, density)?)));
        names.into_iter().flat_map(densities).flatten().collect()
    }

    fn moved(&self, expression: &str, strength: f32) -> Moved<'_> {
        let set = ExpressionSet::bundled();
        let expression = set.find(expression).unwrap();
        let mix = Mix::of(&[(expression.as_ref(), strength)], set.unit_set());
        let Head { points, weights, bones, .. } = &self.head;
        Moved { head: &self.head, points: apply(points, weights, bones, &self.face.pose(&mix)) }
    }
}

/// Largest opening of an eye that counts as shut, as a share of that at rest: the points nearest to the landmarks lie beside the
/// rims, and the true shapes leave 0.28 between them.
const SHUT: f32 = 0.41;

/// A head in an expression. Lengths are in eye distances.
struct Moved<'a> {
    head: &'a Head,
    points: Vec<Vec3>,
}

impl Moved<'_> {
    /// Movement of a landmark.
    fn by(&self, mark: usize) -> Vec3 {
        let point = self.head.marks[mark];
        (self.points[point] - self.head.points[point]) / self.head.landmarks.eye_distance()
    }

    fn up(&self, mark: usize) -> f32 {
        self.by(mark).y
    }

    fn chin_drop(&self) -> f32 {
        -self.up(8)
    }

    fn mouth_widening(&self) -> f32 {
        self.by(54).x - self.by(48).x
    }

    /// Change of the height of one landmark above another.
    fn parting(&self, above: usize, below: usize) -> f32 {
        self.up(above) - self.up(below)
    }

    /// Furthest movement of some landmarks.
    fn furthest(&self, marks: impl Iterator<Item = usize>) -> f32 {
        marks.map(|mark| self.by(mark).length()).fold(0.0, f32::max)
    }

    /// Opening of an eye, as a share of that at rest.
    fn eye_opening(&self, lids: [[usize; 2]; 2]) -> f32 {
        let opening = |points: &[Vec3]| {
            let gaps = lids.map(|[a, b]| points[self.head.marks[a]].distance(points[self.head.marks[b]]));
            gaps[0] + gaps[1]
        };
        opening(&self.points) / opening(&self.head.points)
    }
}

/// Measures that are out of their range.
#[derive(Default)]
struct Faults(Vec<String>);

impl Faults {
    fn check(&mut self, what: &str, value: f32, range: RangeInclusive<f32>) {
        println!("{what}: {value:.4}");
        if !range.contains(&value) {
            self.0.push(format!("{what}: {value} is not from {} to {}", range.start(), range.end()));
        }
    }

    #[track_caller]
    fn assert_none(&self) {
        assert!(self.0.is_empty(), "{}", self.0.join("\n"));
    }
}

#[test]
fn smirk_and_contempt_raise_one_corner_of_the_mouth() {
    let mut faults = Faults::default();
    for posable in Posable::all() {
        for name in ["smirk", "contempt"] {
            let moved = posable.moved(name, 1.0);
            let told = format!("{}, {name}", posable.name);
            faults.check(&format!("{told}: left corner up"), moved.up(54), 0.05..=0.2);
            faults.check(&format!("{told}: left corner outwards"), moved.by(54).x, 0.02..=0.15);
            let other = moved.by(48).length() / moved.by(54).length();
            faults.check(&format!("{told}: share of the right corner"), other, 0.0..=0.25);
        }
    }
    faults.assert_none();
}

#[test]
fn a_wink_shuts_one_eye_and_leaves_the_other() {
    let mut faults = Faults::default();
    for posable in Posable::all() {
        let moved = posable.moved("wink", 1.0);
        let name = posable.name;
        faults.check(&format!("{name}: left eye"), moved.eye_opening(LEFT_LIDS), 0.0..=SHUT);
        faults.check(&format!("{name}: right eye"), moved.eye_opening(RIGHT_LIDS), 0.95..=1.05);
        faults.check(&format!("{name}: left corner of the mouth up"), moved.up(54), 0.025..=0.1);
        let right = (17..=21).chain(36..=41).chain([48]);
        faults.check(&format!("{name}: right brow, lids and corner"), moved.furthest(right), 0.0..=0.025);
    }
    faults.assert_none();
}

#[test]
fn pain_lowers_brows_shuts_eyes_and_raises_the_upper_lip() {
    let mut faults = Faults::default();
    for posable in Posable::all() {
        let moved = posable.moved("pain", 1.0);
        let name = posable.name;
        for (brow, least) in [(19, 0.04), (24, 0.04), (21, 0.025), (22, 0.025)] {
            faults.check(&format!("{name}: brow {brow} down"), -moved.up(brow), least..=0.2);
        }
        for (eye, lids) in [("left", LEFT_LIDS), ("right", RIGHT_LIDS)] {
            faults.check(&format!("{name}: {eye} eye"), moved.eye_opening(lids), 0.0..=SHUT);
        }
        faults.check(&format!("{name}: upper lip up"), moved.up(51), 0.05..=0.2);
        faults.check(&format!("{name}: mouth wider"), moved.mouth_widening(), 0.04..=0.2);
        faults.check(&format!("{name}: sides"), (moved.up(19) - moved.up(24)).abs(), 0.0..=0.01);
    }
    faults.assert_none();
}

/// Range of a measure.
type Range = [f32; 2];

/// Ranges of visemes: drop of the chin, widening of the mouth, and movement of the upper lip to the front; from about half
/// of what the units ask to nearly twice as much.
const VISEMES: [(&str, Range, Range, Range); 14] = [
    ("viseme_pp", [-0.05, 0.005], [-0.03, 0.04], [-0.05, 0.01]),
    ("viseme_ff", [0.0, 0.05], [-0.03, 0.03], [-0.03, 0.02]),
    ("viseme_th", [0.025, 0.11], [-0.05, 0.03], [-0.03, 0.02]),
    ("viseme_dd", [0.02, 0.09], [-0.02, 0.05], [-0.03, 0.02]),
    ("viseme_kk", [0.03, 0.12], [-0.02, 0.05], [-0.03, 0.02]),
    ("viseme_nn", [0.02, 0.09], [-0.03, 0.04], [-0.03, 0.02]),
    ("viseme_ch", [0.02, 0.11], [-0.16, -0.035], [0.03, 0.13]),
    ("viseme_rr", [0.02, 0.11], [-0.14, -0.03], [0.025, 0.11]),
    ("viseme_ss", [-0.01, 0.03], [0.04, 0.18], [-0.05, 0.01]),
    ("viseme_aa", [0.09, 0.3], [-0.09, 0.02], [-0.03, 0.02]),
    ("viseme_e", [0.04, 0.16], [0.03, 0.15], [-0.05, 0.01]),
    ("viseme_ih", [0.02, 0.09], [0.035, 0.16], [-0.05, 0.01]),
    ("viseme_oh", [0.07, 0.28], [-0.19, -0.045], [0.03, 0.13]),
    ("viseme_ou", [0.02, 0.1], [-0.22, -0.05], [0.04, 0.18]),
];

#[test]
fn visemes_open_widen_and_round_the_mouth() {
    let mut faults = Faults::default();
    for posable in Posable::all() {
        for (viseme, chin, width, front) in VISEMES {
            let moved = posable.moved(viseme, 1.0);
            let told = format!("{}, {viseme}", posable.name);
            for (what, value, [least, most]) in [
                ("chin down", moved.chin_drop(), chin),
                ("mouth wider", moved.mouth_widening(), width),
                ("upper lip to the front", moved.by(51).z, front),
            ] {
                faults.check(&format!("{told}: {what}"), value, least..=most);
            }
            let upper_face = (17..=26).chain(36..=47);
            faults.check(&format!("{told}: brows and lids"), moved.furthest(upper_face), 0.0..=0.025);
            let mirrored = moved.by(48) * vec3(-1.0, 1.0, 1.0);
            faults.check(&format!("{told}: sides"), mirrored.distance(moved.by(54)), 0.0..=0.015);
        }
        let drop = |viseme: &str| posable.moved(viseme, 1.0).chin_drop();
        let [aa, e, ih] = ["viseme_aa", "viseme_e", "viseme_ih"].map(drop);
        faults.check(&format!("{}: chin of aa beside e", posable.name), aa / e, 1.4..=4.0);
        faults.check(&format!("{}: chin of e beside ih", posable.name), e / ih, 1.2..=4.0);
        let silent = posable.moved("viseme_sil", 1.0);
        let moves = silent.points.iter().zip(&posable.head.points).any(|(posed, rest)| posed.distance(*rest) > 1e-5);
        assert!(!moves, "{}: silence moves nothing", posable.name);
    }
    faults.assert_none();
}

#[test]
fn visemes_close_roll_and_part_the_lips() {
    let mut faults = Faults::default();
    for posable in Posable::all() {
        let name = posable.name;
        let closed = posable.moved("viseme_pp", 1.0);
        faults.check(&format!("{name}, pp: outer lips nearer"), -closed.parting(51, 57), 0.03..=0.15);
        faults.check(&format!("{name}, pp: inner lips apart"), closed.parting(62, 66), -0.1..=0.005);
        let rolled = posable.moved("viseme_ff", 1.0);
        faults.check(&format!("{name}, ff: lower lip up from the chin"), rolled.parting(57, 8), 0.02..=0.12);
        faults.check(&format!("{name}, ff: lower lip inwards"), -rolled.by(57).z, 0.015..=0.1);
        faults.check(&format!("{name}, ff: upper lip up"), rolled.up(51), 0.01..=0.06);
        // Lips that are one surface cannot part.
        if !posable.head.landmarks.mouth_open {
            continue;
        }
        faults.check(&format!("{name}, ff: under the upper teeth"), rolled.by(62).z - rolled.by(66).z, 0.03..=0.2);
        for (viseme, least) in [("viseme_aa", 0.1), ("viseme_e", 0.06), ("viseme_ih", 0.03), ("viseme_oh", 0.1)] {
            let moved = posable.moved(viseme, 1.0);
            faults.check(&format!("{name}, {viseme}: lips apart"), moved.parting(62, 66), least..=0.45);
        }
    }
    faults.assert_none();
}

/// Skin under the chin and at the corners of the mouth creases where the jaw opens: 249 triangles of the bundled head turn
/// by more than a right angle, and no more than a tenth above that may.
#[test]
fn the_open_jaw_folds_no_more_than_it_did() {
    for posable in Posable::all() {
        let folds = posable.head.folds(&posable.moved("jaw_open", 1.0).points);
        println!("{}: {folds} triangles fold in the open jaw", posable.name);
        assert!(folds <= 273 || posable.name == HEADS[0], "{}: {folds} triangles fold", posable.name);
    }
}

/// Adds the lips and lids that any expression crosses, at full strength or as a caricature.
fn add_crossings(posable: &Posable, faults: &mut Faults) {
    let Posable { name, head, .. } = posable;
    let name = format!("{name} with {} bones", head.bones.len());
    for expression in ExpressionSet::bundled().expressions() {
        for strength in [1.0, MAX_STRENGTH] {
            let moved = posable.moved(&expression.name, strength);
            for [above, below] in APART {
                let gap = |points: &[Vec3]| {
                    let height = points[head.marks[above]].y - points[head.marks[below]].y;
                    height / head.landmarks.eye_distance()
                };
                // Lips may overlap in the mesh itself.
                let least = gap(&head.points).min(0.0) - 0.0001;
                let told = format!("{name}, {} of {strength}: {above} above {below}", expression.name);
                faults.check(&told, gap(&moved.points), least..=1.0);
            }
        }
    }
}

/// Every expression, at full strength and as a caricature, keeps upper lips and lids above the lower ones.
#[test]
fn no_expression_crosses_lips_or_lids() {
    let mut faults = Faults::default();
    for posable in Posable::all().into_iter().chain(Posable::all_found()) {
        add_crossings(&posable, &mut faults);
    }
    faults.assert_none();
}

/// Densities at which lips crossed whose points are between the places along the rims, or pass each other far.
#[test]
fn no_expression_crosses_lips_or_lids_at_other_densities() {
    let mut faults = Faults::default();
    let others = [
        ("ict_neutral", 24),
        ("ict_identity_1", 28),
        ("ict_identity_1", 64),
        ("ict_identity_1", 75),
        ("ict_identity_3", 48),
    ];
    for posable in others.into_iter().filter_map(|(name, density)| Some(Posable::new(name, found(name, density)?))) {
        add_crossings(&posable, &mut faults);
    }
    faults.assert_none();
}

/// A scan whose lips touch and whose eyes are shut.
#[test]
fn no_expression_crosses_lips_or_lids_of_a_scan() {
    let mut faults = Faults::default();
    for head in [20, 40, 80].into_iter().filter_map(scan) {
        add_crossings(&Posable::new("lee_perry_smith", head), &mut faults);
    }
    faults.assert_none();
}
