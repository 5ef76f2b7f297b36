//! Parts that are worn over the skin: hats, hair, large sunglasses.
//!
//! They are large and visible as skin is, but have skin close behind them wherever they are seen. Pieces of skin, such as
//! those of a scan, lie side by side.

use glam::Vec3;

use super::{ShellKind, Shells, measured, visibility};

/// Least share of a shell's visible places that have another shell close behind them, of a part that is worn. The brim of
/// a hat reaches beyond the head, so that most of a sombrero has nothing behind it.
const WORN: f32 = 0.2;
/// Largest distance of a worn part from the skin behind it, as a share of the largest extent of all shells.
const CLOSE: f32 = 0.15;

impl Shells {
    /// The shells with parts that are worn over the skin as [`ShellKind::Inside`]; `None` if there are none.
    ///
    /// `points` and `triangles` are those that the shells were found in. At least one skin shell stays skin. Linear time.
    pub fn without_worn(&self, points: &[Vec3], triangles: &[[u32; 3]]) -> Option<Self> {
        let is_skin: Vec<bool> = self.kinds.iter().map(|kind| *kind == ShellKind::Skin).collect();
        if is_skin.iter().filter(|is_skin| **is_skin).count() < 2 {
            return None;
        }
        let islands = measured(points, triangles, &self.shell_of, self.kinds.len());
        let covering = visibility::covering(points, triangles, &self.shell_of, &islands, &is_skin, CLOSE);
        let worn: Vec<bool> = is_skin.iter().zip(covering).map(|(is_skin, share)| *is_skin && share >= WORN).collect();
        if !worn.contains(&true) || !is_skin.iter().zip(&worn).any(|(is_skin, worn)| *is_skin && !worn) {
            return None;
        }
        let kind = |(kind, worn): (&ShellKind, bool)| if worn { ShellKind::Inside } else { *kind };
        Some(Self { shell_of: self.shell_of.clone(), kinds: self.kinds.iter().zip(worn).map(kind).collect() })
    }
}
