//! Reduction of cubic tracks, and of tracks of several kinds: fewer keys, between which the curve is as it was.

use bevy::math::{Quat, Vec3};
use rigsmith::rig::{
    animation::{Ease, Key, Property, Track},
    operations::{KeyOperation, KeyTolerance},
};

use super::{
    BASE, animated,
    keys::{keys, track},
    target,
};

/// Keys a second of the tracks.
const RATE: u16 = 60;
/// Moments of four seconds at that rate.
fn moments() -> impl Iterator<Item = f32> {
    (0..=4 * RATE).map(|frame| f32::from(frame) / f32::from(RATE))
}

fn cubic(time: f32, value: [f32; 4], tangent: [f32; 4]) -> Key {
    Key { time, value, ease: Ease::Cubic { arrive: tangent, leave: tangent } }
}

/// Sixty cubic keys a second of a place that swings.
fn swinging() -> Vec<Key> {
    let key = |time: f32| {
        let (sine, cosine) = (2.0 * time).sin_cos();
        cubic(time, [sine, 0.5 * cosine, 0.0, 0.0], [2.0 * cosine, -sine, 0.0, 0.0])
    };
    moments().map(key).collect()
}

/// Sixty cubic keys a second of a turn that swings.
fn turning() -> Vec<Key> {
    let axis = Vec3::new(1.0, 2.0, -1.0).normalize();
    let key = |time: f32| {
        let (angle, speed) = (0.6 * (2.0 * time).sin(), 1.2 * (2.0 * time).cos());
        let (sine, cosine) = (0.5 * angle).sin_cos();
        let slope = axis * (cosine * 0.5 * speed);
        let tangent = [slope.x, slope.y, slope.z, -sine * 0.5 * speed];
        cubic(time, Quat::from_axis_angle(axis, angle).to_array(), tangent)
    };
    moments().map(key).collect()
}

/// Largest difference between two tracks at times between their keys, too: degrees for rotations.
fn off(property: &Property, a: &[Key], b: &[Key]) -> f32 {
    let tracks = [a, b].map(|keys| Track { keys: keys.to_vec() });
    let difference = |step: u16| {
        let [a, b] = [&tracks[0], &tracks[1]].map(|track| track.sample(property, f32::from(step) / 1000.0).unwrap());
        let (a, b) = (Quat::from_array(a), Quat::from_array(b));
        let chord = (a - b).length();
        if *property == Property::Rotation { 4.0 * (0.5 * chord).asin().to_degrees() } else { chord }
    };
    (0..=4000).map(difference).fold(0.0, f32::max)
}

#[test]
fn dense_cubic_tracks_lose_most_of_their_keys() {
    let tolerance = KeyTolerance { distance: 1e-3, angle: 0.1, ..KeyTolerance::default() };
    for (property, list, most) in
        [(Property::Translation, swinging(), tolerance.distance), (Property::Rotation, turning(), tolerance.angle)]
    {
        let mut rig = animated();
        let target = target(rig.walk().next().unwrap().data.uid, property.clone());
        keys(&mut rig, BASE, KeyOperation::Set(vec![(target.clone(), list.clone())]));
        assert_eq!(track(&rig, 0, &target), list, "{property}");
        keys(&mut rig, BASE, KeyOperation::Reduce { targets: vec![target.clone()], tolerance });
        let left = track(&rig, 0, &target);
        assert!((4..=24).contains(&left.len()), "{property}: {} of {} keys", left.len(), list.len());
        // Keys that stay are as they were, with their tangents.
        assert!(left.iter().all(|key| list.contains(key)), "{property}");
        assert_eq!((left.first(), left.last()), (list.first(), list.last()), "{property}");
        let off = off(&property, left, &list);
        assert!(off <= 1.02 * most, "{property}: {off} of {most}");
    }
}

#[test]
fn curves_between_the_keys_count() {
    let tolerance = KeyTolerance::default();
    let times = |keys: &[Key]| -> Vec<f32> {
        let kept = tolerance.reduced(&Track { keys: keys.to_vec() }, &Property::Translation);
        kept.iter().map(|key| key.time).collect()
    };
    let key = |time: f32, value: f32, tangent: f32| cubic(time, [value, 0.0, 0.0, 0.0], [tangent, 0.0, 0.0, 0.0]);
    // Keys of one value, between which the curve swings.
    assert_eq!(times(&[key(0.0, 0.0, 0.0), key(1.0, 0.0, 1.0), key(2.0, 0.0, 0.0)]), [0.0, 1.0, 2.0]);
    // A curve that swings by less than the tolerance is a constant.
    assert_eq!(times(&[key(0.0, 0.0, 0.0), key(1.0, 0.0, 1e-4), key(2.0, 0.0, 0.0)]), [0.0]);
    // A key that lies on the curve, with its slope, is not needed.
    let ends = [key(0.0, 0.0, 3.0), key(2.0, 1.0, -1.0)];
    let middle = Track { keys: ends.to_vec() }.sample(&Property::Translation, 1.0).unwrap()[0];
    let slope = 1.5 * 0.5 - 0.25 * (3.0 - 1.0);
    assert_eq!(times(&[ends[0], key(1.0, middle, slope), ends[1]]), [0.0, 2.0]);
    // Another slope bends the curve on both sides.
    assert_eq!(times(&[ends[0], key(1.0, middle, slope + 0.1), ends[1]]), [0.0, 1.0, 2.0]);
}

#[test]
fn keys_at_which_the_interpolation_changes_stay() {
    let tolerance = KeyTolerance::default();
    let plain = |time: f32, value: f32, ease: Ease| Key { ease, ..Key::number(time, value) };
    let level = Ease::Cubic { arrive: [0.0; 4], leave: [0.0; 4] };
    // A line of three keys, a curve that is level at both ends, and steps of one value.
    let track = Track {
        keys: vec![
            plain(0.0, 0.0, Ease::Linear),
            plain(0.5, 0.5, Ease::Linear),
            plain(1.0, 1.0, level),
            plain(2.0, 3.0, Ease::Stepped),
            plain(3.0, 3.0, Ease::Stepped),
            plain(4.0, 0.0, Ease::Stepped),
        ],
    };
    let kept = tolerance.reduced(&track, &Property::Attribute("dial".into()));
    let times: Vec<f32> = kept.iter().map(|key| key.time).collect();
    assert_eq!(times, [0.0, 1.0, 2.0, 4.0]);
}
