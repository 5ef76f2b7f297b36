//! Theme: the colours of the viewport.

use bevy::prelude::*;

/// An sRGB colour with its opacity, 0 to 255 each.
pub type Tint = [u8; 4];

/// The viewport's background: dark enough for light meshes, light enough for dark ones.
pub const BACKGROUND: Color = Color::srgb(0.232, 0.242, 0.262);

/// Colours of rigs, ghosts, the grid and the symmetry plane.
///
/// Bones take the colour of their joint's local group; everything else differs by brightness and outline, so that it is
/// readable on any group's colour, on light and dark meshes.
#[derive(Debug, Clone, PartialEq)]
pub struct Theme {
    /// Bones of joints without a group.
    pub bone: Tint,
    /// Bones of joints that deform, while those are shown.
    pub deforming: Tint,
    /// Bones of all other joints meanwhile.
    pub idle: Tint,
    /// Balls of all joints.
    pub joint: Tint,
    /// Crosses of nulls and the lines from them.
    pub null: Tint,
    /// Outlines.
    pub outline: Tint,
    /// Outlines of selected joints.
    pub selected: Tint,
    /// Outline and ball of the joint selected last.
    pub active: Tint,
    /// Ring and ball of the joint that a click would hit.
    pub hovered: Tint,
    /// Text of labels.
    pub label: Tint,
    /// Local axes x, y and z.
    pub axes: [Tint; 3],
    /// Ghost joints.
    pub ghost: Tint,
    /// Ghost joints on the other side.
    pub ghost_mirrored: Tint,
    /// The line of a stroke.
    pub stroke: Tint,
    /// The span between the near and the far hit.
    pub depth: Tint,
    /// The symmetry plane's area.
    pub plane: Tint,
    /// The symmetry plane's border.
    pub plane_border: Tint,
    /// Lines of the grid.
    pub grid: Tint,
    /// World axes x, y and z on the grid.
    pub world_axes: [Tint; 3],
}

impl Default for Theme {
    fn default() -> Self {
        Self {
            bone: [150, 160, 176, 255],
            deforming: [64, 196, 255, 255],
            idle: [88, 92, 100, 255],
            joint: [208, 212, 220, 255],
            null: [196, 200, 208, 255],
            outline: [20, 21, 25, 255],
            selected: [250, 250, 250, 255],
            active: [98, 255, 176, 255],
            hovered: [255, 176, 32, 255],
            label: [240, 241, 244, 255],
            axes: [[240, 84, 92, 255], [132, 204, 72, 255], [84, 148, 250, 255]],
            ghost: [255, 255, 255, 170],
            ghost_mirrored: [255, 255, 255, 80],
            stroke: [255, 196, 64, 235],
            depth: [255, 255, 255, 210],
            plane: [120, 190, 255, 13],
            plane_border: [120, 190, 255, 130],
            grid: [150, 154, 164, 92],
            world_axes: [[196, 82, 90, 200], [112, 166, 70, 200], [82, 128, 208, 200]],
        }
    }
}

/// A group's colour (sRGB, 0 to 1 each) as a tint.
pub fn group_tint(color: [f32; 3]) -> Tint {
    let byte = |part: f32| (part.clamp(0.0, 1.0) * 255.0).round() as u8;
    [byte(color[0]), byte(color[1]), byte(color[2]), 255]
}

/// A mix of two colours at `part` of the way; the opacity is that of the first.
pub fn mix(from: Tint, to: Tint, part: f32) -> Tint {
    let channel = |a: u8, b: u8| (f32::from(a) + (f32::from(b) - f32::from(a)) * part).round() as u8;
    [channel(from[0], to[0]), channel(from[1], to[1]), channel(from[2], to[2]), from[3]]
}

/// A colour made darker (below 1) or lighter (above).
pub fn shade(tint: Tint, factor: f32) -> Tint {
    let channel = |part: u8| (f32::from(part) * factor).clamp(0.0, 255.0).round() as u8;
    [channel(tint[0]), channel(tint[1]), channel(tint[2]), tint[3]]
}

/// A colour with its opacity multiplied.
pub fn fade(tint: Tint, factor: f32) -> Tint {
    let alpha = (f32::from(tint[3]) * factor).clamp(0.0, 255.0).round() as u8;
    [tint[0], tint[1], tint[2], alpha]
}
