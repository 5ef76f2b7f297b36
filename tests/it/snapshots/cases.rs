//! Table of all pictures: which panel or overlay, in which state, size and look.

use rigsmith::editor::{
    panel::EditorPanel,
    panels::{
        controls::ControlsPanel, curves::CurvesPanel, display::DisplayPanel, face::FacePanel, graph::GraphPanel,
        hierarchy::HierarchyPanel, history::HistoryPanel, loader::LoaderPanel, local_groups::GroupsPanel,
        log::LogPanel, poses::PosesPanel, process::ProcessPanel, properties::PropertiesPanel,
        selection_sets::SelectionSetsPanel, skinning::SkinningPanel, tags::TagsPanel, timeline::TimelinePanel,
        updater::UpdaterPanel, weights::WeightsPanel,
    },
    style::{Look, WindowTheme},
};

use super::{
    booth::{Booth, Frame, Step},
    lists, overlays,
    queries::Asked,
    states,
};

/// A picture that is taken.
#[derive(Clone)]
pub struct Case {
    /// Name of the picture in its group.
    pub name: String,
    pub what: PictureSubject,
    pub frame: Frame,
    /// Preparation of the state.
    pub before: fn(&mut Booth),
    /// Clicks and typed texts.
    pub steps: &'static [Step],
    pub asked: Asked,
    /// Width and height of the part of the picture that is kept, in pixels.
    pub kept: Option<[usize; 2]>,
}

#[derive(Clone, Copy)]
pub enum PictureSubject {
    Panel(fn() -> Box<dyn EditorPanel>),
    Toasts,
    Overlays,
    Window,
}

/// Cases that share an app.
pub struct Group {
    pub name: &'static str,
    pub booth: fn() -> Booth,
    pub cases: fn() -> Vec<Case>,
}

pub const GROUPS: [Group; 7] = [
    Group { name: "empty", booth: states::empty, cases: empty },
    Group { name: "typical", booth: states::typical, cases: typical },
    Group { name: "extreme", booth: states::extreme, cases: extreme },
    Group { name: "face", booth: states::head, cases: face },
    Group { name: "updater", booth: states::followed, cases: updater },
    Group { name: "lists", booth: lists::booth, cases: lists::cases },
    Group { name: "overlays", booth: states::empty, cases: overlays::cases },
];

const fn look(theme: WindowTheme, high_contrast: bool) -> Look {
    Look { theme, high_contrast }
}

pub const DARK: (&str, Look) = ("dark", look(WindowTheme::Dark, false));
pub const LIGHT: (&str, Look) = ("light", look(WindowTheme::Light, false));
pub const CONTRAST: (&str, Look) = ("contrast", look(WindowTheme::Dark, true));
pub const LIGHT_CONTRAST: (&str, Look) = ("light_contrast", look(WindowTheme::Light, true));

pub const ALL: Asked = Asked { names: true, apart: true, room: true };
pub const NAMES: Asked = Asked { names: true, apart: true, room: false };
/// Questions about the whole window: panels that stand side by side have fields of the same names.
pub const WHOLE: Asked = Asked { names: true, apart: false, room: false };

type Panel = (&'static str, fn() -> Box<dyn EditorPanel>);

fn of<P: EditorPanel + Default>() -> Box<dyn EditorPanel> {
    Box::new(P::default())
}

/// The panels beside the viewport.
const BESIDE: [Panel; 15] = [
    ("hierarchy", of::<HierarchyPanel>),
    ("loader", of::<LoaderPanel>),
    ("groups", of::<GroupsPanel>),
    ("process", of::<ProcessPanel>),
    ("properties", of::<PropertiesPanel>),
    ("tags", of::<TagsPanel>),
    ("controls", of::<ControlsPanel>),
    ("skinning", of::<SkinningPanel>),
    ("weights", of::<WeightsPanel>),
    ("face", of::<FacePanel>),
    ("history", of::<HistoryPanel>),
    ("updater", of::<UpdaterPanel>),
    ("poses", of::<PosesPanel>),
    ("sets", of::<SelectionSetsPanel>),
    ("display", of::<DisplayPanel>),
];

/// The panels below the viewport.
const BELOW: [Panel; 4] = [
    ("timeline", of::<TimelinePanel>),
    ("curves", of::<CurvesPanel>),
    ("graph", of::<GraphPanel>),
    ("log", of::<LogPanel>),
];

/// Sizes of a tab beside the viewport and below it, in windows of 1280x720 and 1024x600.
const WIDE: [[u16; 2]; 2] = [[252, 440], [777, 200]];
const NARROW: [[u16; 2]; 2] = [[194, 360], [622, 110]];

fn panel((name, panel): Panel, (look_name, look): (&str, Look), size: [u16; 2], asked: Asked) -> Case {
    // Keys, wires and curves go on beyond what is seen of them.
    let is_scrolled = ["timeline", "curves", "graph"].contains(&name);
    Case {
        name: format!("{name}_{look_name}_{}", size[0]),
        what: PictureSubject::Panel(panel),
        frame: Frame { size, scale: 1.0, look },
        before: states::as_it_is,
        steps: &[],
        asked: Asked {
            names: asked.names,
            // Commands of one module on one joint are the same for the graph.
            apart: asked.apart && name != "graph",
            room: asked.room && !is_scrolled,
        },
        kept: None,
    }
}

fn panels(look: (&str, Look), sizes: [[u16; 2]; 2], asked: Asked) -> impl Iterator<Item = Case> {
    let beside = BESIDE.into_iter().map(move |of| (of, sizes[0]));
    let below = BELOW.into_iter().map(move |of| (of, sizes[1]));
    let cases: Vec<Case> = beside.chain(below).map(|(of, size)| panel(of, look, size, asked)).collect();
    cases.into_iter()
}

fn found(name: &str) -> Panel {
    let mut all = BESIDE.into_iter().chain(BELOW);
    all.find(|(known, _)| *known == name).unwrap_or_else(|| panic!("{name} is no panel"))
}

/// Larger interfaces: three halves of the usual pixels for each point.
fn scaled(name: &str, look: (&str, Look), size: [u16; 2]) -> Case {
    let case = panel(found(name), look, size, ALL);
    Case { name: format!("{}_large", case.name), frame: Frame { scale: 1.5, ..case.frame }, ..case }
}

fn empty() -> Vec<Case> {
    panels(DARK, NARROW, ALL).chain(panels(LIGHT, WIDE, ALL)).collect()
}

/// A panel in another state than it begins in.
pub fn varied(name: &str, variant: &str, height: u16, before: fn(&mut Booth), steps: &'static [Step]) -> Case {
    let case = panel(found(name), DARK, [252, height], ALL);
    Case { name: format!("{name}_{variant}"), before, steps, ..case }
}

/// A panel below the viewport with room for a menu, in another state than it begins in.
fn wide(name: &str, variant: &str, before: fn(&mut Booth), steps: &'static [Step]) -> Case {
    let case = panel(found(name), DARK, [777, 600], ALL);
    Case { name: format!("{name}_{variant}"), before, steps, ..case }
}

fn typical() -> Vec<Case> {
    let mut cases: Vec<Case> =
        panels(DARK, WIDE, ALL).chain(panels(LIGHT, NARROW, ALL)).chain(panels(CONTRAST, WIDE, ALL)).collect();
    for name in ["hierarchy", "properties", "weights", "skinning", "history", "display"] {
        cases.push(scaled(name, DARK, WIDE[0]));
        cases.push(panel(found(name), LIGHT_CONTRAST, WIDE[0], ALL));
    }
    for name in ["timeline", "log"] {
        cases.push(scaled(name, DARK, WIDE[1]));
    }
    cases.extend(windows());
    cases.extend([
        varied("skinning", "settings", 560, states::as_it_is, &[Step::Click("Settings")]),
        varied("hierarchy", "filtered", 300, states::as_it_is, &[Step::Click("Filter"), Step::Type("hand")]),
        varied("hierarchy", "nothing_found", 300, states::as_it_is, &[Step::Click("Filter"), Step::Type("no such")]),
        varied("log", "searched", 200, states::as_it_is, &[Step::Click("Search"), Step::Type("face")]),
        varied("controls", "selected", 700, states::select_control, &[]),
        varied("properties", "unselected", 300, states::select_nothing, &[]),
        varied("tags", "unselected", 300, states::select_nothing, &[]),
        varied("properties", "posing", 440, states::pose_mode, &[]),
        varied("loader", "part", 900, states::choose_part, &[]),
        varied("loader", "save", 1100, states::as_it_is, &[Step::Click("Save as template")]),
        wide("timeline", "menu", states::as_it_is, &[Step::Click("Menu of the clip")]),
        // Its key is the last change of the document that the pictures are of.
        wide("timeline", "row_menu", states::key_hand, &[Step::Menu("hand_ik_l")]),
    ]);
    // The menu of keys is higher than the panel.
    let menu = wide("timeline", "keys_menu", states::as_it_is, &[Step::Menu("All keys")]);
    cases.push(Case { frame: Frame { size: [menu.frame.size[0], 760], ..menu.frame }, ..menu });
    cases
}

fn extreme() -> Vec<Case> {
    let mut cases: Vec<Case> =
        panels(DARK, WIDE, NAMES).chain(panels(CONTRAST, NARROW, NAMES)).chain(extreme_windows()).collect();
    let parts = varied("skinning", "parts", 560, states::as_it_is, &[Step::Click("Parts (")]);
    let first_values = varied("tags", "values", 700, states::select_first, &[Step::Click("Values of control")]);
    let part = varied("loader", "part", 1100, states::choose_part, &[]);
    cases.extend([parts, first_values, part].map(|case| Case { asked: NAMES, ..case }));
    cases
}

fn face() -> Vec<Case> {
    let tall = |look: (&'static str, Look)| panel(found("face"), look, [252, 760], ALL);
    vec![
        tall(DARK),
        tall(LIGHT),
        panel(found("face"), CONTRAST, NARROW[0], ALL),
        varied("face", "settings", 520, states::as_it_is, &[Step::Click("Settings")]),
        varied("face", "grouping", 520, states::as_it_is, &[Step::Click("Grouping")]),
    ]
}

fn updater() -> Vec<Case> {
    let of = |variant: &str, look, size, before| {
        let case = panel(found("updater"), look, size, ALL);
        Case { name: format!("{}_{variant}", case.name), before, ..case }
    };
    vec![
        of("same", DARK, WIDE[0], states::as_it_is),
        of("same", LIGHT, NARROW[0], states::as_it_is),
        of("conflicts", DARK, WIDE[0], states::make_conflicts),
        of("conflicts", LIGHT, NARROW[0], states::as_it_is),
        of("conflicts", CONTRAST, WIDE[0], states::as_it_is),
    ]
}

/// The whole window.
pub fn whole(name: &str, (look_name, look): (&str, Look), size: [u16; 2]) -> Case {
    Case {
        name: format!("{name}_{look_name}_{}", size[0]),
        what: PictureSubject::Window,
        frame: Frame { size, scale: 1.0, look },
        before: states::as_it_is,
        steps: &[],
        asked: WHOLE,
        kept: None,
    }
}

pub const LARGE: [u16; 2] = [1280, 720];
pub const SMALL: [u16; 2] = [1024, 600];

fn windows() -> Vec<Case> {
    let mut cases: Vec<Case> = [DARK, LIGHT, CONTRAST, LIGHT_CONTRAST]
        .into_iter()
        .flat_map(|look| [whole("window", look, LARGE), whole("window", look, SMALL)])
        .collect();
    let larger = whole("window_large", DARK, [853, 480]);
    cases.push(Case { frame: Frame { scale: 1.5, ..larger.frame }, ..larger });
    let menus: [(&str, &'static [Step]); 9] = [
        ("file", &[Step::Click("File")]),
        ("edit", &[Step::Click("Edit")]),
        ("mode", &[Step::Click("Mode")]),
        ("rig", &[Step::Click("Rig")]),
        ("library", &[Step::Click("Library")]),
        ("animate", &[Step::Click("Animate")]),
        ("view", &[Step::Click("View")]),
        ("window", &[Step::Click("Window")]),
        ("help", &[Step::Click("Help")]),
    ];
    for (name, steps) in menus {
        let case = whole(&format!("menu_{name}"), DARK, LARGE);
        cases.push(Case { steps, kept: Some([560, 640]), ..case });
    }
    cases
}

fn extreme_windows() -> Vec<Case> {
    vec![whole("window", DARK, LARGE), whole("window", LIGHT, SMALL), whole("window", CONTRAST, SMALL)]
}
