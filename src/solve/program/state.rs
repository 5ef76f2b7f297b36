//! Instances of a program: their inputs, results and registers.

mod carry;
mod four;
mod partial;
mod workspace;

use std::{cell::RefCell, sync::Arc};

use glam::{Affine3A, Vec3};

pub use self::{carry::Carry, four::LANES};
use self::{four::Four, partial::PartialRun, workspace::Workspace};
use super::{
    ContentHash, RigProgram, StateError,
    graph::valid,
    run::{Machine, Scratch, SingleRegisters, on},
};
use crate::{
    mesh::model::Trs,
    rig::{PoseOffset, Uid},
    solve::{spring::PointSpring, weights::relative},
};

/// Reciprocal of the share of changed operations above which all operations run without tracking changes.
const FULL: usize = 6;

/// Values that a state keeps between evaluations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Memory {
    /// All registers: an evaluation runs only operations whose inputs changed. For editing.
    #[default]
    Whole,
    /// Inputs and results: an evaluation runs all operations, in memory that instances of a thread share. For crowds.
    Results,
}

/// A spring between evaluations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpringState {
    /// Marks a spring that has been placed at its node.
    pub started: bool,
    pub origin: PointSpring,
    pub tip: PointSpring,
}

impl Default for SpringState {
    fn default() -> Self {
        let still = PointSpring::at(Vec3::ZERO);
        Self { started: false, origin: still, tip: still }
    }
}

impl SpringState {
    /// Returns `true` if time alone changes nothing.
    fn is_settled(&self) -> bool {
        let rests =
            |point: &PointSpring| point.velocity == Vec3::ZERO && point.position == point.target && point.left == 0.0;
        self.started && rests(&self.origin) && rests(&self.tip)
    }
}

/// One instance of a [`RigProgram`]: its inputs, registers and results. Cloning copies a few flat lists.
///
/// Transforms are in the rig's space unless said otherwise; slots are those of the program's lists.
#[derive(Debug, Clone)]
pub struct RigState {
    program: Arc<RigProgram>,
    memory: Memory,
    poses: Vec<PoseOffset>,
    springs: Vec<SpringState>,
    /// Map from the rig's space of the last evaluation to that of now, both seen from the world.
    frame: Option<Trs>,
    /// Registers; only the first of them with [`Memory::Results`].
    x: Vec<Trs>,
    n: Vec<f32>,
    /// A bit for each operation that has to run.
    dirty: Vec<u64>,
    /// Marks that all operations have to run.
    all_dirty: bool,
    /// True if the registers of nodes hold the results of the last evaluation although all operations have to run, so that it
    /// can be told which nodes move.
    has_results: bool,
    /// Marks that any operation has to run.
    any_dirty: bool,
    /// Run that is enough while no operation has to run for another reason; only with [`Memory::Results`].
    partial: Option<Arc<PartialRun>>,
    /// A bit for each node register whose transform the last evaluation changed.
    moved: Vec<u64>,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::default();
    static FOUR: RefCell<Four> = RefCell::default();
}

impl RigState {
    /// An unposed instance with [`Memory::Whole`].
    pub fn new(program: Arc<RigProgram>) -> Self {
        Self::with_memory(program, Memory::Whole)
    }

    /// An unposed instance. It has results after the first evaluation.
    pub fn with_memory(program: Arc<RigProgram>, memory: Memory) -> Self {
        let nodes = program.nodes.len() + 1;
        let (transforms, numbers) = match memory {
            Memory::Whole => (program.x.len(), program.n.len()),
            Memory::Results => (nodes + program.inputs.len(), program.attributes.len() + program.morphs.len()),
        };
        let operations = if memory == Memory::Whole { program.ops.len() } else { 0 };
        Self {
            memory,
            poses: vec![PoseOffset::IDENTITY; program.poses],
            springs: vec![SpringState::default(); program.layout.spring_ops.len()],
            frame: None,
            x: program.x[..transforms].to_vec(),
            n: program.n[..numbers].to_vec(),
            dirty: vec![0; operations.div_ceil(64)],
            all_dirty: true,
            has_results: false,
            any_dirty: true,
            partial: None,
            moved: vec![0; nodes.div_ceil(64)],
            program,
        }
    }

    /// Program of the instance.
    pub fn program(&self) -> &Arc<RigProgram> {
        &self.program
    }

    /// The hash of the program.
    pub fn hash(&self) -> ContentHash {
        self.program.hash
    }

    /// Returns `true` if an evaluation would change anything: an input changed, or, if time passes, a spring moves.
    pub fn is_dirty(&self, dt: f32) -> bool {
        let is_changed = self.any_dirty || self.partial.is_some() || self.frame.is_some();
        is_changed || (dt > 0.0 && self.springs.iter().any(|spring| !spring.is_settled()))
    }

    /// Tells that the rig has moved in the world since the last evaluation: `motion` is the rig's space of now, seen from
    /// that of before. Springs that feel it stay behind. Several motions before an evaluation add up; the scale of the
    /// motion counts for nothing, and one that is not finite is left out.
    pub fn move_frame(&mut self, motion: &Trs) {
        let rotation = motion.rotation.conjugate().normalize();
        let back = Trs { translation: rotation * -motion.translation, rotation, scale: Vec3::ONE };
        if self.springs.is_empty() || !valid(&back) {
            return;
        }
        let before = self.frame.unwrap_or(Trs::IDENTITY);
        let frame = Trs {
            translation: rotation * before.translation + back.translation,
            rotation: (rotation * before.rotation).normalize(),
            scale: Vec3::ONE,
        };
        self.frame = Some(frame);
    }

    /// Makes the next evaluation run everything.
    pub fn mark_all(&mut self) {
        self.all_dirty = true;
        self.any_dirty = true;
    }

    /// Tells that every node may have moved in the last evaluation, for results that are read by somebody else from now on.
    pub(crate) fn mark_moved(&mut self) {
        self.moved.fill(u64::MAX);
    }

    /// Poses a node, within the channels and limits of its control.
    ///
    /// # Errors
    ///
    /// If the program has no such node or it takes no pose, or if the offset is not finite.
    pub fn set_offset(&mut self, node: Uid, offset: PoseOffset) -> Result<(), StateError> {
        let slot = self.program.node(node).ok_or(StateError::UnknownNode(node))?;
        if !self.program.nodes[slot].is_posable() {
            return Err(StateError::NotPosable(node));
        }
        if !offset.is_valid() {
            return Err(StateError::NotFinite(node));
        }
        self.set_offset_at(slot, offset);
        Ok(())
    }

    /// Poses the node of a slot, within the channels and limits of its control; false if it takes no pose or the offset is not finite.
    pub fn set_offset_at(&mut self, slot: usize, offset: PoseOffset) -> bool {
        let Some(node) = self.program.nodes.get(slot) else { return false };
        let Some(known) = self.poses.get_mut(node.pose.0 as usize) else { return false };
        if *known == offset {
            return true;
        }
        if !offset.is_valid() {
            return false;
        }
        let offset = node.freedom.map_or(offset, |freedom| freedom.clamp(offset));
        if *known == offset {
            return true;
        }
        *known = offset;
        mark(&mut self.dirty, self.program.layout.pose_readers.get(node.pose.0 as usize));
        self.any_dirty = true;
        true
    }

    /// The pose of a slot; the identity for a node that takes none.
    pub fn offset_at(&self, slot: usize) -> PoseOffset {
        let node = self.program.nodes.get(slot);
        node.and_then(|node| self.poses.get(node.pose.0 as usize)).copied().unwrap_or_default()
    }

    /// Sets an attribute to the nearest allowed value.
    ///
    /// # Errors
    ///
    /// If the program has no such attribute or a constraint gives its value, or if the value is not finite.
    pub fn set_attribute(&mut self, node: Uid, name: &str, value: f32) -> Result<(), StateError> {
        if !value.is_finite() {
            return Err(StateError::NotFinite(node));
        }
        let slot = self.program.attribute(node, name);
        if slot.is_some_and(|slot| self.set_attribute_at(slot, value)) {
            return Ok(());
        }
        Err(StateError::UnknownAttribute { node, name: name.to_owned() })
    }

    /// Sets the attribute of a slot to the nearest allowed value; returns `false` if it cannot be set.
    pub fn set_attribute_at(&mut self, slot: usize, value: f32) -> bool {
        let Some(attribute) = self.program.attributes.get(slot).filter(|attribute| attribute.is_settable) else {
            return false;
        };
        let value = attribute.kind.clamp(value, attribute.default);
        if self.n[slot].to_bits() != value.to_bits() {
            self.n[slot] = value;
            mark(&mut self.dirty, self.program.layout.attribute_readers.get(slot));
            self.any_dirty = true;
        }
        true
    }

    /// Sets the transform of an input, in the rig's space.
    ///
    /// # Errors
    ///
    /// If the program has no such input, or the transform is not finite.
    pub fn set_input(&mut self, node: Uid, transform: Trs) -> Result<(), StateError> {
        let slot = self.program.input(node).ok_or(StateError::UnknownInput(node))?;
        if self.set_input_at(slot, transform) { Ok(()) } else { Err(StateError::NotFinite(node)) }
    }

    /// Sets the transform of the input of a slot, in the rig's space; returns `false` if there is none or the transform
    /// is not finite.
    pub fn set_input_at(&mut self, slot: usize, transform: Trs) -> bool {
        if slot >= self.program.inputs.len() || !valid(&transform) {
            return false;
        }
        let register = self.program.nodes.len() + 1 + slot;
        if !super::run::same_bits(&self.x[register], &transform) {
            self.x[register] = transform;
            mark(&mut self.dirty, self.program.layout.input_readers.get(slot));
            self.any_dirty = true;
        }
        true
    }

    /// Evaluates the operations whose inputs changed, after `dt` seconds (springs move by it; a value not above zero
    /// counts as zero). Returns `true` if any ran.
    ///
    /// The results are the same bits whatever was evaluated before, and whichever of the instance's inputs changed.
    /// Does not allocate once each thread has evaluated the program.
    pub fn evaluate(&mut self, dt: f32) -> bool {
        let dt = elapsed(dt);
        if !self.is_dirty(dt) {
            return false;
        }
        WORKSPACE.with_borrow_mut(|workspace| match self.memory {
            Memory::Whole => {
                self.moved.fill(0);
                self.evaluate_whole(dt, &mut workspace.scratch);
                self.settle();
            }
            Memory::Results => match self.due_run().cloned() {
                Some(run) => workspace.run_partially(self, &run, dt),
                None => {
                    let (first, program) = (workspace.take(self), self.program.clone());
                    workspace.run(self, program.ops[first..].iter(), dt);
                    workspace.give(self);
                }
            },
        });
        true
    }

    /// Evaluates several instances as [`evaluate`](Self::evaluate) does; returns `true` for those that ran.
    ///
    /// Instances of one program that remember [`Memory::Results`] run in step, one operation for all of them before the
    /// next, their numbers side by side, so that a processor computes all of them at once. The results are the same bits
    /// as of instances that run alone.
    pub fn evaluate_together(mut states: [Option<&mut Self>; LANES], dt: f32) -> [bool; LANES] {
        let dt = elapsed(dt);
        let serial = states[0].as_ref().map(|state| state.program.serial);
        let is_alike = states
            .iter()
            .flatten()
            .all(|state| state.memory == Memory::Results && Some(state.program.serial) == serial && state.is_dirty(dt));
        let [Some(a), Some(b), Some(c), Some(d)] = &mut states else {
            return states.map(|state| state.is_some_and(|state| state.evaluate(dt)));
        };
        if !is_alike {
            return [a, b, c, d].map(|state| state.evaluate(dt));
        }
        let run = a.due_run().cloned();
        let run = run
            .filter(|run| [&*b, &*c, &*d].iter().all(|state| state.due_run().is_some_and(|own| Arc::ptr_eq(own, run))));
        FOUR.with_borrow_mut(|four| match run {
            Some(run) => four.evaluate_partially([a, b, c, d], &run, dt),
            None => four.evaluate([a, b, c, d], dt),
        });
        [true; LANES]
    }

    /// Marks the results as up to date.
    fn settle(&mut self) {
        self.any_dirty = false;
        self.all_dirty = false;
        self.has_results = false;
        self.partial = None;
        self.frame = None;
    }

    fn evaluate_whole(&mut self, dt: f32, scratch: &mut Scratch) {
        let Self { program, dirty, x, n, poses, springs, moved, frame, .. } = self;
        let frame = *frame;
        if dt > 0.0 || frame.is_some() {
            for (op, state) in program.layout.spring_ops.iter().zip(springs.iter()) {
                if *op != u32::MAX && (frame.is_some() || !state.is_settled()) {
                    mark(dirty, &[*op]);
                }
            }
        }
        let certain: u32 = dirty.iter().map(|word| word.count_ones()).sum();
        if self.all_dirty || certain as usize * FULL > program.ops.len() {
            dirty.fill(0);
            let tables = &program.tables;
            if self.has_results {
                let registers = SingleRegisters::<true> { x, n, poses, changed: false, moved };
                let mut machine = Machine { tables, registers, springs, scratch, dt, frame };
                return program.ops.iter().for_each(|op| machine.run(op));
            }
            moved.fill(u64::MAX);
            let registers = SingleRegisters::<false> { x, n, poses, changed: false, moved: &mut [] };
            let mut machine = Machine { tables, registers, springs, scratch, dt, frame };
            program.ops.iter().for_each(|op| machine.run(op));
            return;
        }
        let tables = &program.tables;
        let registers = SingleRegisters::<true> { x, n, poses, changed: false, moved };
        let mut machine = Machine { tables, registers, springs, scratch, dt, frame };
        for word in 0..dirty.len() {
            while dirty[word] != 0 {
                let bit = dirty[word].trailing_zeros() as usize;
                dirty[word] &= dirty[word] - 1;
                let at = word * 64 + bit;
                machine.registers.changed = false;
                machine.run(&program.ops[at]);
                if machine.registers.changed {
                    // Readers come later in the list, so none is missed.
                    mark(dirty, program.layout.op_readers.get(at));
                }
            }
        }
    }

    /// Rig transform of a node; `None` if the program does not have it.
    pub fn global(&self, node: Uid) -> Option<Trs> {
        self.program.node(node).map(|slot| *self.global_at(slot))
    }

    /// Rig transform of the node of a slot, which must be one of the program's.
    pub fn global_at(&self, slot: usize) -> &Trs {
        &self.globals()[slot]
    }

    /// Rig transforms of all nodes, by slot.
    pub fn globals(&self) -> &[Trs] {
        &self.x[1..=self.program.nodes.len()]
    }

    /// Transform of the node of a slot relative to its parent (to the rig, if the program does not keep the parent).
    /// The slot must be one of the program's.
    pub fn local_at(&self, slot: usize) -> Trs {
        let node = &self.program.nodes[slot];
        // A program that drops nodes may lack parents.
        let is_whole = self.memory == Memory::Whole && self.program.nodes.len() == self.program.poses;
        match node.local {
            Some(local) if is_whole => self.x[local.0 as usize],
            None if is_whole && !node.is_driven => {
                let offset = self.offset_at(slot);
                if offset == PoseOffset::IDENTITY { node.base } else { on(&offset, &node.base) }
            }
            _ => match node.parent {
                Some(parent) => relative(self.global_at(parent), self.global_at(slot)),
                None => *self.global_at(slot),
            },
        }
    }

    /// Slots of nodes whose rig transforms the last evaluation changed (or may have changed).
    pub fn moved(&self) -> impl Iterator<Item = usize> {
        (0..self.program.nodes.len()).filter(|slot| self.is_moved(*slot))
    }

    /// Returns `true` if the last evaluation changed (or may have changed) the rig transform of the node of a slot.
    pub fn is_moved(&self, slot: usize) -> bool {
        // The first register is the rig's space.
        let register = slot + 1;
        self.moved.get(register / 64).is_some_and(|word| word & (1 << (register % 64)) != 0)
    }

    /// Returns `true` if the last evaluation changed (or may have changed) the rig transform of any node.
    pub fn is_any_moved(&self) -> bool {
        self.moved.iter().any(|word| *word != 0)
    }

    /// Value of an attribute, after all constraints.
    pub fn attribute(&self, node: Uid, name: &str) -> Option<f32> {
        self.program.attribute(node, name).map(|slot| self.n[slot])
    }

    /// Value of the attribute of a slot, after all constraints. The slot must be one of the program's.
    pub fn attribute_at(&self, slot: usize) -> f32 {
        self.n[slot]
    }

    /// Weights of the morph targets, by slot.
    pub fn morphs(&self) -> &[f32] {
        let first = self.program.attributes.len();
        &self.n[first..first + self.program.morphs.len()]
    }

    /// Multiplies the rig transforms of joints with inverse bind matrices: the matrices that move a skinned mesh in the
    /// rig's space. `joints` are slots; lists are used as far as the shortest goes.
    pub fn skin_matrices(&self, joints: &[u32], inverse_binds: &[Affine3A], out: &mut [Affine3A]) {
        let globals = self.globals();
        for ((joint, bind), out) in joints.iter().zip(inverse_binds).zip(out) {
            *out = globals[*joint as usize].affine() * *bind;
        }
    }
}

/// `dt` in seconds, or zero if it is negative or not finite.
fn elapsed(dt: f32) -> f32 {
    if dt > 0.0 && dt.is_finite() { dt } else { 0.0 }
}

/// Sets the bits of the items.
#[inline]
fn mark(bits: &mut [u64], items: &[u32]) {
    for item in items {
        // A state with [`Memory::Results`] has no bits.
        if let Some(word) = bits.get_mut(*item as usize / 64) {
            *word |= 1 << (item % 64);
        }
    }
}
