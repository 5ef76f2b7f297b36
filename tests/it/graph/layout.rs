//! Layout of graphs, whatever they are of.

use rigsmith::editor::panels::graph::layout::{GRID, LayoutNode, crossings, lay_out, snapped};

fn nodes(count: usize, frame: impl Fn(usize) -> Option<usize>) -> Vec<LayoutNode> {
    let size = |number: usize| [220.0, 44.0 + 18.0 * (number % 5) as f32];
    (0..count).map(|number| LayoutNode { size: size(number), frame: frame(number), is_folded: false }).collect()
}

/// Numbers below a bound, the same for the same seed.
fn numbers(seed: u64) -> impl FnMut(usize) -> usize {
    let mut state = seed;
    move |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    }
}

/// Edges from earlier to later nodes, most of them from near ones.
fn edges(count: usize, seed: u64) -> Vec<(usize, usize)> {
    let mut next = numbers(seed);
    let mut list = Vec::new();
    for to in 1..count {
        for _ in 0..next(3) {
            list.push((to - 1 - next(to.min(12)), to));
        }
    }
    list
}

fn boxes(nodes: &[LayoutNode], places: &[[f32; 2]]) -> Vec<[f32; 4]> {
    let ends = |(node, [x, y]): (&LayoutNode, &[f32; 2])| [*x, *y, x + node.size[0], y + node.size[1]];
    nodes.iter().zip(places).map(ends).collect()
}

fn overlap(a: &[f32; 4], b: &[f32; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Space of all of some boxes.
fn around<'b>(boxes: impl Iterator<Item = &'b [f32; 4]>) -> [f32; 4] {
    boxes.fold([f32::MAX, f32::MAX, f32::MIN, f32::MIN], |space, ends| {
        [space[0].min(ends[0]), space[1].min(ends[1]), space[2].max(ends[2]), space[3].max(ends[3])]
    })
}

/// The share of edges that go to the right.
fn share_right(boxes: &[[f32; 4]], edges: &[(usize, usize)]) -> f32 {
    let right = edges.iter().filter(|(from, to)| boxes[*from][2] <= boxes[*to][0]).count();
    right as f32 / edges.len().max(1) as f32
}

#[test]
fn edges_within_a_frame_go_right_and_no_node_covers_another() {
    for seed in 1..20 {
        let count = 20 + 9 * seed as usize;
        let nodes = nodes(count, |number| (number % 3 > 0).then_some(number / 9));
        let edges = edges(count, seed);
        let places = lay_out(&nodes, &edges);
        assert_eq!(places, lay_out(&nodes, &edges), "the same graph is laid out alike");
        let boxes = boxes(&nodes, &places);
        for (from, to) in edges.iter().filter(|(from, to)| nodes[*from].frame == nodes[*to].frame) {
            assert!(boxes[*from][2] < boxes[*to][0], "{seed}: {from} to {to}");
        }
        for (number, first) in boxes.iter().enumerate() {
            assert_eq!(places[number], snapped(places[number]), "on the grid of {GRID}");
            let covered = boxes[..number].iter().position(|second| overlap(first, second));
            assert_eq!(covered, None, "{seed}: of {number}");
        }
    }
}

/// A rig of limbs with some features each, as large as a biped's.
fn limbs() -> (Vec<LayoutNode>, Vec<(usize, usize)>) {
    let mut next = numbers(5);
    let (mut frames, mut edges) = (Vec::new(), Vec::new());
    for limb in 0..8 {
        let (first, count) = (frames.len(), 30);
        for number in 0..count {
            let to = first + number;
            frames.push(Some(8 * limb + (number / 4).min(7)));
            for _ in 0..next(3).min(number) {
                edges.push((first + number - 1 - next(number.min(8)), to));
            }
            if first > 0 && number < 2 {
                edges.push((next(4), to));
            }
        }
    }
    let nodes = nodes(frames.len(), |number| frames[number]);
    (nodes, edges)
}

#[test]
fn frames_never_overlap_and_the_whole_is_wide() {
    let (nodes, edges) = limbs();
    let places = lay_out(&nodes, &edges);
    let boxes = boxes(&nodes, &places);
    let frames: Vec<[f32; 4]> = (0..64)
        .map(|frame| {
            let inside = nodes.iter().zip(&boxes).filter(|(node, _)| node.frame == Some(frame));
            let [left, top, right, bottom] = around(inside.map(|(_, ends)| ends));
            // With the title and the edge.
            [left - 16.0, top - 34.0, right + 16.0, bottom + 16.0]
        })
        .collect();
    for (number, first) in frames.iter().enumerate() {
        let covered = frames[..number].iter().position(|second| overlap(first, second));
        assert_eq!(covered, None, "frame {number}: {first:?}");
    }
    let [left, top, right, bottom] = around(boxes.iter());
    let aspect = (right - left) / (bottom - top);
    assert!((1.8..=3.4).contains(&aspect), "{aspect}");
    assert!(share_right(&boxes, &edges) > 0.7, "{}", share_right(&boxes, &edges));
}

#[test]
fn folded_frames_are_as_wide_as_a_panel_and_read_from_left_to_right() {
    let (open, edges) = limbs();
    // A node for each frame.
    let frame = |number: usize| open[number].frame.unwrap();
    let node = |number: usize| LayoutNode { size: [240.0, 60.0], frame: Some(number), is_folded: true };
    let nodes: Vec<LayoutNode> = (0..64).map(node).collect();
    let ends = edges.iter().map(|(from, to)| (frame(*from), frame(*to)));
    let edges: Vec<(usize, usize)> = ends.filter(|(from, to)| from != to).collect();
    let boxes = boxes(&nodes, &lay_out(&nodes, &edges));
    for (number, first) in boxes.iter().enumerate() {
        assert!(!boxes[..number].iter().any(|second| overlap(first, second)), "{number}");
    }
    let [left, top, right, bottom] = around(boxes.iter());
    let aspect = (right - left) / (bottom - top);
    assert!((1.8..=3.4).contains(&aspect), "{aspect}");
    assert!(share_right(&boxes, &edges) > 0.6, "{}", share_right(&boxes, &edges));
}

#[test]
fn a_small_change_moves_few_nodes() {
    let (nodes, edges) = limbs();
    let before = lay_out(&nodes, &edges);
    // One more command behind the last of a frame, which reads the one before it.
    let (mut more, mut wired) = (nodes.clone(), edges.clone());
    more.push(nodes[239]);
    wired.push((239, 240));
    let after = lay_out(&more, &wired);
    let moved = before.iter().zip(&after).filter(|(before, after)| before != after).count();
    assert!(moved < 60, "{moved} of {} moved", before.len());
    // Another edge within a frame that does not deepen it moves nothing outside.
    let other = edges.iter().copied().find(|(from, to)| nodes[*from].frame == nodes[*to].frame).unwrap();
    let twice: Vec<(usize, usize)> = edges.iter().copied().chain([other]).collect();
    let frame = nodes[other.0].frame;
    for (number, (before, after)) in before.iter().zip(lay_out(&nodes, &twice)).enumerate() {
        assert!(*before == after || nodes[number].frame == frame, "{number}");
    }
}

#[test]
fn columns_are_sorted_by_their_neighbours() {
    let nodes = nodes(8, |_| None);
    // Four nodes, each read by one of four others in reverse order.
    let reversed: Vec<(usize, usize)> = (0..4).map(|number| (number, 7 - number)).collect();
    let as_listed: Vec<[f32; 2]> =
        (0..8).map(|number| [if number < 4 { 0.0 } else { 300.0 }, 100.0 * (number % 4) as f32]).collect();
    assert_eq!(crossings(&as_listed, &reversed), 6);
    assert_eq!(crossings(&lay_out(&nodes, &reversed), &reversed), 0);
}

#[test]
fn long_columns_are_broken_and_edges_that_go_back_left_out() {
    let nodes = nodes(400, |_| None);
    let places = lay_out(&nodes, &[(3, 2), (5, 5), (0, 900)]);
    let [width, height] = [0, 1].map(|axis| places.iter().map(|place| place[axis]).fold(0.0, f32::max));
    assert!(width > 0.2 * height && height > 0.2 * width, "{width} by {height}");
    assert_eq!(lay_out(&[], &[]), Vec::<[f32; 2]>::new());
    // A long chain of frames is broken into rows.
    let chain: Vec<LayoutNode> =
        (0..30).map(|number| LayoutNode { size: [240.0, 60.0], frame: Some(number), is_folded: true }).collect();
    let places = lay_out(&chain, &(1..30).map(|number| (number - 1, number)).collect::<Vec<_>>());
    let [left, top, right, bottom] = around(boxes(&chain, &places).iter());
    assert!(right - left < 4.0 * (bottom - top), "{} by {}", right - left, bottom - top);
}
