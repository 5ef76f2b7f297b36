//! Signs of the window: the fonts that it draws with have a glyph for each of them.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use bevy_egui::egui::{self, Color32, FontId};

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn every_sign_of_the_window_can_be_drawn() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/editor"), &mut files);
    let mut signs: BTreeMap<char, BTreeSet<String>> = BTreeMap::new();
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        for line in text.lines().filter(|line| !line.trim_start().starts_with("//")) {
            for sign in line.chars().filter(|sign| !sign.is_ascii()) {
                signs.entry(sign).or_default().insert(file.display().to_string());
            }
        }
    }
    assert!(signs.len() > 20, "the signs were not found: {signs:?}");
    // A sign without a glyph looks like one that no font has.
    let ctx = egui::Context::default();
    let mut output = ctx.run_ui(egui::RawInput::default(), |ui| {
        let font = FontId::proportional(14.0);
        let glyph = |sign: char| {
            let text = ui.painter().layout_no_wrap(sign.to_string(), font.clone(), Color32::WHITE);
            text.rows[0].glyphs.first().map(|glyph| glyph.uv_rect)
        };
        let missing = glyph('\u{e123}');
        assert!(missing.is_some() && glyph('a') != missing, "the fonts have no sign for what they lack");
        signs.retain(|sign, _| glyph(*sign) == missing);
    });
    output.textures_delta.clear();
    assert!(signs.is_empty(), "signs without a glyph are drawn as boxes: {signs:?}");
}
