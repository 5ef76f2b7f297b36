//! The one file layer: everything Rigsmith saves or reads goes through here.
//!
//! - [`save_atomic`] leaves the old file or the finished one, whatever fails: it writes a temporary file beside its target,
//!   syncs it, reads it back, and renames it over the target.
//! - [`save_set`] does so for a main file with companions, such as a `.gltf` with its buffer and images. Companions have names
//!   with the hash of their content, so that no file is ever replaced by one.
//! - [`read_capped`] and [`open`] answer a missing, empty, oversized or forbidden file with an error that says what to do.
//! - [`journal`] keeps every edit as it is made, and gives it back after a crash.
//! - [`ModelFolder`] finds the textures and buffers that a model names, and nothing outside the model's folder.
//! - [`Disk`] is what they stand on. [`RealDisk`] is the file system; [`FaultyDisk`] fails at a chosen operation in a chosen
//!   manner, so that a test can try every one of them (as SQLite's tests do), including tests of games that save rigs.
//!
//! Temporary files are named `.rigsmith-XXXXXXXXXXXXXXXX.tmp` (16 hexadecimal digits). A killed process can leave some
//! behind: watchers and listings skip what [`is_temp_name`] recognises, and the next save in the folder clears them away, as
//! does [`remove_stale_temps`].
//!
//! Readers and writers elsewhere in the crate take bytes or `Read`, and never a path.

mod allowed_folders;
mod atomic;
mod disk;
mod disk_error;
mod expressions;
mod failed_save;
mod fault;
mod folder;
mod identity;
pub mod journal;
mod kept_lists;
mod library;
mod load;
mod model_watch;
mod part_cache;
mod part_error;
mod parts;
mod project;
mod read;
mod shapes;
mod similar_parts;
mod site;
mod stoppable_disk;
mod store;
mod template_layout;
mod template_origin;
mod template_text;
mod template_update;
mod verify;
mod watch;

pub use allowed_folders::{AllowedError, AllowedFolders};
pub use atomic::{
    FileSet, SaveError, SaveStep, StagedFile, check_place, is_temp_name, remove_stale_temps, save_atomic, save_set,
    stage_file,
};
pub use disk::{Disk, DiskFile, Entry, EntryKind, Hold, RealDisk};
pub use disk_error::DiskError;
pub use expressions::{
    ExpressionFileError, FoundFiles, LeftOut, SITE_DEPTH, files_below, is_expression_file, load_expressions,
};
pub use failed_save::FailedSave;
pub use fault::{Fault, FaultPlan, FaultyDisk};
pub use folder::{ModelFolder, UriError};
pub use identity::is_same_file;
pub use library::{
    FileState, FolderListError, FolderListing, HeaderError, HeaderMemory, LibraryError, ListedTemplate, NewestVersions,
    TemplatePlace, VersionedTemplate, list_bundled, list_templates, newest_versions, read_listed,
};
pub use load::{
    FileKind, LoadError, load_animation, load_gestures, load_joint_map, load_model, load_motion, load_packed_clips,
    load_rig_text, load_skin, load_template, stem,
};
pub use model_watch::{ModelWatch, SETTLE, read_noting_files};
pub use part_cache::PartCache;
pub use part_error::PartFileError;
pub use parts::{
    BUNDLED_CHARACTERS, BUNDLED_PARTS, FoundPart, PartFiles, bundled_characters, bundled_part, bundled_parts,
};
pub use project::{
    LoadedMesh, LoadedProject, MeshShape, MeshState, MeshToSave, ProjectFiles, ProjectMesh, ProjectNote,
    ProjectTemplate, ProjectToSave, load_project, project_files, store_project,
};
pub use read::{OpenFile, ReadError, open, read_capped};
pub use shapes::{LoadShapesError, load_shapes};
pub use site::{SITE_FILE, SearchPaths, SiteError, TEMPLATES_VARIABLE};
pub use stoppable_disk::{StopSign, StoppableDisk};
pub use store::{
    DocumentBase, StoreError, is_template_of, stage_animation, stage_skin, store_animation, store_avatar,
    store_document_over, store_model, store_owned_model, store_packed_clips, store_rig, store_rig_over, store_skin,
};
pub use template_layout::format_template_file;
pub use template_origin::{TemplateOrigin, has_parts, store_rig_from};
#[cfg(feature = "cli")]
pub(crate) use template_text::new_template_text;
pub(crate) use template_text::template_text;
pub use template_update::{
    DocumentUpdate, TemplateBase, TemplateUpdate, TemplateVersion, base_text, diff_templates, update_document,
    update_template, update_with_known_parts,
};
pub use watch::{FileWatch, LOOK, TemplateWatch};
