//! Sockets and options of a template's file that a rig has never had.
//!
//! A project may come from a time when the rigs in it had no sockets and options, although their templates did. What such a
//! rig lacks was not taken away by a person, so a save over the file keeps it there.

use crate::rig::{
    Rig, RigAbout, RigEdit,
    part::{HeaderSocket, PartSocket},
    template,
};

/// The rig with the sockets and options of a template's text that neither it nor its base has, and their names in a sentence; `None`
/// if there are none. The base is the version of the template that the rig took over last: what it has, and the rig has not, was
/// removed.
pub(super) fn with_kept_lists(rig: &Rig, base: Option<&Rig>, text: &str) -> Option<(Rig, String)> {
    let file = template::read_template(text.as_bytes()).ok()?;
    let is_known = |has: &dyn Fn(&RigAbout) -> bool| has(rig.about()) || base.is_some_and(|base| has(base.about()));
    let mut kept = rig.clone();
    let mut names = Vec::new();
    for socket in &file.sockets {
        let has = |about: &RigAbout| about.sockets.iter().any(|known| known.name == socket.name);
        // A socket goes with its joint.
        let Some(socket) = on_joint(socket, &file.rig, rig).filter(|_| !is_known(&has)) else { continue };
        names.push(format!("the socket \"{}\"", socket.name));
        change(&mut kept, |about| about.sockets.push(socket))?;
    }
    for option in &file.options {
        let has = |about: &RigAbout| about.options.iter().any(|known| known.name == option.name);
        if !is_known(&has) {
            names.push(format!("the option \"{}\"", option.name));
            change(&mut kept, |about| about.options.push(option.clone()))?;
        }
    }
    let text = format!(
        "the file keeps {}: the document has never had it; take over the file's version in the Updater to change it here",
        names.join(", ")
    );
    (!names.is_empty()).then_some((kept, text))
}

/// The socket on the rig's joint that its label means in the file, or in the rig where a part brings the joint.
fn on_joint(socket: &PartSocket, file: &Rig, rig: &Rig) -> Option<HeaderSocket> {
    let joint = match file.labelled(&socket.label) {
        Some(joint) => joint,
        None => rig.labelled(&socket.label)?,
    };
    rig.joint(joint)?.data.label.as_ref()?;
    let (translation, rotation) = (socket.rest.translation, socket.angles);
    Some(HeaderSocket { name: socket.name.clone(), joint, translation, rotation })
}

fn change(rig: &mut Rig, change: impl FnOnce(&mut RigAbout)) -> Option<()> {
    let mut about = rig.about().clone();
    change(&mut about);
    rig.apply(&RigEdit::SetAbout(Box::new(about))).ok().map(drop)
}
