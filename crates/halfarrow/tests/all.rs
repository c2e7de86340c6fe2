//! All tests in one program, which is linked once: `cargo test --test all NAME` runs those of one file.

#[path = "animation.rs"]
mod animation;
#[path = "api.rs"]
mod api;
#[path = "compare.rs"]
mod compare;
#[path = "contacts.rs"]
mod contacts;
#[path = "converters.rs"]
mod converters;
#[path = "crawls.rs"]
mod crawls;
#[path = "drawings.rs"]
mod drawings;
#[path = "equilibria.rs"]
mod equilibria;
#[path = "events.rs"]
mod events;
#[path = "execution.rs"]
mod execution;
#[path = "faults_assumptions.rs"]
mod faults_assumptions;
#[path = "faults_audit.rs"]
mod faults_audit;
#[path = "faults_files.rs"]
mod faults_files;
#[path = "faults_forms.rs"]
mod faults_forms;
#[path = "faults_guess.rs"]
mod faults_guess;
#[path = "faults_numbers.rs"]
mod faults_numbers;
#[path = "faults_pictures.rs"]
mod faults_pictures;
#[path = "faults_print.rs"]
mod faults_print;
#[path = "faults_start.rs"]
mod faults_start;
#[path = "faults_steps.rs"]
mod faults_steps;
#[path = "faults_strokes.rs"]
mod faults_strokes;
#[path = "fit.rs"]
mod fit;
#[path = "forms.rs"]
mod forms;
#[path = "gradient.rs"]
mod gradient;
#[path = "growth.rs"]
mod growth;
#[path = "iltis.rs"]
mod iltis;
#[path = "jumps_random.rs"]
mod jumps_random;
#[path = "lanes_in_modes.rs"]
mod lanes_in_modes;
#[path = "library_std.rs"]
mod library_std;
#[path = "linearize.rs"]
mod linearize;
#[path = "machines_bicycle.rs"]
mod machines_bicycle;
#[path = "machines_robot.rs"]
mod machines_robot;
#[path = "machines_satellite.rs"]
mod machines_satellite;
#[path = "machines_stewart.rs"]
mod machines_stewart;
#[path = "mechanisms.rs"]
mod mechanisms;
#[path = "modes_in_c.rs"]
mod modes_in_c;
#[path = "multibonds.rs"]
mod multibonds;
#[path = "names.rs"]
mod names;
#[path = "planar.rs"]
mod planar;
#[path = "random_trees.rs"]
mod random_trees;
#[path = "repeated.rs"]
mod repeated;
#[path = "report.rs"]
mod report;
#[path = "sensitivity.rs"]
mod sensitivity;
#[path = "set_valued.rs"]
mod set_valued;
#[path = "set_valued_forms.rs"]
mod set_valued_forms;
#[path = "set_valued_random.rs"]
mod set_valued_random;
#[path = "shares.rs"]
mod shares;
#[path = "stiff_networks.rs"]
mod stiff_networks;
#[path = "sweep.rs"]
mod sweep;
#[path = "vehicles.rs"]
mod vehicles;
#[path = "velocity.rs"]
mod velocity;
#[path = "velocity_many.rs"]
mod velocity_many;
#[path = "wild_graphs.rs"]
mod wild_graphs;
