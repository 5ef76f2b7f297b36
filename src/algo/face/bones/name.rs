//! Names of facial bones: region, number from the middle outwards, side.

use glam::Vec3;

use super::{
    FaceBone, FaceBoneKind, Region, Side,
    map::{FaceMap, Part},
    spread::Seat,
};

impl Region {
    /// First word of the labels.
    pub fn word(self) -> &'static str {
        match self {
            Self::Forehead => "forehead",
            Self::Brow => "brow",
            Self::Lid => "lid",
            Self::Nose => "nose",
            Self::Cheek => "cheek",
            Self::Lip => "lip",
            Self::Jaw => "jaw",
            Self::Temple => "temple",
            Self::Eye => "eye",
        }
    }
}

impl Side {
    /// Last letter of the labels.
    pub fn letter(self) -> char {
        match self {
            Self::Left => 'l',
            Self::Middle => 'm',
            Self::Right => 'r',
        }
    }
}

/// The region of a part, and the part's rank in the region.
pub(crate) fn region(part: Part) -> (Region, u8) {
    match part {
        Part::Forehead => (Region::Forehead, 0),
        Part::Temple => (Region::Temple, 0),
        Part::Brow => (Region::Brow, 0),
        Part::UpperLid => (Region::Lid, 0),
        Part::LowerLid => (Region::Lid, 1),
        Part::Nose => (Region::Nose, 0),
        Part::Cheek => (Region::Cheek, 0),
        Part::UpperLip => (Region::Lip, 0),
        Part::Corner => (Region::Lip, 1),
        Part::LowerLip => (Region::Lip, 2),
        Part::Jaw => (Region::Jaw, 0),
    }
}

/// Turns seats into bones with labels, in a stable order: by region, number, side.
///
/// `parts` tells the part of each seat. Seats of a pair get one number; numbers run from the middle outwards.
pub(crate) fn name(seats: &[Seat], parts: &[Part], map: &FaceMap) -> Vec<FaceBone> {
    let side = |seat: &Seat| match seat.place.x - map.middle {
        _ if seat.middle => Side::Middle,
        x if x < 0.0 => Side::Right,
        _ => Side::Left,
    };
    let partners = partners(seats, map);
    // A right bone takes number, region and place in the order from its left partner.
    let lead = |i: usize| match partners[i] {
        Some(other) if side(&seats[i]) == Side::Right => other,
        _ => i,
    };
    let key = |i: usize| {
        let l = lead(i);
        let (region, rank) = region(parts[l]);
        (region, rank, (seats[l].place.x - map.middle).abs(), -seats[l].place.y, l, side(&seats[i]))
    };
    let mut order: Vec<usize> = (0..seats.len()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (key(a), key(b));
        (a.0, a.1)
            .cmp(&(b.0, b.1))
            .then(a.2.total_cmp(&b.2))
            .then(a.3.total_cmp(&b.3))
            .then((a.4, a.5).cmp(&(b.4, b.5)))
    });
    let mut rank = vec![0; seats.len()];
    for (i, &seat) in order.iter().enumerate() {
        rank[seat] = i;
    }
    let mut bones = Vec::with_capacity(seats.len());
    let mut number = 0;
    let mut last: Option<(Region, usize)> = None;
    for &i in &order {
        let region = region(parts[lead(i)]).0;
        match last {
            Some((r, l)) if r == region && l == lead(i) => {}
            Some((r, _)) if r == region => number += 1,
            _ => number = 1,
        }
        last = Some((region, lead(i)));
        let side = side(&seats[i]);
        bones.push(FaceBone {
            position: seats[i].place,
            kind: FaceBoneKind::Skin,
            region,
            side,
            label: super::label(region, side, number, FaceBoneKind::Skin),
            pair: partners[i].map(|p| rank[p]),
            fixed: seats[i].fixed,
        });
    }
    bones
}

/// Partners by mirror symmetry: seats made as pairs, else seats nearest to each other's mirror images.
fn partners(seats: &[Seat], map: &FaceMap) -> Vec<Option<usize>> {
    let mut partners = vec![None; seats.len()];
    for (i, a) in seats.iter().enumerate() {
        if a.pair.is_some() {
            partners[i] = seats.iter().enumerate().position(|(j, b)| j != i && b.pair == a.pair);
        }
    }
    let mirror = |p: Vec3| p.with_x(2.0 * map.middle - p.x);
    let nearest = |i: usize| {
        let side = seats[i].place.x < map.middle;
        (0..seats.len())
            .filter(|&j| seats[j].pair.is_none() && !seats[j].middle && (seats[j].place.x < map.middle) != side)
            .min_by(|&a, &b| {
                let to = mirror(seats[i].place);
                seats[a].place.distance_squared(to).total_cmp(&seats[b].place.distance_squared(to))
            })
    };
    for i in 0..seats.len() {
        if seats[i].pair.is_none()
            && !seats[i].middle
            && let Some(other) = nearest(i)
            && nearest(other) == Some(i)
            && seats[other].part == seats[i].part
            && seats[other].place.distance(mirror(seats[i].place)) < 0.12 * map.scale
        {
            partners[i] = Some(other);
        }
    }
    partners
}

/// A bone of jaw, eyes or tongue, which come on top of the skin's bones.
pub(crate) fn extra(position: Vec3, kind: FaceBoneKind, side: Side) -> FaceBone {
    let region = if kind == FaceBoneKind::Eye { Region::Eye } else { Region::Jaw };
    let label = super::label(region, side, 1, kind);
    FaceBone { position, kind, region, side, label, pair: None, fixed: None }
}
