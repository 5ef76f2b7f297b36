//! Sockets: places of a part, or of a rig, that others hang on.

use bevy::math::Vec3;
use serde::{Deserialize, Serialize};

use crate::rig::{RestTransform, Rig, Uid, nearest::did_you_mean, reference::MOST_COMPARED};

/// A socket of a rig itself, as people write it in the header of its template.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeaderSocket {
    /// Name, without points.
    pub name: String,
    /// Joint of the socket.
    pub joint: Uid,
    /// Translation relative to the joint.
    pub translation: Vec3,
    /// Rotation relative to the joint: degrees about X, Y and Z.
    pub rotation: Vec3,
}

/// A place of a part, or of a rig, that other parts hang on, and that things of a game are attached to.
#[derive(Debug, Clone, PartialEq)]
pub struct PartSocket {
    /// Name: `hand` where the template itself has the socket, `left arm.hand` where a part of that name has it.
    pub name: String,
    /// Label of its joint in the file that has the socket.
    pub label: String,
    /// Joint of the socket; `None` until the part that brings the joint is there.
    pub joint: Option<Uid>,
    /// Place relative to the joint.
    pub rest: RestTransform,
    /// Rotation of that place as files have it: degrees about X, Y and Z.
    pub angles: Vec3,
    /// Place in the text that has the socket, in bytes.
    pub offset: usize,
}

/// Error of a socket.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SocketError {
    /// No socket has the name.
    #[error("there is no socket \"{name}\" before this part{nearest}")]
    Unknown {
        /// The name.
        name: String,
        /// End of the sentence with similar names.
        nearest: String,
    },
    /// The socket has no joint.
    #[error("socket \"{name}\" is on joint \"{label}\", which is not there{nearest}")]
    NoJoint {
        /// The name of the socket.
        name: String,
        /// Label of the joint.
        label: String,
        /// End of the sentence with similar labels.
        nearest: String,
    },
}

impl PartSocket {
    /// The socket as the header of its template has it; `None` without its joint.
    pub(in crate::rig) fn header(&self) -> Option<HeaderSocket> {
        let (joint, translation) = (self.joint?, self.rest.translation);
        Some(HeaderSocket { name: self.name.clone(), joint, translation, rotation: self.angles })
    }

    /// The socket with its joint, found by label.
    ///
    /// # Errors
    /// A joint that the rig does not have.
    pub fn in_rig(&self, rig: &Rig) -> Result<Self, SocketError> {
        let found = self.joint.filter(|joint| rig.joint(*joint).is_some()).or_else(|| rig.labelled(&self.label));
        let joint = found.ok_or_else(|| self.no_joint(rig.walk().filter_map(|joint| joint.data.label.as_deref())))?;
        Ok(Self { joint: Some(joint), ..self.clone() })
    }

    /// Gives sockets their joints as [`PartSocket::in_rig`] finds them. Those without a joint are taken out of the list, each
    /// with its error; their labels are compared with [`MOST_COMPARED`] labels in all.
    pub(in crate::rig) fn put_in_rig(sockets: &mut Vec<Self>, rig: &Rig) -> Vec<(Self, SocketError)> {
        let by_label = rig.joints_by_label();
        let (mut left_out, mut compared) = (Vec::new(), 0);
        sockets.retain_mut(|socket| {
            let known = socket.joint.filter(|joint| rig.joint(*joint).is_some());
            let found = known.or_else(|| by_label.get(socket.label.as_str()).copied());
            if found.is_some() {
                socket.joint = found;
            } else {
                let similar = if compared < MOST_COMPARED { Some(by_label.keys()) } else { None };
                compared += by_label.len();
                left_out.push((socket.clone(), socket.no_joint(similar.into_iter().flatten().copied())));
            }
            found.is_some()
        });
        left_out
    }

    fn no_joint<'a>(&self, labels: impl Iterator<Item = &'a str>) -> SocketError {
        let nearest = did_you_mean(&self.label, labels);
        SocketError::NoJoint { name: self.name.clone(), label: self.label.clone(), nearest }
    }

    /// The socket with that name, with its joint.
    ///
    /// # Errors
    /// A name that none has, and a socket without its joint.
    pub fn find<'a>(name: &str, among: impl Iterator<Item = &'a Self> + Clone, rig: &Rig) -> Result<Self, SocketError> {
        let found = among.clone().find(|socket| socket.name == name);
        let socket = found.ok_or_else(|| {
            let known: Vec<&str> = among.map(|socket| socket.name.as_str()).collect();
            SocketError::Unknown { name: name.to_owned(), nearest: did_you_mean(name, known) }
        })?;
        socket.in_rig(rig)
    }
}
