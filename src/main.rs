//! The `rigsmith` command.

use std::{path::PathBuf, process::ExitCode};

fn main() -> ExitCode {
    rigsmith::cli::main(&open_window)
}

/// Opens the editor.
#[cfg(feature = "editor")]
fn open_window(file: Option<PathBuf>) -> Result<ExitCode, String> {
    use bevy::app::AppExit;
    use rigsmith::editor::app::{EditorOptions, run};

    match run(EditorOptions { file }) {
        Ok(AppExit::Success) => Ok(ExitCode::SUCCESS),
        Ok(AppExit::Error(code)) => Ok(ExitCode::from(code.get())),
        Err(reason) => Err(reason.to_string()),
    }
}

/// Reports that this build has no editor.
#[cfg(not(feature = "editor"))]
fn open_window(_file: Option<PathBuf>) -> Result<ExitCode, String> {
    Err("this build has no editor; build with the feature `editor`".to_owned())
}
