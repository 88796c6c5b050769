//! `fabrig bench registration`: truth and cost of registration.

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use fabrig_core::mesh::io::write_obj;
use fabrig_core::pipeline::{CostRow, cost};
use fabrig_core::registration::bench::{
    Case, CaseResult, Outcome as CaseOutcome, cases, peak_memory_bytes, run_case,
};
use fabrig_core::template;

use crate::cli::BenchRegistrationArgs;
use crate::commands::Outcome;
use crate::console::Console;

pub(crate) fn run(console: &Console, args: &BenchRegistrationArgs) -> Result<Outcome> {
    if args.cost {
        return run_cost(console, args);
    }
    let mut chosen = cases();
    if let Some(text) = &args.filter {
        chosen.retain(|c| c.name.contains(text));
        ensure!(!chosen.is_empty(), "no case has {text:?} in its name");
    }
    chosen.truncate(args.cases.unwrap_or(usize::MAX));
    if let Some(folder) = &args.write {
        return write(console, &chosen, folder);
    }
    if !args.json {
        console.result(&format!(
            "{:<44}{:>9}{:>8}{:>8}{:>8}{:>8}{:>7}{:>6}{:>7}  verdict",
            "case [mm]", "vertices", "vertex", "95 %", "surface", "95 %", "folds", "sure", "s"
        ));
    }
    let mut results = Vec::new();
    for (k, case) in chosen.iter().enumerate() {
        if console
            .show("cases", k as u64, chosen.len() as u64, &case.name)
            .is_break()
        {
            console.clear();
            return Ok(Outcome::Partial);
        }
        let result = run_case(case, template::human())?;
        if !args.json {
            console.result(&line(&result));
        }
        results.push(result);
    }
    console.clear();
    if args.json {
        console.result(&serde_json::to_string_pretty(&results)?);
    } else {
        summarize(console, &results);
    }
    let failed = results.iter().filter(|r| !r.failures.is_empty()).count();
    ensure!(failed == 0, "{failed} of {} cases fail", results.len());
    Ok(Outcome::Done)
}

fn line(result: &CaseResult) -> String {
    let verdict = if result.failures.is_empty() {
        "ok".to_owned()
    } else {
        result.failures.join("; ")
    };
    let start = format!("{:<44}{:>9}", result.name, result.vertex_count);
    match &result.outcome {
        CaseOutcome::Found(found) => format!(
            "{start}{:>8.2}{:>8.2}{:>8.2}{:>8.2}{:>7}{:>6.2}{:>7.2}  {verdict}",
            found.vertex_error.median,
            found.vertex_error.p95,
            found.template_to_face.median,
            found.template_to_face.p95,
            found.folded_triangles,
            found.confidence,
            result.seconds,
        ),
        CaseOutcome::Refused(_) => format!(
            "{start}{:>8}{:>8}{:>8}{:>8}{:>7}{:>6}{:>7.2}  {verdict} (refused)",
            "-", "-", "-", "-", "-", "-", result.seconds
        ),
    }
}

fn summarize(console: &Console, results: &[CaseResult]) {
    let passed = results.iter().filter(|r| r.failures.is_empty()).count();
    let refused = results
        .iter()
        .filter(|r| matches!(r.outcome, CaseOutcome::Refused(_)))
        .count();
    let seconds: f64 = results.iter().map(|r| r.seconds).sum();
    let memory = peak_memory_bytes().map_or(String::new(), |bytes| {
        format!(", {:.2} GB at most", bytes as f64 / 1e9)
    });
    console.result(&format!(
        "{passed} of {} cases pass, {refused} refused, {seconds:.1} s{memory}",
        results.len()
    ));
    console.result(
        "people come from the template's own source: the whole ones that they are made of are held \
         out of its identity modes, local targets are shared",
    );
}

/// The mesh of each case as `<name>.obj` and its truth as `<name>.truth.obj`: the template's
/// polygons at their true places, in the mesh's frame.
fn write(console: &Console, chosen: &[Case], folder: &Path) -> Result<Outcome> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for case in chosen {
        let specimen = case.specimen(template::human());
        let name: String = case
            .name
            .chars()
            .map(|c| if c.is_alphanumeric() { c } else { '_' })
            .collect();
        let mesh = folder.join(format!("{name}.obj"));
        write_obj(&mesh, &specimen.mesh()?)?;
        let truth = template::human()
            .skin
            .with_positions(specimen.truth.clone())?;
        write_obj(folder.join(format!("{name}.truth.obj")), &truth)?;
        console.result(&mesh.display().to_string());
    }
    Ok(Outcome::Done)
}

fn run_cost(console: &Console, args: &BenchRegistrationArgs) -> Result<Outcome> {
    let folder = tempfile::tempdir().context("no temporary folder")?;
    let mut has_head = args.json;
    let rows = cost(template::human(), args.largest, folder.path(), &mut |row| {
        if !args.json {
            if !has_head {
                has_head = true;
                console.result(&cost_head(row));
            }
            console.result(&cost_line(row));
        }
        if console.is_stopped() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })?;
    if args.json {
        console.result(&serde_json::to_string_pretty(&rows)?);
    }
    Ok(Outcome::Done)
}

fn cost_head(row: &CostRow) -> String {
    let stages: String = row
        .times
        .iter()
        .map(|t| format!("{:>9}", t.stage))
        .collect();
    format!(
        "{:<12}{stages}{:>9}{:>12}{:>10}",
        "vertices", "s", "us/vertex", "peak GB"
    )
}

fn cost_line(row: &CostRow) -> String {
    let stages: String = row
        .times
        .iter()
        .map(|t| format!("{:>9.3}", t.seconds))
        .collect();
    let memory = row
        .peak_memory_bytes
        .map_or("-".to_owned(), |b| format!("{:.2}", b as f64 / 1e9));
    format!(
        "{:<12}{stages}{:>9.2}{:>12.1}{memory:>10}",
        row.vertex_count,
        row.seconds,
        1e6 * row.seconds / row.vertex_count as f64
    )
}
