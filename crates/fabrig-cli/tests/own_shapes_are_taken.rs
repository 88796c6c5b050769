//! `fabrig rig --shapes` takes a folder of the face's own expressions, says what it passed
//! over, and the rig moves as they do.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use assert_cmd::Command;
use fabrig_core::evaluation::synthetic_faces;
use fabrig_core::mesh::io::write_obj;
use fabrig_core::rig::Rig;
use fabrig_core::template;

#[test]
fn a_folder_of_shapes_is_fitted_and_reported() {
    let template = template::human();
    let face = &synthetic_faces(template, "demo warped").unwrap()[0];
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("shapes")).unwrap();
    write_obj(at("shapes/neutral.obj"), &face.neutral).unwrap();
    let wider = |p: &fabrig_core::Point, q: &fabrig_core::Point| p + (q - p) * 1.4;
    for name in ["mouthSmileLeft", "jawOpen"] {
        let own = face.expressions.iter().find(|e| e.name == name).unwrap();
        let rest = face.neutral.positions().iter();
        let stronger = rest.zip(&own.positions).map(|(p, q)| wider(p, q)).collect();
        let mesh = face.neutral.with_positions(stronger).unwrap();
        write_obj(at("shapes").join(format!("{name}.obj")), &mesh).unwrap();
    }
    write_obj(at("shapes/hat.obj"), &face.neutral).unwrap();
    let rig = |alpha: Option<&str>| {
        let mut args = vec!["rig", "shapes/neutral.obj", "-o", "face.fabrig"];
        if let Some(alpha) = alpha {
            args.extend(["--shapes", "shapes", "--alpha", alpha]);
        }
        let output = Command::cargo_bin("fabrig")
            .unwrap()
            .current_dir(folder.path())
            .args(args)
            .output()
            .unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{text}");
        (Rig::load(at("face.fabrig")).unwrap(), text)
    };
    let (plain, _) = rig(None);
    let peak = |rig: &Rig, name: &str| -> f64 {
        let patches = rig.patches.iter().filter_map(|p| {
            let shape = p.transfer.shapes.iter().find(|s| s.name.ends_with(name))?;
            Some((p.transfer.alpha, shape))
        });
        patches
            .flat_map(|(alpha, shape)| {
                shape
                    .deltas
                    .iter()
                    .map(move |d| alpha * f64::from(d.norm()))
            })
            .fold(0.0, f64::max)
    };
    for alpha in ["patch", "shape", "map", "own"] {
        let (fitted, text) = rig(Some(alpha));
        assert!(text.contains("own shapes          2,"), "{text}");
        assert!(text.contains("hat.obj passed over"), "{text}");
        let more = peak(&fitted, ".mouthSmileLeft") / peak(&plain, ".mouthSmileLeft");
        assert!(
            (1.2..1.6).contains(&more),
            "{alpha}: the smile grew by {more}"
        );
        let wider = fitted.jaw.hinge.open_angle / plain.jaw.hinge.open_angle;
        assert!(
            (1.25..1.55).contains(&wider),
            "{alpha}: the jaw opens {wider}"
        );
    }
}
