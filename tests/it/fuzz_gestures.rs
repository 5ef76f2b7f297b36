//! Fuzzing of the gesture reader: no panic, no hang, and whatever it accepts can be written and read again.

use rigsmith::plugins::gesture::read_gestures;

use crate::mutate::run_fuzz;

#[test]
fn no_text_breaks_the_gesture_reader() {
    let seeds = vec![
        b"[View(Front), Stroke(points: [(0.2,1.4),(0.7,1.1)], threshold: 0.02), Stroke(points: [(0.0,0.9),(0.0,1.4)], joints: 3), Select((0.0,1.0))]".to_vec(),
        b"[Click((0.0,1.2)), Depth(0.3), Mirror(true), Volume(1), Undo, Redo, Label(\"wrist_l\"), View(Orbit(30, -1e1))]".to_vec(),
        b"[Box((0, 0), (1, 1)), Group(\"g\", Some((1, 0, 0))), MoveTo((0, 1, 2)), Orient(Y), Lock(true), /* c */ Scale(2) // d\n]".to_vec(),
    ];
    let dictionary: &[&[u8]] = &[
        b"Click((0,0)),",
        b"Stroke(points: [",
        b"joints: ",
        b"threshold: ",
        b"View(",
        b"Orbit(",
        b"NaN",
        b"inf",
        b"None",
    ];
    run_fuzz("gestures", &seeds, dictionary, |bytes| match read_gestures(bytes) {
        Ok(gestures) => {
            let text = ron::to_string(&gestures).expect("gestures can be written");
            assert_eq!(read_gestures(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}")), gestures);
        }
        Err(error) => {
            let lines = 1 + bytes.iter().filter(|byte| **byte == b'\n').count();
            assert!((1..=lines).contains(&error.line), "{error}");
        }
    });
}
