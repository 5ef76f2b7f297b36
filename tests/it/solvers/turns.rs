//! Aim, blends, twist, stretch and limits.

use bevy::{
    math::{EulerRot, Quat, Vec3},
    transform::components::Transform,
};
use rigsmith::{
    mesh::model::Trs,
    solve::{
        aim::{Aim, Up},
        limit::{Bounds, JointLimit},
        rotate::{self, EulerOrder},
        stretch::Stretch,
        twist::{swing_twist, twist_angle, twist_share, twist_step, unwrap_angle},
        weights::{blend, blend_points, blend_rotations, inverse, mix, multiply, relative},
    },
};

use super::{HARD, Random, angle, is_unit};

#[test]
fn aim_points_its_axis_and_keeps_up() {
    let mut random = Random(11);
    for _ in 0..500 {
        let aim = Aim { axis: random.direction() * 3.0, up_axis: random.direction() };
        let (position, target, current) = (random.point(), random.point() * 4.0, random.rotation());
        let up = random.direction();
        let rotation = aim.solve(position, target, Up::Vector(up * 0.1), current);
        let to = (target - position).normalize();
        assert!((rotation * aim.axis.normalize()).dot(to) > 0.99999);
        // The up axis and the up direction lie in one plane with the aim, on one side.
        let flat = |v: Vec3| (v - to * v.dot(to)).normalize();
        if to.cross(up).length() > 0.05 && aim.axis.normalize().cross(aim.up_axis).length() > 0.05 {
            assert!(flat(rotation * aim.up_axis).dot(flat(up)) > 0.999);
        }
        let object = aim.solve(position, target, Up::Point(position + up), current);
        assert!(angle(rotation, object) < 1e-3);
        // Kept up: aiming where it aims already changes nothing.
        let kept = aim.solve(position, position + current * aim.axis, Up::Keep, current);
        assert!(angle(kept, current) < 1e-3);
        assert_eq!(aim.solve(position, position, Up::Keep, current), rotate::unit(current));
    }
}

#[test]
fn aim_answers_anything_with_numbers() {
    let mut random = Random(12);
    for case in 0..5000 {
        let mut vector = || {
            let mut one = || if random.unit() < 0.5 { 0.0 } else { HARD[(random.unit() * 8.999) as usize] };
            Vec3::new(one(), one(), one())
        };
        let aim = Aim { axis: vector(), up_axis: vector() };
        let up = [Up::Keep, Up::Vector(vector()), Up::Point(vector())][case % 3];
        let rotation = aim.solve(vector(), vector(), up, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0));
        assert!(is_unit(rotation), "{aim:?}, {up:?}: {rotation}");
    }
    // In line with up, both ways.
    for target in [Vec3::Y, Vec3::NEG_Y] {
        let rotation = Aim::default().solve(Vec3::ZERO, target, Up::Vector(Vec3::Y), Quat::IDENTITY);
        assert!((rotation * Vec3::Y).dot(target) > 0.9999);
    }
}

#[test]
fn the_shortest_turn_is_right_near_half_a_turn() {
    let mut random = Random(13);
    for _ in 0..500 {
        let from = random.direction();
        for off in [0.0, 1e-8, 1e-6, 1e-4, 1e-2, 0.14, 0.142, 0.2, 1.0] {
            let axis = rotate::perpendicular_or_any(from, &[random.direction()]);
            let to = rotate::about(axis, std::f32::consts::PI - off) * from;
            let turn = rotate::arc(from, to, axis);
            assert!((turn * from).distance(to) < 2e-6, "{off}: {}", (turn * from).distance(to));
            if off >= 1e-4 {
                assert!((angle(turn, Quat::IDENTITY) - (std::f32::consts::PI - off)).abs() < 2e-3);
            }
        }
    }
}

#[test]
fn blends_are_weighted_and_need_weight() {
    let [a, b] = [Vec3::ZERO, Vec3::X * 4.0];
    assert_eq!(blend_points([(a, 3.0), (b, 1.0)]), Some(Vec3::X));
    assert_eq!(blend_points([(a, 1.0), (b, -1.0), (b, f32::NAN)]), Some(a));
    assert_eq!(blend_points([(a, 0.0)]), None);
    assert_eq!(blend_points([]), None);
    assert_eq!(blend_rotations([]), None);
    let turn = |degrees: f32| Quat::from_rotation_z(degrees.to_radians());
    let half = blend_rotations([(turn(0.0), 1.0), (-turn(90.0), 1.0)]);
    assert!(half.is_some_and(|half| angle(half, turn(45.0)) < 1e-5), "{half:?}");
    let mut random = Random(14);
    for _ in 0..200 {
        // Within a quarter turn of one another: the order and the signs do not matter.
        let base = random.rotation();
        let near = |random: &mut Random| base * Quat::from_axis_angle(random.direction(), random.between(-0.7, 0.7));
        let targets: Vec<(Quat, f32)> = (0..4).map(|_| (near(&mut random), random.between(0.0, 1.0))).collect();
        let mean = blend_rotations(targets.iter().copied()).unwrap();
        let flipped = targets.iter().rev().map(|(rotation, weight)| (-*rotation, *weight));
        assert!(angle(mean, blend_rotations(flipped).unwrap()) < 1e-4);
        assert!(is_unit(mean));
    }
    // Opposite turns cancel; the first one stays.
    let cancel = [(turn(0.0), 0.0), (turn(90.0) * Quat::from_rotation_x(3.0), 1.0), (turn(180.0), f32::INFINITY)];
    assert!(blend_rotations(cancel).is_some_and(is_unit));
}

#[test]
fn a_blend_does_not_pop_when_weights_pass_over() {
    let mut random = Random(15);
    for _ in 0..50 {
        let targets: Vec<Quat> = (0..2).map(|_| random.rotation()).collect();
        let at = |t: f32| blend_rotations([(targets[0], 1.0 - t), (targets[1], t)]).unwrap();
        for i in 0..500 {
            assert!(angle(at(i as f32 / 500.0), at((i + 1) as f32 / 500.0)) < 0.1);
        }
        assert!(angle(at(1.0), targets[1]) < 1e-4);
    }
}

fn random_trs(random: &mut Random) -> Trs {
    let scale = Vec3::new(random.between(0.2, 3.0), random.between(0.2, 3.0), -random.between(0.2, 3.0));
    Trs { translation: random.point() * 3.0, rotation: random.rotation(), scale }
}

#[test]
fn transforms_multiply_as_bevy_does_and_go_back() {
    let mut random = Random(16);
    let bevy = |t: &Trs| Transform { translation: t.translation, rotation: t.rotation, scale: t.scale };
    let close = |a: &Trs, b: &Trs| {
        a.translation.distance(b.translation) < 1e-4
            && angle(a.rotation, b.rotation) < 1e-3
            && a.scale.distance(b.scale) < 1e-4
    };
    for _ in 0..300 {
        let (a, b) = (random_trs(&mut random), random_trs(&mut random));
        let product = multiply(&a, &b);
        let theirs = bevy(&a) * bevy(&b);
        assert!(product.translation.distance(theirs.translation) < 1e-5 * (1.0 + theirs.translation.length()));
        assert!(angle(product.rotation, theirs.rotation) < 1e-3 && product.scale == theirs.scale);
        assert!(close(&multiply(&a, &relative(&a, &b)), &b));
        assert!(close(&relative(&a, &multiply(&a, &b)), &b));
        assert!(close(&multiply(&a, &inverse(&a)), &Trs::IDENTITY));
        assert_eq!(mix(&a, &b, 0.0), a);
        assert_eq!(mix(&a, &b, 1.0), b);
        let half = mix(&a, &b, 0.5);
        assert!((angle(a.rotation, half.rotation) - angle(half.rotation, b.rotation)).abs() < 1e-3);
        assert_eq!(blend([(a, 0.0), (b, 0.0)]), None);
        assert!(close(&blend([(a, 0.0), (b, 2.0)]).unwrap(), &b));
    }
    let flat = Trs { scale: Vec3::new(0.0, 1.0, 2.0), ..Trs::IDENTITY };
    let back = relative(&flat, &Trs { translation: Vec3::ONE, ..Trs::IDENTITY });
    assert_eq!((back.translation, back.scale), (Vec3::new(0.0, 1.0, 0.5), Vec3::new(1.0, 1.0, 0.5)));
}

#[test]
fn twist_is_split_off_and_shared() {
    let mut random = Random(17);
    for _ in 0..500 {
        let axis = random.direction();
        let (rotation, wanted) = (random.rotation(), random.between(-3.0, 3.0));
        let (swing, twist) = swing_twist(rotation, axis * 2.0);
        assert!(angle(swing * twist, rotation) < 1e-3);
        assert!(swing.xyz().dot(axis).abs() < 1e-5, "the swing twists");
        assert!(twist.xyz().cross(axis).length() < 1e-5, "the twist swings");
        assert!((twist_angle(Quat::from_axis_angle(axis, wanted), axis) - wanted).abs() < 1e-4);
        assert!((twist_angle(-Quat::from_axis_angle(axis, wanted), axis) - wanted).abs() < 1e-4);
        let third = twist_share(Quat::from_axis_angle(axis, wanted), axis, 1.0 / 3.0);
        assert!(angle(third, Quat::from_axis_angle(axis, wanted / 3.0)) < 1e-3);
        let step = twist_step(axis, wanted, 4);
        assert!(angle(step * step * step * step, Quat::from_axis_angle(axis, wanted)) < 1e-3);
        // A swing alone has no twist.
        let swing_only = rotate::arc(axis, (axis + random.direction() * 0.9).normalize(), Vec3::ZERO);
        assert!(twist_angle(swing_only, axis).abs() < 1e-3);
    }
    // Turns are counted, both ways.
    let mut angle_now = 0.0;
    for i in 0..100 {
        let wanted = 0.3 * i as f32;
        angle_now = unwrap_angle(twist_angle(Quat::from_rotation_y(wanted), Vec3::Y), angle_now);
        assert!((angle_now - wanted).abs() < 1e-3, "{angle_now} for {wanted}");
    }
    // Half a turn about a perpendicular axis leaves the twist open.
    let (swing, twist) = swing_twist(Quat::from_rotation_x(std::f32::consts::PI), Vec3::Y);
    assert!(is_unit(swing) && angle(twist, Quat::IDENTITY) < 1e-3);
    for value in HARD {
        let q = Quat::from_xyzw(value, 0.0, value, 0.0);
        assert!(is_unit(swing_twist(q, Vec3::splat(value)).0) && twist_angle(q, Vec3::splat(value)).is_finite());
        assert!(is_unit(twist_share(q, Vec3::Y, value)) && is_unit(twist_step(Vec3::Y, value, 0)));
        assert!(unwrap_angle(value, value).is_finite());
    }
}

#[test]
fn stretch_keeps_volume_and_its_limits() {
    let stretch = Stretch::default();
    let cases = [(1.0, 1.0, 1.0, 1.0), (1.0, 4.0, 4.0, 0.5), (2.0, 0.5, 0.25, 2.0), (0.0, 5.0, 1.0, 1.0)];
    for (rest, length, along, across) in cases {
        let stretched = stretch.solve(rest, length);
        assert!((stretched.along - along).abs() < 1e-5 && (stretched.across - across).abs() < 1e-5, "{stretched:?}");
        let scale = stretched.scale(1);
        assert_eq!((scale.x, scale.y, scale.z), (stretched.across, stretched.along, stretched.across));
    }
    let bounded = Stretch { min: 0.5, max: 2.0, volume: 0.0 };
    assert_eq!((bounded.solve(1.0, 9.0).along, bounded.solve(1.0, 0.1).along), (2.0, 0.5));
    assert_eq!(bounded.solve(1.0, 9.0).across, 1.0);
    for a in HARD {
        for b in HARD {
            for c in HARD {
                let stretched = Stretch { min: a, max: b, volume: c }.solve(b, c);
                assert!(stretched.along.is_finite() && stretched.across.is_finite(), "{a} {b} {c}: {stretched:?}");
            }
        }
    }
}

#[test]
fn euler_angles_match_their_order() {
    let orders = [
        (EulerOrder::Xyz, EulerRot::XYZ, [0, 1, 2]),
        (EulerOrder::Xzy, EulerRot::XZY, [0, 2, 1]),
        (EulerOrder::Yxz, EulerRot::YXZ, [1, 0, 2]),
        (EulerOrder::Yzx, EulerRot::YZX, [1, 2, 0]),
        (EulerOrder::Zxy, EulerRot::ZXY, [2, 0, 1]),
        (EulerOrder::Zyx, EulerRot::ZYX, [2, 1, 0]),
    ];
    let mut random = Random(18);
    for (order, theirs, axes) in orders {
        for case in 0..300 {
            let mut angles = random.point() * Vec3::splat(3.1);
            angles[axes[1]] *= 0.5;
            if case % 10 == 0 {
                angles[axes[1]] = std::f32::consts::FRAC_PI_2 * if case % 20 == 0 { 1.0 } else { -1.0 };
            }
            let rotation = order.rotation(angles);
            let [i, j, k] = axes.map(|axis| angles[axis]);
            assert!(angle(rotation, Quat::from_euler(theirs, i, j, k)) < 1e-3, "{order:?} {angles}");
            let back = order.rotation(order.angles(rotation));
            assert!(angle(rotation, back) < 2e-3, "{order:?} {angles}: {}", angle(rotation, back));
        }
    }
}

#[test]
fn limits_hold_and_leave_the_rest_alone() {
    let bounds = Bounds::new([Some(-1.0), None, Some(0.0)], [Some(1.0), Some(2.0), None]);
    assert_eq!(bounds.clamp(Vec3::new(-3.0, -9.0, -1.0)), Vec3::new(-1.0, -9.0, 0.0));
    assert_eq!(bounds.clamp(Vec3::splat(5.0)), Vec3::new(1.0, 2.0, 5.0));
    assert_eq!(Bounds::NONE.clamp(Vec3::splat(7.0)), Vec3::splat(7.0));
    // A knee that bends by 150 degrees, whatever place its axis has in the order.
    let turn = |axis: usize, degrees: f32| rotate::about([Vec3::X, Vec3::Y, Vec3::Z][axis], degrees.to_radians());
    let orders = [EulerOrder::Xyz, EulerOrder::Xzy, EulerOrder::Yxz, EulerOrder::Yzx, EulerOrder::Zxy, EulerOrder::Zyx];
    for order in orders {
        for axis in 0..3 {
            let mut bounds = Bounds { min: Vec3::ZERO, max: Vec3::ZERO };
            bounds.max[axis] = 150_f32.to_radians();
            for (degrees, wanted) in [(120.0, 120.0), (149.0, 149.0), (170.0, 150.0), (-40.0, 0.0), (0.0, 0.0)] {
                let clamped = bounds.clamp_rotation(turn(axis, degrees), order);
                let off = angle(clamped, turn(axis, wanted));
                assert!(off < 1e-2, "{order:?}, axis {axis}: {degrees} becomes {off} off {wanted}");
            }
        }
        // Within wide bounds nothing changes.
        let mut random = Random(19);
        let wide = Bounds { min: Vec3::splat(-3.2), max: Vec3::splat(3.2) };
        for _ in 0..100 {
            let rotation = random.rotation();
            assert!(angle(wide.clamp_rotation(rotation, order), rotation) < 1e-4);
        }
    }
    let cone = JointLimit::Cone { axis: Vec3::Y, swing: 0.5, twist_min: -0.2, twist_max: 0.3 };
    let mut random = Random(20);
    for _ in 0..300 {
        let clamped = cone.clamp(random.rotation());
        assert!(angle(swing_twist(clamped, Vec3::Y).0, Quat::IDENTITY) < 0.5 + 1e-3);
        assert!((-0.201..0.301).contains(&twist_angle(clamped, Vec3::Y)));
        assert!(angle(cone.clamp(clamped), clamped) < 1e-3, "clamping twice moves");
    }
    for value in HARD {
        let bounds = Bounds { min: Vec3::splat(value), max: Vec3::NAN };
        for order in orders {
            assert!(is_unit(bounds.clamp_rotation(Quat::from_xyzw(value, 1.0, 0.0, value), order)));
        }
    }
}
