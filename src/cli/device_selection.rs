//! Mesa's selection of a graphics card, which asks the display for one even where there is no display.

/// Restarts the command without Mesa's device selection if there is no display for it to ask.
///
/// The selection tries Wayland in every program that uses Vulkan, and where there is none an error is printed for each
/// try. Switched off it is by an environment variable, which a running process cannot set for itself without `unsafe`
/// code; so the process is replaced by one that has it. Where that fails, the command goes on as it is.
#[cfg(unix)]
pub(super) fn restart_without() {
    use std::{os::unix::process::CommandExt, process::Command};

    const SWITCH: &str = "NODEVICE_SELECT";
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if ["DISPLAY", "WAYLAND_DISPLAY", "XDG_RUNTIME_DIR", SWITCH].into_iter().any(is_set) {
        return;
    }
    let mut arguments = std::env::args_os();
    if let (Some(name), Ok(program)) = (arguments.next(), std::env::current_exe()) {
        let _ = Command::new(program).arg0(name).args(arguments).env(SWITCH, "1").exec();
    }
}

/// Does nothing on systems other than Unix, where Mesa does not select devices.
#[cfg(not(unix))]
pub(super) fn restart_without() {}
