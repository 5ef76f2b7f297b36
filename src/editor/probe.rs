//! Probe for a display, before Bevy needs one and would panic without it.

/// Reason why there is no display.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DisplayError {
    /// The environment names no display.
    #[error("DISPLAY is not set")]
    NotSet,
    /// No display answers under the name in the environment.
    #[error("nothing answers at DISPLAY={0}")]
    NoAnswer(String),
}

/// Probes for a display to open a window on.
///
/// # Errors
/// See [`DisplayError`].
pub fn display() -> Result<(), DisplayError> {
    if cfg!(not(all(unix, not(target_os = "macos")))) {
        return Ok(());
    }
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    if cfg!(feature = "wayland") && set("WAYLAND_DISPLAY").is_some() {
        return Ok(());
    }
    let Some(name) = set("DISPLAY") else { return Err(DisplayError::NotSet) };
    if answers(&name) { Ok(()) } else { Err(DisplayError::NoAnswer(name)) }
}

/// Returns `true` if an X display of that name accepts connections.
#[cfg(unix)]
fn answers(name: &str) -> bool {
    use std::{net::TcpStream, os::unix::net::UnixStream, path::Path};
    let Some((host, rest)) = name.rsplit_once(':') else { return false };
    let Ok(number) = rest.split('.').next().unwrap_or_default().parse::<u16>() else { return false };
    if host.is_empty() || host == "unix" {
        let path = format!("/tmp/.X11-unix/X{number}");
        // Without the socket file a server may still listen under the abstract name; then the window system decides.
        return !Path::new(&path).exists() && abstract_socket(&path) || UnixStream::connect(path).is_ok();
    }
    TcpStream::connect((host, 6000 + number)).is_ok()
}

#[cfg(target_os = "linux")]
fn abstract_socket(path: &str) -> bool {
    use std::os::{
        linux::net::SocketAddrExt,
        unix::net::{SocketAddr, UnixStream},
    };
    SocketAddr::from_abstract_name(path).and_then(|address| UnixStream::connect_addr(&address)).is_ok()
}

#[cfg(all(unix, not(target_os = "linux")))]
fn abstract_socket(_path: &str) -> bool {
    false
}

#[cfg(not(unix))]
fn answers(_name: &str) -> bool {
    true
}
