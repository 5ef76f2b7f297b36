//! The axis of time: seconds of a clip as pixels from left to right.

use bevy_egui::egui::Rangef;

/// Shortest span of time that is shown, in seconds.
const SHORTEST: f32 = 0.05;
/// Longest span of time that is shown, in seconds.
const LONGEST: f32 = 2e5;

/// Seconds as pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeAxis {
    /// First and last visible second.
    pub span: [f32; 2],
    /// Pixels of the two.
    pub x: Rangef,
}

impl TimeAxis {
    /// Pixels of a second.
    pub fn scale(&self) -> f32 {
        self.x.span() / (self.span[1] - self.span[0]).max(SHORTEST)
    }

    /// Pixel of a time.
    pub fn at(&self, time: f32) -> f32 {
        self.x.min + (time - self.span[0]) * self.scale()
    }

    /// Time of a pixel.
    pub fn time(&self, x: f32) -> f32 {
        self.span[0] + (x - self.x.min) / self.scale()
    }

    /// Span in which as many seconds are seen, moved by pixels.
    pub fn panned(&self, pixels: f32) -> [f32; 2] {
        self.span.map(|time| time - pixels / self.scale())
    }

    /// Span in which time is `factor` times as wide; the time of a pixel stays there.
    pub fn zoomed(&self, factor: f32, x: f32) -> [f32; 2] {
        let (fixed, length) = (self.time(x), self.span[1] - self.span[0]);
        let next = (length / factor.max(1e-3)).clamp(SHORTEST, LONGEST);
        let start = fixed - (fixed - self.span[0]) * next / length;
        [start, start + next]
    }

    /// Frames between two lines of the ruler that are far enough apart for their numbers.
    pub fn step(&self, frame_rate: f32) -> i64 {
        let frame = self.scale() / frame_rate;
        let steps = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 1_000_000];
        steps.into_iter().find(|step| *step as f32 * frame >= 46.0).unwrap_or(10_000_000)
    }
}
