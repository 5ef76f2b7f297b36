//! Vertex attributes of a primitive: decoded once, selected by index, and repaired where a file is careless.

use std::{cell::RefCell, collections::BTreeMap, mem::size_of, rc::Rc};

use glam::{Vec2, Vec3, Vec4};

use super::{GltfError, accessor::Source, budget::Notes};

/// Decoder of accessors that decodes each once, however many primitives share it.
pub(super) struct Decoder<'a> {
    pub(super) source: &'a Source<'a>,
    pub(super) notes: &'a Notes,
    cache: RefCell<BTreeMap<usize, Rc<Vec<f32>>>>,
}

impl<'a> Decoder<'a> {
    pub(super) fn new(source: &'a Source<'a>, notes: &'a Notes) -> Self {
        Self { source, notes, cache: RefCell::default() }
    }

    /// Elements of an accessor as a flat list, `width` numbers each.
    pub(super) fn all(&self, accessor: usize, width: usize) -> Result<Rc<Vec<f32>>, GltfError> {
        if let Some(known) = self.cache.borrow().get(&accessor)
            && self.source.document.accessors[accessor].width == width
        {
            return Ok(known.clone());
        }
        let floats = Rc::new(self.source.floats(accessor, width)?);
        self.cache.borrow_mut().insert(accessor, floats.clone());
        Ok(floats)
    }

    /// Elements of an accessor at the indices `pick`; the whole accessor for `None`.
    pub(super) fn pick<const N: usize, T>(
        &self,
        accessor: usize,
        pick: Option<&[u32]>,
        make: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, GltfError> {
        let flat = self.all(accessor, N)?;
        let (elements, _) = flat.as_chunks::<N>();
        let count = pick.map_or(elements.len(), <[u32]>::len);
        self.source.budget.take(count, size_of::<T>(), &format!("/accessors/{accessor}"))?;
        Ok(match pick {
            None => elements.iter().map(|element| make(*element)).collect(),
            Some(pick) => pick.iter().map(|&i| make(elements[i as usize])).collect(),
        })
    }

    /// Displacements; a value that is not finite is an error.
    pub(super) fn offsets(&self, accessor: usize, pick: Option<&[u32]>) -> Result<Vec<Vec3>, GltfError> {
        let offsets = self.pick(accessor, pick, Vec3::from_array)?;
        match offsets.iter().position(|offset| !offset.is_finite()) {
            None => Ok(offsets),
            Some(at) => Err(GltfError::at(format!("/accessors/{accessor}"), format!("element {at} is not finite"))),
        }
    }

    /// Unit normals; zero where the file has none.
    pub(super) fn normals(&self, accessor: usize, pick: Option<&[u32]>) -> Result<Vec<Vec3>, GltfError> {
        self.pick(accessor, pick, |normal| unit(Vec3::from_array(normal)))
    }

    /// Tangents of unit length with a sign; a tangent without direction is replaced by one at right angles to the
    /// normal.
    pub(super) fn tangents(
        &self,
        accessor: usize,
        pick: Option<&[u32]>,
        normals: &[Vec3],
    ) -> Result<Vec<Vec4>, GltfError> {
        let mut tangents = self.pick(accessor, pick, Vec4::from_array)?;
        let mut made_up = 0;
        for (tangent, normal) in tangents.iter_mut().zip(normals) {
            let mut direction = unit(tangent.truncate());
            if direction == Vec3::ZERO {
                direction = normal.any_orthonormal_vector();
                made_up += 1;
            }
            *tangent = direction.extend(if tangent.w < 0.0 { -1.0 } else { 1.0 });
        }
        self.notes.add_times("A tangent without direction was replaced", made_up);
        Ok(tangents)
    }

    /// Texture coordinates.
    pub(super) fn uvs(&self, accessor: usize, pick: Option<&[u32]>) -> Result<Vec<Vec2>, GltfError> {
        let mut uvs = self.pick(accessor, pick, Vec2::from_array)?;
        let mut broken = 0;
        for uv in uvs.iter_mut().filter(|uv| !uv.is_finite()) {
            *uv = Vec2::ZERO;
            broken += 1;
        }
        self.notes.add_times("A texture coordinate that was not finite was set to zero", broken);
        Ok(uvs)
    }

    /// Colours from 0 to 1.
    pub(super) fn colors(&self, accessor: usize, pick: Option<&[u32]>) -> Result<Vec<Vec4>, GltfError> {
        let mut colors = match self.source.document.accessors[accessor].width {
            3 => self.pick(accessor, pick, |[r, g, b]| Vec4::new(r, g, b, 1.0))?,
            _ => self.pick(accessor, pick, Vec4::from_array)?,
        };
        let mut clamped = 0;
        for color in &mut colors {
            let right = color.to_array().map(|channel| if channel.is_nan() { 0.0 } else { channel.clamp(0.0, 1.0) });
            if *color != Vec4::from_array(right) {
                *color = Vec4::from_array(right);
                clamped += 1;
            }
        }
        self.notes.add_times("A vertex colour outside 0 to 1 was clamped", clamped);
        Ok(colors)
    }
}

/// A direction of unit length: a unit vector keeps its bits, a vector without direction becomes zero.
pub(super) fn unit(vector: Vec3) -> Vec3 {
    let length = vector.as_dvec3().length();
    if (length - 1.0).abs() <= 1e-4 {
        vector
    } else if length.is_finite() && length > 1e-20 {
        (vector.as_dvec3() * (1.0 / length)).as_vec3()
    } else {
        Vec3::ZERO
    }
}

/// Fills normals that are zero with those of the triangles around, weighted by area.
pub(super) fn fill_normals(normals: &mut [Vec3], triangles: &[[u32; 3]], position: impl Fn(u32) -> Vec3) {
    if !normals.contains(&Vec3::ZERO) {
        return;
    }
    let mut sums = vec![glam::DVec3::ZERO; normals.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| position(vertex).as_dvec3());
        let area = (b - a).cross(c - a);
        for vertex in triangle {
            sums[*vertex as usize] += area;
        }
    }
    for (normal, sum) in normals.iter_mut().zip(sums).filter(|(normal, _)| **normal == Vec3::ZERO) {
        *normal = sum.try_normalize().unwrap_or(glam::DVec3::Y).as_vec3();
    }
}
