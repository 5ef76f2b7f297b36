//! Fuzzing of the reader of clips: no panic, no hang, and whatever it accepts can be sampled, saved and read again.

use rigsmith::rig::{
    Rig, RigEdit, Uid,
    animation::ClipSampler,
    format::animation::{read_animation, write_named},
};

use crate::mutate::run_fuzz;

#[test]
fn no_text_breaks_the_reader_of_clips() {
    let frozen = include_str!("../frozen/format-1.anim.ron");
    let newer = frozen.replacen("format: 1,", "format: 2, extra: (a: ['\"', r#\"x\"#]),", 1);
    let seeds = vec![
        frozen.as_bytes().to_vec(),
        newer.into_bytes(),
        b"(format: 1, rig: \"0000000000000001\", clips: [(uid: \"0000000000000002\", name: \"\", range: (0, 1))])"
            .to_vec(),
    ];
    let dictionary: &[&[u8]] = &[
        b"uid: \"0000000000000001\",",
        b"node: \"0000000000001001\", label: \"\",",
        b"(t: 2.5, v: (0.0, 0.0, 0.0, 1.0)),",
        b"(t: 0.5, v: (1.0), ease: Stepped),",
        b"ease: Cubic(arrive: (0.0, 0.0, 0.0), leave: (1e30, -1e30, 3e38))",
        b"property: Rotation,",
        b"property: Attribute(\"a\"),",
        b"keys: [",
        b"tracks: [",
        b"layers: [",
        b"clips: [",
        b"mask: [",
        b"markers: [",
        b"format: 2",
        b"Some(",
        b"inf",
        b"NaN",
        b"1e39",
        b"r#\"",
        b"/*",
    ];
    run_fuzz("animation", &seeds, dictionary, |bytes| match read_animation(bytes) {
        Ok(read) => {
            let text = write_named(read.rig, &read.rig_name, &read.names, &read.clips);
            let again = read_animation(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
            assert_eq!((again.notes.len(), &again.clips), (0, &read.clips));
            assert_eq!(write_named(again.rig, &again.rig_name, &again.names, &again.clips), text);
            let mut rig = Rig::new(Uid(1), "");
            for clip in &read.clips {
                for time in [clip.range[0], clip.range[1], 0.3, f32::NAN] {
                    let mut values = vec![bevy::math::Vec4::ZERO; ClipSampler::new(clip).targets().len()];
                    ClipSampler::new(clip).sample(time, &mut Default::default(), &mut values);
                    clip.sample(time);
                }
                // What the reader takes, the document takes.
                rig.apply(&RigEdit::AddClip(Box::new(clip.clone()), 0)).unwrap();
            }
        }
        Err(error) => {
            let lines = 1 + bytes.iter().filter(|byte| **byte == b'\n').count();
            assert!((1..=lines).contains(&error.line), "{error}");
        }
    });
}
