//! The merge history in depth as a tree, with its cut.

use bevy_egui::egui::{self, Color32, Pos2, Rect, RichText, Sense, Stroke, Ui, WidgetInfo, WidgetType, vec2};

use crate::{
    algo::{
        face::{auto::FaceAnalysis, grouping::HeadGroup},
        linkage::Dendrogram,
    },
    editor::{
        panel::Requests,
        panels::fields::{TypedText, typed_field},
        style,
    },
};

/// Number of drawn leaves; each stands for the subtree below it.
const LEAVES: usize = 16;

/// A cluster that is drawn.
struct Branch {
    /// Position from front (0) to back (1).
    at: f32,
    height: f32,
    children: Option<(usize, usize)>,
    group: HeadGroup,
}

/// Draws the tree. A click between two heights cuts there at the next placement; a double click restores the automatic
/// choice. Returns true once a person has chosen: after a click, and after the release of the slider.
pub(super) fn show(ui: &mut Ui, analysis: &FaceAnalysis, groups: &mut Option<usize>, requests: &mut Requests) -> bool {
    let tree = &analysis.groups.depth;
    let heights = tree.heights(LEAVES);
    let Some(top) = heights.first().copied().filter(|top| *top > 0.0) else {
        ui.weak("There is one group only.");
        return false;
    };
    let size = vec2(ui.available_width(), 110.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, "Merge history"));
    let area = rect.shrink2(vec2(8.0, 8.0));
    // The square root makes small heights visible.
    let level = |height: f32| area.bottom() - area.height() * (height / top).max(0.0).sqrt();
    let cut = groups.unwrap_or(analysis.groups.groups).clamp(1, heights.len() + 1);
    draw(ui, area, tree, analysis, &level);
    let line = cut_height(&heights, cut);
    let dashes = [Pos2::new(area.left(), level(line)), Pos2::new(area.right(), level(line))];
    let color = ui.visuals().warn_fg_color;
    ui.painter().extend(egui::Shape::dashed_line(&dashes, Stroke::new(1.5, color), 5.0, 4.0));
    let mut is_chosen = response.clicked() || response.double_clicked();
    let response = response.on_hover_text("Click where the history is to be cut; double-click to let the mesh decide");
    if response.double_clicked() {
        *groups = None;
    } else if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.clicked()) {
        let at = ((area.bottom() - pointer.y) / area.height()).clamp(0.0, 1.0);
        let height = at * at * top;
        *groups = Some(heights.iter().filter(|merge| **merge > height).count() + 1);
    }
    key(ui);
    let mut count = cut;
    let (typed, most) = (TypedText::default(), heights.len() + 1);
    let slider = egui::Slider::new(&mut count, 1..=most).text("groups").update_while_editing(false);
    let slider = typed_field(ui, "groups", slider.custom_parser(typed.whole_reader(1.0..=most as f64, "")));
    typed.tell(&slider, "The number of groups", requests);
    // The field of the number changes with each letter, its number when the field is left.
    let is_other = count != cut;
    if is_other {
        *groups = Some(count);
    }
    is_chosen |= slider.drag_stopped() || is_other && !slider.is_pointer_button_down_on();
    ui.weak(match groups {
        Some(_) => "Cut by hand; place again to use it. The front groups that hold features are joined.",
        None => "Cut where every feature lies in the face. Front groups are joined.",
    });
    is_chosen
}

/// Draws what stands where in the tree, and the colours of the groups.
fn key(ui: &mut Ui) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.label(RichText::new("Front to back:").small().weak());
        for (group, name) in [(HeadGroup::Face, "face"), (HeadGroup::Middle, "middle"), (HeadGroup::Back, "back")] {
            ui.label(RichText::new(format!("⏺ {name}")).small().color(style::readable(ui.visuals(), color(group))));
        }
        ui.label(RichText::new("- - cut").small().color(ui.visuals().warn_fg_color));
    });
}

/// A height between the merges on both sides of the cut.
fn cut_height(heights: &[f32], groups: usize) -> f32 {
    let above = groups.checked_sub(2).and_then(|last| heights.get(last)).copied().unwrap_or(heights[0] * 1.1);
    let below = heights.get(groups - 1).copied().unwrap_or(0.0);
    0.5 * (above + below)
}

fn draw(ui: &Ui, area: Rect, tree: &Dendrogram, analysis: &FaceAnalysis, level: &dyn Fn(f32) -> f32) {
    let branches = branches(tree, analysis);
    let x = |branch: &Branch| area.left() + branch.at * area.width();
    for branch in &branches {
        let Some((first, second)) = branch.children else { continue };
        for child in [first, second].map(|child| &branches[child]) {
            let stroke = Stroke::new(1.5, style::readable(ui.visuals(), color(child.group)));
            let corner = Pos2::new(x(child), level(branch.height));
            ui.painter().line_segment([Pos2::new(x(branch), level(branch.height)), corner], stroke);
            ui.painter().line_segment([corner, Pos2::new(x(child), level(child.height))], stroke);
        }
    }
}

/// The colours of the paper's figure: red, green, blue.
fn color(group: HeadGroup) -> Color32 {
    match group {
        HeadGroup::Face => Color32::from_rgb(230, 110, 90),
        HeadGroup::Middle => Color32::from_rgb(110, 190, 110),
        HeadGroup::Back => Color32::from_rgb(100, 140, 230),
    }
}

/// The upper part of the tree, children before parents; the root is last.
fn branches(tree: &Dendrogram, analysis: &FaceAnalysis) -> Vec<Branch> {
    let points = tree.points;
    let Some(root) = points.checked_add(tree.merges.len()).and_then(|n| n.checked_sub(1)) else { return Vec::new() };
    let merge = |cluster: usize| cluster.checked_sub(points).and_then(|merge| tree.merges.get(merge));
    // The largest merges are opened one after another until there are enough leaves.
    let mut open: Vec<usize> = Vec::new();
    let mut leaves = vec![root];
    while leaves.len() < LEAVES {
        let highest = (0..leaves.len()).filter(|leaf| merge(leaves[*leaf]).is_some());
        let Some(at) = highest.max_by_key(|leaf| leaves[*leaf]) else { break };
        let cluster = leaves.swap_remove(at);
        if let Some(merge) = merge(cluster) {
            leaves.extend([merge.first as usize, merge.second as usize]);
            open.push(cluster);
        }
    }
    // A single point of a cluster gives the cluster's position: clusters in depth do not overlap.
    let point = |mut cluster: usize| {
        while let Some(merge) = merge(cluster) {
            cluster = merge.first as usize;
        }
        cluster
    };
    let depth = |cluster: usize| analysis.points.get(point(cluster)).map_or(0.0, |point| point.z);
    leaves.sort_by(|a, b| depth(*b).total_cmp(&depth(*a)).then(a.cmp(b)));
    let group = |cluster: usize| analysis.groups.of.get(point(cluster)).copied().unwrap_or(HeadGroup::Back);
    let mut numbers = std::collections::BTreeMap::new();
    let mut branches = Vec::new();
    let last = leaves.len().saturating_sub(1).max(1) as f32;
    for (place, cluster) in leaves.iter().enumerate() {
        numbers.insert(*cluster, branches.len());
        let height = merge(*cluster).map_or(0.0, |merge| merge.height);
        branches.push(Branch { at: place as f32 / last, height, children: None, group: group(*cluster) });
    }
    // Merges are numbered by height, so later ones are higher.
    open.sort_unstable();
    for cluster in open {
        let Some(merge) = merge(cluster) else { continue };
        let (Some(first), Some(second)) =
            (numbers.get(&(merge.first as usize)).copied(), numbers.get(&(merge.second as usize)).copied())
        else {
            continue;
        };
        numbers.insert(cluster, branches.len());
        let at = 0.5 * (branches[first].at + branches[second].at);
        branches.push(Branch { at, height: merge.height, children: Some((first, second)), group: group(cluster) });
    }
    branches
}
