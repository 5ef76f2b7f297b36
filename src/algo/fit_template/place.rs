//! Placement: the template's joints on the centre lines of their branches and in the sections of the trunk.

mod birds;
mod legs;
mod soles;
mod trunk;

use glam::{Quat, Vec3};

use super::{
    align::Stretch,
    assign::Hypothesis,
    limbs::{Limb, LimbKind, TemplateLimbs},
    line::CentreLine,
    report::FitReason,
    tree::Tree,
    volume::VoxelGraph,
};

/// Height of the spine in the trunk of an animal on all fours, from the belly to the back.
const SPINE_HEIGHT: f32 = 0.52;
/// Half of the thickness of a section of the trunk, in cells.
const SECTION: f32 = 2.5;
/// Radii of a limb between where it leaves the trunk and the ball that it turns about.
const BALL_OF_SHOULDER: f32 = 1.2;
const BALL_OF_HIP: f32 = 1.1;
/// Distance of a joint from the line between its neighbours above which a limb is bent, as a share of their distance.
const BENT: f32 = 0.04;

/// Shoulder, elbow and wrist of a spread wing with feathers, as shares of the way from shoulder to feathers' end.
const WING: [f32; 3] = [0.0, 0.16, 0.37];

/// Root of a wing, as a share of the way from the middle of the trunk to the place at which the wing leaves it.
const WING_ROOT: f32 = 0.3;

/// Place of the bones in a wing, as a share of the way from its centre line to its leading edge.
const LEADING_EDGE: f32 = 0.4;
/// Share at the shoulder, which carries the leading edge, and the part of the wing beside the trunk over which it falls to
/// that of the rest.
const SHOULDER_EDGE: f32 = 0.65;
const SHOULDER: f32 = 0.15;

/// Share of the way to where the centre line bends by which a joint moves, and that of the knee of an animal on all fours, over
/// which the flesh of the thigh bends the line lower down.
const TO_BEND: f32 = 0.8;
const KNEE: f32 = 0.3;

/// Rounds in which the joints of a limb of an animal on all fours move to its bends: a hock that moves up takes the knee
/// along, and shows more of its own bend then.
const ROUNDS: usize = 2;
/// Share of the way from the crown to where the neck enters the head by which the head's joint lies inside of the head.
const IN_SKULL: f32 = 0.1;

/// The joints of a template in the mesh.
#[derive(Debug, Clone)]
pub(super) struct Placement {
    /// Places in unit space.
    pub(super) places: Vec<Vec3>,
    pub(super) reasons: Vec<FitReason>,
    /// Share by which the length of each joint's limb differs from the template's; zero on the trunk.
    pub(super) strain: Vec<f32>,
    /// Length of the limb from its end to each joint, as a share of the limb's free length; one on the trunk.
    pub(super) along: Vec<f32>,
}

/// Places all joints of a template by a hypothesis.
pub(super) fn place(template: &TemplateLimbs, tree: &Tree, graph: &VoxelGraph, hypothesis: &Hypothesis) -> Placement {
    let forward = hypothesis.alignment.rotation * Vec3::Z;
    let posed = hypothesis.trunk.map(|turn| {
        let alignment = hypothesis.alignment.turned(turn, &hypothesis.pairs);
        Hypothesis { alignment, ..hypothesis.clone() }
    });
    let hypothesis = posed.as_ref().unwrap_or(hypothesis);
    let stretch = Stretch::fit(&hypothesis.pairs, &hypothesis.alignment);
    let count = template.positions.len();
    let mut reasons = vec![FitReason::Proportion; count];
    let mut strain = vec![0.0; count];
    let mut along_limb = vec![1.0; count];
    let line = |(limb, leaf): (&Limb, &Option<usize>)| {
        let leaf = (*leaf)?;
        let line = tree.lines[leaf].among(&tree.branches, &hypothesis.leaves);
        Some(if limb.kind == LimbKind::Wing { leading_edge(line, leaf, tree, graph, forward) } else { line })
    };
    let lines: Vec<Option<CentreLine>> = template.limbs.iter().zip(&hypothesis.leaves).map(line).collect();
    let standing = hypothesis.alignment.scale;
    let mut work = Work { template, tree, graph, hypothesis, stretch, lines, standing };
    let mut places: Vec<Option<Vec3>> = vec![None; count];
    let trunk = work.trunk_places();
    for (&joint, &place) in template.trunk.iter().zip(&trunk) {
        places[joint] = Some(place);
    }
    work.standing = work.standing_scale(&places);
    for ((limb, line), leaf) in template.limbs.iter().zip(&work.lines).zip(&hypothesis.leaves) {
        let Some(line) = line else {
            for &joint in &limb.joints {
                reasons[joint] = FitReason::NoLimb;
            }
            continue;
        };
        let attach = places[limb.attach].unwrap_or_else(|| stretch.apply(template.positions[limb.attach]));
        let Reach { lengths, root, whole, measured } = work.reach(limb, line, attach);
        for (&joint, &along) in limb.joints.iter().zip(&lengths) {
            strain[joint] = bevy::math::ops::ln(measured / hypothesis.alignment.scale).abs();
            along_limb[joint] = along / line.free.max(1e-9);
            if along <= line.free {
                reasons[joint] = FitReason::CentreLine;
            }
            places[joint] = Some(beyond_line(line, along, root, whole));
        }
        work.hold_bends(limb, line, &lengths, &mut places);
        work.keep_over_foot(limb, line, &lengths, &mut places);
        work.stand_on_sole((limb, *leaf), line, &lengths, &mut places);
    }
    work.carry_by_legs(&mut places);
    work.hang_tail(&mut places);
    Placement { places: follow(template, &stretch, &places), reasons, strain, along: along_limb }
}

/// The centre line of a wing, moved towards its leading edge: there lie the bones, and behind them feathers or skin.
fn leading_edge(line: CentreLine, leaf: usize, tree: &Tree, graph: &VoxelGraph, forward: Vec3) -> CentreLine {
    let arc_of = &tree.branches.arc_of;
    let nodes: Vec<Vec3> =
        (0..graph.len()).filter(|&node| arc_of[node] as usize == leaf).map(|node| graph.centres[node]).collect();
    let front = |at: usize| {
        let (before, after) = (at.saturating_sub(2), (at + 2).min(line.points.len() - 1));
        let along = (line.points[after] - line.points[before]).normalize_or_zero();
        let along = (along - forward * along.dot(forward)).normalize_or_zero();
        let place = line.points[at];
        let near = nodes.iter().filter(|node| (**node - place).dot(along).abs() < SECTION * graph.cell);
        near.map(|node| (*node - place).dot(forward)).fold(0.0f32, f32::max)
    };
    let shifts: Vec<f32> = (0..line.free_count.min(line.points.len())).map(front).collect();
    let last = shifts.last().copied().unwrap_or(0.0);
    let shifted = line.points.iter().enumerate().map(|(at, place)| {
        // Sections beside the body and at the tip hold little of the wing.
        let around = shifts.get(at.saturating_sub(3)..(at + 4).min(shifts.len())).unwrap_or_default();
        let mean = around.iter().sum::<f32>() / around.len().max(1) as f32;
        let shoulder = 1.0 - (1.0 - at as f32 / line.free_count.max(1) as f32) / SHOULDER;
        let edge = LEADING_EDGE + (SHOULDER_EDGE - LEADING_EDGE) * shoulder.clamp(0.0, 1.0);
        *place + forward * (edge * if around.is_empty() { last } else { mean })
    });
    let shifted = shifted.collect();
    line.along(shifted)
}

/// The place at a length from a limb's end: on the line, then straight from the line's free end to the root.
fn beyond_line(line: &CentreLine, along: f32, root: Vec3, whole: f32) -> Vec3 {
    if along <= line.free {
        return line.at(along);
    }
    let rest = (whole - line.free).max(1e-6);
    line.at(line.free).lerp(root, ((along - line.free) / rest).clamp(0.0, 1.0))
}

/// Places of a limb's joints along its line.
struct Reach {
    /// Length of each joint from the end.
    lengths: Vec<f32>,
    /// Root of the limb in the trunk.
    root: Vec3,
    whole: f32,
    /// Scale of the limb against the template.
    measured: f32,
}

/// A placement at work.
struct Work<'a> {
    template: &'a TemplateLimbs,
    tree: &'a Tree,
    graph: &'a VoxelGraph,
    hypothesis: &'a Hypothesis,
    stretch: Stretch,
    /// The centre line of each limb.
    lines: Vec<Option<CentreLine>>,
    /// Scale of the figure's height: how high the trunk stands over the ends of legs.
    standing: f32,
}

impl Work<'_> {
    /// Height of the trunk over the ends of its legs against the template's.
    fn standing_scale(&self, places: &[Option<Vec3>]) -> f32 {
        let (mut mesh, mut rest) = (0.0, 0.0);
        for (limb, line) in self.template.limbs.iter().zip(&self.lines) {
            let (Some(line), Some(attach)) = (line, places[limb.attach]) else { continue };
            if limb.kind == LimbKind::Leg {
                mesh += line.at(0.0).distance(attach);
                rest += self.template.tip(limb).distance(self.template.positions[limb.attach]);
            }
        }
        if rest > 0.0 { mesh / rest } else { self.hypothesis.alignment.scale }
    }

    /// Finds how a limb's joints lie along its line.
    fn reach(&self, limb: &Limb, line: &CentreLine, attach: Vec3) -> Reach {
        let template = self.template;
        let (first, end) = (limb.joints[0], limb.joints[limb.joints.len() - 1]);
        let scale = self.hypothesis.alignment.scale;
        // A long body has no longer shoulders: the limb's place at its joint of the trunk keeps the template's shape.
        let beside = template.positions[first] - template.positions[limb.attach];
        let mut root = attach + self.hypothesis.alignment.rotation * (beside * self.standing);
        if !self.template.is_upright() {
            root = self.over_leg(limb, line, attach, root);
        }
        if limb.kind == LimbKind::Wing {
            let left = self.hypothesis.alignment.rotation * Vec3::X;
            let out = (line.at(line.free) - attach).dot(left) * WING_ROOT;
            root += left * (out - (root - attach).dot(left));
            root = self.beside_spine(limb, root, attach);
        }
        let rest: Vec<f32> = limb.joints.iter().map(|&j| template.length(j, end) + limb.beyond).collect();
        let whole = rest[0];
        if self.template.is_upright() && limb.kind == LimbKind::Head {
            let (lengths, whole) = self.neck_lengths(limb, line, attach);
            return Reach { lengths, root: attach, whole, measured: scale };
        }
        let (measured, root) = match self.template.ball_joint(limb) {
            // The ball of a shoulder or hip lies about the limb's radius behind where the limb leaves the trunk.
            Some(ball) if self.template.is_upright() => {
                let place = self.ball_place(limb.kind, line);
                let ratio = (line.free + place.distance(line.at(line.free))) / rest[ball];
                let beside = self.hypothesis.alignment.rotation * (beside * self.ball_scale());
                let root = if ball == 0 { self.over_leg(limb, line, attach, place) } else { attach + beside };
                (ratio, root)
            }
            // A tail leaves the trunk at its first joint.
            _ if limb.kind == LimbKind::Tail => (line.free / whole, line.at(line.free)),
            _ => ((line.free + line.at(line.free).distance(root)) / whole, root),
        };
        // Tails of feathers are as long as they like, and all of what leaves the trunk is one.
        let ratio = if limb.kind == LimbKind::Tail { measured } else { measured.clamp(0.4 * scale, 2.5 * scale) };
        let mut lengths: Vec<f32> = rest.iter().map(|l| l * ratio).collect();
        if limb.kind == LimbKind::Wing && limb.joints.len() > WING.len() {
            for (length, share) in lengths.iter_mut().zip(WING) {
                *length = whole * ratio * (1.0 - share);
            }
        } else {
            self.hide_knee(limb, line, &mut lengths);
            self.keep_skull(limb, line, &mut lengths);
            for _ in 0..if self.template.is_on_fours() { ROUNDS } else { 1 } {
                self.bend(limb, line, &mut lengths, root);
            }
        }
        let whole = lengths[0];
        Reach { lengths, root, whole, measured }
    }

    /// Moves the joints between others to where the centre line bends the way the template does.
    fn bend(&self, limb: &Limb, line: &CentreLine, lengths: &mut [f32], root: Vec3) {
        let whole = lengths[0];
        // From the end: where a foot is tells how much is left for the leg above it.
        for i in (1..lengths.len().saturating_sub(1)).rev() {
            let [before, here, after] = [i - 1, i, i + 1].map(|k| self.template.positions[limb.joints[k]]);
            let chord = (after - before).normalize_or_zero();
            let out = (here - before) - chord * (here - before).dot(chord);
            if out.length() < BENT * before.distance(after) {
                continue;
            }
            let out = self.stretch.turn(out).normalize_or_zero();
            // Lengths fall along the joints: the one before is further from the end.
            let (far, near) = (lengths[i - 1].min(line.free), lengths[i + 1]);
            if far - near < 6.0 * self.graph.cell || lengths[i] > line.free {
                continue;
            }
            let (a, b) = (line.at(near), beyond_line(line, lengths[i - 1], root, whole));
            let straight = (b - a).normalize_or_zero();
            let side = (out - straight * out.dot(straight)).normalize_or_zero();
            let mut best = (BENT * a.distance(b), lengths[i]);
            let (low, high) = (near + 0.2 * (far - near), if far < line.free { far - 0.2 * (far - near) } else { far });
            for k in 0..=24 {
                let length = low + (high - low) * k as f32 / 24.0;
                let away = (line.at(length) - a).dot(side);
                if away > best.0 {
                    best = (away, length);
                }
            }
            let is_knee = i == 1 && self.template.is_hind_leg(limb);
            let moved = lengths[i] + if is_knee { KNEE } else { TO_BEND } * (best.1 - lengths[i]);
            let rest = (whole - moved) / (whole - lengths[i]).max(1e-9);
            let below = lengths[i];
            if !self.template.is_upright() {
                lengths[1..i].iter_mut().for_each(|length| *length = moved + (*length - below) * rest);
            }
            lengths[i] = moved;
        }
    }

    /// Distance between the middles of shoulders and of hips over that of the template.
    fn ball_scale(&self) -> f32 {
        let middle = |kind: LimbKind| {
            let (mut mesh, mut rest, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
            for (limb, line) in self.template.limbs.iter().zip(&self.lines) {
                let Some(line) = line.as_ref().filter(|_| limb.kind == kind) else { continue };
                let Some(ball) = self.template.ball_joint(limb) else { continue };
                mesh += self.ball_place(limb.kind, line);
                rest += self.template.positions[limb.joints[ball]];
                count += 1.0;
            }
            (count > 0.0).then(|| (mesh / count, rest / count))
        };
        match (middle(LimbKind::Arm), middle(LimbKind::Leg)) {
            (Some(arms), Some(legs)) => arms.0.distance(legs.0) / arms.1.distance(legs.1).max(1e-9),
            _ => self.hypothesis.alignment.scale,
        }
    }

    fn ball_place(&self, kind: LimbKind, line: &CentreLine) -> Vec3 {
        let behind = if kind == LimbKind::Leg { BALL_OF_HIP } else { BALL_OF_SHOULDER };
        let at = line.at(line.free);
        let back = (at - line.at((line.free - 6.0 * self.graph.cell).max(0.5 * line.free))).normalize_or_zero();
        let radius = line.radii[(line.free_count.max(4) - 3).min(line.radii.len() - 1)];
        at + back * (behind * radius).min(0.4 * line.free)
    }

    /// Lengths of the joints of neck and head and of the chest from the crown: the head turns a little above where the neck is
    /// narrowest.
    fn neck_lengths(&self, limb: &Limb, line: &CentreLine, chest: Vec3) -> (Vec<f32>, f32) {
        let from = line.lengths.partition_point(|&l| l < 0.3 * line.free).min(line.free_count - 1);
        let narrow =
            (from..line.free_count).reduce(|a, b| if line.radii[b] < line.radii[a] { b } else { a }).unwrap_or(from);
        let head = line.lengths[narrow] * (1.0 - IN_SKULL);
        let below = head + line.at(head).distance(chest);
        let whole = self.template.length(limb.attach, limb.joints[limb.joints.len() - 1]).max(1e-9);
        let share = |j: usize| self.template.length(limb.attach, j) / whole;
        (limb.joints.iter().map(|&j| below + (head - below) * share(j)).collect(), below)
    }

    /// Places of the trunk's joints: between the limbs that its ends carry, and in the trunk's sections across it.
    fn trunk_places(&self) -> Vec<Vec3> {
        let (template, stretch) = (self.template, &self.stretch);
        let trunk = &template.trunk;
        let mut places: Vec<Vec3> = trunk.iter().map(|&j| stretch.apply(template.positions[j])).collect();
        let upright = self.template.is_upright();
        let turn = self.hypothesis.alignment.rotation;
        let along = match (places.first(), places.last()) {
            (Some(a), Some(b)) if trunk.len() > 1 => {
                let way = *b - *a;
                let up = turn * Vec3::Y;
                let is_level = !upright && !template.has_hidden_knees();
                (if is_level { way - up * way.dot(up) } else { way }).normalize_or_zero()
            }
            _ => return places,
        };
        let balls = self.ball_scale();
        // How far the limbs of a joint lie from where the stretched template has them, along the trunk.
        let pull = |joint: usize, place: Vec3| {
            let (mut sum, mut count) = (0.0, 0.0);
            for (limb, line) in template.limbs.iter().zip(&self.lines) {
                let Some(line) = line.as_ref().filter(|_| limb.attach == joint && limb.partner.is_some()) else {
                    continue;
                };
                let wanted = match self.template.ball_joint(limb).filter(|_| upright) {
                    Some(ball) => {
                        let away = template.positions[joint] - template.positions[limb.joints[ball]];
                        (self.ball_place(limb.kind, line) + turn * away * balls).dot(along)
                    }
                    None if template.is_on_fours() => self.over_legs(limb, line, joint, place).dot(along),
                    None => {
                        let of_wing = (limb.kind == LimbKind::Wing).then(|| self.between_ends(joint)).flatten();
                        of_wing.unwrap_or_else(|| line.at(line.free)).dot(along)
                    }
                };
                sum += wanted - place.dot(along);
                count += 1.0;
            }
            (count > 0.0).then(|| sum / count)
        };
        let pulls: Vec<Option<f32>> = trunk.iter().zip(&places).map(|(&j, &p)| pull(j, p)).collect();
        let known: Vec<usize> = (0..trunk.len()).filter(|&i| pulls[i].is_some()).collect();
        for (i, place) in places.iter_mut().enumerate() {
            let before = known.iter().rev().find(|&&k| k <= i);
            let after = known.iter().find(|&&k| k >= i);
            let value = |k: usize| pulls[k].unwrap_or(0.0);
            let shift = match (before, after) {
                (Some(&a), Some(&b)) if a != b => value(a) + (value(b) - value(a)) * (i - a) as f32 / (b - a) as f32,
                (Some(&a), _) => value(a),
                (_, Some(&b)) => value(b),
                _ => 0.0,
            };
            *place += along * shift;
        }
        let left = self.hypothesis.alignment.rotation * Vec3::X;
        let up = self.hypothesis.alignment.rotation * if upright { Vec3::Z } else { Vec3::Y };
        let across = (up - along * along.dot(up)).normalize_or_zero();
        if template.is_on_fours() {
            return self.under_back(&places, along, left, across);
        }
        let in_section = |place: &Vec3| self.in_trunk(self.in_section(*place, along, left, across, upright));
        places.iter().map(in_section).collect()
    }

    /// Moves a place of the trunk across it, to where the spine is in its section.
    fn in_section(&self, place: Vec3, along: Vec3, left: Vec3, across: Vec3, upright: bool) -> Vec3 {
        let Some((low, high, centroid)) = self.section(place, along, left, across) else { return place };
        let depth = if upright || high <= low { centroid.dot(across) } else { low + SPINE_HEIGHT * (high - low) };
        place + left * centroid.dot(left) + across * depth
    }

    /// The section of the trunk at a place: how far it reaches from there across the trunk, at its middle, and its centroid. What
    /// lies over an animal's shoulders and rump may belong to its head and its tail.
    fn section(&self, place: Vec3, along: Vec3, left: Vec3, across: Vec3) -> Option<(f32, f32, Vec3)> {
        let branches = &self.tree.branches;
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let (mut sum, mut count) = (Vec3::ZERO, 0);
        let limbs = self.template.limbs.iter().zip(&self.hypothesis.leaves);
        let ends: Vec<usize> = limbs
            .filter(|(limb, _)| self.template.is_on_fours() && matches!(limb.kind, LimbKind::Head | LimbKind::Tail))
            .filter_map(|(_, leaf)| *leaf)
            .collect();
        for (node, centre) in self.graph.centres.iter().enumerate() {
            let arc = branches.arc_of[node];
            if arc == u32::MAX {
                continue;
            }
            let arc = arc as usize;
            if branches.arcs[arc].children.is_empty() && !ends.contains(&arc) {
                continue;
            }
            let away = *centre - place;
            if away.dot(along).abs() < SECTION * self.graph.cell {
                sum += away;
                count += 1;
                if away.dot(left).abs() < 3.0 * self.graph.cell {
                    low = low.min(away.dot(across));
                    high = high.max(away.dot(across));
                }
            }
        }
        (count >= 8).then(|| (low, high, sum / count as f32))
    }
}

/// Places the joints that are still open relative to their parents, turned as the bone is on which they lie: the one that begins at
/// their parent, or the one that ends there at the end of a limb and on the trunk.
pub(super) fn follow(template: &TemplateLimbs, stretch: &Stretch, places: &[Option<Vec3>]) -> Vec<Vec3> {
    let mut done = vec![Vec3::ZERO; places.len()];
    let mut turns = vec![Quat::IDENTITY; places.len()];
    let mut next = vec![None; places.len()];
    for pair in template.limbs.iter().flat_map(|limb| limb.joints.windows(2)) {
        next[pair[0]] = Some(pair[1]);
    }
    for &joint in &template.order {
        let Some(parent) = template.parents[joint] else {
            done[joint] = places[joint].unwrap_or_else(|| stretch.apply(template.positions[joint]));
            continue;
        };
        let rest = stretch.turn(template.positions[joint] - template.positions[parent]);
        match places[joint] {
            Some(place) => {
                done[joint] = place;
                let after = next[joint].and_then(|next: usize| Some((next, places[next]?)));
                let (rest, now) = match after {
                    Some((next, there)) => {
                        (stretch.turn(template.positions[next] - template.positions[joint]), there - place)
                    }
                    None => (rest, place - done[parent]),
                };
                turns[joint] = if rest.length_squared() > 1e-16 && now.length_squared() > 1e-16 {
                    Quat::from_rotation_arc(rest.normalize(), now.normalize())
                } else {
                    turns[parent]
                };
            }
            None => {
                done[joint] = done[parent] + turns[parent] * rest;
                turns[joint] = turns[parent];
            }
        }
    }
    done
}
