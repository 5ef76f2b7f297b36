//! The hand on the mouse: each of its events is in a frame of the window before the next one comes, however long frames take.

use std::{thread::sleep, time::Duration};

use super::{Hands, PATIENCE};

impl Hands<'_> {
    /// Moves the pointer, and waits until the window has drawn a frame with the pointer there.
    pub(super) fn point(&self, at: [f32; 2]) {
        let at = at.map(f32::round);
        self.xdotool(&["mousemove", &at[0].to_string(), &at[1].to_string()]);
        // No event tells of a pointer that has not moved.
        self.within(PATIENCE / 12, |report| report.pointer == Some(at));
    }

    /// Presses or releases the button of the mouse, and waits until the window has drawn a frame since then.
    pub(super) fn hold(&self, is_held: bool) {
        self.xdotool(&[if is_held { "mousedown" } else { "mouseup" }, "1"]);
        self.within(PATIENCE / 12, |report| report.pressed == is_held);
    }

    /// Lets the window draw some frames, however long they take: the pointer moves a pixel and back.
    pub(super) fn frames(&self) {
        let [x, y] = self.report().and_then(|report| report.pointer).unwrap_or([640.0, 300.0]);
        for step in [1.0, 0.0, 1.0, 0.0] {
            self.point([x + step, y]);
        }
    }

    /// Drags along a line: events of the mouse are in as many frames as a hand needs.
    pub(super) fn drag(&self, line: &[[f32; 2]]) {
        self.count("drag".to_owned());
        let place = |at: [f32; 2]| [at[0].round().to_string(), at[1].round().to_string()];
        self.point(line[0]);
        sleep(Duration::from_millis(200));
        self.hold(true);
        for w in line.windows(2) {
            for step in 1..=6 {
                let t = step as f32 / 6.0;
                let [x, y] = place([w[0][0] + (w[1][0] - w[0][0]) * t, w[0][1] + (w[1][1] - w[0][1]) * t]);
                self.xdotool(&["mousemove", &x, &y]);
            }
        }
        if let Some(end) = line.last() {
            self.point(*end);
        }
        sleep(Duration::from_millis(200));
        self.hold(false);
    }

    /// Clicks once.
    pub(super) fn click(&self, at: [f32; 2]) {
        self.count("click".to_owned());
        self.point(at);
        sleep(Duration::from_millis(300));
        // Both events at once: a press that lasts is no click.
        self.xdotool(&["click", "1"]);
    }
}
