//! Accessors: typed elements in buffers (section 3.6), with strides, normalised integers and sparse substitution.

use std::mem::size_of;

use glam::Mat4;

use super::{
    GltfError,
    budget::Budget,
    document::{BufferBytes, Document},
    json::JsonObject,
};

/// A range of a buffer; checked to lie inside it.
#[derive(Clone, Copy)]
pub(super) struct View {
    pub(super) buffer: usize,
    pub(super) offset: usize,
    pub(super) length: usize,
    pub(super) stride: Option<usize>,
}

/// The type of an element's components.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_code(code: usize) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The component at the start of `bytes`, which are long enough, as a float (section 3.11 for normalised ones).
    fn float(self, bytes: &[u8], normalized: bool) -> f32 {
        let scaled = |value: f32, range: f32| if normalized { (value / range).max(-1.0) } else { value };
        match self {
            Self::I8 => scaled(f32::from(bytes[0] as i8), 127.0),
            Self::U8 => scaled(f32::from(bytes[0]), 255.0),
            Self::I16 => scaled(f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
            Self::U16 => scaled(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
            Self::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f32,
            Self::F32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }

    /// The component as an unsigned number; signed and float ones are refused before.
    fn uint(self, bytes: &[u8]) -> u32 {
        match self {
            Self::I8 | Self::U8 => u32::from(bytes[0]),
            Self::I16 | Self::U16 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            Self::U32 | Self::F32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }
}

/// Number of elements, their size, and their distance if the view does not give one.
#[derive(Clone, Copy)]
struct Layout {
    count: usize,
    size: usize,
    packed: usize,
}

/// Location of elements: in a view, `offset` bytes from its start, `stride` apart.
struct Place {
    view: usize,
    offset: usize,
    stride: usize,
}

/// Elements that replace those of the accessor at some indices.
struct Sparse {
    count: usize,
    indices: Place,
    index_component: Component,
    values: Place,
}

/// An accessor whose ranges lie inside its views.
pub(super) struct Accessor {
    pub(super) count: usize,
    /// Component type; `None` for an unknown type.
    pub(super) component: Option<Component>,
    /// Number of components of an element; zero for an unknown type.
    pub(super) width: usize,
    pub(super) normalized: bool,
    place: Option<Place>,
    sparse: Option<Box<Sparse>>,
}

impl Accessor {
    pub(super) fn new(at: &JsonObject, views: &[View]) -> Result<Self, GltfError> {
        let count = at.need("count", at.uint("count")?)?;
        let component = Component::from_code(at.need("componentType", at.uint("componentType")?)?);
        let kind = at.need("type", at.text("type")?)?;
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            _ => 0,
        };
        // Columns of matrices begin at multiples of four bytes.
        let (size, packed) = match (kind, component.map_or(0, Component::size)) {
            ("MAT2", 1) => (6, 8),
            ("MAT3", 1) => (11, 12),
            ("MAT3", 2) => (22, 24),
            (_, size) => (size * width, size * width),
        };
        let layout = Layout { count, size, packed };
        let view = at.index("bufferView", views.len(), "buffer view")?;
        let offset = at.uint("byteOffset")?.unwrap_or(0);
        let place = view.map(|view| place(at, view, offset, layout, views)).transpose()?;
        let sparse = match at.object("sparse")? {
            None => None,
            Some(at) => Some(Box::new(sparse(&at, layout, views)?)),
        };
        Ok(Self { count, component, width, normalized: at.flag("normalized")?, place, sparse })
    }
}

impl Accessor {
    /// Returns `true` if no bytes belong to the accessor, so that all its elements are zero.
    pub(super) fn is_empty(&self) -> bool {
        self.place.is_none() && self.sparse.is_none()
    }
}

/// Checks that `count` elements of `size` bytes fit into the view.
fn place(at: &JsonObject, view: usize, offset: usize, layout: Layout, views: &[View]) -> Result<Place, GltfError> {
    let Layout { count, size, packed } = layout;
    let View { length, stride, .. } = views[view];
    let stride = stride.unwrap_or(packed);
    if stride < size {
        let what = format!("elements of {size} bytes every {stride} bytes of buffer view {view}");
        return Err(at.fail("byteOffset", what));
    }
    let end = match count {
        0 => Some(offset),
        _ => stride.checked_mul(count - 1).and_then(|last| last.checked_add(size)?.checked_add(offset)),
    };
    if end.is_none_or(|end| end > length) {
        let what = format!(
            "{count} elements of {size} bytes, {stride} apart, from byte {offset} reach beyond buffer view {view}, \
             which has {length} bytes"
        );
        return Err(at.fail("byteOffset", what));
    }
    Ok(Place { view, offset, stride })
}

fn sparse(at: &JsonObject, layout: Layout, views: &[View]) -> Result<Sparse, GltfError> {
    let count = at.need("count", at.uint("count")?)?;
    if count > layout.count {
        return Err(at.fail("count", format!("{count} of {} elements are replaced", layout.count)));
    }
    // Sparse data is packed, whatever the view says.
    let part = |at: &JsonObject, size: usize, packed: usize| {
        let view = at.need("bufferView", at.index("bufferView", views.len(), "buffer view")?)?;
        let offset = at.uint("byteOffset")?.unwrap_or(0);
        let unstrided = [View { stride: None, ..views[view] }];
        let found = place(at, 0, offset, Layout { count, size, packed }, &unstrided)?;
        Ok::<_, GltfError>(Place { view, ..found })
    };
    let of_indices = at.need("indices", at.object("indices")?)?;
    let code = of_indices.need("componentType", of_indices.uint("componentType")?)?;
    let index_component = match Component::from_code(code) {
        Some(kind @ (Component::U8 | Component::U16 | Component::U32)) => kind,
        _ => return Err(of_indices.fail("componentType", "must be 5121, 5123 or 5125 (unsigned)")),
    };
    let indices = part(&of_indices, index_component.size(), index_component.size())?;
    let values = part(&at.need("values", at.object("values")?)?, layout.size, layout.packed)?;
    Ok(Sparse { count, indices, index_component, values })
}

/// The document with the bytes of its buffers.
pub(super) struct Source<'a> {
    pub(super) document: &'a Document<'a>,
    buffers: &'a [Option<BufferBytes<'a>>],
    pub(super) budget: &'a Budget,
}

impl<'a> Source<'a> {
    pub(super) fn new(document: &'a Document<'a>, buffers: &'a [Option<BufferBytes<'a>>], budget: &'a Budget) -> Self {
        Self { document, buffers, budget }
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&'a [u8], GltfError> {
        let View { buffer, offset, length, .. } = self.document.views[index];
        let bytes = self.buffers[buffer].as_deref();
        bytes.and_then(|bytes| bytes.get(offset..offset + length)).ok_or_else(|| {
            GltfError::at(format!("/bufferViews/{index}/buffer"), format!("buffer {buffer} has no data"))
        })
    }

    /// Reads all elements as floats, flat, `width` an element. Fails if the accessor has another width.
    pub(super) fn floats(&self, index: usize, width: usize) -> Result<Vec<f32>, GltfError> {
        let normalized = self.document.accessors[index].normalized;
        self.read(index, width, 0.0, |component, bytes| component.float(bytes, normalized))
    }

    /// Reads all elements as unsigned numbers.
    pub(super) fn uints(&self, index: usize, width: usize) -> Result<Vec<u32>, GltfError> {
        match self.document.accessors[index].component {
            Some(Component::U8 | Component::U16 | Component::U32) => {
                self.read(index, width, 0, |component, bytes| component.uint(bytes))
            }
            _ => Err(GltfError::at(format!("/accessors/{index}/componentType"), "must be unsigned whole numbers here")),
        }
    }

    fn read<T: Copy>(
        &self,
        index: usize,
        width: usize,
        zero: T,
        decode: impl Fn(Component, &[u8]) -> T,
    ) -> Result<Vec<T>, GltfError> {
        let accessor = &self.document.accessors[index];
        let place = format!("/accessors/{index}");
        let Some(component) = accessor.component else {
            return Err(GltfError::at(format!("{place}/componentType"), "is not a component type of glTF 2.0"));
        };
        if accessor.width != width {
            let what = format!("has {} components an element, {width} are needed here", accessor.width);
            return Err(GltfError::at(format!("{place}/type"), what));
        }
        self.budget.take(accessor.count, width * size_of::<T>(), &place)?;
        let step = component.size();
        let mut out = Vec::with_capacity(accessor.count * width);
        match &accessor.place {
            None => out.resize(accessor.count * width, zero),
            Some(at) => {
                let bytes = &self.view(at.view)?[at.offset..];
                for element in 0..accessor.count {
                    let element = &bytes[element * at.stride..];
                    out.extend((0..width).map(|i| decode(component, &element[i * step..])));
                }
            }
        }
        if let Some(sparse) = &accessor.sparse {
            let indices = &self.view(sparse.indices.view)?[sparse.indices.offset..];
            let values = &self.view(sparse.values.view)?[sparse.values.offset..];
            for entry in 0..sparse.count {
                let at = sparse.index_component.uint(&indices[entry * sparse.indices.stride..]) as usize;
                let Some(target) = out.chunks_exact_mut(width).nth(at) else {
                    let what = format!("entry {entry} is for element {at} of {}", accessor.count);
                    return Err(GltfError::at(format!("{place}/sparse/indices"), what));
                };
                let value = &values[entry * sparse.values.stride..];
                for (i, target) in target.iter_mut().enumerate() {
                    *target = decode(component, &value[i * step..]);
                }
            }
        }
        Ok(out)
    }

    /// Reads floats as [`Source::floats`] does; an error names the first element that is not finite.
    pub(super) fn finite(&self, index: usize, width: usize) -> Result<Vec<f32>, GltfError> {
        let floats = self.floats(index, width)?;
        match floats.iter().position(|value| !value.is_finite()) {
            None => Ok(floats),
            Some(at) => {
                Err(GltfError::at(format!("/accessors/{index}"), format!("element {} is not finite", at / width)))
            }
        }
    }

    /// Reads matrices of finite floats.
    pub(super) fn matrices(&self, index: usize) -> Result<Vec<Mat4>, GltfError> {
        if self.document.accessors[index].component != Some(Component::F32) {
            return Err(GltfError::at(format!("/accessors/{index}/componentType"), "matrices must be floats (5126)"));
        }
        Ok(self.finite(index, 16)?.chunks_exact(16).map(Mat4::from_cols_slice).collect())
    }
}
