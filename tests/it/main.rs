//! All integration tests in one binary: one module a feature, through the public API.
//!
//! Tests of real meshes need `RIGSMITH_DATA`, pictures and the window a graphics adapter; see `prerequisites`. Tests count
//! work and measure no time: the benches do.

mod animation;
mod bench;
mod build_limits;
mod bvh;
mod carried_objects;
mod choices;
#[cfg(feature = "cli")]
mod cli;
#[cfg(feature = "cli")]
mod cli_animate;
#[cfg(feature = "cli")]
mod cli_answers;
#[cfg(feature = "cli")]
mod cli_build;
#[cfg(feature = "cli")]
mod cli_check;
#[cfg(feature = "cli")]
mod cli_face;
#[cfg(feature = "cli")]
mod cli_face_parts;
#[cfg(feature = "cli")]
mod cli_limits;
#[cfg(all(feature = "cli", unix))]
mod cli_names;
#[cfg(feature = "cli")]
mod cli_numbers;
#[cfg(feature = "cli")]
mod cli_outputs;
#[cfg(feature = "cli")]
mod cli_pose;
#[cfg(feature = "cli")]
mod cli_process;
#[cfg(feature = "cli")]
mod cli_saved_parts;
#[cfg(feature = "cli")]
mod cli_site;
#[cfg(feature = "cli")]
mod cli_skin;
#[cfg(all(feature = "cli", target_os = "linux"))]
mod cli_streams;
#[cfg(feature = "cli")]
mod cli_template_answers;
#[cfg(feature = "cli")]
mod cli_templates;
#[cfg(feature = "cli")]
mod cli_update_clips;
#[cfg(feature = "cli")]
mod cli_watch;
mod click_runs;
#[cfg(feature = "editor")]
mod clicks;
mod clip_files;
mod commands;
#[cfg(feature = "editor")]
mod control_density;
mod control_sizes;
mod custom_module;
#[cfg(feature = "editor")]
mod discard;
mod disks;
#[cfg(feature = "draw")]
mod display;
#[cfg(feature = "editor")]
mod dock;
mod documents;
#[cfg(feature = "draw")]
mod drawing;
#[cfg(feature = "render")]
mod drawing_pictures;
mod dropped_parts;
mod dual_quaternion;
mod edit_text;
#[cfg(feature = "editor")]
mod editor_files;
#[cfg(all(feature = "cli", feature = "editor"))]
mod editor_follow;
#[cfg(feature = "editor")]
mod editor_settings;
mod edits;
#[cfg(feature = "editor")]
mod examples;
mod exports;
mod face;
mod face_accessories;
#[cfg(feature = "cli")]
mod face_arkit;
mod face_bones;
mod face_expressions;
mod face_eyes;
mod face_fit;
mod face_grouping;
mod face_landmarks;
mod face_orientation;
mod face_symmetry;
mod face_teeth;
mod face_units;
mod failed_saves;
mod files;
mod files_faults;
mod files_kill;
mod files_read;
mod files_set;
mod fill;
mod fit;
mod fit_choice;
#[cfg(feature = "cli")]
mod fit_cli;
#[cfg(feature = "cli")]
mod fit_clutter;
mod fit_data;
mod fit_hinges;
#[cfg(feature = "cli")]
mod fit_parts;
#[cfg(feature = "editor")]
mod fit_window;
#[cfg(feature = "cli")]
mod fit_wishes;
#[cfg(feature = "editor")]
mod folder_watch;
mod fuzz_animation;
mod fuzz_bvh;
mod fuzz_gestures;
mod fuzz_gltf;
mod fuzz_journal;
mod fuzz_obj;
mod fuzz_packed_clips;
mod fuzz_peers;
mod fuzz_project;
mod fuzz_rig_text;
mod fuzz_skin;
mod fuzz_template;
mod fuzz_whole;
mod generate;
mod gesture_answers;
#[cfg(feature = "editor")]
mod gesture_counts;
mod gestures;
#[cfg(feature = "editor")]
mod gizmo;
mod gltf;
mod gltf_torture;
#[cfg(feature = "editor")]
mod glyphs;
#[cfg(feature = "editor")]
mod graph;
mod growth;
mod growth_bends;
mod growth_clips;
mod growth_fit;
mod growth_picks;
mod growth_weights;
mod heads;
#[cfg(feature = "cli")]
mod hostile;
mod influences;
mod inputs;
mod instances;
mod joined_weights;
mod journal;
mod journal_kill;
mod keep_pose;
#[cfg(feature = "editor")]
mod key_bindings;
mod kmeans;
mod layout;
mod layout_names;
mod leg_strokes;
mod linkage;
mod list_orders;
#[cfg(feature = "editor")]
mod loader;
mod long_run;
mod mesh_reload;
#[cfg(feature = "editor")]
mod mesh_watch;
mod mirror;
mod model_files;
mod models;
mod modules_nodes;
mod modules_rigs;
mod moved_tags;
mod mutate;
#[cfg(feature = "cli")]
mod new_templates;
mod obj;
mod obj_materials;
mod obj_tangles;
mod obj_torture;
mod operation_runs;
mod packed_clips;
#[cfg(feature = "editor")]
mod panels;
#[cfg(feature = "cli")]
mod part_fields;
mod part_instances;
mod part_overrides;
mod part_sizes;
mod part_sockets;
mod parts;
mod parts_more;
mod picking;
mod placement;
mod plugins;
mod polling;
mod pose;
mod prerequisites;
mod processor;
mod project;
#[cfg(feature = "cli")]
mod project_parts;
mod random;
mod references;
#[cfg(feature = "remote")]
mod remote;
#[cfg(feature = "render")]
mod render;
mod retarget;
mod review_growth;
mod rig_limits;
mod rig_text;
#[cfg(feature = "editor")]
mod run_failures;
mod runtime;
mod same_parts;
mod saved_text;
mod schema;
mod sided_values;
mod site;
mod skin_built;
mod skin_file;
#[cfg(feature = "editor")]
mod snapshots;
mod solvers;
mod sources;
mod stages;
#[cfg(feature = "editor")]
mod start_page;
mod stroke;
mod surface;
mod surface_refresh;
mod tags;
mod template;
#[cfg(feature = "cli")]
mod template_copies;
mod template_layout;
mod template_text;
mod three_strokes;
#[cfg(feature = "editor")]
mod timeline;
#[cfg(feature = "editor")]
mod tools;
mod transfer;
#[cfg(feature = "editor")]
mod typing;
mod unknown_names;
mod update;
#[cfg(feature = "editor")]
mod updater;
#[cfg(feature = "editor")]
mod viewport_app;
#[cfg(feature = "editor")]
mod viewport_views;
mod voxels;
#[cfg(feature = "cli")]
mod vrm;
mod watched_folder;
mod weight_paint;
#[cfg(feature = "editor")]
mod weight_paint_tool;
mod weights;
mod weights_bodies;
mod weights_rigs;
mod whole;
#[cfg(all(feature = "editor", feature = "cli"))]
mod window;
#[cfg(feature = "editor")]
mod window_app;
mod world;
