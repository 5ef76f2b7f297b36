//! Search for the eyes among the shells: two balls of one size, side by side.

use glam::Vec3;

use super::{Island, ShellKind, Shells, measured};
use crate::algo::face::landmarks::Landmarks;

/// A shell with the shape of a ball, or of a large part of one.
#[derive(Debug, Clone, Copy)]
struct Ball {
    shell: usize,
    center: Vec3,
    radius: f32,
}

/// Largest radius of an eye, as a share of the size of all shells.
const LARGEST: f32 = 0.2;
/// Largest deviation of points from a ball, as a share of its radius (root of the mean square). It admits the cornea's
/// bulge and the hole behind the eyeball.
const ROUND: f32 = 0.12;
/// Least number of points of a ball; a sphere runs through any four.
const FEWEST: usize = 8;
/// Least extent of a ball, or of a part of one, as a share of its largest. A sphere runs through the corners of any bar,
/// too, such as the temple of a pair of glasses.
const FLATTEST: f32 = 0.18;
/// Largest distance of two eyes, in radii. Human eyes are 5 apart; beads and earrings are small and far from each other.
const APART: f32 = 16.0;

/// Places of the eyes on a face, the left one first, where eyeballs have to be.
pub struct Sockets {
    places: [Vec3; 2],
    /// Distance of the eyes' outer corners.
    scale: f32,
}

impl Sockets {
    fn of(landmarks: &Landmarks) -> Self {
        Self { places: [true, false].map(|left| landmarks.eye_center(left)), scale: landmarks.eye_distance() }
    }

    /// Returns `true` for balls that are behind the lids, or bulge out of them.
    fn hold(&self, balls: [(Vec3, f32); 2]) -> bool {
        balls.iter().zip(self.places).all(|((center, radius), place)| {
            let off = *center - place;
            off.truncate().length() <= 0.2 * self.scale + 0.5 * radius
                && off.z <= 0.1 * self.scale + 0.5 * radius
                && off.z >= -0.3 * self.scale - 2.5 * radius
        })
    }
}

impl Shells {
    /// Returns `true` if shells are marked as eyes.
    pub fn has_eyes(&self) -> bool {
        self.kinds.iter().any(|kind| matches!(kind, ShellKind::LeftEye | ShellKind::RightEye))
    }

    /// Returns `true` if both eyes are where `landmarks` have them; `points` are those that the shells were found in.
    pub fn are_eyes_on_face(&self, points: &[Vec3], landmarks: &Landmarks) -> bool {
        let bounds = |wanted: ShellKind| {
            let own = points.iter().enumerate().filter(|(point, _)| self.kind(*point) == wanted);
            own.fold((Vec3::MAX, Vec3::MIN), |(low, high), (_, place)| (low.min(*place), high.max(*place)))
        };
        let balls = [ShellKind::LeftEye, ShellKind::RightEye].map(|kind| {
            let (low, high) = bounds(kind);
            (0.5 * (low + high), 0.5 * (high - low).max_element())
        });
        Sockets::of(landmarks).hold(balls)
    }

    /// The shells with no eye among them: balls that were marked as eyes are [`ShellKind::Inside`].
    pub fn without_eyes(&self) -> Self {
        let kind = |kind: &ShellKind| match kind {
            ShellKind::LeftEye | ShellKind::RightEye => ShellKind::Inside,
            other => *other,
        };
        Self { shell_of: self.shell_of.clone(), kinds: self.kinds.iter().map(kind).collect() }
    }

    /// Marks a pair of balls where `landmarks` have the eyes as eyes; returns `false` if there is none.
    ///
    /// `points` and `triangles` are those that the shells were found in. Linear time.
    pub fn mark_eyes(&mut self, points: &[Vec3], triangles: &[[u32; 3]], landmarks: &Landmarks) -> bool {
        let islands = measured(points, triangles, &self.shell_of, self.kinds.len());
        find(points, &self.shell_of, &islands, Some(&Sockets::of(landmarks)), &mut self.kinds);
        self.has_eyes()
    }
}

/// Marks the eyes among `kinds`: the balls in `sockets` if they are given.
pub fn find(points: &[Vec3], shell_of: &[u32], islands: &[Island], sockets: Option<&Sockets>, kinds: &mut [ShellKind]) {
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for island in islands.iter().filter(|island| island.area > 0.0) {
        low = low.min(island.low);
        high = high.max(island.high);
    }
    let size = (high - low).max_element();
    let balls = balls(points, shell_of, islands, size);
    let Some((left, right)) = pair(&balls, (low.z + high.z) * 0.5, sockets) else { return };
    for (eye, kind) in [(left, ShellKind::LeftEye), (right, ShellKind::RightEye)] {
        for (shell, island) in islands.iter().enumerate() {
            // Cornea and iris are often shells of their own; every shell within the eye turns with it. Lashes reach out
            // of it.
            let reach = (island.low - eye.center).abs().max((island.high - eye.center).abs());
            if shell == eye.shell || (island.area > 0.0 && reach.max_element() <= eye.radius * 1.15) {
                kinds[shell] = kind;
            }
        }
    }
}

/// All shells with the shape of a ball.
fn balls(points: &[Vec3], shell_of: &[u32], islands: &[Island], size: f32) -> Vec<Ball> {
    let fits = |island: &Island| {
        let extent = island.high - island.low;
        let is_flat = extent.min_element() <= FLATTEST * extent.max_element();
        island.area > 0.0 && extent.max_element() < 2.2 * LARGEST * size && !is_flat
    };
    let possible: Vec<bool> = islands.iter().map(fits).collect();
    let mut members: Vec<Vec<Vec3>> = vec![Vec::new(); islands.len()];
    for (point, shell) in points.iter().zip(shell_of) {
        if possible[*shell as usize] {
            members[*shell as usize].push(*point);
        }
    }
    members.iter().enumerate().filter_map(|(shell, members)| ball(shell, members, &islands[shell], size)).collect()
}

/// The sphere through a shell's points by least squares; `None` if the shell is not a ball.
///
/// |p|² = 2 c·p + (r² - |c|²) is linear in the centre c and the rest. It is solved about the middle of the box, in
/// units of the box, by Gauss elimination in double precision.
fn ball(shell: usize, members: &[Vec3], island: &Island, size: f32) -> Option<Ball> {
    if members.len() < FEWEST {
        return None;
    }
    let middle = (island.low + island.high) * 0.5;
    let unit = (island.high - island.low).max_element() * 0.5;
    let mut system = [[0.0_f64; 5]; 4];
    for member in members {
        let p = ((*member - middle) / unit).as_dvec3();
        let row = [2.0 * p.x, 2.0 * p.y, 2.0 * p.z, 1.0, p.length_squared()];
        for i in 0..4 {
            for j in 0..5 {
                system[i][j] += row[i] * row[j];
            }
        }
    }
    let [x, y, z, rest] = solve(system)?;
    let square = rest + x * x + y * y + z * z;
    let center = Vec3::new(x as f32, y as f32, z as f32);
    let radius = square.max(0.0).sqrt() as f32;
    let off = |member: &Vec3| ((*member - middle) / unit).distance(center) - radius;
    let error = members.iter().map(|member| off(member) * off(member)).sum::<f32>() / members.len() as f32;
    // The test accepts a ball, but not a bowl cut from a much larger one.
    let round = error.sqrt() <= ROUND * radius && (0.6..1.4).contains(&radius);
    (round && radius * unit <= LARGEST * size).then(|| Ball {
        shell,
        center: middle + center * unit,
        radius: radius * unit,
    })
}

#[expect(clippy::needless_range_loop, reason = "indices are those of the matrix")]
fn solve(mut system: [[f64; 5]; 4]) -> Option<[f64; 4]> {
    for column in 0..4 {
        let pivot = (column..4).max_by(|a, b| system[*a][column].abs().total_cmp(&system[*b][column].abs()))?;
        system.swap(column, pivot);
        if system[column][column].abs() < 1e-9 {
            return None;
        }
        for row in 0..4 {
            if row != column {
                let factor = system[row][column] / system[column][column];
                for entry in 0..5 {
                    system[row][entry] -= factor * system[column][entry];
                }
            }
        }
    }
    Some([0, 1, 2, 3].map(|row| system[row][4] / system[row][row]))
}

/// The two balls most like a pair of eyes, left one first.
///
/// The balls have one size and lie side by side rather than above or behind each other. The largest pair wins, since
/// beads and buttons are smaller; of equal pairs the one in front.
fn pair(balls: &[Ball], middle: f32, sockets: Option<&Sockets>) -> Option<(Ball, Ball)> {
    let mut best: Option<(f32, Ball, Ball)> = None;
    for (index, a) in balls.iter().enumerate() {
        for b in &balls[index + 1..] {
            let apart = a.center - b.center;
            let radius = (a.radius + b.radius) * 0.5;
            let alike = (a.radius - b.radius).abs() <= 0.15 * radius;
            let beside = apart.x.abs() > 1.2 * radius && apart.x.abs() > 0.6 * apart.length();
            let (left, right) = if a.center.x >= b.center.x { (*a, *b) } else { (*b, *a) };
            let placed = [(left.center, left.radius), (right.center, right.radius)];
            let is_off_face = sockets.is_some_and(|sockets| !sockets.hold(placed));
            if !alike || !beside || apart.length() > APART * radius || is_off_face {
                continue;
            }
            let front = if (a.center.z + b.center.z) * 0.5 >= middle { 1.0 } else { 0.5 };
            let straight = apart.x.abs() / apart.length();
            let score = radius * front * straight;
            if best.is_none_or(|best| score > best.0) {
                best = Some((score, left, right));
            }
        }
    }
    best.map(|(_, left, right)| (left, right))
}
