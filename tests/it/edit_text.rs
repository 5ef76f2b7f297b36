//! Edits as text: what a journal writes is what it reads.

use std::sync::Arc;

use proptest::prelude::*;
use rigsmith::{
    mesh::model::Weights,
    rig::{Rig, RigEdit, SkinData, Uid, UidSource, operations::MirrorPlane},
};

use crate::edits::{operation, steps};

fn again(edit: &RigEdit) -> RigEdit {
    let text = ron::to_string(edit).unwrap();
    ron::from_str(&text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_edit_and_its_inverse_come_back(steps in steps(40)) {
        let (mut rig, mut uids) = (Rig::new(Uid(42), "random"), UidSource::seeded(5));
        for step in &steps {
            let plane = (step.1 % 3 == 0).then(|| MirrorPlane::sagittal(2.0));
            let Ok(outcome) = operation(&rig, step).run(&mut rig, &mut uids, plane) else { continue };
            for edit in outcome.edits.iter().chain(&outcome.inverses) {
                prop_assert_eq!(&again(edit), edit);
            }
        }
    }
}

#[test]
fn weights_come_back_bit_by_bit() {
    let mut weights = Weights::default();
    weights.push([(0, 0.1), (1, 0.9)]);
    weights.push([]);
    weights.push([(1, f32::MIN_POSITIVE), (0, 1.0 - f32::EPSILON)]);
    let subjects = [(Uid(u64::MAX), Uid(1))].into();
    let skin = SkinData { joints: vec![Uid(1), Uid(u64::MAX)], weights, at_rest: true, subjects };
    for edit in [RigEdit::SetSkin(Uid(7), Some(Arc::new(skin))), RigEdit::SetSkin(Uid(7), None)] {
        assert_eq!(again(&RigEdit::Batch(vec![edit.clone()])), RigEdit::Batch(vec![edit]));
    }
}
