//! Pictures of what lies over the window: toasts, the start page, help, the palette, questions.

use std::{path::PathBuf, time::SystemTime};

use bevy::prelude::*;
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        files::{
            FollowUp,
            dialog::{Purpose, Question},
        },
        help::HelpShown,
        notice::Notice,
        palette::PaletteShown,
        settings::EditorSettings,
        start::{RecentFiles, StartPage},
        style::Look,
    },
    files::journal::{Condition, Ending, Origin, PendingJournal},
};

use super::{
    booth::{Booth, Frame, Step},
    cases::{ALL, CONTRAST, Case, DARK, LARGE, LIGHT, NAMES, PictureSubject, SMALL, WHOLE},
    queries::Asked,
};

fn case(name: &str, what: PictureSubject, look: (&str, Look), size: [u16; 2], before: fn(&mut Booth)) -> Case {
    Case {
        name: format!("{name}_{}_{}", look.0, size[0]),
        what,
        frame: Frame { size, scale: 1.0, look: look.1 },
        before,
        steps: &[],
        asked: ALL,
        kept: None,
    }
}

pub fn cases() -> Vec<Case> {
    let toasts = |name, look, before| case(name, PictureSubject::Toasts, look, [400, 320], before);
    let over = |name, look, size, before| case(name, PictureSubject::Overlays, look, size, before);
    let asked = |case: Case, asked: Asked| Case { asked, ..case };
    let typed = |case: Case, steps: &'static [Step]| Case { steps, ..case };
    let small = [620, 460];
    vec![
        toasts("toast", DARK, one_toast),
        toasts("toast", LIGHT, one_toast),
        toasts("toasts", DARK, many_toasts),
        toasts("toasts", LIGHT, many_toasts),
        toasts("toasts", CONTRAST, many_toasts),
        toasts("toasts_long", DARK, long_toasts),
        over("question_unsaved", DARK, small, ask_unsaved),
        over("question_unsaved", LIGHT, small, ask_unsaved),
        over("question_replace", DARK, small, ask_replace),
        over("question_save", DARK, small, ask_save),
        over("question_export", DARK, small, ask_export),
        over("question_export", LIGHT, small, ask_export),
        over("question_export", CONTRAST, small, ask_export),
        over("question_avatar", DARK, small, ask_avatar),
        over("question_recover", DARK, small, ask_recover),
        over("question_recover", LIGHT, small, ask_recover),
        over("palette", DARK, SMALL, show_palette),
        over("palette", LIGHT, SMALL, show_palette),
        typed(over("palette_searched", DARK, SMALL, show_palette), &[Step::Type("mirror")]),
        typed(over("palette_nothing", DARK, SMALL, show_palette), &[Step::Type("no such thing")]),
        over("help", DARK, SMALL, show_help),
        over("help", LIGHT, LARGE, show_help),
        typed(over("help_searched", CONTRAST, SMALL, show_help), &[Step::Type("key")]),
        over("start", DARK, LARGE, show_start),
        over("start", LIGHT, SMALL, show_start),
        over("start", CONTRAST, SMALL, show_start),
        asked(over("start_recent", DARK, SMALL, show_start_with_files), NAMES),
        asked(over("start_column", DARK, [560, 640], show_start_with_files), NAMES),
        asked(case("empty_window", PictureSubject::Window, DARK, LARGE, show_nothing), WHOLE),
        asked(case("empty_window", PictureSubject::Window, LIGHT, SMALL, show_nothing), WHOLE),
    ]
}

fn one_toast(booth: &mut Booth) {
    show_nothing(booth);
    booth.tell([Notice::done("biped is skinned: 100 % of 13380 points have weights.").named()]);
}

fn many_toasts(booth: &mut Booth) {
    show_nothing(booth);
    let told = (0..12).map(|number| Notice::info(format!("Notice {number}: something has happened.")));
    let error = Notice::error("The project was not saved: the disk is full. Free some space, or save it elsewhere.");
    let warning = Notice::warning("There is no mesh to skin: open one first.");
    booth.tell(told.chain([error, warning.clone(), warning.clone(), warning]));
}

fn long_toasts(booth: &mut Booth) {
    show_nothing(booth);
    let path = "/home/somebody/a folder with a long name/another one/character_with_a_long_name.rigsmith.ron";
    booth.tell([
        Notice::error(format!("{path} was not opened: line 12, column 7: expected a number, found \"oops\".")),
        Notice::warning(
            "左鎖骨の補助関節 has no weights. Бесконечно_длинное_имя_сустава_без_пробелов_и_переносов_строк too.",
        ),
    ]);
}

/// Shows no question and no page, and forgets what was told.
fn show_nothing(booth: &mut Booth) {
    booth.cancel_question();
    booth.app.insert_resource(StartPage::default());
    booth.app.insert_resource(HelpShown(false));
    booth.app.insert_resource(PaletteShown(false));
    booth.tell([]);
    booth.draw_overlays();
}

fn ask(booth: &mut Booth, question: Question) {
    show_nothing(booth);
    booth.question(question);
}

fn ask_unsaved(booth: &mut Booth) {
    ask(booth, Question::Unsaved { name: "character with a long name".to_owned(), then: FollowUp::Quit });
}

fn ask_replace(booth: &mut Booth) {
    let path = PathBuf::from("/home/somebody/characters/biped.rigsmith.ron");
    ask(booth, Question::Replace { purpose: Purpose::Save, path, then: None });
}

fn ask_path(booth: &mut Booth, purpose: Purpose, path: &str) {
    ask(booth, Question::Path { purpose, suggestion: path.into(), then: None });
}

fn ask_save(booth: &mut Booth) {
    ask_path(booth, Purpose::Save, "/home/somebody/characters/biped.rigsmith.ron");
}

fn ask_export(booth: &mut Booth) {
    ask_path(booth, Purpose::Export, "/home/somebody/characters/biped.glb");
}

fn ask_avatar(booth: &mut Booth) {
    ask_path(booth, Purpose::Export, "/home/somebody/characters/biped.vrm");
}

fn ask_recover(booth: &mut Booth) {
    let journal = |number: u64, origin: Origin, condition: Condition| PendingJournal {
        path: PathBuf::from(format!("/home/somebody/.local/state/rigsmith/{number}.journal")),
        origin,
        started: number,
        modified: None::<SystemTime>,
        changes: 12 * number as usize,
        project_changed: number == 2,
        ending: Ending::Open,
        condition,
    };
    let list = vec![
        journal(1, Origin::Empty, Condition::Whole),
        journal(2, Origin::Bundled("biped".to_owned()), Condition::Whole),
        journal(3, Origin::Empty, Condition::Whole),
    ];
    ask(booth, Question::Recover(list));
}

fn show_palette(booth: &mut Booth) {
    show_nothing(booth);
    booth.app.insert_resource(PaletteShown(true));
}

fn show_help(booth: &mut Booth) {
    show_nothing(booth);
    booth.app.insert_resource(HelpShown(true));
}

fn show_start(booth: &mut Booth) {
    show_nothing(booth);
    booth.app.world_mut().resource_mut::<EditorSettings>().recent.clear();
    booth.send(ActionRequest(Action::StartPage));
}

fn show_start_with_files(booth: &mut Booth) {
    show_start(booth);
    let recent = (0..9).map(|number| {
        let name = ["hero", "a_character_whose_name_is_longer_than_the_page", "左鎖骨"][number % 3];
        PathBuf::from(format!("/no/such/folder/{name}_{number}.rigsmith.ron"))
    });
    booth.app.world_mut().resource_mut::<EditorSettings>().recent = recent.collect();
    booth.until("the recent files", |world| world.resource::<RecentFiles>().list().len() == 9);
}
