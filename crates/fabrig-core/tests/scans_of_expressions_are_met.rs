//! Scans of expressions with meshes of their own: each is found where it stands, registered, and
//! brings the rig nearer to how this face really moves than its size alone does; a scan of
//! another face is refused.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::ops::ControlFlow::Continue;
use std::path::PathBuf;
use std::sync::Arc;

use fabrig_core::Point;
use fabrig_core::mesh::Mesh;
use fabrig_core::pipeline::{ExpressionScan, RigFaceOptions, RiggedFace, rig_face};
use fabrig_core::registration::bench::Specimen;
use fabrig_core::scene::{FacePose, Scene, Simulation};
use fabrig_core::template::{self, Template};
use nalgebra::{Similarity3, Vector3};

/// How far this face takes each shape, the template's own amplitude being 1.
const SHAPES: [(&str, f64); 4] = [
    ("mouthSmileLeft", 1.35),
    ("browInnerUp", 0.7),
    ("mouthPucker", 1.2),
    ("jawOpen", 0.8),
];

/// An old woman's face in an expression, by her own warp.
fn truth(template: &Template, shape: Option<(&str, f64)>) -> Specimen {
    let person = template::people().iter().find(|p| p.name == "old_woman");
    let mut at = person.unwrap().positions.clone();
    if let Some((name, amplitude)) = shape {
        let shape = &template.shapes[template.shape_index(name).unwrap()];
        for &(v, delta) in &shape.deltas {
            at[v as usize] += delta * amplitude;
        }
    }
    Specimen::from_truth(template, &at).warped(11, 1.0)
}

/// A scan: another mesh of it, turned and elsewhere.
fn scan(template: &Template, name: &str, amplitude: f64, seed: usize) -> ExpressionScan {
    let pose = Similarity3::new(
        Vector3::new(15.0 * seed as f64, -20.0, 30.0),
        Vector3::new(0.05, -0.08, 0.04) * seed as f64,
        1.0,
    );
    let specimen = truth(template, Some((name, amplitude)));
    let mesh = specimen.decimated(3200).posed(&pose).mesh().unwrap();
    let mut weights = vec![0.0; template.shapes.len()];
    weights[template.shape_index(name).unwrap()] = 1.0;
    ExpressionScan {
        name: name.to_owned(),
        weights,
        mesh,
        path: PathBuf::from(format!("{name}.obj")),
    }
}

/// Mean distance of the rig's skin from the truth over what moves. (mm)
fn error(rigged: &RiggedFace, template: &Template, name: &str, amplitude: f64) -> f64 {
    let rest = truth(template, None).remeshed().mesh().unwrap();
    let posed = truth(template, Some((name, amplitude)))
        .remeshed()
        .mesh()
        .unwrap();
    let rig = Arc::new(rigged.rig.clone());
    let mut simulation =
        Simulation::new(Arc::clone(&rig), Scene::without_dynamics(), None).unwrap();
    let mut pose = FacePose::neutral(rig.shape_names.len());
    pose.weights[rig.shape_index(name).unwrap()] = 1.0;
    simulation.reset(pose).unwrap();
    let own: Vec<Point> = simulation.skin_in_own_units();
    let pairs = own.iter().zip(rest.positions()).zip(posed.positions());
    let errors: Vec<f64> = pairs
        .filter(|((_, rest), posed)| (*posed - *rest).norm() > 1.0)
        .map(|((own, _), posed)| (own - posed).norm())
        .collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}

#[test]
fn scans_bring_the_rig_nearer_to_how_the_face_moves() {
    let template = template::human();
    let neutral: Mesh = truth(template, None).remeshed().mesh().unwrap();
    let rigged = |scans: Vec<ExpressionScan>| {
        let options = RigFaceOptions {
            scans,
            ..RigFaceOptions::default()
        };
        rig_face(&neutral, template, &options, &mut |_| Continue(())).unwrap()
    };
    let by_size = rigged(Vec::new());
    let scans = (1..).zip(SHAPES);
    let scans = scans.map(|(seed, (name, amplitude))| scan(template, name, amplitude, seed));
    let by_scans = rigged(scans.collect());
    for (report, (name, amplitude)) in by_scans.scans.iter().zip(SHAPES) {
        let before = error(&by_size, template, name, amplitude);
        let after = error(&by_scans, template, name, amplitude);
        println!("{name}: {before:.2} -> {after:.2} mm, {report:?}");
        assert_eq!(report.problem, None, "{name}");
        let found = report.amplitude.unwrap();
        assert!(
            (found / amplitude - 1.0).abs() < 0.25,
            "{name}: amplitude {found}"
        );
        assert!(
            after < 0.75 * before,
            "{name}: {before} mm by size, {after} mm by the scan"
        );
    }
}

#[test]
fn a_scan_of_something_else_is_told() {
    let template = template::human();
    let neutral = truth(template, None).remeshed().mesh().unwrap();
    let mut other = scan(template, "mouthSmileLeft", 1.0, 1);
    let wide = other.mesh.positions().iter();
    let wide = wide
        .map(|p| Point::new(1.3 * p.x, p.y, 0.8 * p.z))
        .collect();
    other.mesh = other.mesh.with_positions(wide).unwrap();
    let options = RigFaceOptions {
        scans: vec![other],
        ..RigFaceOptions::default()
    };
    let rigged = rig_face(&neutral, template, &options, &mut |_| Continue(())).unwrap();
    println!("{:?}", rigged.scans);
    assert!(rigged.scans[0].problem.is_some());
    assert_eq!(
        rigged
            .report
            .warnings
            .iter()
            .filter(|w| w.contains("not used"))
            .count(),
        1
    );
}
