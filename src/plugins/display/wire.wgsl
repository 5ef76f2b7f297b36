// Lines over a surface, a little nearer to the camera than they are.

#import bevy_pbr::{
    mesh_functions,
    mesh_view_bindings::view,
    skinning,
    forward_io::Vertex,
    view_transformations::position_world_to_clip,
}

struct Line {
    @builtin(position) position: vec4<f32>,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> color: vec4<f32>;

// How much nearer: a part of the distance in a perspective view, of the view's height in an orthographic one.
const NEARER: f32 = 0.001;

@vertex
fn vertex(in: Vertex) -> Line {
#ifdef SKINNED
    let world_from_local = skinning::skin_model(in.joint_indices, in.joint_weights, in.instance_index);
#else
    let world_from_local = mesh_functions::get_world_from_local(in.instance_index);
#endif
    let world = mesh_functions::mesh_position_local_to_world(world_from_local, vec4<f32>(in.position, 1.0));
    var out: Line;
    out.position = position_world_to_clip(world.xyz);
    // Depth is reversed: one is near, zero is far.
    if view.clip_from_view[3].w == 1.0 {
        let height = 2.0 / view.clip_from_view[1].y;
        out.position.z += height * NEARER * abs(view.clip_from_view[2].z);
    } else {
        out.position.z *= 1.0 + NEARER;
    }
    return out;
}

@fragment
fn fragment() -> @location(0) vec4<f32> {
    return color;
}
