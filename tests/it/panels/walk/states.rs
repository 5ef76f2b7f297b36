//! All actions in states in which few of them can do anything: an empty document, a mesh alone, joints alone. Those that can do
//! nothing are greyed, and say so; those that are not greyed are not refused.

use rigsmith::editor::{
    notice::Severity,
    palette::obstacle,
    panels::{log::LogBook, timeline::TimelineAction},
    settings::{EditorSettings, UI_SCALES},
    tools::paint::brush::BrushAction,
};

use super::*;
use crate::gestures::boxes;

/// Actions that need nothing but a window and a document.
fn always() -> Vec<Action> {
    let others = [
        Action::New,
        Action::Open,
        Action::AddMesh,
        Action::Save,
        Action::SaveAs,
        Action::Quit,
        Action::Symmetry,
        Action::MoveChildren,
        Action::GizmoSpace,
        Action::ViewFront,
        Action::ViewBack,
        Action::ViewLeft,
        Action::ViewRight,
        Action::ViewTop,
        Action::ViewBottom,
        Action::Projection,
        Action::Grid,
        Action::Help,
        Action::Palette,
        Action::StartPage,
        Action::Theme,
        Action::Contrast,
    ];
    let of_library = [LibraryAction::Loader, LibraryAction::List, LibraryAction::Updater].map(Action::Library);
    Mode::ALL.into_iter().map(Action::Mode).chain(others).chain(of_library).collect()
}

/// Actions that can be done in each of the states, beside those that can be done always.
fn states() -> Vec<(&'static str, Vec<Action>)> {
    let brush = [
        BrushAction::Smaller,
        BrushAction::Larger,
        BrushAction::Weaker,
        BrushAction::Stronger,
        BrushAction::Add,
        BrushAction::Subtract,
        BrushAction::Replace,
        BrushAction::Smooth,
        BrushAction::Sharpen,
        BrushAction::Reach,
        BrushAction::AllJoints,
    ];
    let of_meshes = [
        Action::Export,
        Action::Fit,
        Action::FitPart,
        Action::FrameSelected,
        Action::FrameAll,
        Action::XRay,
        Action::Wireframe,
        Action::Meshes,
    ];
    let of_joints = [
        Action::Export,
        Action::Undo,
        Action::SelectAll,
        Action::StorePose,
        Action::FrameSelected,
        Action::FrameAll,
        Action::Labels,
        Action::LocalAxes,
        Action::Bones,
    ];
    let of_timeline =
        [TimelineAction::KeyAll, TimelineAction::AutoKey, TimelineAction::NewClip, TimelineAction::Import];
    let of_library = [
        LibraryAction::LoadSkeleton,
        LibraryAction::EditSkeleton,
        LibraryAction::BuildRig,
        LibraryAction::DeleteRig,
        LibraryAction::Save,
    ];
    let of_meshes = of_meshes.into_iter().chain(brush.map(Action::Brush));
    let of_rigs = of_timeline.map(Action::Timeline).into_iter().chain(of_library.map(Action::Library));
    vec![
        ("an empty document", Vec::new()),
        ("a mesh", of_meshes.collect()),
        ("joints", of_joints.into_iter().chain(of_rigs).collect()),
    ]
}

/// The app in a state, with nothing selected.
fn walk_in(state: &str) -> Walk {
    let mut walk = Walk::empty(Box::new(HierarchyPanel::default()), egui::vec2(360.0, 600.0));
    match state {
        "a mesh" => {
            let mesh = RigMesh::new(Uid(0xA1_0005), boxes(&[[[-1.2, 0.8, -0.2], [1.2, 1.2, 0.2]]]), Vec::new());
            walk.desk.app.world_mut().spawn((mesh, SkinOf(walk.desk.rig)));
        }
        "joints" => {
            walk.desk.chain(&["hips", "chest"]);
            walk.desk.select(&[]);
        }
        _ => {}
    }
    walk.rest();
    walk
}

#[test]
fn actions_that_can_do_nothing_are_greyed() {
    for (state, more) in states() {
        let walk = walk_in(state);
        let world = walk.desk.app.world();
        let is_size = |action: &Action| matches!(action, Action::UiLarger | Action::UiSmaller | Action::UiUsual);
        let free = Action::all().into_iter().filter(|action| !is_size(action) && obstacle(world, *action).is_none());
        let free: BTreeSet<String> = free.map(|action| format!("{action:?}")).collect();
        let wanted: BTreeSet<String> = always().into_iter().chain(more).map(|action| format!("{action:?}")).collect();
        let greyed: Vec<&String> = wanted.difference(&free).collect();
        let idle: Vec<&String> = free.difference(&wanted).collect();
        assert!(greyed.is_empty() && idle.is_empty(), "{state}: {greyed:?} are greyed, {idle:?} are not");
    }
}

/// Keys reach actions that are greyed, too: they change no document. Actions that are not greyed are not refused.
#[test]
fn actions_are_refused_exactly_where_they_are_greyed() {
    let refusals =
        ["no joint is selected", "nothing is selected", "there are no joints", "there is no mesh", "no mesh is open"];
    for (state, _) in states() {
        let mut wrong = Vec::new();
        let mut walk = walk_in(state);
        for action in Action::all() {
            // Fits take long and may fail for other reasons; the dialogs of files are walked over elsewhere.
            if OF_FILES.contains(&action) || matches!(action, Action::Fit | Action::FitPart) {
                continue;
            }
            let why_not = obstacle(walk.desk.app.world(), action);
            let book = walk.desk.app.world().resource::<LogBook>().next_number();
            let (before, steps) = (write_template(walk.desk.rig()), walk.desk.steps());
            walk.desk.app.world_mut().write_message(ActionRequest(action));
            walk.desk.frames(4);
            walk.rest();
            let is_changed = (write_template(walk.desk.rig()), walk.desk.steps()) != (before, steps);
            if why_not.is_some() && is_changed {
                wrong.push(format!("{action:?} is greyed and changes the document"));
            }
            let told = walk.desk.app.world().resource::<LogBook>().entries();
            let told = told.filter(|entry| entry.number >= book && entry.notice.severity != Severity::Done);
            for entry in told.filter(|_| why_not.is_none()) {
                let text = entry.notice.text.to_lowercase();
                if refusals.iter().any(|refusal| text.contains(refusal)) {
                    wrong.push(format!("{action:?} is not greyed, and refused: {text}"));
                }
            }
            // What an action left is none of the next one's.
            let leaves = matches!(
                action,
                Action::Mode(_)
                    | Action::Library(_)
                    | Action::Timeline(TimelineAction::Import | TimelineAction::AutoKey)
            );
            if leaves || is_changed || !walk.desk.selected().is_empty() {
                walk = walk_in(state);
            }
        }
        assert!(wrong.is_empty(), "{state}: {}", wrong.join("\n"));
    }
}

/// Sizes of the interface have a largest and a smallest one.
#[test]
fn sizes_of_the_interface_end() {
    let mut walk = walk_in("an empty document");
    let set = |walk: &mut Walk, ui_scale: f32| {
        walk.desk.app.insert_resource(EditorSettings { ui_scale, ..EditorSettings::default() });
    };
    for (scale, greyed) in [
        (1.0, [false, false, true]),
        (1.25, [false; 3]),
        (UI_SCALES[0], [false, true, false]),
        (UI_SCALES[UI_SCALES.len() - 1], [true, false, false]),
    ] {
        set(&mut walk, scale);
        let world = walk.desk.app.world();
        let now =
            [Action::UiLarger, Action::UiSmaller, Action::UiUsual].map(|action| obstacle(world, action).is_some());
        assert_eq!(now, greyed, "{scale}");
    }
}
