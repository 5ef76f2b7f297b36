//! Sparse factorisation of a symmetric positive definite matrix, once for many right-hand sides.
//!
//! Up-looking `L D Lᵀ` (Davis, *Direct Methods for Sparse Linear Systems*, section 4.8) after approximate minimum
//! degree ordering by `faer`. Right-hand sides are solved in blocks that share one pass over the factor.
//!
//! Columns that follow each other mostly have the same rows below both (they are a supernode, section 4.8 there). Such rows are
//! kept once, which takes most of the memory of indices away.

use faer::{
    dyn_stack::{MemBuffer, MemStack},
    sparse::{SymbolicSparseColMatRef, linalg::amd},
};

/// Number of right-hand sides of a block.
pub(crate) const LANES: usize = 8;

/// Multiplications of a factorisation, in units of the size to the power of 1.5. Surfaces take 10 to 20 (George 1973,
/// nested dissection of a plane grid); what takes far more is no surface.
const MOST_WORK: f64 = 200.0;

/// Sizes below this count as this: small matrices may be dense.
const LEAST_SIZE: f64 = 1000.0;

/// One row of a block of right-hand sides.
pub(crate) type Lane = [f64; LANES];

/// A symmetric matrix in compressed rows, without its diagonal, and the diagonal.
pub(crate) struct Symmetric {
    pub starts: Vec<u32>,
    pub columns: Vec<u32>,
    pub values: Vec<f64>,
    pub diagonal: Vec<f64>,
}

/// The factor of a permuted matrix.
pub(crate) struct Ldl {
    /// Old index of each new one.
    order: Vec<u32>,
    /// Index of the first value of each column, and their number at the end.
    starts: Vec<u32>,
    values: Vec<f64>,
    /// Index of the first row of each column. A column has as many rows as values.
    row_starts: Vec<u32>,
    /// Rows of columns, those of a column possibly among the rows of the column before it.
    rows: Vec<u32>,
    inverse_diagonal: Vec<f64>,
}

impl Ldl {
    /// Factorises; `None` if the matrix is not positive definite, too large for the index type, or no surface's: a soup of
    /// triangles that connect points at random fills the factor, with work that grows with the cube of its points.
    pub fn new(matrix: &Symmetric) -> Option<Self> {
        let n = matrix.diagonal.len();
        let (order, inverse) = minimum_degree(matrix)?;
        // Upper triangle of the permuted matrix by columns: entries above the diagonal of column k.
        let mut parent = vec![u32::MAX; n];
        let mut flag = vec![u32::MAX; n];
        let mut count = vec![0u32; n];
        let row = |k: usize| {
            let old = order[k] as usize;
            let range = matrix.starts[old] as usize..matrix.starts[old + 1] as usize;
            let inverse = &inverse;
            range.map(move |e| (inverse[matrix.columns[e] as usize] as usize, e)).filter(move |&(i, _)| i < k)
        };
        for k in 0..n {
            flag[k] = k as u32;
            for (mut i, _) in row(k) {
                while flag[i] != k as u32 {
                    if parent[i] == u32::MAX {
                        parent[i] = k as u32;
                    }
                    count[i] += 1;
                    flag[i] = k as u32;
                    i = parent[i] as usize;
                }
            }
        }
        let mut starts = Vec::with_capacity(n + 1);
        let mut total = 0u32;
        starts.push(0);
        for &c in &count {
            total = total.checked_add(c)?;
            starts.push(total);
        }
        let work: f64 = count.iter().map(|&c| f64::from(c) * f64::from(c)).sum();
        if work > MOST_WORK * (n as f64).max(LEAST_SIZE) * (n as f64).max(LEAST_SIZE).sqrt() {
            return None;
        }
        let (row_starts, row_count) = shared_rows(&parent, &count);
        drop(count);
        let mut rows = vec![0u32; row_count as usize];
        let mut values = vec![0f64; total as usize];
        let mut diagonal = vec![0f64; n];
        let mut y = vec![0f64; n];
        let mut pattern = vec![0u32; n];
        let mut stack = Vec::new();
        let mut filled = vec![0u32; n];
        flag.fill(u32::MAX);
        for k in 0..n {
            let mut top = n;
            flag[k] = k as u32;
            for (first, entry) in row(k) {
                y[first] += matrix.values[entry];
                let mut i = first;
                stack.clear();
                while flag[i] != k as u32 {
                    stack.push(i as u32);
                    flag[i] = k as u32;
                    i = parent[i] as usize;
                }
                while let Some(i) = stack.pop() {
                    top -= 1;
                    pattern[top] = i;
                }
            }
            let mut d = matrix.diagonal[order[k] as usize];
            for &i in &pattern[top..] {
                let i = i as usize;
                let yi = std::mem::take(&mut y[i]);
                let (start, end) = (starts[i] as usize, (starts[i] + filled[i]) as usize);
                let (row_start, row_end) = (row_starts[i] as usize, (row_starts[i] + filled[i]) as usize);
                for (r, v) in rows[row_start..row_end].iter().zip(&values[start..end]) {
                    y[*r as usize] -= v * yi;
                }
                let l = yi / diagonal[i];
                d -= l * yi;
                // Columns that share rows all have this one in this place.
                rows[row_end] = k as u32;
                values[end] = l;
                filled[i] += 1;
            }
            if !(d.is_finite() && d > 0.0) {
                return None;
            }
            diagonal[k] = d;
        }
        for value in &mut diagonal {
            *value = 1.0 / *value;
        }
        Some(Self { order, starts, values, row_starts, rows, inverse_diagonal: diagonal })
    }

    /// Index of each unknown in the matrix, in the order of the factor.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Solves for a block of right-hand sides, which is overwritten with the solution. `x` has one row an unknown, in the order
    /// of the factor ([`Self::order`]): a copy in that order would take as much memory again on each thread.
    pub fn solve(&self, x: &mut [Lane]) {
        let n = self.order.len();
        for k in 0..n {
            let xk = x[k];
            if xk == [0.0; LANES] {
                continue;
            }
            for (row, value) in self.column(k) {
                let target = &mut x[row];
                for l in 0..LANES {
                    target[l] -= value * xk[l];
                }
            }
        }
        for k in (0..n).rev() {
            let mut xk = x[k];
            for value in &mut xk {
                *value *= self.inverse_diagonal[k];
            }
            for (row, value) in self.column(k) {
                let other = &x[row];
                for l in 0..LANES {
                    xk[l] -= value * other[l];
                }
            }
            x[k] = xk;
        }
    }

    fn column(&self, k: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let values = &self.values[self.starts[k] as usize..self.starts[k + 1] as usize];
        let rows = &self.rows[self.row_starts[k] as usize..][..values.len()];
        rows.iter().map(|&r| r as usize).zip(values.iter().copied())
    }
}

/// Index of the first row of each column, and the number of rows that are kept. A column whose parent in the elimination tree
/// is the next column, and that has one row more, has the rows of that column behind its first.
fn shared_rows(parent: &[u32], count: &[u32]) -> (Vec<u32>, u32) {
    let mut starts: Vec<u32> = Vec::with_capacity(count.len());
    let mut total = 0;
    for (k, &rows) in count.iter().enumerate() {
        let before = k.checked_sub(1).filter(|&k| parent[k] as usize == k + 1 && count[k] == rows + 1);
        match before {
            Some(before) => starts.push(starts[before] + 1),
            None => {
                starts.push(total);
                total += rows;
            }
        }
    }
    (starts, total)
}

/// A fill-reducing order and its inverse.
fn minimum_degree(matrix: &Symmetric) -> Option<(Vec<u32>, Vec<u32>)> {
    let n = matrix.diagonal.len();
    if n > i32::MAX as usize || matrix.columns.len() > i32::MAX as usize {
        return None;
    }
    // Both triangles are given; only entries above the diagonal are read.
    let mut starts = Vec::with_capacity(n + 1);
    let mut rows = Vec::with_capacity(matrix.columns.len() / 2);
    starts.push(0u32);
    for column in 0..n {
        let range = matrix.starts[column] as usize..matrix.starts[column + 1] as usize;
        rows.extend(matrix.columns[range].iter().filter(|&&r| (r as usize) < column));
        starts.push(rows.len() as u32);
    }
    let symbolic = SymbolicSparseColMatRef::<'_, u32>::new_checked(n, n, &starts, None, &rows);
    let mut order = vec![0u32; n];
    let mut inverse = vec![0u32; n];
    let mut memory = MemBuffer::try_new(amd::order_maybe_unsorted_scratch::<u32>(n, rows.len())).ok()?;
    amd::order_maybe_unsorted(&mut order, &mut inverse, symbolic, amd::Control::default(), MemStack::new(&mut memory))
        .ok()?;
    Some((order, inverse))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix whose unknowns are coupled in pairs, with a diagonal that makes it definite.
    fn coupled(count: usize, is_coupled: impl Fn(usize, usize) -> bool) -> Symmetric {
        let mut matrix = Symmetric { starts: vec![0], columns: vec![], values: vec![], diagonal: vec![] };
        for row in 0..count {
            let mut diagonal = 1.0;
            for column in (0..count).filter(|column| *column != row && is_coupled(row, *column)) {
                let value = -1.0 / (1 + row.abs_diff(column)) as f64;
                diagonal -= value;
                matrix.columns.push(column as u32);
                matrix.values.push(value);
            }
            matrix.starts.push(matrix.columns.len() as u32);
            matrix.diagonal.push(diagonal);
        }
        matrix
    }

    /// The largest error of a solution for eight right-hand sides.
    fn error(matrix: &Symmetric, factor: &Ldl) -> f64 {
        let count = matrix.diagonal.len();
        let side = |row: usize, lane: usize| ((row * 7 + lane * 3) % 11) as f64 - 5.0;
        let side_of = |&row: &u32| std::array::from_fn(|lane| side(row as usize, lane));
        let mut solved: Vec<Lane> = factor.order().iter().map(side_of).collect();
        factor.solve(&mut solved);
        let mut block = vec![[0.0; LANES]; count];
        for (row, &at) in solved.iter().zip(factor.order()) {
            block[at as usize] = *row;
        }
        let error_of = |(row, lane): (usize, usize)| {
            let range = matrix.starts[row] as usize..matrix.starts[row + 1] as usize;
            let others: f64 = range.map(|e| matrix.values[e] * block[matrix.columns[e] as usize][lane]).sum();
            (matrix.diagonal[row] * block[row][lane] + others - side(row, lane)).abs()
        };
        let places = (0..count).flat_map(|row| (0..LANES).map(move |lane| (row, lane)));
        places.map(error_of).fold(0.0, f64::max)
    }

    /// Columns that have the same rows keep them once: in a factor without zeros those of the first column are all.
    #[test]
    fn columns_share_their_rows() {
        let all = coupled(60, |_, _| true);
        let factor = Ldl::new(&all).unwrap();
        assert_eq!((factor.values.len(), factor.rows.len()), (60 * 59 / 2, 59));
        assert!(error(&all, &factor) < 1e-9);
        // A grid of 30 times 30: some columns share, others do not.
        let next = |a: usize, b: usize| (a / 30 == b / 30 && a.abs_diff(b) == 1) || a.abs_diff(b) == 30;
        let grid = coupled(900, next);
        let factor = Ldl::new(&grid).unwrap();
        assert!(factor.rows.len() < factor.values.len() * 3 / 4, "{} of {}", factor.rows.len(), factor.values.len());
        assert!(error(&grid, &factor) < 1e-9);
    }
}
