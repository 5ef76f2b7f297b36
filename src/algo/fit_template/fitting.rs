//! Fitting: the steps of one fit, from the assignment of limbs to the report.

use glam::{Mat3, Quat, Vec3};

use super::{
    FitError, FitNote, FitReason, FitSettings, FitSymmetry, FittedSkeleton, HypothesisSummary, JointFit, MeshAnalysis,
    TemplateJoint, align,
    assign::Hypothesis,
    bends, chain, confidence,
    human::{self, Role},
    limbs::{self, LimbKind, TemplateLimbs},
    markers::{self, Marker},
    place,
    report::axis_name,
    symmetry,
};

/// Angle (its cosine) within which up and forward are taken to be an axis of the file.
const SNAP: f32 = 0.9;
/// Difference of the residuals of two starts below which the front is uncertain, as a share.
const UNCERTAIN: f32 = 0.06;
/// Distance between body model and surface, as a share of the height, above which the model is not used.
const UNLIKE: f32 = 0.018;
/// Distance outside of the mesh's bounds from which on a marker is a mistake, as a share of the mesh's longest side.
const MARGIN: f32 = 0.25;
/// Confidence of a fit from which on what it shows counts more than a wish that contradicts it.
const SURE: f32 = 0.7;
/// Distance of a marker from where a sure fit has its joint that contradicts it, as a share of the height.
const FAR: f32 = 0.25;
/// Distance, as a share of the height, within which a joint is where its marker is.
const AT_PLACE: f32 = 1e-4;
/// Cosine of the angle from which on two up directions are one.
const SAME_UP: f32 = 0.9;
/// Cosine of the angle below which a direction contradicts another one.
const OTHER_WAY: f32 = 0.5;
/// Cosine of the angle from which on up and forward are one line.
const PARALLEL: f32 = 0.98;
/// Most confidence in a fit by a direction that the mesh contradicts.
const CONTRADICTED: f32 = 0.45;

/// Function that takes the share of the work done, and cancels with `false`.
type Progress<'p> = &'p (dyn Fn(f32) -> bool + Sync);

/// A fit at work.
pub(super) struct Fit<'a> {
    analysis: &'a MeshAnalysis,
    joints: &'a [TemplateJoint<'a>],
    settings: &'a FitSettings,
    template: TemplateLimbs,
    markers: Vec<Marker>,
}

impl<'a> Fit<'a> {
    pub(super) fn new(
        analysis: &'a MeshAnalysis,
        joints: &'a [TemplateJoint<'a>],
        settings: &'a FitSettings,
    ) -> Result<Self, FitError> {
        if let Some(joint) = joints.iter().position(|j| !j.position.is_finite()) {
            return Err(FitError::Joint { joint });
        }
        if settings.root.is_some_and(|place| !place.is_finite()) {
            return Err(FitError::Root);
        }
        for (direction, name) in [(settings.up, "up"), (settings.forward, "forward")] {
            if direction.is_some_and(|d| d.normalize_or_zero() == Vec3::ZERO) {
                return Err(FitError::Direction(name));
            }
        }
        if let (Some(up), Some(forward)) = (settings.up, settings.forward)
            && up.normalize_or_zero().dot(forward.normalize_or_zero()).abs() > PARALLEL
        {
            return Err(FitError::Parallel);
        }
        let bad = |&(joint, position): &(usize, Vec3)| joint >= joints.len() || !position.is_finite();
        if let Some(marker) = settings.markers.iter().position(bad) {
            return Err(FitError::Marker { marker, joint: settings.markers[marker].0, joints: joints.len() });
        }
        let template = limbs::limbs(joints).filter(|t| !t.limbs.is_empty()).ok_or(FitError::NoChain)?;
        if !settings.markers.is_empty() {
            let (low, high) = analysis.bounds();
            let margin = MARGIN * (high - low).max_element();
            let is_far = |place: Vec3| place.cmplt(low - margin).any() || place.cmpgt(high + margin).any();
            if let Some(&(joint, place)) = settings.markers.iter().find(|(_, place)| is_far(*place)) {
                return Err(FitError::FarMarker { label: joints[joint].label.to_owned(), place, low, high });
            }
        }
        let markers = analysis.markers(settings);
        Ok(Self { analysis, joints, settings, template, markers })
    }

    /// Runs the fit, starting from an earlier one if it still holds.
    pub(super) fn run(
        self,
        before: Option<&FittedSkeleton>,
        progress: Progress<'_>,
    ) -> Result<FittedSkeleton, FitError> {
        let is_given = self.settings.up.is_some() || self.settings.forward.is_some();
        let has_sides = self.template.limbs.iter().any(|limb| limb.kind != LimbKind::Free);
        let is_weighed = before.is_none() && is_given && has_sides;
        let contradictions: Vec<FitNote> = match before {
            Some(before) => before.notes.iter().filter(|note| note.is_of_direction()).cloned().collect(),
            None if is_weighed => self.contradictions(&|share| progress(0.5 * share))?,
            None => Vec::new(),
        };
        let begun = if is_weighed { 0.5 } else { 0.0 };
        let mut fit = self.by_markers(before, &|share| progress(begun + (1.0 - begun) * share))?;
        if !contradictions.is_empty() {
            fit.confidence = fit.confidence.min(CONTRADICTED);
            fit.notes.extend(contradictions);
        }
        let is_finite = |joint: &JointFit| joint.position.is_finite() && joint.confidence.is_finite();
        match fit.joints.iter().all(is_finite) && fit.confidence.is_finite() {
            true => Ok(fit),
            false => Err(FitError::NotFinite),
        }
    }

    /// Directions of which the mesh shows the contrary: what a fit without them finds for sure.
    fn contradictions(&self, progress: Progress<'_>) -> Result<Vec<FitNote>, FitError> {
        let free = FitSettings { up: None, forward: None, markers: Vec::new(), ..self.settings.clone() };
        let shown = match Fit::new(self.analysis, self.joints, &free)?.settled(None, progress) {
            Ok((shown, _)) if shown.confidence >= SURE => shown,
            Err(FitError::Cancelled) => return Err(FitError::Cancelled),
            _ => return Ok(Vec::new()),
        };
        let cosine = |given: Option<Vec3>, shown: Vec3| given.map_or(1.0, |given| given.normalize_or_zero().dot(shown));
        let (up, forward) = (cosine(self.settings.up, shown.up), cosine(self.settings.forward, shown.forward));
        let mut notes = Vec::new();
        if up < OTHER_WAY {
            notes.push(FitNote::OtherUp(axis_name(shown.up)));
        }
        let is_uncertain = shown.notes.contains(&FitNote::UncertainFront);
        // Where the front is uncertain, the plane of symmetry still tells it from a side.
        if forward < OTHER_WAY && (!is_uncertain || forward > -OTHER_WAY) {
            notes.push(FitNote::OtherForward(axis_name(shown.forward)));
        }
        Ok(notes)
    }

    /// Fits with markers, which are weighed against what the mesh shows without them: where that is sure, a marker that
    /// contradicts it moves its own limb alone.
    fn by_markers(
        mut self,
        before: Option<&FittedSkeleton>,
        progress: Progress<'_>,
    ) -> Result<FittedSkeleton, FitError> {
        // A marker that was against the first fit is so until it is moved.
        for (marker, (joint, place)) in self.markers.iter_mut().zip(&self.settings.markers) {
            let Some((before, was)) = before.and_then(|before| Some((before, before.joints.get(*joint)?))) else {
                break;
            };
            let note = FitNote::MarkerAgainst(self.joints[*joint].label.to_owned());
            let is_there = was.position.distance(*place) <= AT_PLACE * before.height;
            marker.against = is_there && before.notes.contains(&note);
        }
        if let Some(before) = before.filter(|before| self.still_holds(&before.assignments)) {
            return Ok(self.settled(Some(before), progress)?.0);
        }
        if self.markers.is_empty() {
            return Ok(self.settled(None, progress)?.0);
        }
        let bare = FitSettings { markers: Vec::new(), ..self.settings.clone() };
        let shown = match before {
            Some(before) => Ok(before.clone()),
            None => {
                let first = |share: f32| progress(0.5 * share);
                Fit::new(self.analysis, self.joints, &bare)?.settled(None, &first).map(|(fit, _)| fit)
            }
        };
        let rest = |share: f32| progress(0.5 + 0.5 * share);
        let shown = match shown {
            Ok(shown) if shown.confidence >= SURE => shown,
            Err(FitError::Cancelled) => return Err(FitError::Cancelled),
            _ => return Ok(self.settled(None, &rest)?.0),
        };
        let far = FAR * shown.height;
        let is_against = |marker: &(usize, Vec3)| shown.joints[marker.0].position.distance(marker.1) > far;
        let against: Vec<bool> = self.settings.markers.iter().map(is_against).collect();
        if !against.contains(&true) && self.still_holds(&shown.assignments) {
            return Ok(self.settled(Some(&shown), &rest)?.0);
        }
        // Markers that agree with each other may know the sides or the front better; a figure that stands has its feet below.
        if !self.markers.iter().all(Marker::is_alone) {
            match self.settled(None, &rest) {
                Ok((marked, pull)) if marked.up.dot(shown.up) > SAME_UP && pull <= far => return Ok(marked),
                Err(FitError::Cancelled) => return Err(FitError::Cancelled),
                _ => {}
            }
        }
        for (marker, against) in self.markers.iter_mut().zip(against) {
            marker.against |= against;
        }
        Ok(self.settled(Some(&shown), &rest)?.0)
    }

    /// The fit by an earlier one, or by the best assignment of limbs; with it, the largest distance over which a marker
    /// pulls its joint, in the mesh's unit.
    fn settled(
        &self,
        before: Option<&FittedSkeleton>,
        progress: Progress<'_>,
    ) -> Result<(FittedSkeleton, f32), FitError> {
        let analysis = self.analysis;
        let step = |share: f32| if progress(share) { Ok(()) } else { Err(FitError::Cancelled) };
        step(0.0)?;
        let hypotheses = match before {
            Some(before) => before.assignments.clone(),
            None => analysis.hypotheses(&self.template, self.settings, &self.markers)?,
        };
        let best = &hypotheses[0];
        let tree = &analysis.trees[best.tree];
        let placement = place::place(&self.template, tree, &analysis.graph, best);
        let mut places = placement.places.clone();
        let told = self.markers.iter().filter(|marker| !marker.is_alone());
        let pull = told.map(|marker| places[marker.joint].distance(marker.place)).fold(0.0, f32::max);
        if let Some(leaf) = best.leaves.first().copied().flatten().filter(|_| chain::is_lone(&self.template)) {
            chain::spread(&self.template, tree, leaf, analysis.root(self.settings), &mut places);
        }
        let human = human::is_human(&self.template) && !self.settings.without_body_model;
        let roles = human.then(|| human::roles(self.joints, &self.template));
        let body = match &roles {
            Some(roles) => self.registered_body(roles, &hypotheses, &places, before, &step)?,
            None => None,
        };
        if let (Some(body), Some(roles)) = (&body, &roles) {
            places = self.by_roles(body, roles, best);
        }
        step(0.95)?;
        let (plane, is_forced) = self.make_symmetric(&mut places);
        let pulls = self.pulls(before, plane);
        let (up, forward) = self.directions(best, body.as_ref());
        let is_solid = |place| analysis.is_solid(place);
        let level = analysis.mesh.space.direction_to_unit(forward);
        markers::shift_wings(&self.template, &mut places, &pulls, level, &is_solid);
        markers::warp(&self.template, &mut places, &pulls, body.is_some(), &is_solid);
        self.bend_as_template(best, (up, forward), &pulls, &mut places);
        let near: Vec<Option<f32>> = match (&body, &roles) {
            (Some(body), Some(roles)) => roles.iter().map(|r| r.map(|r| body.place(r).1)).collect(),
            _ => vec![None; places.len()],
        };
        let with_body = body.as_ref().map(|b| (b, near.as_slice()));
        let mut trusted =
            confidence::joints(&self.template, &placement, with_body, best, &analysis.voxels, &analysis.graph, &places);
        if body.is_some() {
            confidence::doubt_folded(&self.template, tree, best, &places, &mut trusted);
        } else {
            // A body model has tried the assignments on the surface.
            let (trees, graph) = (&analysis.trees, &analysis.graph);
            confidence::doubt_ambiguous(&self.template, trees, graph, &hypotheses, &placement, &mut trusted);
        }
        confidence::doubt_uneven(&self.template, &places, &mut trusted);
        let confidence = confidence::whole(&self.template, best, body.as_ref(), &trusted);
        for marker in &pulls {
            trusted[marker.joint] = (1.0, if marker.mirrored { FitReason::Partner } else { FitReason::Marker });
        }
        let space = &analysis.mesh.space;
        let position = |joint: usize| {
            let marker = self.settings.markers.iter().rev().find(|m| m.0 == joint);
            marker.map_or_else(|| space.to_file(places[joint]), |m| m.1)
        };
        let fits = trusted.iter().enumerate().map(|(joint, &(confidence, reason))| JointFit {
            position: position(joint),
            confidence,
            reason,
        });
        let mut notes = self.notes(best, body.as_ref());
        if plane.is_some() && self.settings.symmetry != FitSymmetry::Off {
            let pairs = self.template.mirror.iter().flatten().count() / 2;
            notes.push(if is_forced { FitNote::ForcedSymmetric(pairs) } else { FitNote::MadeSymmetric });
        }
        let fit = FittedSkeleton {
            up,
            forward,
            symmetry: plane.map(|(p, n)| (space.to_file(p), space.direction_to_file(n))),
            height: analysis.height(space.direction_to_unit(up)),
            confidence,
            joints: fits.collect(),
            hypotheses: hypotheses.iter().map(|h| self.summary(h)).collect(),
            notes,
            body,
            assignments: hypotheses,
        };
        Ok((fit, (f64::from(pull) / space.scale) as f32))
    }

    /// The body model on the mesh; `None` for a figure that is unlike all bodies and is left to its centre lines.
    /// `plain` are the joints on centre lines.
    fn registered_body(
        &self,
        roles: &[Option<Role>],
        hypotheses: &[Hypothesis],
        plain: &[Vec3],
        before: Option<&FittedSkeleton>,
        step: &dyn Fn(f32) -> Result<(), FitError>,
    ) -> Result<Option<human::FittedBody>, FitError> {
        let analysis = self.analysis;
        if let Some(before) = before {
            let pulls = self.pulls(Some(before), None);
            return Ok(before.body.as_ref().map(|body| self.refitted_body(body, roles, &pulls)));
        }
        let anchor = |(role, &position): (&Option<Role>, &Vec3)| match role {
            Some(Role::Bone(b)) => Some(human::Anchor { place: human::Place::Joint(*b), position, weight: 1.0 }),
            _ => None,
        };
        let anchors: Vec<human::Anchor> = roles.iter().zip(plain).filter_map(anchor).collect();
        let (surface, target) = (&analysis.surface, &analysis.target);
        let body = human::fit(surface, target, &self.template, &analysis.trees, hypotheses, &anchors, step)?;
        let body = body.filter(|body| body.residual <= UNLIKE);
        Ok(body.map(|body| self.refitted_body(&body, roles, &self.markers)))
    }

    /// True if each marker on a limb lies nearest to the branch that the limb has.
    fn still_holds(&self, assignments: &[Hypothesis]) -> bool {
        let Some(best) = assignments.first().filter(|b| b.leaves.len() == self.template.limbs.len()) else {
            return false;
        };
        let Some(tree) = self.analysis.trees.get(best.tree) else { return false };
        let slack = 4.0 * self.analysis.graph.cell;
        self.markers.iter().filter(|marker| !marker.is_alone()).all(|marker| {
            let Some(limb) = self.template.limbs.iter().position(|l| l.joints.contains(&marker.joint)) else {
                return true;
            };
            let Some(leaf) = best.leaves[limb] else { return true };
            let distance = |leaf: usize| tree.lines[leaf].distance(marker.place);
            let taken = best.leaves.iter().flatten().copied();
            taken.filter(|&l| l != leaf).all(|other| distance(other) > slack || distance(leaf) < 2.0 * slack)
        })
    }

    /// Markers with their images on the other side, where mesh and pose are symmetric: about the plane of an earlier fit, or else
    /// about one in unit space.
    fn pulls(&self, before: Option<&FittedSkeleton>, plane: Option<(Vec3, Vec3)>) -> Vec<Marker> {
        let space = &self.analysis.mesh.space;
        let known = before.and_then(|before| before.symmetry);
        let known = known.map(|(point, normal)| (space.to_unit(point), space.direction_to_unit(normal)));
        match known.or(plane).filter(|_| self.settings.symmetry != FitSymmetry::Off) {
            Some(plane) => markers::with_partners(&self.template, &self.markers, plane),
            None => self.markers.clone(),
        }
    }

    fn refitted_body(&self, body: &human::FittedBody, roles: &[Option<Role>], markers: &[Marker]) -> human::FittedBody {
        // A person's idea of the spine and of clavicles, which the surface hides, must not bend the body.
        let of_bone = |m: &Marker| match roles[m.joint] {
            Some(Role::Bone(bone)) if human::is_shown(bone) && !m.is_alone() => Some((bone, m.place)),
            _ => None,
        };
        let kept: Vec<(usize, Vec3)> = markers.iter().filter_map(of_bone).collect();
        if kept.is_empty() {
            return body.clone();
        }
        human::refit(&self.analysis.surface, &self.analysis.target, body, &kept)
    }

    /// Places by the registered body; joints without a role lie between those with one, or follow their parents.
    fn by_roles(&self, body: &human::FittedBody, roles: &[Option<Role>], best: &Hypothesis) -> Vec<Vec3> {
        let template = &self.template;
        let mut places: Vec<Option<Vec3>> = roles.iter().map(|r| r.map(|r| body.place(r).0)).collect();
        let known = places.clone();
        for &joint in &template.order {
            if known[joint].is_some() {
                continue;
            }
            let mut above = template.parents[joint];
            while let Some(a) = above.filter(|&a| known[a].is_none()) {
                above = template.parents[a];
            }
            // The nearest joint below with a role.
            let mut below = None;
            for &other in &template.order {
                let mut up = Some(other);
                while let Some(u) = up.filter(|&u| u != joint) {
                    up = template.parents[u];
                }
                if known[other].is_some() && up.is_some() && below.is_none() {
                    below = Some(other);
                }
            }
            if let (Some(a), Some(b)) = (above, below) {
                let share = template.length(a, joint) / template.length(a, b).max(1e-9);
                if let (Some(from), Some(to)) = (known[a], known[b]) {
                    places[joint] = Some(from.lerp(to, share.clamp(0.0, 1.0)));
                }
            }
        }
        let pairs: Vec<(Vec3, Vec3, f32)> =
            known.iter().zip(&template.positions).filter_map(|(k, &p)| k.map(|k| (p, k, 1.0))).collect();
        let similarity = align::similarity(&pairs).map_or(best.alignment, |s| s.0);
        place::follow(template, &align::Stretch::fit(&pairs, &similarity), &places)
    }

    /// Makes left and right alike, where they shall be. Returns the plane of symmetry, and whether it is only asked for.
    fn make_symmetric(&self, places: &mut [Vec3]) -> (Option<(Vec3, Vec3)>, bool) {
        let analysis = self.analysis;
        let of_mesh = analysis.mirror.filter(|plane| plane.is_of(&self.template, places));
        // Joints on the two sides are never quite alike: where the mesh has a plane of symmetry, theirs would be tilted.
        let found = of_mesh
            .map(|plane| (plane.point, plane.normal))
            .or_else(|| symmetry::find(&self.template, places, &analysis.graph, &analysis.voxels));
        let plane = match self.settings.symmetry {
            FitSymmetry::Off => None,
            FitSymmetry::Auto => found,
            FitSymmetry::On => found.or_else(|| symmetry::plane(&self.template, places)),
        };
        if let Some(plane) = plane {
            symmetry::make_symmetric(&self.template, places, plane);
        } else if self.settings.symmetry == FitSymmetry::Auto
            && let Some(plane) = analysis.mirror
        {
            symmetry::centre(&self.template, places, (plane.point, plane.normal));
        }
        (plane.or(found), found.is_none() && plane.is_some())
    }

    /// Bends elbows and knees as the template does; a place that a person gave stays with its neighbours.
    fn bend_as_template(
        &self,
        best: &Hypothesis,
        (up, forward): (Vec3, Vec3),
        markers: &[Marker],
        places: &mut [Vec3],
    ) {
        let space = &self.analysis.mesh.space;
        let (up, forward) = (space.direction_to_unit(up), space.direction_to_unit(forward));
        let Some(left) = up.cross(forward).try_normalize() else { return };
        let turn = Quat::from_mat3(&Mat3::from_cols(left, up, left.cross(up))).normalize();
        let lines = &self.analysis.trees[best.tree].lines;
        let radius = |limb: usize, place: Vec3| best.leaves[limb].map_or(0.0, |leaf| lines[leaf].radius_at(place));
        let is_fixed = |joint: usize| markers.iter().any(|marker| marker.joint == joint);
        bends::follow_template(&self.template, turn, is_fixed, radius, places);
    }

    /// Directions up and forward in the mesh's space: the file's axes where they are near.
    fn directions(&self, best: &Hypothesis, body: Option<&human::FittedBody>) -> (Vec3, Vec3) {
        let rotation = body.map_or(best.alignment.rotation, |b| b.trunk);
        let space = &self.analysis.mesh.space;
        let snapped = |d: Vec3, not: Vec3| {
            let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
            axes.into_iter().find(|a| a.dot(d) > SNAP && a.dot(not).abs() < 0.5).unwrap_or(d)
        };
        let up = snapped(space.direction_to_file(rotation * Vec3::Y), Vec3::ZERO);
        let up = self.settings.up.map_or(up, |u| u.normalize_or_zero());
        let forward = space.direction_to_file(rotation * Vec3::Z);
        let level = (forward - up * forward.dot(up)).normalize_or_zero();
        let forward = snapped(level, up);
        (up, self.settings.forward.map_or(forward, |f| f.normalize_or_zero()))
    }

    fn summary(&self, hypothesis: &Hypothesis) -> HypothesisSummary {
        let lines = &self.analysis.trees[hypothesis.tree].lines;
        let end = |leaf: &Option<usize>| leaf.map(|l| self.analysis.mesh.space.to_file(lines[l].at(0.0)));
        let limbs = self.template.limbs.iter().zip(&hypothesis.leaves).map(|(l, leaf)| (l.kind, end(leaf))).collect();
        HypothesisSummary { cost: hypothesis.cost, limbs }
    }

    fn notes(&self, best: &Hypothesis, body: Option<&human::FittedBody>) -> Vec<FitNote> {
        let analysis = self.analysis;
        let mut notes = Vec::new();
        let mut counted = |count: usize, note: fn(usize) -> FitNote| {
            if count > 0 {
                notes.push(note(count));
            }
        };
        counted(analysis.mesh.specks, FitNote::Specks);
        counted(analysis.graph.tied, FitNote::Tied);
        counted(analysis.graph.loose, FitNote::Loose);
        counted(analysis.grounds, FitNote::Grounds);
        counted(analysis.sheets, FitNote::Sheets);
        let used = best.leaves.iter().filter(|l| l.is_some()).count();
        counted(analysis.trees[best.tree].branches.leaves.len() - used, FitNote::UnusedBranches);
        for (limb, leaf) in self.template.limbs.iter().zip(&best.leaves) {
            if leaf.is_none() {
                notes.push(FitNote::MissingLimb(limb.kind));
            }
        }
        if let Some(body) = body {
            notes.push(FitNote::BodyModel);
            if body.backwards.is_some_and(|backwards| backwards - body.start < UNCERTAIN * body.start) {
                notes.push(FitNote::UncertainFront);
            }
        }
        for marker in &self.markers {
            let label = || self.joints[marker.joint].label.to_owned();
            notes.extend(marker.outside.then(|| FitNote::MarkerOutside(label())));
            notes.extend(marker.against.then(|| FitNote::MarkerAgainst(label())));
        }
        notes
    }
}
