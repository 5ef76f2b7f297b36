//! Controls that are too small and too close together on the screen to be told apart.
//!
//! One rule for drawing and picking: of controls smaller than [`SMALL`] pixels, those with another one nearer than [`CLOSE`]
//! pixels are left out. From where the whole body is seen these are the controls of fingers; a lone control stays at any distance.

use std::collections::BTreeSet;

use bevy::prelude::*;

use super::outline::ControlOutline;
use crate::{algo::view::ViewPlane, rig::Uid};

/// Width or height in pixels from which on a control is always shown.
pub const SMALL: f32 = 28.0;
/// Distance in pixels of the middles of two small controls from which on both are shown.
pub const CLOSE: f32 = 16.0;

/// True on controls that a view leaves out: they are neither drawn nor picked. Written by apps that have a view.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component)]
pub struct CrowdedControl(pub bool);

/// Controls that a view of their rig leaves out. `pixel` is the length of a pixel on the view plane, in the rig's units.
pub fn crowded_controls(controls: &[ControlOutline], plane: &ViewPlane, pixel: f32) -> BTreeSet<Uid> {
    let middle = |control: &ControlOutline| Some((small_middle(control, plane, pixel)?, control.uid));
    let mut small: Vec<(Vec2, Uid)> = controls.iter().filter_map(middle).collect();
    small.sort_by(|(a, _), (b, _)| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut found = BTreeSet::new();
    for (number, (middle, uid)) in small.iter().enumerate() {
        let right = small[number + 1..].iter().take_while(|(other, _)| other.x - middle.x < CLOSE);
        for (_, other) in right.filter(|(other, _)| other.distance(*middle) < CLOSE) {
            found.extend([*uid, *other]);
        }
    }
    found
}

/// The middle of a small control in pixels; `None` for one that is large, or behind the camera in part.
fn small_middle(control: &ControlOutline, plane: &ViewPlane, pixel: f32) -> Option<Vec2> {
    let [mut low, mut high] = [Vec2::INFINITY, Vec2::NEG_INFINITY];
    for point in control.lines.iter().flatten() {
        let place = plane.project(*point)? / pixel;
        (low, high) = (low.min(place), high.max(place));
    }
    ((high - low).max_element() < SMALL).then(|| low.midpoint(high))
}
