#import bevy_pbr::{mesh_functions, view_transformations::position_world_to_clip}

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> color: vec4<f32>;

struct Vertex {
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3<f32>,
    @location(1) depth: f32,
    @location(2) tint: vec4<f32>,
};

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) color: vec4<f32>,
};

fn linear(srgb: vec3<f32>) -> vec3<f32> {
    let low = srgb / 12.92;
    let high = pow((srgb + 0.055) / 1.055, vec3(2.4));
    return select(high, low, srgb <= vec3(0.04045));
}

@vertex
fn vertex(vertex: Vertex) -> Corner {
    let world_from_local = mesh_functions::get_world_from_local(vertex.instance);
    let world = mesh_functions::mesh_position_local_to_world(world_from_local, vec4(vertex.position, 1.0));
    var corner: Corner;
    corner.position = position_world_to_clip(world.xyz);
    if vertex.depth > 0.0 {
        corner.position.z = vertex.depth * corner.position.w;
    }
    corner.color = vec4(linear(vertex.tint.rgb), vertex.tint.a) * color;
    return corner;
}

@fragment
fn fragment(corner: Corner) -> @location(0) vec4<f32> {
    return corner.color;
}
