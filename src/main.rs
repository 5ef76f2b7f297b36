//! The `rigsmith` command.

use std::process::ExitCode;

use rigsmith::cli::{WindowError, WindowRequest};

fn main() -> ExitCode {
    rigsmith::cli::main(&open_window)
}

/// Opens the editor.
#[cfg(feature = "editor")]
fn open_window(request: WindowRequest) -> Result<ExitCode, WindowError> {
    use bevy::app::AppExit;
    use rigsmith::editor::app::{EditorOptions, run};

    let options = EditorOptions {
        file: request.file,
        limits: request.limits,
        #[cfg(feature = "remote")]
        remote: request.remote,
    };
    match run(options) {
        Ok(AppExit::Success) => Ok(ExitCode::SUCCESS),
        Ok(AppExit::Error(code)) => Ok(ExitCode::from(code.get())),
        Err(error) => Err(WindowError::Window(error.into())),
    }
}

/// Reports that this build has no editor.
#[cfg(not(feature = "editor"))]
fn open_window(_request: WindowRequest) -> Result<ExitCode, WindowError> {
    Err(WindowError::NoEditor)
}
