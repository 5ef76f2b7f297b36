//! Onion skin: the skeleton as the open clip has it before and after the playhead, as thin lines over the viewport.

use bevy::prelude::*;
use bevy_egui::egui::{Color32, Painter, Rect, Stroke, pos2};

use super::{
    actions::{Action, ActionRequest},
    camera::ViewportSight,
    counts::counted,
    files::attend,
    panel::{PanelApp, ViewportPainter},
    panels::{
        poses::put_clip,
        timeline::{OpenClip, key_times},
    },
    skeleton_lines::bones,
};
use crate::{
    plugins::runtime::RigRuntime,
    rig::{animation::RigClip, operations::WholePose},
    solve::program::ContentHash,
};

/// Plugin of the onion skin, which is off at first.
pub struct OnionPlugin;

impl Plugin for OnionPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<OnionSkin>()
            .add_message::<ActionRequest>()
            .add_painter(OnionPainter::default())
            .add_systems(Update, toggle.after(attend));
    }
}

/// Poses that are shown beside the current one.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq)]
pub struct OnionSkin {
    /// True to show them.
    pub on: bool,
    /// Number of poses before the playhead, and of those after it.
    pub count: usize,
    /// Distance from one to the next.
    pub step: OnionStep,
}

impl Default for OnionSkin {
    fn default() -> Self {
        Self { on: false, count: 2, step: OnionStep::Frames(5) }
    }
}

/// Distance between poses of the onion skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnionStep {
    /// A number of frames.
    Frames(u32),
    /// The way from key to key.
    Keys,
}

impl OnionStep {
    /// Distances that people choose from.
    pub const ALL: [Self; 4] = [Self::Frames(1), Self::Frames(5), Self::Frames(10), Self::Keys];

    /// The name in the Display panel.
    pub fn name(self) -> String {
        match self {
            Self::Frames(count) => counted(count as usize, "frame", "frames"),
            Self::Keys => "Keys".to_owned(),
        }
    }
}

/// Numbers of poses that people choose from.
pub const ONION_COUNTS: [usize; 4] = [1, 2, 3, 5];

/// Skeleton at another moment of the clip.
#[derive(Debug, Clone, PartialEq)]
pub struct OnionGhost {
    /// Second of the clip.
    pub time: f32,
    /// Place from the playhead: -1 is the one before it, 1 the one after.
    pub place: i32,
    /// Bones in the rig's space.
    pub bones: Vec<[Vec3; 2]>,
}

fn toggle(mut actions: MessageReader<ActionRequest>, mut skin: ResMut<OnionSkin>) {
    for ActionRequest(action) in actions.read() {
        if *action == Action::OnionSkin {
            skin.on = !skin.on;
        }
    }
}

/// Moments of the onion skin, with their places from the playhead; those outside of the clip's range are left out.
pub fn onion_times(clip: &RigClip, time: f32, skin: &OnionSkin) -> Vec<(i32, f32)> {
    let near = 0.01 / clip.frame_rate;
    let place = |number: usize| i32::try_from(number + 1).unwrap_or(i32::MAX);
    let mut times: Vec<(i32, f32)> = match skin.step {
        OnionStep::Keys => {
            let keys = key_times(clip, &[]);
            let before = keys.iter().rev().filter(|key| **key < time - near).take(skin.count).enumerate();
            let after = keys.iter().filter(|key| **key > time + near).take(skin.count).enumerate();
            let before = before.map(|(number, key)| (-place(number), *key));
            before.chain(after.map(|(number, key)| (place(number), *key))).collect()
        }
        OnionStep::Frames(frames) => {
            let step = frames.max(1) as f32 / clip.frame_rate;
            let places = (0..skin.count).flat_map(|number| [-place(number), place(number)]);
            places.map(|place| (place, time + place as f32 * step)).collect()
        }
    };
    let [start, end] = clip.range;
    times.retain(|(_, time)| *time >= start - near && *time <= end + near);
    times.sort_by_key(|(place, _)| *place);
    times
}

/// Ghosts of the open clip; none while the onion skin is off.
pub fn onion_ghosts(world: &World) -> Vec<OnionGhost> {
    let Some((open, skin)) = wanted(world) else { return Vec::new() };
    let runtime = world.get::<RigRuntime>(open.entity);
    let own = WholePose::of(open.rig);
    let ghost = |(place, time): (i32, f32)| {
        let mut pose = own.clone();
        put_clip(&mut pose, open.clip, time);
        OnionGhost { time, place, bones: bones(open.rig, runtime, &pose) }
    };
    onion_times(open.clip, moment(&open), &skin).into_iter().map(ghost).collect()
}

fn wanted(world: &World) -> Option<(OpenClip<'_>, OnionSkin)> {
    let skin = *world.get_resource::<OnionSkin>().filter(|skin| skin.on)?;
    Some((OpenClip::of(world)?, skin))
}

/// Second of the frame at the playhead: between two frames the ghosts stay.
fn moment(open: &OpenClip) -> f32 {
    (f64::from(open.frame().floor()) / f64::from(open.clip.frame_rate)) as f32
}

/// Painter of the ghosts, which are made again only after a change.
#[derive(Default)]
struct OnionPainter {
    ghosts: Vec<OnionGhost>,
    made_from: Option<MadeFrom>,
}

/// Values that the ghosts follow from.
#[derive(Clone, PartialEq)]
struct MadeFrom {
    clip: RigClip,
    own: WholePose,
    times: Vec<(i32, f32)>,
    program: Option<ContentHash>,
}

impl ViewportPainter for OnionPainter {
    fn paint(&mut self, painter: &Painter, area: Rect, world: &World) {
        let Some((open, skin)) = wanted(world) else {
            (self.made_from, self.ghosts) = (None, Vec::new());
            return;
        };
        let made_from = MadeFrom {
            clip: open.clip.clone(),
            own: WholePose::of(open.rig),
            times: onion_times(open.clip, moment(&open), &skin),
            program: world.get::<RigRuntime>(open.entity).map(|runtime| runtime.state().hash()),
        };
        if self.made_from.as_ref() != Some(&made_from) {
            self.ghosts = onion_ghosts(world);
            self.made_from = Some(made_from);
        }
        let Some(sight) = world.get_resource::<ViewportSight>().and_then(|sight| sight.0) else { return };
        for ghost in &self.ghosts {
            let stroke = Stroke::new(1.5, color(ghost.place, skin.count));
            for ends in &ghost.bones {
                let [Some(a), Some(b)] = ends.map(|end| sight.project(end)) else { continue };
                let at = |pixel: Vec2| pos2(area.left() + pixel.x, area.top() + pixel.y);
                painter.line_segment([at(a), at(b)], stroke);
            }
        }
    }
}

/// Colour of a ghost: blue before the playhead, green after it, fainter with the distance.
fn color(place: i32, count: usize) -> Color32 {
    let far = place.unsigned_abs() as f32 / (count.max(1) as f32 + 1.0);
    let base = if place < 0 { Color32::from_rgb(96, 160, 255) } else { Color32::from_rgb(110, 210, 120) };
    base.gamma_multiply(0.75 * (1.0 - far) + 0.15)
}
