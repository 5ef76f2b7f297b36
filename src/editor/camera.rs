//! The camera of the viewport: it orbits a point, and keeps the position that the user chose.
//!
//! | | mouse | trackpad | pen |
//! | --- | --- | --- | --- |
//! | orbit | middle drag, or Alt and left drag | two fingers | Alt and drag |
//! | pan | right drag, or Shift and middle drag | Shift and two fingers | Alt, Shift and drag |
//! | zoom | wheel, or Alt and right drag | Control and two fingers, or pinch | wheel |
//!
//! Wheel and pinch zoom to the pointer: what is under the pointer stays there. A drag zooms to the middle.
//!
//! A view of the whole figure leaves room for the bars over the lower edge of the viewport, and makes room for a bar that comes
//! later, as long as nobody has turned or moved the view.

use bevy::{
    camera::{Viewport, visibility::RenderLayers},
    input::mouse::{AccumulatedMouseScroll, MouseScrollUnit},
    math::ops,
    prelude::*,
    window::PrimaryWindow,
};
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin, PanOrbitCameraSystemSet, TrackpadBehavior};

use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    pointer::{PointerState, ViewportArea, WheelUse},
    viewport_bars::ViewportBars,
};
use crate::{
    algo::view::View,
    plugins::{
        display::ViewportLights,
        document::{JointEntities, Selection},
        drawing::BACKGROUND,
        surface::RigSurface,
        viewport::{FIELD_OF_VIEW, RigViewport, Sight, framing_beside, zoom_shift},
    },
    rig::{Rig, project::ProjectCamera},
};

/// Adds the viewport's camera.
pub struct CameraPlugin;

impl Plugin for CameraPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(PanOrbitCameraPlugin)
            .init_resource::<ViewportSight>()
            .init_resource::<FrameWhenReady>()
            .init_resource::<LastFraming>()
            .init_resource::<ViewportBars>()
            .init_resource::<ZoomStart>()
            .add_systems(Startup, spawn_camera)
            .add_systems(PreUpdate, see.after(super::pointer::follow_pointer))
            .add_systems(Update, (carry_out, frame_when_ready, make_room).chain())
            .add_systems(
                PostUpdate,
                (
                    (steer, pace_zoom, fit_viewport, start_zoom).chain().before(PanOrbitCameraSystemSet),
                    (zoom_to_pointer, keep_depths)
                        .chain()
                        .after(PanOrbitCameraSystemSet)
                        .before(TransformSystems::Propagate),
                ),
            );
    }
}

/// View of the active rig through the viewport's camera; `None` without a camera or rig.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewportSight(pub Option<Sight>);

/// Request to frame the whole character as soon as it is loaded, set after a file was opened.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameWhenReady(pub bool);

/// View that a box was framed in last, with the lasting bars that it leaves room for; `None` before the first.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
struct LastFraming(Option<Framing>);

#[derive(Debug, Clone, PartialEq)]
struct Framing {
    bounds: [Vec3; 2],
    bars: Vec<Rect>,
    focus: Vec3,
    radius: f32,
    angles: [f32; 2],
}

impl Framing {
    /// True while the camera is where the framing has put it.
    fn is_seen_by(&self, camera: &PanOrbitCamera) -> bool {
        self.focus == camera.target_focus
            && self.radius == camera.target_radius
            && self.angles == [camera.target_yaw, camera.target_pitch]
    }
}

/// Distance of the camera from its focus before the wheel of the frame; `None` before the first frame.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Default)]
struct ZoomStart(Option<f32>);

fn spawn_camera(mut commands: Commands) {
    commands.spawn((
        Camera3d::default(),
        Camera { clear_color: ClearColorConfig::Custom(BACKGROUND), ..default() },
        ViewportLights::default().bundle(),
        RigViewport::default(),
        Projection::Perspective(PerspectiveProjection { fov: FIELD_OF_VIEW, ..default() }),
        Transform::from_xyz(0.0, 1.0, 4.0).looking_at(Vec3::Y, Vec3::Y),
        RenderLayers::layer(0),
        PanOrbitCamera {
            focus: Vec3::Y,
            orbit_smoothness: 0.0,
            pan_smoothness: 0.0,
            zoom_smoothness: 0.0,
            button_orbit: MouseButton::Middle,
            button_pan: MouseButton::Right,
            trackpad_behavior: TrackpadBehavior::blender_default(),
            trackpad_pinch_to_zoom_enabled: true,
            zoom_lower_limit: 1e-4,
            ..default()
        },
    ));
}

/// Updates [`ViewportSight`] after the last frame's transforms have propagated, before tools read it.
pub(super) fn see(
    cameras: Query<(&GlobalTransform, &Projection, &RigViewport), With<PanOrbitCamera>>,
    rig: Option<Res<ActiveRig>>,
    places: Query<&GlobalTransform>,
    area: Res<ViewportArea>,
    mut sight: ResMut<ViewportSight>,
) {
    let place = rig.and_then(|rig| places.get(rig.0).ok()).copied().unwrap_or_default();
    let next = cameras
        .single()
        .ok()
        .and_then(|(camera, projection, viewport)| Sight::new(camera, projection, viewport, area.size, &place));
    sight.set_if_neq(ViewportSight(next));
}

/// Carries out changes of view, framing and projection.
fn carry_out(
    mut actions: MessageReader<ActionRequest>,
    mut cameras: Query<(&mut PanOrbitCamera, &mut Projection)>,
    rig: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &Selection, &JointEntities, &GlobalTransform, Option<&RigSurface>)>,
    places: Query<&GlobalTransform>,
    (area, bars): (Res<ViewportArea>, Res<ViewportBars>),
    mut framing: ResMut<LastFraming>,
) {
    for ActionRequest(action) in actions.read() {
        let Ok((mut camera, mut projection)) = cameras.single_mut() else { continue };
        let found = rig.as_ref().and_then(|rig| rigs.get(rig.0).ok());
        match action {
            Action::ViewFront => turn(&mut camera, View::Front),
            Action::ViewBack => turn(&mut camera, View::Back),
            Action::ViewLeft => turn(&mut camera, View::Left),
            Action::ViewRight => turn(&mut camera, View::Right),
            Action::ViewTop => turn(&mut camera, View::Top),
            Action::ViewBottom => turn(&mut camera, View::Bottom),
            Action::Projection => {
                *projection = projected(matches!(&*projection, Projection::Perspective(_)));
                camera.force_update = true;
            }
            Action::FrameSelected | Action::FrameAll => {
                let Some((data, selection, entities, place, surface)) = found else { continue };
                let joints = selection.0.iter().filter_map(|joint| places.get(entities.get(*joint)?).ok());
                let points: Vec<Vec3> = joints.map(GlobalTransform::translation).collect();
                let bounds = match (*action, points.as_slice()) {
                    (Action::FrameSelected, [first, rest @ ..]) => {
                        let around = rest.iter().fold([*first; 2], |[low, high], p| [low.min(*p), high.max(*p)]);
                        let margin = surface.map_or(0.1, |surface| extent(surface.bounds()) * 0.08);
                        [around[0] - margin, around[1] + margin]
                    }
                    _ => everything(surface, place, data, entities, &places),
                };
                framing.0 = Some(frame(&mut camera, bounds, area.size, &bars));
            }
            _ => {}
        }
    }
}

/// The orthographic or the perspective projection.
fn projected(orthographic: bool) -> Projection {
    if orthographic {
        Projection::Orthographic(OrthographicProjection {
            scaling_mode: bevy::camera::ScalingMode::FixedVertical {
                viewport_height: 2.0 * bevy::math::ops::tan(FIELD_OF_VIEW * 0.5),
            },
            ..OrthographicProjection::default_3d()
        })
    } else {
        Projection::Perspective(PerspectiveProjection { fov: FIELD_OF_VIEW, ..default() })
    }
}

/// Position of the camera in the form that projects store.
pub fn kept(orbit: &PanOrbitCamera, projection: &Projection) -> ProjectCamera {
    ProjectCamera {
        yaw: orbit.target_yaw,
        pitch: orbit.target_pitch,
        distance: orbit.target_radius,
        focus: orbit.target_focus,
        orthographic: matches!(projection, Projection::Orthographic(_)),
    }
}

/// Restores the camera's position from a project.
pub fn take(kept: &ProjectCamera, orbit: &mut PanOrbitCamera, projection: &mut Projection) {
    orbit.target_yaw = kept.yaw;
    orbit.target_pitch = kept.pitch;
    orbit.target_radius = kept.distance.max(1e-3);
    orbit.target_focus = kept.focus;
    limit_zoom(orbit);
    orbit.force_update = true;
    if matches!(projection, Projection::Orthographic(_)) != kept.orthographic {
        *projection = projected(kept.orthographic);
    }
}

/// Room about joints without a mesh, for controls and bones, as a part of the largest side of their bounds.
const ROOM: f32 = 0.06;

/// Bounds in world space of a rig's surface, or of its joints with some room for controls; a cube of one unit without either.
fn everything(
    surface: Option<&RigSurface>,
    place: &GlobalTransform,
    rig: &Rig,
    entities: &JointEntities,
    places: &Query<&GlobalTransform>,
) -> [Vec3; 2] {
    if let Some(surface) = surface {
        let [low, high] = surface.bounds();
        let corners = (0..8).map(|bits: u32| {
            let pick = |bit: u32, low: f32, high: f32| if bits & bit == 0 { low } else { high };
            place.transform_point(Vec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z)))
        });
        return around(corners);
    }
    let joints = rig.walk().filter_map(|joint| places.get(entities.get(joint.data.uid)?).ok());
    let [low, high] = around(joints.map(GlobalTransform::translation));
    let room = ROOM * (high - low).max_element();
    [low - room, high + room]
}

fn around(points: impl Iterator<Item = Vec3>) -> [Vec3; 2] {
    let bounds = points.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)]);
    if bounds[0].is_finite() { bounds } else { [Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5)] }
}

fn extent([low, high]: [Vec3; 2]) -> f32 {
    (high - low).max_element().max(1e-6)
}

/// Turns the camera about its focus.
fn turn(camera: &mut PanOrbitCamera, view: View) {
    let (yaw, pitch) = angles(view);
    camera.target_yaw = yaw;
    camera.target_pitch = pitch;
    camera.force_update = true;
}

/// Yaw and pitch in radians of a view.
pub fn angles(view: View) -> (f32, f32) {
    use std::f32::consts::{FRAC_PI_2, PI};
    match view {
        View::Front => (0.0, 0.0),
        View::Back => (PI, 0.0),
        View::Left => (FRAC_PI_2, 0.0),
        View::Right => (-FRAC_PI_2, 0.0),
        View::Top => (0.0, FRAC_PI_2),
        View::Bottom => (0.0, -FRAC_PI_2),
        View::Orbit(yaw, pitch) => (yaw.to_radians(), pitch.to_radians()),
    }
}

/// Moves the camera so that a box fills the viewport beside its bars, in the current view direction.
fn frame(camera: &mut PanOrbitCamera, bounds: [Vec3; 2], size: Vec2, bars: &ViewportBars) -> Framing {
    let angles = [camera.target_yaw, camera.target_pitch];
    let [yaw, pitch] = angles.map(f32::to_degrees);
    let (focus, radius) = framing_beside(bounds, View::Orbit(yaw, pitch).axes(), size, &bars.all());
    camera.target_focus = focus;
    camera.target_radius = radius;
    limit_zoom(camera);
    camera.force_update = true;
    Framing { bounds, bars: bars.lasting.clone(), focus, radius, angles }
}

/// Frames the box of the last framing anew where a bar came or went since then, unless a person has moved the view or drags.
fn make_room(
    mut framing: ResMut<LastFraming>,
    mut cameras: Query<&mut PanOrbitCamera>,
    (area, bars, pointer): (Res<ViewportArea>, Res<ViewportBars>, Res<PointerState>),
) {
    let Some(last) = framing.0.as_ref().filter(|last| last.bars != bars.lasting) else { return };
    let Ok(mut camera) = cameras.single_mut() else { return };
    if pointer.is_busy() || area.size.x < 1.0 {
        return;
    }
    let bounds = last.bounds;
    framing.0 = last.is_seen_by(&camera).then(|| frame(&mut camera, bounds, area.size, &bars));
}

/// Least and greatest distance to the focus, in parts of the distance at which something fills the view.
const ZOOM: [f32; 2] = [0.01, 50.0];

/// Keeps the wheel between a close look at what is in view, which ends before joints and surfaces are behind the camera, and
/// a distance at which it can still be found.
fn limit_zoom(camera: &mut PanOrbitCamera) {
    let [least, most] = ZOOM.map(|part| camera.target_radius * part);
    camera.zoom_lower_limit = least.max(1e-4);
    camera.zoom_upper_limit = Some(most);
}

/// Frames the whole character once the mesh of an opened file is loaded.
fn frame_when_ready(
    mut wanted: ResMut<FrameWhenReady>,
    rig: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &JointEntities, &GlobalTransform, Option<&RigSurface>)>,
    places: Query<&GlobalTransform>,
    mut cameras: Query<&mut PanOrbitCamera>,
    (area, bars): (Res<ViewportArea>, Res<ViewportBars>),
    mut framing: ResMut<LastFraming>,
) {
    if !wanted.0 || area.size.x < 1.0 {
        return;
    }
    let Some((data, entities, place, surface)) = rig.and_then(|rig| rigs.get(rig.0).ok()) else { return };
    let Ok(mut camera) = cameras.single_mut() else { return };
    if surface.is_none() && data.is_empty() {
        return;
    }
    let bounds = everything(surface, place, data, entities, &places);
    framing.0 = Some(frame(&mut camera, bounds, area.size, &bars));
    wanted.0 = false;
}

/// Assigns the mouse buttons to the camera, and withholds the wheel while a tool uses it.
fn steer(
    mut cameras: Query<&mut PanOrbitCamera>,
    area: Res<ViewportArea>,
    wheel: Res<WheelUse>,
    pointer: Res<PointerState>,
    keys: Res<ButtonInput<KeyCode>>,
) {
    let Ok(mut camera) = cameras.single_mut() else { return };
    let alt = keys.any_pressed([KeyCode::AltLeft, KeyCode::AltRight]);
    let shift = keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]);
    let control = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    let (orbit, pan, zoom) = match (alt, shift) {
        (true, false) => (MouseButton::Left, MouseButton::Middle, Some(MouseButton::Right)),
        (true, true) => (MouseButton::Middle, MouseButton::Left, Some(MouseButton::Right)),
        (false, true) => (MouseButton::Other(0), MouseButton::Middle, None),
        (false, false) => (MouseButton::Middle, MouseButton::Right, None),
    };
    let wheel_free = *wheel == WheelUse::Zoom || control;
    let enabled = !pointer.is_captured() && (pointer.is_camera() || (area.pointer.is_some() && wheel_free));
    if camera.enabled != enabled || (camera.button_orbit, camera.button_pan, camera.button_zoom) != (orbit, pan, zoom) {
        camera.enabled = enabled;
        camera.button_orbit = orbit;
        camera.button_pan = pan;
        camera.button_zoom = zoom;
    }
}

/// Part of the distance to the focus that one notch of the wheel leaves.
const NOTCH: f32 = 0.8;
/// Notches a pixel of a trackpad's scrolling, as the camera counts them.
const PIXEL: f32 = 0.005;
/// Part of the distance that the camera takes for a notch at a sensitivity of 1.
const TAKEN: f32 = 0.2;

/// Makes several notches of one frame go as far as the same notches of as many frames. The camera adds the notches of a frame
/// up, so that five of them, which a fast hand or a slow frame brings together, end at the nearest distance that is allowed.
fn pace_zoom(mut cameras: Query<&mut PanOrbitCamera>, scroll: Res<AccumulatedMouseScroll>) {
    let notches = match scroll.unit {
        MouseScrollUnit::Line => scroll.delta.y,
        MouseScrollUnit::Pixel => scroll.delta.y * PIXEL,
    };
    let sensitivity = zoom_sensitivity(notches);
    for mut camera in &mut cameras {
        if camera.zoom_sensitivity != sensitivity {
            camera.zoom_sensitivity = sensitivity;
        }
    }
}

/// Sensitivity at which some notches, added up, leave [`NOTCH`] of the distance each.
fn zoom_sensitivity(notches: f32) -> f32 {
    let sensitivity = (1.0 - ops::powf(NOTCH, notches)) / (TAKEN * notches);
    if sensitivity.is_finite() { sensitivity } else { 1.0 }
}

/// Notes the distance to the focus before the camera takes the input of the frame.
fn start_zoom(cameras: Query<&PanOrbitCamera>, mut start: ResMut<ZoomStart>) {
    let camera = cameras.single().ok().filter(|camera| camera.initialized);
    start.set_if_neq(ZoomStart(camera.map(|camera| camera.target_radius)));
}

/// Moves a camera that has zoomed across its view, so that what is under the pointer stays there.
fn zoom_to_pointer(
    start: Res<ZoomStart>,
    (area, pointer): (Res<ViewportArea>, Res<PointerState>),
    mut cameras: Query<(&mut PanOrbitCamera, &mut Transform)>,
) {
    let (Some(start), Some(at)) = (start.0, area.pointer) else { return };
    let Ok((mut camera, mut place)) = cameras.single_mut() else { return };
    let approach = start - camera.target_radius;
    if approach == 0.0 || pointer.is_camera() {
        return;
    }
    let shift = zoom_shift([*place.right(), *place.up()], at, area.size, approach);
    camera.target_focus += shift;
    camera.focus += shift;
    place.translation += shift;
}

/// Restricts drawing to the part of the window that the panels leave free.
fn fit_viewport(
    area: Res<ViewportArea>,
    windows: Query<&Window, With<PrimaryWindow>>,
    mut cameras: Query<&mut Camera, With<PanOrbitCamera>>,
) {
    let (Ok(window), Ok(mut camera)) = (windows.single(), cameras.single_mut()) else { return };
    let limit = UVec2::new(window.physical_width(), window.physical_height());
    let scale = if area.scale > 0.0 { area.scale } else { 1.0 };
    let min = (area.min * scale).round().max(Vec2::ZERO).as_uvec2().min(limit);
    let max = ((area.min + area.size) * scale).round().max(Vec2::ZERO).as_uvec2().min(limit);
    if max.cmple(min).any() {
        if camera.is_active {
            camera.is_active = false;
        }
        return;
    }
    let (position, size) = (min, max - min);
    let same = camera.viewport.as_ref().is_some_and(|v| v.physical_position == position && v.physical_size == size);
    if !same || !camera.is_active {
        camera.is_active = true;
        camera.viewport = Some(Viewport { physical_position: position, physical_size: size, ..default() });
    }
}

/// Updates the distance to the focus, and keeps the clipping planes beyond the whole scene.
fn keep_depths(
    mut cameras: Query<(&mut PanOrbitCamera, &Transform, &mut Projection, &mut RigViewport), Changed<Transform>>,
) {
    for (mut orbit, place, mut projection, mut viewport) in &mut cameras {
        let focus = place.translation.distance(orbit.focus).max(1e-6);
        if viewport.focus != focus {
            viewport.focus = focus;
        }
        let changed = |now: f32, wanted: f32| now < 0.7 * wanted || now > 1.3 * wanted;
        let next = match &*projection {
            Projection::Perspective(perspective) => {
                let near = (focus * 0.01).clamp(1e-5, 0.1);
                let next = PerspectiveProjection { near, far: near * 1e6, ..perspective.clone() };
                changed(perspective.near, near).then_some(Projection::Perspective(next))
            }
            Projection::Orthographic(orthographic) => {
                // The camera is in the middle between the planes: far enough not to cut into the mesh.
                let framed = orbit.zoom_upper_limit.unwrap_or_default() * 0.1;
                let far = 2.0 * framed.max(orbit.target_radius * 5.0);
                let next = OrthographicProjection { near: 0.0, far, ..orthographic.clone() };
                changed(orthographic.far, far).then_some(Projection::Orthographic(next))
            }
            Projection::Custom(_) => None,
        };
        if let Some(next) = next {
            *projection = next;
            orbit.force_update = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notches_of_one_frame_go_as_far_as_those_of_many() {
        let left = |notches: f32| 1.0 - TAKEN * notches * zoom_sensitivity(notches);
        for notches in 1..=40 {
            let one_by_one = (0..notches).fold([1.0; 2], |[near, far], _| [near * left(1.0), far * left(-1.0)]);
            let at_once = [left(notches as f32), left(-notches as f32)];
            for (a, b) in at_once.into_iter().zip(one_by_one) {
                assert!(
                    a > 0.0 && (a - b).abs() <= 1e-4 * b.max(1e-2),
                    "{notches} notches: {a} at once, {b} one by one"
                );
            }
        }
        assert_eq!(zoom_sensitivity(0.0), 1.0);
    }
}
