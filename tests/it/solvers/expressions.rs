//! Expressions.

use proptest::prelude::*;
use rigsmith::solve::expression::{Expression, ExpressionError, FUNCTIONS, MOST_CHARACTERS};

const NAMES: [&str; 4] = ["curl", "side", "arm.roll", "x"];
const VALUES: [f32; 4] = [0.5, -1.0, 30.0, 3.0];

fn value(text: &str) -> f32 {
    let expression = Expression::new(text, &NAMES).unwrap_or_else(|error| panic!("{text}: {error}"));
    let evaluated = expression.evaluate(&VALUES);
    assert!(evaluated.is_finite, "{text} is not finite");
    evaluated.value
}

#[test]
fn expressions_come_to_what_they_say() {
    let cases = [
        ("1", 1.0),
        (" 1.5e1 ", 15.0),
        (".5 + 2.", 2.5),
        ("1 + 2 * 3", 7.0),
        ("(1 + 2) * 3", 9.0),
        ("7 - 2 - 1", 4.0),
        ("7 - 2 + 1", 6.0),
        ("1 - 2 + 3 - 4 + 5", 3.0),
        ("x - 2 + 3", 4.0),
        ("8 / 4 / 2", 1.0),
        ("8 / 4 * 2", 4.0),
        ("2 * 8 / 4 % 3", 1.0),
        ("7 % 3", 1.0),
        ("-1 % 3", 2.0),
        ("1 % -3", -2.0),
        ("2 ^ 3", 8.0),
        ("-2 ^ 2", -4.0),
        ("(-2) ^ 2", 4.0),
        ("-x ^ 2", -9.0),
        ("-(x) ^ 2", -9.0),
        ("-abs(side) ^ 2", -1.0),
        ("2 ^ -1", 0.5),
        ("2 ^ -x", 0.125),
        ("2 ^ -(x)", 0.125),
        ("2 * -3", -6.0),
        ("2 * -(1 + 2)", -6.0),
        ("6 / -(1 + 2)", -2.0),
        ("6 / -(2) ^ 2", -1.5),
        ("--2", 2.0),
        ("---(2)", -2.0),
        ("-+-x", 3.0),
        ("1 - -1", 2.0),
        ("1 - -(1)", 2.0),
        ("curl * 90", 45.0),
        ("arm.roll / 2", 15.0),
        ("side", -1.0),
        ("sin(arm.roll)", 0.5),
        ("cos(60)", 0.5),
        ("tan(45)", 1.0),
        ("asin(1)", 90.0),
        ("acos(0)", 90.0),
        ("atan(1)", 45.0),
        ("atan2(1, -1)", 135.0),
        ("sqrt(16)", 4.0),
        ("exp(0) + log(1)", 1.0),
        ("abs(-3) + abs(3)", 6.0),
        ("sign(-2) + sign(0) * 5 + sign(9)", 0.0),
        ("floor(-1.5)", -2.0),
        ("ceil(-1.5)", -1.0),
        ("round(2.5)", 3.0),
        ("min(3, 1, 2)", 1.0),
        ("max(3, 1 + 4, 2)", 5.0),
        ("max(1, min(2, 3)) - min(1, max(2, 3))", 1.0),
        ("clamp(7, 0, 5)", 5.0),
        ("clamp(-7, 0, 5)", 0.0),
        ("clamp(2 + 1, 0 + 0, 2 * 5)", 3.0),
        ("lerp(10, 20, 0.25)", 12.5),
        ("lerp(lerp(0, 10, 0.5), lerp(10, 20, 0.5), curl)", 10.0),
        ("smoothstep(0.5, 0, 1)", 0.5),
        ("smoothstep(-1, 0, 1) + smoothstep(2, 0, 1)", 1.0),
        ("if(x > 2, 10, 20)", 10.0),
        ("if(x < 2, 10, if(side < 0, 30, 40))", 30.0),
        ("if(1, x, 1 / 0)", 3.0),
        ("not(0) + not(4)", 1.0),
        ("1 < 2", 1.0),
        ("(2 <= 2) + (2 >= 3) + (1 == 1) + (1 != 1)", 2.0),
        ("1 < 2 && 2 < 3", 1.0),
        ("1 > 2 || 2 > 3 || 0", 0.0),
        ("1 || 0 && 0", 1.0),
        ("1 + 1 == 2 && 2 * 2 > 3", 1.0),
        ("pi", std::f32::consts::PI),
        ("tau / pi", 2.0),
        ("((((((x))))))", 3.0),
        ("sin ( 90 )", 1.0),
        ("min(-1, -(2))", -2.0),
    ];
    for (text, wanted) in cases {
        let value = value(text);
        assert!((value - wanted).abs() <= 1e-5 * wanted.abs().max(1.0), "{text} = {value}, not {wanted}");
    }
}

#[test]
fn names_are_the_callers() {
    let names: Vec<String> = (0..30).map(|i| format!("v{i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let expression = Expression::new("v29 * 100 + v3 * 10 + v10 - v3", &names).unwrap();
    let values: Vec<f32> = (0..30).map(|i| i as f32).collect();
    assert_eq!(expression.evaluate(&values).value, 2937.0);
    assert_eq!(expression.used(), [3, 10, 29]);
    // Missing values are zero; a variable hides a constant; functions and names do not get in each other's way.
    assert_eq!(expression.evaluate(&values[..5]).value, 27.0);
    assert_eq!(
        Expression::new("pi + sin + größe", &["pi", "sin", "größe"]).unwrap().evaluate(&[1.0, 2.0, 3.0]).value,
        6.0
    );
}

#[test]
fn what_is_not_finite_is_zero_and_told() {
    for text in ["1 / 0", "sqrt(-1)", "log(0)", "(0 - 2) ^ 0.5", "exp(1000)", "5 % 0", "asin(2)"] {
        let evaluated = Expression::new(text, &[]).unwrap().evaluate(&[]);
        assert_eq!((evaluated.value, evaluated.is_finite), (0.0, false), "{text}");
    }
    let divided = Expression::new("1 / x", &["x"]).unwrap();
    assert!(!divided.evaluate(&[f32::NAN]).is_finite);
    assert!(divided.evaluate(&[2.0]).is_finite);
}

#[test]
fn errors_tell_place_and_remedy() {
    let deep = "(".repeat(33) + "1" + &")".repeat(33);
    let long = "1".repeat(MOST_CHARACTERS + 1);
    let wide = vec!["1"; 33].join("+");
    let cases = [
        ("", 1, "empty"),
        ("   ", 1, "empty"),
        ("1 +", 4, "before the end"),
        ("1 + * 2", 5, "before `*`"),
        ("1 2", 3, "operator must stand before `2`"),
        ("(1)(2)", 4, "operator must stand before `(`"),
        ("x(2)", 1, "`x` is not known"),
        ("2 x", 3, "operator must stand before `x`"),
        ("(1 + 2", 1, "never closed"),
        ("1 + (2 * (3)", 5, "never closed"),
        ("1 + 2)", 6, "closes nothing"),
        ("()", 2, "before `)`"),
        ("1, 2", 2, "comma"),
        ("(1, 2)", 3, "comma"),
        ("min(1)", 4, "`min` takes two or more arguments, but has 1"),
        ("clamp(1, 2)", 6, "three arguments, but has 2"),
        ("clamp(1, 2, 3, 4)", 6, "three arguments, but has 4"),
        ("sin(1, 2)", 4, "one argument, but has 2"),
        ("sin()", 4, "one argument, but has 0"),
        ("min(1,)", 7, "before `)`"),
        ("min(,1)", 5, "before `,`"),
        ("crul + 1", 1, "is `curl` meant"),
        ("2 * Sin(3)", 5, "`sin`"),
        ("wholly_unlike", 1, "spelling"),
        ("1 = 2", 3, "`==`"),
        ("!x", 1, "not("),
        ("1 & 2", 3, "`&&`"),
        ("1 | 2", 3, "`||`"),
        ("1 # 2", 3, "`#`"),
        ("1 + {x}", 5, "`{`"),
        ("a@b", 1, "`a` is not known"),
        ("1.2.3", 1, "1.2.3"),
        (".", 1, "not a number"),
        ("1e99", 1, "1e99"),
        ("2 ^ 3 ^ 2", 7, "two ways"),
        ("1 < 2 < 3", 7, "two ways"),
        ("🦴 + 1", 1, "🦴"),
        ("1 + 🦴", 5, "🦴"),
        (&deep, 33, "deep"),
        (&long, 1001, "1000 characters"),
        (&wide, 65, "32 numbers"),
    ];
    for (text, column, part) in cases {
        let error: ExpressionError = Expression::new(text, &NAMES).expect_err(text);
        let shown = error.to_string();
        assert!(error.column == column && shown.contains(part), "{text}: {shown}");
    }
}

#[test]
fn every_function_is_documented_and_works() {
    for function in FUNCTIONS {
        assert!(function.doc.starts_with('(') && function.doc.contains(": "), "{}", function.name);
        let works = (1..=3).any(|count| {
            let arguments = vec!["0.5"; count].join(", ");
            Expression::new(&format!("{}({arguments})", function.name), &[]).is_ok_and(|e| e.evaluate(&[]).is_finite)
        });
        assert!(works, "{}", function.name);
    }
}

/// A random expression with its value, computed apart.
fn tree() -> impl Strategy<Value = (String, f64)> {
    let leaf = prop_oneof![
        (0_u8..20).prop_map(|n| (format!("{}", f64::from(n) / 4.0), f64::from(n) / 4.0)),
        (0_usize..4).prop_map(|i| (NAMES[i].to_owned(), f64::from(VALUES[i]))),
    ];
    leaf.prop_recursive(4, 24, 3, |inner| {
        prop_oneof![
            (inner.clone(), inner.clone(), 0..6).prop_map(|((a, x), (b, y), kind)| match kind {
                0 => (format!("({a} + {b})"), x + y),
                1 => (format!("({a}) - ({b})"), x - y),
                2 => (format!("({a}) * ({b})"), x * y),
                3 => (format!("(({a}) < ({b}))"), f64::from(u8::from(x < y))),
                4 => (format!("max({a}, {b})"), x.max(y)),
                _ => (format!("min({b}, {a}, 2)"), x.min(y).min(2.0)),
            }),
            (inner.clone(), inner.clone(), inner.clone(), 0..3).prop_map(|((a, x), (b, y), (c, z), kind)| match kind {
                0 => (format!("lerp({a}, {b}, {c})"), x + (y - x) * z),
                1 => (format!("if({a}, {b}, {c})"), if x == 0.0 { z } else { y }),
                // Unparenthesised: all that a text of ours begins or ends with binds at least as strongly.
                _ => (format!("({a}) - ({b}) + ({c})"), x - y + z),
            }),
            inner.clone().prop_map(|(a, x)| (format!("-({a})"), -x)),
            inner.prop_map(|(a, x)| (format!("abs({a})"), x.abs())),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_expressions_have_the_right_value((text, wanted) in tree()) {
        match Expression::new(&text, &NAMES) {
            Ok(expression) => {
                let evaluated = expression.evaluate(&VALUES);
                let off = (f64::from(evaluated.value) - wanted).abs();
                // Numbers are quarters, mostly exact; large products are not.
                prop_assert!(off <= 1e-3 * wanted.abs().max(1.0), "{} = {}, not {}", text, evaluated.value, wanted);
            }
            Err(error) => prop_assert!(error.to_string().contains("numbers and names"), "{}: {}", text, error),
        }
    }

    #[test]
    fn any_text_is_an_expression_or_an_error(text in "(curl|x|min|clamp|if|sin|pi|[0-9.e]{1,4}|[-+*/%^<>=!&|(),{}#@~ ]|\\PC){0,40}") {
        match Expression::new(&text, &NAMES) {
            Ok(expression) => prop_assert!(expression.evaluate(&VALUES).value.is_finite()),
            Err(error) => {
                prop_assert!(error.column >= 1 && error.column <= text.chars().count() + 1);
                prop_assert!(!matches!(error.problem, rigsmith::solve::expression::ExpressionProblem::Evaluator(_)));
            }
        }
    }
}
