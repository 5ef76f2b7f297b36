//! Draws `docs/parts.png`: parts and characters, each posed by its own controls and attributes.
//!
//! `cargo run --release --no-default-features --features render --example parts_sheet [FILE]`.

use std::{collections::HashMap, error::Error, path::Path, sync::Arc};

use bevy::math::{Quat, UVec2, Vec3};
use rigsmith::{
    algo::{view::View, weights::WeightSettings},
    files::{RealDisk, load_model, load_template, save_atomic},
    headless::Workbench,
    mesh::model::Trs,
    modules,
    plugins::{drawing::RigDrawing, surface::RigMesh},
    processor::Builder,
    render::{PictureSettings, take_picture},
    rig::{
        BuiltNode, BuiltRig, JointData, PoseOffset, RestTransform, Rig, RigEdit, RigJoint, Uid, operations::Operation,
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

/// Width and height of one picture in pixels, and how many stand beside each other.
const TILE: UVec2 = UVec2::new(360, 300);
const COLUMNS: u32 = 4;

/// One picture: a template, from where, and what is done to it.
struct Picture {
    template: &'static str,
    /// A bundled mesh that it moves.
    mesh: Option<&'static str>,
    view: View,
    moves: &'static [Move],
}

/// Move of an animator.
enum Move {
    /// Sets the attribute of a node: label, name, value.
    Set(&'static str, &'static str, f32),
    /// Moves a control: label, shape, by how much in the axes of the rig (X to its left, Y up, Z to the front).
    Shift(&'static str, &'static str, [f32; 3]),
    /// Turns a control about X, Y, then Z: label, shape, degrees.
    Turn(&'static str, &'static str, [f32; 3]),
}

const PICTURES: [Picture; 16] = [
    Picture {
        template: "biped",
        mesh: Some("biped.obj"),
        view: View::Orbit(25.0, 5.0),
        moves: &[
            Move::Shift("hand_l", "cube", [-0.22, 0.3, 0.25]),
            Move::Shift("hand_r", "cube", [0.1, 0.0, 0.3]),
            Move::Shift("foot_l", "foot", [0.0, 0.2, 0.2]),
            Move::Turn("head", "square", [0.0, 25.0, 0.0]),
        ],
    },
    Picture {
        template: "quadruped",
        mesh: None,
        view: View::Orbit(50.0, 12.0),
        moves: &[
            Move::Shift("carpus_l", "cube", [0.0, 0.05, 0.10]),
            Move::Shift("carpus_r", "cube", [0.0, 0.0, -0.07]),
            Move::Shift("foot_l", "foot", [0.0, 0.0, -0.08]),
            Move::Shift("foot_r", "foot", [0.0, 0.06, 0.10]),
            Move::Turn("tail_1", "circle", [25.0, 0.0, 0.0]),
            Move::Turn("tail_3", "circle", [20.0, 0.0, 10.0]),
            Move::Turn("neck", "circle", [-15.0, 0.0, 0.0]),
            Move::Set("jaw", "open", 1.0),
        ],
    },
    Picture {
        template: "bird",
        mesh: None,
        view: View::Orbit(25.0, 35.0),
        moves: &[
            Move::Set("wing_1_l", "fold", 0.85),
            Move::Shift("foot_l", "foot", [0.0, 0.06, 0.06]),
            Move::Set("beak", "open", 1.0),
        ],
    },
    Picture {
        template: "parts/arm",
        mesh: None,
        view: View::Orbit(40.0, 15.0),
        moves: &[Move::Shift("hand_l", "cube", [-0.2, 0.25, 0.15])],
    },
    Picture {
        template: "parts/leg",
        mesh: None,
        view: View::Left,
        moves: &[Move::Shift("foot_l", "foot", [0.0, 0.2, 0.15])],
    },
    Picture {
        template: "parts/leg_3joint",
        mesh: None,
        view: View::Left,
        moves: &[Move::Shift("foot_l", "foot", [0.0, 0.12, 0.08])],
    },
    Picture {
        template: "parts/spine",
        mesh: None,
        view: View::Left,
        moves: &[Move::Turn("spine", "circle", [20.0, 0.0, 0.0]), Move::Turn("spine_1", "circle", [20.0, 0.0, 0.0])],
    },
    Picture {
        template: "parts/neck_head",
        mesh: None,
        view: View::Left,
        moves: &[Move::Turn("neck", "circle", [20.0, 0.0, 0.0]), Move::Turn("head", "square", [-30.0, 0.0, 0.0])],
    },
    Picture { template: "parts/hand", mesh: None, view: View::Top, moves: &[Move::Set("hand_l", "spread", 1.0)] },
    Picture {
        template: "parts/hand",
        mesh: None,
        view: View::Orbit(-20.0, 35.0),
        moves: &[Move::Set("hand_l", "curl", 0.7)],
    },
    Picture { template: "parts/wing", mesh: None, view: View::Top, moves: &[Move::Set("wing_1_l", "fan", 1.0)] },
    Picture { template: "parts/wing", mesh: None, view: View::Top, moves: &[Move::Set("wing_1_l", "fold", 0.6)] },
    Picture {
        template: "parts/tail",
        mesh: None,
        view: View::Left,
        moves: &[
            Move::Set("tail_1", "curve", 1.0),
            Move::Shift("tail_6", "diamond", [0.0, 0.3, 0.1]),
            Move::Shift("tail_4", "diamond", [0.0, -0.1, 0.0]),
        ],
    },
    Picture {
        template: "parts/ikfk_chain",
        mesh: None,
        view: View::Left,
        moves: &[Move::Shift("chain_5", "cube", [0.0, -0.3, 0.25])],
    },
    Picture { template: "parts/jaw", mesh: None, view: View::Left, moves: &[Move::Set("jaw", "open", 1.0)] },
    Picture {
        template: "hand",
        mesh: Some("hand.obj"),
        view: View::Orbit(-30.0, 15.0),
        moves: &[Move::Set("hand_l", "curl", 0.35)],
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = std::env::args_os().nth(1).map_or_else(|| root.join("docs/parts.png"), Into::into);
    let rows = (PICTURES.len() as u32).div_ceil(COLUMNS);
    let mut sheet = image::RgbImage::new(COLUMNS * TILE.x, rows * TILE.y);
    for (number, picture) in (0..).zip(&PICTURES) {
        let template = load_template(&RealDisk, &root.join(format!("assets/templates/{}.rig.ron", picture.template)))?;
        let posed = posed(&template.rig, picture.moves)?;
        let (rig, meshes) = match picture.mesh {
            Some(mesh) => dressed(template.rig, &posed, &root.join("assets/models").join(mesh))?,
            None => (posed, Vec::new()),
        };
        let settings = PictureSettings {
            size: TILE,
            view: picture.view,
            drawing: RigDrawing { grid: false, ..RigDrawing::default() },
            ..PictureSettings::default()
        };
        let tile = take_picture(rig, meshes, &settings)?.try_into_dynamic()?.to_rgb8();
        let (x, y) = (number % COLUMNS * TILE.x, number / COLUMNS * TILE.y);
        image::imageops::replace(&mut sheet, &tile, i64::from(x), i64::from(y));
        println!("{}", picture.template);
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    sheet.write_to(&mut bytes, image::ImageFormat::Png)?;
    save_atomic(&RealDisk, &file, &bytes.into_inner())?;
    println!("wrote {}", file.display());
    Ok(())
}

/// A skinned rig in the pose in which another rests.
fn dressed(rig: Rig, posed: &Rig, mesh: &Path) -> Result<(Rig, Vec<RigMesh>), Box<dyn Error>> {
    let mut bench = Workbench::with_rig(1, rig);
    bench.open(load_model(&RealDisk, mesh)?, true)?;
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {})?;
    let offset = |joint: &RigJoint| {
        let to = posed.joint(joint.data.uid)?.data.rest.into();
        Some(RigEdit::SetOffset(joint.data.uid, Some(PoseOffset::between(&joint.data.rest, &to))))
    };
    let edits = bench.rig().walk().filter_map(offset).collect();
    bench.operate(Operation::Edits(edits))?;
    Ok((bench.rig().clone(), bench.mesh().cloned().into_iter().collect()))
}

/// A skeleton that rests as the template stands after some moves.
fn posed(template: &Rig, moves: &[Move]) -> Result<Rig, Box<dyn Error>> {
    let built = Builder::build(template, &Arc::new(modules::all()))?;
    let mut state = RigState::new(Arc::new(RigProgram::compile(&built, &CompileOptions::default())?));
    state.evaluate(0.0);
    let rest = state.clone();
    for step in moves {
        match step {
            Move::Set(label, name, value) => {
                let node = find(&built, label, |node| node.attributes.iter().any(|known| &*known.name == *name))?;
                state.set_attribute(node, name, *value)?;
            }
            Move::Shift(label, shape, by) => {
                let control = find(&built, label, |node| has_shape(node, shape))?;
                let turned = rest.global(control).unwrap_or_default().rotation;
                let translation = turned.inverse() * Vec3::from(*by);
                state.set_offset(control, PoseOffset { translation, ..PoseOffset::IDENTITY })?;
            }
            Move::Turn(label, shape, degrees) => {
                let rotation = rigsmith::rig::degrees(Vec3::from(*degrees));
                state.set_offset(
                    find(&built, label, |node| has_shape(node, shape))?,
                    PoseOffset::from_rotation(rotation),
                )?;
            }
        }
    }
    state.evaluate(0.0);
    let mut rig = Rig::new(template.uid(), template.about().name.clone());
    for group in template.groups() {
        rig.apply(&RigEdit::AddLocalGroup(group.clone(), usize::MAX))?;
    }
    let mut globals: HashMap<Uid, Trs> = HashMap::new();
    for joint in template.walk() {
        let uid = joint.data.uid;
        let global = state.global(uid).unwrap_or_default();
        let above = joint.parent.and_then(|parent| globals.get(&parent));
        let local = above.map_or(global, |above| global.relative_to(above));
        let rest = RestTransform {
            translation: local.translation,
            rotation: Quat::normalize(local.rotation),
            scale: local.scale,
        };
        globals.insert(uid, global);
        let data = JointData { rest, mirror: None, tags: Vec::new(), ..joint.data.clone() };
        rig.apply(&RigEdit::AddJoint { joint: Box::new(data), parent: joint.parent, index: usize::MAX })?;
    }
    Ok(rig)
}

fn has_shape(node: &BuiltNode, shape: &str) -> bool {
    node.control.as_ref().is_some_and(|control| control.shape == shape)
}

fn find(built: &BuiltRig, label: &str, is_it: impl Fn(&BuiltNode) -> bool) -> Result<Uid, Box<dyn Error>> {
    let found = built.nodes.iter().find(|node| node.label.as_deref() == Some(label) && is_it(node));
    Ok(found.ok_or_else(|| format!("there is no such node at {label}"))?.uid)
}
