//! The rows of the timeline: layers, nodes with their tracks, and keys that are set aside.

use std::collections::{BTreeMap, BTreeSet};

use bevy::{ecs::change_detection::Tick, prelude::*};

use super::{
    marks::{Mark, merged},
    state::{OpenClip, Timeline},
};
use crate::{
    editor::panels::displayed_rig::{Stamp, joint_name},
    plugins::commands::BuildResult,
    rig::{
        BuiltRig, Rig, Uid,
        animation::{ClipLayer, OrphanedKeys, Property, TrackTarget, orphaned_keys},
        operations::KeyTimes,
    },
};

/// Row of the timeline, with places in the [`Sheet`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Row {
    /// Header of the layers.
    Layers,
    /// A layer, with its place in the clip.
    Layer(usize),
    /// All keys together.
    All,
    /// A node.
    Node(usize),
    /// A track of a node.
    Track(usize, usize),
    /// Header of the keys that are set aside.
    Aside,
    /// Keys of a node that is gone.
    Orphan(usize),
}

/// A node with keys.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SheetNode {
    pub uid: Uid,
    pub name: String,
    /// Name in small letters with those of its properties, for the filter.
    words: String,
    pub tracks: Vec<SheetTrack>,
    pub marks: Vec<Mark>,
}

/// A track.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SheetTrack {
    pub target: TrackTarget,
    pub name: String,
    pub marks: Vec<Mark>,
}

/// Content of the rows, made again only after a change.
#[derive(Default)]
pub(super) struct Sheet {
    made_from: Option<MadeFrom>,
    pub nodes: Vec<SheetNode>,
    pub marks: Vec<Mark>,
    pub orphans: Vec<OrphanedKeys>,
    pub layers: usize,
    selected: SelectedTimes,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct MadeFrom {
    rig: Stamp,
    built: Option<Tick>,
    clip: Uid,
    layer: Option<Uid>,
    names: usize,
}

/// Times of the selected keys by row.
#[derive(Default)]
struct SelectedTimes {
    made_from: Option<(u64, u64)>,
    all: Vec<f32>,
    nodes: BTreeMap<Uid, Vec<f32>>,
}

/// Choice of rows.
#[derive(Debug, Clone, Default)]
pub(super) struct Choice {
    /// Words that a row has to contain.
    pub filter: String,
    /// True for nodes that are selected in the viewport alone.
    pub selected_only: bool,
    /// Nodes whose tracks have rows.
    pub unfolded: BTreeSet<Uid>,
    /// True if layers have rows.
    pub layers: bool,
    /// True if keys that are set aside have rows.
    pub aside: bool,
}

impl Sheet {
    /// Makes the content again after a change of the rig, its build, or what is open.
    pub fn refresh(&mut self, world: &World, stamp: Stamp, open: &OpenClip) {
        let built = world.get_entity(open.entity).ok().and_then(|rig| rig.get_ref::<BuildResult>());
        let names = world.get_resource::<Timeline>().map(|timeline| &timeline.names);
        let made_from = MadeFrom {
            rig: stamp,
            built: built.as_ref().map(|built| built.last_changed()),
            clip: open.clip.uid,
            layer: open.layer.map(|layer| layer.uid),
            names: names.map_or(0, |names| names.0.len()),
        };
        if self.made_from == Some(made_from) {
            return;
        }
        self.made_from = Some(made_from);
        let built = built.as_ref().map(|built| &*built.0);
        self.nodes = open.layer.map(|layer| nodes(open.rig, built, layer)).unwrap_or_default();
        self.marks = merged(self.nodes.iter().flat_map(|node| node.marks.iter().copied()).collect());
        self.layers = open.clip.layers.len();
        let known = names.cloned().unwrap_or_default();
        self.orphans = orphaned_keys(open.rig, built, &known);
        self.orphans.retain(|orphan| orphan.clip == open.clip.uid);
    }

    /// Rows in their order.
    pub fn rows(&self, choice: &Choice, selected: &[Uid]) -> Vec<Row> {
        let words: Vec<String> = choice.filter.split_whitespace().map(str::to_lowercase).collect();
        let mut rows = vec![Row::Layers];
        if choice.layers {
            // The topmost layer is the uppermost row.
            rows.extend((0..self.layers).rev().map(Row::Layer));
        }
        if !self.nodes.is_empty() {
            rows.push(Row::All);
        }
        for (number, node) in self.nodes.iter().enumerate() {
            let is_chosen = !choice.selected_only || selected.contains(&node.uid);
            if !is_chosen || !words.iter().all(|word| node.words.contains(word.as_str())) {
                continue;
            }
            rows.push(Row::Node(number));
            if choice.unfolded.contains(&node.uid) {
                rows.extend((0..node.tracks.len()).map(|track| Row::Track(number, track)));
            }
        }
        if !self.orphans.is_empty() {
            rows.push(Row::Aside);
            if choice.aside {
                rows.extend((0..self.orphans.len()).map(Row::Orphan));
            }
        }
        rows
    }

    /// Marks of a row.
    pub fn marks_of(&self, row: Row) -> &[Mark] {
        match row {
            Row::All => &self.marks,
            Row::Node(node) => self.nodes.get(node).map_or(&[], |node| &node.marks),
            Row::Track(node, track) => {
                self.nodes.get(node).and_then(|node| node.tracks.get(track)).map_or(&[], |track| &track.marks)
            }
            Row::Layers | Row::Layer(_) | Row::Aside | Row::Orphan(_) => &[],
        }
    }

    /// Tracks whose keys a row shows.
    fn tracks_of(&self, row: Row) -> Box<dyn Iterator<Item = &SheetTrack> + '_> {
        match row {
            Row::All => Box::new(self.nodes.iter().flat_map(|node| &node.tracks)),
            Row::Node(node) => Box::new(self.nodes.get(node).into_iter().flat_map(|node| &node.tracks)),
            Row::Track(node, track) => {
                Box::new(self.nodes.get(node).and_then(|node| node.tracks.get(track)).into_iter())
            }
            Row::Layers | Row::Layer(_) | Row::Aside | Row::Orphan(_) => Box::new(std::iter::empty()),
        }
    }

    /// Keys of a row from the first to the last second of a span, both included.
    pub fn keys_within(&self, row: Row, span: [f32; 2]) -> KeyTimes {
        let mut keys = KeyTimes::new();
        for track in self.tracks_of(row) {
            let from = track.marks.partition_point(|mark| mark.time < span[0]);
            let to = track.marks.partition_point(|mark| mark.time <= span[1]);
            if from < to {
                keys.insert(track.target.clone(), track.marks[from..to].iter().map(|mark| mark.time).collect());
            }
        }
        keys
    }

    /// Gathers the times of selected keys by row. `version` changes with the keys.
    pub fn note_selected(&mut self, keys: &KeyTimes, version: (u64, u64)) {
        if self.selected.made_from == Some(version) {
            return;
        }
        let mut nodes: BTreeMap<Uid, Vec<f32>> = BTreeMap::new();
        for (target, times) in keys {
            nodes.entry(target.node).or_default().extend(times);
        }
        let mut all: Vec<f32> = nodes.values().flatten().copied().collect();
        let settle = |times: &mut Vec<f32>| {
            times.sort_by(f32::total_cmp);
            times.dedup();
        };
        nodes.values_mut().for_each(settle);
        settle(&mut all);
        self.selected = SelectedTimes { made_from: Some(version), all, nodes };
    }

    /// Times of selected keys of a row, rising.
    pub fn selected_times<'a>(&'a self, row: Row, keys: &'a KeyTimes) -> &'a [f32] {
        match row {
            Row::All => &self.selected.all,
            Row::Node(node) => {
                let uid = self.nodes.get(node).map(|node| node.uid);
                uid.and_then(|uid| self.selected.nodes.get(&uid)).map_or(&[], |times| times)
            }
            Row::Track(node, track) => {
                let track = self.nodes.get(node).and_then(|node| node.tracks.get(track));
                track.and_then(|track| keys.get(&track.target)).map_or(&[], |times| times)
            }
            Row::Layers | Row::Layer(_) | Row::Aside | Row::Orphan(_) => &[],
        }
    }
}

/// Nodes of a layer that the rig has: joints in their order, then created nodes.
fn nodes(rig: &Rig, built: Option<&BuiltRig>, layer: &ClipLayer) -> Vec<SheetNode> {
    let mut tracks: BTreeMap<Uid, Vec<SheetTrack>> = BTreeMap::new();
    for (target, track) in &layer.tracks {
        let marks = track.keys.iter().map(Mark::from).collect();
        let track = SheetTrack { target: target.clone(), name: property_name(target), marks };
        tracks.entry(target.node).or_default().push(track);
    }
    let joints = rig.walk().map(|joint| (joint.data.uid, joint_name(&joint.data).into_owned()));
    let created = built.into_iter().flat_map(|built| &built.nodes).map(|node| (node.uid, node.name.to_string()));
    let mut found = Vec::with_capacity(tracks.len());
    for (uid, name) in joints.chain(created) {
        let Some(tracks) = tracks.remove(&uid) else { continue };
        let marks = merged(tracks.iter().flat_map(|track| track.marks.iter().copied()).collect());
        let properties: Vec<&str> = tracks.iter().map(|track| track.name.as_str()).collect();
        let words = format!("{name} {}", properties.join(" ")).to_lowercase();
        found.push(SheetNode { uid, name, words, tracks, marks });
    }
    found
}

/// Name of a track for people: the property, an attribute by its own name.
fn property_name(target: &TrackTarget) -> String {
    match &target.property {
        Property::Attribute(name) => name.clone(),
        property => property.to_string(),
    }
}
