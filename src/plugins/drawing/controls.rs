//! Shapes of controls: lines over the mesh, in the colour of the control, its layer or its state.

use super::{
    ink::{Ink, Pen},
    theme::{Theme, Tint, group_tint, mix},
};
use crate::{
    plugins::{
        controls::outline::ControlOutline,
        document::{HoveredNode, Selection},
        viewport::Sight,
    },
    rig::LayerDisplay,
};

/// Grey of a layer that is shown as a template.
const TEMPLATE: Tint = [128, 130, 136, 255];

/// Draws controls into `ink`; selected and hovered controls are drawn wider.
pub fn draw_controls(
    controls: &[ControlOutline],
    selection: &Selection,
    hovered: &HoveredNode,
    sight: &Sight,
    theme: &Theme,
    ink: &mut Ink,
) {
    let mut pen = Pen::new(ink, sight);
    for control in controls {
        let own = if control.display == LayerDisplay::Template { TEMPLATE } else { group_tint(control.color) };
        let (tint, width) = match control.uid {
            uid if hovered.0 == Some(uid) => (theme.hovered, 3.0),
            uid if selection.active() == Some(uid) => (theme.active, 3.0),
            uid if selection.0.contains(&uid) => (mix(own, theme.selected, 0.7), 2.6),
            _ => (own, 1.8),
        };
        for line in &control.lines {
            for ends in line.windows(2) {
                let (ends, pixel) = ([ends[0], ends[1]], sight.pixel_at(ends[0].midpoint(ends[1])));
                pen.line(ends, width + 1.6, 0.0, theme.outline);
                pen.line(ends, width, pixel, tint);
            }
        }
    }
}
