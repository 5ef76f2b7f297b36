//! Edits of the header of a rig's template.

use std::collections::HashSet;

use ron::value::RawValue;

use super::EditError;
use crate::rig::{Rig, RigAbout, RigEdit, degrees, format::source::ron_options, part::OptionError};

/// Fault of a socket or an option, with which no template could be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HeaderFault {
    /// Name of a socket that cannot be told from that of a part's.
    #[error("a socket has a name without points, and \"{0}\" is none; type another")]
    SocketName(String),
    /// Two sockets with one name.
    #[error("two sockets are called \"{0}\"; give the second another name")]
    SocketTwice(String),
    /// Place of a socket with numbers that are not finite.
    #[error("the place of the socket \"{0}\" is not finite; correct the numbers")]
    SocketPlace(String),
    /// Two options with one name.
    #[error("two options are called \"{0}\"; give the second another name")]
    OptionTwice(String),
    /// Default of an option that is no value at all.
    #[error("the default of the option \"{0}\" is no value as in a file: {1}; correct it")]
    OptionDefault(String, String),
    /// Default that the form of its option does not take.
    #[error("the default does not fit: {0}; correct it, or choose another form")]
    OptionForm(OptionError),
}

impl RigAbout {
    /// Check of sockets and options.
    ///
    /// # Errors
    /// A socket or an option with which no template could be read.
    pub fn check(&self) -> Result<(), HeaderFault> {
        let mut names = HashSet::with_capacity(self.sockets.len());
        for socket in &self.sockets {
            if socket.name.is_empty() || socket.name.contains('.') {
                return Err(HeaderFault::SocketName(socket.name.clone()));
            }
            if !names.insert(socket.name.as_str()) {
                return Err(HeaderFault::SocketTwice(socket.name.clone()));
            }
            if !socket.translation.is_finite() || !degrees(socket.rotation).is_finite() {
                return Err(HeaderFault::SocketPlace(socket.name.clone()));
            }
        }
        names.clear();
        for option in &self.options {
            if !names.insert(option.name.as_str()) {
                return Err(HeaderFault::OptionTwice(option.name.clone()));
            }
            let read: Result<Box<RawValue>, _> = ron_options().from_str(&option.default);
            if let Err(error) = read {
                return Err(HeaderFault::OptionDefault(option.name.clone(), error.code.to_string()));
            }
            option.check(&option.default).map_err(HeaderFault::OptionForm)?;
        }
        Ok(())
    }
}

impl Rig {
    pub(super) fn set_about(&mut self, about: &RigAbout) -> Result<RigEdit, EditError> {
        about.check()?;
        Ok(RigEdit::SetAbout(Box::new(std::mem::replace(&mut self.about, about.clone()))))
    }
}
