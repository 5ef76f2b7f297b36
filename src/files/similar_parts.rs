//! Names of parts that are similar to the name of a missing part.

use std::path::Path;

use super::{BUNDLED_PARTS, Disk};
use crate::rig::nearest::nearest;

/// Ending of the files of parts.
const ENDING: &str = ".rig.ron";

/// Most names of a folder that are searched.
const MOST_NAMES: usize = 4096;

/// Most names that are told.
const MOST_TOLD: usize = 3;

/// Names, as templates call them, of parts beside `path` and of those that come with Rigsmith whose files are called like that of
/// `name`, sorted.
pub(super) fn similar_parts(disk: Option<&dyn Disk>, path: &Path, name: &str) -> Vec<String> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let beside = disk.and_then(|disk| disk.list(folder, MOST_NAMES).ok()).unwrap_or_default();
    let before = name.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
    let beside = beside.into_iter().map(|file| format!("{before}{}", file.to_string_lossy()));
    let bundled = BUNDLED_PARTS.iter().map(|(known, _)| (*known).to_owned());
    let mut known: Vec<String> = beside.filter(|file| file.ends_with(ENDING)).chain(bundled).collect();
    known.sort_unstable();
    known.dedup();
    let wanted = stem(name);
    let is_same = |known: &String| stem(known) == wanted;
    let near = match known.iter().any(is_same) {
        true => vec![wanted.to_owned()],
        false => nearest(wanted, known.iter().map(|known| stem(known)), MOST_TOLD),
    };
    known.retain(|known| near.iter().any(|near| near == stem(known)));
    known.truncate(MOST_TOLD);
    known
}

/// Text before the ending of a file, which tells parts apart: the ends of their names are all alike.
fn stem(name: &str) -> &str {
    let file = name.rsplit('/').next().unwrap_or(name);
    file.split('.').next().unwrap_or(file)
}
