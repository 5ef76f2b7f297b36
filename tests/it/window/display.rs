//! A display without a screen, and pictures of it.

use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
};

use image::{Rgb, RgbImage};
use tempfile::TempDir;

/// A display of its own, gone with the test.
pub(super) struct Display {
    server: Child,
    pub(super) name: String,
    /// Folder of the file in which the server keeps the screen.
    screen: TempDir,
}

impl Display {
    /// Starts a display with a number that the server itself finds free: tests start theirs at the same time.
    pub(super) fn start() -> Option<Self> {
        let screen = tempfile::tempdir().ok()?;
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x720x24", "-nolisten", "tcp", "-fbdir"])
            .arg(screen.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut number = String::new();
        BufReader::new(server.stdout.take()?).read_line(&mut number).ok()?;
        let name = format!(":{}", number.trim());
        (name.len() > 1).then_some(Self { server, name, screen })
    }

    /// The screen as it is, from the server's file: numbers of four bytes about the picture, a table of colours, and rows of
    /// pixels (XWD).
    pub(super) fn picture(&self) -> RgbImage {
        let bytes = std::fs::read(self.screen.path().join("Xvfb_screen0")).unwrap();
        let number = |place: usize| u32::from_be_bytes(bytes[4 * place..4 * place + 4].try_into().unwrap());
        let (head, width, height, row, colors) = (number(0), number(4), number(5), number(12), number(19));
        let pixels = &bytes[(head + 12 * colors) as usize..];
        RgbImage::from_fn(width, height, |x, y| {
            let at = (y * row + 4 * x) as usize;
            Rgb([pixels[at + 2], pixels[at + 1], pixels[at]])
        })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
