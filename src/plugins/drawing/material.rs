//! Material of the drawing: unlit vertex colours, with a depth for each vertex.

use bevy::{
    asset::{load_internal_asset, uuid_handle},
    mesh::{MeshVertexAttribute, MeshVertexBufferLayoutRef, VertexFormat},
    pbr::{MaterialPipeline, MaterialPipelineKey},
    prelude::*,
    reflect::TypePath,
    render::{
        RenderApp,
        render_resource::{AsBindGroup, RenderPipelineDescriptor, SpecializedMeshPipelineError},
    },
    shader::{Shader, ShaderRef},
};

const SHADER: Handle<Shader> = uuid_handle!("6d9f44be-3a38-47b4-9d0e-5f5c0f1f3b7a");

/// Depth of a vertex, see [`Ink::depths`](super::ink::Ink::depths).
pub const DEPTH: MeshVertexAttribute =
    MeshVertexAttribute::new("Overlay_Depth", 0x7269_6773_6d01, VertexFormat::Float32);
/// sRGB colour of a vertex.
pub const TINT: MeshVertexAttribute =
    MeshVertexAttribute::new("Overlay_Tint", 0x7269_6773_6d02, VertexFormat::Unorm8x4);

/// Unlit material with vertex colours.
#[derive(Asset, TypePath, AsBindGroup, Debug, Clone)]
pub struct OverlayMaterial {
    /// Factor of all colours.
    #[uniform(0)]
    pub color: LinearRgba,
    /// Opaque or blended.
    pub alpha_mode: AlphaMode,
    /// Order among blended objects: later (positive) or earlier (negative) than objects at the same distance.
    pub order: f32,
}

impl Material for OverlayMaterial {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }

    fn alpha_mode(&self) -> AlphaMode {
        self.alpha_mode
    }

    fn depth_bias(&self) -> f32 {
        self.order
    }

    fn enable_prepass() -> bool {
        false
    }

    fn enable_shadows() -> bool {
        false
    }

    fn specialize(
        _pipeline: &MaterialPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        layout: &MeshVertexBufferLayoutRef,
        _key: MaterialPipelineKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        let attributes =
            [Mesh::ATTRIBUTE_POSITION.at_shader_location(0), DEPTH.at_shader_location(1), TINT.at_shader_location(2)];
        descriptor.vertex.buffers = vec![layout.0.get_layout(&attributes)?];
        descriptor.primitive.cull_mode = None;
        Ok(())
    }
}

/// Adds the material; its assets only, without a renderer.
pub(super) fn add_material(app: &mut App) {
    if app.get_sub_app(RenderApp).is_some() {
        load_internal_asset!(app, SHADER, "overlay.wgsl", Shader::from_wgsl);
        app.add_plugins(MaterialPlugin::<OverlayMaterial>::default());
    } else {
        app.init_asset::<OverlayMaterial>();
    }
}
