//! Registers a case and judges the outcome by its truth.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Instant;

use serde::Serialize;

use super::cases::{Bars, Case, Expectation};
use super::specimen::Specimen;
use crate::Error;
use crate::registration::face_model::{FaceModel, Role};
use crate::registration::{
    DistanceStatistics, OpeningState, Registration, RegistrationOptions, StageTime, register,
};
use crate::template::Template;

/// What registration found, measured against the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// Distance of the template's face vertices from their true places, where the mesh has
    /// them.
    pub vertex_error: DistanceStatistics,
    /// The region where this is largest, and its 95 %.
    pub worst_region: (String, f64),
    /// Distance of the template's face vertices from the mesh.
    pub template_to_face: DistanceStatistics,
    /// Distance of the mesh from the template's face.
    pub face_to_template: DistanceStatistics,
    /// Triangles that are folded over.
    pub folded_triangles: usize,
    /// Margin of the alignment.
    pub confidence: f64,
    /// Mouth, left eye, right eye.
    pub openings: [OpeningState; 3],
    /// What was said to the user.
    pub warnings: Vec<String>,
    /// Time of each stage.
    pub times: Vec<StageTime>,
}

/// What became of a case.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It was registered.
    Found(Box<Found>),
    /// It was refused, with this message.
    Refused(String),
}

/// A case, judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CaseResult {
    /// Name of the case.
    pub name: String,
    /// Vertices of its mesh.
    pub vertex_count: usize,
    /// What was expected.
    pub expectation: Expectation,
    /// What became of it.
    pub outcome: Outcome,
    /// What is wrong with that, nothing when it passes.
    pub failures: Vec<String>,
    /// Time of registration. (s)
    pub seconds: f64,
}

/// Runs one case.
///
/// # Errors
///
/// [`Error`] when the case itself cannot be made; refusals are outcomes.
pub fn run_case(case: &Case, template: &Template) -> Result<CaseResult, Error> {
    let specimen = case.specimen(template);
    let mesh = specimen.mesh()?;
    let clock = Instant::now();
    let outcome = match register(
        &mesh,
        template,
        &RegistrationOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    ) {
        Ok(found) => Outcome::Found(Box::new(measure(template, &specimen, &found)?)),
        Err(error) => Outcome::Refused(error.to_string()),
    };
    Ok(CaseResult {
        name: case.name.clone(),
        vertex_count: mesh.vertex_count(),
        expectation: case.expectation,
        failures: judge(&case.expectation, &outcome),
        outcome,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

fn measure(template: &Template, specimen: &Specimen, found: &Registration) -> Result<Found, Error> {
    let model = FaceModel::new(template)?;
    let mut all = Vec::new();
    let mut by_region: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for v in 0..specimen.truth.len() {
        if model.roles[v] != Role::Face || !specimen.is_present[v] {
            continue;
        }
        let truth = found.to_head.transform_point(&specimen.truth[v]);
        let error = (found.positions[v] - truth).norm();
        all.push(error);
        let region = model.region(v as u32).0 as usize;
        by_region
            .entry(&template.regions.regions[region].name)
            .or_default()
            .push(error);
    }
    let worst = by_region
        .into_iter()
        .map(|(name, errors)| (name, DistanceStatistics::from_distances(errors).p95))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or(("", 0.0));
    let report = &found.report;
    Ok(Found {
        vertex_error: DistanceStatistics::from_distances(all),
        worst_region: (worst.0.to_owned(), worst.1),
        template_to_face: report.template_to_face,
        face_to_template: report.face_to_template,
        folded_triangles: report.folded_triangles,
        confidence: report.confidence,
        openings: [
            report.openings.mouth.state,
            report.openings.eyes[0].state,
            report.openings.eyes[1].state,
        ],
        warnings: report.warnings.clone(),
        times: report.times.clone(),
    })
}

fn judge(expectation: &Expectation, outcome: &Outcome) -> Vec<String> {
    match (expectation, outcome) {
        (Expectation::Refused, Outcome::Found(_)) => {
            vec!["registered what is no face".to_owned()]
        }
        (Expectation::Refused | Expectation::WithinOrRefused(_), Outcome::Refused(_)) => Vec::new(),
        (_, Outcome::Refused(_)) => vec!["refused".to_owned()],
        (Expectation::Within(bars) | Expectation::WithinOrRefused(bars), Outcome::Found(found)) => {
            over(bars, found)
        }
        (Expectation::WithinAndSaid(bars, word), Outcome::Found(found)) => {
            let mut failures = over(bars, found);
            if !found.warnings.iter().any(|w| w.contains(word)) {
                failures.push(format!("said nothing of {word:?}"));
            }
            failures
        }
    }
}

fn over(bars: &Bars, found: &Found) -> Vec<String> {
    let mut failures = Vec::new();
    let mut check = |what: &str, value: f64, bar: f64| {
        if value > bar || value.is_nan() {
            failures.push(format!("{what} {value:.2} > {bar}"));
        }
    };
    check("vertex median", found.vertex_error.median, bars.vertex[0]);
    check("vertex 95 %", found.vertex_error.p95, bars.vertex[1]);
    check(
        "surface median",
        found.template_to_face.median,
        bars.surface[0],
    );
    check("surface 95 %", found.template_to_face.p95, bars.surface[1]);
    check("folds", found.folded_triangles as f64, bars.folds as f64);
    if found.vertex_error.count == 0 {
        failures.push("no truth to measure against".to_owned());
    }
    failures
}

/// Largest memory that this process has had so far, where the system tells. (bytes)
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn judging_sees_each_kind_of_failure() {
        let bars = Bars {
            vertex: [0.7, 2.5],
            surface: [0.2, 0.8],
            folds: 0,
        };
        let good = DistanceStatistics::from_distances(vec![0.1; 30]);
        let found = Found {
            vertex_error: good,
            worst_region: (String::new(), 0.0),
            template_to_face: good,
            face_to_template: good,
            folded_triangles: 0,
            confidence: 1.0,
            openings: [OpeningState::Open; 3],
            warnings: Vec::new(),
            times: Vec::new(),
        };
        let judged = |expectation: Expectation, change: &dyn Fn(&mut Found)| {
            let mut found = found.clone();
            change(&mut found);
            judge(&expectation, &Outcome::Found(Box::new(found))).len()
        };
        let within = Expectation::Within(bars);
        assert_eq!(judged(within, &|_| ()), 0);
        assert_eq!(judged(within, &|f| f.folded_triangles = 1), 1);
        assert_eq!(judged(within, &|f| f.vertex_error.median = 0.8), 1);
        assert_eq!(judged(within, &|f| f.vertex_error.p95 = f64::NAN), 1);
        assert_eq!(judged(within, &|f| f.template_to_face.p95 = 0.9), 1);
        assert_eq!(judged(Expectation::Refused, &|_| ()), 1);
        assert_eq!(
            judged(Expectation::WithinAndSaid(bars, "mirror"), &|_| ()),
            1
        );
        let refused = Outcome::Refused("not sure".to_owned());
        assert_eq!(judge(&within, &refused).len(), 1);
        assert!(judge(&Expectation::WithinOrRefused(bars), &refused).is_empty());
    }
}
