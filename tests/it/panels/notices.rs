//! Notices: the log, and toasts over the viewport.

use super::*;

#[test]
fn everything_is_told_and_the_log_is_capped() {
    let mut desk = Desk::new(LogPanel::default());
    desk.edit(Operation::Delete { joints: vec![Uid(404)], keep_children: true });
    desk.frames(2);
    let told = desk.told();
    assert!(told.len() == 1 && told[0].starts_with("There is no joint"), "{told:?}");
    for number in 0..LogBook::CAPACITY + 300 {
        desk.app.world_mut().write_message(Notice::info(format!("Notice {number}")));
    }
    for _ in 0..5 {
        desk.app.world_mut().write_message(Notice::warning("Again"));
    }
    desk.frames(4);
    let book = desk.app.world().resource::<LogBook>();
    assert_eq!(book.entries().len(), LogBook::CAPACITY);
    assert_eq!(book.entries().next_back().map(|last| last.times), Some(5), "repetitions are counted");
    assert!(desk.look("Again").is_some(), "the newest is in view");
    desk.click("Search");
    desk.type_text("notice 1234");
    desk.frames(3);
    assert!(desk.look("Notice 1234").is_some() && desk.look("Again").is_none());
    desk.click("Clear");
    desk.frames(2);
    assert!(desk.told().is_empty());
    // An entry leads to the panel that it is about.
    desk.click("Clear search");
    desk.app.world_mut().write_message(Notice::error("It stopped.").at("Process"));
    desk.frames(3);
    desk.click("It stopped.");
    desk.frames(2);
    desk.time += 1.0;
    let at = desk.find("Show in Process").rect.center();
    desk.press(at);
    desk.release(at);
    let shown: Vec<ShowPanel> = desk.app.world_mut().resource_mut::<Messages<ShowPanel>>().drain().collect();
    assert_eq!(shown, [ShowPanel("Process")]);
}

#[test]
fn the_log_is_filtered_by_severity() {
    let mut desk = Desk::new(LogPanel::default());
    for notice in
        [Notice::info("Told"), Notice::done("Made"), Notice::warning("Doubtful"), Notice::error("Wrong").at("Process")]
    {
        desk.app.world_mut().write_message(notice);
    }
    desk.frames(3);
    let listed = |desk: &Desk| -> Vec<&str> {
        ["Told", "Made", "Doubtful", "Wrong"].into_iter().filter(|text| desk.look(text).is_some()).collect()
    };
    let toggled = |desk: &mut Desk, name: &str| {
        let was_on = desk.find(name).on;
        desk.click(name);
        desk.frames(2);
        assert_ne!(desk.find(name).on, was_on, "{name} tells its state");
    };
    assert_eq!(listed(&desk), ["Told", "Made", "Doubtful", "Wrong"]);
    toggled(&mut desk, "Show information");
    assert_eq!(listed(&desk), ["Doubtful", "Wrong"]);
    toggled(&mut desk, "Show warnings");
    assert_eq!(listed(&desk), ["Wrong"]);
    toggled(&mut desk, "Show errors");
    assert!(listed(&desk).is_empty());
    // Others that come are sorted in, too, and words narrow what is listed.
    desk.app.world_mut().write_message(Notice::done("Made again"));
    toggled(&mut desk, "Show information");
    assert_eq!(listed(&desk), ["Told", "Made"]);
    assert!(desk.look("Made again").is_some());
    desk.click("Search");
    desk.type_text("again");
    desk.frames(2);
    assert!(listed(&desk).is_empty() && desk.look("Made again").is_some());
}

#[test]
fn toasts_are_few_and_errors_stay_longest() {
    let size = egui::vec2(1280.0, 720.0);
    let mut desk = Desk::with(Sheet::Overlay(Box::new(Toasts::default())), size);
    let shown = |desk: &Desk| desk.seen.iter().filter(|seen| seen.label == "Close").count();
    desk.app.world_mut().write_message(Notice::error("It cannot be. Do that instead."));
    desk.app.world_mut().write_message(Notice::info("not shown").quiet());
    for number in 0..7 {
        desk.app.world_mut().write_message(Notice::info(format!("Notice {number}")));
    }
    desk.frames(4);
    assert_eq!(shown(&desk), 4);
    let low = desk.seen.iter().filter(|seen| seen.label == "Close").all(|seen| seen.rect.top() > 200.0);
    assert!(low, "none is near the toolbar");
    desk.time += 8.0;
    desk.frames(3);
    assert_eq!(shown(&desk), 1, "the error stays longer");
    desk.click("Close");
    desk.frames(2);
    assert_eq!(shown(&desk), 0);
    desk.app.world_mut().write_message(Notice::error("It cannot be. Do that instead."));
    desk.frames(3);
    assert_eq!(shown(&desk), 1);
    desk.time += 60.0;
    desk.frames(3);
    assert_eq!(shown(&desk), 0, "even an error goes, and is in the log");
    assert!(desk.told().iter().any(|told| told.starts_with("It cannot be")));
}

#[test]
fn a_toast_leads_to_the_panel_that_it_is_about() {
    let size = egui::vec2(1280.0, 720.0);
    let mut desk = Desk::with(Sheet::Overlay(Box::new(Toasts::default())), size);
    for (notice, name, panel) in [
        (Notice::error("The build stopped.").at("Process"), "Show in Process", "Process"),
        (Notice::warning("Something else."), "Show in the log", "Log"),
    ] {
        desk.app.world_mut().write_message(notice);
        desk.frames(4);
        desk.time += 1.0;
        let at = desk.find(name).rect.left_center() + egui::vec2(3.0, 0.0);
        desk.press(at);
        desk.release(at);
        let shown: Vec<ShowPanel> = desk.app.world_mut().resource_mut::<Messages<ShowPanel>>().drain().collect();
        assert_eq!(shown, [ShowPanel(panel)], "{name}");
    }
}

/// A window that sleeps while the pointer rests on a toast wakes up for another reason later: the toast is there yet.
#[test]
fn a_toast_under_the_pointer_stays_without_frames() {
    let mut desk = Desk::with(Sheet::Overlay(Box::new(Toasts::default())), egui::vec2(1280.0, 720.0));
    desk.app.world_mut().write_message(Notice::info("It began."));
    desk.frames(3);
    let toast = |desk: &Desk| desk.look("Show in the log").map(|toast| toast.rect.center());
    let at = toast(&desk).expect("the toast");
    desk.move_to(at);
    desk.frames(60);
    assert!(!desk.asks && desk.wakes_in == std::time::Duration::MAX, "it rests");
    desk.time += 600.0;
    desk.frames(60);
    assert!(toast(&desk).is_some(), "{:?}", desk.seen);
    assert!(!desk.asks && desk.wakes_in == std::time::Duration::MAX, "it rests again");
    desk.move_to(egui::pos2(5.0, 5.0));
    desk.time += 1.0;
    desk.frames(3);
    assert!(toast(&desk).is_some(), "it stays a little longer");
    desk.time += 5.0;
    desk.frames(3);
    assert!(toast(&desk).is_none());
}

#[test]
fn equal_toasts_are_counted() {
    let size = egui::vec2(1280.0, 720.0);
    let mut desk = Desk::with(Sheet::Overlay(Box::new(Toasts::default())), size);
    let shown = |desk: &Desk| desk.seen.iter().filter(|seen| seen.label == "Close").count();
    let send = |desk: &mut Desk, notice: Notice| {
        desk.app.world_mut().write_message(notice);
    };
    send(&mut desk, Notice::warning("Again"));
    send(&mut desk, Notice::warning("Again"));
    desk.frames(3);
    assert!(desk.says("Again ×2"), "{:?}", desk.seen);
    // Another one between them makes no second toast.
    send(&mut desk, Notice::info("Other"));
    desk.frames(2);
    send(&mut desk, Notice::warning("Again"));
    desk.frames(3);
    assert!(desk.says("Again ×3") && desk.says("Other") && shown(&desk) == 2, "{:?}", desk.seen);

    // A key pressed too often is told, as what it is.
    for change in [Change::Undo, Change::Undo, Change::Redo] {
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
    }
    desk.frames(3);
    let book = desk.app.world().resource::<LogBook>();
    let told: Vec<_> = book.entries().map(|entry| (entry.notice.severity, entry.notice.text.as_str())).collect();
    let none = |what: &str| (Severity::Info, format!("There is nothing to {what}."));
    let [undo, redo] = ["undo", "redo"].map(none);
    assert!(told.contains(&(undo.0, undo.1.as_str())) && told.contains(&(redo.0, redo.1.as_str())), "{told:?}");
    assert!(desk.says("There is nothing to undo. ×2"), "{:?}", desk.seen);
}

/// Notices are sentences; names at their start are as people wrote them.
#[test]
fn notices_begin_with_a_capital_unless_they_begin_with_a_name() {
    let mut desk = Desk::new(LogPanel::default());
    for (text, told) in [
        ("the disk is full: free some space", "The disk is full: free some space"),
        ("nothing: no joint is selected", "Nothing: no joint is selected"),
        ("über alles", "Über alles"),
        ("Some joints are gone", "Some joints are gone"),
        ("hero.glb was not opened", "hero.glb was not opened"),
        ("models/hero: no such file", "models/hero: no such file"),
        ("hand_l has no partner", "hand_l has no partner"),
        ("\"hips\" is given twice", "\"hips\" is given twice"),
        ("3 joints move nothing", "3 joints move nothing"),
    ] {
        desk.app.world_mut().write_message(Notice::info(text));
        desk.frames(2);
        assert_eq!(desk.told().last().map(String::as_str), Some(told));
    }
    desk.app.world_mut().write_message(Notice::info("hips keeps its weights.").named());
    desk.frames(2);
    assert_eq!(desk.told().last().map(String::as_str), Some("hips keeps its weights."));
    // Refusals of edits are told by the same rule.
    desk.edit(Operation::Delete { joints: vec![Uid(404)], keep_children: true });
    desk.frames(2);
    assert!(desk.told().last().is_some_and(|told| told.starts_with("There is no joint")), "{:?}", desk.told());
}
