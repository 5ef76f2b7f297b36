//! Analysis: what depends on the mesh alone.

use std::ops::RangeInclusive;

use glam::Vec3;

use super::{
    FitError, FitSettings,
    assign::{self, Directions, Hypothesis, LimbMarker},
    chain, clean, clutter,
    limbs::TemplateLimbs,
    markers::Marker,
    symmetry::{self, MirrorPlane},
    target,
    tree::{self, Tree, TreeRole},
    volume,
};
use crate::mesh::{surface::Surface, voxels::Voxels};

/// Solid cells of a body, about.
const NODES: f32 = 90_000.0;
/// Cells along the longest side for the first look.
const COARSE: usize = 64;
/// Cells along the longest side between which limbs are seen and time is well spent.
const FINE: RangeInclusive<usize> = 96..=240;
/// Solid cells with the fewest along a side from which on a mesh is a block: it has no limbs to be seen, and would take ten
/// times as long as a body.
const BLOCK: usize = 250_000;
/// Extent of a mesh along its thinnest axis below which it is flat, as a share of the longest.
const FLAT: f32 = 0.004;
/// Distance from the volume from which on a marker lies outside of it, in unit space.
const OUTSIDE: f32 = 0.05;

/// Penalty of an assignment from which on an animal may have shorter legs than are seen.
const POOR: f32 = 0.75;

/// Times that a mesh is looked at without parts that are too far from the body: from nearer, there may be more of them.
const NEARER: usize = 3;

/// Analysis of a mesh, independent of any template; several fits may use it.
#[derive(Debug, Clone)]
pub struct MeshAnalysis {
    pub(super) mesh: clean::CleanMesh,
    pub(super) voxels: Voxels,
    pub(super) surface: Surface,
    pub(super) target: target::Target,
    pub(super) graph: volume::VoxelGraph,
    pub(super) trees: Vec<Tree>,
    /// Plane of symmetry, if the mesh has one.
    pub(super) mirror: Option<MirrorPlane>,
    /// Seam on which the part of the mesh hangs on the rest of it, in unit space.
    pub(super) seam: Option<Vec3>,
    /// Shells that the figure stands on, and sheets about its body, which were left out.
    pub(super) grounds: usize,
    pub(super) sheets: usize,
}

impl MeshAnalysis {
    /// Analyses a mesh, or only the triangles with the numbers `region`.
    ///
    /// `progress` is called with a share of the work done, 0 to 1, and cancels with `false`. Triangles with corners
    /// that do not exist or are not finite are left out. Time: about 0.15 s for a body.
    ///
    /// # Errors
    /// [`FitError::NoSurface`], [`FitError::Flat`], [`FitError::Cancelled`].
    pub fn new(
        points: &[Vec3],
        triangles: &[[u32; 3]],
        region: Option<&[u32]>,
        progress: &(dyn Fn(f32) -> bool + Sync),
    ) -> Result<Self, FitError> {
        let step = |share: f32| if progress(share) { Ok(()) } else { Err(FitError::Cancelled) };
        step(0.0)?;
        let seam = region.and_then(|region| chain::seam(points, triangles, region));
        let chosen: Vec<[u32; 3]>;
        let triangles = match region {
            Some(region) => {
                chosen = region.iter().filter_map(|&t| triangles.get(t as usize).copied()).collect();
                &chosen
            }
            None => triangles,
        };
        // Whatever is left out is left out of all that follows: the figure is fitted as if it were alone.
        let figure = if region.is_none() { clutter::figure(points, triangles) } else { None };
        let (grounds, sheets) = figure.as_ref().map_or((0, 0), |figure| (figure.grounds, figure.sheets));
        let triangles = figure.as_ref().map_or(triangles, |figure| figure.triangles.as_slice());
        let mut look = Look::new(points, triangles, &step)?;
        let loose = look.graph.loose;
        let mut kept: Option<Vec<[u32; 3]>> = None;
        for _ in 0..NEARER {
            let Look { mesh, voxels, graph, .. } = &look;
            if graph.loose == 0 {
                break;
            }
            let from = kept.as_deref().unwrap_or(triangles);
            let Some(near) = clutter::near(points, from, mesh.space, voxels, graph) else { break };
            look = Look::new(points, &near, &step)?;
            kept = Some(near);
        }
        let Look { mesh, voxels, surface, target, mut graph } = look;
        graph.loose = loose.max(graph.loose);
        step(0.7)?;
        let mut trees = tree::trees(&graph, TreeRole::Usual);
        let file_axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|d| mesh.space.direction_to_unit(d));
        let mirror = symmetry::of_mesh(&graph, &voxels, file_axes);
        // A staff or a shield in one hand bends the centre lines of the whole arm: without it they are tried, too.
        if let Some(core) = mirror.and_then(|plane| symmetry::core(&graph, &voxels, &plane)) {
            trees.extend(tree::trees(&core, TreeRole::Carrier));
        }
        let of_short_legs = tree::of_short_legs(&graph, &trees);
        trees.extend(of_short_legs);
        step(1.0)?;
        if trees.is_empty() {
            return Err(FitError::NoSurface);
        }
        let seam = seam.map(|place| mesh.space.to_unit(place));
        Ok(Self { mesh, voxels, surface, target, graph, trees, mirror, seam, grounds, sheets })
    }

    /// True if thousands of triangles lie over each other, so that the nearest points of the surface are looked for roughly.
    pub fn is_crowded(&self) -> bool {
        self.target.most_leaves < usize::MAX
    }

    /// Number of the solid cells in which the mesh is analysed.
    pub fn cells(&self) -> usize {
        self.voxels.len()
    }

    /// Ends of the mesh's branches in its space, longest first: limbs, and what hangs on them.
    pub fn branch_ends(&self) -> Vec<Vec3> {
        let tree = &self.trees[0];
        tree.branches.leaves.iter().map(|&l| self.mesh.space.to_file(tree.lines[l].at(0.0))).collect()
    }

    /// Centre lines of the mesh's branches in its space, for drawing.
    pub fn centre_lines(&self) -> Vec<Vec<Vec3>> {
        let tree = &self.trees[0];
        let line = |leaf: &usize| {
            let line = &tree.lines[*leaf];
            line.points[..line.free_count].iter().map(|&p| self.mesh.space.to_file(p)).collect()
        };
        tree.branches.leaves.iter().map(line).collect()
    }

    /// Place, in unit space, that the skeleton hangs on.
    pub(super) fn root(&self, settings: &FitSettings) -> Option<Vec3> {
        settings.root.map(|place| self.mesh.space.to_unit(place)).or(self.seam)
    }

    /// Assignments of a template's limbs to branches, best first.
    pub(super) fn hypotheses(
        &self,
        template: &TemplateLimbs,
        settings: &FitSettings,
        markers: &[Marker],
    ) -> Result<Vec<Hypothesis>, FitError> {
        let space = &self.mesh.space;
        let directions = Directions {
            up: settings.up.map(|d| space.direction_to_unit(d)),
            forward: settings.forward.map(|d| space.direction_to_unit(d)),
            file_axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|d| space.direction_to_unit(d)),
            mirror: self.mirror.map(|plane| (plane.point, plane.normal)),
            root: self.root(settings),
        };
        let of_limb = |marker: &Marker| {
            let limb = template.limbs.iter().position(|l| l.joints.contains(&marker.joint))?;
            Some(LimbMarker { limb, place: marker.place })
        };
        let told = markers.iter().filter(|marker| !marker.is_alone());
        let limb_markers: Vec<LimbMarker> = told.filter_map(of_limb).collect();
        let assign = |is_tried: &dyn Fn(&Tree) -> bool| {
            assign::assign(&self.graph, &self.trees, template, &directions, &limb_markers, is_tried)
        };
        let wanted = template.limbs.len();
        let is_figure = |found: &[Hypothesis]| {
            let shown = found.first().map_or(0, |best| best.leaves.iter().filter(|l| l.is_some()).count());
            shown * 2 >= wanted
        };
        let mut found = assign(&|tree| !tree.is_last_resort());
        let is_poor = found.first().is_some_and(|best| best.posed_cost() > POOR);
        if template.is_on_fours() && is_poor && is_figure(&found) {
            found = assign(&|_| true);
        }
        if is_figure(&found) {
            return Ok(found);
        }
        let usual = self.trees.iter().filter(|tree| !tree.is_last_resort());
        let ends = usual.map(|tree| tree.branches.leaves.len()).max().unwrap_or(0);
        Err(FitError::TooFewLimbs { found: ends, wanted })
    }

    /// Least and greatest corner of the mesh in its space.
    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        let used = self.mesh.triangles.iter().flatten();
        let corners = used.map(|&c| self.mesh.space.to_file(self.mesh.points[c as usize]));
        corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    }

    /// Markers of the settings in unit space.
    pub(super) fn markers(&self, settings: &FitSettings) -> Vec<Marker> {
        let marker = |&(joint, position): &(usize, Vec3)| {
            let place = self.mesh.space.to_unit(position);
            Marker {
                joint,
                place,
                outside: self.distance_from_volume(place) > OUTSIDE,
                against: false,
                mirrored: false,
            }
        };
        settings.markers.iter().map(marker).collect()
    }

    /// Distance of a place from the volume, in unit space.
    fn distance_from_volume(&self, place: Vec3) -> f32 {
        let centres = self.graph.centres.iter();
        centres.map(|centre| centre.distance_squared(place)).fold(f32::INFINITY, f32::min).sqrt()
    }

    /// True if a place, in unit space, is in the volume.
    pub(super) fn is_solid(&self, place: Vec3) -> bool {
        let cell = self.voxels.cell_at(self.voxels.to_grid(place));
        cell.is_some_and(|cell| self.voxels.solid_index(cell).is_some())
    }

    /// Height of the lowest place of the figure along a direction of the mesh's space, where what it stands on was left out.
    pub fn floor(&self, up: Vec3) -> Option<f32> {
        let used = self.mesh.triangles.iter().flatten().map(|&c| self.mesh.points[c as usize]);
        let heights = used.map(|place| self.mesh.space.to_file(place).dot(up));
        (self.grounds > 0).then(|| heights.fold(f32::INFINITY, f32::min))
    }

    /// Extent of the mesh along a direction of unit space, in the mesh's unit.
    pub(super) fn height(&self, up: Vec3) -> f32 {
        let along = |p: &Vec3| p.dot(up);
        let used = self.mesh.triangles.iter().flatten().map(|&c| along(&self.mesh.points[c as usize]));
        let (low, high) = used.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), d| (l.min(d), h.max(d)));
        ((high - low) as f64 / self.mesh.space.scale) as f32
    }
}

/// First part of an analysis: surface and volume.
struct Look {
    mesh: clean::CleanMesh,
    voxels: Voxels,
    surface: Surface,
    target: target::Target,
    graph: volume::VoxelGraph,
}

impl Look {
    fn new(
        points: &[Vec3],
        triangles: &[[u32; 3]],
        step: &dyn Fn(f32) -> Result<(), FitError>,
    ) -> Result<Self, FitError> {
        let mesh = clean::clean(points, triangles).ok_or(FitError::NoSurface)?;
        step(0.15)?;
        let (low, high) =
            mesh.points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
        if (high - low).min_element() < FLAT {
            return Err(FitError::Flat);
        }
        // A first look tells how many cells are solid at a resolution; a stout body gets larger cells.
        let voxels = |resolution: usize| Voxels::new(&mesh.points, &mesh.triangles, resolution, None);
        let coarse = voxels(COARSE).map_err(|_| FitError::NoSurface)?;
        let fine = COARSE as f32 * bevy::math::ops::cbrt(NODES / coarse.len().max(1) as f32);
        let voxels = voxels(resolution(coarse.len(), fine as usize)).map_err(|_| FitError::NoSurface)?;
        step(0.4)?;
        let origin = mesh.space.to_unit(Vec3::ZERO);
        let (surface, (graph, mut target)) = rayon::join(
            || Surface::build(&mesh.points, &mesh.triangles),
            || (volume::graph(&voxels, origin), target::Target::new(&mesh, &voxels)),
        );
        target.bound_looks(&surface, &voxels);
        Ok(Self { mesh, voxels, surface, target, graph })
    }
}

/// Cells along the longest side for a mesh of which the first look has so many solid cells; `wished` are those that give a
/// body its number of cells.
fn resolution(solid: usize, wished: usize) -> usize {
    let (least, coarse) = (*FINE.start(), COARSE);
    let of_least = solid.saturating_mul(least * least * least) / (coarse * coarse * coarse);
    if of_least > BLOCK { wished.min(least) } else { wished.clamp(least, *FINE.end()) }
}
