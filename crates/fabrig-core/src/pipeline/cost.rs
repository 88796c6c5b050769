//! What it costs to rig a face of so many vertices, stage by stage, from the file on.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use serde::Serialize;

use super::{RigFaceOptions, rig_face};
use crate::Error;
use crate::mesh::io::{read_mesh, write_obj};
use crate::registration::bench::{Specimen, peak_memory_bytes};
use crate::registration::{RegistrationError, StageTime};
use crate::template::{Template, people};

/// One size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CostRow {
    /// Vertices of the mesh.
    pub vertex_count: usize,
    /// Time of each stage: reading, registration's own stages, building, saving.
    pub times: Vec<StageTime>,
    /// From file to rig file. (s)
    pub seconds: f64,
    /// Largest memory that the process has had so far, where the system tells. (bytes)
    pub peak_memory_bytes: Option<u64>,
}

/// Vertices of the sizes, about: the template's, a quarter and four times it and so on.
const SIZES: [usize; 6] = [1_000, 4_242, 11_000, 67_000, 270_000, 1_070_000];

/// Rigs a person at growing sizes up to `largest` vertices, each through files in `folder`;
/// `each` gets every row as it is measured.
///
/// # Errors
///
/// [`Error`] of any of the stages, [`RegistrationError::Cancelled`] when `each` breaks.
pub fn cost(
    template: &Template,
    largest: usize,
    folder: &Path,
    each: &mut dyn FnMut(&CostRow) -> ControlFlow<()>,
) -> Result<Vec<CostRow>, Error> {
    let person = people().first().map_or_else(
        || Specimen::template(template),
        |p| Specimen::person(template, p),
    );
    let mut rows = Vec::new();
    for size in SIZES.into_iter().filter(|s| *s <= largest) {
        let specimen = match size {
            0..4_000 => person.clone().decimated(size),
            4_000..5_000 => person.clone(),
            5_000..20_000 => person.clone().subdivided(1).decimated(size),
            20_000..100_000 => person.clone().subdivided(2),
            100_000..500_000 => person.clone().subdivided(3),
            _ => person.clone().subdivided(4),
        };
        let (input, output) = (folder.join("face.obj"), folder.join("face.fabrig"));
        write_obj(&input, &specimen.mesh()?)?;
        drop(specimen);
        let clock = Instant::now();
        let face = read_mesh(&input)?;
        let mut times = vec![stage("read", &clock)];
        let rigged = rig_face(&face, template, &RigFaceOptions::default(), &mut |_| {
            ControlFlow::Continue(())
        })?;
        times.extend(rigged.report.times.iter().cloned());
        let saving = Instant::now();
        rigged.rig.save(&output)?;
        times.push(stage("save", &saving));
        let row = CostRow {
            vertex_count: face.vertex_count(),
            times,
            seconds: clock.elapsed().as_secs_f64(),
            peak_memory_bytes: peak_memory_bytes(),
        };
        let stop = each(&row).is_break();
        rows.push(row);
        if stop {
            return Err(RegistrationError::Cancelled { stage: "bench" }.into());
        }
    }
    Ok(rows)
}

fn stage(name: &str, since: &Instant) -> StageTime {
    StageTime {
        stage: name.to_owned(),
        seconds: since.elapsed().as_secs_f64(),
    }
}
