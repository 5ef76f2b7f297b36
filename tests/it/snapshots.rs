//! Pictures of every panel, overlay and of the whole window, in each state, look and width, compared with stored ones.
//!
//! `UPDATE_SNAPSHOTS=1` writes the pictures; `RIGSMITH_SHEETS` names a folder for sheets on which the pictures of a group
//! stand side by side with captions, to be looked at. A rasteriser on the processor draws the triangles of egui, so that the
//! tests need no graphics adapter and the pictures are the same everywhere.

mod booth;
mod cases;
mod lists;
mod overlays;
mod picture;
mod queries;
mod raster;
mod states;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use bevy_egui::egui;
use rigsmith::editor::{
    panels::toasts::Toasts,
    style::{Look, WindowTheme},
};

use booth::{Booth, Canvas, Frame, Shot, Subject};
use cases::{Case, GROUPS, Group, PictureSubject};
use picture::{Picture, write_sheets};

/// Largest size of all pictures together in bytes.
const MOST_BYTES: u64 = 6 << 20;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/snapshots/pictures")
}

fn stored(group: &str, case: &str) -> PathBuf {
    folder().join(format!("{group}-{case}.png"))
}

/// Takes the pictures of a group and compares them.
fn check(name: &str) {
    let group = GROUPS.iter().find(|group| group.name == name).expect("a group of that name");
    let update = std::env::var("UPDATE_SNAPSHOTS").is_ok_and(|value| value == "1");
    let sheets = std::env::var_os("RIGSMITH_SHEETS").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let mut booth = (group.booth)();
    let mut captions = Canvas::new();
    let (mut wrong, mut cells) = (Vec::new(), Vec::new());
    for case in (group.cases)() {
        let shot = take(&mut booth, &case);
        for problem in queries::problems(&shot, f32::from(case.frame.size[0]), case.asked) {
            wrong.push(format!("{name}/{}: {problem}", case.name));
        }
        let picture = match case.kept {
            Some([width, height]) => shot.picture.part(width, height),
            None => shot.picture,
        };
        let path = stored(name, &case.name);
        match Picture::load(&path) {
            // A picture that nobody can tell from the stored one is no change.
            Some(known) if picture.difference(&known).is_none() => {}
            _ if update => picture.save(&path),
            None => wrong.push(format!("{name}/{}: there is no stored picture; {HOW}", case.name)),
            Some(known) => {
                let file = path.file_name().expect("a file");
                let seen = Path::new(env!("CARGO_TARGET_TMPDIR")).join("snapshots").join(file);
                picture.save(&seen);
                let difference = picture.difference(&known).unwrap_or_default();
                wrong.push(format!("{name}/{}: {difference}; see {}; {HOW}", case.name, seen.display()));
            }
        }
        if sheets.is_some() {
            cells.push((captions.caption(&format!("{name}/{}", case.name), picture.width), picture));
        }
    }
    if let Some(folder) = sheets {
        for sheet in write_sheets(&folder, name, &cells) {
            println!("{}", sheet.display());
        }
    }
    assert!(wrong.is_empty(), "{} problems:\n{}", wrong.len(), wrong.join("\n"));
}

/// Advice on how a picture is made.
const HOW: &str = "UPDATE_SNAPSHOTS=1 cargo test --test it snapshots makes it; look at it before you keep it";

fn take(booth: &mut Booth, case: &Case) -> Shot {
    (case.before)(booth);
    let mut subject = match case.what {
        PictureSubject::Panel(panel) => Subject::Panel(panel()),
        PictureSubject::Toasts => Subject::Overlay(Box::new(Toasts::default())),
        PictureSubject::Overlays => Subject::Overlays,
        PictureSubject::Window => Subject::Window,
    };
    booth.take(&mut subject, case.frame, case.steps)
}

#[test]
fn panels_of_an_empty_project() {
    check("empty");
}

#[test]
fn panels_and_window_of_a_usual_character() {
    check("typical");
}

#[test]
fn panels_and_window_of_far_more_than_usual() {
    check("extreme");
}

#[test]
fn the_panel_of_a_face() {
    check("face");
}

#[test]
fn the_panel_of_a_newer_template() {
    check("updater");
}

#[test]
fn lists_in_the_cards_of_commands() {
    check("lists");
}

#[test]
fn toasts_pages_and_questions() {
    check("overlays");
}

/// The table is large, says each name once, and no stored picture is left over from a case that is gone.
#[test]
fn the_table_has_every_stored_picture() {
    let names = |group: &Group| (group.cases)().into_iter().map(|case| stored(group.name, &case.name)).collect();
    let lists: Vec<Vec<PathBuf>> = GROUPS.iter().map(names).collect();
    let all: BTreeSet<&PathBuf> = lists.iter().flatten().collect();
    assert_eq!(all.len(), lists.iter().map(Vec::len).sum::<usize>(), "each name is there once");
    assert!(all.len() >= 150, "{} pictures", all.len());
    let mut bytes = 0;
    for file in std::fs::read_dir(folder()).into_iter().flatten() {
        let path = file.expect("a picture").path();
        assert!(all.contains(&path), "{} belongs to no case: delete it", path.display());
        bytes += std::fs::metadata(&path).expect("a picture").len();
    }
    assert!(bytes <= MOST_BYTES, "the pictures have {bytes} bytes, of which {MOST_BYTES} may be");
}

/// Faults that the comparison and the queries are there for are found: another letter, a field without a name, two buttons
/// of one name, a line that is too long. What nobody sees is none.
#[test]
fn differences_and_problems_are_found() {
    let mut canvas = Canvas::new();
    let frame = Frame { size: [200, 120], scale: 1.0, look: Look { theme: WindowTheme::Dark, high_contrast: false } };
    // A button, or a field without a name, above a line.
    let mut shot = |button: &str, line: &str| {
        canvas.shoot(frame, |ui| {
            let mut number = 1.0;
            match button {
                "" => ui.add(egui::DragValue::new(&mut number)),
                name => ui.button(name),
            };
            ui.add(egui::Label::new(line).extend());
        })
    };
    let usual = shot("Skin", "13 joints");
    let other = shot("Skin", "43 joints");
    assert!(usual.picture == shot("Skin", "13 joints").picture, "the same state is the same picture");
    assert!(usual.picture.difference(&usual.picture).is_none());
    assert!(other.picture.difference(&usual.picture).is_some(), "one letter is another");
    let mut noisy = usual.picture.clone();
    for y in 0..noisy.height {
        for x in 0..noisy.width {
            let color = noisy.pixel(x, y).map(|part| part.saturating_add(3));
            noisy.set(x, y, color);
        }
    }
    assert!(noisy.difference(&usual.picture).is_none(), "rounding is no difference");
    let taller = Picture::filled(noisy.width, noisy.height + 1, [0; 3]);
    assert!(taller.difference(&noisy).is_some());

    let problems = |shot: &Shot| queries::problems(shot, 200.0, cases::ALL);
    assert_eq!(problems(&usual), Vec::<String>::new());
    let unnamed = problems(&shot("", "13 joints"));
    assert!(unnamed.len() == 1 && unnamed[0].contains("has no name"), "{unnamed:?}");
    let long = problems(&shot("Skin", "A line of words that is longer than the panel in which it stands"));
    assert!(long.iter().any(|problem| problem.contains("reaches beyond")), "{long:?}");
    assert!(long.iter().any(|problem| problem.contains("is cut off")), "{long:?}");
    let mut twins = usual;
    let button = twins.widgets.iter().find(|widget| widget.label == "Skin").expect("the button").clone();
    twins.widgets.push(button);
    assert!(problems(&twins).iter().any(|problem| problem.contains("has the name of")), "{:?}", problems(&twins));
}
