//! The picture of a rig: octahedral bones, balls, crosses, outlines, marks and labels.

use bevy::{math::Affine3A, prelude::*};

use super::{
    RigDrawing,
    ink::{Ink, Layer, Pen},
    labels::write_label,
    shapes::{Octahedron, ball_radius},
    theme::{Theme, Tint, group_tint, mix, shade},
};
use crate::{
    plugins::{
        document::{HoveredNode, Selection},
        viewport::Sight,
    },
    rig::{NodeKind, Rig, Uid},
};

/// Emphasis of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Emphasis {
    /// Normal: neither selected nor active.
    #[default]
    None,
    /// A selected joint.
    Selected,
    /// The joint selected last.
    Active,
}

/// A joint as it is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnJoint {
    /// Identity.
    pub uid: Uid,
    /// Posed position, in the rig's space.
    pub position: Vec3,
    /// Posed axes, in the rig's space, of unit length.
    pub axes: Mat3,
    /// Index of its parent in the list; parents come first.
    pub parent: Option<usize>,
    /// The bone that leads to the joint at rest, turned and scaled with the joint as it is posed; in the rig's space.
    pub bone: Vec3,
    /// Joint or null.
    pub kind: NodeKind,
    /// Colour of its local group; `None` without one.
    pub color: Option<Tint>,
    /// Emphasis by the selection.
    pub emphasis: Emphasis,
    /// Marks the joint that a click would hit.
    pub hovered: bool,
    /// True if its layer hides it.
    pub hidden: bool,
}

/// The joints of a rig in the order of [`Rig::walk`], with the transforms `pose` to the rig's space; a joint without
/// one rests below its parent.
pub fn drawn_joints(
    rig: &Rig,
    selection: &Selection,
    hovered: &HoveredNode,
    mut pose: impl FnMut(Uid) -> Option<Affine3A>,
) -> Vec<DrawnJoint> {
    let mut numbers = bevy::platform::collections::HashMap::<Uid, usize>::with_capacity(rig.len());
    let mut globals: Vec<Affine3A> = Vec::with_capacity(rig.len());
    let mut joints: Vec<DrawnJoint> = Vec::with_capacity(rig.len());
    let colors: Vec<(Uid, Tint)> = rig.groups().iter().map(|group| (group.uid, group_tint(group.color))).collect();
    for joint in rig.walk() {
        let uid = joint.data.uid;
        let parent = joint.parent.and_then(|parent| numbers.get(&parent)).copied();
        let global = pose(uid).unwrap_or_else(|| {
            let above = parent.map_or(Affine3A::IDENTITY, |parent| globals[parent]);
            above * Affine3A::from(joint.data.rest.affine())
        });
        numbers.insert(uid, joints.len());
        globals.push(global);
        let axes = Mat3::from(global.matrix3);
        let rest = joint.data.rest;
        let bone = rest.rotation.inverse() * rest.translation / rest.scale;
        let color = joint.data.group.and_then(|group| colors.iter().find(|(uid, _)| *uid == group));
        joints.push(DrawnJoint {
            uid,
            position: global.translation.into(),
            axes: Mat3::from_cols(
                axes.x_axis.normalize_or(Vec3::X),
                axes.y_axis.normalize_or(Vec3::Y),
                axes.z_axis.normalize_or(Vec3::Z),
            ),
            parent,
            bone: if bone.is_finite() { axes * bone } else { Vec3::ZERO },
            kind: joint.data.kind,
            color: color.map(|(_, tint)| *tint),
            emphasis: Emphasis::None,
            hovered: false,
            hidden: false,
        });
    }
    for uid in &selection.0 {
        if let Some(&number) = numbers.get(uid) {
            let active = selection.active() == Some(*uid);
            joints[number].emphasis = if active { Emphasis::Active } else { Emphasis::Selected };
        }
    }
    if let Some(&number) = hovered.0.and_then(|uid| numbers.get(&uid)) {
        joints[number].hovered = true;
    }
    joints
}

/// A bone as it is drawn: from a joint to a child, or the tail of a joint without children.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnBone {
    /// Index of the joint that moves it.
    pub joint: usize,
    /// Position of its end.
    pub tail: Vec3,
    /// Marks the tail of a joint without children.
    pub leaf: bool,
    /// Marks one of many bones from a common joint, which are drawn as lines for lack of room.
    pub fan: bool,
}

/// Least number of children of a joint whose bones form a fan, such as those of a face on the head.
pub const FAN: usize = 12;

/// Number of children of each joint.
fn children(joints: &[DrawnJoint]) -> Vec<usize> {
    let mut children = vec![0; joints.len()];
    for parent in joints.iter().filter_map(|joint| joint.parent) {
        children[parent] += 1;
    }
    children
}

/// Bones of a rig. A joint without children gets a tail as long as a third of the bone that leads to it, in the same
/// direction at rest and turned with the joint, unless it is part of a fan.
pub fn bones(joints: &[DrawnJoint]) -> Vec<DrawnBone> {
    let children = children(joints);
    let mut list = Vec::with_capacity(joints.len() * 2);
    for (number, joint) in joints.iter().enumerate() {
        if let Some(parent) = joint.parent {
            // A chain that leaves a fan is drawn as any other bone.
            let fan = children[parent] >= FAN && children[number] == 0 && joint.kind == NodeKind::Joint;
            list.push(DrawnBone { joint: parent, tail: joint.position, leaf: false, fan });
        }
    }
    for (number, joint) in joints.iter().enumerate() {
        let is_leaf = children[number] == 0 && joint.kind == NodeKind::Joint;
        if !is_leaf || joint.parent.is_none_or(|parent| children[parent] >= FAN) {
            continue;
        }
        let tail = joint.position + joint.bone / 3.0;
        list.push(DrawnBone { joint: number, tail, leaf: true, fan: false });
    }
    list
}

/// Radii in pixels of the balls of all joints, by [`ball_radius`] of the shorter of the bone that leads to a joint and
/// the longest that leaves it; in a fan, by twice the distance to the nearest joint.
pub fn ball_radii(joints: &[DrawnJoint], bones: &[DrawnBone], sight: &Sight, scale: f32) -> Vec<f32> {
    let pixels = |joint: usize, length: f32| {
        let pixel = sight.pixel_at(joints[joint].position);
        if pixel > 0.0 { length / pixel } else { 0.0 }
    };
    let mut leaving = vec![0.0_f32; joints.len()];
    for bone in bones.iter().filter(|bone| !bone.leaf) {
        let length = joints[bone.joint].position.distance(bone.tail);
        leaving[bone.joint] = leaving[bone.joint].max(pixels(bone.joint, length));
    }
    let children = children(joints);
    let entering = |number: usize| {
        let parent = joints[number].parent?;
        let to = |other: usize| joints[number].position.distance(joints[other].position);
        let mut length = to(parent);
        if children[parent] >= FAN && children[number] == 0 {
            let beside = (0..joints.len()).filter(|other| *other != number && joints[*other].parent == Some(parent));
            length = beside.map(to).filter(|way| *way > 0.0).fold(length, |least, way| least.min(2.0 * way));
        }
        Some(pixels(number, length))
    };
    (0..joints.len())
        .map(|number| {
            let bone = match (entering(number), leaving[number]) {
                (Some(length), 0.0) => length,
                (Some(length), leaving) => length.min(leaving),
                (None, leaving) => leaving,
            };
            ball_radius(bone, scale)
        })
        .collect()
}

/// Draws a rig into `ink`. `labels` are written with strokes at their pixel positions.
pub fn draw_skeleton(
    joints: &[DrawnJoint],
    labels: &[(Vec2, String)],
    sight: &Sight,
    settings: &RigDrawing,
    ink: &mut Ink,
) {
    let bones = bones(joints);
    let radii = ball_radii(joints, &bones, sight, settings.ball_scale);
    let mut artist = Artist { pen: Pen::new(ink, sight), theme: &settings.theme };
    for bone in bones.iter().filter(|bone| !joints[bone.joint].hidden) {
        artist.bone(bone, &joints[bone.joint]);
    }
    for (joint, radius) in joints.iter().zip(&radii).filter(|(joint, _)| !joint.hidden) {
        artist.joint(joint, *radius);
        if settings.axes && joint.emphasis != Emphasis::None {
            artist.axes(joint, *radius);
        }
    }
    for (at, text) in labels {
        write_label(&mut artist.pen, *at, text, settings.theme.label, settings.theme.outline);
    }
}

struct Artist<'a> {
    pen: Pen<'a>,
    theme: &'a Theme,
}

impl Artist<'_> {
    /// Colour of the outline, and its width in pixels.
    fn outline(&self, joint: &DrawnJoint) -> Option<(Tint, f32)> {
        match joint.emphasis {
            Emphasis::None => None,
            Emphasis::Selected => Some((self.theme.selected, 2.0)),
            Emphasis::Active => Some((self.theme.active, 2.0)),
        }
    }

    fn bone(&mut self, bone: &DrawnBone, joint: &DrawnJoint) {
        let (head, tail) = (joint.position, bone.tail);
        let pixel = self.pen.sight.pixel_at(head.midpoint(tail));
        let length = head.distance(tail);
        // The bone is too short to see, or fully behind the camera.
        if !(pixel > 0.0 && length > 2.0 * pixel) {
            return;
        }
        let tint = joint.color.unwrap_or(self.theme.bone);
        if joint.kind == NodeKind::Null {
            let tint = self.outline(joint).map_or(self.theme.null, |(tint, _)| tint);
            self.pen.line([head, tail], 3.0, 0.0, self.theme.outline);
            self.pen.line([head, tail], 1.2, pixel, tint);
            return;
        }
        if bone.fan {
            self.pen.line([head, tail], 2.2, 0.0, self.theme.outline);
            self.pen.line([head, tail], 0.9, 0.0, shade(tint, 0.8));
            return;
        }
        let width = (length * if bone.leaf { 0.11 } else { 0.085 }).max(1.8 * pixel);
        let Some(shape) = Octahedron::new(head, tail, width, joint.axes.x_axis) else { return };
        let tint = match (joint.emphasis, joint.hovered) {
            (Emphasis::None, false) => tint,
            (Emphasis::None, true) => mix(tint, [255; 4], 0.25),
            _ => mix(tint, [255; 4], 0.35),
        };
        let faces = shape.faces();
        let light = self.light();
        let seen = faces.map(|face| face.normal.dot(self.pen.sight.towards(face.corners[0])) > 0.0);
        for (face, _) in faces.iter().zip(seen).filter(|(_, seen)| *seen) {
            let bright = face.normal.normalize_or_zero().dot(light).max(0.0);
            self.pen.triangle(face.corners, 0.0, shade(tint, 0.5 + 0.5 * bright));
        }
        let outline = self.outline(joint);
        for (ends, [a, b]) in shape.edges() {
            if seen[a] != seen[b] {
                if let Some((tint, width)) = outline {
                    self.pen.line(ends, width + 2.4, 0.5 * pixel, self.theme.outline);
                    self.pen.line(ends, width, pixel, tint);
                } else {
                    self.pen.line(ends, 1.4, pixel, self.theme.outline);
                }
            } else if seen[a] && length > 40.0 * pixel {
                self.pen.line(ends, 0.8, 0.5 * pixel, shade(tint, 0.45));
            }
        }
    }

    /// Direction of the light: from the camera, from above and a little from the left, so that faces differ.
    fn light(&self) -> Vec3 {
        let plane = &self.pen.sight.plane;
        (plane.right * -0.45 + plane.up * 0.65 + plane.towards() * 0.6).normalize_or_zero()
    }

    fn joint(&mut self, joint: &DrawnJoint, radius: f32) {
        let pixel = self.pen.sight.pixel_at(joint.position);
        if pixel <= 0.0 {
            return;
        }
        if joint.kind == NodeKind::Null {
            self.cross(joint, radius, pixel);
        } else {
            self.ball(joint, radius, pixel);
        }
        let at = joint.position;
        if joint.parent.is_none() {
            let size = (radius + 4.5) * pixel;
            self.pen.ring(at, [size, size + 3.2 * pixel], Some(4), radius * pixel, self.theme.outline);
            let tint = self.outline(joint).map_or(self.theme.joint, |(tint, _)| tint);
            self.pen.ring(at, [size + 0.8 * pixel, size + 2.4 * pixel], Some(4), (radius + 1.0) * pixel, tint);
        }
        if joint.hovered {
            let size = (radius + 3.0) * pixel;
            let lift = (radius + 2.0) * pixel;
            self.pen.ring(at, [size, size + 4.0 * pixel], None, lift, self.theme.outline);
            self.pen.ring(at, [size + pixel, size + 3.0 * pixel], None, lift + pixel, self.theme.hovered);
        }
    }

    fn ball(&mut self, joint: &DrawnJoint, radius: f32, pixel: f32) {
        let (size, lift) = (radius * pixel, (radius + 1.0) * pixel);
        let fill = match (joint.hovered, joint.emphasis) {
            (true, _) => self.theme.hovered,
            (_, Emphasis::Active) => self.theme.active,
            (_, Emphasis::Selected) => self.theme.selected,
            _ => self.theme.joint,
        };
        self.pen.ring(joint.position, [size * 0.8, size], None, lift, self.theme.outline);
        let inner = size - 1.2 * pixel;
        self.pen.ball(joint.position, inner, lift + pixel, mix(fill, [255; 4], 0.6), shade(fill, 0.78));
        if let Some((tint, _)) = self.outline(joint) {
            self.pen.ring(joint.position, [size, size + 2.0 * pixel], None, lift, tint);
            self.pen.ring(joint.position, [size + 2.0 * pixel, size + 3.0 * pixel], None, lift, self.theme.outline);
        }
    }

    /// Draws three short lines along the null's own axes.
    fn cross(&mut self, joint: &DrawnJoint, radius: f32, pixel: f32) {
        let tint = match (joint.hovered, self.outline(joint)) {
            (true, _) => self.theme.hovered,
            (_, Some((tint, _))) => tint,
            _ => self.theme.null,
        };
        let arm = (radius + 5.0) * pixel;
        let lift = (radius + 1.0) * pixel;
        for axis in [joint.axes.x_axis, joint.axes.y_axis, joint.axes.z_axis] {
            let ends = [joint.position - axis * arm, joint.position + axis * arm];
            self.pen.line(ends, 4.0, lift, self.theme.outline);
            self.pen.line(ends, 1.8, lift + pixel, tint);
        }
    }

    fn axes(&mut self, joint: &DrawnJoint, radius: f32) {
        let pixel = self.pen.sight.pixel_at(joint.position);
        let (start, end) = ((radius + 1.0) * pixel, (radius + 30.0) * pixel);
        let axes = [joint.axes.x_axis, joint.axes.y_axis, joint.axes.z_axis];
        for (axis, tint) in axes.into_iter().zip(self.theme.axes) {
            let ends = [joint.position + axis * start, joint.position + axis * end];
            // A fixed depth in front of the bone, because one of the axes usually runs inside it.
            self.pen.layer = Layer::Fixed(0.999_86);
            self.pen.line(ends, 4.0, 0.0, self.theme.outline);
            self.pen.layer = Layer::Fixed(0.999_88);
            self.pen.line(ends, 2.2, 0.0, tint);
        }
        self.pen.layer = Layer::Over;
    }
}
