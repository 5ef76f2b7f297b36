//! Transfer of skin weights from one mesh to another of about the same shape.
//!
//! After Abdrashitov and others 2023, "Robust skin weights transfer via weight inpainting": a point takes the weights
//! of the closest point of the source if that is near and faces the same way; all other points are inpainted from these
//! by a sparse solve on the target's vertex graph.

use glam::Vec3;
use rayon::prelude::*;

use super::weights::fill::{Graph, Links, Nearest, Sparse, Unit, complete, prune};
use crate::mesh::{model::Weights, surface::Surface};

/// A mesh to transfer from or to; both in the same space.
#[derive(Debug, Clone, Copy)]
pub struct TransferMesh<'a> {
    /// Positions.
    pub points: &'a [Vec3],
    /// Corners of triangles over `points`; triangles with a corner out of range are ignored.
    pub triangles: &'a [[u32; 3]],
}

/// Settings of [`transfer_weights`].
#[derive(Debug, Clone, PartialEq)]
pub struct TransferSettings {
    /// Largest distance of a trusted closest point, as a share of the diagonal of the source's box.
    pub distance: f32,
    /// Least cosine of the angle between both normals at a trusted closest point.
    pub cosine: f32,
    /// The largest number of influences of a point.
    pub influences: usize,
}

impl Default for TransferSettings {
    fn default() -> Self {
        // The paper's thresholds: 5 % and 30 degrees.
        Self { distance: 0.05, cosine: 0.866, influences: 8 }
    }
}

/// Sources of the weights of the target's points; the counts add up to the number of points.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TransferReport {
    /// Points at the place of a source point, with its weights unchanged.
    pub copied: usize,
    /// Points with the weights of the closest source point, which is near and faces the same way.
    pub matched: usize,
    /// Points inpainted from matched points around.
    pub inpainted: usize,
    /// Points with the weights of the closest source point although it is far or faces another way, because no point
    /// around matched.
    pub nearest: usize,
    /// Points without weights, because they are not finite.
    pub empty: usize,
}

/// Error of transferring weights.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TransferError {
    /// The weights are not those of the source mesh.
    #[error("the source has {points} points but its weights are for {weights}: they belong to another mesh")]
    WeightCount {
        /// The number of points of the source.
        points: usize,
        /// The number of points of the weights.
        weights: usize,
    },
    /// A source without weights.
    #[error("no finite point of the source mesh has weights; bind it first")]
    NoWeights,
}

/// Transfers weights from `source` to `target`.
///
/// Both meshes are in one space, in any unit; joint indices stay as they are. All finite points of the target get
/// weights that sum to one (copied ones stay as they were). A shell that is inside-out against the source is recognised
/// by the majority of its points. Independent of the number of threads. Cost: a closest-point query a point and a
/// sparse factorisation over the inpainted points.
///
/// # Errors
/// [`TransferError`]: the weights do not fit the source, or it has none.
pub fn transfer_weights(
    source: TransferMesh,
    weights: &Weights,
    target: TransferMesh,
    settings: &TransferSettings,
) -> Result<(Weights, TransferReport), TransferError> {
    if weights.len() != source.points.len() {
        return Err(TransferError::WeightCount { points: source.points.len(), weights: weights.len() });
    }
    let unit = Unit::of(source.points.iter().copied());
    let (from, to) = (unit.all(source.points), unit.all(target.points));
    let source = TransferMesh { points: &from, ..source };
    let target = TransferMesh { points: &to, ..target };
    let origin = Source::new(source, weights, settings.influences.max(1))?;
    let limit = settings.distance.max(0.0) * origin.size;
    let graph = Graph::new(target.points, target.triangles);
    let normals = node_normals(&graph, target);
    let closest: Vec<Option<Closest>> =
        (0..graph.len()).into_par_iter().map(|n| origin.closest(graph.place(n))).collect();

    let mut known: Vec<Option<Sparse>> = vec![None; graph.len()];
    let mut origins = vec![WeightOrigin::Inpainted; graph.len()];
    for island in graph.islands() {
        let cosine = |n: u32| closest[n as usize].as_ref().map_or(0.0, |c| c.normal.dot(normals[n as usize]));
        let near = |n: u32| closest[n as usize].as_ref().is_some_and(|c| c.distance <= limit);
        let facing: f32 = island.iter().filter(|&&n| near(n)).map(|&n| cosine(n).signum()).sum();
        let side = if facing < 0.0 { -1.0 } else { 1.0 };
        for &n in &island {
            let Some(found) = &closest[n as usize] else { continue };
            // Without a normal on either side, directions cannot be compared.
            let blind = found.normal == Vec3::ZERO || normals[n as usize] == Vec3::ZERO;
            let trusted = near(n) && (blind || cosine(n) * side >= settings.cosine);
            if found.same || (trusted && !found.influences.is_empty()) {
                known[n as usize] = Some(found.influences.clone());
                origins[n as usize] = if found.same { WeightOrigin::Copied } else { WeightOrigin::Matched };
            }
        }
    }
    let inpainted = complete(&graph, &known, &vec![false; graph.len()], &Links::default(), settings.influences.max(1));
    let mut report = TransferReport::default();
    let mut result = Weights { starts: vec![0], ..Weights::default() };
    for p in 0..target.points.len() {
        let Some(node) = graph.node(p) else {
            report.empty += 1;
            result.push([]);
            continue;
        };
        let (influences, count) = match (&known[node], &inpainted[node], &closest[node]) {
            (Some(influences), ..) if origins[node] == WeightOrigin::Copied => (influences.clone(), &mut report.copied),
            (Some(influences), ..) => (influences.clone(), &mut report.matched),
            (None, Some(influences), _) => (influences.clone(), &mut report.inpainted),
            (None, None, Some(found)) if !found.influences.is_empty() => {
                (found.influences.clone(), &mut report.nearest)
            }
            _ => (origin.nearest(graph.place(node)), &mut report.nearest),
        };
        *count += 1;
        result.push(influences);
    }
    Ok((result, report))
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum WeightOrigin {
    Copied,
    Matched,
    Inpainted,
}

/// The closest point of the source.
struct Closest {
    distance: f32,
    /// Normal of the source, zero without one.
    normal: Vec3,
    influences: Sparse,
    /// Marks a weighted point of the source at the very same place.
    same: bool,
}

/// Source of the weights.
struct Source<'a> {
    mesh: TransferMesh<'a>,
    weights: &'a Weights,
    surface: Surface,
    normals: Vec<Vec3>,
    /// Weighted, finite points, and a search tree over them.
    weighted: Vec<u32>,
    tree: Nearest,
    size: f32,
    most: usize,
}

impl<'a> Source<'a> {
    fn new(mesh: TransferMesh<'a>, weights: &'a Weights, most: usize) -> Result<Self, TransferError> {
        let usable = |p: usize| mesh.points[p].is_finite() && weights.of(p).len() > 0;
        let weighted: Vec<u32> = (0..mesh.points.len()).filter(|&p| usable(p)).map(|p| p as u32).collect();
        if weighted.is_empty() {
            return Err(TransferError::NoWeights);
        }
        let places: Vec<Vec3> = weighted.iter().map(|&p| mesh.points[p as usize]).collect();
        let (low, high) = places.iter().fold((places[0], places[0]), |(l, h), &p| (l.min(p), h.max(p)));
        let graph = Graph::new(mesh.points, mesh.triangles);
        let nodes = node_normals(&graph, mesh);
        let normals = (0..mesh.points.len()).map(|p| graph.node(p).map_or(Vec3::ZERO, |n| nodes[n])).collect();
        Ok(Self {
            mesh,
            weights,
            surface: Surface::build(mesh.points, mesh.triangles),
            normals,
            weighted,
            tree: Nearest::new(&places),
            size: (high - low).length(),
            most,
        })
    }

    /// The weights of the nearest weighted point.
    fn nearest(&self, place: Vec3) -> Sparse {
        let nearest = self.tree.nearest(place, 1, f32::INFINITY).next();
        nearest.map(|(at, _)| self.weights.of(self.weighted[at as usize] as usize).collect()).unwrap_or_default()
    }

    fn closest(&self, place: Vec3) -> Option<Closest> {
        let (at, distance) = self.tree.nearest(place, 1, f32::INFINITY).next()?;
        let vertex = self.weighted[at as usize] as usize;
        if self.mesh.points[vertex] == place {
            let influences = self.weights.of(vertex).collect();
            return Some(Closest { distance: 0.0, normal: self.normals[vertex], influences, same: true });
        }
        let Some(hit) = self.surface.closest_point(place) else {
            let influences = self.weights.of(vertex).collect();
            return Some(Closest { distance, normal: Vec3::ZERO, influences, same: false });
        };
        let corners = self.mesh.triangles[hit.triangle as usize].map(|c| c as usize);
        let shares = hit.barycentric.to_array();
        let mut influences = Sparse::new();
        let mut normal = Vec3::ZERO;
        for (corner, share) in corners.into_iter().zip(shares) {
            normal += self.normals[corner] * share;
            for (joint, weight) in self.weights.of(corner) {
                match influences.iter_mut().find(|i| i.0 == joint) {
                    Some(found) => found.1 += weight * share,
                    None => influences.push((joint, weight * share)),
                }
            }
        }
        let influences = prune(influences, self.most);
        Some(Closest { distance: hit.distance, normal: normal.normalize_or_zero(), influences, same: false })
    }
}

/// Unit normals of the welded vertices, weighted by area; zero where triangles cancel or there are none.
fn node_normals(graph: &Graph, mesh: TransferMesh) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; graph.len()];
    for triangle in mesh.triangles {
        let corner = |i: usize| mesh.points.get(triangle[i] as usize).and_then(|_| graph.node(triangle[i] as usize));
        if let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) {
            let (pa, pb, pc) = (graph.place(a), graph.place(b), graph.place(c));
            // Edges are scaled first, so that tiny units do not underflow.
            let (u, v) = (pb - pa, pc - pa);
            let area = u.length() * v.length();
            let normal = u.normalize_or_zero().cross(v.normalize_or_zero()) * area.max(f32::MIN_POSITIVE);
            for node in [a, b, c] {
                normals[node] += normal;
            }
        }
    }
    for normal in &mut normals {
        // The largest component is divided out first: squares of tiny numbers vanish.
        let largest = normal.abs().max_element();
        *normal =
            if largest > 0.0 && largest.is_finite() { (*normal / largest).normalize_or_zero() } else { Vec3::ZERO };
    }
    normals
}
