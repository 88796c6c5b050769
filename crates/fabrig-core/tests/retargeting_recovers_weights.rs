//! Retargeting finds the weights that moved a face: from one identity to another and back.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::sync::Arc;

use fabrig_core::Point;
use fabrig_core::motion::MarkerTake;
use fabrig_core::retarget::{
    Controls, FitOptions, MarkerOptions, ResponseModel, SiteMotion, bind_markers, fit_sites,
    mesh_sites,
};
use fabrig_core::rig::{FaceOnTemplate, Rig, RigOptions, build, places_of_self};
use fabrig_core::template::{self, people};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A rig of one of the bundled people, in the template's topology.
fn person_rig(name: &str) -> Arc<Rig> {
    let template = template::human();
    let person = people().iter().find(|p| p.name == name).unwrap();
    let face = template
        .skin
        .with_positions(person.positions.clone())
        .unwrap();
    let places = places_of_self(template);
    let on_template = FaceOnTemplate {
        face: &face,
        to_head: nalgebra::Similarity3::identity(),
        positions: &person.positions,
        places: &places,
        rigid: &[],
        report: String::new(),
    };
    Arc::new(build(&on_template, template, &RigOptions::default()).unwrap())
}

fn shape_model(rig: &Arc<Rig>) -> ResponseModel {
    ResponseModel::new(Arc::clone(rig), Controls::shapes(rig), mesh_sites(rig)).unwrap()
}

/// Smooth values that come and go, each control in its own time, a few at once.
fn performance(controls: usize, frames: usize) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let phases: Vec<f64> = (0..controls).map(|_| rng.random_range(0.0..1.0)).collect();
    let at = |phase: f64, frame: usize| {
        let s = (frame as f64 / frames as f64 + phase).fract();
        let peak = 1.0 - ((s - 0.7).abs() / 0.15).min(1.0);
        0.85 * peak * peak * (3.0 - 2.0 * peak)
    };
    (0..frames)
        .map(|frame| phases.iter().map(|&phase| at(phase, frame)).collect())
        .collect()
}

/// The skin of a rig at its sites under given values.
fn played(model: &mut ResponseModel, values: &[Vec<f64>]) -> SiteMotion {
    let rest = model.rest();
    let mut motion = SiteMotion {
        times: (0..values.len()).map(|i| i as f64 / 30.0).collect(),
        neutral: rest.clone(),
        positions: Vec::new(),
        has_head_motion: false,
    };
    for row in values {
        let moved = model.displacements(row).unwrap();
        let places = rest.iter().zip(moved).map(|(p, d)| Some(p + d));
        motion.positions.push(places.collect());
    }
    motion
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

#[test]
fn a_clip_goes_from_one_identity_to_another_and_back() {
    let mut here = shape_model(&person_rig("goblin"));
    let mut there = shape_model(&person_rig("old_woman"));
    let mut values = performance(here.controls().count(), 20);
    // What no skin shows cannot come back: the tongue is a piece of its own.
    let reach = [here.reach(), there.reach()];
    for row in &mut values {
        for (control, value) in row.iter_mut().enumerate() {
            if reach.iter().any(|r| r[control] < 0.1) {
                *value = 0.0;
            }
        }
    }
    let options = FitOptions::default();
    let source = played(&mut here, &values);
    let on_source = fit_sites(&mut here, &source, &options).unwrap();
    let rows: Vec<Vec<f64>> = on_source
        .values
        .chunks(values[0].len())
        .map(<[f64]>::to_vec)
        .collect();
    let target = played(&mut there, &rows);
    let back = fit_sites(&mut there, &target, &options).unwrap();
    let wanted: Vec<f64> = values.concat();
    let error = rms(&back.values, &wanted);
    eprintln!(
        "there and back: weights {error:.4} rms, residuals {:.4} and {:.4} mm, kkt {:.1e}",
        on_source.report.residual_rms, back.report.residual_rms, back.report.kkt_residual
    );
    assert!(error < 0.02, "weights come back to {error:.4} rms");
    assert!(on_source.report.residual_rms < 0.05);
    assert!(on_source.report.kkt_residual < 1e-6 && back.report.kkt_residual < 1e-6);
}

#[test]
fn sources_that_cannot_be_fitted_are_refused() {
    let rig = person_rig("goblin");
    let far = MarkerTake {
        names: vec!["a".into(), "b".into(), "c".into()],
        times: vec![0.0],
        positions: vec![
            Some(Point::new(500.0, 0.0, 0.0)),
            Some(Point::new(0.0, 900.0, 0.0)),
            None,
        ],
    };
    let error = bind_markers(&far, &rig, &MarkerOptions::default()).unwrap_err();
    assert!(error.to_string().contains("from the face"), "{error}");
    let mut placed = MarkerOptions::default();
    placed.places.insert("d".into(), Point::origin());
    let error = bind_markers(&far, &rig, &placed).unwrap_err();
    assert!(error.to_string().contains("nearest: 'a'"), "{error}");
}
