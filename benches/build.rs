//! Building a rig from its tags: all of the bundled biped, one parameter of it, and what an edit costs besides the
//! commands that it runs, among a thousand.
//!
//! Prints one JSON line. `cargo bench --no-default-features --bench build`; to compare with Rigify, alternate with
//! `python rigify_peer.py` (seconds to generate and to regenerate the human).

use std::{error::Error, path::Path, sync::Arc, time::Instant};

use rigsmith::{
    files::{RealDisk, load_template},
    modules,
    processor::{Builder, Modules},
    rig::{JointData, RestTransform, Rig, RigEdit, TagData, TagKind, Uid},
};

fn main() -> Result<(), Box<dyn Error>> {
    let modules = Arc::new(modules::all());
    let mut report = Vec::new();
    let mut note = |name: &str, value: f64| report.push(format!("\"{name}\": {value:.3}"));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    let biped = load_template(&RealDisk, &path)?.rig;

    let built = Builder::build(&biped, &modules)?;
    let created = built.nodes.iter().filter(|node| node.origin.is_some()).count();
    note("joints", biped.len() as f64);
    note("created_nodes", created as f64);
    note("constraints", built.constraints.len() as f64);
    let full = median(60, || {
        std::hint::black_box(Builder::build(&biped, &modules).map(|built| built.nodes.len()).unwrap_or(0));
    });
    note("full_build_ms", full / 1e3);
    note("full_build_us_per_created_node", full / created.max(1) as f64);

    let mut rig = biped.clone();
    let mut builder = Builder::new(modules.clone());
    builder.sync(&rig);
    builder.run_all();
    note("commands", builder.len() as f64);
    if let Some((joint, tag, params)) = control(&rig, &builder, &modules) {
        let mut ran = 0;
        let mut turn = false;
        let all = median(400, || {
            turn = !turn;
            let text = params[usize::from(turn)].clone();
            let edit = RigEdit::SetTag(joint, Box::new(with_params(&tag, text)));
            if rig.apply(&edit).is_ok() {
                builder.touch(&rig, &edit);
                ran = builder.run_all().executed.len();
                std::hint::black_box(builder.built().nodes.len());
            }
        });
        note("one_parameter_ms", all / 1e3);
        note("one_parameter_commands_run", ran as f64);
    }

    let (mut rig, last) = thousand();
    let mut builder = Builder::new(modules);
    builder.sync(&rig);
    if let Some(error) = builder.run_all().error {
        return Err(error.into());
    }
    let mut turn = false;
    let overhead = median(2000, || {
        turn = !turn;
        let up = if turn { 0.5 } else { 0.25 };
        let kind = TagKind::Command { module: "null".into(), params: nulls(up), feature: None };
        let edit = RigEdit::SetTag(last.0, Box::new(TagData { kind, ..last.1.clone() }));
        if rig.apply(&edit).is_ok() {
            builder.touch(&rig, &edit);
            builder.run_all();
        }
    });
    let spent = builder.status(last.1.uid).map_or(0.0, |status| f64::from(status.micros));
    note("edit_among_1000_us", overhead);
    note("edit_among_1000_command_us", spent);
    note("edit_among_1000_overhead_us", overhead - spent);
    println!("{{{}}}", report.join(", "));
    Ok(())
}

/// Microseconds that something takes, the median of so many times.
fn median(times: usize, mut work: impl FnMut()) -> f64 {
    let mut taken: Vec<f64> = (0..times)
        .map(|_| {
            let started = Instant::now();
            work();
            started.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    taken.sort_by(f64::total_cmp);
    taken[times / 2]
}

fn with_params(tag: &TagData, params: String) -> TagData {
    let kind = match &tag.kind {
        TagKind::Command { module, feature, .. } => {
            TagKind::Command { module: module.clone(), params, feature: *feature }
        }
        feature => feature.clone(),
    };
    TagData { kind, ..tag.clone() }
}

/// The first control in the list without a feature, with its parameters at two sizes.
fn control(rig: &Rig, builder: &Builder, modules: &Arc<Modules>) -> Option<(Uid, TagData, [String; 2])> {
    for entry in builder.list() {
        let tag = rig.joint(entry.joint)?.data.tags.iter().find(|tag| tag.uid == entry.command)?;
        let TagKind::Command { module, params, feature: None } = &tag.kind else { continue };
        let open = params.trim_start().strip_prefix('(');
        if let (true, Some(rest)) = (module == "control" && !params.contains("size"), open) {
            let sized = [0.25, 0.5].map(|size| format!("(size: {size:?}, {rest}"));
            if modules.load(module, &sized[0]).is_ok() {
                return Some((entry.joint, tag.clone(), sized));
            }
        }
    }
    None
}

fn nulls(up: f32) -> String {
    format!("(at: \"@this\", translate: (0.0, {up:?}, 0.0))")
}

/// A hundred joints with ten commands each.
fn thousand() -> (Rig, (Uid, TagData)) {
    let mut rig = Rig::new(Uid(1), "thousand");
    let mut last = None;
    for number in 0..100 {
        let joint = JointData {
            uid: Uid(10 + number),
            label: Some(format!("j{number}")),
            rest: RestTransform::from_translation([0.0, 0.1, 0.0].into()),
            ..Default::default()
        };
        let parent = (number > 0).then(|| Uid(9 + number));
        let mut edits = vec![RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }];
        for command in 0..10 {
            let uid = Uid(1000 + 10 * number + command);
            let kind = TagKind::Command { module: "null".into(), params: nulls(0.5), feature: None };
            let tag = TagData { uid, enabled: true, comment: String::new(), kind };
            last = Some((Uid(10 + number), tag.clone()));
            edits.push(RigEdit::AddTag { joint: Uid(10 + number), tag: Box::new(tag), index: 10 });
        }
        for edit in edits {
            // Fresh uids below a joint that is there: nothing can be refused.
            let _ = rig.apply(&edit);
        }
    }
    let middle = rig.joint(Uid(60)).and_then(|joint| joint.data.tags.first().cloned());
    let chosen = middle.map(|tag| (Uid(60), tag)).or(last);
    (rig, chosen.unwrap_or_else(|| (Uid(0), empty())))
}

fn empty() -> TagData {
    let kind = TagKind::Command { module: String::new(), params: String::new(), feature: None };
    TagData { uid: Uid(0), enabled: false, comment: String::new(), kind }
}
