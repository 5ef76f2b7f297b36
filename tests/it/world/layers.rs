//! Visibility of controls: by kinematics, and by layers that hide them, colour them, or show them as templates.

use bevy::prelude::*;
use rigsmith::{
    plugins::{commands::BuildResult, controls::NodeVisible},
    prelude::*,
    rig::{Matching, NodeType},
};

use super::{RigBench, shipped};

/// Controls whose kinematics has no effect are neither seen nor picked; a blend of both shows both.
#[test]
fn controls_without_effect_are_hidden() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let mut stage = RigBench::of_built(rig);
    let built = stage.get::<BuildResult>(stage.rig).unwrap().0.clone();
    let limbs = built.switches.iter().filter_map(|switch| match &switch.matching {
        Matching::IkFk { fk, goal, .. } if *goal != switch.control => {
            Some((switch.control, switch.attribute.to_string(), fk.clone(), *goal))
        }
        _ => None,
    });
    let limbs: Vec<_> = limbs.collect();
    assert!(limbs.len() >= 4, "arms and legs");
    let visible = |stage: &RigBench, node: Uid| stage.get::<NodeVisible>(stage.node(node).unwrap()).unwrap().0;
    // The control that carries a goal: a foot's goal hangs below its control.
    let index = built.index();
    let carrier = |goal: Uid| {
        let mut at = &built.nodes[index[&goal]];
        while at.kind != NodeType::Control {
            at = &built.nodes[at.parent.expect("a control carries the goal")];
        }
        at.uid
    };
    for (control, attribute, fk, goal) in limbs {
        for (value, forward, inverse) in [(0.0, true, false), (0.4, true, true), (1.0, false, true)] {
            let edit = RigEdit::SetAttributeValue(control, attribute.clone(), Some(value));
            stage.apply_all(vec![edit]);
            assert_eq!(visible(&stage, carrier(goal)), inverse, "the goal at {value}");
            for node in fk.iter().filter(|node| **node != control) {
                assert_eq!(visible(&stage, *node), forward, "a forward control at {value}");
            }
        }
    }
}

/// Controls in layers, as they are drawn and picked.
#[cfg(feature = "draw")]
mod drawn_layers {
    use bevy::ecs::system::RunSystemOnce;
    use rigsmith::{
        algo::view::ViewPlane,
        plugins::{
            controls::outline::{ControlNodes, ControlOutline, lines_of},
            document::HoveredNode,
            drawing::{
                controls::draw_controls,
                ink::Ink,
                theme::{Theme, Tint, group_tint},
            },
            picking::{Pick, PickAnswer, PickRequest},
            schema::{Control, RigNodes},
            viewport::{RigViewport, Sight},
        },
        rig::{TagData, TagKind},
    };

    use super::*;
    use crate::world::limits::limited_rig;

    /// Uid of the tag that puts the control into a layer.
    const LAYER: Uid = Uid(78);
    const OWN: [f32; 3] = [0.1, 0.9, 0.2];
    const OTHER: [f32; 3] = [0.9, 0.1, 0.8];

    /// A rig with one control of a colour of its own, at the joint `j2`.
    fn stage() -> (RigBench, Uid) {
        let mut rig = limited_rig();
        let mut tag = rig.find_tag(Uid(77)).unwrap().1.clone();
        let params = format!("(size: 0.3, color: Some({}))", tuple(OWN));
        tag.kind = TagKind::Command { module: "control".into(), params, feature: None };
        rig.apply(&RigEdit::SetTag(Uid(2), Box::new(tag))).unwrap();
        rig.apply(&RigEdit::AddTag { joint: Uid(2), tag: Box::new(layer("()")), index: 1 }).unwrap();
        let stage = RigBench::of_built(rig);
        let built = &stage.get::<BuildResult>(stage.rig).unwrap().0;
        let control = built.nodes.iter().find(|node| node.kind == NodeType::Control).unwrap().uid;
        (stage, control)
    }

    fn tuple([r, g, b]: [f32; 3]) -> String {
        format!("({r:?}, {g:?}, {b:?})")
    }

    /// A layer of all controls; without parameters an ordinary one.
    fn layer(params: &str) -> TagData {
        let inner = &params[1..params.len() - 1];
        let params = format!("(nodes: \"@any type:control\", name: \"controls\", {inner})");
        let kind = TagKind::Command { module: "layer".into(), params, feature: None };
        TagData { uid: LAYER, enabled: true, comment: String::new(), kind }
    }

    fn sight() -> Sight {
        let camera = Transform::from_xyz(2.0, 4.0, 5.0).looking_at(2.0 * Vec3::Y, Vec3::Y);
        let viewport = RigViewport { focus: camera.translation.distance(2.0 * Vec3::Y) };
        let projection = Projection::Perspective(PerspectiveProjection { fov: 0.6, ..default() });
        let size = Vec2::new(1000.0, 800.0);
        Sight::new(&camera.into(), &projection, &viewport, size, &GlobalTransform::IDENTITY).unwrap()
    }

    /// Outlines of the visible controls, as the drawing and the picking get them.
    fn outlines(stage: &mut RigBench) -> Vec<ControlOutline> {
        let rig = stage.rig;
        let visible = move |controls: ControlNodes, nodes: Query<&RigNodes>| {
            controls.visible(nodes.get(rig).ok(), bevy::math::Affine3A::IDENTITY)
        };
        stage.app.world_mut().run_system_once(visible).unwrap()
    }

    fn tints(stage: &mut RigBench) -> Vec<Tint> {
        let (controls, mut ink) = (outlines(stage), Ink::default());
        draw_controls(&controls, &Selection::default(), &HoveredNode::default(), &sight(), &Theme::default(), &mut ink);
        ink.tints.clone()
    }

    /// Nodes that a click on the outline of the control selects.
    fn click(stage: &mut RigBench, control: Uid) -> Vec<Uid> {
        let entity = stage.node(control).unwrap();
        let place = stage.get::<GlobalTransform>(entity).unwrap().affine();
        let lines = lines_of(&stage.get::<Control>(entity).unwrap().0, place);
        let plane: ViewPlane = sight().plane;
        let point = plane.project(lines[0][0].midpoint(lines[0][1])).unwrap();
        let what = Pick::Click { plane, point, reach: 0.02 };
        let rig = stage.rig;
        stage.app.world_mut().resource_mut::<Messages<PickAnswer>>().clear();
        stage.app.world_mut().write_message(PickRequest { rig, what, add: false });
        stage.app.update();
        let picked = stage.app.world_mut().resource_mut::<Messages<PickAnswer>>().drain().last();
        let picked = picked.expect("an answer").joints;
        assert_eq!(stage.get::<Selection>(rig).unwrap().0, picked);
        picked
    }

    #[test]
    fn layers_hide_colour_and_lock_controls() {
        let (mut stage, control) = stage();
        // Parameters of the layer, the colour in which the control is drawn, and whether a click takes it.
        let table: [(&str, Option<[f32; 3]>, bool); 7] = [
            ("()", Some(OWN), true),
            ("(color: Some((0.9, 0.1, 0.8)))", Some(OTHER), true),
            ("(visible: false)", None, false),
            ("(display: reference)", Some(OWN), false),
            ("(display: reference, color: Some((0.9, 0.1, 0.8)))", Some(OTHER), false),
            ("(display: template, color: Some((0.9, 0.1, 0.8)))", Some([0.5, 0.51, 0.53]), false),
            ("(visible: false, display: template)", None, false),
        ];
        for (params, color, is_picked) in table {
            stage.apply(RigEdit::SetTag(Uid(2), Box::new(layer(params))));
            let entity = stage.node(control).unwrap();
            assert_eq!(stage.get::<NodeVisible>(entity), Some(&NodeVisible(color.is_some())), "{params}");
            let tints = tints(&mut stage);
            match color {
                None => assert!(tints.is_empty(), "{params}: a hidden control is drawn"),
                Some(color) => {
                    let near = |tint: &Tint| tint.iter().zip(group_tint(color)).all(|(a, b)| a.abs_diff(b) <= 2);
                    assert!(tints.iter().any(near), "{params}: {color:?} is not drawn");
                    let other = if color == OWN { OTHER } else { OWN };
                    assert!(!tints.contains(&group_tint(other)), "{params}: {other:?} is drawn");
                }
            }
            assert_eq!(click(&mut stage, control) == [control], is_picked, "{params}");
        }
        // Undone, the control is seen and picked again.
        for _ in 0..table.len() {
            stage.change(Change::Undo);
        }
        assert!(tints(&mut stage).contains(&group_tint(OWN)));
        assert_eq!(click(&mut stage, control), [control]);
    }

    /// A command drives the visibility: a hidden control escapes a click, also where the click selected it before.
    #[test]
    fn a_hidden_control_escapes_a_click() {
        let (mut stage, control) = stage();
        let commands = [
            ("attribute", "(node: \"@any type:control\", name: \"shown\", min: 0.0, max: 1.0, default: 1.0)"),
            ("attribute", "(node: \"@any type:control\", name: \"visible\", min: 0.0, max: 1.0, default: 1.0)"),
            (
                "driven_key",
                "(driver: \"@any type:control\", driver_attribute: \"shown\", keys: [(0.0, 0.0), (1.0, 1.0)], \
                 output: \"@any type:control\", output_attribute: \"visible\")",
            ),
        ];
        let tags = commands.iter().zip(79..).zip(2..).map(|(((module, params), uid), index)| {
            let kind = TagKind::Command { module: (*module).into(), params: (*params).into(), feature: None };
            let tag = TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind };
            RigEdit::AddTag { joint: Uid(2), tag: Box::new(tag), index }
        });
        stage.apply_all(tags.collect());
        assert!(!tints(&mut stage).is_empty());
        assert_eq!(click(&mut stage, control), [control]);
        let show = |stage: &mut RigBench, value: f32| {
            stage.apply(RigEdit::SetAttributeValue(control, "shown".into(), Some(value)));
        };
        show(&mut stage, 0.0);
        assert!(tints(&mut stage).is_empty());
        assert!(!click(&mut stage, control).contains(&control));
        show(&mut stage, 1.0);
        assert!(!tints(&mut stage).is_empty());
        assert_eq!(click(&mut stage, control), [control]);
    }
}
