//! Shells: the loose parts of a head mesh: skin, eyes and inner parts.
//!
//! A head often comes with eyeballs, teeth and lashes as loose parts, and a scan with its skin in several pieces. Size
//! alone cannot tell them apart, so the visibility of every part is measured from six sides: skin is large and visible,
//! eyes are a pair of equal balls, and the rest lies inside.

use glam::Vec3;

use crate::mesh::adjacency;

mod eyes;
mod tongue;
mod visibility;
mod worn;

pub use tongue::MouthName;

/// Kind of a shell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShellKind {
    /// The outer surface.
    Skin,
    /// The eyeball on the character's left.
    LeftEye,
    /// The eyeball on the character's right.
    RightEye,
    /// Teeth, lashes and everything else.
    Inside,
    /// The tongue, once [`Shells::mark_tongue`] has found it among the parts inside.
    Tongue,
}

/// The loose parts of a head.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shells {
    /// The shell of each point.
    pub shell_of: Vec<u32>,
    /// Kind of each shell.
    pub kinds: Vec<ShellKind>,
}

impl Shells {
    /// Kind of a point's shell.
    pub fn kind(&self, point: usize) -> ShellKind {
        self.shell_of.get(point).and_then(|&shell| self.kinds.get(shell as usize)).copied().unwrap_or(ShellKind::Inside)
    }
}

/// Least area of a skin shell, as a share of the largest shell's.
const SKIN_AREA: f32 = 0.03;
/// Least visible share of a skin shell from six sides. A flat patch of skin shows one half of itself; teeth behind open
/// lips show a sixth.
const SKIN_SEEN: f32 = 0.3;

/// Measurements of one shell.
#[derive(Debug, Clone, Copy)]
struct Island {
    low: Vec3,
    high: Vec3,
    area: f32,
}

/// Finds the loose parts of a mesh and the kind of each.
///
/// `points` are in head space (+x the character's left, +y up, +z forward), in any unit. Points of equal position are
/// connected, so that texture seams do not cut the skin. Every large part that is visible from outside is
/// [`ShellKind::Skin`], with the walls of mouth and eye sockets connected to it; two balls of one size are the eyes.
/// Points without triangles are [`ShellKind::Inside`]. Triangles with corners past the end are ignored.
///
/// Shells are numbered by their first points. Linear time; a millisecond for 10,000 points.
pub fn find_shells(points: &[Vec3], triangles: &[[u32; 3]]) -> Shells {
    let (welded, count) = adjacency::weld(points);
    let whole = |triangle: &&[u32; 3]| triangle.iter().all(|corner| (*corner as usize) < points.len());
    let joined: Vec<[u32; 3]> =
        triangles.iter().filter(whole).map(|triangle| triangle.map(|corner| welded[corner as usize])).collect();
    let (island_of, found) = adjacency::islands(&joined, count);
    let shell_of: Vec<u32> = welded.iter().map(|place| island_of[*place as usize]).collect();

    let islands = measured(points, triangles, &shell_of, found);
    let kinds = kinds(points, triangles, &shell_of, &islands);
    Shells { shell_of, kinds }
}

/// Measurements of `count` shells. Triangles with corners past the end are ignored.
fn measured(points: &[Vec3], triangles: &[[u32; 3]], shell_of: &[u32], count: usize) -> Vec<Island> {
    let mut islands = vec![Island { low: Vec3::MAX, high: Vec3::MIN, area: 0.0 }; count];
    for (point, shell) in points.iter().zip(shell_of) {
        let island = &mut islands[*shell as usize];
        island.low = island.low.min(*point);
        island.high = island.high.max(*point);
    }
    let whole = |triangle: &&[u32; 3]| triangle.iter().all(|corner| (*corner as usize) < points.len());
    for triangle in triangles.iter().filter(whole) {
        let [a, b, c] = triangle.map(|corner| points[corner as usize]);
        let area = 0.5 * (b - a).cross(c - a).length();
        if area.is_finite() {
            islands[shell_of[triangle[0] as usize] as usize].area += area;
        }
    }
    islands
}

fn kinds(points: &[Vec3], triangles: &[[u32; 3]], shell_of: &[u32], islands: &[Island]) -> Vec<ShellKind> {
    let largest = islands.iter().map(|island| island.area).fold(0.0, f32::max);
    let mut kinds: Vec<ShellKind> = islands.iter().map(|_| ShellKind::Inside).collect();
    if largest <= 0.0 {
        return kinds;
    }
    let solid = islands.iter().filter(|island| island.area > 0.0).count();
    let seen =
        if solid > 1 { visibility::shares(points, triangles, shell_of, islands) } else { vec![1.0; islands.len()] };
    for (kind, (island, seen)) in kinds.iter_mut().zip(islands.iter().zip(&seen)) {
        if island.area >= SKIN_AREA * largest && *seen >= SKIN_SEEN {
            *kind = ShellKind::Skin;
        }
    }
    if solid > 1 {
        eyes::find(points, shell_of, islands, None, &mut kinds);
    }
    // One shell has to be the skin, even of a shape that hides itself.
    if !kinds.contains(&ShellKind::Skin)
        && let Some(first) = islands.iter().position(|island| island.area == largest)
    {
        kinds[first] = ShellKind::Skin;
    }
    kinds
}
