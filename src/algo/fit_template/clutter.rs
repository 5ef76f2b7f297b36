//! Pieces of a mesh that are no part of the figure: what it stands on, sheets that hang about a whole body, and shells that
//! are too far away from it.

use glam::{DVec3, Vec3};

use super::{
    clean::{UnitSpace, principal_axes},
    volume::VoxelGraph,
};
use crate::mesh::{adjacency, voxels::Voxels};

/// Share of the whole surface from which on a shell may be what the figure stands on, how many shells are looked at, and how
/// many are left out.
const GROUND_AREA: f64 = 0.03;
const LOOKED_AT: usize = 4;
const MOST_GROUNDS: usize = 3;
/// Thickness of a pedestal, as a share of its width, and its least width as a share of the height of what stands on it. It is
/// below along the file's second axis.
const PEDESTAL: (f64, f64) = (0.6, 0.25);
/// Thickness and least width, in the same shares, of a ground that may lie on any side, in a file that is turned.
const GROUND: (f64, f64) = (0.1, 0.8);
/// Cosine of the angle between the file's second axis and a pedestal's.
const LEVEL: f64 = 0.9;
/// Share of the height of what stands on a ground by which it may sink into it or hover over it, and share of the surface
/// that may be further below.
const STANDS: f64 = 0.05;
const BELOW: f64 = 0.005;
/// Share of what is next to a ground that has to be over it.
const OVER: f64 = 0.95;
/// Height of what stands on a ground, as a share of its width (folded wings have bodies beside them that are less wide), and
/// thickness of the ground, as a share of that height.
const TALL: f64 = 0.35;
const THICK: f64 = 0.5;
/// Cosines of the angles between a triangle and the ground that it is part of, from which on and up to which it is a face or
/// a rim of it, and share of its surface that faces and rims have. A body has surface in all directions.
const FACE: f64 = 0.95;
const RIM: f64 = 0.3;
const EVEN: f64 = 0.9;

/// Share of the whole surface that a closed body has about which sheets may be left out, and square of the length of its rims
/// below which it is closed, in its areas.
const BODY_AREA: f64 = 0.45;
const CLOSED: f64 = 0.5;
/// Square of the length of its rims, in its areas, from which on a shell is a sheet: a box without one face has 3.2, a half
/// sphere 6.3, a long skirt about 7.
const OPEN: f64 = 3.0;
/// Share of the body's area from which on a sheet is left out, and share of the body's longest side by which it may stand out:
/// wings stand out further.
const SHEET_AREA: f64 = 0.03;
const STANDS_OUT: f64 = 0.25;
/// Distance between the rims of a sheet and of the body, as a share of the body's longest side, up to which they are one seam.
const APART: f64 = 0.02;

/// Triangles of the figure, and what else the mesh has.
pub(super) struct Figure {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Shells that the figure stands on.
    pub(super) grounds: usize,
    /// Sheets about its body.
    pub(super) sheets: usize,
}

/// The figure without what it stands on and without sheets about it; `None` where all of the mesh is the figure.
pub(super) fn figure(points: &[Vec3], triangles: &[[u32; 3]]) -> Option<Figure> {
    let mut shells = Shells::new(points, triangles);
    let mut grounds = 0;
    while grounds < MOST_GROUNDS
        && let Some(ground) = shells.ground()
    {
        shells.leave_out(&[ground]);
        grounds += 1;
    }
    let sheets = shells.sheets();
    shells.leave_out(&sheets);
    let is_less = grounds + sheets.len() > 0;
    is_less.then_some(Figure { triangles: shells.triangles, grounds, sheets: sheets.len() })
}

/// Triangles of the shells that belong to the body of a graph; `None` where all do.
pub(super) fn near(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    space: UnitSpace,
    voxels: &Voxels,
    graph: &VoxelGraph,
) -> Option<Vec<[u32; 3]>> {
    let mut shells = Shells::new(points, triangles);
    let mut votes = vec![(0.0f64, 0.0f64); shells.areas.len()];
    for (corners, &shell) in shells.triangles.iter().zip(&shells.shell_of) {
        let [a, b, c] = corners.map(|corner| space.to_unit(points[corner as usize]));
        let area = f64::from((b - a).cross(c - a).length());
        let vote = &mut votes[shell as usize];
        match graph.is_of_body(voxels, (a + b + c) / 3.0) {
            Some(true) => vote.0 += area,
            Some(false) => vote.1 += area,
            None => {}
        }
    }
    let loose: Vec<u32> = (0..votes.len() as u32).filter(|&s| votes[s as usize].1 > votes[s as usize].0).collect();
    if loose.is_empty() {
        return None;
    }
    shells.leave_out(&loose);
    (!shells.triangles.is_empty()).then_some(shells.triangles)
}

/// A mesh in shells, which share no point.
struct Shells<'a> {
    points: &'a [Vec3],
    /// Triangles with three finite corners.
    triangles: Vec<[u32; 3]>,
    /// Number of each triangle's shell.
    shell_of: Vec<u32>,
    /// Number of each point's position.
    welded: Vec<u32>,
    positions: usize,
    /// Area of each shell; nothing for one that was left out.
    areas: Vec<f64>,
}

impl<'a> Shells<'a> {
    fn new(points: &'a [Vec3], triangles: &[[u32; 3]]) -> Self {
        let (welded, positions) = adjacency::weld(points);
        let usable = |corner: &u32| points.get(*corner as usize).is_some_and(|p| p.is_finite());
        let triangles: Vec<[u32; 3]> = triangles.iter().filter(|t| t.iter().all(usable)).copied().collect();
        let by_position: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|c| welded[c as usize])).collect();
        let (islands, count) = adjacency::islands(&by_position, positions);
        let shell_of: Vec<u32> = by_position.iter().map(|t| islands[t[0] as usize]).collect();
        let mut shells = Self { points, triangles, shell_of, welded, positions, areas: vec![0.0; count] };
        let areas: Vec<f64> = (0..shells.triangles.len()).map(|triangle| shells.area(triangle)).collect();
        for (area, &shell) in areas.iter().zip(&shells.shell_of) {
            shells.areas[shell as usize] += area;
        }
        shells
    }

    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|corner| self.points[corner as usize].as_dvec3())
    }

    fn area(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners(triangle);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Triangles that are part of a shell, or those of all others.
    fn of(&self, shell: u32, is_part: bool) -> impl Iterator<Item = usize> + '_ {
        (0..self.triangles.len()).filter(move |&triangle| (self.shell_of[triangle] == shell) == is_part)
    }

    fn leave_out(&mut self, shells: &[u32]) {
        if shells.is_empty() {
            return;
        }
        let mut is_out = vec![false; self.areas.len()];
        for &shell in shells {
            is_out[shell as usize] = true;
            self.areas[shell as usize] = 0.0;
        }
        let kept = self.triangles.iter().zip(&self.shell_of).filter(|(_, shell)| !is_out[**shell as usize]);
        (self.triangles, self.shell_of) = kept.map(|(corners, shell)| (*corners, *shell)).unzip();
    }

    /// The largest shell that the others stand on.
    fn ground(&self) -> Option<u32> {
        let whole: f64 = self.areas.iter().sum();
        let area = |shell: u32| self.areas[shell as usize];
        let mut large: Vec<u32> =
            (0..self.areas.len() as u32).filter(|&s| area(s) > 0.0 && area(s) >= GROUND_AREA * whole).collect();
        large.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
        large.into_iter().take(LOOKED_AT).find(|&shell| area(shell) < whole && self.is_ground(shell))
    }

    /// True if a shell is flat and wide, and all others stand on one side of it.
    fn is_ground(&self, shell: u32) -> bool {
        let (centre, axes) = self.frame(shell);
        let mut above = 0.0;
        for triangle in self.of(shell, false) {
            above += self.area(triangle) * (middle(self.corners(triangle)) - centre).dot(axes[2]);
        }
        let axes = [axes[0], axes[1], if above < 0.0 { -axes[2] } else { axes[2] }];
        let at = |place: DVec3| DVec3::from_array(axes.map(|axis| (place - centre).dot(axis)));
        let extent = |is_part: bool| {
            let places = self.of(shell, is_part).flat_map(|triangle| self.corners(triangle)).map(at);
            places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
        };
        let ((low, high), (rest_low, rest_high)) = (extent(true), extent(false));
        let (width, thickness) = ((high.x - low.x).min(high.y - low.y), high.z - low.z);
        let tall = rest_high.z - high.z;
        let rest_width = (rest_high.x - rest_low.x).max(rest_high.y - rest_low.y);
        let is_like = |(thick, wide): (f64, f64)| thickness <= thick * width && width >= wide * tall;
        let is_pedestal = axes[2].y > LEVEL && is_like(PEDESTAL);
        let is_tall = tall > 0.0 && tall >= TALL * rest_width && thickness <= THICK * tall;
        if !(is_tall && (is_pedestal || is_like(GROUND)) && self.is_even(shell, axes[2])) {
            return false;
        }
        let (mut all, mut below, mut next, mut over) = (0.0, 0.0, 0.0, 0.0);
        for triangle in self.of(shell, false) {
            let (place, area) = (at(middle(self.corners(triangle))), self.area(triangle));
            all += area;
            if place.z < high.z - STANDS * tall {
                below += area;
            }
            if place.z < high.z + STANDS * tall {
                next += area;
                let is_over = (low.x..=high.x).contains(&place.x) && (low.y..=high.y).contains(&place.y);
                over += if is_over { area } else { 0.0 };
            }
        }
        below <= BELOW * all && next > 0.0 && over >= OVER * next
    }

    /// True if a shell is made of faces across an axis and rims along it.
    fn is_even(&self, shell: u32, axis: DVec3) -> bool {
        let even = self.of(shell, true).filter(|&triangle| {
            let [a, b, c] = self.corners(triangle);
            let slope = (b - a).cross(c - a).normalize_or_zero().dot(axis).abs();
            slope >= FACE || slope <= RIM
        });
        even.map(|triangle| self.area(triangle)).sum::<f64>() >= EVEN * self.areas[shell as usize]
    }

    /// Centre and principal axes of a shell, the one across it last.
    fn frame(&self, shell: u32) -> (DVec3, [DVec3; 3]) {
        let whole = self.areas[shell as usize].max(f64::MIN_POSITIVE);
        let centre: DVec3 = self.of(shell, true).map(|t| middle(self.corners(t)) * (self.area(t) / whole)).sum();
        let mut moments = [[0.0f64; 3]; 3];
        for triangle in self.of(shell, true) {
            let share = self.area(triangle) / whole;
            let [a, b, c] = self.corners(triangle).map(|p| p - centre);
            for q in [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5] {
                let q = q.to_array();
                for (row, x) in moments.iter_mut().zip(q) {
                    for (cell, y) in row.iter_mut().zip(q) {
                        *cell += share / 3.0 * x * y;
                    }
                }
            }
        }
        // Squares of tiny and huge units come back to numbers of order one.
        let trace = moments[0][0] + moments[1][1] + moments[2][2];
        let moments = moments.map(|row| row.map(|cell| cell / trace.max(f64::MIN_POSITIVE)));
        (centre, principal_axes(moments))
    }

    /// Open shells that hang about a closed body: skirts, cloaks, plates of armour. A body without them is whole.
    fn sheets(&self) -> Vec<u32> {
        let whole: f64 = self.areas.iter().sum();
        let area = |shell: u32| self.areas[shell as usize];
        let numbers = 0..self.areas.len() as u32;
        let Some(body) = numbers.clone().max_by(|&a, &b| area(a).total_cmp(&area(b)).then(b.cmp(&a))) else {
            return Vec::new();
        };
        let large = |&shell: &u32| shell != body && area(shell) > 0.0 && area(shell) >= SHEET_AREA * area(body);
        let large: Vec<u32> = numbers.filter(large).collect();
        if large.is_empty() || area(body) < BODY_AREA * whole {
            return Vec::new();
        }
        let rims = self.rims();
        let open = |shell: u32| {
            let length: f64 = rims[shell as usize].iter().map(|[a, b]| a.distance(*b)).sum();
            length * length / area(shell)
        };
        if open(body) > CLOSED {
            return Vec::new();
        }
        let extent = |shell: u32| {
            let places = self.of(shell, true).flat_map(|triangle| self.corners(triangle));
            places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
        };
        let (body_low, body_high) = extent(body);
        let side = (body_high - body_low).max_element();
        // What goes on where the body ends is a part of it: a forearm between elbow and glove.
        let ends = |shell: u32| rims[shell as usize].iter().map(|edge| edge[0]);
        let goes_on = |shell: u32| ends(shell).any(|end| ends(body).any(|other| other.distance(end) <= APART * side));
        let is_sheet = |&shell: &u32| {
            let (low, high) = extent(shell);
            let out = (body_low - low).max(high - body_high).max_element();
            open(shell) >= OPEN && out <= STANDS_OUT * side && !goes_on(shell)
        };
        large.into_iter().filter(is_sheet).collect()
    }

    /// Edges of each shell that one triangle uses each.
    fn rims(&self) -> Vec<Vec<[DVec3; 2]>> {
        let by_position: Vec<[u32; 3]> =
            self.triangles.iter().map(|corners| corners.map(|corner| self.welded[corner as usize])).collect();
        let mut places = vec![DVec3::ZERO; self.positions];
        let mut shells = vec![0u32; self.positions];
        for ((corners, positions), &shell) in self.triangles.iter().zip(&by_position).zip(&self.shell_of) {
            for (&corner, &position) in corners.iter().zip(positions) {
                places[position as usize] = self.points[corner as usize].as_dvec3();
                shells[position as usize] = shell;
            }
        }
        let mut rims = vec![Vec::new(); self.areas.len()];
        for edge in adjacency::edges(&by_position).into_iter().filter(|edge| edge.triangles == 1) {
            let shell = shells[edge.points[0] as usize];
            rims[shell as usize].push(edge.points.map(|position| places[position as usize]));
        }
        rims
    }
}

fn middle([a, b, c]: [DVec3; 3]) -> DVec3 {
    (a + b + c) / 3.0
}
