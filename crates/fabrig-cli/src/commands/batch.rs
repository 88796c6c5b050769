//! `fabrig batch`: a manifest's faces times its takes, on this machine.

use std::ops::ControlFlow;

use anyhow::{Context, Result};
use fabrig_core::batch::{
    BatchReport, Ending, Manifest, Plan, PlanOptions, RunOptions, RunProgress, Standing,
    run as run_plan, run_single,
};

use super::{Outcome, batch_page, check_output};
use crate::cli::BatchArgs;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &BatchArgs) -> Result<Outcome> {
    if let Some(page) = &args.report {
        check_output(page)?;
    }
    let manifest = Manifest::read(&args.manifest)?;
    let options = PlanOptions {
        only: args.only.clone(),
        verify: args.verify,
    };
    let plan = Plan::new(manifest, &args.output, &options)
        .with_context(|| format!("{} cannot be planned", args.manifest.display()))?;
    if args.dry_run {
        return dry_run(console, &plan, args.json);
    }
    if let Some(output) = &args.job {
        return single(console, &plan, output, args);
    }
    let options = RunOptions {
        workers: args.jobs.unwrap_or(0) as usize,
        threads: args.threads as usize,
    };
    let report = run_plan(&plan, &options, &mut |now| show(console, now));
    console.clear();
    let report = report?;
    if args.json {
        console.result(&serde_json::to_string_pretty(&report)?);
    } else {
        print_report(console, &report);
    }
    if let Some(page) = &args.report {
        batch_page::write(console, page, &report)?;
    }
    if report.counts.stopped > 0 {
        console.note("stopped; the same command goes on from here");
    }
    Ok(if report.is_complete {
        Outcome::Done
    } else {
        Outcome::Partial
    })
}

/// A bar over all jobs, with what is being made and how long the rest will take.
pub(super) fn show(console: &Console, now: &RunProgress) -> ControlFlow<()> {
    const STEPS: f64 = 1000.0;
    let begun: f64 = now.running.iter().map(|(_, share)| share).sum();
    let share = (now.ended as f64 + begun) / now.total.max(1) as f64;
    let left = match now.remaining_secs {
        Some(seconds) => format!("about {} left", duration(seconds)),
        None => "no telling yet how long".to_owned(),
    };
    let missing = match now.without_result {
        0 => String::new(),
        count => format!(", {count} without result"),
    };
    let detail = format!("{}/{} jobs{missing}, {left}", now.ended, now.total);
    console.show_with("batch", (STEPS * share) as u64, STEPS as u64, &detail)
}

fn duration(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
    }
}

fn dry_run(console: &Console, plan: &Plan, as_json: bool) -> Result<Outcome> {
    let standing = |standing: &Standing| match standing {
        Standing::UpToDate(_) => ("up to date", String::new()),
        Standing::Missing => ("missing", String::new()),
        Standing::Changed => ("changed", String::new()),
        Standing::Lost(failure) => ("lost", failure.message.clone()),
    };
    let mut is_lost = false;
    let mut rows = Vec::new();
    for planned in &plan.jobs {
        let (word, reason) = standing(&planned.standing);
        is_lost |= word == "lost";
        rows.push(serde_json::json!({
            "output": planned.job.output, "stage": planned.job.stage, "standing": word,
            "reason": reason, "key": planned.job.key, "needs": planned.job.needs,
        }));
        if !as_json {
            let line = format!(
                "{word:<12}{:<10}{}",
                planned.job.stage.name(),
                planned.job.output
            );
            let reason = if reason.is_empty() {
                reason
            } else {
                format!("  {reason}")
            };
            console.result(&format!("{line}{reason}"));
        }
    }
    if as_json {
        console.result(&serde_json::to_string_pretty(&rows)?);
    } else {
        let to_run = plan
            .jobs
            .iter()
            .filter(|planned| planned.is_to_run())
            .count();
        console.result(&format!(
            "{to_run} of {} jobs would be done",
            plan.jobs.len()
        ));
    }
    Ok(if is_lost {
        Outcome::Partial
    } else {
        Outcome::Done
    })
}

fn single(console: &Console, plan: &Plan, output: &str, args: &BatchArgs) -> Result<Outcome> {
    let outcome = run_single(plan, output, args.threads as usize, &mut |share| {
        console.share("job", share)
    });
    console.clear();
    let outcome = outcome?;
    if args.json {
        console.result(&serde_json::to_string_pretty(&outcome)?);
    }
    let (word, is_there) = match &outcome.ending {
        Ending::Done(_) => ("made".to_owned(), true),
        Ending::UpToDate(_) => ("up to date".to_owned(), true),
        Ending::Failed(failure) | Ending::Lost(failure) => (failure.message.clone(), false),
        Ending::Stopped => ("stopped".to_owned(), false),
    };
    if !args.json {
        console.result(&format!("{output:<20}  {word}, {:.2} s", outcome.seconds));
    }
    Ok(if is_there {
        Outcome::Done
    } else {
        Outcome::Partial
    })
}

/// What a run did, for people.
pub(super) fn print_report(console: &Console, report: &BatchReport) {
    let line = |name: &str, value: String| console.result(&format!("{name:<20}{value}"));
    for row in &report.stages {
        let counts = &row.counts;
        line(
            row.stage.name(),
            format!(
                "{} made, {} up to date, {} failed, {} lost, {} stopped; {:.1} s of workers",
                counts.done,
                counts.up_to_date,
                counts.failed,
                counts.lost,
                counts.stopped,
                row.seconds
            ),
        );
    }
    for face in &report.faces {
        if let Some([median, p95, max]) = face.template_to_face_mm {
            line(
                &face.face,
                format!(
                    "template to face {median:.2} / {p95:.2} / {max:.2} mm (median, 95 %, largest), {} \
                     folds, {} of {} outputs",
                    face.folded_triangles.unwrap_or(0),
                    face.outputs[0],
                    face.outputs[1]
                ),
            );
        }
        for note in &face.notes {
            line("", format!("{}: {note}", face.face));
        }
    }
    let settled = report.pairs.iter().filter_map(|pair| pair.settle_rms_max);
    if let Some(worst) = settled.reduce(f64::max) {
        let guards: u64 = report.pairs.iter().filter_map(|pair| pair.guards).sum();
        line(
            "pairs",
            format!(
                "{} there; at most {worst:.2} mm rms from muscle shapes in a frame, guards acted \
                 {guards} times",
                report.pairs.len()
            ),
        );
    }
    for row in &report.accuracy {
        let rate = row
            .fps
            .map_or("the takes' own frame rate".to_owned(), |fps| {
                format!("{fps} frames/s")
            });
        let cloth = if row.has_dynamics {
            format!("{} substeps per 1/60 s", row.substeps)
        } else {
            "without dynamics".to_owned()
        };
        line("scene", format!("{}: {cloth}, {rate}", row.scene));
    }
    let run = &report.run;
    let throughput = report.throughput.map_or(String::new(), |rate| {
        format!(
            ", {:.1} s simulated: {rate:.2} simulated seconds per second",
            report.simulated_secs
        )
    });
    let memory = run.peak_memory_bytes.map_or(String::new(), |bytes| {
        format!(", {:.2} GB at most", bytes as f64 / 1e9)
    });
    line(
        "time",
        format!(
            "{:.1} s, {} at a time ({:.1} s of workers){throughput}{memory}",
            run.wall_secs, run.workers, report.worker_secs
        ),
    );
    for row in &report.failures {
        line(
            "error",
            format!(
                "{}: {} ({} outputs)",
                row.failure.subject,
                row.failure.message,
                row.outputs.len()
            ),
        );
    }
    for note in &report.notes {
        line("note", note.clone());
    }
    let counts = &report.counts;
    line(
        "result",
        if report.is_complete {
            format!(
                "all {} outputs are in {}",
                counts.jobs,
                report.out.display()
            )
        } else {
            format!(
                "{} of {} outputs are in {}",
                counts.done + counts.up_to_date,
                counts.jobs,
                report.out.display()
            )
        },
    );
}
