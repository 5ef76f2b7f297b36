//! Makes the bundled models and their rest skeletons: `assets/models/{biped,hand,head}.obj`, `biped.rig`, `hand.rig`.
//!
//! Run from the project's folder: `cargo run --release --no-default-features --example generate_models`, or with
//! another folder as argument. The same source makes the same bytes on every machine.

mod biped;
mod field;
mod hand;
mod head;
mod refine;
mod rig;
mod surface_nets;
mod write;

use std::{error::Error, fs, path::Path};

use glam::{DMat3, DVec3, dvec3};

use biped::Biped;
use field::Frame;
use hand::{Hand, HandModel};
use head::HeadModel;
use refine::{Ring, Settle, faults, largest_shell, settle};
use rig::Rig;
use surface_nets::{Grid, Quads, extract, graded, graded_symmetric};
use write::{Piece, obj};

const ABOUT: &str = "Made by examples/generate_models of Rigsmith.\n\
    Dedicated to the public domain under CC0 1.0.\n\
    Metres, Y up.";

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let folder = args.first().map_or("assets/models", String::as_str);
    let folder = Path::new(folder);
    fs::create_dir_all(folder)?;
    let only = args.get(1).map(String::as_str);
    if only.is_none_or(|x| x == "hand") {
        make_hand(folder)?;
    }
    if only.is_none_or(|x| x == "head") {
        make_head(folder)?;
    }
    if only.is_none_or(|x| x == "biped") {
        make_biped(folder)?;
    }
    Ok(())
}

/// A shell that must be closed, manifold and in one piece.
fn checked(name: &str, mesh: &Quads) -> Result<(), Box<dyn Error>> {
    let faults = faults(mesh);
    println!("{name}: {} vertices, {} faces", mesh.points.len(), mesh.faces.len());
    match faults.first() {
        None => Ok(()),
        Some(first) => {
            Err(format!("{name} is not a closed manifold at {} places; first: {first}", faults.len()).into())
        }
    }
}

fn make_hand(folder: &Path) -> Result<(), Box<dyn Error>> {
    let (sampled, shown) = (HandModel::new(&hand::OPEN), HandModel::new(&hand::SPREAD));
    let nodes = [
        graded(&[(-0.13, 0.0050), (-0.04, 0.0042), (0.0, 0.0034), (0.10, 0.0028), (0.13, 0.0022), (0.22, 0.0021)]),
        graded(&[(-0.065, 0.0036), (-0.03, 0.0024), (0.03, 0.0024), (0.06, 0.0036)]),
        graded(&[(-0.08, 0.0024), (0.12, 0.0024)]),
    ];
    let grid = Grid { nodes, warp: &|p| p, symmetric: false };
    let mut mesh = extract(&grid, &|p| sampled.distance(p));
    largest_shell(&mut mesh);
    let ring = Ring::new(&mesh);
    settle(
        &mut mesh,
        &ring,
        &|p| sampled.distance(p),
        Settle { rounds: 6, spread: 0.5, reach: 0.002, step: 0.0002, polish: 0 },
    );
    for p in &mut mesh.points {
        *p = sampled.hand.carry(&shown.hand, *p);
    }
    settle(
        &mut mesh,
        &ring,
        &|p| shown.distance(p),
        Settle { rounds: 10, spread: 0.4, reach: 0.002, step: 0.0002, polish: 0 },
    );
    checked("hand", &mesh)?;
    // Fingers up, palm forward, standing on the cut forearm.
    let stand = Frame { at: DVec3::Y * hand::STUB, axes: DMat3::from_cols(DVec3::Y, -DVec3::Z, -DVec3::X) };
    for p in &mut mesh.points {
        *p = stand.out(*p);
    }
    let mut rig = Rig::default();
    let forearm = rig.add(-1, stand.out(dvec3(-STUB_ROOT, 0.0, 0.001)), "forearm_l");
    let wrist = rig.add(forearm as i64, stand.out(DVec3::ZERO), "hand_l");
    let posed: &Hand = &shown.hand;
    posed.add_joints(&mut rig, wrist, &stand, "_l", true);
    let about = format!("{ABOUT}\nA left hand, fingers up, palm facing +Z.");
    fs::write(folder.join("hand.obj"), obj(&about, &[Piece::whole("hand", mesh)]))?;
    fs::write(folder.join("hand.rig"), rig.text(&about))?;
    Ok(())
}

/// Distance of the forearm joint below the wrist of the single hand.
const STUB_ROOT: f64 = 0.085;

fn make_head(folder: &Path) -> Result<(), Box<dyn Error>> {
    let model = HeadModel::new();
    let nodes = [
        graded_symmetric(&[(0.0, 0.0062), (0.19, 0.0062)]),
        graded(&[(-0.24, 0.0062), (0.36, 0.0062)]),
        graded(&[(-0.27, 0.0062), (0.24, 0.0062)]),
    ];
    let grid = Grid { nodes, warp: &head::focus, symmetric: true };
    let field = |p: DVec3| model.distance(p);
    let mut half = extract(&grid, &field);
    largest_shell(&mut half);
    let ring = Ring::new(&half);
    settle(&mut half, &ring, &field, Settle { rounds: 12, spread: 0.4, reach: 0.002, step: 0.0002, polish: 5 });
    let lift = DVec3::Y * head::FOOT;
    for p in &mut half.points {
        *p += lift;
    }
    let body = Piece::symmetric("head", &half);
    checked("head", body.mesh())?;
    let right = head::eyeball(head::EYE + lift, 9);
    let eyes = Piece::symmetric("eyes", &right);
    checked("eyes", eyes.mesh())?;
    fs::write(folder.join("head.obj"), obj(ABOUT, &[body, eyes]))?;
    Ok(())
}

fn make_biped(folder: &Path) -> Result<(), Box<dyn Error>> {
    let (sampled, rest) = (Biped::new(&biped::SAMPLED), Biped::new(&biped::REST));
    let nodes = [
        graded_symmetric(&[
            (0.0, 0.0180),
            (0.20, 0.0185),
            (0.35, 0.0210),
            (0.55, 0.0180),
            (0.68, 0.0064),
            (0.80, 0.0055),
            (0.95, 0.0055),
        ]),
        graded(&[
            (-0.03, 0.0095),
            (0.05, 0.0100),
            (0.12, 0.0145),
            (0.30, 0.0215),
            (1.0, 0.0215),
            (1.30, 0.0185),
            (1.42, 0.0155),
            (1.54, 0.0118),
            (1.68, 0.0114),
            (1.86, 0.0130),
        ]),
        graded(&[(-0.34, 0.0172), (0.11, 0.0168), (0.16, 0.0120), (0.22, 0.0120), (0.26, 0.0168), (0.46, 0.0168)]),
    ];
    let grid = Grid { nodes, warp: &biped::warp, symmetric: true };
    let mut half = extract(&grid, &|p| sampled.distance(p));
    largest_shell(&mut half);
    let ring = Ring::new(&half);
    settle(
        &mut half,
        &ring,
        &|p| sampled.distance(p),
        Settle { rounds: 4, spread: 0.4, reach: 0.006, step: 0.0004, polish: 0 },
    );
    for p in &mut half.points {
        *p = sampled.carry(&rest, *p);
    }
    settle(
        &mut half,
        &ring,
        &|p| rest.distance(p),
        Settle { rounds: 24, spread: 0.5, reach: 0.004, step: 0.0004, polish: 3 },
    );
    let body = Piece::symmetric("body", &half);
    checked("body", body.mesh())?;
    fs::write(folder.join("biped.obj"), obj(&format!("{ABOUT}\nFeet at Y = 0, facing +Z."), &[body]))?;
    fs::write(folder.join("biped.rig"), rest.rig().text(ABOUT))?;
    Ok(())
}
