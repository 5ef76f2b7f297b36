//! sRGB and linear colours without transcendental functions, whose results differ between machines.

/// The linear value of an sRGB component (IEC 61966-2-1). Values outside 0..=1 are extrapolated.
pub(super) fn to_linear(value: f64) -> f64 {
    if value <= 0.04045 {
        return value / 12.92;
    }
    // x^2.4 = x^2 (x^2)^(1/5)
    let base = (value + 0.055) / 1.055;
    let square = base * base;
    square * root(square, 5)
}

/// The sRGB component of a linear value.
pub(super) fn to_srgb(value: f64) -> f64 {
    if value <= 0.003_130_8 {
        return value * 12.92;
    }
    // x^(1/2.4) = ((x^5)^(1/3))^(1/4), and x^5 = x^2 x^2 x
    let square = value * value;
    1.055 * root(square * square * value, 3).sqrt().sqrt() - 0.055
}

/// The shortest decimal whose linear value is `linear` again; the exact decimal if there is none so short.
pub(super) fn srgb_text(linear: f32) -> String {
    let value = to_srgb(f64::from(linear.max(0.0)));
    let candidates = (1..12).map(|places| format!("{value:.places$}"));
    let same = |text: &String| text.parse::<f32>().is_ok_and(|read| to_linear(f64::from(read)) as f32 == linear);
    let text = candidates.into_iter().find(same).unwrap_or_else(|| (value as f32).to_string());
    match text.strip_suffix(".0") {
        Some(whole) => whole.into(),
        None => text,
    }
}

/// A root of a positive number by Newton's iteration, which converges monotonically from above.
fn root(value: f64, degree: i32) -> f64 {
    let n = f64::from(degree);
    let mut guess = value.max(1.0);
    loop {
        let mut power = 1.0;
        for _ in 1..degree {
            power *= guess;
        }
        let next = ((n - 1.0) * guess + value / power) / n;
        if next >= guess {
            return guess;
        }
        guess = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversion_is_that_of_the_standard_and_back() {
        for step in 0..=1000 {
            let value = f64::from(step) / 1000.0;
            let wanted = if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
            assert!((to_linear(value) - wanted).abs() < 1e-14, "{value}");
            assert!((to_srgb(to_linear(value)) - value).abs() < 2e-8, "{value}");
            let linear = to_linear(f64::from(value as f32)) as f32;
            assert_eq!(to_linear(f64::from(srgb_text(linear).parse::<f32>().unwrap())) as f32, linear, "{value}");
        }
        assert_eq!(srgb_text(0.0), "0");
        assert_eq!(srgb_text(1.0), "1");
    }
}
