//! `check_rig` passes a sound rig and names what is wrong with a broken one: a muscle shape that
//! runs backwards, lips that hang on each other's muscles, vertices labelled for the wrong lip,
//! a shape scaled away by edits, a smile that pulls the other side.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod faces;

use std::ops::ControlFlow;
use std::sync::{Arc, LazyLock};

use fabrig_core::edit::{Edits, muscle_shape_names};
use fabrig_core::evaluation::{CheckError, CheckGates, CheckReport, check_rig};
use fabrig_core::rig::Rig;
use fabrig_core::scene::Scene;
use fabrig_core::template;

fn check(rig: &Rig) -> CheckReport {
    let rig = Arc::new(rig.clone());
    let gates = CheckGates::default();
    let scene = Scene::without_dynamics();
    let check = check_rig(&rig, template::human(), &gates, &scene, &mut |_| {
        ControlFlow::Continue(())
    });
    check.unwrap().report
}

static DEMO: LazyLock<CheckReport> = LazyLock::new(|| check(&faces::demo().rig));

/// Findings of a broken rig that the sound one does not have, as (gate, shape).
fn broken(rig: &Rig) -> Vec<(&'static str, String)> {
    let report = check(rig);
    assert!(!report.passes());
    let findings = report.findings.into_iter();
    findings
        .map(|f| (f.gate, f.shape.unwrap_or_default()))
        .collect()
}

fn has(findings: &[(&str, String)], gate: &str, shape: &str) -> bool {
    findings.iter().any(|(g, s)| *g == gate && s == shape)
}

#[test]
fn the_demo_rig_passes_and_so_does_the_template() {
    for (name, report) in [
        ("demo", &*DEMO),
        ("template", &check(&faces::template_rig())),
    ] {
        let texts: Vec<&str> = report.findings.iter().map(|f| f.text.as_str()).collect();
        assert!(report.passes(), "{name}: {texts:#?}");
        assert_eq!(report.shapes.len(), 52);
        let jaw = report.shapes.iter().find(|s| s.shape == "jawOpen").unwrap();
        assert!(jaw.amplitude_mm > 25.0, "{name}: {}", jaw.amplitude_mm);
        assert!(jaw.direction.unwrap() > 0.95, "{name}");
        assert!((0.8..1.25).contains(&jaw.ratio.unwrap()), "{name}");
    }
}

#[test]
fn a_face_on_a_rig_of_the_shared_folder_is_checked_too() {
    for face in faces::subjects().skip(1) {
        let report = check(&face.rig);
        assert_eq!(report.shapes.iter().map(|s| s.wrong_side).sum::<usize>(), 0);
        assert_eq!(report.shapes.iter().map(|s| s.torn_edges).sum::<usize>(), 0);
    }
}

#[test]
fn a_muscle_shape_that_runs_backwards_is_named() {
    let mut rig = Rig::clone(&faces::demo().rig);
    let name = "zygomaticus_major_l.mouthSmileLeft";
    let shapes = rig.patches.iter_mut().flat_map(|p| &mut p.transfer.shapes);
    let shape = shapes.into_iter().find(|s| s.name == name).unwrap();
    shape.deltas.iter_mut().for_each(|d| *d = -*d);
    let findings = broken(&rig);
    assert!(has(&findings, "muscle_direction", name), "{findings:?}");
    assert!(!has(
        &findings,
        "muscle_direction",
        "zygomaticus_major_r.mouthSmileRight"
    ));
}

#[test]
fn lips_on_each_others_muscles_are_found_by_side() {
    let mut rig = Rig::clone(&faces::demo().rig);
    let (upper, lower) = (
        rig.vertices_in(&["upper_lip"]),
        rig.vertices_in(&["lower_lip"]),
    );
    let count = upper.len().min(lower.len());
    let rows: Vec<Vec<(u32, f32)>> = (0..rig.binding.vertex_count())
        .map(|v| rig.binding.row(v).collect())
        .collect();
    let mut swapped = rows.clone();
    for (&a, &b) in upper[..count].iter().zip(&lower[..count]) {
        swapped[a as usize].clone_from(&rows[b as usize]);
        swapped[b as usize].clone_from(&rows[a as usize]);
    }
    rig.binding.starts = vec![0];
    rig.binding.nodes.clear();
    rig.binding.weights.clear();
    for row in swapped {
        for (node, weight) in row {
            rig.binding.nodes.push(node);
            rig.binding.weights.push(weight);
        }
        rig.binding.starts.push(rig.binding.nodes.len() as u32);
    }
    let findings = broken(&rig);
    assert!(has(&findings, "wrong_side", "jawOpen"), "{findings:?}");
}

/// Registration that takes some of the upper lip for the lower one: labels and weights agree,
/// so only the edges of the mesh can tell.
#[test]
fn vertices_labelled_for_the_wrong_lip_tear_their_edges() {
    let face = faces::demo();
    let template = template::human();
    let lower = template.regions.find("lower_lip").unwrap();
    let corners = template.skin.triangles();
    let of_lower = |t: &[u32; 3]| {
        let labels = t
            .iter()
            .map(|&v| template.regions.vertex_regions[v as usize]);
        labels.filter(|&r| r == lower).count() == 3
    };
    let surface = fabrig_core::mesh::Surface::new(&face.registration.positions, &corners).unwrap();
    let mut registration = face.registration.clone();
    let upper = face.rig.vertices_in(&["upper_lip"]);
    let middle = |v: &&u32| {
        let p = face.registration.to_head * face.mesh.positions()[**v as usize];
        p.x.abs() < 6.0
    };
    let moved: Vec<u32> = upper.iter().filter(middle).copied().collect();
    assert!(moved.len() > 4);
    for &v in &moved {
        let p = face.registration.to_head * face.mesh.positions()[v as usize];
        let place = surface.closest_where(&p, f64::INFINITY, |at| {
            of_lower(&corners[at.triangle as usize])
        });
        registration.face_points[v as usize] = place.unwrap();
        registration.face_regions[v as usize] = lower;
    }
    let on_template =
        fabrig_core::rig::FaceOnTemplate::from_registration(&face.mesh, &registration).unwrap();
    let rig = fabrig_core::rig::build(&on_template, template, &Default::default()).unwrap();
    let findings = broken(&rig);
    assert!(has(&findings, "torn_edges", "jawOpen"), "{findings:?}");
}

#[test]
fn a_shape_scaled_away_by_edits_is_dead() {
    let mut rig = Rig::clone(&faces::demo().rig);
    let text: String = muscle_shape_names(&rig)
        .iter()
        .filter(|name| name.ends_with(".cheekPuff"))
        .map(|name| format!("[shapes.\"{name}\"]\nstrength = 0.0\n"))
        .collect();
    Edits::parse(&text).unwrap().apply(&mut rig).unwrap();
    let findings = broken(&rig);
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert!(has(&findings, "least_ratio", "cheekPuff"), "{findings:?}");
}

#[test]
fn a_smile_that_pulls_the_other_side_leaks() {
    let mut rig = Rig::clone(&faces::demo().rig);
    let right = rig.shape_index("mouthSmileRight").unwrap() as u32;
    let left = rig.shape_index("mouthSmileLeft").unwrap() as u32;
    let shapes = rig.patches.iter_mut().flat_map(|p| &mut p.transfer.shapes);
    for shape in shapes.filter(|s| s.name.starts_with("zygomaticus_major_r.")) {
        if shape.shape == right {
            shape.shape = left;
        } else if shape.shape == left {
            shape.shape = right;
        }
    }
    let findings = broken(&rig);
    assert!(has(&findings, "leak_mm", "mouthSmileLeft"), "{findings:?}");
}

#[test]
fn another_template_is_refused() {
    let mut rig = Rig::clone(&faces::demo().rig);
    rig.template = "goat".to_owned();
    let gates = CheckGates::default();
    let scene = Scene::without_dynamics();
    let error = check_rig(
        &Arc::new(rig),
        template::human(),
        &gates,
        &scene,
        &mut |_| ControlFlow::Continue(()),
    );
    assert!(matches!(error, Err(CheckError::Template { .. })));
    let rig = Arc::clone(&faces::demo().rig);
    let error = check_rig(&rig, template::human(), &gates, &scene, &mut |_| {
        ControlFlow::Break(())
    });
    assert!(matches!(error, Err(CheckError::Stopped)));
}
