//! Updates of the picture after changes of meshes, weights, rest poses and display settings.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use bevy::{
    mesh::skinning::SkinnedMeshInverseBindposes,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use super::{
    DisplayJob, DisplayNote, DisplayPiece, MeshDisplay, Shading, WeightColors,
    build::RIG,
    layer::{Layer, LayerKey, Plans, ShownPiece},
    materials::{self, Materials},
    textures::TextureError,
    wire::WireMaterial,
};
use crate::{
    mesh::model::Model,
    plugins::{
        commands::{BuildResult, BuiltEntities},
        document::JointEntities,
        runtime::RigRuntime,
        skinning::{InstanceBody, InstanceSkin},
        surface::{RigMesh, SkinOf},
    },
    rig::{Rig, Uid, deform::DeformSkeleton},
};

/// Picture of a mesh.
#[derive(Component)]
pub(super) struct DisplayedMesh {
    model: Arc<Model>,
    plans: Plans,
    surface: Layer,
    edges: Layer,
    materials: Vec<StandardMaterial>,
    textures: Option<TextureJob>,
    piece_materials: BTreeMap<PieceMaterial, Handle<StandardMaterial>>,
    /// Marks that pieces have arrived, or their materials changed, in this frame.
    fresh: bool,
}

/// Material of a piece of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct PieceMaterial {
    look: Look,
    xray: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Look {
    Material(usize),
    Clay,
    Painted,
}

/// Images that are being decoded.
struct TextureJob {
    task: Task<()>,
    queue: Arc<Mutex<Vec<(Handle<Image>, Result<Image, TextureError>)>>>,
    /// Materials with their textures, used once all textures are decoded.
    materials: Vec<StandardMaterial>,
    total: usize,
    landed: usize,
    missing: Vec<AssetId<Image>>,
}

/// The materials of edges.
#[derive(Resource)]
pub(super) struct EdgeMaterials {
    solid: Handle<WireMaterial>,
    xray: Handle<WireMaterial>,
}

impl FromWorld for EdgeMaterials {
    fn from_world(world: &mut World) -> Self {
        let mut materials = world.resource_mut::<Assets<WireMaterial>>();
        let solid = materials.add(WireMaterial { color: LinearRgba::new(0.0, 0.0, 0.0, 0.55) });
        let xray = materials.add(WireMaterial { color: LinearRgba::new(0.55, 0.62, 0.70, 0.35) });
        Self { solid, xray }
    }
}

/// Puts meshes below their rigs, where they are drawn, and removes the pictures of meshes without a rig.
pub(super) fn place_meshes(
    mut commands: Commands,
    placed: Query<(Entity, &SkinOf, Option<&ChildOf>), (With<RigMesh>, Or<(Added<RigMesh>, Changed<SkinOf>)>)>,
    gone: Query<(Entity, &DisplayedMesh), Or<(Without<RigMesh>, Without<SkinOf>)>>,
    orphans: Query<Entity, (With<DisplayPiece>, Without<ChildOf>)>,
) {
    for (mesh, of, child_of) in &placed {
        if child_of.is_none_or(|child_of| child_of.parent() != of.0) {
            let mut entity = commands.entity(mesh);
            entity.try_insert_if_new((Transform::default(), Visibility::default())).try_insert(ChildOf(of.0));
            commands.entity(of.0).try_insert_if_new((Transform::default(), Visibility::default()));
        }
    }
    for (mesh, displayed) in &gone {
        for piece in displayed.surface.entities().chain(displayed.edges.entities()) {
            commands.entity(piece).try_despawn();
        }
        commands.entity(mesh).try_remove::<(DisplayedMesh, DisplayJob)>();
    }
    // Pieces that were spawned in the same frame in which their mesh was removed.
    for piece in &orphans {
        commands.entity(piece).try_despawn();
    }
}

/// Starts to build missing pieces.
pub(super) fn start_jobs(
    mut commands: Commands,
    display: Res<MeshDisplay>,
    mut meshes: Query<(Entity, Ref<RigMesh>, &SkinOf, Option<Ref<InstanceSkin>>, Option<&mut DisplayedMesh>)>,
    rigs: Query<Ref<Rig>>,
    bodies: Query<(), With<InstanceBody>>,
    images: Res<Assets<Image>>,
) {
    for (entity, mesh, of, shared, displayed) in &mut meshes {
        let (skin, is_other) = match (rigs.get(of.0), shared) {
            (Ok(rig), _) => (rig.skin(mesh.uid).cloned(), rig.is_changed()),
            (Err(_), Some(shared)) => (Some(shared.0.clone()), shared.is_changed()),
            (Err(_), None) if bodies.contains(of.0) => (None, false),
            (Err(_), None) => continue,
        };
        let is_shown = displayed.as_ref().is_some_and(|displayed| !displayed.waits());
        if is_shown && !(display.is_changed() || mesh.is_changed() || is_other) {
            continue;
        }
        let surface = LayerKey { skin: skin.clone(), colors: display.weights };
        let edges = LayerKey { skin, colors: WeightColors::Off };
        let start = |displayed: &mut DisplayedMesh| {
            displayed.surface.start(&displayed.model, &displayed.plans, surface.clone());
            if display.wireframe {
                displayed.edges.start(&displayed.model, &displayed.plans, edges.clone());
            } else {
                displayed.edges.stop_waiting();
            }
        };
        match displayed {
            Some(mut displayed) => {
                if !Arc::ptr_eq(&displayed.model, &mesh.rest) {
                    displayed.change_model(&mesh.rest, &images);
                }
                start(&mut displayed);
            }
            None => {
                let mut displayed = DisplayedMesh::new(&mesh.rest, &images);
                start(&mut displayed);
                commands.entity(entity).try_insert(displayed);
            }
        }
    }
}

impl DisplayedMesh {
    fn new(model: &Arc<Model>, images: &Assets<Image>) -> Self {
        let mut displayed = Self {
            model: model.clone(),
            plans: Plans::default(),
            surface: Layer::new(DisplayPiece::Surface),
            edges: Layer::new(DisplayPiece::Edges),
            materials: Vec::new(),
            textures: None,
            piece_materials: BTreeMap::new(),
            fresh: false,
        };
        displayed.change_model(model, images);
        displayed
    }

    fn change_model(&mut self, model: &Arc<Model>, images: &Assets<Image>) {
        self.model = model.clone();
        self.plans = Plans::default();
        self.surface.forget();
        self.edges.forget();
        self.piece_materials.clear();
        let Materials { materials, textures } =
            materials::translate(&model.material_set, &images.get_handle_provider());
        if textures.is_empty() {
            (self.materials, self.textures) = (materials, None);
            return;
        }
        self.materials = materials.iter().map(|material| materials::without_textures(material, |_| true)).collect();
        let queue = Arc::new(Mutex::new(Vec::new()));
        let (model, out, total) = (model.clone(), queue.clone(), textures.len());
        let task = AsyncComputeTaskPool::get().spawn(async move {
            for done in materials::decode_textures(&model.material_set, &textures) {
                out.lock().unwrap_or_else(PoisonError::into_inner).push(done);
                bevy::tasks::futures_lite::future::yield_now().await;
            }
        });
        self.textures = Some(TextureJob { task, queue, materials, total, landed: 0, missing: Vec::new() });
    }

    /// True while other weights wait for their turn.
    fn waits(&self) -> bool {
        self.surface.waits() || self.edges.waits()
    }

    fn progress(&self) -> Option<f32> {
        let textures = self.textures.as_ref().map(|job| job.landed as f32 / job.total as f32);
        let parts = [self.surface.progress(), self.edges.progress(), textures];
        let (count, sum) = parts.iter().flatten().fold((0, 0.0), |(count, sum), part| (count + 1, sum + part));
        (count > 0).then(|| sum / count as f32)
    }
}

/// Spawns finished pieces, a bounded amount a frame.
pub(super) fn land_jobs(
    mut commands: Commands,
    mut displays: Query<(Entity, &RigMesh, &mut DisplayedMesh, Option<&mut DisplayJob>)>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut notes: MessageWriter<DisplayNote>,
    mut redraw: MessageWriter<RequestRedraw>,
) {
    for (entity, mesh, mut displayed, job) in &mut displays {
        let busy = displayed.surface.is_busy() || displayed.edges.is_busy() || displayed.textures.is_some();
        if !busy && job.is_none() {
            continue;
        }
        redraw.write(RequestRedraw);
        let displayed = &mut *displayed;
        displayed.fresh |= displayed.surface.land(entity, &mut commands, &mut meshes);
        displayed.fresh |= displayed.edges.land(entity, &mut commands, &mut meshes);
        displayed.land_textures(&mut images, &mut materials, |text| {
            notes.write(DisplayNote { mesh: mesh.uid, text });
        });
        match (displayed.progress(), job) {
            (Some(done), Some(mut job)) => job.done = done,
            (Some(done), None) => {
                commands.entity(entity).try_insert(DisplayJob { done });
            }
            (None, Some(_)) => {
                commands.entity(entity).try_remove::<DisplayJob>();
            }
            (None, None) => {}
        }
    }
}

impl DisplayedMesh {
    fn land_textures(
        &mut self,
        images: &mut Assets<Image>,
        materials: &mut Assets<StandardMaterial>,
        mut note: impl FnMut(String),
    ) {
        let Some(job) = &mut self.textures else { return };
        let done = check_ready(&mut job.task).is_some();
        let waiting = std::mem::take(&mut *job.queue.lock().unwrap_or_else(PoisonError::into_inner));
        for (handle, image) in waiting {
            job.landed += 1;
            let id = handle.id();
            match image.map(|image| images.insert(id, image)) {
                Ok(Ok(())) => {}
                Ok(Err(_)) => job.missing.push(id),
                Err(error) => {
                    warn!("{error}");
                    note(error.to_string());
                    job.missing.push(id);
                }
            }
        }
        if !done {
            return;
        }
        let missing = |image: &Handle<Image>| job.missing.contains(&image.id());
        self.materials = job.materials.iter().map(|material| materials::without_textures(material, missing)).collect();
        self.textures = None;
        for (piece_material, handle) in &self.piece_materials {
            // The handle is alive, so its slot exists.
            let _ = materials.insert(handle.id(), piece_material.material(&self.materials));
        }
    }
}

/// Links pieces to their joints, and gives the renderer the rest transforms of the joints.
pub(super) fn follow_skins(
    mut commands: Commands,
    mut displays: Query<(&mut DisplayedMesh, Ref<SkinOf>)>,
    rigs: Query<(Entity, Ref<Rig>, Ref<JointEntities>, Option<Ref<BuildResult>>, Option<Ref<BuiltEntities>>)>,
    bodies: Query<(Entity, Ref<InstanceBody>, &RigRuntime), Without<Rig>>,
    mut bind_assets: ResMut<Assets<SkinnedMeshInverseBindposes>>,
) {
    for (mut displayed, of) in &mut displays {
        if let Ok((entity, body, runtime)) = bodies.get(of.0) {
            if displayed.fresh || of.is_changed() || body.is_changed() {
                let skeleton = DeformSkeleton::new(&body.rig, Some(&body.built));
                let program = runtime.state().program();
                let joint = |uid: Uid| program.node(uid).and_then(|slot| runtime.entity(slot));
                follow_joints(&mut displayed, entity, &body.rig, &skeleton, &joint, &mut commands, &mut bind_assets);
            }
            continue;
        }
        let Ok((entity, rig, joints, built, created)) = rigs.get(of.0) else { continue };
        let is_rebuilt = built.as_ref().is_some_and(|built| built.is_changed())
            || created.as_ref().is_some_and(|created| created.is_changed());
        if !(displayed.fresh || of.is_changed() || rig.is_changed() || joints.is_changed() || is_rebuilt) {
            continue;
        }
        let skeleton = DeformSkeleton::new(&rig, built.as_ref().map(|built| &*built.0));
        let joint = |uid: Uid| joints.get(uid).or_else(|| created.as_ref()?.get(uid));
        follow_joints(&mut displayed, entity, &rig, &skeleton, &joint, &mut commands, &mut bind_assets);
    }
}

/// Links the pieces of a mesh to the entities of its joints.
fn follow_joints(
    displayed: &mut Mut<DisplayedMesh>,
    entity: Entity,
    rig: &Rig,
    skeleton: &DeformSkeleton,
    joint: &dyn Fn(Uid) -> Option<Entity>,
    commands: &mut Commands,
    bind_assets: &mut Assets<SkinnedMeshInverseBindposes>,
) {
    // Pieces of joints without an entity or with a singular rest transform follow the rig itself.
    let held = skeleton.joints().iter().map(|one| {
        let bind = Mat4::from(bevy::math::Affine3A::from(one.rest).inverse());
        joint(one.uid).filter(|_| bind.is_finite()).map_or((entity, Mat4::IDENTITY), |joint| (joint, bind))
    });
    let held: Vec<(Entity, Mat4)> = held.collect();
    let held = BindTargets { rig_entity: entity, rig, skeleton, joints: &held };
    let displayed = displayed.bypass_change_detection();
    for shown in displayed.surface.pieces.iter_mut().chain(&mut displayed.edges.pieces) {
        follow_skin(shown, &held, commands, bind_assets);
    }
}

/// Joints that move pieces of the mesh.
struct BindTargets<'a> {
    rig_entity: Entity,
    rig: &'a Rig,
    skeleton: &'a DeformSkeleton,
    /// Entity of each joint of the skeleton, and the transform from the rig's space to the joint at rest.
    joints: &'a [(Entity, Mat4)],
}

fn follow_skin(
    shown: &mut ShownPiece,
    held: &BindTargets,
    commands: &mut Commands,
    bind_assets: &mut Assets<SkinnedMeshInverseBindposes>,
) {
    let (Some(palette), Some(skin)) = (&shown.palette, &shown.key.skin) else { return };
    // Points without influences, and points of removed joints, follow the rig itself: no joint poses them.
    let free = (held.rig_entity, Mat4::IDENTITY);
    let holders = held.skeleton.holders(held.rig, skin);
    let hold = |joint: &u32| {
        let holder = if *joint == RIG { None } else { holders.get(*joint as usize).copied().flatten() };
        holder.map_or(free, |holder| held.joints[holder])
    };
    let (joints, binds): (Vec<Entity>, Vec<Mat4>) = palette.iter().map(hold).unzip();
    let moved = shown.binds != binds;
    let rejoined = shown.joints != joints || shown.bind_asset.is_none();
    if moved || rejoined {
        shown.binds = binds;
        let poses = SkinnedMeshInverseBindposes::from(shown.binds.clone());
        let handle = match shown.bind_asset.take() {
            Some(handle) => {
                // The handle is alive, so its slot exists.
                let _ = bind_assets.insert(handle.id(), poses);
                handle
            }
            None => bind_assets.add(poses),
        };
        if rejoined {
            shown.joints = joints;
            shown.hold(commands, handle.clone());
        }
        shown.bind_asset = Some(handle);
    }
}

impl PieceMaterial {
    fn material(self, materials: &[StandardMaterial]) -> StandardMaterial {
        let material = match self.look {
            Look::Material(index) => materials.get(index).cloned().unwrap_or_else(materials::clay),
            Look::Clay => materials::clay(),
            Look::Painted => materials::painted(),
        };
        if self.xray { materials::xray(material) } else { material }
    }
}

/// Assigns the materials of pieces, and shows or hides edges.
pub(super) fn assign_materials(
    mut commands: Commands,
    display: Res<MeshDisplay>,
    edges: Res<EdgeMaterials>,
    mut displays: Query<&mut DisplayedMesh>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for mut displayed in &mut displays {
        if !(displayed.fresh || display.is_changed()) {
            continue;
        }
        let displayed = displayed.bypass_change_detection();
        displayed.fresh = false;
        for shown in &mut displayed.surface.pieces {
            let look = match (shown.is_painted(), display.shading, shown.material) {
                (true, ..) => Look::Painted,
                (_, Shading::Shaded, Some(material)) => Look::Material(material),
                _ => Look::Clay,
            };
            let piece_material = PieceMaterial { look, xray: display.xray };
            let handle = displayed
                .piece_materials
                .entry(piece_material)
                .or_insert_with(|| materials.add(piece_material.material(&displayed.materials)));
            if shown.piece_material.as_ref().is_none_or(|known| known.id() != handle.id().untyped()) {
                shown.piece_material = Some(handle.clone().untyped());
                commands.entity(shown.entity).try_insert(MeshMaterial3d(handle.clone()));
            }
        }
        let handle = if display.xray { &edges.xray } else { &edges.solid };
        let visible = if display.wireframe { Visibility::Inherited } else { Visibility::Hidden };
        for shown in &mut displayed.edges.pieces {
            shown.piece_material = Some(handle.clone().untyped());
            commands.entity(shown.entity).try_insert((MeshMaterial3d(handle.clone()), visible));
        }
    }
}
