//! Targets of units at the samples of a skin, kept while only the weights change.
//!
//! The field of a unit does not know the weights of the skin, and costs more than solving for the bones does.

use std::sync::OnceLock;

use glam::DVec3;
use rayon::prelude::*;

use super::{asked, samples::Sample, unsolved};
use crate::algo::face::{
    expression::{UnitSet, field::Field, openings::OpeningLines},
    landmarks::Landmarks,
};

/// Displacements that each unit asks of each sample on the left and the right side at full strength.
pub(super) struct UnitTargets {
    of: Vec<[OnceLock<Vec<DVec3>>; 2]>,
}

impl UnitTargets {
    pub fn new(units: &UnitSet) -> Self {
        Self { of: unsolved(units) }
    }

    /// Displacements that a unit asks of the samples; `field` is that of the unit.
    pub fn of(&self, unit: usize, side: usize, samples: &[Sample], field: &Field) -> &[DVec3] {
        self.of[unit][side]
            .get_or_init(|| samples.iter().map(|sample| sample.target(|mark| asked(field, mark))).collect())
    }

    /// Targets for samples of other weights: most are what they were.
    pub fn for_samples(
        self,
        before: &[Sample],
        samples: &[Sample],
        units: &UnitSet,
        lines: &OpeningLines,
        landmarks: &Landmarks,
    ) -> Self {
        // Both lists are in the order of their numbers.
        let mut next = 0;
        let same: Vec<Option<usize>> = samples
            .iter()
            .map(|sample| {
                while before.get(next).is_some_and(|other| other.number < sample.number) {
                    next += 1;
                }
                before.get(next).filter(|other| other.asks_like(sample)).map(|_| next)
            })
            .collect();
        let renewed = |(unit, sides): (usize, [OnceLock<Vec<DVec3>>; 2])| {
            let mut side = 0;
            sides.map(|mut known| {
                let field = Field::of_unit(&units.units()[unit], side, lines, landmarks);
                side += 1;
                let Some(known) = known.take() else { return OnceLock::new() };
                let target = |(sample, same): (&Sample, &Option<usize>)| match same.and_then(|same| known.get(same)) {
                    Some(target) => *target,
                    None => sample.target(|mark| asked(&field, mark)),
                };
                OnceLock::from(samples.iter().zip(&same).map(target).collect::<Vec<DVec3>>())
            })
        };
        Self { of: self.of.into_par_iter().enumerate().map(renewed).collect() }
    }
}
