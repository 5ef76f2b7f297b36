//! Skin files: no panic, no hang, and what is read is written and read again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigsmith::rig::skin::SkinFile;

fuzz_target!(|data: &[u8]| {
    if let Ok(skin) = SkinFile::read(data) {
        let written = skin.write();
        let again = SkinFile::read(&written).expect("what was written can be read");
        assert_eq!(again.write(), written);
    }
});
