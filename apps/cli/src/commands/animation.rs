//! What `simulate --animate` writes: a page that shows the machine as it moves.

use halfarrow::{Error, FRAMES_PER_SECOND, Method, Model, Problem, Record, Run, Scene, Simulated, write_whole};

use crate::arguments::Simulate;

/// The run that an animation needs: it records what the picture reads too, and takes results as often as frames are shown
/// where nothing else is asked for. Gives the variables that are recorded for the picture alone.
pub fn filmed(arguments: &Simulate, model: &Model, run: Run) -> Result<(Run, Vec<String>), Problem> {
    if arguments.animate.is_empty() {
        return Ok((run, Vec::new()));
    }
    let pictured = model.pictured()?;
    let every = run.every.unwrap_or_else(|| between_frames(&run));
    let (record, own) = match run.record {
        Record::Default => (Record::Also(pictured.clone()), pictured),
        Record::All => (Record::All, Vec::new()),
        Record::Also(names) => more(names, pictured, Record::Also),
        Record::Names(names) => more(names, pictured, Record::Names),
    };
    Ok((Run { every: Some(every), record, ..run }, own))
}

/// Time between results, so that no more are taken than are shown: whole steps where these are fixed, which stay as they are.
fn between_frames(run: &Run) -> f64 {
    let least = 1.0 / FRAMES_PER_SECOND;
    match (run.method, run.step) {
        (Method::Fixed(_), Some(step)) if step > 0.0 => step * (least / step - 1e-9).ceil().max(1.0),
        _ => least,
    }
}

fn more(names: Vec<String>, pictured: Vec<String>, record: fn(Vec<String>) -> Record) -> (Record, Vec<String>) {
    let own: Vec<String> = pictured.into_iter().filter(|name| !names.contains(name)).collect();
    (record([names, own.clone()].concat()), own)
}

/// The scene of a run, whose trace then keeps only what was asked for beside it.
pub fn scene(
    arguments: &Simulate,
    model: &Model,
    done: &mut Simulated,
    own: &[String],
) -> Result<Option<Scene>, Problem> {
    if arguments.animate.is_empty() || done.trace.samples() == 0 {
        return Ok(None);
    }
    let scene = model.scene(&done.trace)?;
    let own: std::collections::BTreeSet<&str> = own.iter().map(String::as_str).collect();
    done.trace.columns.retain(|column| !own.contains(column.name.as_str()));
    Ok(Some(scene))
}

/// Writes the pages.
pub fn write(arguments: &Simulate, scene: Option<&Scene>) -> Result<(), Error> {
    let Some(scene) = scene else { return Ok(()) };
    let page = scene.page()?;
    arguments.animate.iter().try_for_each(|path| {
        let written = write_whole(path, |out| out.write_all(page.as_bytes()));
        written.map_err(|why| Problem::Unwritable { path: path.clone(), why: why.source.to_string() }.into())
    })
}
