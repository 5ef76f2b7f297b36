//! Motion on bodies after a fit: other sizes, proportions and rest poses.

use std::sync::Arc;

use rigsmith::{
    files::{RealDisk, bundled_characters, load_model},
    headless::Workbench,
    plugins::fit::FitTemplates,
    rig::Rig,
    solve::retarget::RetargetSettings,
};

use super::{PlayedRig, motion};
use crate::prerequisites::test_data;

/// The biped in a body of the data folder.
fn fitted(body: &std::path::Path) -> Rig {
    let mut bench = Workbench::new(7, "fit");
    bench.open(load_model(&RealDisk, &body.join("body.obj")).unwrap(), true).unwrap();
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    let report = bench.fit(|_| (), &mut |_| ()).unwrap();
    assert_eq!(report.template, "biped");
    bench.rig().clone()
}

fn check(body: &str) {
    let Some(data) = test_data() else { return };
    let rig = fitted(&data.join("bodies").join(body));
    for (name, rate) in [("makehuman_walk1", None), ("cmu_01_01", Some(30.0))] {
        let settings = RetargetSettings { frame_rate: rate, ..RetargetSettings::default() };
        let played = PlayedRig::new(rig.clone(), &motion(&data, name), &settings);
        let [slide, off] = played.feet();
        println!("{body}, {name}: slide {slide:.3} %, ankles off {off:.3} %");
        assert!(slide <= 1.0 && off <= 1.5, "{body}, {name}: slide {slide}, off {off}");
        let bend = played.least_bend();
        assert!(bend > -1.0, "{body}, {name}: a knee or an elbow bends backwards by {bend}°");
    }
}

#[test]
fn clips_move_a_young_man() {
    check("male_young");
}

#[test]
fn clips_move_a_heavy_woman_in_a_t_pose() {
    check("female_heavy_tpose");
}

#[test]
fn clips_move_a_child_in_a_t_pose() {
    check("male_child_tpose");
}
