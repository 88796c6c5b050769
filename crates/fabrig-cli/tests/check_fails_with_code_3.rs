//! `fabrig check` leaves with 0 on a sound rig and with 3, and the reason, on one whose shape
//! was scaled away by the edits beside it; its page holds every shape.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::ops::ControlFlow;
use std::process::Output;

use assert_cmd::Command;
use fabrig_core::edit::muscle_shape_names;
use fabrig_core::pipeline::{RigFaceOptions, rig_face};
use fabrig_core::template;

#[test]
fn a_dead_shape_fails_the_gate() {
    let face = template::demo_face();
    let options = RigFaceOptions::default();
    let rigged = rig_face(&face, template::human(), &options, &mut |_| {
        ControlFlow::Continue(())
    });
    let rig = rigged.unwrap().rig;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    rig.save(at("face.fabrig")).unwrap();
    let check = |args: &[&str]| -> Output {
        Command::cargo_bin("fabrig")
            .unwrap()
            .current_dir(folder.path())
            .args(["check", "face.fabrig"])
            .args(args)
            .output()
            .unwrap()
    };
    let sound = check(&[]);
    let text = String::from_utf8(sound.stdout).unwrap();
    assert_eq!(sound.status.code(), Some(0), "{text}");
    assert!(text.contains("passes"), "{text}");

    let strict = check(&["--gate", "leak-mm=0", "--json"]);
    assert_eq!(strict.status.code(), Some(3));
    let report: serde_json::Value = serde_json::from_slice(&strict.stdout).unwrap();
    assert_eq!(report["passes"], false);
    assert_eq!(report["findings"][0]["gate"], "leak_mm");

    let edits: String = muscle_shape_names(&rig)
        .iter()
        .filter(|name| name.ends_with(".noseSneerLeft"))
        .map(|name| format!("[shapes.\"{name}\"]\nstrength = 0.0\n"))
        .collect();
    std::fs::write(at("face.edits.toml"), edits).unwrap();
    let broken = check(&["--report", "check.html"]);
    let text = String::from_utf8(broken.stdout).unwrap();
    assert_eq!(broken.status.code(), Some(3), "{text}");
    assert!(text.contains("noseSneerLeft is dead"), "{text}");
    let page = std::fs::read_to_string(at("check.html")).unwrap();
    assert_eq!(page.matches("<img").count(), 3 + 52);
    assert!(page.contains("<figcaption class=\"bad\">noseSneerLeft"));
    for args in [["--gate", "leek=1"], ["--report", "check.txt"]] {
        assert_ne!(check(&args).status.code(), Some(0));
    }
}
