//! The example of a module from outside the crate, run as it is.

#[path = "../../examples/custom_module.rs"]
mod example;

#[test]
fn the_example_of_a_module_from_outside_runs() {
    let told = example::run().unwrap();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 6, "{told}");
    assert_eq!(lines[0], "1 command ran, the rig has 4 nodes");
    let lag = |line: &str| line.split(' ').nth(3).unwrap().parse::<f32>().unwrap();
    assert!(lag(lines[1]) > 0.05, "it lags behind at first: {told}");
    assert!(lag(lines[4]) < lag(lines[1]), "and comes after: {told}");
    assert!(lines[5].contains("pendulum") && lines[5].contains("length: is -1; write a number above 0"), "{told}");
}
