//! The `rigsmith` command.

use std::{path::PathBuf, process::ExitCode};

use rigsmith::cli::WindowError;

fn main() -> ExitCode {
    rigsmith::cli::main(&open_window)
}

/// Opens the editor.
#[cfg(feature = "editor")]
fn open_window(file: Option<PathBuf>) -> Result<ExitCode, WindowError> {
    use bevy::app::AppExit;
    use rigsmith::editor::app::{EditorOptions, run};

    match run(EditorOptions { file }) {
        Ok(AppExit::Success) => Ok(ExitCode::SUCCESS),
        Ok(AppExit::Error(code)) => Ok(ExitCode::from(code.get())),
        Err(error) => Err(WindowError::Window(error.into())),
    }
}

/// Reports that this build has no editor.
#[cfg(not(feature = "editor"))]
fn open_window(_file: Option<PathBuf>) -> Result<ExitCode, WindowError> {
    Err(WindowError::NoEditor)
}
