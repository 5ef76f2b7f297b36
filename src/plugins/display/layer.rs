//! A layer of a mesh's picture, its surface or its edges: built in the background, spawned piece by piece.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use bevy::{
    camera::visibility::DynamicSkinnedMeshBounds,
    mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes},
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};

use super::{
    DisplayPiece, WeightColors,
    build::{Piece, build_edges, build_surface},
    colors::Painter,
    plan::{EdgePlan, SurfacePlan, plan_edges, plan_surface},
};
use crate::{mesh::model::Model, rig::SkinData};

/// Approximate number of bytes handed to the renderer in one frame; a larger piece goes whole.
const FRAME_BYTES: usize = 4 << 20;
/// Largest number of vertices of a model that is built at once: this takes less time than waiting for the next frame.
const SMALL: usize = 20_000;
/// Number of frames for which a replaced piece of another vertex kind stays, until the renderer certainly has the new
/// one.
const OVERLAP: u8 = 4;

/// State that a layer is built for.
#[derive(Debug, Clone, Default)]
pub(super) struct LayerKey {
    /// The weights.
    pub skin: Option<Arc<SkinData>>,
    /// Mode of the weight colours.
    pub colors: WeightColors,
}

impl PartialEq for LayerKey {
    fn eq(&self, other: &Self) -> bool {
        let skins = match (&self.skin, &other.skin) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        skins && self.colors == other.colors
    }
}

impl LayerKey {
    /// True if the other state differs in its weights alone.
    fn is_repainted_by(&self, other: &Self) -> bool {
        self.colors == other.colors && self.skin.is_some() && other.skin.is_some()
    }
}

/// Pieces into which a model is cut, computed once and kept.
#[derive(Debug, Clone, Default)]
pub(super) struct Plans {
    surface: Arc<OnceLock<Vec<SurfacePlan>>>,
    edges: Arc<OnceLock<Vec<EdgePlan>>>,
}

/// A piece on the screen.
#[derive(Debug)]
pub(super) struct ShownPiece {
    /// Entity that draws it.
    pub entity: Entity,
    /// Index into the model's materials.
    pub material: Option<usize>,
    /// State that it was built for.
    pub key: LayerKey,
    /// See [`Piece::palette`].
    pub palette: Option<Vec<u32>>,
    /// Marks vertices with colours.
    colored: bool,
    /// Entities of its palette's joints.
    pub joints: Vec<Entity>,
    /// Transforms of the mesh relative to each of `joints` at rest.
    pub binds: Vec<Mat4>,
    /// `binds` for the renderer.
    pub bind_asset: Option<Handle<SkinnedMeshInverseBindposes>>,
    /// Material that it is drawn with.
    pub piece_material: Option<UntypedHandle>,
}

/// The pieces of one kind.
#[derive(Debug)]
pub(super) struct Layer {
    kind: DisplayPiece,
    /// State that the pieces are, or are being, built for.
    pub key: Option<LayerKey>,
    /// Pieces on the screen.
    pub pieces: Vec<ShownPiece>,
    /// Entities of another model's pieces, until the first of this one is spawned.
    stale: Vec<Entity>,
    /// Entities of replaced pieces, and the number of frames that they stay.
    retiring: Vec<(Entity, u8)>,
    job: Option<Job>,
    /// Marks that other weights wait until those that are being built are on the screen.
    waits: bool,
}

#[derive(Debug)]
struct Job {
    task: Option<Task<()>>,
    queue: Arc<Queue>,
    key: LayerKey,
    landed: usize,
}

/// Queue of finished pieces.
#[derive(Debug, Default)]
struct Queue {
    /// Pieces in order; `None` for one that is as it is on the screen.
    pieces: Mutex<VecDeque<Option<Piece>>>,
    /// Number of pieces in all; 0 until the model is cut.
    total: AtomicUsize,
    built: AtomicUsize,
}

impl Queue {
    fn push(&self, piece: Option<Piece>) {
        self.pieces.lock().unwrap_or_else(PoisonError::into_inner).push_back(piece);
        self.built.fetch_add(1, Ordering::Relaxed);
    }

    fn pop(&self) -> Option<Option<Piece>> {
        self.pieces.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }
}

impl Layer {
    /// A layer without pieces.
    pub fn new(kind: DisplayPiece) -> Self {
        Self { kind, key: None, pieces: Vec::new(), stale: Vec::new(), retiring: Vec::new(), job: None, waits: false }
    }

    /// True if [`Self::start`] has to be called again in the next frame.
    pub fn waits(&self) -> bool {
        self.waits
    }

    /// Ends the wait of [`Self::waits`]; the layer is out of date until the next start.
    pub fn stop_waiting(&mut self) {
        self.waits = false;
    }

    /// Starts to build the pieces for `key`, unless it is the state that they are or become; the current pieces stay until
    /// they are replaced.
    ///
    /// Weights that change with every frame, as under a brush, wait for pieces that are being built: otherwise no piece of
    /// a large mesh would ever be finished.
    pub fn start(&mut self, model: &Arc<Model>, plans: &Plans, key: LayerKey) {
        let is_other = self.key.as_ref() != Some(&key);
        let is_building = self.job.as_ref().is_some_and(|job| job.key.is_repainted_by(&key));
        self.waits = is_other && is_building;
        if !is_other || self.waits {
            return;
        }
        let queue = Arc::new(Queue::default());
        let (kind, model, plans, wanted, out) = (self.kind, model.clone(), plans.clone(), key.clone(), queue.clone());
        let vertices: usize = model.parts.iter().map(|part| part.vertices.len()).sum();
        let shown = self.shown_for(&key);
        let work = move || build(kind, &model, &plans, &wanted, shown.as_deref(), &out);
        let task = if vertices <= SMALL {
            work();
            None
        } else {
            Some(AsyncComputeTaskPool::get().spawn(async move { work() }))
        };
        self.key = Some(key.clone());
        // An older running task stops at its next piece.
        self.job = Some(Job { task, queue, key, landed: 0 });
    }

    /// Weights that all pieces on the screen were built for, if they differ from those of `key` at some points alone.
    fn shown_for(&self, key: &LayerKey) -> Option<Arc<SkinData>> {
        let shown = self.key.as_ref().filter(|_| self.job.is_none() && !self.pieces.is_empty())?;
        let (before, after) = (shown.skin.as_ref()?, key.skin.as_ref()?);
        // Palettes of pieces are places in the list of joints, which may only grow.
        let is_alike = shown.colors == key.colors
            && before.weights.len() == after.weights.len()
            && after.joints.starts_with(&before.joints)
            && self.pieces.iter().all(|piece| piece.key == *shown);
        is_alike.then(|| before.clone())
    }

    /// Drops the model: its pieces stay until those of another arrive.
    pub fn forget(&mut self) {
        self.stale.extend(self.pieces.drain(..).map(|shown| shown.entity));
        self.key = None;
        self.job = None;
        self.waits = false;
    }

    /// Finished share of a running job, 0 to 1.
    pub fn progress(&self) -> Option<f32> {
        let job = self.job.as_ref()?;
        let total = job.queue.total.load(Ordering::Relaxed);
        let done = job.queue.built.load(Ordering::Relaxed) + job.landed;
        Some(if total == 0 { 0.0 } else { done as f32 / (2 * total) as f32 })
    }

    /// Returns `true` while pieces are being spawned or removed.
    pub fn is_busy(&self) -> bool {
        self.job.is_some() || !self.retiring.is_empty()
    }

    /// Entities that draw this layer.
    pub fn entities(&self) -> impl Iterator<Item = Entity> {
        let pieces = self.pieces.iter().map(|shown| shown.entity);
        pieces.chain(self.stale.iter().copied()).chain(self.retiring.iter().map(|(entity, _)| *entity))
    }

    /// Spawns finished pieces below `mesh`, as many as fit into a frame. Returns `true` if there was any.
    pub fn land(&mut self, mesh: Entity, commands: &mut Commands, meshes: &mut Assets<Mesh>) -> bool {
        self.retiring.retain_mut(|(entity, frames)| {
            *frames -= 1;
            if *frames == 0 {
                commands.entity(*entity).try_despawn();
            }
            *frames > 0
        });
        let Some(job) = &mut self.job else { return false };
        // The task is checked before the queue is emptied: a finished task adds nothing more.
        let done = job.task.as_mut().is_none_or(|task| check_ready(task).is_some());
        if done {
            job.task = None;
        }
        let (mut bytes, before) = (0, job.landed);
        while bytes < FRAME_BYTES {
            let Some(piece) = job.queue.pop() else { break };
            let index = job.landed;
            job.landed += 1;
            let Some(piece) = piece else {
                if let Some(shown) = self.pieces.get_mut(index) {
                    shown.key = job.key.clone();
                }
                continue;
            };
            bytes += piece.bytes.max(1);
            self.stale.drain(..).for_each(|entity| commands.entity(entity).try_despawn());
            let handle = meshes.add(piece.mesh);
            let known = self.pieces.get(index);
            let alike =
                |old: &&ShownPiece| old.palette.is_some() == piece.palette.is_some() && old.colored == piece.colored;
            let entity = match known.filter(alike) {
                Some(old) => commands.entity(old.entity).try_insert(Mesh3d(handle)).id(),
                None => {
                    // The renderer may need some frames to prepare for another kind of mesh.
                    self.retiring.extend(known.map(|old| (old.entity, OVERLAP)));
                    commands.spawn((self.kind, Mesh3d(handle), Transform::default(), ChildOf(mesh))).id()
                }
            };
            let old = (index < self.pieces.len()).then(|| self.pieces.swap_remove(index));
            let old = old.filter(|old| old.entity == entity);
            let (bind_asset, piece_material) = old.map_or((None, None), |old| (old.bind_asset, old.piece_material));
            self.pieces.push(ShownPiece {
                entity,
                material: piece.material,
                key: job.key.clone(),
                palette: piece.palette,
                colored: piece.colored,
                joints: Vec::new(),
                binds: Vec::new(),
                bind_asset,
                piece_material,
            });
            let last = self.pieces.len() - 1;
            self.pieces.swap(index, last);
        }
        let has_landed = job.landed > before;
        if done && job.landed == job.queue.built.load(Ordering::Relaxed) {
            let gone = self.pieces.drain(job.landed.min(self.pieces.len())..).map(|shown| shown.entity);
            gone.chain(self.stale.drain(..)).for_each(|entity| commands.entity(entity).try_despawn());
            self.job = None;
        }
        has_landed
    }
}

impl ShownPiece {
    /// Returns `true` if the piece shows weights.
    pub fn is_painted(&self) -> bool {
        self.key.colors != WeightColors::Off
    }

    /// Inserts the components by which the renderer skins the piece to its joints.
    pub fn hold(&self, commands: &mut Commands, inverse_bindposes: Handle<SkinnedMeshInverseBindposes>) {
        let skinned = SkinnedMesh { inverse_bindposes, joints: self.joints.clone() };
        commands.entity(self.entity).try_insert((skinned, DynamicSkinnedMeshBounds));
    }
}

/// Builds all pieces, unless the layer has dropped its queue. One task builds all: a single thread may have to build
/// the hierarchy for rays as well, and people want to see the mesh first.
///
/// `shown` are the weights for which the pieces on the screen were built: pieces whose points have not changed stay.
fn build(
    kind: DisplayPiece,
    model: &Model,
    plans: &Plans,
    key: &LayerKey,
    shown: Option<&SkinData>,
    queue: &Arc<Queue>,
) {
    let skin = key.skin.as_deref();
    let is_same = |point: u32| shown.zip(skin).is_some_and(|(before, after)| has_same_row(before, after, point));
    // The layer and this task hold the queue.
    let abandoned = || Arc::strong_count(queue) < 2;
    match kind {
        DisplayPiece::Surface => {
            let plan = plans.surface.get_or_init(|| plan_surface(model));
            queue.total.store(plan.len(), Ordering::Relaxed);
            let painter = Painter::new(key.colors, skin);
            for piece in plan.iter().take_while(|_| !abandoned()) {
                if piece.sources(model).all(|(part, vertex)| is_same(part.vertices[vertex])) {
                    queue.push(None);
                    continue;
                }
                let material = piece.traits.material.and_then(|material| model.material_set.materials.get(material));
                let bumps =
                    painter.is_none() && material.is_some_and(|material| material.get("normalTexture").is_some());
                queue.push(Some(build_surface(model, piece, skin, painter.as_ref(), bumps)));
            }
        }
        DisplayPiece::Edges => {
            let plan = plans.edges.get_or_init(|| plan_edges(model));
            queue.total.store(plan.len(), Ordering::Relaxed);
            for piece in plan.iter().take_while(|_| !abandoned()) {
                let is_shown = piece.points.iter().all(|point| is_same(*point));
                queue.push(if is_shown { None } else { Some(build_edges(model, piece, skin)) });
            }
        }
    }
}

/// True if a point has the same influences in two sets of weights; points past their ends have none.
fn has_same_row(before: &SkinData, after: &SkinData, point: u32) -> bool {
    let row = |skin: &SkinData| {
        let [start, end] = [0, 1].map(|next| skin.weights.starts.get(point as usize + next).copied());
        start.zip(end).map(|(start, end)| start as usize..end as usize)
    };
    match (row(before), row(after)) {
        (Some(a), Some(b)) => {
            before.weights.joints.get(a.clone()) == after.weights.joints.get(b.clone())
                && before.weights.values.get(a) == after.weights.values.get(b)
        }
        (None, None) => true,
        _ => false,
    }
}
