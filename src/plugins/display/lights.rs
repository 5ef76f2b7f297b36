//! Lights attached to the camera, so that a mesh looks the same from every direction and no side of it is in the dark.

use bevy::{camera::Exposure, core_pipeline::tonemapping::Tonemapping, prelude::*};

/// Light for a camera that looks at meshes: a key light over its left shoulder, a dimmer fill light from its right, a
/// rim light from behind that sets outlines off, and light from all around. They cast no shadows, which would cost a
/// software renderer most of its time and hide edited parts.
///
/// The values are the brightness of a white matte surface that squarely faces the light, where 1 is white on the
/// screen. Their sum is about 1 on a surface that faces the camera, which with [`Tonemapping::None`] shows colours as
/// they were authored. The lights of several such cameras affect each other's pictures.
///
/// ```
/// # use bevy::prelude::*;
/// # use rigsmith::plugins::{display::ViewportLights, viewport::RigViewport};
/// fn setup(mut commands: Commands) {
///     commands.spawn((Camera3d::default(), RigViewport::default(), ViewportLights::default().bundle()));
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewportLights {
    /// Brightness of the key light.
    pub key: f32,
    /// Brightness of the fill light.
    pub fill: f32,
    /// Brightness of the rim light.
    pub rim: f32,
    /// Brightness of the light from all around.
    pub ambient: f32,
}

impl Default for ViewportLights {
    fn default() -> Self {
        Self { key: 0.78, fill: 0.2, rim: 0.4, ambient: 0.2 }
    }
}

impl ViewportLights {
    /// Components for the camera: the lights as its children, ambient light, exposure and no tone mapping.
    pub fn bundle(self) -> impl Bundle {
        let exposure = Exposure::BLENDER;
        // Illuminance at which a white surface that faces the light reflects 1: a matte surface spreads the light over
        // pi.
        let white = 1.0 / exposure.exposure();
        let light = |brightness: f32, from: Vec3| {
            (
                DirectionalLight {
                    illuminance: brightness * white * std::f32::consts::PI,
                    shadow_maps_enabled: false,
                    ..default()
                },
                Transform::from_translation(from).looking_at(Vec3::ZERO, Vec3::Y),
            )
        };
        let ambient = AmbientLight { brightness: self.ambient * white, ..default() };
        let lights = children![
            light(self.key, Vec3::new(-0.7, 0.9, 1.2)),
            light(self.fill, Vec3::new(1.2, -0.1, 0.8)),
            light(self.rim, Vec3::new(0.6, 0.8, -1.2)),
        ];
        (ambient, exposure, Tonemapping::None, lights)
    }
}
