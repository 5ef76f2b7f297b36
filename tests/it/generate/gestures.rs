//! Lists of gestures: what a person does in a viewport, on joints that are there and on none.

use rigsmith::{algo::view::View, plugins::gesture::Gesture, rig::operations::Axis};

use super::{Choices, params::NAMES};

fn point(choices: &mut Choices) -> (f32, f32) {
    (choices.number() * 0.2, choices.number() * 0.2)
}

/// A list of gestures.
pub fn gestures(choices: &mut Choices) -> Vec<Gesture> {
    (0..1 + choices.below(24)).map(|_| gesture(choices)).collect()
}

/// One gesture.
pub fn gesture(choices: &mut Choices) -> Gesture {
    match choices.below(38) {
        0..=3 => Gesture::Click(point(choices)),
        4..=7 => {
            let points = (0..choices.below(7)).map(|_| point(choices)).collect();
            let threshold = choices.chance(3).then(|| choices.pick(&[0.02, 0.0, -1.0, 1e30]));
            let joints = choices.chance(4).then(|| choices.pick(&[2, 3, 0, 1, 40, usize::MAX]));
            Gesture::Stroke { points, threshold, joints }
        }
        8 => Gesture::View(choices.pick(&[
            View::Front,
            View::Back,
            View::Left,
            View::Right,
            View::Top,
            View::Bottom,
            View::Orbit(30.0, 20.0),
            View::Orbit(1e30, -400.0),
        ])),
        9 => Gesture::Depth(choices.pick(&[0.5, 0.0, 1.0, -7.0, 1e30])),
        10 => Gesture::Volume(choices.pick(&[0, 1, 2, u32::MAX])),
        11 => Gesture::Mirror(choices.chance(2)),
        12 => Gesture::Recentre(choices.chance(2)),
        13 => Gesture::Reach(choices.pick(&[0.05, 0.0, -1.0, 1e30])),
        14 | 15 => Gesture::Select(point(choices)),
        16 => Gesture::Add(point(choices)),
        17 => Gesture::Box(point(choices), point(choices)),
        18 => Gesture::SelectLabel(choices.pick(&NAMES).to_owned()),
        19 => Gesture::SelectAll,
        20 => Gesture::Deselect,
        21 => Gesture::Label(choices.pick(&NAMES).to_owned()),
        22 => Gesture::Labels((0..choices.below(4)).map(|_| choices.pick(&NAMES).to_owned()).collect()),
        23 => Gesture::Move(point(choices)),
        24 => {
            let to = choices.vector();
            Gesture::MoveTo((to.x, to.y, to.z))
        }
        25 => Gesture::Rotate(choices.number() * 40.0),
        26 => Gesture::Scale(choices.pick(&[1.5, 0.5, 1.0, 0.0, -1.0, 1e18, 1e-18])),
        27 => Gesture::Insert(point(choices)),
        28 => Gesture::Delete,
        29 => Gesture::DeleteHierarchy,
        30 => Gesture::Parent,
        31 => Gesture::Unparent,
        32 => Gesture::Orient(choices.pick(&[Axis::Y, Axis::X, Axis::Z])),
        33 => Gesture::MirrorSelected,
        34 => Gesture::Group(choices.pick(&NAMES).to_owned(), choices.chance(2).then_some((0.5, 0.25, 1.0))),
        35 => Gesture::Lock(choices.chance(2)),
        36 => Gesture::Redo,
        _ => Gesture::Undo,
    }
}
