//! Retargeting finds the weights that moved a face: from one identity to another and back, and
//! from forty noisy markers on a head that moves.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::sync::Arc;

use fabrig_core::facs::ActionUnitTable;
use fabrig_core::motion::{HeadPose, MarkerTake};
use fabrig_core::retarget::{
    Controls, FitOptions, MarkerOptions, ResponseModel, Site, SiteMotion, bind_markers, fit_sites,
    mesh_sites,
};
use fabrig_core::rig::{FaceOnTemplate, Rig, RigOptions, build, places_of_self};
use fabrig_core::template::{self, people};
use fabrig_core::{Point, Vector};
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
        examples: &[],
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

/// Forty markers as a face is taped: brows, lids, nose, cheeks, lips and chin, and a few that
/// tell the head's motion.
fn marker_sites() -> Vec<Site> {
    const PAIRS: [&str; 17] = [
        "brow_inner",
        "brow_mid",
        "brow_outer",
        "upper_lid_front",
        "lower_lid_front",
        "alar",
        "nasolabial_top",
        "nasolabial_mid",
        "malar",
        "buccal",
        "lip_corner",
        "mouth_corner_low",
        "upper_lip_peak",
        "upper_lip_side",
        "lower_lip_bottom_near",
        "temporal_line",
        "tragion",
    ];
    const MIDDLE: [&str; 6] = [
        "hairline_mid",
        "glabella",
        "nose_tip",
        "upper_lip_mid",
        "lower_lip_mid",
        "pogonion",
    ];
    let landmarks = &template::human().landmarks;
    let pairs = PAIRS
        .iter()
        .flat_map(|p| ["l", "r"].map(|side| format!("{p}_{side}")));
    pairs
        .chain(MIDDLE.map(str::to_owned))
        .map(|name| Site::vertex(landmarks[&name]))
        .collect()
}

#[test]
fn forty_noisy_markers_give_the_action_units() {
    const UNITS: [u32; 14] = [1, 2, 4, 6, 9, 10, 12, 14, 15, 17, 20, 25, 26, 45];
    let rig = person_rig("old_woman");
    let sites = marker_sites();
    assert_eq!(sites.len(), 40);
    let table = ActionUnitTable::bundled().unwrap();
    let units = Controls::units(&rig, &table, &UNITS).unwrap();
    let mut model = ResponseModel::new(Arc::clone(&rig), units.clone(), sites).unwrap();

    let mut values = vec![vec![0.0; units.count()]; 15];
    values.extend(performance(units.count(), 90));
    let still = played(&mut model, &values);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut normal = move || {
        let (a, b): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random_range(0.0..1.0));
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    };
    let mut take = MarkerTake {
        names: (0..40).map(|i| format!("m{i}")).collect(),
        times: still.times.clone(),
        positions: Vec::new(),
    };
    for (frame, places) in still.positions.iter().enumerate() {
        let swing = (frame as f64 * 0.11).sin() * f64::from(u8::from(frame >= 15));
        let head = HeadPose {
            yaw: 0.2 * swing,
            pitch: 0.1 * swing,
            ..HeadPose::default()
        };
        for (m, place) in places.iter().enumerate() {
            let noise = 0.5 * Vector::new(normal(), normal(), normal());
            let moved =
                head.rotation() * place.unwrap() + noise + Vector::new(4.0, 9.0, 0.0) * swing;
            // A marker is hidden now and then.
            take.positions
                .push(((frame + 7 * m) % 53 != 30).then_some(moved));
        }
    }
    let options = MarkerOptions {
        neutral: [0.0, 0.45],
        ..MarkerOptions::default()
    };
    let bound = bind_markers(&take, &rig, &options).unwrap();
    assert_eq!(bound.names.len(), 40);
    assert!(
        bound.distances.iter().all(|&d| d < 2.0),
        "{:?}",
        bound.distances
    );
    let motion = SiteMotion {
        times: take.times.clone(),
        neutral: bound.neutral,
        positions: bound.positions,
        has_head_motion: true,
    };
    let mut model = ResponseModel::new(Arc::clone(&rig), units.clone(), bound.sites).unwrap();
    let found = fit_sites(&mut model, &motion, &FitOptions::markers()).unwrap();
    let wanted: Vec<f64> = values.concat();
    let error = rms(&found.values, &wanted);
    for (control, name) in units.names().iter().enumerate() {
        let of = |all: &[f64]| -> Vec<f64> {
            all.iter()
                .skip(control)
                .step_by(units.count())
                .copied()
                .collect()
        };
        eprintln!("{name:<8}{:.3}", rms(&of(&found.values), &of(&wanted)));
    }
    eprintln!(
        "units {error:.4} rms, markers {:.3} mm rms",
        found.report.residual_rms
    );
    assert!(error < 0.08, "units are found to {error:.4} rms");
    assert!(found.report.kkt_residual < 1e-6);
    let turned = found
        .clip
        .tracks()
        .head
        .iter()
        .map(|h| h.yaw)
        .fold(0.0, f64::max);
    assert!((turned - 0.2).abs() < 0.03, "the head turns by {turned:.3}");
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
