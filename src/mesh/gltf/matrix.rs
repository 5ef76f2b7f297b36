//! Rest transforms: decomposition of matrices, and geometry moved to model space.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Quat, Vec3};

use crate::mesh::model::Trs;

/// Largest deviation from the identity that still counts as the identity: the rounding error of a transform times its
/// inverse when both are stored as `f32`.
const SNAP: f64 = 1e-5;

/// A transform in double precision.
pub(super) fn affine(trs: &Trs) -> DAffine3 {
    let rotation = trs.rotation.as_dquat().normalize();
    DAffine3::from_scale_rotation_translation(trs.scale.as_dvec3(), rotation, trs.translation.as_dvec3())
}

/// Keeps a rotation's bits if it is a unit quaternion to within rounding; `None` if it has no direction.
pub(super) fn unit(rotation: Quat) -> Option<Quat> {
    let length = rotation.as_dquat().length();
    if (length - 1.0).abs() < 1e-6 {
        return Some(rotation);
    }
    (length > 1e-12).then(|| (rotation.as_dquat() * (1.0 / length)).as_quat())
}

/// Decomposes an affine matrix into translation, rotation and scale. Returns `true` if the matrix had shear, which is
/// lost.
pub(super) fn decompose(matrix: DMat4) -> (Trs, bool) {
    let (linear, translation) = (DMat3::from_mat4(matrix), matrix.w_axis.truncate());
    let lengths = DVec3::new(linear.x_axis.length(), linear.y_axis.length(), linear.z_axis.length());
    let mirror = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
    let scale = lengths * DVec3::new(mirror, 1.0, 1.0);
    let direction = |v: DVec3, or: DVec3| v.try_normalize().unwrap_or(or);
    let x = direction(linear.x_axis * mirror, DVec3::X);
    let y = direction(linear.y_axis.reject_from_normalized(x), x.any_orthonormal_vector());
    // A flat matrix has no third direction of its own; a mirrored one has been turned right-handed.
    let rotation = DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).normalize();
    let again = DMat3::from_quat(rotation) * DMat3::from_diagonal(scale);
    let sheared = (0..3).any(|i| (again.col(i) - linear.col(i)).length() > 1e-4 * lengths.max_element());
    let trs = Trs { translation: translation.as_vec3(), rotation: rotation.as_quat(), scale: scale.as_vec3() };
    (trs, sheared)
}

/// Returns `true` if the transform moves points up to `extent` from the origin by no more than rounding.
pub(super) fn is_identity(world: &DAffine3, extent: f64) -> bool {
    let off = world.matrix3 - DMat3::IDENTITY;
    let columns = [off.x_axis, off.y_axis, off.z_axis];
    columns.iter().all(|column| column.abs().max_element() <= SNAP)
        && world.translation.abs().max_element() <= SNAP * extent
}

/// Transform of geometry from node space to model space.
pub(super) struct Bake {
    world: DAffine3,
    /// The inverse transpose up to a positive factor; it exists for singular transforms, too.
    normal: DMat3,
    /// Marks a transform that mirrors, so that triangles have to be reversed.
    pub(super) flip: bool,
    /// Marks the identity, which changes no geometry.
    pub(super) identity: bool,
}

impl Bake {
    /// Identity, which changes no geometry.
    pub(super) fn none() -> Self {
        Self { world: DAffine3::IDENTITY, normal: DMat3::IDENTITY, flip: false, identity: true }
    }

    /// Transform for points up to `extent` from the origin; one that is the identity to within rounding changes no
    /// geometry.
    pub(super) fn new(world: DAffine3, extent: f64) -> Self {
        if is_identity(&world, extent) {
            return Self::none();
        }
        let linear = world.matrix3;
        let cofactors = DMat3::from_cols(
            linear.y_axis.cross(linear.z_axis),
            linear.z_axis.cross(linear.x_axis),
            linear.x_axis.cross(linear.y_axis),
        );
        let flip = linear.determinant() < 0.0;
        Self { world, normal: if flip { cofactors * -1.0 } else { cofactors }, flip, identity: false }
    }

    pub(super) fn point(&self, point: Vec3) -> Vec3 {
        if self.identity { point } else { self.world.transform_point3(point.as_dvec3()).as_vec3() }
    }

    /// Transforms a displacement, or a tangent not yet of unit length.
    pub(super) fn vector(&self, vector: Vec3) -> Vec3 {
        if self.identity { vector } else { self.world.transform_vector3(vector.as_dvec3()).as_vec3() }
    }

    /// Transforms a unit normal; zero if the transform flattens it.
    pub(super) fn normal(&self, normal: Vec3) -> Vec3 {
        if self.identity { normal } else { (self.normal * normal.as_dvec3()).normalize_or_zero().as_vec3() }
    }

    /// Transforms the displacement of a unit normal, such that the sum of normal and displacement keeps its direction.
    pub(super) fn normal_offset(&self, normal: Vec3, offset: Vec3) -> Vec3 {
        if self.identity {
            return offset;
        }
        let scale = (self.normal * normal.as_dvec3()).length();
        if scale > 0.0 { (self.normal * offset.as_dvec3() * (1.0 / scale)).as_vec3() } else { offset }
    }
}
