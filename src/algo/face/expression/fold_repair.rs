//! Smoothing of weights in the few places where an expression would fold the skin.
//!
//! Between lips or lids that meet, the weights of a small triangle may change from one side to the other, and the
//! movement that opens the two flips it. Holding the bones back would weaken the expression; averaging the weights of
//! the triangle's corners with their neighbours' is not visible.

use glam::{Affine3A, Vec3, Vec3A};
use rayon::prelude::*;

use super::{ExpressionSet, FittedFace, Mix, bone_fit::SLIVER, text::Expression};
use crate::{
    algo::face::{bones::FaceBone, landmarks::Landmarks, weights::Mirror},
    mesh::{adjacency::weld, influences::keep_strongest_alike, model::Weights},
};

/// Number of passes; each solves the bones' movements anew.
const PASSES: usize = 5;
/// Rounds of averaging in a pass.
const ROUNDS: usize = 120;
/// Rounds after which places one edge further from the corners are averaged, too; the first do so after one round. On a dense
/// mesh a fold is many edges wide.
const WIDEN: usize = 10;
/// Rounds without fewer folds after which a pass ends.
const PATIENCE: usize = 60;
/// Share of its own weights that a place keeps in a round.
const OWN: f32 = 0.25;

type Influences = Vec<(u32, f32)>;

/// Averages weights where one of the six expressions at full strength turns a triangle by more than a right angle.
///
/// All in head space; `mask` and `weights` as [`FittedFace::new`] takes them. Points at the same place keep the same
/// weights. Bones move otherwise with other weights, so that each pass poses anew, and the weights with the fewest folds
/// are kept, of which no point has more than `most`. Returns the folds that are left, summed over the six, after
/// [`FittedFace::pose`] has repaired the poses. Cost: a few poses of every expression.
pub fn repair_folds(
    set: &ExpressionSet,
    points: &[Vec3],
    triangles: &[[u32; 3]],
    mask: &[bool],
    weights: &mut Weights,
    bones: &[FaceBone],
    landmarks: &Landmarks,
    most: usize,
) -> usize {
    if weights.len() != points.len() || triangles.iter().flatten().any(|&corner| corner as usize >= points.len()) {
        return 0;
    }
    let six: Vec<&Expression> = set.six().collect();
    let mut surface: Option<Surface> = None;
    let mut best: Option<(usize, Weights)> = None;
    let mirror = Mirror::new(points, bones, landmarks);
    let mut face =
        FittedFace::new(points, triangles, mask, weights, bones, landmarks, set.unit_set()).keeping_targets();
    for pass in 0..=PASSES {
        if pass > 0 {
            face = face.with_weights(points, triangles, mask, weights);
        }
        let posed = |expression: &&Expression| {
            let (poses, repair) = face.pose_and_repair(&Mix::of(&[(*expression, 1.0)], set.unit_set()));
            let moved = poses.into_iter().zip(bones).map(|(pose, bone)| pose.affine(bone.position));
            ([Affine3A::IDENTITY; 2].into_iter().chain(moved).collect(), repair.folded)
        };
        let (poses, all): (Vec<Vec<Affine3A>>, Vec<Vec<u32>>) = six.par_iter().map(posed).unzip();
        let sum = all.iter().map(Vec::len).sum();
        // A pass that helped nothing is the last.
        if best.as_ref().is_some_and(|(least, _)| sum >= *least) {
            break;
        }
        best = Some((sum, weights.clone()));
        if sum == 0 || pass == PASSES {
            break;
        }
        let surface = surface.get_or_insert_with(|| Surface::new(points, triangles));
        let mut folded = all.concat();
        sort(&mut folded);
        let mut averaged = AveragedWeights {
            surface,
            points,
            triangles,
            weights,
            most,
            poses: &poses,
            own: vec![Vec::new(); surface.first.len()],
            posed: vec![Vec::new(); surface.first.len()],
        };
        averaged.smooth(folded);
        *weights = averaged.weights();
        if let Some(mirror) = &mirror {
            mirror.apply(weights, most);
        }
    }
    let Some((left, best)) = best else { return 0 };
    *weights = best;
    left
}

/// Sorts numbers and drops those that come again.
fn sort(numbers: &mut Vec<u32>) {
    numbers.sort_unstable();
    numbers.dedup();
}

/// The welded surface.
struct Surface {
    /// Place of each point.
    place_of: Vec<u32>,
    /// The first point at each place.
    first: Vec<u32>,
    /// Triangles around each place: where its list starts, with one more entry at the end.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Surface {
    fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (place_of, count) = weld(points);
        let mut first = vec![u32::MAX; count];
        for (point, &place) in place_of.iter().enumerate() {
            let first = &mut first[place as usize];
            *first = (*first).min(point as u32);
        }
        let mut starts = vec![0_u32; count + 1];
        for corner in triangles.iter().flatten() {
            starts[place_of[*corner as usize] as usize + 1] += 1;
        }
        for place in 0..count {
            starts[place + 1] += starts[place];
        }
        let mut next = starts.clone();
        let mut around = vec![0_u32; 3 * triangles.len()];
        for (index, triangle) in triangles.iter().enumerate() {
            for corner in triangle {
                let next = &mut next[place_of[*corner as usize] as usize];
                around[*next as usize] = index as u32;
                *next += 1;
            }
        }
        Self { place_of, first, starts, triangles: around }
    }

    fn triangles_of(&self, place: u32) -> &[u32] {
        let [from, to] = [0, 1].map(|next| self.starts[place as usize + next] as usize);
        &self.triangles[from..to]
    }
}

/// Weights of a surface, some of them averaged.
struct AveragedWeights<'a> {
    surface: &'a Surface,
    points: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    weights: &'a Weights,
    /// Largest number of influences of a point.
    most: usize,
    /// Matrices of the joints in each pose.
    poses: &'a [Vec<Affine3A>],
    /// Averaged weights of each place; empty where they are as they were.
    own: Vec<Influences>,
    /// The place in each pose; empty where nobody has asked yet.
    posed: Vec<Vec<Vec3A>>,
}

impl AveragedWeights<'_> {
    /// Averages until no triangle is folded or all rounds are over.
    fn smooth(&mut self, mut folded: Vec<u32>) {
        let (mut least, mut waited) = (usize::MAX, 0);
        for round in 0..ROUNDS {
            let rings = if round > 0 { 1 + round / WIDEN } else { 0 };
            let places = self.around(&folded, rings);
            let averaged = |&place: &u32| {
                let influences = self.average(place);
                let posed = self.posed_with(place, || influences.iter().copied());
                (influences, posed)
            };
            let averages: Vec<(Influences, Vec<Vec3A>)> = places.par_iter().map(averaged).collect();
            for (&place, (influences, posed)) in places.iter().zip(averages) {
                self.own[place as usize] = influences;
                self.posed[place as usize] = posed;
            }
            // The corners of all folded triangles have changed, so that no other triangle can be folded.
            let mut near: Vec<u32> =
                places.iter().flat_map(|&place| self.surface.triangles_of(place)).copied().collect();
            sort(&mut near);
            let mut unknown: Vec<u32> = near.iter().flat_map(|&triangle| self.places(triangle)).collect();
            unknown.retain(|&place| self.posed[place as usize].is_empty());
            sort(&mut unknown);
            let posed: Vec<Vec<Vec3A>> =
                unknown.par_iter().map(|&place| self.posed_with(place, || self.weights_of(place))).collect();
            for (&place, posed) in unknown.iter().zip(posed) {
                self.posed[place as usize] = posed;
            }
            folded = near.into_par_iter().filter(|&triangle| self.is_folded(triangle)).collect();
            waited = if folded.len() < least { 0 } else { waited + 1 };
            least = least.min(folded.len());
            if folded.is_empty() || waited == PATIENCE {
                return;
            }
        }
    }

    /// Corners of triangles and the places up to so many edges from them, in rising order.
    fn around(&self, triangles: &[u32], rings: usize) -> Vec<u32> {
        let mut places: Vec<u32> = triangles.iter().flat_map(|&triangle| self.places(triangle)).collect();
        sort(&mut places);
        let mut is_in = vec![false; self.surface.first.len()];
        places.iter().for_each(|&place| is_in[place as usize] = true);
        let mut from = 0;
        for _ in 0..rings {
            let to = places.len();
            for at in from..to {
                for other in self.next_to(places[at]) {
                    if !std::mem::replace(&mut is_in[other as usize], true) {
                        places.push(other);
                    }
                }
            }
            from = to;
        }
        places.sort_unstable();
        places
    }

    /// The weights of all points.
    fn weights(&self) -> Weights {
        let mut weights = Weights::default();
        for (point, &place) in self.surface.place_of.iter().enumerate() {
            match self.own[place as usize].as_slice() {
                [] => weights.push(self.weights.of(point)),
                own => weights.push(own.iter().copied()),
            }
        }
        weights
    }

    /// A share of a place's own weights plus the mean of its neighbours', in which near ones count more.
    ///
    /// A triangle folds where weights change much over a short way, mostly where tiny triangles meet large ones. With
    /// shares by the square of the distance the change is even along the surface, not from one point to the next.
    fn average(&self, place: u32) -> Influences {
        let near = |other: u32| 1.0 / self.at(other).distance_squared(self.at(place)).max(f32::MIN_POSITIVE);
        let next = self.next_to(place);
        let all: f32 = next.iter().map(|other| near(*other)).sum();
        let mut sum: Influences = Vec::with_capacity(4 * self.most);
        let mut add = |place: u32, share: f32| {
            let mut add_one = |(joint, weight): (u32, f32)| match sum.binary_search_by_key(&joint, |entry| entry.0) {
                Ok(known) => sum[known].1 += weight * share,
                Err(at) => sum.insert(at, (joint, weight * share)),
            };
            match self.own[place as usize].as_slice() {
                [] => self.weights_of(place).for_each(&mut add_one),
                own => own.iter().copied().for_each(&mut add_one),
            }
        };
        if all.is_finite() && all > 0.0 {
            add(place, OWN);
            next.iter().for_each(|other| add(*other, (1.0 - OWN) * near(*other) / all));
        } else {
            add(place, 1.0);
        }
        sum.retain(|(_, weight)| *weight > 1e-4);
        keep_strongest_alike(&mut sum, self.most, 0.0);
        sum
    }

    fn at(&self, place: u32) -> Vec3 {
        self.points[self.surface.first[place as usize] as usize]
    }

    /// Places of a triangle's corners.
    fn places(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize].map(|corner| self.surface.place_of[corner as usize])
    }

    /// Places that share a triangle with a place, in rising order.
    fn next_to(&self, place: u32) -> Vec<u32> {
        let all = self.surface.triangles_of(place).iter().flat_map(|&triangle| self.places(triangle));
        let mut next: Vec<u32> = all.filter(|&other| other != place).collect();
        sort(&mut next);
        next
    }

    /// Weights of a place as they were.
    fn weights_of(&self, place: u32) -> impl Iterator<Item = (u32, f32)> + '_ {
        self.weights.of(self.surface.first[place as usize] as usize)
    }

    /// A place with some weights, in each pose.
    fn posed_with<I: Iterator<Item = (u32, f32)>>(&self, place: u32, influences: impl Fn() -> I) -> Vec<Vec3A> {
        let rest = Vec3A::from(self.at(place));
        let posed = |matrices: &Vec<Affine3A>| {
            let moved = influences()
                .filter_map(|(joint, weight)| Some(matrices.get(joint as usize)?.transform_point3a(rest) * weight));
            moved.fold(Vec3A::ZERO, |sum, moved| sum + moved)
        };
        self.poses.iter().map(posed).collect()
    }

    /// True if any of the poses flips the orientation of a triangle.
    fn is_folded(&self, triangle: u32) -> bool {
        let normal = |[a, b, c]: [Vec3A; 3]| (b - a).cross(c - a);
        let places = self.places(triangle);
        let [a, b, c] = places.map(|place| Vec3A::from(self.at(place)));
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        let rest = normal([a, b, c]);
        // Slivers have no orientation.
        rest.length() > SLIVER * longest
            && (0..self.poses.len()).any(|pose| {
                let posed = places.map(|place| self.posed[place as usize].get(pose).copied().unwrap_or_default());
                rest.dot(normal(posed)) < 0.0
            })
    }
}
