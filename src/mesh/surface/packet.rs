//! Four triangles in 128 bytes: two quads, whose halves share two corners.

use glam::Vec3;
use wide::{CmpGt, CmpLt, f32x4};

use super::crossing::Frame;
use super::node::Bounds;

/// Triangles of a packet.
pub(super) const LANES: usize = 4;
/// Marks a lane without a triangle.
pub(super) const NONE: u32 = u32::MAX;

/// Two triangles with a common edge, or one alone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quad {
    /// Points: the first triangle has the corners 0, 1, 2 and the second 0, 2, 3, each after a rotation.
    pub points: [u32; 4],
    /// Index of each triangle; [`NONE`] for a missing second one.
    pub triangles: [u32; 2],
    /// Index of the triangle's own corner that comes first, for each triangle.
    rotations: [u8; 2],
}

impl Quad {
    /// A quad of one triangle.
    pub fn one(index: u32, [a, b, c]: [u32; 3]) -> Self {
        Self { points: [a, b, c, c], triangles: [index, NONE], rotations: [0; 2] }
    }

    /// A quad of two triangles, if they run along a common edge in opposite directions.
    pub fn two(indices: [u32; 2], first: [u32; 3], second: [u32; 3]) -> Option<Self> {
        for i in 0..3 {
            let [a, b, c] = [first[i], first[(i + 1) % 3], first[(i + 2) % 3]];
            for j in 0..3 {
                if second[j] == a && second[(j + 1) % 3] == c {
                    return Some(Self {
                        points: [a, b, c, second[(j + 2) % 3]],
                        triangles: indices,
                        rotations: [i as u8, j as u8],
                    });
                }
            }
        }
        None
    }
}

/// Two quads, lane by lane.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(128))]
pub(super) struct Packet {
    /// Coordinates by axis, then quad, then the quad's points.
    corners: [[f32x4; 2]; 3],
    /// The caller's index of each triangle, [`NONE`] if a lane has none.
    triangles: [u32; LANES],
    /// Index of the corner of each triangle that comes first.
    rotations: [u8; LANES],
    /// A bit for each lane with a triangle.
    lanes: u32,
}

impl Packet {
    /// Makes a packet of one or two quads, without positions; returns it with the indices of its points.
    pub fn new(quads: &[Quad]) -> (Self, [u32; 8]) {
        let mut packet =
            Self { corners: [[f32x4::ZERO; 2]; 3], triangles: [NONE; LANES], rotations: [0; LANES], lanes: 0 };
        let mut points = [0; 8];
        for (i, quad) in quads.iter().chain(quads).take(2).enumerate() {
            points[4 * i..4 * i + 4].copy_from_slice(&quad.points);
            if i < quads.len() {
                packet.triangles[2 * i..2 * i + 2].copy_from_slice(&quad.triangles);
                packet.rotations[2 * i..2 * i + 2].copy_from_slice(&quad.rotations);
            }
        }
        for lane in 0..LANES {
            packet.lanes |= u32::from(packet.triangles[lane] != NONE) << lane;
        }
        (packet, points)
    }

    /// Sets the positions of the packet's points; returns the box around them.
    #[inline(always)]
    pub fn place(&mut self, points: &[Vec3], sources: &[u32; 8]) -> Bounds {
        let at = sources.map(|point| points[point as usize].to_array());
        let mut bounds = Bounds::EMPTY;
        for (axis, corners) in self.corners.iter_mut().enumerate() {
            let of = |i: usize| at[i][axis];
            let [p, q] = [0, 4].map(|i| f32x4::new([of(i), of(i + 1), of(i + 2), of(i + 3)]));
            *corners = [p, q];
            let [a, b, c, d] = p.fast_min(q).to_array();
            bounds.low[axis] = least(least(a, b), least(c, d));
            let [a, b, c, d] = p.fast_max(q).to_array();
            bounds.high[axis] = -least(least(-a, -b), least(-c, -d));
        }
        bounds
    }

    /// The index of the triangle in a lane.
    pub fn triangle(&self, lane: usize) -> u32 {
        self.triangles[lane]
    }

    /// The corners of the triangle in a lane, in its own order.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> [Vec3; 3] {
        let order = if lane & 1 == 0 { [0, 1, 2] } else { [0, 2, 3] };
        let first = 3 - usize::from(self.rotations[lane]);
        [0, 1, 2].map(|corner| {
            let i = order[(corner + first) % 3];
            Vec3::from_array(self.corners.map(|axis| axis[lane / 2].as_array_ref()[i]))
        })
    }

    /// A bit for each lane with a triangle.
    pub fn lanes(&self) -> u32 {
        self.lanes
    }

    /// A bit for each lane whose triangle may be crossed. No crossing is missed; false candidates are rare.
    ///
    /// The same sheared coordinates as in [`Frame::cross`]. Rounding keeps order, so a strict comparison of rounded
    /// products is a strict comparison of the products themselves.
    #[inline(always)]
    pub fn candidates(&self, frame: &Frame) -> u32 {
        let [x, y, z] = frame.axes;
        let origin = frame.axes.map(|axis| f32x4::splat(frame.origin[axis]));
        let depth = self.corners[z].map(|corner| corner - origin[2]);
        let flat = |axis: usize, i: usize| {
            let shear = f32x4::splat(frame.shear[i]);
            let [p, q] = [0, 1].map(|half| (self.corners[axis][half] - origin[i] - shear * depth[half]).to_array());
            [
                f32x4::new([p[0], p[0], q[0], q[0]]),
                f32x4::new([p[1], p[2], q[1], q[2]]),
                f32x4::new([p[2], p[3], q[2], q[3]]),
            ]
        };
        let (xs, ys) = (flat(x, 0), flat(y, 1));
        let edge = |a: usize, b: usize| {
            let (p, q) = (xs[a] * ys[b], ys[a] * xs[b]);
            (p.cmp_gt(q), p.cmp_lt(q))
        };
        let (u, v, w) = (edge(1, 2), edge(2, 0), edge(0, 1));
        let mixed = (u.0 | v.0 | w.0) & (u.1 | v.1 | w.1);
        !mixed.move_mask() as u32 & self.lanes
    }

    /// Reads a word from each half of the packet.
    #[inline(always)]
    pub fn touch(&self) -> u32 {
        self.corners[0][0].as_array_ref()[0].to_bits() ^ self.lanes
    }
}

/// The lesser of two numbers, neither of which is NaN: one instruction.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
