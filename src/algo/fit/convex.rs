//! Convex weights of one point: the least squares problem that is solved for every point.
//!
//! Minimise `½ wᵀ G w - cᵀ w` with `w ≥ 0`, `Σ w = 1` and few entries: an active set method (Lawson and Hanson 1974,
//! chapter 23) with the sum as an equality, and exchanges once the set is full.

/// Largest weight that counts as zero.
const NOTHING: f64 = 1e-7;
/// Number of exchanges in a call once the set is full.
const EXCHANGES: usize = 4;

/// A solver with its buffers; each thread uses one for point after point.
#[derive(Default)]
pub(super) struct Convex {
    /// The matrix `G`, rows of `n`.
    pub gram: Vec<f64>,
    /// The vector `c`; its length is `n`.
    pub target: Vec<f64>,
    /// Input: first weights (sum one, or all zero). Output: the solved weights.
    pub weights: Vec<f64>,
    set: Vec<usize>,
    factor: Vec<f64>,
    answer: Vec<f64>,
    ones: Vec<f64>,
}

impl Convex {
    /// Makes room for `n` unknowns and sets all values to zero.
    pub fn reset(&mut self, n: usize) {
        for (buffer, size) in [(&mut self.gram, n * n), (&mut self.target, n), (&mut self.weights, n)] {
            buffer.clear();
            buffer.resize(size, 0.0);
        }
    }

    /// Solves with at most `most` positive weights.
    pub fn solve(&mut self, most: usize) {
        let n = self.target.len();
        if n == 0 {
            return;
        }
        let most = most.clamp(1, n);
        self.begin(most);
        let mut exchanges = 0;
        for _ in 0..3 * n + 8 {
            let Some(slope) = self.settle() else { break };
            let Some(next) = self.steepest(slope) else { break };
            if self.set.len() < most {
                self.set.push(next);
                continue;
            }
            if exchanges == EXCHANGES {
                break;
            }
            exchanges += 1;
            let (before, set, weights) = (self.cost(), self.set.clone(), self.weights.clone());
            if most == 1 {
                self.only(next);
            } else {
                self.set.push(next);
                let _ = self.settle();
                if self.set.len() > most {
                    self.drop_weakest();
                    let _ = self.settle();
                }
            }
            if self.cost() >= before - before.abs() * 1e-12 {
                (self.set, self.weights) = (set, weights);
                break;
            }
        }
    }

    fn begin(&mut self, most: usize) {
        let n = self.target.len();
        self.set.clear();
        self.set.extend((0..n).filter(|&k| self.weights[k] > NOTHING));
        while self.set.len() > most {
            self.drop_weakest();
        }
        let sum: f64 = self.set.iter().map(|&k| self.weights[k]).sum();
        if sum > NOTHING {
            (0..n).for_each(|k| self.weights[k] = if self.weights[k] > NOTHING { self.weights[k] / sum } else { 0.0 });
            return;
        }
        let alone = |k: usize| 0.5 * self.gram[k * n + k] - self.target[k];
        let best = (1..n).fold(0, |best, k| if alone(k) < alone(best) { k } else { best });
        self.only(best);
    }

    fn only(&mut self, index: usize) {
        self.weights.fill(0.0);
        self.weights[index] = 1.0;
        self.set.clear();
        self.set.push(index);
    }

    fn drop_weakest(&mut self) {
        let weakest = (1..self.set.len())
            .fold(0, |best, k| if self.weights[self.set[k]] < self.weights[self.set[best]] { k } else { best });
        let index = self.set.remove(weakest);
        self.weights[index] = 0.0;
        let sum: f64 = self.set.iter().map(|&k| self.weights[k]).sum();
        if sum > NOTHING {
            self.set.iter().for_each(|&k| self.weights[k] /= sum);
        } else if let Some(&first) = self.set.first() {
            self.weights[first] = 1.0;
        }
    }

    /// Finds the best weights on the set; weights that would become negative leave it. Returns the multiplier of the
    /// sum.
    fn settle(&mut self) -> Option<f64> {
        loop {
            let slope = self.equality()?;
            let mut step = 1.0f64;
            for (&k, &x) in self.set.iter().zip(&self.answer) {
                if x <= NOTHING {
                    let w = self.weights[k];
                    step = step.min(if w - x > 0.0 { w / (w - x) } else { 0.0 });
                }
            }
            let whole = self.answer.iter().all(|&x| x > NOTHING);
            for (&k, &x) in self.set.iter().zip(&self.answer) {
                self.weights[k] += step * (x - self.weights[k]);
            }
            if whole {
                return Some(slope);
            }
            let (weights, answer, mut at, mut removed) = (&mut self.weights, &self.answer, 0, false);
            self.set.retain(|&k| {
                let gone = answer[at] <= NOTHING && weights[k] <= NOTHING;
                at += 1;
                removed |= gone;
                if gone {
                    weights[k] = 0.0;
                }
                !gone
            });
            if !removed || self.set.is_empty() {
                return None;
            }
        }
    }

    /// Solves on the set without signs, into `answer`; returns `None` if the matrix is not positive definite.
    fn equality(&mut self) -> Option<f64> {
        let (n, m) = (self.target.len(), self.set.len());
        self.factor.clear();
        self.factor.resize(m * m, 0.0);
        for i in 0..m {
            for j in 0..=i {
                let mut sum = self.gram[self.set[i] * n + self.set[j]];
                for k in 0..j {
                    sum -= self.factor[i * m + k] * self.factor[j * m + k];
                }
                self.factor[i * m + j] = if i > j {
                    sum / self.factor[j * m + j]
                } else if sum > 0.0 {
                    sum.sqrt()
                } else {
                    return None;
                };
            }
        }
        self.answer.clear();
        self.answer.extend(self.set.iter().map(|&k| self.target[k]));
        self.ones.clear();
        self.ones.resize(m, 1.0);
        for side in [&mut self.answer, &mut self.ones] {
            for i in 0..m {
                let sum = (0..i).fold(side[i], |sum, k| sum - self.factor[i * m + k] * side[k]);
                side[i] = sum / self.factor[i * m + i];
            }
            for i in (0..m).rev() {
                let sum = (i + 1..m).fold(side[i], |sum, k| sum - self.factor[k * m + i] * side[k]);
                side[i] = sum / self.factor[i * m + i];
            }
        }
        let slope = (1.0 - self.answer.iter().sum::<f64>()) / self.ones.iter().sum::<f64>();
        self.answer.iter_mut().zip(&self.ones).for_each(|(x, one)| *x += slope * one);
        slope.is_finite().then_some(slope)
    }

    /// The unknown outside the set that lowers the cost fastest.
    fn steepest(&self, slope: f64) -> Option<usize> {
        let n = self.target.len();
        let mut best = (0.0, None);
        for k in 0..n {
            if self.set.contains(&k) {
                continue;
            }
            let row = &self.gram[k * n..(k + 1) * n];
            let gradient = self.set.iter().map(|&j| row[j] * self.weights[j]).sum::<f64>() - self.target[k] - slope;
            let threshold = -1e-9 * (row[k].abs() + self.target[k].abs());
            if gradient < threshold && gradient < best.0 {
                best = (gradient, Some(k));
            }
        }
        best.1
    }

    /// `½ wᵀ G w - cᵀ w`.
    pub fn cost(&self) -> f64 {
        let n = self.target.len();
        let row = |k: usize| self.set.iter().map(|&j| self.gram[k * n + j] * self.weights[j]).sum::<f64>();
        self.set.iter().map(|&k| self.weights[k] * (0.5 * row(k) - self.target[k])).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solve(columns: &[[f64; 3]], target: [f64; 3], most: usize) -> Vec<f64> {
        let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (n, mut convex) = (columns.len(), Convex::default());
        convex.reset(n);
        for i in 0..n {
            (0..n).for_each(|j| convex.gram[i * n + j] = dot(&columns[i], &columns[j]));
            convex.gram[i * n + i] += 1e-9;
            convex.target[i] = dot(&columns[i], &target);
        }
        convex.solve(most);
        convex.weights
    }

    #[test]
    fn inside_at_a_corner_and_at_an_edge() {
        let columns = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (target, most, expected) in [
            ([0.2, 0.3, 0.1], 4, [0.4, 0.2, 0.3, 0.1]),
            ([2.0, -1.0, 0.0], 4, [0.0, 1.0, 0.0, 0.0]),
            ([1.0, 1.0, 0.0], 4, [0.0, 0.5, 0.5, 0.0]),
            ([0.9, 0.0, 0.0], 1, [0.0, 1.0, 0.0, 0.0]),
            ([-1.0, -1.0, -1.0], 4, [1.0, 0.0, 0.0, 0.0]),
        ] {
            let found = solve(&columns, target, most);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{target:?}: {found:?}");
        }
    }
}
