//! Size of a fitted movement in each region of the face.
//!
//! Bones cannot follow every detail of a field, and least squares pay for that with size: a movement falls short most
//! where bones are few. The target of each region is enlarged by as much as the fit falls short there.

use glam::DVec3;

use super::samples::Sample;
use crate::algo::face::bones::FaceBone;

/// Number of regions.
const REGIONS: usize = 9;
/// Rounds in which the gains are corrected.
const CORRECTIONS: usize = 2;
/// Size of the fitted movement that is aimed at, as a share of the field's.
const FULL: f64 = 1.04;
/// Bounds of the gain of a region.
const BOUNDS: (f64, f64) = (0.9, 1.7);
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
            for (unknown, weight) in &sample.influences {
                if let Some(bone) = skin.get(*unknown as usize).and_then(|bone| bones.get(*bone)) {
                    shares[bone.region as usize] += weight.abs();
                }
            }
            let sum: f64 = shares.iter().sum();
            shares.map(|share| share / sum.max(1e-12))
        };
        Self { shares: samples.iter().map(share).collect() }
    }

    /// Targets at the samples, enlarged so that what `fit` makes of `measured`, displacements that stand for them, comes
    /// out in full size. `fit` gives the displacement of each sample for the targets that it gets.
    pub fn enlarged(
        &self,
        samples: &[Sample],
        targets: &[DVec3],
        measured: &[DVec3],
        fit: impl Fn(&[DVec3]) -> Vec<DVec3>,
    ) -> Vec<DVec3> {
        let mut gains = [FULL; REGIONS];
        for _ in 0..CORRECTIONS {
            let moved = fit(&self.scaled(measured, &gains));
            for (gain, size) in gains.iter_mut().zip(self.sizes(samples, measured, &moved)) {
                *gain = (*gain * FULL / size.max(0.1)).clamp(BOUNDS.0, BOUNDS.1);
            }
        }
        self.scaled(targets, &gains)
    }

    fn scaled(&self, targets: &[DVec3], gains: &[f64; REGIONS]) -> Vec<DVec3> {
        let gain = |shares: &[f64; REGIONS]| shares.iter().zip(gains).map(|(share, gain)| share * gain).sum::<f64>();
        targets.iter().zip(&self.shares).map(|(target, shares)| *target * gain(shares)).collect()
    }

    /// Size of the displacements of samples in each region, along the targets and as a share of them.
    fn sizes(&self, samples: &[Sample], targets: &[DVec3], moved: &[DVec3]) -> [f64; REGIONS] {
        let mut sums = [[0.0; 2]; REGIONS];
        let mut whole = 0.0;
        for (((sample, target), moved), shares) in samples.iter().zip(targets).zip(moved).zip(&self.shares) {
            let square = target.length_squared() * sample.counts;
            if sample.minus.is_some() || square == 0.0 {
                continue;
            }
            let along = moved.dot(*target) * sample.counts;
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
