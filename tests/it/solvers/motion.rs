//! Springs and driven keys.

use bevy::math::{Quat, Vec3};
use rigsmith::solve::{
    curve::{Curve, CurveError, CurveKey, Extrapolation, Interpolation},
    spring::{PointSpring, RotationSpring, Spring},
};

use super::{HARD, angle, is_unit};

/// A target that moves evenly between the times that all frame rates share.
fn target(time: f32) -> Vec3 {
    let knots = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 2.0, 0.0), Vec3::Z, Vec3::Z, Vec3::new(-1.0, 0.5, 0.0)];
    let at = (time * 4.0).clamp(0.0, 4.999);
    let i = at as usize;
    knots[i].lerp(knots[(i + 1).min(5)], at - i as f32)
}

fn turned(time: f32) -> Quat {
    Quat::from_scaled_axis(target(time) * 0.8)
}

#[test]
fn springs_move_alike_at_every_frame_rate() {
    let springs = [(0.5, 0.2), (2.0, 0.0), (3.0, 0.3), (4.0, 1.0), (2.0, 3.0), (40.0, 0.5)];
    for (frequency, damping) in springs {
        let spring = Spring { frequency, damping };
        let run = |rate: u32| -> Vec<(Vec3, Quat)> {
            let mut point = PointSpring::at(target(0.0));
            let mut rotation = RotationSpring::at(turned(0.0));
            let mut seen = Vec::new();
            for frame in 1..=rate * 5 / 4 {
                let time = frame as f32 / rate as f32;
                let dt = 1.0 / rate as f32;
                let now =
                    (spring.point(&mut point, target(time), dt), spring.rotation(&mut rotation, turned(time), dt));
                if frame % (rate / 4) == 0 {
                    seen.push(now);
                }
            }
            seen
        };
        // 60 and 120 need not meet in quarters of 30 frames, so all are multiples of four a second.
        let slow = run(32);
        assert_eq!(slow.len(), 5);
        for rate in [60, 120, 144, 240, 1000] {
            for (a, b) in slow.iter().zip(run(rate)) {
                assert!(a.0.distance(b.0) < 2e-2, "{spring:?} at {rate}: {} and {}", a.0, b.0);
                assert!(angle(a.1, b.1) < 3e-2, "{spring:?} at {rate}: {} and {}", a.1, b.1);
            }
        }
        // Whole numbers of steps a frame: the same up to rounding.
        let slow = run(60);
        for rate in [120, 240] {
            for (a, b) in slow.iter().zip(run(rate)) {
                assert!(a.0.distance(b.0) < 1e-3, "{spring:?} at {rate}: {} and {}", a.0, b.0);
                assert!(angle(a.1, b.1) < 1e-2, "{spring:?} at {rate}: {} and {}", a.1, b.1);
            }
        }
    }
}

#[test]
fn springs_swing_as_physics_says() {
    // Let go at 1 without damping: a cosine.
    let spring = Spring { frequency: 1.5, damping: 0.0 };
    let mut state = PointSpring { position: Vec3::X, ..PointSpring::at(Vec3::ZERO) };
    for frame in 1..=240 {
        let x = spring.point(&mut state, Vec3::ZERO, 1.0 / 100.0).x;
        let wanted = (std::f32::consts::TAU * 1.5 * frame as f32 / 100.0).cos();
        assert!((x - wanted).abs() < 1e-3, "frame {frame}: {x} for {wanted}");
    }
    // Critical and over-damped ones do not overshoot, and arrive.
    for damping in [1.0, 1.0005, 1.01, 2.0] {
        let spring = Spring { frequency: 3.0, damping };
        let mut state = PointSpring { position: Vec3::X, ..PointSpring::at(Vec3::ZERO) };
        for _ in 0..300 {
            assert!(spring.point(&mut state, Vec3::ZERO, 1.0 / 60.0).x >= -1e-6);
        }
        assert!(state.position.x < 1e-3);
    }
    // Without frequency it is tied to its target.
    let mut state = PointSpring::at(Vec3::ZERO);
    assert_eq!(Spring { frequency: 0.0, damping: 0.3 }.point(&mut state, Vec3::ONE, 0.1), Vec3::ONE);
}

#[test]
fn springs_are_stable_and_answer_anything_with_numbers() {
    for frequency in HARD.into_iter().chain([100.0, 1e4, 1e8, -1.0]) {
        for damping in HARD {
            for dt in HARD.into_iter().chain([1.0 / 60.0, -1.0]) {
                let spring = Spring { frequency, damping };
                let mut point = PointSpring { position: Vec3::X, ..PointSpring::at(Vec3::ZERO) };
                let mut rotation = RotationSpring::at(Quat::IDENTITY);
                for frame in 0..12 {
                    let seen = spring.point(&mut point, Vec3::Y * (frame % 2) as f32, dt);
                    assert!(seen.length() < 4.0, "{spring:?}, {dt}: {seen}");
                    let turn = Quat::from_rotation_x((frame % 3) as f32);
                    assert!(is_unit(spring.rotation(&mut rotation, turn, dt)), "{spring:?}, {dt}: {rotation:?}");
                }
                for value in HARD {
                    let broken = Quat::from_xyzw(value, 0.0, 0.0, value);
                    assert!(spring.point(&mut point, Vec3::splat(value), dt).is_finite() || value > 1e30);
                    assert!(is_unit(spring.rotation(&mut rotation, broken, dt)));
                }
                let mut lost = PointSpring { velocity: Vec3::NAN, ..PointSpring::at(Vec3::ZERO) };
                assert_eq!(spring.point(&mut lost, Vec3::ONE, 0.01), Vec3::ONE);
            }
        }
    }
}

fn key(x: f32, y: f32, interpolation: Interpolation) -> CurveKey {
    CurveKey { interpolation, ..CurveKey::new(x, y) }
}

const HOLD: [Extrapolation; 2] = [Extrapolation::Hold; 2];

#[test]
fn curves_pass_their_keys_as_told() {
    use Interpolation::{Constant, Linear, Smooth};
    let keys = [key(0.0, 1.0, Constant), key(1.0, 3.0, Linear), key(2.0, 5.0, Smooth), key(4.0, 5.5, Smooth)];
    let curve = Curve::new(&keys, [Extrapolation::Linear, Extrapolation::Linear]).unwrap();
    let cases = [(-5.0, 1.0), (0.0, 1.0), (0.99, 1.0), (1.0, 3.0), (1.5, 4.0), (2.0, 5.0), (4.0, 5.5), (9.0, 5.5)];
    for (x, y) in cases {
        assert!((curve.evaluate(x) - y).abs() < 1e-5, "{x}: {} for {y}", curve.evaluate(x));
    }
    // Two smooth keys ease in and out.
    let ease = Curve::new(&[CurveKey::new(0.0, 0.0), CurveKey::new(2.0, 1.0)], HOLD).unwrap();
    for (x, y) in [(0.0, 0.0), (0.5, 0.15625), (1.0, 0.5), (1.5, 0.84375), (2.0, 1.0), (3.0, 1.0)] {
        assert!((ease.evaluate(x) - y).abs() < 1e-5, "{x}");
    }
    // Given slopes count, inside and beyond.
    let steep = CurveKey { slope_in: Some(2.0), slope_out: Some(2.0), ..CurveKey::new(0.0, 0.0) };
    let slopes = Curve::new(&[steep, CurveKey { x: 1.0, y: 2.0, ..steep }], [Extrapolation::Linear; 2]).unwrap();
    for x in [-1.0, 0.0, 0.25, 0.5, 1.0, 3.0] {
        assert!((slopes.evaluate(x) - 2.0 * x).abs() < 1e-5, "{x}");
    }
    let one = Curve::new(&[CurveKey::new(1.0, 7.0)], HOLD).unwrap();
    assert_eq!([one.evaluate(0.0), one.evaluate(1.0), one.evaluate(f32::NAN)], [7.0; 3]);
}

#[test]
fn smooth_curves_do_not_overshoot() {
    let mut random = super::Random(21);
    for _ in 0..300 {
        let mut x = 0.0;
        let keys: Vec<CurveKey> = (0..6)
            .map(|_| {
                x += random.between(0.01, 2.0);
                CurveKey::new(x, random.between(-3.0, 3.0))
            })
            .collect();
        let curve = Curve::new(&keys, HOLD).unwrap();
        for pair in keys.windows(2) {
            assert!((curve.evaluate(pair[0].x) - pair[0].y).abs() < 1e-4);
            for i in 0..=20 {
                let y = curve.evaluate(pair[0].x + (pair[1].x - pair[0].x) * i as f32 / 20.0);
                let (low, high) = (pair[0].y.min(pair[1].y), pair[0].y.max(pair[1].y));
                assert!(y >= low - 1e-3 && y <= high + 1e-3, "{y} outside of {low} to {high}");
            }
        }
    }
}

#[test]
fn bad_keys_are_told() {
    let good = CurveKey::new(1.0, 2.0);
    assert_eq!(Curve::new(&[], HOLD), Err(CurveError::Empty));
    for bad in [f32::NAN, f32::INFINITY] {
        for key in [CurveKey { x: bad, ..good }, CurveKey { y: bad, ..good }, CurveKey { slope_in: Some(bad), ..good }]
        {
            assert_eq!(Curve::new(&[CurveKey::new(0.0, 0.0), key], HOLD), Err(CurveError::NotFinite { key: 2 }));
        }
    }
    let error = Curve::new(&[good, good], HOLD).unwrap_err();
    assert_eq!(error, CurveError::Order { key: 2, x: 1.0, before: 1.0 });
    assert!(error.to_string().contains("key 2") && error.to_string().contains("sort the keys"), "{error}");
    let far =
        Curve::new(&[CurveKey::new(f32::MIN, f32::MAX), CurveKey::new(f32::MAX, f32::MIN)], [Extrapolation::Linear; 2]);
    let far = far.unwrap();
    for x in HARD {
        assert!(far.evaluate(x).is_finite() && far.evaluate(-x).is_finite(), "{x}");
    }
}
