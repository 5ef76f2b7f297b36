//! Blocks of a graph, which are its frames: in columns by the depth of their dependencies, and the columns in rows.
//!
//! A block stands right of the blocks that it depends on, as far as they do not depend on each other; columns are filled
//! with what need not stand further right. How high columns may become, and where the row of columns is broken, is tried:
//! the way is taken that is largest in a panel, has nearly its shape, and has few links that go back. The heights that are
//! tried do not depend on the blocks, so that a small change of a graph seldom changes the way.

use std::collections::BTreeMap;

use bevy::math::ops;

use super::{COLUMN_GAP, GRID};

/// Width of a panel for each unit of its height.
const ASPECT: f32 = 2.5;
/// Free space between blocks of a column, and between rows.
const BLOCK_GAP: f32 = 2.0 * GRID;
/// The lowest limit of a column's height that is tried, and by how much each next one is higher.
const LIMITS: (f32, f32) = (8.0 * GRID, 1.25);
/// Number of limits that are tried.
const LIMIT_COUNT: usize = 24;
/// Cost of links that all go back.
const BACKWARD: f32 = 2.0;
/// Most rows that are tried.
const MOST_ROWS: usize = 8;

/// Nodes that stay together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    /// Width and height, on the grid.
    pub size: [f32; 2],
    /// Mean number of its nodes.
    pub mean: f32,
}

/// Column of blocks.
struct Column {
    blocks: Vec<usize>,
    size: [f32; 2],
}

/// Upper left corners of blocks. `links` are the numbers of edges from a block to another.
pub(super) fn pack(blocks: &[Block], links: &BTreeMap<(usize, usize), usize>) -> Vec<[f32; 2]> {
    let waiting = BlockQueue::new(blocks, links);
    let mut best: Option<(f32, Vec<[f32; 2]>)> = None;
    let mut limit = LIMITS.0;
    for _ in 0..LIMIT_COUNT {
        let columns = waiting.columns(blocks, limit);
        for rows in 1..=MOST_ROWS.min(columns.len()) {
            let (places, size) = placed(blocks, &columns, rows);
            let cost = cost(blocks, &places, size, links);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, places));
            }
        }
        limit *= LIMITS.1;
    }
    best.map(|(_, places)| places).unwrap_or_default()
}

/// Blocks in the order in which they are put into columns, each with those that come before it.
struct BlockQueue {
    order: Vec<usize>,
    before: Vec<Vec<usize>>,
}

impl BlockQueue {
    fn new(blocks: &[Block], links: &BTreeMap<(usize, usize), usize>) -> Self {
        let order = order(blocks, links);
        let mut place = vec![0; blocks.len()];
        order.iter().enumerate().for_each(|(at, block)| place[*block] = at);
        let (mut before, mut after) = (vec![Vec::new(); blocks.len()], vec![Vec::new(); blocks.len()]);
        for (from, to) in links.keys().filter(|(from, to)| place[*from] < place[*to]) {
            before[*to].push(*from);
            after[*from].push(*to);
        }
        let mut depths: Vec<usize> = vec![0; blocks.len()];
        for block in &order {
            depths[*block] = before[*block].iter().map(|other| depths[*other] + 1).max().unwrap_or(0);
        }
        // What depends on nothing stands next to what depends on it.
        for block in order.iter().rev().filter(|block| before[**block].is_empty()) {
            let next = after[*block].iter().map(|other| depths[*other]).min();
            depths[*block] = next.map_or(0, |next: usize| next.saturating_sub(1));
        }
        let mut order: Vec<usize> = (0..blocks.len()).collect();
        order.sort_by_key(|block| (depths[*block], *block));
        Self { order, before }
    }

    /// Columns up to a limit of their heights: each takes the next blocks all of whose dependencies are in earlier ones.
    fn columns(&self, blocks: &[Block], limit: f32) -> Vec<Column> {
        let mut left = self.order.clone();
        let mut is_placed = vec![false; blocks.len()];
        let mut columns = Vec::new();
        while !left.is_empty() {
            let mut column = Column { blocks: Vec::new(), size: [0.0; 2] };
            for block in &left {
                if self.before[*block].iter().any(|other| !is_placed[*other]) {
                    continue;
                }
                let [width, height] = blocks[*block].size;
                let below = if column.blocks.is_empty() { height } else { column.size[1] + BLOCK_GAP + height };
                if column.blocks.is_empty() || below <= limit {
                    column.blocks.push(*block);
                    column.size = [column.size[0].max(width), below];
                }
            }
            if column.blocks.is_empty() {
                break;
            }
            column.blocks.iter().for_each(|block| is_placed[*block] = true);
            left.retain(|block| !is_placed[*block]);
            column.blocks.sort_unstable();
            columns.push(column);
        }
        columns
    }
}

/// Blocks in an order against which few links go: by the means of their numbers, and neighbours exchanged where more links
/// go back than forth.
fn order(blocks: &[Block], links: &BTreeMap<(usize, usize), usize>) -> Vec<usize> {
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by(|a, b| blocks[*a].mean.total_cmp(&blocks[*b].mean));
    let count = |from: usize, to: usize| links.get(&(from, to)).copied().unwrap_or(0);
    for _ in 0..blocks.len() {
        let mut is_settled = true;
        for at in 1..order.len() {
            let (first, second) = (order[at - 1], order[at]);
            if count(second, first) > count(first, second) {
                order.swap(at - 1, at);
                is_settled = false;
            }
        }
        if is_settled {
            break;
        }
    }
    order
}

/// Places of blocks if their columns stand in about so many rows, and the size of the whole.
fn placed(blocks: &[Block], columns: &[Column], rows: usize) -> (Vec<[f32; 2]>, [f32; 2]) {
    let total: f32 = columns.iter().map(|column| column.size[0] + COLUMN_GAP).sum();
    let share = total / rows as f32;
    let mut places = vec![[0.0; 2]; blocks.len()];
    let (mut corner, mut height, mut widest, mut done) = ([0.0_f32; 2], 0.0_f32, 0.0_f32, 0.0_f32);
    let mut row = 0;
    for column in columns {
        let width = column.size[0] + COLUMN_GAP;
        // A column belongs to the row in which its middle lies.
        let of_column = ((done + width / 2.0) / share) as usize;
        if of_column > row {
            row = of_column;
            if done > 0.0 {
                corner = [0.0, corner[1] + height + BLOCK_GAP];
                height = 0.0;
            }
        }
        let mut y = corner[1];
        for block in &column.blocks {
            places[*block] = [corner[0], y];
            y += blocks[*block].size[1] + BLOCK_GAP;
        }
        corner[0] += width;
        done += width;
        widest = widest.max(corner[0] - COLUMN_GAP);
        height = height.max(column.size[1]);
    }
    (places, [widest, corner[1] + height])
}

/// Cost of a way to place blocks: how small the whole is in a panel, how far its shape is from that of the panel, and which
/// share of the links goes back.
fn cost(
    blocks: &[Block],
    places: &[[f32; 2]],
    [width, height]: [f32; 2],
    links: &BTreeMap<(usize, usize), usize>,
) -> f32 {
    let area: f32 = blocks.iter().map(|block| block.size[0] * block.size[1]).sum();
    let side = (width / ASPECT).max(height).max(1.0);
    let size = ops::ln(side * side * ASPECT / area.max(1.0));
    let shape = ops::ln((width.max(1.0) / height.max(1.0)) / ASPECT).abs();
    let (mut back, mut all) = (0, 0);
    for ((from, to), count) in links {
        all += count;
        let ends = places[*from][0] + blocks[*from].size[0];
        back += if ends <= places[*to][0] { 0 } else { *count };
    }
    size + shape + BACKWARD * back as f32 / all.max(1) as f32
}
