//! The bundled face and take become a recording with nothing but the binary; equal inputs give
//! equal bytes; a rig that was cut is refused.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use assert_cmd::Command;
use serde_json::Value;

fn fabrig() -> Command {
    Command::cargo_bin("fabrig").unwrap()
}

fn json(command: &mut Command) -> Value {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_demo_is_recorded_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let report = json(
        fabrig()
            .args(["demo", "--json", "-o"])
            .arg(path("demo.mcap"))
            .arg("--rig")
            .arg(path("demo.fabrig")),
    );
    let animation = &report["animation"];
    assert_eq!(animation["is_complete"], true);
    assert!(animation["recording"]["duration_secs"].as_f64().unwrap() >= 8.0);
    assert_eq!(animation["guards"]["frozen_patches"], 0);
    let median = report["rig"]["template_to_face"]["median"]
        .as_f64()
        .unwrap();
    assert!(median < 1.0, "registered to {median} mm");
    for name in ["demo.foxglove.json", "open_in_rerun.py"] {
        assert!(path(name).is_file(), "{name}");
    }

    let info = json(fabrig().args(["info", "--json"]).arg(path("demo.mcap")));
    assert_eq!(info["kind"], "recording");
    assert!(info["frames_with_meshes"].as_u64().unwrap() >= 240);
    let rig = json(fabrig().args(["info", "--json"]).arg(path("demo.fabrig")));
    assert_eq!(
        (rig["patches"].as_u64(), rig["shapes"].as_u64()),
        (Some(44), Some(52))
    );
    assert_eq!(rig["nodes"], 19_380);
    let parts = rig["parts"].as_array().unwrap();
    for name in ["eye_l", "eye_r", "upper_teeth", "lower_teeth", "tongue"] {
        assert!(
            parts.iter().any(|part| part == name),
            "no {name} in {parts:?}"
        );
    }

    // The same rig through a short take, twice.
    std::fs::write(
        path("blink.keys"),
        "fabrig-keys 1\nfps 30\n0.2 eyeBlink=1\n0.4 eyeBlink=0\n",
    )
    .unwrap();
    for name in ["a.mcap", "b.mcap"] {
        json(
            fabrig()
                .arg("animate")
                .arg(path("demo.fabrig"))
                .arg("--motion")
                .arg(path("blink.keys"))
                .args(["--json", "-o"])
                .arg(path(name)),
        );
    }
    assert_eq!(
        std::fs::read(path("a.mcap")).unwrap(),
        std::fs::read(path("b.mcap")).unwrap()
    );

    fabrig()
        .arg("render")
        .arg(path("a.mcap"))
        .args(["--time", "0.2", "--size", "64", "-o"])
        .arg(path("blink.png"))
        .assert()
        .success();
    assert!(
        std::fs::read(path("blink.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );

    let bytes = std::fs::read(path("demo.fabrig")).unwrap();
    std::fs::write(path("cut.fabrig"), &bytes[..bytes.len() / 2]).unwrap();
    let output = fabrig()
        .arg("animate")
        .arg(path("cut.fabrig"))
        .arg("--motion")
        .arg(path("blink.keys"))
        .arg("-o")
        .arg(path("cut.mcap"))
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert!(stderr.contains("cut"), "{stderr}");
    assert!(!path("cut.mcap").exists() && !path("cut.mcap.partial").exists());
}
