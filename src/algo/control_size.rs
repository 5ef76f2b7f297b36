//! Sizes of control shapes that stand on a body: shapes that would lie in the flesh are enlarged.

use bevy::math::Vec3;

use crate::mesh::{ray::Ray, surface::Surface};

/// Share of a shape's length that has to be outside of the mesh.
pub const OUTSIDE: f32 = 0.75;

/// Largest factor.
pub const MOST: f32 = 4.0;

/// Share of its length that is outside of a shape that people find and hit.
pub const SEEN: f32 = 0.5;

/// Largest factor of a shape that would not be [`SEEN`] otherwise: about a short bone in wide plumage, for example.
const MOST_UNSEEN: f32 = 8.0;

/// Share of its length below which a shape is lost in the flesh: about the thigh of a bird, for example, which lies in the trunk.
const LOST: f32 = 0.3;

/// Largest factor of a lost shape.
const MOST_LOST: f32 = 10.0;

/// Factor between one size that is tried and the next.
const STEP: f32 = 1.08;

/// Directions of the lines that tell inside from outside; most of them decide, so that a hole in the mesh does not.
const DIRECTIONS: [Vec3; 3] = [
    Vec3::new(0.267_261, 0.534_522, 0.801_784),
    Vec3::new(-0.811_107, 0.324_443, 0.486_664),
    Vec3::new(0.333_333, -0.666_667, 0.666_667),
];

/// Factor by which a shape has to grow about a point so that [`OUTSIDE`] of its length is outside of a closed mesh: 1 for a
/// shape that is, up to [`MOST`]. Where no factor is enough, the one with the most length outside; where that is less than half,
/// the first beyond with half outside, up to twice as large, and where nothing of three tenths was found the first with those, up
/// to two and a half times as large.
///
/// `lines` are the shape's polylines at factor 1, in the space of the surface. A shape of `n` points costs `3 n` to `240 n` ray
/// queries.
pub fn clear_factor(surface: &Surface, lines: &[Vec<Vec3>], about: Vec3) -> f32 {
    let (best, next) = grown(surface, lines, about, OUTSIDE);
    for (below, most) in [(SEEN, MOST_UNSEEN), (LOST, MOST_LOST)] {
        let mut larger = next;
        while best.share < below && larger <= most {
            if outside_share(surface, lines, about, larger) >= below {
                return larger;
            }
            larger *= STEP;
        }
    }
    best.factor
}

/// Factor by which a shape with a size of its own has to grow about a point so that half of its length is outside of a closed
/// mesh: 1 for a shape that is, up to [`MOST`]. Where no factor is enough, the one with the most length outside.
///
/// `lines` are as for [`clear_factor`].
pub fn seen_factor(surface: &Surface, lines: &[Vec<Vec3>], about: Vec3) -> f32 {
    grown(surface, lines, about, SEEN).0.factor
}

/// Size of a shape, and the share of its length that is outside then.
struct Growth {
    share: f32,
    factor: f32,
}

/// The first factor up to [`MOST`] with a share of the length outside, or the one with the most; and the next one to try.
fn grown(surface: &Surface, lines: &[Vec<Vec3>], about: Vec3, wanted: f32) -> (Growth, f32) {
    let mut best = Growth { share: 0.0, factor: 1.0 };
    let mut factor = 1.0;
    while factor <= MOST && best.share < wanted {
        let share = outside_share(surface, lines, about, factor);
        if share > best.share {
            best = Growth { share, factor };
        }
        factor *= STEP;
    }
    (best, factor)
}

/// Share of a shape's length that is outside of a closed mesh, with the shape enlarged about a point by a factor; 1 for a
/// shape without length.
pub fn outside_share(surface: &Surface, lines: &[Vec<Vec3>], about: Vec3, factor: f32) -> f32 {
    let (mut outside, mut length) = (0.0, 0.0);
    for ends in lines.iter().flat_map(|line| line.windows(2)) {
        let step = ends[0].distance(ends[1]);
        let middle = about + (ends[0].midpoint(ends[1]) - about) * factor;
        length += step;
        if !is_inside(surface, middle) {
            outside += step;
        }
    }
    if length > 0.0 { outside / length } else { 1.0 }
}

/// True if a point is inside of a closed mesh: on most lines through it, the rays to both sides leave the mesh more often than
/// they enter it, or less often where the mesh is inside out. A point beneath a sheet, such as the open plumage of a bird, has
/// such rays to one side alone and is outside.
pub fn is_inside(surface: &Surface, point: Vec3) -> bool {
    let mut hits = Vec::new();
    let mut is_enclosed = |direction: Vec3| {
        hits.clear();
        surface.hits(&Ray { origin: point, direction }, &mut hits);
        let entering = hits.iter().filter(|hit| hit.entering).count();
        2 * entering != hits.len()
    };
    let inside = DIRECTIONS.iter().map(|direction| direction.normalize());
    let inside = inside.filter(|direction| is_enclosed(*direction) && is_enclosed(-*direction));
    inside.count() * 2 > DIRECTIONS.len()
}
