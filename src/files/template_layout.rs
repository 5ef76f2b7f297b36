//! Files of templates in their layout.

use std::path::Path;

use super::{Disk, PartFiles};
use crate::rig::{
    SourceError,
    template::{UidStyle, format_with_parts},
};

/// The text of a template's file in its layout. Its parts are looked for as beside the file; while one cannot be had,
/// references keep their uids.
///
/// # Errors
/// See [`format_template`](crate::rig::template::format_template).
pub fn format_template_file(disk: &dyn Disk, path: &Path, text: &str, uids: UidStyle) -> Result<String, SourceError> {
    let whole = match uids {
        UidStyle::Derived => PartFiles::new(disk).complete(path, text.as_bytes()).ok(),
        UidStyle::Kept | UidStyle::Written => None,
    };
    format_with_parts(text, uids, whole.as_ref().map(|whole| &whole.rig))
}
