//! Colours of local groups: what is drawn follows the sliders of the colour while they are dragged, as one step.

use std::collections::BTreeSet;

use bevy::{
    asset::AssetPlugin,
    camera::{ComputedCameraValues, RenderTargetInfo},
    mesh::VertexAttributeValues,
    prelude::*,
};
use bevy_egui::egui;
use rigsmith::{
    editor::{
        ActiveRig,
        panel::EditorPanel,
        panels::{local_groups::GroupsPanel, properties::PropertiesPanel},
    },
    headless::headless_app,
    plugins::{
        drawing::{
            DrawingPlugin, RigDrawing,
            material::TINT,
            theme::{Tint, group_tint, mix, shade},
        },
        schema::LocalGroup,
        viewport::RigViewport,
    },
    prelude::*,
    test_app::strict_app,
};

use super::desk::{Desk, Sheet};

/// Colour of the group before it is changed.
const RED: [f32; 3] = [0.9, 0.2, 0.2];
/// Width of the sliders of a colour.
const SLIDER_WIDTH: f32 = 275.0;

/// A desk whose rig is drawn, with three selected joints in one group.
fn desk_with_group(panel: Box<dyn EditorPanel>) -> Desk {
    let mut app = headless_app(1);
    app.add_plugins(AssetPlugin::default()).init_asset::<Mesh>().add_plugins(DrawingPlugin);
    let mut app = strict_app(app);
    app.world_mut().resource_mut::<RigDrawing>().grid = false;
    let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
    app.insert_resource(ActiveRig(rig));
    let target = RenderTargetInfo { physical_size: UVec2::new(1280, 720), scale_factor: 1.0 };
    let computed = ComputedCameraValues { target_info: Some(target), ..default() };
    let eye = Transform::from_xyz(0.0, 1.0, 5.0).looking_at(Vec3::Y, Vec3::Y);
    app.world_mut().spawn((Camera3d::default(), Camera { computed, ..default() }, RigViewport { focus: 5.0 }, eye));
    let mut desk = Desk::of(app, rig, Sheet::Panel(panel), egui::vec2(600.0, 800.0));
    let joints = desk.chain(&["hips", "spine", "head"]);
    desk.edit(Operation::Group { joints: joints.clone(), name: "body".to_owned(), color: Some(RED) });
    desk.select(&joints);
    desk
}

/// Colours of all vertices that are drawn over the mesh.
fn drawn_tints(desk: &mut Desk) -> BTreeSet<Tint> {
    let mut shown = desk.app.world_mut().query::<&Mesh3d>();
    let meshes: Vec<AssetId<Mesh>> = shown.iter(desk.app.world()).map(|mesh| mesh.id()).collect();
    let assets = desk.app.world().resource::<Assets<Mesh>>();
    let tints = |mesh: AssetId<Mesh>| match assets.get(mesh)?.attribute(TINT)? {
        VertexAttributeValues::Unorm8x4(tints) => Some(tints.clone()),
        _ => None,
    };
    meshes.into_iter().filter_map(tints).flatten().collect()
}

/// True if faces of bones of a group with that colour are drawn, in whatever light.
fn is_drawn(tints: &BTreeSet<Tint>, color: [f32; 3]) -> bool {
    let tint = group_tint(color);
    let is_near = |one: Tint, other: &Tint| one.iter().zip(other).all(|(a, b)| a.abs_diff(*b) <= 1);
    (0..=100).map(|step| 0.5 + step as f32 / 200.0).any(|light| {
        // Bones of selected joints are lighter.
        [tint, mix(tint, [255; 4], 0.35)].iter().any(|tint| tints.iter().any(|one| is_near(shade(*tint, light), one)))
    })
}

/// The group's colour in the document, which that of its entity is.
#[track_caller]
fn group_color(desk: &mut Desk) -> [f32; 3] {
    let color = desk.rig().groups()[0].color;
    let mut groups = desk.app.world_mut().query::<&LocalGroup>();
    let shown: Vec<[f32; 3]> = groups.iter(desk.app.world()).map(|group| group.color).collect();
    assert_eq!(shown, [color], "the entity of the group");
    color
}

/// Drags the hue in a panel: every place of the pointer is seen in its own frame.
fn check(panel: Box<dyn EditorPanel>, button: &str) {
    let mut desk = desk_with_group(panel);
    let (before, steps) = (desk.rig().clone(), desk.steps());
    assert_eq!(group_color(&mut desk), RED, "{button}");
    let tints = drawn_tints(&mut desk);
    assert!(is_drawn(&tints, RED), "{button}: {tints:?}");
    desk.click(button);
    desk.frames(3);
    let is_slider = |rect: &egui::Rect| (rect.width() - SLIDER_WIDTH).abs() < 1.0 && rect.height() < 40.0;
    let sliders = desk.seen.iter().map(|seen| seen.rect).filter(is_slider);
    // The hue is below the field of brightness and saturation.
    let hue = sliders.max_by(|a, b| a.top().total_cmp(&b.top())).expect("the slider of the hue");
    let at = |share: f32| egui::pos2(hue.left() + share * hue.width(), hue.center().y);
    desk.time += 1.0;
    let mut last = RED;
    for share in [0.3, 0.45, 0.6] {
        if last == RED {
            desk.press(at(share));
        } else {
            desk.move_to(at(share));
        }
        let color = group_color(&mut desk);
        assert!(color.iter().zip(last).any(|(now, last)| (now - last).abs() > 0.1), "{button} at {share}: {color:?}");
        let tints = drawn_tints(&mut desk);
        assert!(is_drawn(&tints, color) && !is_drawn(&tints, last), "{button}: {last:?} to {color:?}: {tints:?}");
        assert_eq!(desk.steps(), steps, "{button}: a drag is no step yet");
        last = color;
    }
    desk.release(at(0.6));
    desk.frames(2);
    assert_eq!((group_color(&mut desk), desk.steps().1), (last, steps.1 + 1), "{button}: the drag is one step");
    assert!(is_drawn(&drawn_tints(&mut desk), last), "{button}");
    desk.undo(1);
    assert_eq!(*desk.rig(), before, "{button}");
    assert_eq!(group_color(&mut desk), RED, "{button}");
    assert!(is_drawn(&drawn_tints(&mut desk), RED), "{button}");
}

#[test]
fn sliders_of_a_group_recolour_what_is_drawn_at_once() {
    check(Box::new(GroupsPanel::default()), "Colour of body");
    check(Box::new(PropertiesPanel::default()), "Colour of the group");
}
