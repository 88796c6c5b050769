//! `fabrig bench table3`: how near rigs come to faces' own expressions.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use fabrig_core::evaluation::{
    Drive, METHODS, OwnFace, POSES, Table3, Table3Error, evaluate_face, synthetic_faces,
};
use fabrig_core::mesh::io::read_mesh;
use fabrig_core::pipeline::{neutral_of_shapes, read_own_shapes};
use fabrig_core::template::{self, Template};

use super::table3_page::{self, FITTED, Loss};
use crate::cli::BenchTable3Args;
use crate::commands::html::write_page;
use crate::commands::{Outcome, check_output};
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &BenchTable3Args) -> Result<Outcome> {
    if let Some(path) = &args.html {
        check_output(path)?;
    }
    let template = template::human();
    let faces = if args.folders.is_empty() {
        synthetic_faces(template, &args.filter)?
    } else {
        let read = |folder: &Path| read_face(console, folder, template);
        args.folders
            .iter()
            .map(|f| read(f))
            .collect::<Result<_>>()?
    };
    anyhow::ensure!(
        !faces.is_empty(),
        "no bundled face has '{}' in its name",
        args.filter
    );
    let mut table = Table3::default();
    let total = (faces.len() * METHODS.len()) as u64;
    let mut done = 0;
    let mut is_stopped = false;
    for face in &faces {
        let result = evaluate_face(face, template, &METHODS, &mut |method| {
            done += 1;
            console.show(&face.name, done, total, method.name)
        });
        match result {
            Ok(result) => table.faces.push(result),
            Err(Table3Error::Stopped) => {
                is_stopped = true;
                break;
            }
            Err(error) => table.refused.push((face.name.clone(), error.to_string())),
        }
    }
    console.clear();
    if let Some(path) = &args.html {
        write_page(path, &table3_page::page(console, &faces, &table)?)?;
    }
    if args.json {
        console.result(&serde_json::to_string_pretty(&table)?);
    } else {
        print_table(console, &table);
    }
    Ok(if is_stopped {
        Outcome::Partial
    } else {
        Outcome::Done
    })
}

fn read_face(console: &Console, source: &Path, template: &Template) -> Result<OwnFace> {
    let path = neutral_of_shapes(source)?.ok_or_else(|| {
        anyhow!(
            "{}: a folder needs one mesh with 'neutral' in its name",
            source.display()
        )
    })?;
    let neutral = read_mesh(&path)?;
    let own = read_own_shapes(source, &neutral, template)
        .and_then(|own| own.without_scans(&neutral))
        .with_context(|| format!("shapes of {}", path.display()))?;
    for (path, reason) in &own.skipped {
        console.note(&format!("{} passed over: {reason}", path.display()));
    }
    Ok(OwnFace {
        name: source.file_name().map_or_else(
            || source.display().to_string(),
            |name| name.to_string_lossy().into_owned(),
        ),
        is_synthetic: false,
        neutral,
        expressions: own.expressions,
    })
}

fn print_table(console: &Console, table: &Table3) {
    let yardstick = METHODS[0].name;
    for (drive, name) in [
        (Drive::Units, "weights of the pose"),
        (Drive::BestFit, "best fit"),
    ] {
        let mut line = format!("{name:<24}");
        for pose in POSES {
            line += &format!("{:>20}", pose.name);
        }
        console.result(&(line + &format!("{:>16}{:>12}", "all", "to delta")));
        for method in METHODS {
            let mut line = format!("{:<24}", method.name);
            for pose in POSES {
                let [mean, deviation] = table.over_faces(method.name, Some(pose.name), drive);
                line += &format!("{:>20}", format!("{mean:.3} +- {deviation:.3}"));
            }
            let [mean, deviation] = table.over_faces(method.name, None, drive);
            let [delta, _] = table.over_faces(yardstick, None, drive);
            line += &format!("{:>16}", format!("{mean:.3} +- {deviation:.3}"));
            line += &format!("{:>11.0}%", 100.0 * (mean / delta - 1.0));
            console.result(&line);
        }
        console.result("");
    }
    let mut line = format!("{:<24}", "mean by face [mm]");
    for method in METHODS {
        line += &format!("{:>22}", method.name);
    }
    console.result(&line);
    for face in &table.faces {
        let mut line = format!("{:<24}", face.face);
        for method in METHODS {
            let mean = face
                .mean(method.name, None, Drive::Units)
                .unwrap_or_default();
            line += &format!("{mean:>22.3}");
        }
        console.result(&line);
    }
    print_losses(console, table);
    for (face, reason) in &table.refused {
        console.result(&format!("{face}: {reason}"));
    }
    let synthetic = table.faces.iter().filter(|f| f.is_synthetic).count();
    console.result(&format!(
        "{} faces, {synthetic} of them synthetic; mean +- standard deviation over faces of the mean \
         distance [mm] from the face's own pose",
        table.faces.len()
    ));
}

/// Where the paper's way, an amplitude a patch fitted to the face's shapes, loses to delta
/// transfer, and why, face by face.
fn print_losses(console: &Console, table: &Table3) {
    console.result("");
    console.result(&format!("where '{FITTED}' loses to '{}'", METHODS[0].name));
    for face in &table.faces {
        for pose in POSES {
            if let Some(loss) = Loss::of(face, FITTED, pose.name) {
                console.result(&format!("{:<24}{:<18}{loss}", face.face, pose.name));
            }
        }
    }
    console.result("");
}
