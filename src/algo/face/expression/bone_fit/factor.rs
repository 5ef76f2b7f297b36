//! Cholesky factor of the normal equations of bones.
//!
//! Only bones with common skin have entries, and a row of the factor is zero up to its first entry: that part of it is
//! neither stored nor computed. Many bones are ordered so that this part is most of it.

use std::collections::BTreeMap;

use glam::DVec3;

/// Largest number of unknowns that keep their order; the order decides how sums are rounded.
const FEW: usize = 256;

/// A symmetric positive matrix: the entries that are not zero, by row and column.
pub(super) struct SparseMatrix(Vec<BTreeMap<u32, f64>>);

impl SparseMatrix {
    /// The matrix without entries.
    pub fn zero(size: usize) -> Self {
        Self(vec![BTreeMap::new(); size])
    }

    pub fn add(&mut self, row: u32, column: u32, value: f64) {
        *self.0[row as usize].entry(column).or_default() += value;
    }

    /// Entries beside the diagonal of a row, by rising column.
    fn beside(&self, row: usize) -> impl Iterator<Item = (usize, f64)> {
        self.0[row].iter().map(|(column, value)| (*column as usize, *value)).filter(move |(column, _)| *column != row)
    }

    /// Takes a share of the entries beside the diagonal over to the diagonal, which grows by `diagonal` as well.
    pub fn stiffened(mut self, share: f64, diagonal: impl Fn(usize) -> f64) -> Self {
        for row in 0..self.0.len() {
            let own = self.0[row].get(&(row as u32)).copied().unwrap_or_default() + diagonal(row);
            let sum = self.beside(row).fold(own, |sum, (_, value)| sum + share * value);
            for (column, value) in &mut self.0[row] {
                if *column as usize != row {
                    *value -= share * *value;
                }
            }
            self.0[row].insert(row as u32, sum);
        }
        self
    }

    /// The unknowns in an order that keeps neighbours near each other: from an end of each connected part in breadth,
    /// those with few neighbours first (Cuthill and McKee, "Reducing the bandwidth of sparse symmetric matrices", 1969),
    /// and then backwards.
    fn order(&self) -> Vec<u32> {
        let size = self.0.len();
        let mut order: Vec<u32> = Vec::with_capacity(size);
        let mut is_taken = vec![false; size];
        let mut is_seen = vec![false; size];
        for start in 0..size {
            if is_taken[start] {
                continue;
            }
            // The last one that is reached lies at an end.
            let part = self.breadth(start, &mut is_seen);
            let end = part.last().map_or(start, |last| *last as usize);
            order.extend(self.breadth(end, &mut is_taken));
        }
        order.reverse();
        order
    }

    fn breadth(&self, start: usize, is_seen: &mut [bool]) -> Vec<u32> {
        let mut list = vec![start as u32];
        is_seen[start] = true;
        let mut at = 0;
        while let Some(&row) = list.get(at) {
            at += 1;
            let mut next: Vec<u32> = Vec::new();
            for (column, _) in self.beside(row as usize) {
                if !std::mem::replace(&mut is_seen[column], true) {
                    next.push(column as u32);
                }
            }
            next.sort_by_key(|column| (self.0[*column as usize].len(), *column));
            list.extend(next);
        }
        list
    }

    /// Factorises the matrix. A pivot lost to rounding becomes 1.
    pub fn factorise(&self) -> Factor {
        let size = self.0.len();
        let order = if size > FEW { self.order() } else { (0..size as u32).collect() };
        let mut place = vec![0; size];
        for (at, unknown) in order.iter().enumerate() {
            place[*unknown as usize] = at;
        }
        let (mut rows, mut values) = (Vec::with_capacity(size), Vec::new());
        for (at, unknown) in order.iter().enumerate() {
            let entries = self.0[*unknown as usize].iter();
            let below = entries.map(|(column, value)| (place[*column as usize], *value)).filter(|(to, _)| *to <= at);
            let below: Vec<(usize, f64)> = below.collect();
            let first = below.iter().map(|(to, _)| *to).min().unwrap_or(at);
            let start = values.len();
            values.resize(start + at - first + 1, 0.0);
            for (to, value) in below {
                values[start + to - first] = value;
            }
            rows.push(Row { first, start });
        }
        let mut factor = Factor { order, rows, values };
        factor.reduce();
        factor
    }
}

/// Lower triangle L of a symmetric positive matrix LLᵀ.
#[derive(Default)]
pub(super) struct Factor {
    /// The unknown of each row.
    order: Vec<u32>,
    rows: Vec<Row>,
    /// Values of all rows, each from its first entry to the diagonal.
    values: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Row {
    /// Column of the first entry.
    first: usize,
    /// Place of the first entry among the values.
    start: usize,
}

impl Factor {
    fn reduce(&mut self) {
        for at in 0..self.rows.len() {
            let row = self.rows[at];
            let (above, own) = self.values.split_at_mut(row.start);
            for column in row.first..=at {
                let mut sum = own[column - row.first];
                if column == at {
                    for value in &own[..column - row.first] {
                        sum -= value * value;
                    }
                    own[column - row.first] = if sum > 0.0 { sum.sqrt() } else { 1.0 };
                    continue;
                }
                let other = self.rows[column];
                let from = row.first.max(other.first);
                let pairs = &above[other.start + from - other.first..=other.start + column - other.first];
                let (pivot, pairs) = (pairs[pairs.len() - 1], &pairs[..pairs.len() - 1]);
                for (a, b) in own[from - row.first..column - row.first].iter().zip(pairs) {
                    sum -= a * b;
                }
                own[column - row.first] = sum / pivot;
            }
        }
    }

    /// Solves for a right-hand side of vectors, in place.
    pub fn solve(&self, right: &mut [DVec3]) {
        let mut sums: Vec<DVec3> = self.order.iter().map(|unknown| right[*unknown as usize]).collect();
        let value = |row: Row, column: usize| self.values[row.start + column - row.first];
        for (at, &row) in self.rows.iter().enumerate() {
            let mut sum = sums[at];
            for (k, other) in sums[..at].iter().enumerate().skip(row.first) {
                sum -= *other * value(row, k);
            }
            sums[at] = sum / value(row, at);
        }
        // The last row with an entry in each column.
        let mut last: Vec<usize> = (0..self.rows.len()).collect();
        for (at, row) in self.rows.iter().enumerate() {
            last[row.first] = last[row.first].max(at);
        }
        for at in 1..last.len() {
            last[at] = last[at].max(last[at - 1]);
        }
        for at in (0..self.rows.len()).rev() {
            let mut sum = sums[at];
            for (other, row) in sums.iter().zip(&self.rows).take(last[at] + 1).skip(at + 1) {
                if row.first <= at {
                    sum -= *other * value(*row, at);
                }
            }
            sums[at] = sum / value(self.rows[at], at);
        }
        for (unknown, sum) in self.order.iter().zip(sums) {
            right[*unknown as usize] = sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bones on a square grid with skin in common with the eight around each, as many numbers away as they may be.
    fn grid(side: usize) -> SparseMatrix {
        let size = side * side;
        let number = |x: usize, y: usize| ((y * side + x) * 7919 % size) as u32;
        let mut matrix = SparseMatrix::zero(size);
        for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
            let around = |at: usize| at.saturating_sub(1)..=(at + 1).min(side - 1);
            for (to_x, to_y) in around(y).flat_map(|to_y| around(x).map(move |to_x| (to_x, to_y))) {
                let value = 1.0 / (1 + x.abs_diff(to_x) + y.abs_diff(to_y) + (x + to_x) % 3) as f64;
                matrix.add(number(x, y), number(to_x, to_y), value);
            }
        }
        matrix.stiffened(0.01, |row| 20.0 + row as f64 % 5.0)
    }

    /// The dense matrix, factorised and solved as in the books.
    fn dense(matrix: &SparseMatrix, right: &mut [DVec3]) {
        let size = matrix.0.len();
        let mut full = vec![0.0; size * size];
        for (row, entries) in matrix.0.iter().enumerate() {
            for (column, value) in entries {
                full[row * size + *column as usize] = *value;
            }
        }
        for row in 0..size {
            for column in 0..=row {
                let mut sum = full[row * size + column];
                for k in 0..column {
                    sum -= full[row * size + k] * full[column * size + k];
                }
                full[row * size + column] = if row == column { sum.sqrt() } else { sum / full[column * size + column] };
            }
        }
        for row in 0..size {
            for k in 0..row {
                right[row] -= right[k] * full[row * size + k];
            }
            right[row] /= full[row * size + row];
        }
        for row in (0..size).rev() {
            for k in row + 1..size {
                right[row] -= right[k] * full[k * size + row];
            }
            right[row] /= full[row * size + row];
        }
    }

    #[test]
    fn solutions_are_those_of_the_full_matrix() {
        for side in [1, 2, 9, 16, 17, 24] {
            let matrix = grid(side);
            let mut right: Vec<DVec3> =
                (0..side * side).map(|at| DVec3::new(at as f64, 1.0, -0.5 * at as f64)).collect();
            let mut expected = right.clone();
            dense(&matrix, &mut expected);
            matrix.factorise().solve(&mut right);
            let is_few = side * side <= FEW;
            for (found, expected) in right.iter().zip(&expected) {
                let is_same = found == expected;
                assert!(is_same || !is_few && found.distance(*expected) <= 1e-10 * (1.0 + expected.length()), "{side}");
            }
        }
    }

    #[test]
    fn factors_of_many_bones_stay_small() {
        let stored = [24, 48, 96].map(|side| grid(side).factorise().values.len());
        for pair in stored.windows(2) {
            // Four times the bones have rows that are twice as long.
            assert!(pair[1] < 9 * pair[0], "{stored:?}");
        }
        assert!(stored[2] < 96 * 96 * 300, "{stored:?}");
    }
}
