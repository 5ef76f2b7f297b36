//! Teeth, gums and tongues that are shells of their own: which of them the jaw moves.

use std::ops::Range;

use glam::Vec3;
use rigsmith::algo::face::{
    auto::{AutoSettings, FaceAnalysis},
    bones::FaceBoneKind,
    expression::ExpressionSet,
};

use crate::{face_eyes::add_bar, heads, prerequisites::test_data};

/// Teeth of a mouth. Lengths of which nothing else is said are in distances of the eyes' outer corners.
#[derive(Clone, Copy)]
struct Mouth {
    name: &'static str,
    /// Numbers of upper and lower teeth.
    teeth: [u8; 2],
    /// Half the width and the depth of the arch, in halves of the width between the corners of the lips.
    arch: [f32; 2],
    /// Rise of the rows to the back, as a share of the depth.
    slope: f32,
    /// Height of a tooth.
    height: f32,
    /// Height by which upper teeth pass in front of lower ones.
    bite: f32,
    /// Number of an upper and of a lower tooth that is missing.
    missing: Option<u8>,
    /// Two upper teeth are twice as long.
    has_fangs: bool,
    has_gums: bool,
    /// The teeth of each jaw are one mesh.
    is_joined: bool,
    has_tongue: bool,
}

const USUAL: Mouth = Mouth {
    name: "thirteen teeth",
    teeth: [13, 13],
    arch: [0.8, 0.81],
    slope: 0.0,
    height: 0.08,
    bite: 0.0,
    missing: None,
    has_fangs: false,
    has_gums: true,
    is_joined: false,
    has_tongue: false,
};

/// Adds a gum: a tube with four corners along some places.
fn add_gum((points, triangles): &mut heads::Mesh, places: &[Vec3], size: Vec3) {
    let first = points.len() as u32;
    for place in places {
        points.extend(
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[y, z]: [f32; 2]| *place + 0.5 * size * Vec3::new(0.0, y, z)),
        );
    }
    for section in 0..places.len() as u32 - 1 {
        for corner in 0..4 {
            let [a, b] = [corner, (corner + 1) % 4].map(|corner| first + 4 * section + corner);
            triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
}

/// Adds the upper or the lower teeth, and their gum; returns their points.
fn add_jaw(
    mesh: &mut heads::Mesh,
    mouth: &Mouth,
    is_upper: bool,
    middle: Vec3,
    [eyes, half]: [f32; 2],
) -> Range<usize> {
    let from = mesh.0.len();
    let (side, teeth) = if is_upper { (1.0, mouth.teeth[0]) } else { (-1.0, mouth.teeth[1]) };
    let on_arch = |along: f32, up: f32, forward: f32, width: f32| {
        let back = mouth.arch[1] * half * along * along;
        let aside = width * mouth.arch[0] * half * along;
        middle + Vec3::new(aside, up * eyes + mouth.slope * back, (forward - 0.05) * eyes - back)
    };
    let middle_up = side * (0.5 * mouth.height + 0.005 - 0.5 * mouth.bite);
    let forward = if is_upper && mouth.bite > 0.0 { 0.045 } else { 0.0 };
    let along = |tooth: u8| 2.0 * f32::from(tooth) / f32::from(teeth - 1) - 1.0;
    if mouth.is_joined {
        let places: Vec<Vec3> = (0..teeth).map(|tooth| on_arch(along(tooth), middle_up, forward, 1.0)).collect();
        add_gum(mesh, &places, eyes * Vec3::new(0.0, mouth.height, 0.04));
    } else {
        let width = 1.8 * mouth.arch[0] * half / f32::from(teeth - 1);
        for tooth in (0..teeth).filter(|tooth| mouth.missing != Some(*tooth)) {
            let is_fang = mouth.has_fangs && is_upper && (tooth == teeth / 4 || tooth == teeth - 1 - teeth / 4);
            let (longer, forward) = if is_fang { (mouth.height, forward + 0.03) } else { (0.0, forward) };
            let at = on_arch(along(tooth), middle_up - 0.5 * longer, forward, 1.0);
            add_bar(mesh, at, Vec3::new(width, (mouth.height + longer) * eyes, 0.04 * eyes));
        }
    }
    if mouth.has_gums {
        let up = side * (mouth.height + 0.02 - 0.5 * mouth.bite);
        let places: Vec<Vec3> = (-12..=12_i8).map(|at| on_arch(f32::from(at) / 12.0, up, forward, 1.0625)).collect();
        add_gum(mesh, &places, 0.06 * eyes * Vec3::ONE);
    }
    from..mesh.0.len()
}

/// Adds the teeth to a head, and returns the points that follow the jaw other than they should.
fn stray_points((head, marks): &(heads::Mesh, Vec<usize>), mouth: &Mouth) -> Vec<String> {
    let mut mesh = head.clone();
    let marks = heads::true_landmarks(&mesh.0, marks);
    let eyes = marks.eye_distance();
    let middle = marks.points[60..68].iter().sum::<Vec3>() / 8.0;
    let half = 0.5 * (marks.points[48].x - marks.points[54].x).abs();
    let jaws = [true, false].map(|is_upper| add_jaw(&mut mesh, mouth, is_upper, middle, [eyes, half]));
    if mouth.has_tongue {
        add_bar(&mut mesh, middle + eyes * Vec3::new(0.0, -0.07, -0.23), eyes * Vec3::new(0.2, 0.05, 0.26));
    }
    let settings =
        AutoSettings { bones: 12, up: Some(Vec3::Y), forward: Some(Vec3::Z), whole: true, ..AutoSettings::default() };
    let analysis = FaceAnalysis::new(&mesh.0, &mesh.1, &settings, &|_, _| true).unwrap();
    let face = analysis.rig(&[], &settings, ExpressionSet::bundled(), &|_, _| true).unwrap();
    let jaw = 2 + face.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw).unwrap();
    let mut stray = Vec::new();
    for (points, wanted) in jaws.into_iter().zip([0.0, 1.0]) {
        for point in points {
            let of_jaw = face.weights.of(point).filter(|(joint, _)| *joint as usize == jaw);
            let share: f32 = of_jaw.map(|(_, value)| value).sum();
            if (share - wanted).abs() >= 1e-3 {
                let at = (mesh.0[point] - middle) / eyes;
                stray
                    .push(format!("{}: point {point} at {at:.2} follows the jaw by {share}, not {wanted}", mouth.name));
            }
        }
    }
    stray
}

/// Single teeth go with their row and its gum, also those in the back, which are as far below the plane of the lips as the
/// front teeth of the other jaw.
#[test]
fn single_teeth_go_with_their_jaw() {
    let wide = Mouth { name: "wide", arch: [1.1, 1.2], ..USUAL };
    check(
        "ict_neutral",
        &[
            USUAL,
            wide,
            Mouth { name: "seven teeth", teeth: [7, 7], ..USUAL },
            Mouth { name: "sixteen and fourteen teeth in a deep arch", teeth: [16, 14], arch: [0.8, 1.4], ..USUAL },
            Mouth { name: "narrow", arch: [0.5, 0.6], teeth: [10, 10], height: 0.06, ..USUAL },
            Mouth { name: "fangs", has_fangs: true, ..USUAL },
            Mouth { name: "a tooth missing", missing: Some(9), ..USUAL },
            Mouth { name: "the last but one missing", missing: Some(1), has_gums: false, ..USUAL },
            Mouth { name: "overbite", bite: 0.03, ..USUAL },
        ],
    );
}

/// Teeth without gums, and rows that rise or sink to the back.
#[test]
fn rows_without_gums_and_sloping_rows_go_with_their_jaw() {
    let bare = Mouth { has_gums: false, ..USUAL };
    check(
        "ict_identity_1",
        &[
            Mouth { name: "no gums", ..bare },
            Mouth { name: "no gums, eight teeth", teeth: [8, 8], height: 0.1, ..bare },
            Mouth { name: "rising", slope: 0.3, teeth: [14, 14], ..USUAL },
            Mouth { name: "sinking", slope: -0.3, teeth: [14, 14], ..USUAL },
            Mouth { name: "rising without gums", slope: 0.3, teeth: [12, 10], ..bare },
            Mouth { name: "fangs without gums", has_fangs: true, teeth: [10, 10], ..bare },
        ],
    );
}

/// Teeth of one mesh a jaw, and mouths with a tongue.
#[test]
fn joined_teeth_and_teeth_around_a_tongue_go_with_their_jaw() {
    let joined = Mouth { is_joined: true, ..USUAL };
    check(
        "ict_identity_2",
        &[
            Mouth { name: "joined", ..joined },
            Mouth { name: "joined without gums", has_gums: false, ..joined },
            Mouth { name: "tongue", has_tongue: true, ..USUAL },
            Mouth { name: "tongue without gums", has_tongue: true, has_gums: false, ..USUAL },
        ],
    );
}

#[track_caller]
fn check(head: &str, mouths: &[Mouth]) {
    let Some(data) = test_data() else { return };
    let head = (heads::mesh(&data.join(format!("heads/{head}.obj"))), heads::truth(&data));
    let stray: Vec<String> = mouths.iter().flat_map(|mouth| stray_points(&head, mouth)).collect();
    assert!(
        stray.is_empty(),
        "{} points follow the wrong jaw, such as {:#?}",
        stray.len(),
        &stray[..stray.len().min(8)]
    );
}
