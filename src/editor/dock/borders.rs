//! Borders between the places of the dock: a border stays where a person put it, also after a window, or an interface of another
//! size, in which the places had no room there.

use std::collections::BTreeMap;

use egui_dock::{DockState, Node, SplitNode, SurfaceIndex, Tree};

/// Largest difference of two shares that are the same but for rounding.
const NEAR: f32 = 1e-5;

/// A border between two places.
#[derive(Debug, Clone, Copy)]
struct Border {
    /// Share of the first place that a person chose, or that the usual layout gives it.
    chosen: f32,
    /// Share with which it was drawn last: the chosen one, as far as both places have room.
    drawn: f32,
}

/// Borders of the window by the number of their node. The dock itself knows only the share that is drawn.
#[derive(Debug, Clone, Default)]
pub(super) struct Borders(BTreeMap<usize, Border>);

impl Borders {
    /// Takes over borders that were added or set since the last frame.
    pub fn note(&mut self, dock: &DockState<String>) {
        let known = std::mem::take(&mut self.0);
        let Some(tree) = dock.get_surface(SurfaceIndex::main()).and_then(|surface| surface.node_tree()) else { return };
        for (number, node) in tree.iter().enumerate() {
            let (Node::Horizontal(split) | Node::Vertical(split)) = node else { continue };
            let share = split.fraction;
            let same = known.get(&number).copied().filter(|border| border.drawn == share);
            self.0.insert(number, same.unwrap_or(Border { chosen: share, drawn: share }));
        }
    }

    /// Takes over borders that a person moved while the dock was drawn, and puts the others back where they were chosen to be, as
    /// far as each place keeps a length of `least`. Returns `true` if one has to be drawn at another place.
    pub fn follow(&mut self, dock: &mut DockState<String>, least: f32) -> bool {
        let Some(tree) = main_tree(dock) else { return false };
        let mut is_moved = false;
        for (number, node) in tree.iter_mut().enumerate() {
            let (split, length) = match node {
                Node::Horizontal(split) => {
                    let length = split.rect.width();
                    (split, length)
                }
                Node::Vertical(split) => {
                    let length = split.rect.height();
                    (split, length)
                }
                Node::Empty | Node::Leaf(_) => continue,
            };
            let share = split.fraction;
            let border = self.0.entry(number).or_insert(Border { chosen: share, drawn: share });
            if (share - fitting(border.drawn, length, least)).abs() > NEAR {
                border.chosen = share;
            }
            is_moved |= put(split, fitting(border.chosen, length, least));
            border.drawn = split.fraction;
        }
        is_moved
    }

    /// Puts all borders where they were chosen to be, for a window of any size.
    pub fn restore(&self, dock: &mut DockState<String>) {
        let Some(tree) = main_tree(dock) else { return };
        for (number, node) in tree.iter_mut().enumerate() {
            let (Node::Horizontal(split) | Node::Vertical(split)) = node else { continue };
            let known = self.0.get(&number).filter(|border| border.drawn == split.fraction);
            if let Some(border) = known {
                split.fraction = border.chosen;
            }
        }
    }
}

fn main_tree(dock: &mut DockState<String>) -> Option<&mut Tree<String>> {
    dock.get_surface_mut(SurfaceIndex::main()).and_then(|surface| surface.node_tree_mut())
}

/// Puts a border to a share; returns `true` if it was elsewhere.
fn put(split: &mut SplitNode, share: f32) -> bool {
    let is_moved = (split.fraction - share).abs() > NEAR;
    if is_moved {
        split.fraction = share;
    }
    is_moved
}

/// The share nearest to a given one with which both places have a length of `least`, as the dock computes it.
fn fitting(share: f32, length: f32, least: f32) -> f32 {
    if length <= 0.0 || !length.is_finite() {
        return share;
    }
    let min = (least / length).min(1.0);
    let max = 1.0 - min;
    share.clamp(min.min(max), max.max(min))
}
