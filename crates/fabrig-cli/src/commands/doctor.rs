//! `fabrig doctor`: what this build and machine can do, each tried rather than asked.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};
use fabrig_core::atomic_file::write_atomically;
use fabrig_core::machine::instruction_set;
use fabrig_core::motion::parse_keys;
use fabrig_core::pipeline::{AnimateOptions, animate};
use fabrig_core::recording::RecordingReader;
use fabrig_core::rig::{FORMAT_VERSION, OLDEST_VERSION, RigOptions, rig_of_template};
use fabrig_core::scene::Scene;
use fabrig_core::template::human;
use serde::Serialize;

use super::Outcome;
use crate::cli::DoctorArgs;
use crate::console::Console;

/// Half a second in which the jaw opens.
const TAKE: &str = "fabrig-keys 1\nfps 60\n0 jawOpen=0\n0.5 jawOpen=0.5\n";

/// What was found.
#[derive(Debug, Serialize)]
struct Findings {
    version: &'static str,
    target: String,
    features: Vec<&'static str>,
    instructions: &'static str,
    processors: usize,
    threads: usize,
    template: Template,
    rig_file_versions: [u32; 2],
    /// Simulating and recording half a second of the template, and reading it back.
    simulation: Trial,
    /// Writing a file where the command runs.
    writing: Trial,
    /// Rerun's program, which `fabrig convert --to rrd` needs.
    rerun: Option<String>,
}

#[derive(Debug, Serialize)]
struct Template {
    name: String,
    version: u32,
    vertices: usize,
    shapes: usize,
    patches: usize,
    nodes: usize,
}

/// Something that was tried.
#[derive(Debug, Serialize)]
struct Trial {
    works: bool,
    /// What it came to, or what is wrong.
    says: String,
}

impl Trial {
    fn of(tried: Result<String>) -> Self {
        match tried {
            Ok(says) => Self { works: true, says },
            Err(error) => Self {
                works: false,
                says: format!("{error:#}"),
            },
        }
    }
}

pub(crate) fn run(console: &Console, args: &DoctorArgs) -> Result<Outcome> {
    let findings = examine()?;
    if args.json {
        console.result(&serde_json::to_string_pretty(&findings)?);
    } else {
        print(console, &findings);
    }
    let is_well = findings.simulation.works && findings.writing.works;
    Ok(if is_well {
        Outcome::Done
    } else {
        Outcome::Partial
    })
}

fn examine() -> Result<Findings> {
    let template = human();
    let rig = rig_of_template(template, &RigOptions::default())
        .context("the bundled template makes no rig")?;
    let nodes = rig.patches.iter().map(|p| p.patch.neutral.len()).sum();
    let patches = rig.patches.len();
    Ok(Findings {
        version: env!("CARGO_PKG_VERSION"),
        target: format!("{} {}", std::env::consts::ARCH, std::env::consts::OS),
        features: features(),
        instructions: instruction_set(),
        processors: std::thread::available_parallelism().map_or(1, usize::from),
        threads: rayon::current_num_threads(),
        template: Template {
            name: template.name.clone(),
            version: template.version,
            vertices: template.skin.vertex_count(),
            shapes: template.shapes.len(),
            patches,
            nodes,
        },
        rig_file_versions: [OLDEST_VERSION, FORMAT_VERSION],
        simulation: Trial::of(simulate(rig)),
        writing: Trial::of(write_here()),
        rerun: rerun(),
    })
}

fn features() -> Vec<&'static str> {
    let known = [("play", cfg!(feature = "play")), ("render", true)];
    let there = known.into_iter().filter(|(_, is_there)| *is_there);
    there.map(|(name, _)| name).collect()
}

fn simulate(rig: fabrig_core::rig::Rig) -> Result<String> {
    let clip = parse_keys(TAKE, "doctor").context("the take")?;
    let folder = tempfile::tempdir().context("no temporary folder")?;
    let path = folder.path().join("doctor.mcap");
    let options = AnimateOptions::default();
    let clock = Instant::now();
    let report = animate(
        Arc::new(rig),
        clip,
        Scene::default(),
        &path,
        &options,
        &mut |_| std::ops::ControlFlow::Continue(()),
    )?;
    let seconds = clock.elapsed().as_secs_f64();
    let mut reader = RecordingReader::open(&path)?;
    let mut frames = 0;
    while reader.next_frame()?.is_some() {
        frames += 1;
    }
    Ok(format!(
        "{} frames recorded in {seconds:.2} s, median {:.1} ms a frame; {frames} meshes read back",
        report.frames, report.simulation_ms.median
    ))
}

fn write_here() -> Result<String> {
    let folder = std::env::current_dir().context("no current folder")?;
    let made = tempfile::Builder::new()
        .prefix(".fabrig-doctor-")
        .tempdir_in(&folder)
        .with_context(|| format!("{} cannot be written to", folder.display()))?;
    let path = made.path().join("file");
    write_atomically(&path, |file| file.write_all(b"fabrig"))
        .with_context(|| format!("{} cannot be written to", folder.display()))?;
    Ok(format!("files appear whole in {}", folder.display()))
}

fn rerun() -> Option<String> {
    let asked = Command::new("rerun")
        .arg("--version")
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&asked.stdout);
    let first = text.lines().next()?.trim();
    (asked.status.success() && !first.is_empty()).then(|| first.to_owned())
}

fn print(console: &Console, findings: &Findings) {
    let line = |name: &str, value: &str| console.result(&format!("{name:<20}{value}"));
    let trial = |trial: &Trial| {
        let word = if trial.works { "works" } else { "FAILS" };
        format!("{word}: {}", trial.says)
    };
    let template = &findings.template;
    let [oldest, newest] = findings.rig_file_versions;
    line(
        "fabrig",
        &format!("{} for {}", findings.version, findings.target),
    );
    line("features", &findings.features.join(", "));
    line("instructions", findings.instructions);
    line(
        "threads",
        &format!("{} on {} processors", findings.threads, findings.processors),
    );
    line(
        "template",
        &format!(
            "{} {}: {} vertices, {} shapes, {} patches of {} nodes",
            template.name,
            template.version,
            template.vertices,
            template.shapes,
            template.patches,
            template.nodes
        ),
    );
    line("rig files", &format!("versions {oldest} to {newest}"));
    line("simulation", &trial(&findings.simulation));
    line("writing", &trial(&findings.writing));
    line(
        "rerun",
        findings
            .rerun
            .as_deref()
            .unwrap_or("not found: pip install rerun-sdk (for `convert --to rrd`)"),
    );
}
