//! Edges over a surface: thin lines, drawn a little nearer to the camera so that the surface does not hide them.

use bevy::{
    asset::{load_internal_asset, uuid_handle},
    mesh::MeshVertexBufferLayoutRef,
    pbr::{MaterialPipeline, MaterialPipelineKey},
    prelude::*,
    render::{
        RenderApp,
        render_resource::{AsBindGroup, RenderPipelineDescriptor, SpecializedMeshPipelineError},
    },
    shader::{Shader, ShaderRef},
};

const SHADER: Handle<Shader> = uuid_handle!("0f0c41d7-93a5-4b5e-9a61-6f2a0a4d5be3");

/// Adds the material; its assets only, without a renderer.
pub(super) fn add_wire(app: &mut App) {
    if app.get_sub_app(RenderApp).is_some() {
        load_internal_asset!(app, SHADER, "wire.wgsl", Shader::from_wgsl);
        app.add_plugins(MaterialPlugin::<WireMaterial>::default());
    } else {
        app.init_asset::<WireMaterial>();
    }
}

/// Draws line lists in one colour, with or without skinning. The graphics pipeline biases the depth of triangles only,
/// so the vertex shader does it.
#[derive(Asset, TypePath, AsBindGroup, Debug, Clone, PartialEq)]
pub struct WireMaterial {
    /// The lines' colour.
    #[uniform(0)]
    pub color: LinearRgba,
}

impl Material for WireMaterial {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }

    fn alpha_mode(&self) -> AlphaMode {
        AlphaMode::Blend
    }

    fn depth_bias(&self) -> f32 {
        // The order among blended objects: after see-through surfaces, before the rig's picture.
        1e5
    }

    fn enable_prepass() -> bool {
        false
    }

    fn enable_shadows() -> bool {
        false
    }

    fn specialize(
        _: &MaterialPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        _: &MeshVertexBufferLayoutRef,
        _: MaterialPipelineKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        descriptor.primitive.cull_mode = None;
        Ok(())
    }
}
