//! Remote control of the window.

use std::path::PathBuf;

use super::report::Failure;
use crate::remote::{RemotePlugin, RemoteSettings, TOKEN_VARIABLE};

/// Takes the port, and says on standard error where to call and with which token.
pub(super) fn bind(port: u16, mut folders: Vec<PathBuf>) -> Result<RemotePlugin, Failure> {
    if folders.is_empty() {
        folders.push(PathBuf::from("."));
    }
    let settings = RemoteSettings { port, folders, ..RemoteSettings::default() };
    let remote = RemotePlugin::bind(settings).map_err(|error| Failure::Usage(error.to_string()))?;
    eprint!("remote control on http://{}; ", remote.address());
    if remote.has_random_token() {
        eprintln!("its token, until the window is closed: {}", remote.token());
    } else {
        eprintln!("its token is that of {TOKEN_VARIABLE}");
    }
    Ok(remote)
}
