//! Work to measure a batch with: bundled people, and clips of the bundled take.

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::atomic_file::write_atomically;
use crate::mesh::io::{MeshIoError, write_obj};
use crate::registration::bench::Specimen;
use crate::template::{demo_take, human, people};

/// How much work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BenchWork<'a> {
    /// Faces, of the people bundled and the template's own; they begin again from the first where
    /// there are too few, a little larger each time.
    pub faces: usize,
    /// Clips, one after the other from the take's start, from the start again at its end.
    pub clips: usize,
    /// Length of a clip. (s)
    pub seconds: f64,
    /// Outputs as the manifest has them: `path = "{face}/{take}.mcap"`.
    pub outputs: &'a [&'a str],
}

/// Length of the bundled take. (s)
const TAKE_SECONDS: f64 = 12.0;
/// A face of the second round is this much larger than its first.
const GROWTH: f64 = 0.02;

/// Writes faces, take and manifest to a folder, which must be there; returns the manifest.
///
/// # Errors
///
/// [`Error::MeshIo`].
pub fn write_bench_work(folder: &Path, work: &BenchWork<'_>) -> Result<PathBuf, Error> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source: io::Error| MeshIoError::Write { path, source }
    };
    let faces = folder.join("faces");
    std::fs::create_dir_all(&faces).map_err(failed(&faces))?;
    let mut manifest = String::from("# Bundled people, and clips of the bundled take.\n\n");
    let everyone = people().len() + 1;
    for index in 0..work.faces {
        let round = index / everyone;
        let (name, specimen) = match people().get(index % everyone) {
            Some(person) => (person.name.as_str(), Specimen::person(human(), person)),
            None => ("template", Specimen::template(human())),
        };
        let name = match round {
            0 => name.to_owned(),
            round => format!("{name}_{round}"),
        };
        let scale = 1.0 + GROWTH * round as f64;
        let specimen = specimen.moved(|p| p * scale);
        let mesh = specimen.with_parts(human()).mesh()?;
        write_obj(faces.join(format!("{name}.obj")), &mesh)?;
        // Writing to a string does not fail.
        let _ = writeln!(manifest, "[[faces]]\nfile = \"faces/{name}.obj\"\n");
    }
    let take = folder.join("take.keys");
    write_atomically(&take, |file| file.write_all(demo_take().as_bytes()))
        .map_err(failed(&take))?;
    let rounds = (TAKE_SECONDS / work.seconds).floor().max(1.0) as usize;
    for clip in 0..work.clips {
        let from = work.seconds * (clip % rounds) as f64;
        let to = (from + work.seconds).min(TAKE_SECONDS);
        let _ = writeln!(
            manifest,
            "[[takes]]\nfile = \"take.keys\"\nname = \"clip_{clip}\"\nfrom = {from:?}\nto = {to:?}\n"
        );
    }
    for output in work.outputs {
        let _ = writeln!(manifest, "[[outputs]]\n{output}\n");
    }
    let path = folder.join("work.toml");
    write_atomically(&path, |file| file.write_all(manifest.as_bytes())).map_err(failed(&path))?;
    Ok(path)
}
