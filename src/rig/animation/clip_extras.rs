//! Facts of a clip that channels of a mesh file cannot hold, in the `extras` of the file's animation.
//!
//! ```json
//! "extras": { "rigsmith": { "frame_rate": 24.0, "looped": true, "markers": [{ "time": 0.5, "name": "left" }] } }
//! ```
//!
//! Times are seconds of the file. Other programs pass over extras, and extras of other programs stay as they are.

use serde_json::{Map, Value, json};

use super::{Marker, RigClip};

/// Member of the extras that holds the facts.
const MEMBER: &str = "rigsmith";
/// Frame rates that are believed.
const RATES: std::ops::RangeInclusive<f64> = 0.01..=10_000.0;
/// Most markers that are read from one animation.
pub const MAX_MARKERS: usize = 10_000;

/// Facts of a clip in the extras of an animation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ClipExtras {
    /// Frames a second; `None` if the file does not say it.
    pub frame_rate: Option<f32>,
    /// True if the clip is played over and over.
    pub looped: bool,
    /// Named moments, by rising time, in seconds of the file.
    pub markers: Vec<Marker>,
}

impl ClipExtras {
    /// Facts of a clip whose file begins with it, at a frame rate.
    pub fn of(clip: &RigClip, rate: f32) -> Self {
        let marker = |marker: &Marker| Marker { time: marker.time - clip.range[0], name: marker.name.clone() };
        let markers = clip.markers.iter().map(marker).collect();
        Self { frame_rate: Some(rate), looped: clip.looped, markers }
    }

    /// Facts that the extras of an animation hold; what is damaged is left out.
    pub fn read(extras: Option<&Value>) -> Self {
        let Some(facts) = extras.and_then(|extras| extras.get(MEMBER)) else { return Self::default() };
        let rate = facts.get("frame_rate").and_then(Value::as_f64).filter(|rate| RATES.contains(rate));
        let marker = |value: &Value| {
            let time = value.get("time")?.as_f64()? as f32;
            let name = value.get("name")?.as_str()?.to_owned();
            time.is_finite().then_some(Marker { time, name })
        };
        let listed = facts.get("markers").and_then(Value::as_array);
        let mut markers: Vec<Marker> = listed.into_iter().flatten().take(MAX_MARKERS).filter_map(marker).collect();
        markers.sort_by(|a, b| a.time.total_cmp(&b.time));
        let looped = facts.get("looped").and_then(Value::as_bool).unwrap_or_default();
        Self { frame_rate: rate.map(|rate| rate as f32), looped, markers }
    }

    /// Extras with the facts.
    pub fn written(&self) -> Value {
        let mut facts = Map::new();
        if let Some(rate) = self.frame_rate {
            facts.insert("frame_rate".to_owned(), f64::from(rate).into());
        }
        facts.insert("looped".to_owned(), self.looped.into());
        if !self.markers.is_empty() {
            let marker = |marker: &Marker| json!({ "time": f64::from(marker.time), "name": marker.name });
            facts.insert("markers".to_owned(), self.markers.iter().map(marker).collect());
        }
        Value::Object(Map::from_iter([(MEMBER.to_owned(), Value::Object(facts))]))
    }
}

/// Extras of a clip together with those that its animation has in a file: what both have is that of the clip.
pub fn joined_extras(own: Option<Value>, of_file: Option<Value>) -> Option<Value> {
    match (own, of_file) {
        (Some(Value::Object(own)), Some(Value::Object(mut all))) => {
            all.extend(own);
            Some(Value::Object(all))
        }
        (own, of_file) => own.or(of_file),
    }
}
