//! Systems that build pictures, and the entities that show them.

use bevy::{
    asset::RenderAssetUsages,
    camera::visibility::NoFrustumCulling,
    ecs::system::SystemParam,
    mesh::{Indices, PrimitiveTopology, VertexAttributeValues},
    prelude::*,
};

use super::{
    DrawingCounts, Ghosts, LETTER, LabelCandidate, LabelChoice, RigDrawing, RigLabels,
    controls::draw_controls,
    deform_joints::DeformingJoints,
    ghosts, grid,
    ink::Ink,
    label_places,
    material::{DEPTH, OverlayMaterial, TINT},
    skeleton::{DrawnJoint, Emphasis, ball_radii, bones, draw_skeleton, drawn_joints},
    theme::group_tint,
};
use crate::{
    plugins::{
        controls::{ControlsInUse, NodeVisible, density::CrowdedControl, outline::ControlNodes, size::ShapeFactor},
        document::{HoveredNode, Joint, JointEntities, NodeOf, Selection, Symmetry},
        schema::{Control, NodeLayer, RigNodes},
        surface::{RigMesh, RigMeshes},
        viewport::{RigViewport, Sight},
    },
    rig::Rig,
};

/// The materials of all pictures.
#[derive(Resource)]
pub(super) struct PictureMaterials {
    solid: Handle<OverlayMaterial>,
    /// Blended material, drawn after everything else.
    glass: Handle<OverlayMaterial>,
    /// Blended material, drawn before everything else.
    ground: Handle<OverlayMaterial>,
}

impl FromWorld for PictureMaterials {
    fn from_world(world: &mut World) -> Self {
        let mut materials = world.resource_mut::<Assets<OverlayMaterial>>();
        let mut add =
            |alpha_mode, order| materials.add(OverlayMaterial { color: LinearRgba::WHITE, alpha_mode, order });
        Self {
            solid: add(AlphaMode::Opaque, 0.0),
            glass: add(AlphaMode::Blend, 1e6),
            ground: add(AlphaMode::Blend, -1e6),
        }
    }
}

/// Rig of a picture's entity.
#[derive(Component, Debug)]
#[relationship(relationship_target = Pictures)]
pub(super) struct PictureOf(Entity);

/// The pictures of a rig.
#[derive(Component, Debug)]
#[relationship_target(relationship = PictureOf, linked_spawn)]
pub(super) struct Pictures(Vec<Entity>);

/// A picture: its entity and the view it was built for.
#[derive(Debug, Default)]
pub(super) struct Picture {
    entity: Option<Entity>,
    sight: Option<Sight>,
    ink: Ink,
}

impl Picture {
    /// Returns `true` if the picture has to be built again for this view.
    fn is_stale(&self, sight: Option<&Sight>) -> bool {
        self.sight.as_ref() != sight
    }
}

/// Pictures of a rig, and the extent of its symmetry plane.
#[derive(Component, Debug, Default)]
pub(super) struct RigPictures {
    skeleton: Picture,
    ghosts: Picture,
    plane: Picture,
    bounds: Option<[Vec3; 2]>,
    deforming: DeformingJoints,
}

/// Access to the entities of pictures: spawns, fills and hides them.
#[derive(SystemParam)]
pub(super) struct PictureEntities<'w, 's> {
    commands: Commands<'w, 's>,
    meshes: ResMut<'w, Assets<Mesh>>,
    shown: Query<
        'w,
        's,
        (&'static Mesh3d, &'static mut Visibility, &'static mut GlobalTransform),
        (With<OverlayMesh>, Without<Control>),
    >,
}

/// Marks entities that show pictures.
#[derive(Component, Debug)]
pub(super) struct OverlayMesh;

impl PictureEntities<'_, '_> {
    /// Shows a picture with its ink.
    fn show(
        &mut self,
        picture: &mut Picture,
        of: Option<Entity>,
        place: GlobalTransform,
        look: &Handle<OverlayMaterial>,
    ) {
        let visibility = if picture.ink.is_empty() { Visibility::Hidden } else { Visibility::Visible };
        let entity = picture.entity.filter(|entity| self.shown.contains(*entity));
        let Some(entity) = entity else {
            // An empty mesh cannot be drawn.
            if picture.ink.is_empty() {
                return;
            }
            let mesh = self.meshes.add(mesh_of(&mut picture.ink));
            let bundle = (OverlayMesh, Mesh3d(mesh), MeshMaterial3d(look.clone()), NoFrustumCulling, visibility);
            let mut spawned = self.commands.spawn((bundle, Transform::from_matrix(place.to_matrix()), place));
            if let Some(rig) = of {
                spawned.insert(PictureOf(rig));
            }
            picture.entity = Some(spawned.id());
            return;
        };
        let Ok((mesh, mut shown, mut stands)) = self.shown.get_mut(entity) else { return };
        shown.set_if_neq(visibility);
        stands.set_if_neq(place);
        if !picture.ink.is_empty() {
            // The handle is alive, so its slot exists.
            let _ = self.meshes.insert(mesh.id(), mesh_of(&mut picture.ink));
        }
    }
}

/// Moves ink into a mesh.
fn mesh_of(ink: &mut Ink) -> Mesh {
    let ink = std::mem::take(ink);
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, ink.positions)
        .with_inserted_attribute(DEPTH, ink.depths)
        .with_inserted_attribute(TINT, VertexAttributeValues::Unorm8x4(ink.tints))
        .with_inserted_indices(Indices::U32(ink.indices))
}

/// Access to the view of the active viewport camera.
#[derive(SystemParam)]
pub(super) struct Views<'w, 's> {
    cameras: Query<
        'w,
        's,
        (Entity, &'static Camera, &'static GlobalTransform, &'static Projection, &'static RigViewport),
        Without<OverlayMesh>,
    >,
}

impl Views<'_, '_> {
    /// View of an object at `place`.
    fn sight(&self, place: &GlobalTransform) -> Option<Sight> {
        let active = self.cameras.iter().filter(|(_, camera, ..)| camera.is_active);
        let (_, camera, eye, projection, viewport) =
            active.min_by_key(|(entity, camera, ..)| (camera.order, *entity))?;
        Sight::new(eye, projection, viewport, camera.logical_viewport_size()?, place)
    }
}

/// Adds the drawing's state to rigs, and updates the extents of their symmetry planes.
pub(super) fn frame_planes(
    mut commands: Commands,
    fresh: Query<Entity, (With<Rig>, Without<RigPictures>)>,
    mut rigs: Query<(&mut RigPictures, &Rig, Ref<Symmetry>, Option<Ref<RigMeshes>>)>,
    meshes: Query<&RigMesh>,
) {
    for rig in &fresh {
        commands.entity(rig).insert((RigPictures::default(), RigLabels::default()));
    }
    for (mut drawn, rig, symmetry, bound) in &mut rigs {
        let changed = symmetry.is_changed() || bound.as_ref().is_some_and(|bound| bound.is_changed());
        if symmetry.0.is_none() || !(changed || drawn.bounds.is_none()) {
            continue;
        }
        let models = bound.iter().flat_map(|bound| bound.iter()).filter_map(|mesh| meshes.get(mesh).ok());
        let points = models.flat_map(|mesh| mesh.rest.points.iter().copied()).filter(|point| point.is_finite());
        let joints = rig.rest_globals().into_iter().map(|(_, global)| global.translation);
        let [low, high] =
            points.chain(joints).fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)]);
        let bounds = if low.cmple(high).all() { [low, high] } else { [Vec3::splat(-0.5), Vec3::splat(0.5)] };
        drawn.bounds = Some(bounds);
        drawn.plane.sight = None;
    }
}

/// A node that looks otherwise than in the frame before.
type NodeRedrawn = Or<(
    Changed<GlobalTransform>,
    Changed<NodeVisible>,
    Changed<Control>,
    Changed<NodeLayer>,
    Changed<ShapeFactor>,
    Changed<CrowdedControl>,
)>;

/// Builds the pictures of rigs.
pub(super) fn draw_rigs(
    settings: Res<RigDrawing>,
    materials: Res<PictureMaterials>,
    views: Views,
    mut rigs: Query<
        (
            Entity,
            Ref<Rig>,
            Ref<Selection>,
            Ref<HoveredNode>,
            &JointEntities,
            &GlobalTransform,
            Option<&RigNodes>,
            &mut RigPictures,
            &mut RigLabels,
        ),
        Without<OverlayMesh>,
    >,
    moved: Query<&NodeOf, (NodeRedrawn, Without<OverlayMesh>)>,
    poses: Query<(&GlobalTransform, Option<&NodeVisible>, Option<&NodeLayer>), (With<Joint>, Without<OverlayMesh>)>,
    controls: ControlNodes,
    in_use: Res<ControlsInUse>,
    mut gallery: PictureEntities,
    mut counts: ResMut<DrawingCounts>,
) {
    for (entity, rig, selection, hovered, entities, place, nodes, mut drawn, mut labels) in &mut rigs {
        let sight = views.sight(place).filter(|_| settings.rig);
        let changed = rig.is_changed()
            || selection.is_changed()
            || hovered.is_changed()
            || settings.is_changed()
            || in_use.is_changed();
        let stale = changed || drawn.skeleton.is_stale(sight.as_ref());
        let posed = || moved.iter().any(|joint| joint.0 == entity);
        if !stale && !posed() {
            continue;
        }
        let RigPictures { skeleton: drawn, deforming, .. } = drawn.bypass_change_detection();
        drawn.sight = sight;
        let mut texts = Vec::new();
        if let Some(sight) = &sight {
            let to_rig = place.affine().inverse();
            let node = |uid| entities.get(uid).and_then(|joint| poses.get(joint).ok());
            let mut joints = drawn_joints(&rig, &selection, &hovered, |uid| Some(to_rig * node(uid)?.0.affine()));
            for joint in &mut joints {
                let Some((_, visible, layer)) = node(joint.uid) else { continue };
                joint.hidden = visible.is_some_and(|visible| !visible.0);
                joint.color = layer.and_then(|layer| layer.0.color).map(group_tint).or(joint.color);
            }
            if settings.deforming {
                let deforming = deforming.of(&rig);
                let color = |deforms| if deforms { settings.theme.deforming } else { settings.theme.idle };
                joints.iter_mut().for_each(|joint| joint.color = Some(color(deforming.contains(&joint.uid))));
            }
            if !settings.bones {
                let is_in_use = |joint: &DrawnJoint| joint.hovered || joint.emphasis != Emphasis::None;
                joints.iter_mut().filter(|joint| !is_in_use(joint)).for_each(|joint| joint.hidden = true);
            }
            texts = labels_of(&rig, &joints, sight, &settings);
            let written: &[(Vec2, String)] = if settings.write_labels { &texts } else { &[] };
            draw_skeleton(&joints, written, sight, &settings, &mut drawn.ink);
            if settings.controls && in_use.0 {
                let controls = controls.visible(nodes, to_rig);
                draw_controls(&controls, &selection, &hovered, sight, &settings.theme, &mut drawn.ink);
            }
        }
        labels.set_if_neq(RigLabels(texts));
        gallery.show(drawn, Some(entity), *place, &materials.solid);
        counts.rigs += 1;
    }
}

/// Labels chosen by [`RigDrawing::labels`].
fn labels_of(rig: &Rig, joints: &[DrawnJoint], sight: &Sight, settings: &RigDrawing) -> Vec<(Vec2, String)> {
    if settings.labels == LabelChoice::None {
        return Vec::new();
    }
    let radii = ball_radii(joints, &bones(joints), sight, settings.ball_scale);
    let candidates: Vec<LabelCandidate> = joints
        .iter()
        .zip(radii)
        .filter_map(|(joint, radius)| {
            let rank = match joint.emphasis {
                _ if joint.hidden && !settings.bones => return None,
                _ if joint.hovered => 3,
                Emphasis::Active => 2,
                Emphasis::Selected => 1,
                Emphasis::None if settings.labels == LabelChoice::Selected => return None,
                Emphasis::None => 0,
            };
            let text = rig.joint(joint.uid)?.data.label.as_deref()?;
            // Room for the mark of a root and the ring of a hovered joint.
            let mark = if joint.hovered || joint.parent.is_none() { 7.0 } else { 0.0 };
            Some(LabelCandidate { position: joint.position, radius: radius + mark, text, rank })
        })
        .collect();
    label_places(sight, &candidates, LETTER)
}

/// Builds the pictures of ghosts.
pub(super) fn draw_ghosts(
    settings: Res<RigDrawing>,
    materials: Res<PictureMaterials>,
    wanted: Res<Ghosts>,
    views: Views,
    mut rigs: Query<(Entity, &GlobalTransform, &mut RigPictures), Without<OverlayMesh>>,
    mut gallery: PictureEntities,
    mut counts: ResMut<DrawingCounts>,
) {
    for (entity, place, mut drawn) in &mut rigs {
        let meant = wanted.rig.is_none_or(|rig| rig == entity) && !wanted.is_empty();
        let picture = &mut drawn.bypass_change_detection().ghosts;
        let sight = views.sight(place).filter(|_| meant);
        if !picture.is_stale(sight.as_ref()) && (sight.is_none() || !(wanted.is_changed() || settings.is_changed())) {
            continue;
        }
        picture.sight = sight;
        if let Some(sight) = &sight {
            ghosts::draw_ghosts(&wanted, sight, &settings.theme, settings.ball_scale, &mut picture.ink);
        }
        gallery.show(picture, Some(entity), *place, &materials.glass);
        counts.ghosts += 1;
    }
}

/// Builds the pictures of symmetry planes.
pub(super) fn draw_planes(
    settings: Res<RigDrawing>,
    materials: Res<PictureMaterials>,
    views: Views,
    mut rigs: Query<(Entity, &GlobalTransform, &Symmetry, &mut RigPictures), Without<OverlayMesh>>,
    mut gallery: PictureEntities,
    mut counts: ResMut<DrawingCounts>,
) {
    for (entity, place, symmetry, mut drawn) in &mut rigs {
        let drawn = drawn.bypass_change_detection();
        let shown = symmetry.0.zip(drawn.bounds).filter(|_| settings.plane);
        let picture = &mut drawn.plane;
        let sight = views.sight(place).filter(|_| shown.is_some());
        if !picture.is_stale(sight.as_ref()) && (sight.is_none() || !settings.is_changed()) {
            continue;
        }
        picture.sight = sight;
        if let (Some(sight), Some((plane, bounds))) = (&sight, shown) {
            ghosts::draw_plane(&plane, bounds, sight, &settings.theme, &mut picture.ink);
        }
        gallery.show(picture, Some(entity), *place, &materials.glass);
        counts.planes += 1;
    }
}

/// Builds the picture of the grid.
pub(super) fn draw_grid(
    settings: Res<RigDrawing>,
    materials: Res<PictureMaterials>,
    views: Views,
    mut picture: Local<Picture>,
    mut gallery: PictureEntities,
    mut counts: ResMut<DrawingCounts>,
) {
    let place = GlobalTransform::IDENTITY;
    let sight = views.sight(&place).filter(|_| settings.grid);
    if !picture.is_stale(sight.as_ref()) && (sight.is_none() || !settings.is_changed()) {
        return;
    }
    picture.sight = sight;
    if let Some(sight) = &sight {
        grid::draw_grid(sight, &settings.theme, &mut picture.ink);
    }
    gallery.show(&mut picture, None, place, &materials.ground);
    counts.grid += 1;
}
