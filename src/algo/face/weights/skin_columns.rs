//! Visible skin of a face by its place, for the many shells of hair, teeth and lashes that lie on small parts of it.

use std::collections::BTreeMap;

use glam::Vec3;

use super::Face;

/// Width of a column, in distances of the eyes' outer corners.
const WIDTH: f32 = 0.1;

/// Vertices of the visible skin of a face, in columns along its depth.
pub(crate) struct SkinColumns<'a> {
    places: &'a [Vec3],
    width: f32,
    /// Vertices of each column that has any, in order.
    columns: BTreeMap<(i32, i32), Vec<usize>>,
}

impl<'a> SkinColumns<'a> {
    /// Visible skin of a face, as far as it is wanted.
    pub fn new(face: &'a Face, is_wanted: impl Fn(usize) -> bool) -> Self {
        let mut skin = Self { places: &face.places, width: WIDTH * face.map.scale, columns: BTreeMap::new() };
        for v in (0..face.places.len()).filter(|v| face.mask[*v] && is_wanted(*v)) {
            let column = skin.column(face.places[v]);
            skin.columns.entry(column).or_default().push(v);
        }
        skin
    }

    /// Vertices in a box, in no particular order. Looks at the columns that the box meets.
    pub fn within(&self, low: Vec3, high: Vec3) -> impl Iterator<Item = usize> {
        let (from, to) = (self.column(low), self.column(high));
        let rows = from.1..=to.1;
        let columns = (from <= to).then(|| self.columns.range(from..=to));
        let columns = columns.into_iter().flatten().filter(move |((_, row), _)| rows.contains(row));
        columns.flat_map(|(_, skin)| skin).copied().filter(move |v| {
            let place = self.places[*v];
            place.cmpge(low).all() && place.cmple(high).all()
        })
    }

    fn column(&self, place: Vec3) -> (i32, i32) {
        let [x, y] = [place.x, place.y].map(|at| (at / self.width).floor() as i32);
        (x, y)
    }
}
