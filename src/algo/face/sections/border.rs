//! The open end of a neck.

use glam::Vec3;

use crate::mesh::adjacency;

/// A border of an open mesh.
#[derive(Debug, Clone, Copy)]
pub struct End {
    /// Mean of the border, weighted by its length.
    pub center: Vec3,
    /// Lower corner of its box.
    pub low: Vec3,
    /// Upper corner of its box.
    pub high: Vec3,
    length: f32,
    /// Area of the connected surface that it bounds.
    area: f32,
}

impl End {
    /// Returns `true` if a neck was cut from its body here: the border is large, behind or below the face, and not the
    /// rim of a mask, which is as wide and as high as the whole mesh.
    pub fn is_neck(&self, low: Vec3, high: Vec3, center: Vec3) -> bool {
        let (size, whole) = (self.high - self.low, high - low);
        let rim = size.x > 0.85 * whole.x && size.y > 0.85 * whole.y;
        let large = size.max_element() > 0.15 * whole.max_element();
        let behind = self.center.z < center.z || self.center.y < center.y;
        large && behind && !rim
    }
}

/// Share of the largest connected surface from which on a surface may be the head: closed hair is larger than a head, and open
/// brows and hair beside a closed body are smaller than half of it.
const HEAD: f32 = 0.5;

/// The longest border of the largest connected surface of a mesh that has one and may be the head; hair has a longer rim than a
/// neck.
pub fn largest(points: &[Vec3], triangles: &[[u32; 3]]) -> Option<End> {
    let (welded, count) = adjacency::weld(points);
    let mut place = vec![Vec3::ZERO; count];
    for (point, number) in points.iter().zip(&welded) {
        place[*number as usize] = *point;
    }
    let joined: Vec<[u32; 3]> = triangles
        .iter()
        .filter(|triangle| triangle.iter().all(|corner| (*corner as usize) < points.len()))
        .map(|triangle| triangle.map(|corner| welded[corner as usize]))
        .collect();
    let edges = lonely(&joined, count);
    let sides: Vec<[u32; 3]> = edges.iter().map(|[a, b]| [*a, *b, *b]).collect();
    let (loop_of, loops) = adjacency::islands(&sides, count);
    let mut ends: Vec<End> = (0..loops)
        .map(|_| End { center: Vec3::ZERO, low: Vec3::MAX, high: Vec3::MIN, length: 0.0, area: 0.0 })
        .collect();
    let (island_of, islands) = adjacency::islands(&joined, count);
    let mut areas = vec![0.0_f32; islands];
    for triangle in &joined {
        let [a, b, c] = triangle.map(|corner| place[corner as usize]);
        areas[island_of[triangle[0] as usize] as usize] += (b - a).cross(c - a).length();
    }
    for [a, b] in edges {
        let end = &mut ends[loop_of[a as usize] as usize];
        end.area = areas[island_of[a as usize] as usize];
        let (a, b) = (place[a as usize], place[b as usize]);
        let length = a.distance(b);
        end.center += (a + b) * 0.5 * length;
        end.length += length;
        end.low = end.low.min(a).min(b);
        end.high = end.high.max(a).max(b);
    }
    let least = HEAD * areas.iter().copied().fold(0.0, f32::max);
    ends.retain(|end| end.length > 0.0 && end.area >= least);
    let largest = ends.iter().map(|end| end.area).fold(0.0, f32::max);
    let bounds = |end: &End| end.area >= largest;
    let mut end = ends.into_iter().filter(bounds).max_by(|a, b| a.length.total_cmp(&b.length))?;
    end.center /= end.length;
    Some(end)
}

/// Edges of exactly one triangle, by their ends.
fn lonely(triangles: &[[u32; 3]], count: usize) -> Vec<[u32; 2]> {
    let sides = || {
        let edges = |triangle: &[u32; 3]| {
            let [a, b, c] = *triangle;
            [(a, b), (b, c), (c, a)]
        };
        triangles.iter().flat_map(edges).filter(|(a, b)| a != b).map(|(a, b)| (a.min(b), a.max(b)))
    };
    // Each edge is stored in the list of its lower end; lists are short.
    let mut starts = vec![0_u32; count + 1];
    for (low, _) in sides() {
        starts[low as usize + 1] += 1;
    }
    for place in 0..count {
        starts[place + 1] += starts[place];
    }
    let mut filled = starts.clone();
    let mut others = vec![0_u32; starts[count] as usize];
    for (low, high) in sides() {
        others[filled[low as usize] as usize] = high;
        filled[low as usize] += 1;
    }
    let mut found = Vec::new();
    for (place, ends) in starts.windows(2).enumerate() {
        let list = &mut others[ends[0] as usize..ends[1] as usize];
        list.sort_unstable();
        let same = list.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
        found.extend(same.map(|same| [place as u32, same[0]]));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds a box of twelve triangles, or without the two at its bottom.
    fn add_box(mesh: &mut (Vec<Vec3>, Vec<[u32; 3]>), low: Vec3, size: Vec3, is_closed: bool) {
        let first = mesh.0.len() as u32;
        let corner = |at: u32| Vec3::new((at & 1) as f32, (at >> 1 & 1) as f32, (at >> 2) as f32);
        mesh.0.extend((0..8).map(|at| low + size * corner(at)));
        let bottom = [[0, 1, 5], [0, 5, 4]];
        let others = [
            [2, 6, 7],
            [2, 7, 3],
            [0, 4, 6],
            [0, 6, 2],
            [1, 3, 7],
            [1, 7, 5],
            [0, 2, 3],
            [0, 3, 1],
            [4, 5, 7],
            [4, 7, 6],
        ];
        let all = bottom.iter().filter(|_| is_closed).chain(&others);
        mesh.1.extend(all.map(|corners| corners.map(|corner: u32| first + corner)));
    }

    #[test]
    fn the_border_is_the_necks_beside_hair() {
        let head = (Vec3::ZERO, Vec3::ONE);
        // Closed hair with a larger surface than the head, and a small open piece with a long rim.
        for (low, size, is_closed) in
            [(Vec3::new(-0.1, 2.0, -0.1), Vec3::splat(1.2), true), (Vec3::Y * 3.0, Vec3::new(6.0, 0.1, 0.1), false)]
        {
            let mut mesh = (Vec::new(), Vec::new());
            add_box(&mut mesh, head.0, head.1, false);
            add_box(&mut mesh, low, size, is_closed);
            let end = largest(&mesh.0, &mesh.1).expect("the head is open");
            assert_eq!((end.low, end.high), (Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0)), "{is_closed}");
        }
        // A closed body has no border, whatever small open pieces lie on it.
        let mut closed = (Vec::new(), Vec::new());
        add_box(&mut closed, head.0, head.1, true);
        add_box(&mut closed, Vec3::Y * 3.0, Vec3::new(6.0, 0.05, 0.05), false);
        assert!(largest(&closed.0, &closed.1).is_none());
    }
}
