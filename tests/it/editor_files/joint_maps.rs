//! Maps of joints that are saved from the window.

use rigsmith::editor::panels::timeline::import::{ClipImport, ImportRequest, MapRequest};

use super::*;

#[test]
fn the_map_of_motion_that_waits_is_saved_where_people_say() {
    let folder = folder();
    let motion = folder.path().join("step.bvh");
    std::fs::write(&motion, crate::fuzz_bvh::HUMAN).expect("written");
    let mut window = Window::with_panels(folder.path());
    window.open_file(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron"));
    window.send(MapRequest::AskSave);
    assert!(window.question().is_none(), "no motion waits");
    window.send(ImportRequest(motion));
    let start = Instant::now();
    while window.world().resource::<ClipImport>().draft().is_none() {
        assert!(start.elapsed() < HANG, "the motion never comes: {:?}", window.notices.list);
        window.update();
    }
    window.send(MapRequest::AskSave);
    let Some(Question::Path { purpose: Purpose::JointMap, suggestion, .. }) = window.question() else {
        panic!("{:?}", window.question());
    };
    assert!(suggestion.ends_with("step.map.ron"), "{suggestion:?}");
    // A name without an ending gets one.
    window.answer(Answer::Path(folder.path().join("mine")));
    let saved = folder.path().join("mine.map.ron");
    let text = std::fs::read_to_string(&saved).expect("a map");
    assert!(text.contains("(\"LeftUpLeg\", \"thigh_l\")"), "{text}");
    assert!(window.notices.include(Severity::Done, "Saved the map of joints to mine.map.ron"));
    // A file that is there is not replaced before people say so.
    std::fs::write(&saved, "[]").expect("written");
    window.send(MapRequest::AskSave);
    window.answer(Answer::Path(saved.clone()));
    assert!(matches!(window.question(), Some(Question::Replace { purpose: Purpose::JointMap, .. })));
    assert_eq!(std::fs::read_to_string(&saved).expect("a map"), "[]");
    window.answer(Answer::Save);
    assert_eq!(std::fs::read_to_string(&saved).expect("a map"), text);
}
