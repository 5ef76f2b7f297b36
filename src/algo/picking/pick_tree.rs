//! Joints in trees: many picks among many joints that stand still.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use super::{in_box, in_order, limit, nearest_on_plane};
use crate::algo::{point_tree::PointTree, view::ViewPlane};

/// Number of views that are remembered.
const VIEWS: usize = 16;
/// Slack of the circle around a box, as a share of its numbers.
const SLACK: f32 = 1e-5;

/// Joints that stand still, in trees that picks make as they need them.
#[derive(Debug, Clone, Default)]
pub struct PickTree {
    /// Positions of the joints, in the surface's space.
    joints: Vec<Vec3>,
    places: Option<PlaceTree>,
    /// Views of picks, the latest ones last; those that were seen twice have a tree.
    views: Vec<(ViewPlane, Option<PlaceTree>)>,
    /// Number of joints that were looked at without a tree, and in trees that are forgotten.
    looks: u64,
}

impl PickTree {
    /// Joints at these positions in the surface's space; those that are not finite are never picked.
    pub fn new(joints: Vec<Vec3>) -> Self {
        Self { joints, ..Self::default() }
    }

    /// Candidates of a click as [`candidates_at`](super::candidates_at) gives them. O(log joints) and the candidates.
    pub fn candidates_at(&mut self, first_hit: Option<Vec3>, plane: &ViewPlane, point: Vec2, reach: f32) -> Vec<usize> {
        match first_hit {
            Some(hit) => self.places().candidates(hit, reach),
            None => match self.view(plane) {
                Some(tree) => tree.candidates(point.extend(0.0), reach),
                None => nearest_on_plane(plane, point, &self.joints, reach),
            },
        }
    }

    /// The first of the candidates. O(log joints).
    pub fn nearest_at(&mut self, first_hit: Option<Vec3>, plane: &ViewPlane, point: Vec2) -> Option<usize> {
        match first_hit {
            Some(hit) => self.places().nearest(hit),
            None => match self.view(plane) {
                Some(tree) => tree.nearest(point.extend(0.0)),
                None => nearest_on_plane(plane, point, &self.joints, 0.0).first().copied(),
            },
        }
    }

    /// The two nearest candidates of a click, each with its distance.
    pub fn nearest_two_at(
        &mut self,
        first_hit: Option<Vec3>,
        plane: &ViewPlane,
        point: Vec2,
    ) -> [Option<(f32, usize)>; 2] {
        let (tree, place) = match first_hit {
            Some(hit) => (self.places(), hit),
            None => (self.view_tree(plane), point.extend(0.0)),
        };
        tree.nearest_two(place)
    }

    /// Joints in a box as [`in_box`] gives them.
    pub fn in_box(&mut self, plane: &ViewPlane, corners: [Vec2; 2]) -> Vec<usize> {
        let (low, high) = (corners[0].min(corners[1]), corners[0].max(corners[1]));
        let middle = 0.5 * (low + high);
        let radius = 0.5 * low.distance(high);
        let radius = radius + SLACK * (radius + middle.abs().max_element());
        let tree = if radius.is_finite() { self.view(plane) } else { None };
        let Some(tree) = tree else { return in_box(plane, corners, &self.joints) };
        let inside = |place: Vec2| place.cmpge(low).all() && place.cmple(high).all();
        let found = tree.tree.within(middle.extend(0.0), radius).into_iter();
        let found = found.filter(|number| inside(tree.places[*number].truncate()));
        let mut joints: Vec<usize> = found.flat_map(|number| tree.joints[number].iter().copied()).collect();
        joints.sort_unstable();
        joints
    }

    /// Number of joints that were looked at so far; for tests of growth.
    pub fn visits(&self) -> u64 {
        let views = self.views.iter().filter_map(|(_, tree)| tree.as_ref());
        self.looks + views.chain(&self.places).map(|tree| tree.tree.visits()).sum::<u64>()
    }

    fn places(&mut self) -> &PlaceTree {
        self.places.get_or_insert_with(|| PlaceTree::new(self.joints.iter().copied(), false))
    }

    /// Tree of the joints on a view plane; `None` where the view is seen for the first time and one look at all joints is
    /// less work.
    fn view(&mut self, plane: &ViewPlane) -> Option<&PlaceTree> {
        if self.views.iter().any(|(other, _)| other == plane) {
            return Some(self.view_tree(plane));
        }
        self.looks += self.joints.len() as u64;
        self.remember(plane);
        None
    }

    fn view_tree(&mut self, plane: &ViewPlane) -> &PlaceTree {
        let number = self.views.iter().position(|(other, _)| other == plane);
        let number = number.unwrap_or_else(|| self.remember(plane));
        let joints = &self.joints;
        let on_plane = |joint: &Vec3| plane.project(*joint).map_or(Vec3::NAN, |place| place.extend(0.0));
        self.views[number].1.get_or_insert_with(|| PlaceTree::new(joints.iter().map(on_plane), true))
    }

    /// Remembers a view, forgets the oldest one if there are many, and returns the view's place.
    fn remember(&mut self, plane: &ViewPlane) -> usize {
        if self.views.len() >= VIEWS
            && let (_, Some(tree)) = self.views.remove(0)
        {
            self.looks += tree.tree.visits();
        }
        self.views.push((*plane, None));
        self.views.len() - 1
    }
}

/// Places apart from each other in a tree.
#[derive(Debug, Clone, Default)]
struct PlaceTree {
    places: Vec<Vec3>,
    /// Joints at each place, rising.
    joints: Vec<Vec<usize>>,
    tree: PointTree,
}

impl PlaceTree {
    /// Places of joints in space, or with one z if `is_flat`.
    fn new(joints: impl Iterator<Item = Vec3>, is_flat: bool) -> Self {
        let mut numbers: HashMap<[u32; 3], usize> = HashMap::new();
        let (mut places, mut at): (Vec<Vec3>, Vec<Vec<usize>>) = (Vec::new(), Vec::new());
        for (joint, place) in joints.enumerate().filter(|(_, place)| place.is_finite()) {
            // Zeros of both signs are one number.
            let key = (place + Vec3::ZERO).to_array().map(f32::to_bits);
            let number = *numbers.entry(key).or_insert(places.len());
            if number == places.len() {
                places.push(place);
                at.push(Vec::new());
            }
            at[number].push(joint);
        }
        let points = places.iter().copied();
        let tree = if is_flat { PointTree::flat(points) } else { PointTree::new(points) };
        Self { places, joints: at, tree }
    }

    fn nearest(&self, place: Vec3) -> Option<usize> {
        let (least, _) = self.tree.nearest_two(place)[0].filter(|(least, _)| least.is_finite())?;
        self.tree.within(place, least).into_iter().filter_map(|number| self.joints[number].first().copied()).min()
    }

    fn nearest_two(&self, place: Vec3) -> [Option<(f32, usize)>; 2] {
        let [first, second] = self.tree.nearest_two(place);
        let of = |found: Option<(f32, usize)>, nth: usize| {
            found.and_then(|(far, number)| Some((far, *self.joints[number].get(nth)?)))
        };
        [of(first, 0), of(first, 1).or_else(|| of(second, 0))]
    }

    fn candidates(&self, place: Vec3, reach: f32) -> Vec<usize> {
        let [Some((least, _)), second] = self.nearest_two(place) else { return Vec::new() };
        let furthest = second.map_or(least, |(far, _)| far).max(limit(least, reach));
        let found = self.tree.within(place, furthest).into_iter();
        let found = found.map(|number| (self.places[number].distance(place), &self.joints[number]));
        let found = found.filter(|(far, _)| far.is_finite());
        in_order(found.flat_map(|(far, joints)| joints.iter().map(move |joint| (far, *joint))).collect(), reach)
    }
}
