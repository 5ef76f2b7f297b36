//! Influences of one point: how many stay, in which order, and that they sum to one.

use proptest::prelude::*;
use rigsmith::mesh::influences::{keep_strongest, keep_strongest_softly};

fn kept_influences(influences: &[(u32, f32)], most: usize, least: f32) -> Vec<(u32, f32)> {
    let mut influences = influences.to_vec();
    keep_strongest(&mut influences, most, least);
    influences
}

#[test]
fn the_strongest_stay_and_sum_to_one() {
    let all = [(4, 0.5), (2, 2.0), (9, 1.0), (1, 0.5)];
    assert_eq!(kept_influences(&all, 4, 0.0), [(2, 0.5), (9, 0.25), (1, 0.125), (4, 0.125)]);
    assert_eq!(kept_influences(&all, 2, 0.0), [(2, 2.0 / 3.0), (9, 1.0 / 3.0)]);
    assert_eq!(kept_influences(&all, 4, 0.2), [(2, 2.0 / 3.0), (9, 1.0 / 3.0)], "an eighth is less than a fifth");
    assert_eq!(kept_influences(&all, 4, 0.9), [(2, 1.0)], "the strongest stays whatever the threshold");
    assert_eq!(kept_influences(&all, 0, 0.0), [(2, 1.0)]);
}

#[test]
fn what_is_no_weight_is_left_out() {
    assert_eq!(kept_influences(&[], 4, 0.1), []);
    assert_eq!(kept_influences(&[(0, 0.0), (1, -1.0), (2, f32::NAN), (3, f32::INFINITY)], 4, 0.0), []);
    assert_eq!(kept_influences(&[(0, f32::NAN), (1, 3.0)], 4, 0.0), [(1, 1.0)]);
    assert_eq!(kept_influences(&[(0, f32::MAX), (1, f32::MAX)], 4, 0.0), [(0, 0.5), (1, 0.5)]);
    assert_eq!(kept_influences(&[(0, f32::MIN_POSITIVE), (1, f32::MIN_POSITIVE)], 4, 0.0), [(0, 0.5), (1, 0.5)]);
}

fn soft_influences(influences: &[(u32, f32)], most: usize, held: Option<u32>) -> Vec<(u32, f32)> {
    let mut influences = influences.to_vec();
    keep_strongest_softly(&mut influences, most, 0.0, held);
    influences
}

#[test]
fn the_one_that_is_left_out_weakens_the_others() {
    let all = [(7, 0.4), (3, 0.3), (5, 0.2), (6, 0.1)];
    let check = |most: usize, held: Option<u32>, wanted: &[(u32, f32)]| {
        let found = soft_influences(&all, most, held);
        assert_eq!(found.len(), wanted.len(), "{found:?}");
        for ((joint, weight), (wanted_joint, wanted_weight)) in found.iter().zip(wanted) {
            assert!(joint == wanted_joint && (weight - wanted_weight).abs() < 1e-6, "{found:?} is not {wanted:?}");
        }
    };
    check(4, None, &all);
    // A quarter of a fifth is taken from both that stay.
    check(2, None, &[(7, 0.35 / 0.6), (3, 0.25 / 0.6)]);
    // Of what the others have, all stays with one of them.
    check(2, Some(7), &[(3, 0.6), (7, 0.4)]);
    check(1, Some(7), &[(7, 1.0)]);
    // A weak one is not held.
    check(1, Some(6), &[(7, 1.0)]);
    // Equally strong ones stay or go together.
    let alike = [(7, 0.4), (3, 0.2), (5, 0.2), (6, 0.2)];
    assert_eq!(soft_influences(&alike, 3, None), [(7, 1.0)]);
    assert_eq!(soft_influences(&[(1, 0.5), (2, 0.5)], 1, None), [(1, 1.0)]);
}

proptest! {
    #[test]
    fn they_are_sorted_and_whole(
        influences in prop::collection::vec((0u32..50, 1e-30f32..1e30), 1..20), most in 1usize..9, least in 0.0f32..0.2,
    ) {
        let soft = soft_influences(&influences, most, Some(influences[0].0));
        prop_assert!((soft.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>() - 1.0).abs() < 1e-5);
        prop_assert!((1..=most).contains(&soft.len()));
        let found = kept_influences(&influences, most, least);
        prop_assert!((1..=most).contains(&found.len()));
        prop_assert!(found.windows(2).all(|pair| pair[0].1 >= pair[1].1));
        prop_assert!((found.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>() - 1.0).abs() < 1e-5);
        prop_assert!(found.iter().all(|kept| influences.iter().any(|known| known.0 == kept.0)));
    }
}
