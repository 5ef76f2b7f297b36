//! OBJ text.

use std::fmt::Write;

use glam::{DVec3, dvec3};

use crate::{
    refine::{mirrored, normals},
    rig::decimals,
    surface_nets::Quads,
};

/// One object of an OBJ file.
pub struct Piece {
    name: String,
    mesh: Quads,
    normals: Vec<DVec3>,
}

impl Piece {
    /// A mesh as it is.
    pub fn whole(name: &str, mesh: Quads) -> Self {
        let normals = normals(&mesh);
        Self { name: name.into(), mesh, normals }
    }

    /// A mesh and its mirror image; vertices on the plane are shared.
    pub fn symmetric(name: &str, half: &Quads) -> Self {
        let mut normals = normals(half);
        for i in 0..half.points.len() {
            if !half.on_plane[i] {
                let n = normals[i];
                normals.push(dvec3(-n.x, n.y, n.z));
            }
        }
        Self { name: name.into(), mesh: mirrored(half), normals }
    }

    /// The mesh.
    pub fn mesh(&self) -> &Quads {
        &self.mesh
    }
}

/// The text of an OBJ file with positions, normals and quads.
pub fn obj(about: &str, pieces: &[Piece]) -> String {
    let mut text = String::new();
    for line in about.lines() {
        let _ = writeln!(text, "# {line}");
    }
    let mut offset = 1;
    for piece in pieces {
        let _ = writeln!(text, "o {}", piece.name);
        for p in &piece.mesh.points {
            let _ = writeln!(text, "v {} {} {}", decimals(p.x, 5), decimals(p.y, 5), decimals(p.z, 5));
        }
        for n in &piece.normals {
            let _ = writeln!(text, "vn {} {} {}", decimals(n.x, 3), decimals(n.y, 3), decimals(n.z, 3));
        }
        for face in &piece.mesh.faces {
            text.push('f');
            for i in face {
                let _ = write!(text, " {0}//{0}", offset + i);
            }
            text.push('\n');
        }
        offset += piece.mesh.points.len() as u32;
    }
    text
}
