//! Templates of the library as pictures, found by words and folder. Only the visible rows are drawn.

use std::{collections::BTreeMap, sync::Arc};

use bevy::prelude::World;
use bevy_egui::egui::{
    Align2, Color32, ComboBox, CornerRadius, FontId, Rect, Response, ScrollArea, Sense, Stroke, StrokeKind,
    TextureHandle, TextureOptions, Ui, WidgetInfo, WidgetType, pos2, text::LayoutJob, text::TextWrapping, vec2,
};

use super::namesakes::differences;
use crate::{
    editor::{
        library::{
            DraggedTemplate, LibraryListing, LibraryPictures, ListTemplates, PictureRequest, ReadPart, TemplateLibrary,
            TemplatePicture, is_part_known, part_refusal,
        },
        panel::Requests,
        panels::list,
        style,
    },
    files::{FileState, ListedTemplate, TemplatePlace},
};

/// Side of a picture, in points.
const TILE: f32 = 72.0;
/// Height of the name below it.
const NAME: f32 = 16.0;
/// Height of the line below the name that tells templates of one name apart.
const DIFFERENCE: f32 = 12.0;

/// Search, folder and textures.
#[derive(Default)]
pub(in crate::editor::panels) struct Tiles {
    words: String,
    folder: Option<String>,
    textures: BTreeMap<TemplatePlace, (Option<FileState>, TextureHandle)>,
    /// Templates that were found, each with what tells it from others of its name.
    found: Vec<(Arc<ListedTemplate>, Option<String>)>,
    from: Option<(u64, String, Option<String>, bool)>,
}

/// Lines below a picture.
struct TileNames<'a> {
    /// Words that tell the template from others of its name.
    difference: Option<&'a str>,
    /// Height of the lines.
    height: f32,
}

/// State of a picture.
struct TileState {
    is_chosen: bool,
    /// Reason why the part would be refused, which greys it.
    why_not: Option<String>,
    /// True if a click has an effect.
    takes_clicks: bool,
}

/// Pictures of a menu that puts parts onto joints.
#[derive(Clone, Copy)]
pub(in crate::editor::panels) struct PartTiles {
    /// True where a click adds the part at once: a picture that would be refused takes none then.
    pub adds: bool,
}

/// Choice of what is shown.
pub(in crate::editor::panels) struct TilesShown<'a> {
    /// Leaves out what is no part, and greys parts that would be refused.
    pub parts: Option<PartTiles>,
    /// Largest height of the pictures.
    pub height: f32,
    /// The chosen template.
    pub chosen: Option<&'a TemplatePlace>,
}

impl Tiles {
    /// Draws search, folders and pictures; returns the template that was clicked.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        world: &World,
        wanted: TilesShown,
        requests: &mut Requests,
    ) -> Option<Arc<ListedTemplate>> {
        let library = world.get_resource::<TemplateLibrary>()?;
        let listing = library.listing().clone();
        self.bar(ui, &listing, wanted.parts.is_some(), requests);
        self.refresh(&listing, wanted.parts.is_some());
        for problem in self.problems(&listing) {
            ui.colored_label(style::obstacle(ui.visuals()), problem);
        }
        if self.found.is_empty() {
            let is_listing = library.is_listing() || !library.is_begun();
            let text = if is_listing { "Looking for templates …" } else { "No template is like that." };
            list::nothing(ui, text);
            return None;
        }
        let columns = ((ui.available_width() + 4.0) / (TILE + 4.0)).floor().max(1.0) as usize;
        let rows = self.found.len().div_ceil(columns);
        let (mut clicked, mut missing, mut unread) = (None, Vec::new(), Vec::new());
        let pictures = world.get_resource::<LibraryPictures>();
        // A menu gives no more room than it took before, when the list was still being made.
        let least = if wanted.parts.is_some() { wanted.height } else { 64.0 };
        let area = ScrollArea::vertical().id_salt("templates").max_height(wanted.height).min_scrolled_height(least);
        let area = area.auto_shrink([false, true]);
        let has_namesakes = self.found.iter().any(|(_, difference)| difference.is_some());
        let foot = if has_namesakes { NAME + DIFFERENCE } else { NAME };
        let mut row = |ui: &mut Ui, row: usize| {
            let in_row: Vec<_> = self.found.iter().skip(row * columns).take(columns).cloned().collect();
            for (listed, difference) in in_row {
                let picture = pictures.and_then(|pictures| pictures.get(&listed));
                if picture.is_none() && pictures.is_some_and(|pictures| !pictures.is_wanted(&listed)) {
                    missing.push(listed.clone());
                }
                let refusal = wanted.parts.and_then(|_| part_refusal(world, &listed.place));
                let why_not = refusal.as_ref().map(|refusal| refusal.words().to_owned());
                let takes_clicks = why_not.is_none() || wanted.parts.is_none_or(|parts| !parts.adds);
                // A request has the window draw on, so there is one for each part.
                if wanted.parts.is_some() && !is_part_known(world, &listed.place) {
                    unread.push(listed.place.clone());
                }
                let is_chosen = wanted.chosen == Some(&listed.place);
                let names = TileNames { difference: difference.as_deref(), height: foot };
                let state = TileState { is_chosen, why_not, takes_clicks };
                if self.tile(ui, &listed, names, picture, state).clicked() {
                    clicked = Some(listed);
                }
            }
        };
        ui.scope(|ui| {
            ui.spacing_mut().item_spacing = vec2(4.0, 4.0);
            area.show_rows(ui, TILE + foot, rows, |ui, visible| {
                visible.for_each(|number| {
                    ui.horizontal(|ui| row(ui, number));
                });
            });
        });
        if !missing.is_empty() {
            requests.send(PictureRequest(missing));
        }
        unread.into_iter().for_each(|place| requests.send(ReadPart(place)));
        clicked
    }

    fn bar(&mut self, ui: &mut Ui, listing: &LibraryListing, parts_only: bool, requests: &mut Requests) {
        let tip = "Templates whose name, kind, author or description contain all of these words";
        list::search_bar(ui, "Search templates", tip, &mut self.words, |ui| {
            if list::symbol_button(ui, "⟳", "List the templates again") {
                requests.send(ListTemplates);
            }
        });
        // The list of a box within a menu would close the menu.
        if listing.folders.len() < 2 || parts_only {
            return;
        }
        let all = "All folders";
        let text = self.folder.clone().unwrap_or_else(|| all.to_owned());
        let width = ui.available_width() - 8.0;
        let menu = ComboBox::from_id_salt("folder").selected_text(text).width(width).truncate().show_ui(ui, |ui| {
            ui.selectable_value(&mut self.folder, None, all);
            for folder in &listing.folders {
                ui.selectable_value(&mut self.folder, Some(folder.name.clone()), &folder.name);
            }
        });
        menu.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, "Folder of templates"));
    }

    /// Finds the templates again after a change of the list, the words or the folder.
    fn refresh(&mut self, listing: &LibraryListing, parts_only: bool) {
        if self.folder.as_ref().is_some_and(|name| listing.folders.iter().all(|folder| folder.name != *name)) {
            self.folder = None;
        }
        let from = Some((listing.number, self.words.clone(), self.folder.clone(), parts_only));
        if self.from == from {
            return;
        }
        let folders = listing.folders.iter();
        let folders = folders.filter(|folder| self.folder.as_ref().is_none_or(|name| folder.name == *name));
        let found = folders.flat_map(|folder| &folder.templates);
        let found = found.filter(|listed| (!parts_only || listed.is_part()) && listed.has_words(&self.words));
        let found: Vec<Arc<ListedTemplate>> = found.cloned().collect();
        let different = differences(&found);
        self.found = found.into_iter().zip(different).collect();
        self.from = from;
    }

    /// Reasons why something of the shown folders is left out.
    fn problems(&self, listing: &LibraryListing) -> Vec<String> {
        let folders = listing.folders.iter();
        let folders = folders.filter(|folder| self.folder.as_ref().is_none_or(|name| folder.name == *name));
        folders.flat_map(|folder| &folder.problems).take(3).cloned().collect()
    }

    /// Draws a picture with the name below; it can be dragged onto a joint.
    fn tile(
        &mut self,
        ui: &mut Ui,
        listed: &Arc<ListedTemplate>,
        names: TileNames,
        picture: Option<&TemplatePicture>,
        TileState { is_chosen, why_not, takes_clicks }: TileState,
    ) -> Response {
        // A part that the selected joints refuse may be dragged onto others.
        let sense = if takes_clicks { Sense::click_and_drag() } else { Sense::drag() };
        let (rect, response) = ui.allocate_exact_size(vec2(TILE, TILE + names.height), sense);
        let name = listed.name().replace('_', " ");
        let kind = if listed.is_part() { "Part" } else { "Template" };
        let said = match names.difference {
            Some(difference) if !difference.eq_ignore_ascii_case(kind) => format!("{kind} {name}, {difference}"),
            _ => format!("{kind} {name}"),
        };
        response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, takes_clicks, is_chosen, &said));
        if listed.header.is_ok() {
            response.dnd_set_drag_payload(DraggedTemplate { place: listed.place.clone(), name: name.clone() });
        }
        let square = Rect::from_min_size(rect.min, vec2(TILE, TILE));
        let opacity = ui.opacity();
        if why_not.is_some() {
            ui.multiply_opacity(ui.visuals().disabled_alpha());
        }
        let visuals = ui.visuals();
        let line = match (is_chosen, response.hovered() || response.has_focus()) {
            (true, _) => Stroke::new(2.0, style::accent(visuals)),
            (false, true) => Stroke::new(1.0, style::accent(visuals)),
            (false, false) => Stroke::new(1.0, visuals.widgets.noninteractive.bg_stroke.color),
        };
        ui.painter().rect(square, CornerRadius::same(4), visuals.extreme_bg_color, line, StrokeKind::Inside);
        self.paint(ui, square.shrink(3.0), listed, picture);
        let is_ok = listed.header.is_ok();
        let color = if is_ok { ui.visuals().text_color() } else { ui.visuals().error_fg_color };
        line_below(ui, square, 1.0, &name, 11.0, color);
        if let Some(difference) = names.difference {
            line_below(ui, square, NAME - 1.0, difference, 10.0, style::quiet(ui.visuals()));
        }
        ui.set_opacity(opacity);
        let tip = match &listed.header {
            Ok(header) if header.description.is_empty() => listed.place.to_string(),
            Ok(header) => format!("{}\n{}", header.description, listed.place),
            Err(error) => format!("{}: {error}", listed.place),
        };
        match why_not {
            Some(why_not) => response.on_hover_ui(|ui| {
                ui.label(why_not);
                ui.weak(tip);
            }),
            None => response.on_hover_text(tip),
        }
    }

    fn paint(&mut self, ui: &Ui, square: Rect, listed: &ListedTemplate, picture: Option<&TemplatePicture>) {
        match picture {
            Some(TemplatePicture::Bones(bones)) => {
                let visuals = ui.visuals();
                bones.paint(ui.painter(), square, style::quiet(visuals), visuals.strong_text_color());
            }
            Some(TemplatePicture::Image(image)) => {
                let known = self.textures.get(&listed.place).filter(|(state, _)| *state == listed.state);
                let texture = match known {
                    Some((_, texture)) => texture.id(),
                    None => {
                        let name = format!("template {}", listed.place);
                        let texture = ui.ctx().load_texture(name, (**image).clone(), TextureOptions::LINEAR);
                        let id = texture.id();
                        self.textures.insert(listed.place.clone(), (listed.state, texture));
                        id
                    }
                };
                let [width, height] = image.size.map(|side| side as f32);
                let size = vec2(width, height) * (square.width() / width.max(height).max(1.0));
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                ui.painter().image(texture, Rect::from_center_size(square.center(), size), whole, Color32::WHITE);
            }
            Some(TemplatePicture::Nothing) => {
                let color = style::quiet(ui.visuals());
                ui.painter().text(square.center(), Align2::CENTER_CENTER, "?", FontId::proportional(20.0), color);
            }
            None => {}
        }
    }
}

/// Draws a line of text below a picture, in its middle, and cut where it is wider.
fn line_below(ui: &Ui, square: Rect, distance: f32, text: &str, size: f32, color: Color32) {
    let mut job = LayoutJob::simple_singleline(text.to_owned(), FontId::proportional(size), color);
    job.wrap = TextWrapping::truncate_at_width(TILE);
    let galley = ui.painter().layout_job(job);
    let left = square.center().x - galley.size().x / 2.0;
    ui.painter().galley(pos2(left, square.bottom() + distance), galley, color);
}
