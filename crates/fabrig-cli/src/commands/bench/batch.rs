//! `fabrig bench batch`: the same work with one worker and with several.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use fabrig_core::batch::{
    BatchReport, BenchWork, Manifest, Plan, PlanOptions, RunOptions, run as run_plan,
    write_bench_work,
};
use serde::Serialize;

use crate::cli::{BenchBatchArgs, BenchOutput};
use crate::commands::Outcome;
use crate::commands::batch::show;
use crate::console::Console;

/// One run of the whole work.
#[derive(Debug, Serialize)]
struct Row {
    workers: usize,
    wall_secs: f64,
    worker_secs: f64,
    simulated_secs: f64,
    /// Simulated seconds per second.
    throughput: f64,
    /// Times quicker than the first row.
    speedup: f64,
    /// Whether every output has the bytes of the first row's.
    is_equal: bool,
    peak_memory_bytes: Option<u64>,
}

#[derive(Debug, Serialize)]
struct Report {
    faces: u32,
    clips: u32,
    clip_secs: f64,
    outputs: Vec<String>,
    substeps: u32,
    processors: usize,
    rows: Vec<Row>,
    /// A second run over finished work. (s)
    nothing_to_do_secs: f64,
}

pub(crate) fn run(console: &Console, args: &BenchBatchArgs) -> Result<Outcome> {
    ensure!(
        args.seconds > 0.0 && args.seconds <= 12.0,
        "--seconds must be above 0 and at most 12, the length of the bundled take"
    );
    let outputs = args.outputs.iter().map(|output| match output {
        BenchOutput::Dataset => "path = \"{face}/{take}.npz\"\ncontent = \"dataset\"",
        BenchOutput::Recording => "path = \"{face}/{take}.mcap\"",
    });
    let outputs: Vec<&str> = outputs.collect();
    let work = BenchWork {
        faces: args.faces as usize,
        clips: args.clips as usize,
        seconds: args.seconds,
        outputs: &outputs,
    };
    if let Some(folder) = &args.write {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
        let manifest = write_bench_work(folder, &work)?;
        console.result(&manifest.display().to_string());
        return Ok(Outcome::Done);
    }
    let folder = tempfile::tempdir().context("no temporary folder")?;
    let manifest = write_bench_work(folder.path(), &work)?;
    let mut report = Report {
        faces: args.faces,
        clips: args.clips,
        clip_secs: args.seconds,
        outputs: outputs
            .iter()
            .map(|output| output.replace('\n', ", "))
            .collect(),
        substeps: 0,
        processors: std::thread::available_parallelism().map_or(1, usize::from),
        rows: Vec::new(),
        nothing_to_do_secs: 0.0,
    };
    let mut first: Option<BTreeMap<String, String>> = None;
    for &workers in &args.workers {
        let out = folder.path().join(format!("out_{workers}"));
        let Some(done) = run_once(console, &manifest, &out, workers)? else {
            return Ok(Outcome::Partial);
        };
        let hashes: BTreeMap<String, String> = done
            .pairs
            .iter()
            .map(|pair| (pair.output.clone(), pair.sha256.clone()))
            .collect();
        let is_equal = *first.get_or_insert_with(|| hashes.clone()) == hashes;
        report.substeps = done.accuracy.first().map_or(0, |row| row.substeps);
        let base = report
            .rows
            .first()
            .map_or(done.run.wall_secs, |row: &Row| row.wall_secs);
        report.rows.push(Row {
            workers: done.run.workers,
            wall_secs: done.run.wall_secs,
            worker_secs: done.worker_secs,
            simulated_secs: done.simulated_secs,
            throughput: done.throughput.unwrap_or_default(),
            speedup: base / done.run.wall_secs,
            is_equal,
            peak_memory_bytes: done.run.peak_memory_bytes,
        });
        let Some(again) = run_once(console, &manifest, &out, workers)? else {
            return Ok(Outcome::Partial);
        };
        ensure!(
            again.counts.up_to_date == again.counts.jobs,
            "finished work was done again"
        );
        report.nothing_to_do_secs = again.run.wall_secs;
        // Room for the next.
        std::fs::remove_dir_all(&out).context("cannot take a finished run away")?;
    }
    if args.json {
        console.result(&serde_json::to_string_pretty(&report)?);
    } else {
        print_table(console, &report);
    }
    ensure!(
        report.rows.iter().all(|row| row.is_equal),
        "outputs differ between runs"
    );
    Ok(Outcome::Done)
}

/// `None` where it was stopped.
fn run_once(
    console: &Console,
    manifest: &Path,
    out: &Path,
    workers: u32,
) -> Result<Option<BatchReport>> {
    let plan = Plan::new(Manifest::read(manifest)?, out, &PlanOptions::default())?;
    let options = RunOptions {
        workers: workers as usize,
        threads: 1,
    };
    let report = run_plan(&plan, &options, &mut |now| show(console, now));
    console.clear();
    let report = report?;
    if report.counts.stopped > 0 {
        return Ok(None);
    }
    if let Some(row) = report.failures.first() {
        anyhow::bail!("{}: {}", row.failure.subject, row.failure.message);
    }
    Ok(Some(report))
}

fn print_table(console: &Console, report: &Report) {
    console.result(&format!(
        "{} faces x {} clips of {} s, {} substeps per 1/60 s, {} processors; {}",
        report.faces,
        report.clips,
        report.clip_secs,
        report.substeps,
        report.processors,
        report.outputs.join("; ")
    ));
    console.result(&format!(
        "{:<10}{:>9}{:>12}{:>13}{:>18}{:>10}{:>9}{:>10}",
        "workers",
        "s",
        "of workers",
        "simulated s",
        "simulated s per s",
        "speedup",
        "bytes",
        "peak GB"
    ));
    for row in &report.rows {
        let memory = row
            .peak_memory_bytes
            .map_or("-".to_owned(), |b| format!("{:.2}", b as f64 / 1e9));
        console.result(&format!(
            "{:<10}{:>9.1}{:>12.1}{:>13.1}{:>18.2}{:>10.2}{:>9}{memory:>10}",
            row.workers,
            row.wall_secs,
            row.worker_secs,
            row.simulated_secs,
            row.throughput,
            row.speedup,
            if row.is_equal { "equal" } else { "differ" },
        ));
    }
    console.result(&format!(
        "a run with nothing left to do: {:.2} s",
        report.nothing_to_do_secs
    ));
}
