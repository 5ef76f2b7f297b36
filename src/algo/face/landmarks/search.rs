//! Position of the face: the plane of symmetry, the height of the eyes and the size of the face, from a coarse depth
//! map.
//!
//! The mean relief of a face is laid over the map at every height and size; the residual of a fit of offset, pitch,
//! bend and strength gives the quality of the match.

use bevy::math::ops;
use glam::{Vec2, Vec3};

use super::prior::{RELIEF, RELIEF_STEP, RELIEF_TOP};
use crate::algo::face::depth_map::DepthMap;

/// Position of the face in head space.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Pose {
    /// Point half way between the eyes.
    pub center: Vec2,
    /// The distance of the outer eye corners.
    pub size: f32,
    /// Quality of the match with the mean relief, -1 to 1.
    pub match_: f32,
    /// Depth of the relief relative to the mean's.
    pub gain: f32,
    /// Ratio of height to width of the face, relative to the mean's.
    pub tall: f32,
    /// Quality of the match less penalties for implausible faces.
    pub worth: f32,
}

/// Least share of points with a mirror image on a symmetric head.
const MIRRORED: f32 = 0.97;
/// Distance of a point from the image of another, as a share of the distance to its own neighbour, up to which they are on
/// quads that are cut along other diagonals on the two sides and were subdivided.
const CUT: f32 = 0.7;
/// Least share of points with a mirror image of their own on such a head.
const EXACT: f32 = 0.7;

/// The x of the plane in which the points mirror onto each other, if they do.
///
/// Tries the middle of the bounds, the mean and zero, on up to 400 points. Sorting dominates: `n log n`.
pub(super) fn exact_mirror(points: &[Vec3], low: Vec3, high: Vec3) -> Option<f32> {
    let size = (high - low).max_element();
    let (tolerance, widest) = (size * 2e-4, size * 1e-2);
    let mut order: Vec<Vec3> = points.to_vec();
    order.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    // Distance of a place from the nearest point that is at least `least` away, if it is not further than `reach`.
    let nearest = |place: Vec3, least: f32, reach: f32| {
        let start = order.partition_point(|other| other.x < place.x - reach);
        let near = order[start..].iter().take_while(|other| other.x <= place.x + reach);
        let distances = near.map(|other| other.distance(place)).filter(|distance| (least..=reach).contains(distance));
        distances.reduce(f32::min)
    };
    let stride = (order.len() / 400).max(1);
    let mean = points.iter().map(|point| f64::from(point.x)).sum::<f64>() / points.len().max(1) as f64;
    [(low.x + high.x) / 2.0, 0.0, mean as f32].into_iter().find(|&middle| {
        let (mut exact, mut cut, mut asked) = (0, 0, 0);
        for &point in order.iter().step_by(stride) {
            asked += 1;
            let mirror = point.with_x(2.0 * middle - point.x);
            if nearest(mirror, 0.0, tolerance).is_some() {
                exact += 1;
            } else if let Some(off) = nearest(mirror, 0.0, widest) {
                let beside = nearest(point, tolerance, widest).unwrap_or(widest);
                cut += usize::from(off <= CUT * beside);
            }
        }
        let share = |count: usize| count as f32 / asked.max(1) as f32;
        share(exact) >= EXACT && share(exact + cut) >= MIRRORED
    })
}

/// Local maxima of the map's mirror symmetry, as x, best first, at most `most`.
///
/// The search runs between `from` and `to`, within `reach` either side and between the heights `rows`; differences of
/// depth are limited to `far`.
pub(super) fn mirror_axes(
    map: &DepthMap,
    (from, to): (f32, f32),
    step: f32,
    reach: f32,
    rows: (f32, f32),
    far: f32,
    most: usize,
) -> Vec<f32> {
    let pixel = map.frame.pixel;
    let stride = pixel.max((rows.1 - rows.0) / 60.0).max(f32::MIN_POSITIVE);
    let across = pixel.max(reach / 40.0).max(f32::MIN_POSITIVE);
    let (lines, columns) = (((rows.1 - rows.0) / stride) as usize, (reach / across) as usize);
    let cost = |middle: f32| -> f32 {
        let (mut sum, mut count) = (0.0f32, 0u32);
        for line in 0..=lines {
            let y = rows.0 + line as f32 * stride;
            for column in 1..=columns {
                let t = column as f32 * across;
                let sides = (map.sample(Vec2::new(middle + t, y)), map.sample(Vec2::new(middle - t, y)));
                sum += match sides {
                    (Some(left), Some(right)) => (left - right).abs().min(far),
                    (None, None) => continue,
                    _ => far,
                };
                count += 1;
            }
        }
        if count == 0 { far } else { sum / count as f32 }
    };
    let steps = (((to - from) / step).ceil() as usize).clamp(2, 100);
    let at = |i: f32| from + (to - from) * i / steps as f32;
    let costs: Vec<f32> = (0..=steps).map(|i| cost(at(i as f32))).collect();
    let mut found: Vec<(f32, f32)> = Vec::new();
    for (i, window) in costs.windows(3).enumerate() {
        let &[a, b, c] = window else { continue };
        let bend = a - 2.0 * b + c;
        if b <= a && b <= c && bend > 0.0 {
            found.push((b, at(i as f32 + 1.0 + (0.5 * (a - c) / bend).clamp(-0.5, 0.5))));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(most);
    found.into_iter().map(|(_, place)| place).collect()
}

/// Reach of the head in each row from `middle` to the right (−x) and left (+x), over `solid` pixels.
fn reaches(map: &DepthMap, solid: &[bool], middle: f32) -> Vec<(f32, f32)> {
    let (width, pixel) = (map.frame.width, map.frame.pixel);
    let center = map.frame.pixels(Vec2::new(middle, 0.0)).x.round().clamp(0.0, width as f32 - 1.0) as usize;
    let run = |row: &[bool]| {
        let right = (0..=center).rev().take_while(|&x| row.get(x) == Some(&true)).count();
        let left = (center..width).take_while(|&x| row.get(x) == Some(&true)).count();
        (right as f32 * pixel, left as f32 * pixel)
    };
    solid.chunks(width.max(1)).map(run).collect()
}

/// The Gram matrix of offset, pitch, bend, relief and depth over the places of the mean relief, every `stride`-th.
fn gram(map: &DepthMap, pose: &Pose, stride: usize) -> Option<[[f64; 5]; 5]> {
    let mut gram = [[0.0f64; 5]; 5];
    let (mut seen, mut asked) = (0u32, 0u32);
    let inverse = 1.0 / pose.size;
    for (row, depths) in RELIEF.iter().enumerate() {
        let v = RELIEF_TOP - row as f32 * RELIEF_STEP;
        for (column, &relief) in depths.iter().enumerate() {
            if (row + column) % stride != 0 {
                continue;
            }
            let u = column as f32 * RELIEF_STEP;
            for side in [-1.0, 1.0] {
                if column == 0 && side > 0.0 {
                    continue;
                }
                asked += 1;
                let at = map.frame.pixels(pose.center + Vec2::new(u * side, v * pose.tall) * pose.size) + 0.5;
                if at.x < 0.0 || at.y < 0.0 {
                    continue;
                }
                let Some(depth) = map.at(at.x as usize, at.y as usize) else { continue };
                seen += 1;
                let values = [1.0, v, u * u, relief, depth * inverse].map(f64::from);
                for i in 0..5 {
                    for j in 0..=i {
                        gram[i][j] += values[i] * values[j];
                    }
                }
            }
        }
    }
    (seen * 10 >= asked * 8).then_some(gram)
}

/// Partial correlation of depth and relief without offset, pitch and bend, and the ratio of the depths to the relief,
/// from a Gram matrix: its Cholesky factor holds both.
fn correlation(gram: &[[f64; 5]; 5]) -> Option<(f32, f32)> {
    let mut factor = [[0.0f64; 5]; 5];
    for i in 0..5 {
        for j in 0..=i {
            let sum: f64 = gram[i][j] - (0..j).map(|k| factor[i][k] * factor[j][k]).sum::<f64>();
            factor[i][j] = match (i == j, factor[j][j] > 1e-9) {
                (true, _) => sum.max(0.0).sqrt(),
                (false, true) => sum / factor[j][j],
                (false, false) => 0.0,
            };
        }
    }
    let (with, rest, own) = (factor[4][3], factor[4][4], factor[3][3]);
    let total = (with * with + rest * rest).sqrt();
    (total > 1e-6 && own > 1e-9).then(|| ((with / total) as f32, (with / own) as f32))
}

/// A pose with `match_`, `gain` and `worth` of the mean face filled in; `None` if it cannot be a face.
fn judge(map: &DepthMap, reaches: &[(f32, f32)], pose: Pose, stride: usize) -> Option<Pose> {
    let row = map.frame.pixels(pose.center).y.round();
    let (right, left) = *reaches.get(row.max(0.0) as usize)?;
    let width = (right + left) / pose.size;
    if !(1.15..=3.4).contains(&width) {
        return None;
    }
    let (match_, gain) = correlation(&gram(map, &pose, stride)?)?;
    // A face is less likely with a relief much flatter or deeper than the mean's, a head much wider or narrower, or
    // much of the head on one side.
    let depth = if gain > 0.0 { 0.12 * ops::ln(gain).abs() } else { 1.0 };
    let wide = 0.5 * (ops::ln(width / 1.9).abs() - 0.3).max(0.0);
    let uneven = 0.5 * ((right - left).abs() / (right + left) - 0.1).max(0.0);
    let tall = 0.3 * ops::ln(pose.tall).abs();
    Some(Pose { match_, gain, worth: match_ - depth - wide - uneven - tall, ..pose })
}

/// Height of a face relative to its width, once its eyes are known.
pub(super) fn fit_height(map: &DepthMap, pose: &Pose) -> f32 {
    let worth = |tall: f32| {
        let (match_, _) = correlation(&gram(map, &Pose { tall, ..*pose }, 1)?)?;
        Some((match_ - 0.1 * ops::ln(tall).abs(), tall))
    };
    let steps = (0..=30).filter_map(|i| worth(0.65 + 0.7 * i as f32 / 30.0));
    steps.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(pose.tall, |(_, tall)| tall)
}

/// Position of the face from eyeballs that are loose parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EyeHint {
    /// Point half way between their centres.
    pub center: Vec2,
    /// Distance of outer eye corners that corresponds to their distance.
    pub size: f32,
}

/// A face in the middle of a front from `low` to `high`, of a person's proportions.
pub(super) fn guess(middle: f32, low: Vec3, high: Vec3) -> Pose {
    let size = high - low;
    let center = Vec2::new(middle, (low.y + high.y) / 2.0);
    Pose { center, size: 0.55 * size.x.min(0.75 * size.y), gain: 1.0, tall: 1.0, ..Pose::default() }
}

/// The best position and size of a face whose plane of symmetry is at `middle`. `solid` marks pixels that the head
/// covers.
pub(super) fn find_face(map: &DepthMap, solid: &[bool], middle: f32, hint: Option<EyeHint>) -> Option<Pose> {
    let frame = &map.frame;
    let reaches = reaches(map, solid, middle);
    let (bottom, top) = (frame.origin.y, frame.place(0, frame.height).y);
    let extent = (frame.width.max(frame.height)) as f32 * frame.pixel;
    let pose = |y: f32, size: f32, tall: f32| Pose { center: Vec2::new(middle, y), size, tall, ..Pose::default() };
    let mut found: Vec<Pose> = Vec::new();
    let sizes = hint.map_or((0.08 * extent, 0.65 * extent), |hint| (0.8 * hint.size, 1.25 * hint.size));
    let mut size = sizes.0;
    while size < sizes.1 {
        let heights =
            hint.map_or((bottom + 0.6 * size, top), |hint| (hint.center.y - 0.1 * size, hint.center.y + 0.1 * size));
        let mut y = heights.0;
        while y < heights.1 {
            found.extend([0.8, 1.0].into_iter().filter_map(|tall| judge(map, &reaches, pose(y, size, tall), 2)));
            y += (size * 0.08).max(frame.pixel);
        }
        size *= 1.1;
    }
    found.sort_by(|a, b| b.worth.total_cmp(&a.worth));
    found.truncate(4);
    let refine = |start: Pose| {
        let mut best = start;
        for step in [0.04f32, 0.02, 0.01] {
            for _ in 0..3 {
                let from = best;
                for (y, size, tall) in [
                    (1.0, 0.0, 0.0),
                    (-1.0, 0.0, 0.0),
                    (0.0, 1.0, 0.0),
                    (0.0, -1.0, 0.0),
                    (0.0, 0.0, 1.0),
                    (0.0, 0.0, -1.0),
                    (0.0, 1.0, -1.0),
                    (0.0, -1.0, 1.0),
                    (1.0, 1.0, 0.0),
                    (-1.0, -1.0, 0.0),
                ] {
                    let tall = (from.tall * (1.0 + step * tall)).clamp(0.65, 1.35);
                    let next = pose(from.center.y + y * step * from.size, from.size * (1.0 + step * size), tall);
                    if let Some(next) = judge(map, &reaches, next, 1)
                        && next.worth > best.worth
                    {
                        best = next;
                    }
                }
                if best == from {
                    break;
                }
            }
        }
        best
    };
    let starts = found.into_iter().filter_map(|start| judge(map, &reaches, start, 1));
    starts.map(refine).max_by(|a, b| a.worth.total_cmp(&b.worth))
}
