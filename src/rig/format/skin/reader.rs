//! Reader of skin files. The bytes may be anything.

use glam::Vec3;

use super::{
    HAS_MESH, HAS_SUBJECTS, HEADER, MAGIC, PLAIN_FORMAT, SKIN_FORMAT, SkinError, SkinFile, SkinJoint, SkinMesh,
    bytes::Bytes, check_triangles, check_weights, content_hash, mesh_hash,
};
use crate::mesh::model::Weights;

/// Reason why bytes are no skin file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SkinFileError {
    /// The file does not begin with the magic of a skin file.
    #[error("this is not a skin file: it does not begin with RIGSKIN")]
    NotASkin,
    /// The file was written by a later version.
    #[error("the skin file has format {found}, this version reads up to {known}; update to open it")]
    Newer {
        /// Format of the file.
        found: u32,
        /// Highest format that this version reads.
        known: u32,
    },
    /// The file is shorter or longer than its header says.
    #[error("the skin file should have {expected} bytes but has {found}; copy or save it again")]
    Length {
        /// Length in bytes according to the header, or length of the header itself.
        expected: u64,
        /// Length of the file in bytes.
        found: u64,
    },
    /// The checksum does not fit the content.
    #[error("the skin file is damaged: its checksum does not fit its content; copy it again or bind the mesh again")]
    Checksum,
    /// The file holds a value that Rigsmith never writes.
    #[error("the skin file is damaged at byte {offset}: {what}; bind the mesh again")]
    Damaged {
        /// Position of the value in bytes from the start of the file.
        offset: usize,
        /// Description of the error.
        what: String,
    },
    /// The parts of the file are valid by themselves but do not fit together.
    #[error("the skin file contradicts itself: {0}")]
    Content(#[from] SkinError),
}

pub(super) fn read(all: &[u8]) -> Result<SkinFile, SkinFileError> {
    if all.get(..MAGIC.len()) != Some(&MAGIC) {
        return Err(SkinFileError::NotASkin);
    }
    let found = all.len() as u64;
    let short = || SkinFileError::Length { expected: (HEADER + 8) as u64, found };
    let mut bytes = Bytes::new(all, MAGIC.len());
    let format = bytes.array().map(u32::from_le_bytes).ok_or_else(short)?;
    if format > SKIN_FORMAT {
        return Err(SkinFileError::Newer { found: format, known: SKIN_FORMAT });
    }
    if all.len() < HEADER + 8 {
        return Err(short());
    }
    let flags = bytes.array().map(u32::from_le_bytes).ok_or_else(short)?;
    let expected = bytes.array().map(u64::from_le_bytes).ok_or_else(short)?;
    if expected != found {
        return Err(SkinFileError::Length { expected, found });
    }
    let (content, checksum) = all.split_at(all.len() - 8);
    if checksum != content_hash(content).to_le_bytes() {
        return Err(SkinFileError::Checksum);
    }
    let damaged = |offset: usize, what: &str| SkinFileError::Damaged { offset, what: what.to_owned() };
    if format == 0 {
        return Err(damaged(8, "the format is 0"));
    }
    if flags & !(HAS_MESH | HAS_SUBJECTS) != 0 || (flags & HAS_SUBJECTS != 0) != (format > PLAIN_FORMAT) {
        return Err(damaged(12, "an unknown flag is set"));
    }
    let mut bytes = Bytes::new(content, 24);
    let hash = bytes.array().map(u128::from_le_bytes).ok_or_else(short)?;
    let mut counts = [0usize; 4];
    for count in &mut counts {
        *count = bytes.array().map(u32::from_le_bytes).ok_or_else(short)? as usize;
    }
    let [joint_count, point_count, influence_count, triangle_count] = counts;
    let has_mesh = flags & HAS_MESH != 0;
    // Each entry takes at least one byte, so counts beyond the file's length are invalid, and no memory is reserved for
    // them.
    let mesh_bytes = if has_mesh { point_count as u64 * 12 + triangle_count as u64 * 3 } else { 0 };
    let has_subjects = flags & HAS_SUBJECTS != 0;
    let joint_bytes = if has_subjects { 17 } else { 9 };
    let least = joint_count as u64 * joint_bytes + point_count as u64 + influence_count as u64 + mesh_bytes;
    if least > bytes.left() as u64 || (!has_mesh && triangle_count != 0) {
        return Err(damaged(40, "the counts do not fit the length of the file"));
    }

    let mut joints = Vec::with_capacity(joint_count);
    for _ in 0..joint_count {
        let at = bytes.offset();
        let uid = bytes.array().map(u64::from_le_bytes);
        let label = bytes.varint().and_then(|length| bytes.take(usize::try_from(length).ok()?));
        let label = label.and_then(|label| std::str::from_utf8(label).ok());
        let (Some(uid), Some(label)) = (uid, label) else { return Err(damaged(at, "a joint is unreadable")) };
        let label = label.to_owned();
        let subject = if has_subjects { bytes.array().map(u64::from_le_bytes) } else { Some(0) };
        let subject = subject.ok_or_else(|| damaged(at, "the subject of a joint is unreadable"))?;
        joints.push(SkinJoint { uid, label, subject: Some(subject).filter(|subject| *subject != 0) });
    }
    if has_subjects && joints.iter().all(|joint| joint.subject.is_none()) {
        return Err(damaged(12, "subjects are announced but there are none"));
    }
    let weights = read_weights(&mut bytes, point_count, influence_count)?;
    check_weights(&weights, joints.len())?;
    let mesh = if has_mesh { Some(read_mesh(&mut bytes, point_count, triangle_count)?) } else { None };
    if bytes.left() > 0 {
        return Err(damaged(bytes.offset(), "there is more than the counts say"));
    }
    if let Some(mesh) = &mesh {
        check_triangles(&mesh.triangles, point_count)?;
        if mesh_hash(&mesh.points, &mesh.triangles) != hash {
            return Err(damaged(24, "the hash is not that of the mesh in the file"));
        }
    }
    Ok(SkinFile { mesh_hash: hash, joints, weights, mesh })
}

fn read_weights(bytes: &mut Bytes, points: usize, influences: usize) -> Result<Weights, SkinFileError> {
    let mut weights = Weights {
        starts: Vec::with_capacity(points + 1),
        joints: Vec::with_capacity(influences),
        values: Vec::with_capacity(influences),
    };
    weights.starts.push(0);
    for point in 0..points {
        let offset = bytes.offset();
        let damaged =
            || SkinFileError::Damaged { offset, what: format!("the influences of point {point} are unreadable") };
        let head = bytes.varint().ok_or_else(damaged)?;
        let (count, rigid) = (head >> 1, head & 1 == 1);
        let room = (influences - weights.joints.len()) as u64;
        if count > room || (rigid && count != 1) {
            return Err(damaged());
        }
        for _ in 0..count {
            let joint = bytes.varint().and_then(|j| u32::try_from(j).ok()).ok_or_else(damaged)?;
            let value = if rigid { 1.0 } else { bytes.float().ok_or_else(damaged)? };
            // A single weight of one has a shorter form, which the writer always uses.
            if !rigid && count == 1 && value.to_bits() == 1.0f32.to_bits() {
                return Err(damaged());
            }
            weights.joints.push(joint);
            weights.values.push(value);
        }
        weights.starts.push(weights.joints.len() as u32);
    }
    if weights.joints.len() != influences {
        let what = "there are fewer influences than the header says".to_owned();
        return Err(SkinFileError::Damaged { offset: bytes.offset(), what });
    }
    Ok(weights)
}

fn read_mesh(bytes: &mut Bytes, points: usize, triangles: usize) -> Result<SkinMesh, SkinFileError> {
    let offset = bytes.offset();
    let damaged = |offset| SkinFileError::Damaged { offset, what: "the mesh is unreadable".to_owned() };
    let mut mesh = SkinMesh { points: Vec::with_capacity(points), triangles: Vec::with_capacity(triangles) };
    for _ in 0..points {
        let mut float = || bytes.float().ok_or_else(|| damaged(offset));
        mesh.points.push(Vec3::new(float()?, float()?, float()?));
    }
    let mut last = 0i64;
    for _ in 0..triangles {
        let mut triangle = [0; 3];
        for corner in &mut triangle {
            let at = bytes.offset();
            last = bytes.signed().and_then(|step| last.checked_add(step)).ok_or_else(|| damaged(at))?;
            *corner = u32::try_from(last).map_err(|_| damaged(at))?;
        }
        mesh.triangles.push(triangle);
    }
    Ok(mesh)
}
