//! Layout of graphs, whatever they are of.

use rigsmith::editor::panels::graph::layout::{GRID, LayoutNode, crossings, lay_out, snapped};

fn nodes(count: usize, frame: impl Fn(usize) -> Option<usize>) -> Vec<LayoutNode> {
    (0..count)
        .map(|number| LayoutNode { size: [220.0, 44.0 + 18.0 * (number % 5) as f32], frame: frame(number) })
        .collect()
}

/// Edges from earlier to later nodes, the same for the same seed.
fn edges(count: usize, seed: u64) -> Vec<(usize, usize)> {
    let mut state = seed;
    let mut next = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
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

#[test]
fn edges_go_right_and_no_node_covers_another() {
    for seed in 1..20 {
        let count = 20 + 9 * seed as usize;
        let nodes = nodes(count, |number| (number % 3 > 0).then_some(number % 3));
        let edges = edges(count, seed);
        let places = lay_out(&nodes, &edges);
        assert_eq!(places, lay_out(&nodes, &edges), "the same graph is laid out alike");
        for (from, to) in &edges {
            assert!(places[*from][0] + nodes[*from].size[0] < places[*to][0], "{seed}: {from} to {to}");
        }
        let boxes = boxes(&nodes, &places);
        for (number, first) in boxes.iter().enumerate() {
            assert_eq!(places[number], snapped(places[number]), "on the grid of {GRID}");
            let covered = boxes[..number].iter().position(|second| overlap(first, second));
            assert_eq!(covered, None, "{seed}: of {number}");
        }
    }
}

#[test]
fn frames_are_bands_that_never_overlap() {
    let nodes = nodes(90, |number| Some(number % 4).filter(|frame| *frame > 0));
    let places = lay_out(&nodes, &edges(90, 7));
    let boxes = boxes(&nodes, &places);
    let band = |frame: Option<usize>| {
        let inside = nodes.iter().zip(&boxes).filter(|(node, _)| node.frame == frame).map(|(_, ends)| ends);
        inside.fold([f32::MAX, f32::MIN], |[low, high], ends| [low.min(ends[1]), high.max(ends[3])])
    };
    let mut bands: Vec<[f32; 2]> = [None, Some(1), Some(2), Some(3)].map(band).into();
    bands.sort_by(|a, b| a[0].total_cmp(&b[0]));
    for pair in bands.windows(2) {
        // Room for the title of the lower one.
        assert!(pair[0][1] + 40.0 <= pair[1][0], "{bands:?}");
    }
}

#[test]
fn columns_are_sorted_by_their_neighbours() {
    let nodes = nodes(10, |_| None);
    // Five nodes, each read by one of five others in reverse order.
    let reversed: Vec<(usize, usize)> = (0..5).map(|number| (number, 9 - number)).collect();
    let as_listed: Vec<[f32; 2]> =
        (0..10).map(|number| [if number < 5 { 0.0 } else { 300.0 }, 100.0 * (number % 5) as f32]).collect();
    assert_eq!(crossings(&as_listed, &reversed), 10);
    assert_eq!(crossings(&lay_out(&nodes, &reversed), &reversed), 0);
}

#[test]
fn long_columns_are_broken_and_edges_that_go_back_left_out() {
    let nodes = nodes(400, |_| None);
    let places = lay_out(&nodes, &[(3, 2), (5, 5), (0, 900)]);
    let [width, height] = [0, 1].map(|axis| places.iter().map(|place| place[axis]).fold(0.0, f32::max));
    assert!(width > 0.2 * height && height > 0.2 * width, "{width} by {height}");
    assert_eq!(lay_out(&[], &[]), Vec::<[f32; 2]>::new());
}
