//! Queries on the skin: the closest place of the skin to a few places, and depths behind a place.

use glam::{Vec2, Vec3};

/// The closest point of the skin to each place, searched on the triangles around the closest vertex.
///
/// Time goes with places times points plus triangles.
pub(super) fn snap(
    places: &[Vec3],
    points: &[Vec3],
    triangles: &[[u32; 3]],
    skin: impl Fn(usize) -> bool,
) -> Vec<Vec3> {
    let mut nearest = vec![(f32::INFINITY, u32::MAX); places.len()];
    for (index, point) in points.iter().enumerate() {
        for (place, best) in places.iter().zip(&mut nearest) {
            let distance = place.distance_squared(*point);
            if distance < best.0 && skin(index) {
                *best = (distance, index as u32);
            }
        }
    }
    let mut found: Vec<(f32, Vec3)> = places
        .iter()
        .zip(&nearest)
        .map(|(place, &(distance, index))| (distance, points.get(index as usize).copied().unwrap_or(*place)))
        .collect();
    let mut wanted: Vec<(u32, usize)> = nearest.iter().enumerate().map(|(place, &(_, index))| (index, place)).collect();
    wanted.sort_unstable();
    let mut marked = vec![false; points.len()];
    for &(index, _) in &wanted {
        if let Some(mark) = marked.get_mut(index as usize) {
            *mark = true;
        }
    }
    for corners in triangles {
        for &corner in corners {
            if marked.get(corner as usize) != Some(&true) {
                continue;
            }
            let [Some(&a), Some(&b), Some(&c)] = corners.map(|corner| points.get(corner as usize)) else { continue };
            let start = wanted.partition_point(|&(index, _)| index < corner);
            for &(_, place) in wanted.iter().skip(start).take_while(|&&(index, _)| index == corner) {
                let closest = closest_on_triangle(places[place], a, b, c);
                let distance = closest.distance_squared(places[place]);
                if distance < found[place].0 {
                    found[place] = (distance, closest);
                }
            }
        }
    }
    found.into_iter().map(|(_, point)| point).collect()
}

/// The point of a triangle closest to `p`, by the regions of its corners, edges and inside.
fn closest_on_triangle(p: Vec3, a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    let on_edge = |from: Vec3, to: Vec3| {
        let along = to - from;
        let length = along.length_squared();
        let part = if length > 0.0 { ((p - from).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        from + along * part
    };
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    if area > 0.0 {
        let wb = (p - a).cross(c - a).dot(normal) / area;
        let wc = (b - a).cross(p - a).dot(normal) / area;
        if wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0 {
            return a + (b - a) * wb + (c - a) * wc;
        }
    }
    let edges = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    edges.into_iter().min_by(|x, y| x.distance_squared(p).total_cmp(&y.distance_squared(p))).unwrap_or(a)
}

/// The depths at which the line along z through `place` meets the triangles that `keep` accepts, nearest to the viewer
/// first.
pub(super) fn depths_at(
    place: Vec2,
    points: &[Vec3],
    triangles: &[[u32; 3]],
    keep: impl Fn(usize) -> bool,
) -> Vec<f32> {
    let mut found = Vec::new();
    for (index, corners) in triangles.iter().enumerate() {
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| points.get(corner as usize)) else { continue };
        let across = |place: f32, a: f32, b: f32, c: f32| place < a.min(b).min(c) || place > a.max(b).max(c);
        if across(place.y, a.y, b.y, c.y) || across(place.x, a.x, b.x, c.x) {
            continue;
        }
        let (ab, ac, ap) = ((*b - *a).truncate(), (*c - *a).truncate(), place - a.truncate());
        let area = ab.perp_dot(ac);
        if area == 0.0 {
            continue;
        }
        let (wb, wc) = (ap.perp_dot(ac) / area, ab.perp_dot(ap) / area);
        if wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0 && keep(index) {
            found.push(a.z + (b.z - a.z) * wb + (c.z - a.z) * wc);
        }
    }
    found.sort_by(|x, y| y.total_cmp(x));
    found
}
