//! `fabrig bench runtime`: what a frame costs, and how the cost grows with the cloth.

use std::sync::Arc;

use anyhow::{Context, Result};
use fabrig_core::cloth::ClothOptions;
use fabrig_core::cloth::bench::{BenchScene, run as run_cloth};
use fabrig_core::collision::PairMask;
use fabrig_core::motion::{self, Clip, ReadOptions};
use fabrig_core::pipeline::{AnimateOptions, TimeStatistics, animate};
use fabrig_core::rig::Rig;
use fabrig_core::scene::Scene;
use serde::Serialize;

use super::demo_scene;
use crate::cli::BenchRuntimeArgs;
use crate::commands::Outcome;
use crate::console::Console;

/// A take with one shape: the jaw opens and shuts.
const SIMPLE_TAKE: &str = "fabrig-keys 1\n0 jawOpen=0\n0.5 jawOpen=0.8\n1 jawOpen=0\n1.5 jawOpen=0.8\n\
                           2 jawOpen=0\n";

/// Nodes along a grid line against the default's, for about 2,000, 19,380, 50,000 and 200,000
/// nodes.
const SCALES: [f64; 4] = [0.32, 1.0, 1.606, 3.21];

/// Frames a second of the four rows of the paper's Table 1, in its order.
const PAPER_FPS: [f64; 4] = [37.3, 32.9, 35.3, 29.7];

const CONTACTS: [(&str, PairMask); 3] = [
    ("none", PairMask::None),
    ("sphincter", PairMask::Sphincter),
    ("all", PairMask::All),
];

/// One row of the grid of the paper's Table 1.
#[derive(Debug, Serialize)]
struct FaceRow {
    take: &'static str,
    contact: &'static str,
    threads: usize,
    nodes: usize,
    vertices: usize,
    /// Muscle shapes and cloth. (ms)
    simulation: TimeStatistics,
    /// And the skin. (ms)
    with_skin: TimeStatistics,
    /// And what recording takes of the simulating thread. (ms)
    with_recording: TimeStatistics,
    /// Median time with skin, against that without contact.
    against_none: f64,
    /// Frames a second that the median time with skin is.
    fps: f64,
    /// Median counts of a frame.
    candidates: usize,
    contacts: usize,
}

/// The cloth alone at one size.
#[derive(Debug, Serialize)]
struct SizeRow {
    nodes: usize,
    threads: usize,
    frame: TimeStatistics,
    /// The quickest frame, which other work on the machine has disturbed least. (ms)
    least_ms: f64,
    /// Of the quickest frame.
    microseconds_per_node: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    processor: String,
    /// Frames a second of the paper's four rows.
    paper_fps: [f64; 4],
    faces: Vec<FaceRow>,
    sizes: Vec<SizeRow>,
    /// Largest over least time per node, by thread count.
    growth: Vec<(usize, f64)>,
}

pub(crate) fn run(console: &Console, args: &BenchRuntimeArgs) -> Result<Outcome> {
    let rig = demo_scene::demo_rig(console)?;
    let simple = motion::parse(SIMPLE_TAKE, "the jaw", &ReadOptions::default())?;
    let takes = [("simple", simple), ("complex", demo_scene::take()?)];
    let mut report = Report {
        processor: processor(),
        paper_fps: PAPER_FPS,
        faces: Vec::new(),
        sizes: Vec::new(),
        growth: Vec::new(),
    };
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .context("cannot start threads")?;
        for (name, clip) in &takes {
            let mut none = None;
            for contact in CONTACTS {
                let mut row =
                    pool.install(|| face(console, &rig, (name, clip), contact, threads))?;
                row.against_none = row.with_skin.median / *none.get_or_insert(row.with_skin.median);
                report.faces.push(row);
                if console.is_stopped() {
                    return Ok(Outcome::Partial);
                }
            }
        }
        for scale in SCALES {
            let scene = BenchScene::sized(scale, true, args.frames as usize);
            let result = pool
                .install(|| run_cloth(&scene, &ClothOptions::default(), scene.frames.len(), 0))?;
            let least_ms = result.quantile_ms(0.0);
            report.sizes.push(SizeRow {
                nodes: scene.node_count(),
                threads,
                microseconds_per_node: least_ms * 1e3 / scene.node_count() as f64,
                frame: TimeStatistics::of(result.frame_ms),
                least_ms,
            });
            console.note(&format!("{} nodes, {threads} threads", scene.node_count()));
        }
        let per_node: Vec<f64> = report
            .sizes
            .iter()
            .filter(|row| row.threads == threads)
            .map(|row| row.microseconds_per_node)
            .collect();
        let most = per_node.iter().copied().fold(0.0, f64::max);
        let least = per_node.iter().copied().fold(f64::INFINITY, f64::min);
        report.growth.push((threads, most / least));
    }
    console.clear();
    if args.json {
        console.result(&serde_json::to_string_pretty(&report)?);
    } else {
        print(console, &report);
    }
    Ok(Outcome::Done)
}

/// Simulates and records a take, into a file that is thrown away.
fn face(
    console: &Console,
    rig: &Arc<Rig>,
    (take, clip): (&'static str, &Clip),
    (contact, pairs): (&'static str, PairMask),
    threads: usize,
) -> Result<FaceRow> {
    let folder = std::env::temp_dir().join(format!("fabrig-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let path = folder.join("bench.mcap");
    let (mut simulation, mut with_skin) = (Vec::new(), Vec::new());
    let options = AnimateOptions {
        fps: Some(demo_scene::FPS),
        ..AnimateOptions::default()
    };
    let mut scene = Scene::default();
    scene.contact.pairs = pairs;
    let result = animate(
        Arc::clone(rig),
        clip.clone(),
        scene,
        &path,
        &options,
        &mut |at| {
            let cloth = at.last.targets_ms + at.last.cloth_ms;
            simulation.push(cloth);
            with_skin.push(cloth + at.last.skin_ms);
            console.show("simulating", at.frame, at.frame_count, take)
        },
    );
    // What cannot be removed from a temporary folder does no harm there.
    let _ = std::fs::remove_dir_all(&folder);
    let result = result?;
    let skin = TimeStatistics::of(with_skin);
    let recording = &result.recording_ms;
    Ok(FaceRow {
        take,
        contact,
        against_none: 1.0,
        fps: 1e3 / skin.median,
        candidates: result.contact.as_ref().map_or(0, |c| c.candidates_median),
        contacts: result.contact.as_ref().map_or(0, |c| c.contacts_median),
        threads,
        nodes: result.node_count,
        vertices: result.vertex_count,
        simulation: TimeStatistics::of(simulation),
        with_recording: TimeStatistics {
            median: skin.median + recording.median,
            p95: skin.p95 + recording.p95,
            p99: skin.p99 + recording.p99,
            max: skin.max + recording.max,
            total: skin.total + recording.total,
        },
        with_skin: skin,
    })
}

/// The processor's name and its count of cores that may be used.
fn processor() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let name = std::fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            text.lines()
                .find_map(|line| line.strip_prefix("model name"))
                .map(|rest| rest.trim_start_matches([' ', '\t', ':']).to_owned())
        })
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    format!("{name}, {cores} cores")
}

fn print(console: &Console, report: &Report) {
    console.result(&report.processor);
    console.result(&format!(
        "{:<9}{:<11}{:>7}  {:<24}{:<24}{:<24}{:>7}{:>8}{:>11}{:>9}",
        "take",
        "contact",
        "threads",
        "simulation [ms]",
        "+ skin",
        "+ recording",
        "fps",
        "x none",
        "candidates",
        "contacts"
    ));
    let times = |t: &TimeStatistics| format!("{:.2} / {:.2} / {:.2}", t.median, t.p95, t.p99);
    for row in &report.faces {
        console.result(&format!(
            "{:<9}{:<11}{:>7}  {:<24}{:<24}{:<24}{:>7.1}{:>8.2}{:>11}{:>9}",
            row.take,
            row.contact,
            row.threads,
            times(&row.simulation),
            times(&row.with_skin),
            times(&row.with_recording),
            row.fps,
            row.against_none,
            row.candidates,
            row.contacts
        ));
    }
    console.result(&format!(
        "median / 95 % / 99 %; frames a second are of the median with skin; the paper's four rows \
         of the same size: {} fps",
        PAPER_FPS.map(|fps| fps.to_string()).join(", ")
    ));
    console.result(
        "the cloth alone, with pairs and a shaking head; time per node of the quickest frame:",
    );
    console.result(&format!(
        "{:>8}{:>9}  {:<26}{:>9}{:>12}",
        "nodes", "threads", "frame [ms]", "least", "us per node"
    ));
    for row in &report.sizes {
        console.result(&format!(
            "{:>8}{:>9}  {:<26}{:>9.3}{:>12.4}",
            row.nodes,
            row.threads,
            times(&row.frame),
            row.least_ms,
            row.microseconds_per_node
        ));
    }
    for (threads, growth) in &report.growth {
        console.result(&format!(
            "{threads} threads: the dearest node costs {growth:.2} times the cheapest"
        ));
    }
}
