//! Every command of `docs/export.md` runs, on the demo face and a short take, and what it names
//! is there. Only Rerun's own program is not asked for.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use assert_cmd::Command;
use fabrig_core::mesh::io::write_obj;
use fabrig_core::template::demo_face;

const GUIDE: &str = include_str!("../../../docs/export.md");

#[test]
fn every_command_of_the_guide_runs() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_obj(at("face.obj"), &demo_face()).unwrap();
    let take = "time,jawOpen,mouthSmileLeft\n0,0,0\n0.1,0.4,0.2\n0.2,0.7,0.5\n0.3,0.2,0.9\n";
    std::fs::write(at("take.csv"), take).unwrap();
    let run = |arguments: &[&str]| {
        let output = Command::cargo_bin("fabrig")
            .unwrap()
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {said}");
        String::from_utf8(output.stdout).unwrap()
    };
    let mut commands = 0;
    for block in GUIDE.split("```sh\n").skip(1) {
        for line in block.split("```").next().unwrap().lines() {
            let line = line.split('#').next().unwrap().trim();
            let mut arguments: Vec<&str> = line.split_whitespace().collect();
            assert_eq!(arguments.remove(0), "fabrig", "{line}");
            if arguments.contains(&"rrd") {
                continue;
            }
            if arguments[0] == "convert" && !at("out.mcap").exists() {
                run(&[
                    "animate",
                    "face.fabrig",
                    "--motion",
                    "take.csv",
                    "-o",
                    "out.mcap",
                ]);
            }
            if arguments[0] == "export" {
                // The same, quicker: settling and comparing are tested in the core.
                arguments.extend(["--without-dynamics", "--skip-check"]);
            }
            let said = run(&arguments);
            assert!(
                arguments[0] == "rig" || said.contains("\nwritten  "),
                "{line}: {said}"
            );
            if let Some(k) = arguments.iter().position(|a| *a == "-o") {
                assert!(at(arguments[k + 1]).exists(), "{line}");
            }
            commands += 1;
        }
    }
    assert_eq!(commands, 6);
    assert!(at("out.usda").exists());
    let report = run(&[
        "export",
        "face.fabrig",
        "-o",
        "shapes",
        "--json",
        "--skip-check",
        "--without-dynamics",
        "--unit",
        "mm",
    ]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(
        (&report["files"], &report["millimetres_per_unit"]),
        (&53.into(), &1.0.into())
    );

    for (arguments, code, says) in [
        (&["export", "face.fabrig", "-o", "face.fbx"][..], 1, "'fbx'"),
        (
            &["export", "face.fabrig", "-o", "a.glb", "--baked"],
            2,
            "--motion",
        ),
        (&["export", "face.fabrig", "-o", "a.pc2"], 1, "--motion"),
        (
            &["export", "face.fabrig", "-o", "face.obj/x"],
            1,
            "does not exist",
        ),
        (&["convert", "out.mcap"], 1, "--to"),
        (
            &["convert", "out.mcap", "--to", "glb", "--face", "face.obj"],
            1,
            "--rig",
        ),
        (&["convert", "face.fabrig", "-o", "a.glb"], 1, "face.fabrig"),
    ] {
        Command::cargo_bin("fabrig")
            .unwrap()
            .current_dir(folder.path())
            .args(arguments)
            .assert()
            .code(code)
            .stderr(predicates::str::contains(says));
    }
    assert!(!at("a.glb").exists());
}
