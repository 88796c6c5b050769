//! `fabrig edit`: single muscles of a rig, out and in again.

use std::path::Path;

use anyhow::{Context, Result};
use fabrig_core::edit::{
    Edits, edits_path, export_muscle_shape, import_muscle_shape, muscle_shape_names,
};
use fabrig_core::mesh::io::{read_mesh, write_obj};
use fabrig_core::rig::Rig;
use serde_json::json;

use super::animate::{load_rig, load_unedited_rig};
use super::{Outcome, check_output};
use crate::cli::EditCommand;
use crate::console::Console;

pub(crate) fn run(console: &Console, command: &EditCommand) -> Result<Outcome> {
    match command {
        EditCommand::List { rig, json } => list(console, rig, *json)?,
        EditCommand::Export { rig, shape, output } => {
            check_output(output)?;
            let mut edits = edits_beside(rig)?;
            // Strength and weight stay in the text; the mesh is the shape itself.
            if let Some(edit) = edits.shapes.get_mut(shape) {
                edit.strength = None;
                edit.weight = None;
            }
            let edited = with_edits(rig, &edits)?;
            write_obj(output, &export_muscle_shape(&edited, shape)?)?;
            console.result(&format!("{:<20}{}", "muscle shape", output.display()));
        }
        EditCommand::Import { rig, shape, mesh } => {
            let mut edits = edits_beside(rig)?;
            let mut others = edits.clone();
            others.shapes.remove(shape);
            let base = with_edits(rig, &others)?;
            let moved = import_muscle_shape(&base, shape, &read_mesh(mesh)?, &mut edits)?;
            let path = edits_path(rig);
            edits.save(&path)?;
            console.result(&format!("{:<20}{moved} nodes moved", shape));
            console.result(&format!("{:<20}{}", "edits", path.display()));
        }
    }
    Ok(Outcome::Done)
}

fn edits_beside(rig: &Path) -> Result<Edits> {
    let edits = Edits::beside(rig);
    let edits = edits.with_context(|| format!("{} cannot be used", edits_path(rig).display()))?;
    Ok(edits.unwrap_or_default())
}

fn with_edits(path: &Path, edits: &Edits) -> Result<Rig> {
    let mut rig = load_unedited_rig(path)?;
    edits.apply(&mut rig)?;
    Ok(rig)
}

fn list(console: &Console, path: &Path, as_json: bool) -> Result<()> {
    let rig = load_rig(path)?;
    let edits = edits_beside(path)?;
    if as_json {
        let facts = json!({ "muscle_shapes": muscle_shape_names(&rig), "edits": edits });
        console.result(&serde_json::to_string_pretty(&facts)?);
        return Ok(());
    }
    for patch in &rig.patches {
        let name = &patch.patch.chart.name;
        let shapes = patch.transfer.shapes.iter();
        let names = shapes.map(|s| s.name.rsplit('.').next().unwrap_or_default());
        console.result(&format!("{name}: {}", names.collect::<Vec<_>>().join(" ")));
    }
    if !edits.is_empty() {
        console.result("");
        console.result(edits.to_text()?.trim_end());
    }
    Ok(())
}
