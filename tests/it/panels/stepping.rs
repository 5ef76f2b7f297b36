//! The Process panel: steps by command and by joint both ways, runs to a command and to breakpoints, and a range of joints.

use bevy::{ecs::system::RunSystemOnce, math::Affine3A, prelude::*};
use bevy_egui::egui;
use rigsmith::{
    editor::panels::process::ProcessPanel,
    plugins::{
        commands::{BuildRequest, BuildStep, Processor},
        controls::outline::ControlNodes,
        schema::RigNodes,
    },
};

use super::{desk::Desk, tag_values::add_command};

fn processor(desk: &Desk) -> &Processor {
    desk.app.world().get::<Processor>(desk.rig).unwrap()
}

/// Clicks a button, and returns the number of commands that are in effect then.
fn step(desk: &mut Desk, button: &str) -> usize {
    desk.click(button);
    // Away from the button, whose tip says the same.
    desk.move_to(egui::pos2(3000.0, 3000.0));
    desk.frames(3);
    processor(desk).builder().cursor()
}

/// Chooses an entry of the menu of a row, and returns the number of commands that are in effect then.
fn choose(desk: &mut Desk, row: &str, entry: &str) -> usize {
    let row = desk.seen.iter().find(|seen| seen.label.starts_with(row)).unwrap_or_else(|| panic!("{row}"));
    let label = row.label.clone();
    desk.secondary_click(&label);
    step(desk, entry)
}

#[test]
fn builds_are_stepped_run_to_a_command_and_stopped_at_breakpoints() {
    let mut desk = Desk::new(ProcessPanel::default());
    let [a, b, c] = desk.chain(&["a", "b", "c"])[..] else { panic!() };
    for (joint, module) in [(a, "control"), (b, "control"), (b, "null"), (c, "control")] {
        add_command(&mut desk, joint, module, "()");
    }
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(4);
    let before = (desk.rig().clone(), desk.steps());
    assert_eq!(processor(&desk).builder().cursor(), 4);
    for (button, cursor) in [
        ("Roll all back", 0),
        ("Carry out the next command", 1),
        ("Carry out the next joint", 3),
        ("Take the last command back", 2),
        ("Roll the last joint back", 1),
        ("Run to the next breakpoint, or to the end", 4),
    ] {
        assert_eq!(step(&mut desk, button), cursor, "{button}");
    }
    assert_eq!(choose(&mut desk, "b control", "Run to here"), 2, "back to a command");
    choose(&mut desk, "b null", "Stop before it");
    assert_eq!(step(&mut desk, "Roll all back"), 0);
    assert_eq!(step(&mut desk, "Run to the next breakpoint, or to the end"), 2);
    assert_eq!(step(&mut desk, "Run to the next breakpoint, or to the end"), 4, "on from the breakpoint");
    choose(&mut desk, "b null", "Remove breakpoint");
    assert_eq!(step(&mut desk, "Roll all back"), 0);
    assert_eq!(step(&mut desk, "Run to the next breakpoint, or to the end"), 4);
    desk.select(&[b]);
    step(&mut desk, "Selection only");
    assert_eq!(processor(&desk).builder().len(), 3, "those of the joint and of what is below it");
    step(&mut desk, "Selection only");
    assert_eq!(processor(&desk).builder().len(), 4);
    assert_eq!((desk.rig().clone(), desk.steps()), before, "builds change no document");
}

/// Controls that are drawn and picked in the viewport are those of the commands that are in effect.
#[test]
fn the_viewport_shows_the_rig_grow_and_shrink_with_each_step() {
    let mut desk = Desk::new(ProcessPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    for joint in &joints {
        add_command(&mut desk, *joint, "control", "()");
    }
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(4);
    let drawn = |desk: &mut Desk| -> usize {
        let rig = desk.rig;
        let visible = move |controls: ControlNodes, nodes: Query<&RigNodes>| {
            controls.visible(nodes.get(rig).ok(), Affine3A::IDENTITY).len()
        };
        desk.app.world_mut().run_system_once(visible).expect("the system runs")
    };
    assert_eq!(drawn(&mut desk), 3);
    step(&mut desk, "Roll all back");
    assert_eq!(drawn(&mut desk), 0, "nothing is built");
    for count in 1..=3 {
        step(&mut desk, "Carry out the next command");
        assert_eq!(drawn(&mut desk), count);
    }
    step(&mut desk, "Take the last command back");
    assert_eq!(drawn(&mut desk), 2);
}
