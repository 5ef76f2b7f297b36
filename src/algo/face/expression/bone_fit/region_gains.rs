//! Size of a fitted movement in each region of the face.
//!
//! Bones cannot follow every detail of a field, and least squares pay for that with size: a movement falls short most
//! where bones are few. The target of each region is therefore enlarged by as much as the fit falls short there.

use glam::DVec3;

use super::{
    normal_equations::{Motion, NormalEquations, moved},
    samples::Sample,
};
use crate::algo::face::bones::FaceBone;

/// Number of regions.
const REGIONS: usize = 9;
/// Rounds in which the gains are corrected.
const CORRECTIONS: usize = 2;
/// Size of the fitted movement that is aimed at, as a share of the field's.
const FULL: f64 = 1.05;
/// Bounds of the correction in one round.
const STEP: (f64, f64) = (0.9, 1.6);
/// Largest gain in all.
const MOST: f64 = 2.0;
/// Share of the whole field's square that is added in each region, so that regions that hardly move get no gain.
const NOISE: f64 = 0.004;

/// Shares of the regions at each sample.
#[derive(Default)]
pub(super) struct RegionGains {
    shares: Vec<[f64; REGIONS]>,
}

impl RegionGains {
    /// Shares of the regions by the bones that move each sample, so that borders blend as the weights do. `skin` are the
    /// numbers of the skin bones among `bones`.
    pub fn new(samples: &[Sample], bones: &[FaceBone], skin: &[usize]) -> Self {
        let share = |sample: &Sample| {
            let mut shares = [0.0; REGIONS];
            for influence in &sample.influences {
                if let Some(bone) = skin.get(influence.unknown as usize).and_then(|bone| bones.get(*bone)) {
                    shares[bone.region as usize] += influence.weight.abs();
                }
            }
            let sum: f64 = shares.iter().sum();
            shares.map(|share| share / sum.max(1e-12))
        };
        Self { shares: samples.iter().map(share).collect() }
    }

    /// Motions whose skin follows `targets` in full size.
    pub fn motions(&self, equations: &NormalEquations, samples: &[Sample], targets: &[DVec3]) -> Vec<Motion> {
        let mut gains = [FULL; REGIONS];
        let solve = |gains: &[f64; REGIONS]| {
            let gain =
                |shares: &[f64; REGIONS]| shares.iter().zip(gains).map(|(share, gain)| share * gain).sum::<f64>();
            let scaled = targets.iter().zip(&self.shares).map(|(target, shares)| *target * gain(shares));
            equations.motions(samples, scaled)
        };
        let mut motions = solve(&gains);
        for _ in 0..CORRECTIONS {
            let sizes = self.sizes(samples, targets, &motions);
            for (gain, size) in gains.iter_mut().zip(sizes) {
                *gain = (*gain * (FULL / size.max(0.1)).clamp(STEP.0, STEP.1)).clamp(0.8, MOST);
            }
            motions = solve(&gains);
        }
        motions
    }

    /// Size of a fitted movement in each region, along the targets and as a share of them.
    fn sizes(&self, samples: &[Sample], targets: &[DVec3], motions: &[Motion]) -> [f64; REGIONS] {
        let mut sums = [[0.0; 2]; REGIONS];
        let mut whole = 0.0;
        for ((sample, target), shares) in samples.iter().zip(targets).zip(&self.shares) {
            let square = target.length_squared() * sample.counts;
            if sample.minus.is_some() || square == 0.0 {
                continue;
            }
            let along = moved(sample, motions).dot(*target) * sample.counts;
            whole += square;
            for (sum, share) in sums.iter_mut().zip(shares) {
                sum[0] += along * share;
                sum[1] += square * share;
            }
        }
        let noise = NOISE * whole + f64::MIN_POSITIVE;
        sums.map(|[along, square]| (along + FULL * noise) / (square + noise))
    }
}
