//! Wire shapes of controls, by name: lines in unit size.
//!
//! Every shape reaches from -1 to 1 at its widest. Flat ones lie in the plane of X and Z and face along Y; shapes with
//! a direction point along Z, or along Y if they are upright. A control draws its shape scaled by `size` and
//! transformed by the shape's offset.

use std::{collections::BTreeMap, f32::consts::TAU, sync::LazyLock};

use bevy::math::ops::{cos, sin};
use glam::Vec3;

/// Polylines of a shape; a polyline is closed if its last point equals the first.
pub type Lines = Vec<Vec<Vec3>>;

static LIBRARY: LazyLock<BTreeMap<&'static str, Lines>> = LazyLock::new(library);

/// The lines of a shape; `None` for a name that is not in the library.
pub fn shape(name: &str) -> Option<&'static [Vec<Vec3>]> {
    LIBRARY.get(name).map(Vec::as_slice)
}

/// The names of all shapes, sorted.
pub fn names() -> impl Iterator<Item = &'static str> {
    LIBRARY.keys().copied()
}

fn library() -> BTreeMap<&'static str, Lines> {
    BTreeMap::from([
        ("arrow", vec![arrow()]),
        ("circle", vec![circle(1.0)]),
        ("cog", vec![cog(), circle(0.45)]),
        ("cross", vec![cross()]),
        ("cube", cube()),
        ("cylinder", cylinder()),
        ("diamond", diamond()),
        ("double_arrow", vec![double_arrow()]),
        ("eye", eye()),
        ("foot", vec![foot()]),
        ("four_arrows", vec![four_arrows()]),
        ("half_circle", vec![half_circle()]),
        ("hand", vec![hand()]),
        ("line", vec![vec![Vec3::NEG_Y, Vec3::Y]]),
        ("locator", locator()),
        ("pin", pin()),
        ("pyramid", pyramid()),
        ("ring_arrows", ring_arrows()),
        ("sphere", sphere()),
        ("spiral", vec![spiral()]),
        ("square", vec![square(1.0, 0.0)]),
        ("star", vec![star()]),
        ("triangle", vec![flat(&[(-1.0, -0.75), (1.0, -0.75), (0.0, 1.0), (-1.0, -0.75)])]),
    ])
}

/// Points in the plane of X and Z.
fn flat(points: &[(f32, f32)]) -> Vec<Vec3> {
    points.iter().map(|(x, z)| Vec3::new(*x, 0.0, *z)).collect()
}

/// An arc in the plane of X and Z, from an angle to another (turns, 0 at +Z, towards +X).
fn arc(radius: f32, from: f32, to: f32, pieces: usize) -> Vec<Vec3> {
    let at = |i: usize| {
        let angle = TAU * (from + (to - from) * i as f32 / pieces as f32);
        Vec3::new(radius * sin(angle), 0.0, radius * cos(angle))
    };
    (0..=pieces).map(at).collect()
}

fn circle(radius: f32) -> Vec<Vec3> {
    let mut points = arc(radius, 0.0, 1.0, 32);
    // The last point equals the first to the bit.
    points[32] = points[0];
    points
}

fn square(half: f32, y: f32) -> Vec<Vec3> {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)]
        .map(|(x, z): (f32, f32)| Vec3::new(x * half, y, z * half))
        .to_vec()
}

fn uprights(corners: &[Vec3], low: f32, high: f32) -> impl Iterator<Item = Vec<Vec3>> {
    corners.iter().map(move |corner| vec![corner.with_y(low), corner.with_y(high)])
}

fn cube() -> Lines {
    let bottom = square(1.0, -1.0);
    let sides: Lines = uprights(&bottom[..4], -1.0, 1.0).collect();
    [vec![bottom, square(1.0, 1.0)], sides].concat()
}

fn cylinder() -> Lines {
    let ring = circle(1.0);
    let at = |y: f32| ring.iter().map(|point| point.with_y(y)).collect();
    let sides: Lines = uprights(&[ring[0], ring[8], ring[16], ring[24]], -1.0, 1.0).collect();
    [vec![at(-1.0), at(1.0)], sides].concat()
}

fn sphere() -> Lines {
    let ring = circle(1.0);
    let standing = ring.iter().map(|p| Vec3::new(p.x, p.z, 0.0)).collect();
    let facing = ring.iter().map(|p| Vec3::new(0.0, p.x, p.z)).collect();
    vec![ring, standing, facing]
}

fn diamond() -> Lines {
    let ring = [Vec3::X, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Z];
    let around = vec![ring[0], ring[1], ring[2], ring[3], ring[0]];
    let sides = ring.map(|corner| vec![Vec3::Y, corner, Vec3::NEG_Y]);
    [vec![around], sides.to_vec()].concat()
}

fn pyramid() -> Lines {
    let base = square(1.0, 0.0);
    let sides: Lines = base[..4].iter().map(|corner| vec![*corner, Vec3::Y * 1.5]).collect();
    [vec![base], sides].concat()
}

fn arrow() -> Vec<Vec3> {
    flat(&[(-0.35, -1.0), (0.35, -1.0), (0.35, 0.2), (0.8, 0.2), (0.0, 1.0), (-0.8, 0.2), (-0.35, 0.2), (-0.35, -1.0)])
}

fn double_arrow() -> Vec<Vec3> {
    let half = [(0.25, 0.0), (0.25, 0.5), (0.6, 0.5), (0.0, 1.0), (-0.6, 0.5), (-0.25, 0.5), (-0.25, 0.0)];
    let other = half.map(|(x, z): (f32, f32)| (-x, -z));
    let mut points = flat(&[&half[..], &other[..]].concat());
    points.push(points[0]);
    points
}

fn four_arrows() -> Vec<Vec3> {
    let quarter = [(0.15, 0.15), (0.15, 0.65), (0.35, 0.65), (0.0, 1.0), (-0.35, 0.65), (-0.15, 0.65)];
    turned(&quarter, 4)
}

/// A run of points repeated `times` times around Y (a quarter turn each for 4), closed.
fn turned(points: &[(f32, f32)], times: usize) -> Vec<Vec3> {
    let mut all = Vec::with_capacity(points.len() * times + 1);
    for turn in 0..times {
        let angle = TAU * turn as f32 / times as f32;
        let (s, c) = (sin(angle), cos(angle));
        all.extend(points.iter().map(|(x, z)| Vec3::new(x * c - z * s, 0.0, x * s + z * c)));
    }
    all.push(all[0]);
    all
}

fn cross() -> Vec<Vec3> {
    turned(&[(0.35, 0.35), (0.35, 1.0), (-0.35, 1.0)], 4)
}

fn star() -> Vec<Vec3> {
    turned(&[(0.0, 1.0), (-0.25, 0.35)], 5)
}

fn cog() -> Vec<Vec3> {
    turned(&[(0.14, 0.99), (-0.14, 0.99), (-0.2, 0.76), (-0.38, 0.68)], 8)
}

fn locator() -> Lines {
    vec![vec![Vec3::NEG_X, Vec3::X], vec![Vec3::NEG_Y, Vec3::Y], vec![Vec3::NEG_Z, Vec3::Z]]
}

/// A stick with a ball, upright on the control.
fn pin() -> Lines {
    let ball = |point: Vec3| Vec3::new(point.x * 0.25, 0.75 + point.z * 0.25, 0.0);
    let ring = circle(1.0);
    let facing = ring.iter().map(|p| Vec3::new(0.0, 0.75 + p.x * 0.25, p.z * 0.25)).collect();
    vec![vec![Vec3::ZERO, Vec3::Y * 0.5], ring.into_iter().map(ball).collect(), facing]
}

fn half_circle() -> Vec<Vec3> {
    let mut points = arc(1.0, -0.25, 0.25, 16);
    points.push(points[0]);
    points
}

/// A circle with four arrow heads, for rotations.
fn ring_arrows() -> Lines {
    let head = |turn: f32| {
        let (s, c) = (sin(TAU * turn), cos(TAU * turn));
        let at = |x: f32, z: f32| Vec3::new(x * c + z * s, 0.0, z * c - x * s);
        vec![at(0.15, 0.85), at(0.0, 1.0), at(-0.15, 0.85), at(0.15, 0.85)]
    };
    [vec![circle(0.8)], (0..4).map(|i| head(i as f32 / 4.0)).collect()].concat()
}

fn spiral() -> Vec<Vec3> {
    let at = |i: usize| {
        let (along, angle) = (i as f32 / 72.0, TAU * 3.0 * i as f32 / 72.0);
        Vec3::new(along * sin(angle), 0.0, along * cos(angle))
    };
    (0..=72).map(at).collect()
}

/// An eye that faces along Z: two lids and an iris in the plane of X and Y.
fn eye() -> Lines {
    let lid = |sign: f32| {
        let at = |i: usize| {
            let x = -1.0 + i as f32 / 8.0;
            Vec3::new(x, sign * 0.5 * (1.0 - x * x), 0.0)
        };
        (0..=16).map(at).collect()
    };
    let iris = circle(0.35).into_iter().map(|p| Vec3::new(p.x, p.z, 0.0)).collect();
    vec![lid(1.0), lid(-1.0), iris]
}

/// A sole seen from above, toes towards Z.
fn foot() -> Vec<Vec3> {
    flat(&[
        (0.0, -1.0),
        (0.25, -0.93),
        (0.38, -0.72),
        (0.36, -0.4),
        (0.32, -0.1),
        (0.42, 0.2),
        (0.5, 0.5),
        (0.44, 0.8),
        (0.24, 0.97),
        (0.0, 1.0),
        (-0.25, 0.95),
        (-0.44, 0.75),
        (-0.5, 0.45),
        (-0.42, 0.1),
        (-0.3, -0.2),
        (-0.34, -0.5),
        (-0.37, -0.75),
        (-0.22, -0.94),
        (0.0, -1.0),
    ])
}

/// A palm with four fingers towards Z and a thumb towards X.
fn hand() -> Vec<Vec3> {
    flat(&[
        (-0.3, -1.0),
        (0.3, -1.0),
        (0.42, -0.65),
        (0.85, -0.2),
        (0.72, -0.02),
        (0.45, -0.2),
        (0.45, 0.75),
        (0.25, 0.75),
        (0.23, 0.2),
        (0.2, 1.0),
        (0.0, 1.0),
        (-0.02, 0.2),
        (-0.05, 0.9),
        (-0.24, 0.9),
        (-0.26, 0.15),
        (-0.3, 0.6),
        (-0.48, 0.6),
        (-0.48, -0.5),
        (-0.3, -1.0),
    ])
}
