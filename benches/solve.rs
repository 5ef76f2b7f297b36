//! Solvers on one core: time of one solution.
//!
//! Prints one JSON line. Inputs are seeded and lie in memory before the clock starts; each time is the least of several
//! runs over all of them, divided by their number.
//!
//! ```text
//! cargo bench --bench solve
//! ```

use std::{hint::black_box, time::Instant};

use bevy::math::{Quat, Vec3};
use rigsmith::solve::{
    expression::Expression,
    fabrik::{IterationSettings, fabrik},
    two_bone::TwoBone,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut random = Random(1);
    let limbs: Vec<TwoBone> = (0..4096).map(|_| random.limb()).collect();
    let hard: Vec<TwoBone> =
        limbs.iter().map(|limb| TwoBone { goal: limb.root + (limb.goal - limb.root) * 2.0, ..*limb }).collect();
    let unpoled: Vec<TwoBone> = limbs.iter().map(|limb| TwoBone { pole: None, soft: 0.0, ..*limb }).collect();
    let each = |seconds: f64| seconds / limbs.len() as f64 * 1e6;
    let solve = |limbs: &[TwoBone]| {
        each(best(200, || {
            for limb in limbs {
                black_box(limb.solve());
            }
        }))
    };
    let mut report = vec![
        format!("\"two_bone_us\": {:.4}", solve(&limbs)),
        format!("\"two_bone_soft_stretched_us\": {:.4}", solve(&hard)),
        format!("\"two_bone_no_pole_us\": {:.4}", solve(&unpoled)),
    ];

    let lengths = [0.25; 8];
    let chain: Vec<Vec3> = (0..9).map(|i| Vec3::new(0.01 * (i * i) as f32, 0.25 * i as f32, 0.0)).collect();
    let settings = IterationSettings { tolerance: 1e-4, iterations: 16, bend: Vec3::Z };
    let mut points = chain.clone();
    let seconds = best(50, || {
        for limb in &limbs {
            points.copy_from_slice(&chain);
            black_box(fabrik(&mut points, &lengths, limb.goal, &settings));
        }
    });
    report.push(format!("\"fabrik_8_bones_us\": {:.4}", each(seconds)));

    let expression =
        Expression::new("clamp(curl * 90 - 10, 0, 80) + if(side > 0, sin(curl * 360), -5)", &["curl", "side"])?;
    let seconds = best(50, || {
        for limb in &limbs {
            black_box(expression.evaluate(&[limb.soft, limb.goal.x]));
        }
    });
    report.push(format!("\"expression_us\": {:.4}", each(seconds)));
    println!("{{{}}}", report.join(", "));
    Ok(())
}

/// The least of several timings, in seconds: what the machine can do when it is left alone.
fn best(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// A bent limb with a pole and a goal within reach.
    fn limb(&mut self) -> TwoBone {
        let root = self.point();
        let mid = root + self.point().normalize_or(Vec3::Y);
        let end = mid + self.point().normalize_or(Vec3::X) * 0.9;
        let [root_rotation, mid_rotation] = [0, 1].map(|_| Quat::from_scaled_axis(self.point()));
        TwoBone {
            root,
            mid,
            end,
            root_rotation,
            mid_rotation,
            goal: root + self.point().normalize_or(Vec3::Z) * (0.3 + 1.5 * self.unit()),
            pole: Some(root + self.point() * 5.0),
            preferred: Vec3::Z,
            soft: 0.1 * self.unit(),
            stretch: 1.0,
            max_stretch: 2.0,
            pin: 0.0,
        }
    }
}
