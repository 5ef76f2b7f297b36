//! Drags of handles: conversion of pointer positions to movements, rotations and factors.

use std::f32::consts::{PI, TAU};

use bevy::{math::ops, prelude::*};

use super::{GizmoFrame, Handle, LENGTH, RING};
use crate::plugins::viewport::Sight;

/// Step of rotations while snapping, in radians.
pub const TURN_STEP: f32 = PI / 12.0;
/// Step of factors while snapping.
pub const SCALE_STEP: f32 = 0.1;
/// Least factor; below it objects would turn inside out.
const LEAST_FACTOR: f32 = 0.01;
/// Distance in pixels that doubles a uniform scale.
const DOUBLING: f32 = 120.0;
/// Least sine of the angle at which a plane is measured on its face; a flatter plane is measured along its edge.
const EDGE_ON: f32 = 0.2;

/// Result of a drag since the press, in the rig's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delta {
    /// A movement.
    Move(Vec3),
    /// A turn.
    Turn {
        /// Axis of unit length.
        axis: Vec3,
        /// Angle in radians.
        angle: f32,
    },
    /// Factors along the axes of the frame.
    Scale(Vec3),
}

impl Delta {
    /// Returns `true` if nothing changes.
    pub fn is_none(&self) -> bool {
        match self {
            Self::Move(by) => *by == Vec3::ZERO,
            Self::Turn { angle, .. } => *angle == 0.0,
            Self::Scale(factors) => *factors == Vec3::ONE,
        }
    }
}

/// A drag of a handle. It uses the view of the press throughout.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GizmoDrag {
    /// The handle.
    pub handle: Handle,
    /// Frame of the gizmo at the press.
    pub frame: GizmoFrame,
    sight: Sight,
    press: Vec2,
    last: Vec2,
    /// Angle so far, in radians; it may exceed a full turn.
    angle: f32,
    delta: Delta,
}

impl GizmoDrag {
    /// Starts a drag with a press on a handle.
    pub fn new(handle: Handle, frame: GizmoFrame, sight: Sight, press: Vec2) -> Self {
        let delta = match handle {
            Handle::MoveAxis(_) | Handle::MovePlane(_) | Handle::MoveView => Delta::Move(Vec3::ZERO),
            Handle::Ring(_) | Handle::ViewRing => Delta::Turn { axis: Vec3::Z, angle: 0.0 },
            Handle::ScaleAxis(_) | Handle::ScaleAll => Delta::Scale(Vec3::ONE),
        };
        Self { handle, frame, sight, press, last: press, angle: 0.0, delta }
    }

    /// The result of the drag with the pointer at a pixel. `snap` is the step of movements, in the rig's units;
    /// rotations and factors have steps of their own. For a pixel without a position (beyond the horizon of a plane),
    /// the result stays.
    pub fn to(&mut self, at: Vec2, snap: Option<f32>) -> Delta {
        let GizmoFrame { axes, .. } = self.frame;
        let view = &self.sight.plane;
        let next = match self.handle {
            Handle::MoveAxis(axis) => self.slid(axes[axis], at).map(|by| Delta::Move(axes[axis] * stepped(by, snap))),
            Handle::MovePlane(axis) => self.shifted(axes[axis], [axes[(axis + 1) % 3], axes[(axis + 2) % 3]], at, snap),
            Handle::MoveView => self.shifted(view.towards(), [view.right, view.up], at, snap),
            Handle::Ring(axis) => Some(self.turned(axes[axis], at, snap)),
            Handle::ViewRing => Some(self.turned(self.sight.towards(self.frame.origin), at, snap)),
            Handle::ScaleAxis(axis) => {
                self.along(axes[axis], self.press).zip(self.along(axes[axis], at)).map(|(a, b)| {
                    // The limit keeps a handle grabbed near the middle from scaling excessively.
                    let least = 0.25 * LENGTH * self.sight.pixel_at(self.frame.origin);
                    let mut factors = Vec3::ONE;
                    factors[axis] = stepped_factor(1.0 + (b - a) / a.max(least), snap);
                    Delta::Scale(factors)
                })
            }
            Handle::ScaleAll => {
                let by = at - self.press;
                Some(Delta::Scale(Vec3::splat(stepped_factor(ops::exp2((by.x - by.y) / DOUBLING), snap))))
            }
        };
        self.last = at;
        self.delta = next.unwrap_or(self.delta);
        self.delta
    }

    /// Pixel of the press.
    pub fn press(&self) -> Vec2 {
        self.press
    }

    /// Last result of the drag.
    pub fn delta(&self) -> Delta {
        self.delta
    }

    fn slid(&self, axis: Vec3, at: Vec2) -> Option<f32> {
        Some(self.along(axis, at)? - self.along(axis, self.press)?)
    }

    fn shifted(&self, normal: Vec3, sides: [Vec3; 2], at: Vec2, snap: Option<f32>) -> Option<Delta> {
        let by = self.met(normal, at)? - self.met(normal, self.press)?;
        Some(Delta::Move(match snap {
            None => by,
            Some(_) => sides.into_iter().map(|side| side * stepped(by.dot(side), snap)).sum(),
        }))
    }

    fn turned(&mut self, axis: Vec3, at: Vec2, snap: Option<f32>) -> Delta {
        self.angle += self.angle_between(axis, self.last, at);
        let angle = if snap.is_some() { stepped(self.angle, Some(TURN_STEP)) } else { self.angle };
        Delta::Turn { axis, angle }
    }

    /// The rotation about an axis that takes one pixel to another, between minus and plus half a turn.
    fn angle_between(&self, axis: Vec3, from: Vec2, to: Vec2) -> f32 {
        let origin = self.frame.origin;
        let towards = self.sight.towards(origin);
        let places = self.met(axis, from).zip(self.met(axis, to));
        if let Some((from, to)) = places.filter(|_| axis.dot(towards).abs() >= EDGE_ON) {
            let (from, to) = (from - origin, to - origin);
            return ops::atan2(from.cross(to).dot(axis), from.dot(to));
        }
        // The ring is seen from its edge: its near side runs along the screen.
        let run = axis.cross(towards).normalize_or_zero() * (RING * self.sight.pixel_at(origin));
        let ends = self.sight.project(origin).zip(self.sight.project(origin + run));
        let Some(run) = ends.and_then(|(a, b)| (b - a).try_normalize()) else { return 0.0 };
        let angle = (to - from).dot(run) / RING;
        angle - TAU * (angle / TAU).round()
    }

    /// Position of a pixel along an axis from the middle: the nearest point on the screen.
    fn along(&self, axis: Vec3, at: Vec2) -> Option<f32> {
        let GizmoFrame { origin, .. } = self.frame;
        let step = LENGTH * self.sight.pixel_at(origin);
        let [start, end] = [self.sight.project(origin)?, self.sight.project(origin + axis * step)?];
        let run = (end - start).try_normalize()?;
        let (eye, direction) = self.line(start + run * (at - start).dot(run));
        let between = origin - eye;
        let slant = axis.dot(direction);
        let square = 1.0 - slant * slant;
        if square < 1e-6 {
            return None;
        }
        let far = (slant * direction.dot(between) - axis.dot(between)) / square;
        let is_before = self.sight.plane.eye.is_none() || direction.dot(between) + far * slant > 0.0;
        (is_before && far.is_finite()).then_some(far)
    }

    /// Intersection of a pixel's line of sight with the plane through the middle.
    fn met(&self, normal: Vec3, at: Vec2) -> Option<Vec3> {
        let (eye, direction) = self.line(at);
        let slope = direction.dot(normal);
        if slope.abs() < 1e-4 {
            return None;
        }
        let far = (self.frame.origin - eye).dot(normal) / slope;
        let is_before = self.sight.plane.eye.is_none() || far > 0.0;
        let place = eye + direction * far;
        (is_before && place.is_finite()).then_some(place)
    }

    /// The line of sight through a pixel. In an orthographic view it starts nearby, where numbers are exact.
    fn line(&self, at: Vec2) -> (Vec3, Vec3) {
        let plane = &self.sight.plane;
        let on_plane = plane.lift(self.sight.point(at));
        match plane.eye {
            None => (on_plane, -plane.towards()),
            Some(eye) => (eye, (on_plane - eye).try_normalize().unwrap_or(-plane.towards())),
        }
    }
}

fn stepped(value: f32, step: Option<f32>) -> f32 {
    match step {
        Some(step) if step > 0.0 => (value / step).round() * step,
        _ => value,
    }
}

fn stepped_factor(factor: f32, snap: Option<f32>) -> f32 {
    match snap {
        Some(_) => stepped(factor, Some(SCALE_STEP)).max(SCALE_STEP),
        None => factor.max(LEAST_FACTOR),
    }
}
