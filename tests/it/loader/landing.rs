//! Templates that are read while steps are undone.

use rigsmith::{
    editor::result_queue::{self, DiscardResult},
    plugins::landing::HeldResult,
};

use super::*;
use crate::bench::{begin_drag, new_clip, undo_meanwhile};

/// Asks for the use of a template, and undoes a step before its work can land.
fn waiting(studio: &mut Studio, place: TemplatePlace, act: LibraryAct) {
    let rig = studio.desk.rig;
    begin_drag(&mut studio.desk.app, rig);
    studio.desk.app.world_mut().write_message(LibraryRequest { place, act });
    studio.desk.until("the template", |desk| desk.app.world().resource::<LibraryJobs>().waits().is_some());
    undo_meanwhile(&mut studio.desk.app, rig, new_clip("wave"));
    studio.desk.frames(3);
}

#[test]
fn no_use_of_a_template_discards_steps_that_were_undone_while_it_was_read() {
    for number in 0..5 {
        let mut studio = Studio::new(LoaderPanel::default());
        let joints = vec![studio.joint("arm_l"), studio.joint("elbow_l")];
        let (place, act) = match number {
            0 => (studio.tall(), LibraryAct::Load { keep: true }),
            1 => (studio.tall(), LibraryAct::Load { keep: false }),
            2 => (studio.limb(), LibraryAct::Merge { parent: None }),
            3 => (studio.limb(), LibraryAct::Inject { joints }),
            _ => (studio.limb(), LibraryAct::Part { joints, options: Vec::new() }),
        };
        let (before, steps) = (studio.desk.rig().clone(), studio.desk.steps().1);
        waiting(&mut studio, place, act.clone());
        assert_eq!(*studio.desk.rig(), before, "{act:?}: nothing lands");
        assert_eq!(studio.desk.steps(), (steps + 1, steps), "{act:?}: the step can be redone");
        let is_warning = |told: &&String| told.contains("would lose the steps that were undone");
        assert_eq!(studio.desk.told().iter().filter(is_warning).count(), 1, "{act:?}: told once");
        assert!(studio.world().resource::<LibraryJobs>().name().is_none(), "{act:?}: nothing is read any more");

        // Redone, the template is put onto the rig as it is then.
        studio.change(Change::Redo);
        studio.desk.until("the use of the template", |desk| desk.steps() == (steps + 2, steps + 2));
        studio.settle();
        assert!(studio.world().resource::<LibraryJobs>().waits().is_none());
        assert_ne!(*studio.desk.rig(), before, "{act:?}");
        (0..2).for_each(|_| studio.change(Change::Undo));
        assert_eq!(*studio.desk.rig(), before, "{act:?}");
    }
}

#[test]
fn another_request_takes_the_place_of_a_template_that_waits() {
    let mut studio = Studio::new(LoaderPanel::default());
    let joints = studio.desk.rig().len();
    let (tall, limb) = (studio.tall(), studio.limb());
    waiting(&mut studio, tall, LibraryAct::Load { keep: true });
    // What a person asks for after an undo goes on from there, as any other edit does.
    studio.act(limb, LibraryAct::Merge { parent: None });
    assert!(studio.told("another was asked for while it waited"), "{:?}", studio.desk.told());
    assert_eq!((studio.desk.rig().len(), studio.height("hips")), (joints + 2, 1.0));
    assert_eq!(studio.desk.steps(), (1, 1));
}

#[test]
fn a_template_that_waits_can_be_discarded() {
    let mut studio = Studio::new(LoaderPanel::default());
    let (before, tall) = (studio.desk.rig().clone(), studio.tall());
    waiting(&mut studio, tall, LibraryAct::Load { keep: true });
    assert_eq!(result_queue::waiting(studio.world()), Some((HeldResult::Template, "tall_man waits".to_owned())));
    studio.send(DiscardResult(HeldResult::Template));
    assert!(
        result_queue::waiting(studio.world()).is_none() && studio.told("it was discarded"),
        "{:?}",
        studio.desk.told()
    );
    assert_eq!(*studio.desk.rig(), before);
    studio.change(Change::Redo);
    assert_eq!((studio.height("hips"), studio.desk.steps()), (1.0, (1, 1)), "the step is done again, and nothing else");
}
