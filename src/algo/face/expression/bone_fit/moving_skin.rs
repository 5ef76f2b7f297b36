//! The skin that facial bones move, and the triangles of it that a pose folds.

use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use super::{
    SLIVER,
    samples::{FacingPairs, FacingPoints, influences},
};
use crate::{
    algo::face::bones::FaceBone,
    mesh::{
        model::Weights,
        skinning::{skin_point, skin_points},
    },
};

/// Share of the triangles above which all are looked at again, in parallel.
const MOST: f32 = 0.4;

/// The points and triangles that bones move, numbered on their own.
#[derive(Default)]
pub(super) struct MovingSkin {
    pub points: Vec<Vec3>,
    /// Weights of the points; joints 0 and 1 are neck and head, 2 + i is bone i.
    pub weights: Weights,
    /// Triangles with an area.
    pub triangles: Vec<[u32; 3]>,
    /// Numbers of the triangles in the mesh.
    numbers: Vec<u32>,
    /// Normals of the triangles at rest, of any length.
    normals: Vec<Vec3>,
    /// Triangles that each bone moves.
    of_bone: Vec<Vec<u32>>,
    /// Points of lips and lids that face each other.
    pub facing: FacingPairs,
}

impl MovingSkin {
    pub fn new(
        points: &[Vec3],
        triangles: &[[u32; 3]],
        weights: &Weights,
        bones: &[FaceBone],
        facing: &FacingPairs,
    ) -> Self {
        let mut skin = Self { of_bone: vec![Vec::new(); bones.len()], ..Self::default() };
        let moved: Vec<bool> =
            (0..points.len()).map(|point| influences(weights, point).any(|(joint, _)| joint >= 2)).collect();
        let mut number_of = vec![u32::MAX; points.len()];
        let mut number = |skin: &mut Self, point: u32| {
            let known = &mut number_of[point as usize];
            if *known == u32::MAX {
                *known = skin.points.len() as u32;
                skin.points.push(points[point as usize]);
                skin.weights.push(influences(weights, point as usize));
            }
            *known
        };
        for (triangle, corners) in triangles.iter().enumerate() {
            if corners.iter().any(|&corner| corner as usize >= points.len())
                || !corners.iter().any(|&corner| moved[corner as usize])
            {
                continue;
            }
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            let normal = (b - a).cross(c - a);
            let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
            // Slivers without an area have no orientation.
            if normal.length() <= SLIVER * longest {
                continue;
            }
            let index = skin.triangles.len() as u32;
            let corners = corners.map(|corner| number(&mut skin, corner));
            for corner in corners {
                for bone in influences(&skin.weights, corner as usize).filter_map(|(joint, _)| joint.checked_sub(2)) {
                    if let Some(list) = skin.of_bone.get_mut(bone as usize)
                        && list.last() != Some(&index)
                    {
                        list.push(index);
                    }
                }
            }
            skin.triangles.push(corners);
            skin.numbers.push(triangle as u32);
            skin.normals.push(normal);
        }
        let mut numbered = |pair: &FacingPoints| {
            let [above, below] = [pair.above, pair.below].map(|point| number(&mut skin, point));
            FacingPoints { above, below, ..*pair }
        };
        let apart = facing.apart.iter().map(&mut numbered).collect();
        let rims = facing.rims.iter().map(&mut numbered).collect();
        skin.facing = FacingPairs { apart, rims };
        skin
    }

    fn is_folded(&self, triangle: usize, posed: &[Vec3]) -> bool {
        let [a, b, c] = self.triangles[triangle].map(|corner| posed[corner as usize]);
        self.normals[triangle].dot((b - a).cross(c - a)) < 0.0
    }
}

/// The moving skin in a pose.
pub(super) struct PosedSkin<'a> {
    skin: &'a MovingSkin,
    matrices: Vec<Affine3A>,
    pub points: Vec<Vec3>,
    folded: Vec<bool>,
    /// The last round in which each triangle and each point was looked at.
    seen: [Vec<u32>; 2],
    round: u32,
}

impl<'a> PosedSkin<'a> {
    /// Poses the skin: `matrices` for neck, head and each bone.
    pub fn new(skin: &'a MovingSkin, matrices: Vec<Affine3A>) -> Self {
        let seen = [vec![0; skin.triangles.len()], vec![0; skin.points.len()]];
        let mut posed = Self { skin, matrices, points: Vec::new(), folded: Vec::new(), seen, round: 0 };
        posed.update_all();
        posed
    }

    /// Triangles that turn by more than a right angle.
    pub fn folded(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.skin.triangles.iter().zip(&self.folded).filter(|(_, is_folded)| **is_folded).map(|(corners, _)| *corners)
    }

    /// Numbers in the mesh of the triangles that turn by more than a right angle, in rising order.
    pub fn folded_numbers(&self) -> Vec<u32> {
        let all = self.skin.numbers.iter().zip(&self.folded);
        all.filter(|(_, is_folded)| **is_folded).map(|(number, _)| *number).collect()
    }

    fn update_all(&mut self) {
        let skin = self.skin;
        skin_points(&skin.points, &skin.weights, &self.matrices, &mut self.points);
        let posed = &self.points;
        self.folded = (0..skin.triangles.len()).into_par_iter().map(|index| skin.is_folded(index, posed)).collect();
    }

    /// Moves to another pose; only triangles of bones that moved are looked at.
    pub fn update(&mut self, matrices: Vec<Affine3A>) {
        let skin = self.skin;
        let changed: Vec<usize> =
            (0..skin.of_bone.len()).filter(|bone| self.matrices.get(bone + 2) != matrices.get(bone + 2)).collect();
        self.matrices = matrices;
        let count: usize = changed.iter().map(|bone| skin.of_bone[*bone].len()).sum();
        if count as f32 > MOST * skin.triangles.len() as f32 {
            self.update_all();
        } else {
            self.round += 1;
            for bone in changed {
                for &index in &skin.of_bone[bone] {
                    self.update_triangle(index as usize);
                }
            }
        }
        for point in skin.facing.apart.iter().flat_map(|pair| [pair.above, pair.below]) {
            let point = point as usize;
            self.points[point] = skin_point(point, skin.points[point], &skin.weights, &self.matrices);
        }
    }

    fn update_triangle(&mut self, index: usize) {
        if std::mem::replace(&mut self.seen[0][index], self.round) == self.round {
            return;
        }
        let skin = self.skin;
        for corner in skin.triangles[index] {
            let corner = corner as usize;
            if std::mem::replace(&mut self.seen[1][corner], self.round) != self.round {
                self.points[corner] = skin_point(corner, skin.points[corner], &skin.weights, &self.matrices);
            }
        }
        self.folded[index] = skin.is_folded(index, &self.points);
    }
}
