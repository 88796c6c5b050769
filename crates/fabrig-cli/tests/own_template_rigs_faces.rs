//! A rig that somebody has becomes a template: `fabrig template build` takes its neutral and the
//! shapes it has, `template check` passes it, and another face rigged with it moves in its style.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::path::Path;
use std::sync::Arc;

use assert_cmd::Command;
use fabrig_core::evaluation::synthetic_faces;
use fabrig_core::mesh::Mesh;
use fabrig_core::mesh::io::write_obj;
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation};
use fabrig_core::template::{self, Template};
use fabrig_core::{Point, Vector};

/// The style of the source: smiles are this much wider than the template's.
const SMILE: f64 = 1.5;

fn run(folder: &Path, args: &[&str]) -> String {
    let output = Command::cargo_bin("fabrig")
        .unwrap()
        .current_dir(folder)
        .args(args)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let notes = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {text}{notes}");
    text
}

/// Motion of a landmark by a shape, without cloth. (mm)
fn motion(rig: &Rig, shape: &str, landmark: &str) -> Vector {
    let template = template::human();
    let mark = rig.positions[template.landmarks[landmark] as usize];
    let mut simulation =
        Simulation::new(Arc::new(rig.clone()), Scene::without_dynamics(), None).unwrap();
    let mut pose = FacePose::neutral(rig.shape_names.len());
    pose.weights[rig.shape_index(shape).unwrap()] = 1.0;
    simulation.reset(pose).unwrap();
    let rest = simulation.rest_skin();
    let distance = |v: &usize| (rest[*v].cast::<f64>() - mark).norm();
    let skin = (0..rest.len()).filter(|&v| rig.regions[v].is_some());
    let v = skin
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap();
    (simulation.skin()[v] - rest[v]).cast()
}

#[test]
fn a_rig_of_ones_own_becomes_a_template_and_another_face_moves_in_its_style() {
    let bundled = template::human();
    let source = &synthetic_faces(bundled, "young_woman carried").unwrap()[0];
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("rig")).unwrap();
    write_obj(at("rig/generic_neutral_mesh.obj"), &source.neutral).unwrap();
    let rest = source.neutral.positions();
    // In the units and the pose of the source, whose left is +X, as the template's is.
    let write = |name: &str, shape: &str, by: &dyn Fn(&Point) -> f64| {
        let own = source.expressions.iter().find(|e| e.name == shape).unwrap();
        let posed = rest.iter().zip(&own.positions);
        let posed = posed.map(|(p, q)| p + (q - p) * by(p)).collect();
        let mesh: Mesh = source.neutral.with_positions(posed).unwrap();
        write_obj(at("rig").join(format!("{name}.obj")), &mesh).unwrap();
    };
    write("mouthSmile_L", "mouthSmileLeft", &|_| SMILE);
    write("mouthSmile_R", "mouthSmileRight", &|_| SMILE);
    write("jawOpen", "jawOpen", &|_| 1.0);
    // One side alone: the other is its mirror image. Two halves: one shape.
    write("noseSneer_L", "noseSneerLeft", &|_| 1.0);
    write("browInnerUp_L", "browInnerUp", &|p| {
        f64::from(u8::from(p.x > 0.0))
    });
    write("browInnerUp_R", "browInnerUp", &|p| {
        f64::from(u8::from(p.x <= 0.0))
    });

    let text = run(
        folder.path(),
        &["template", "build", "rig", "pack", "--credit", "Nobody"],
    );
    assert!(text.contains("own shapes          6"), "{text}");
    assert!(text.contains("46 of human"), "{text}");
    let text = run(
        folder.path(),
        &["template", "check", "pack", "--picture", "pack.png"],
    );
    assert!(text.contains("passes") && text.contains("stored"), "{text}");
    assert!(at("pack.png").is_file());

    let pack = Template::load(&at("pack")).unwrap();
    assert_eq!(pack.name, "pack");
    assert!(pack.credit.starts_with("Nobody") && pack.credit.contains("CC0"));
    let delta = |name: &str| {
        let shape = &pack.shapes[pack.shape_index(name).unwrap()];
        shape.deltas.iter().map(|(_, d)| d.norm()).sum::<f64>()
    };
    assert!((delta("noseSneerRight") / delta("noseSneerLeft") - 1.0).abs() < 1e-3);

    write_obj(at("demo.obj"), &template::demo_face()).unwrap();
    run(folder.path(), &["rig", "demo.obj", "-o", "plain.fabrig"]);
    run(
        folder.path(),
        &["rig", "demo.obj", "--template", "pack", "-o", "own.fabrig"],
    );
    let [plain, own] = ["plain.fabrig", "own.fabrig"].map(|name| Rig::load(at(name)).unwrap());
    assert_eq!(own.template, "pack");
    let ratio = |shape: &str, landmark: &str| {
        motion(&own, shape, landmark).norm() / motion(&plain, shape, landmark).norm()
    };
    for (shape, landmark) in [
        ("mouthSmileLeft", "lip_corner_l"),
        ("mouthSmileRight", "lip_corner_r"),
    ] {
        let ratio = ratio(shape, landmark);
        assert!((ratio / SMILE - 1.0).abs() < 0.15, "{shape}: {ratio}");
    }
    for (shape, landmark) in [
        ("jawOpen", "pogonion"),
        ("browInnerUp", "brow_inner_l"),
        ("noseSneerRight", "alar_r"),
        ("mouthFrownLeft", "lip_corner_l"),
    ] {
        let ratio = ratio(shape, landmark);
        assert!((0.75..1.3).contains(&ratio), "{shape}: {ratio}");
    }
    // Corners of smiles half as wide again cross by 2 mm; everything else holds as it is.
    let gate = "crossing_mm=2.5";
    let text = run(
        folder.path(),
        &["check", "own.fabrig", "--template", "pack", "--gate", gate],
    );
    assert!(text.contains("passes"), "{text}");
}
