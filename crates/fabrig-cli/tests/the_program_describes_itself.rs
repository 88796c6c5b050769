//! Every verb has help with examples; completions and the manual page know all verbs; the doctor
//! finds this build well, and what is recorded is what was asked for.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use assert_cmd::Command;
use serde_json::Value;

fn said(arguments: &[&str]) -> String {
    let output = Command::cargo_bin("fabrig")
        .unwrap()
        .args(arguments)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// The verbs that the help lists.
fn verbs() -> Vec<String> {
    let help = said(&["--help"]);
    let commands = help.split("Commands:").nth(1).unwrap();
    let commands = commands.split("Options:").next().unwrap();
    let words = commands.lines().filter(|line| {
        // Continued descriptions are indented further.
        line.starts_with("  ") && !line.starts_with("   ")
    });
    words
        .filter_map(|line| line.split_whitespace().next())
        .filter(|verb| *verb != "help")
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_verb_is_explained_by_examples_completed_and_in_the_manual() {
    let verbs = verbs();
    assert!(verbs.len() > 12, "{verbs:?}");
    let man = said(&["man"]);
    for verb in &verbs {
        let help = said(&[verb, "--help"]);
        let examples = help.split("Examples:").nth(1).unwrap_or_default();
        assert!(
            examples.contains(&format!("fabrig {verb}")),
            "{verb}: {help}"
        );
        let heading = format!(".SH FABRIG {}", verb.to_uppercase());
        assert!(man.contains(&heading), "{heading}");
    }
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = said(&["completions", shell]);
        for verb in &verbs {
            assert!(script.contains(verb.as_str()), "{shell}: {verb}");
        }
    }
}

#[test]
fn the_doctor_finds_this_build_well() {
    let found: Value = serde_json::from_str(&said(&["doctor", "--json"])).unwrap();
    assert_eq!(found["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(found["simulation"]["works"], true);
    assert_eq!(found["writing"]["works"], true);
    assert_eq!(found["template"]["nodes"], 19_380);
    let has_play = found["features"]
        .as_array()
        .unwrap()
        .contains(&"play".into());
    assert_eq!(has_play, cfg!(feature = "play"));
}

#[test]
fn a_recording_holds_what_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let path = path.to_str().unwrap();
    let report = said(&[
        "demo",
        "-o",
        path,
        "--json",
        "--without-dynamics",
        "--record",
        "weights,errors,magnets",
    ]);
    let report: Value = serde_json::from_str(&report).unwrap();
    let recording = &report["animation"]["recording"];
    let mut topics: Vec<&str> = recording["topics"]
        .as_array()
        .unwrap()
        .iter()
        .map(|topic| topic["topic"].as_str().unwrap())
        .collect();
    topics.sort_unstable();
    assert_eq!(
        topics,
        ["/log", "/points/magnets", "/stats", "/tf", "/weights"]
    );
    for topic in recording["topics"].as_array().unwrap() {
        assert!(topic["messages"].as_u64().unwrap() > 0);
        assert!(topic["raw_bytes"].as_u64().unwrap() > 0);
    }
    // Half of a step of 2^-13 decimetres.
    let error = recording["position_error_um"].as_f64().unwrap();
    assert!((error - 1e5 / 8192.0 / 2.0).abs() < 1e-9, "{error}");
    let unknown = Command::cargo_bin("fabrig")
        .unwrap()
        .args(["demo", "-o", path, "--record", "skins"])
        .assert();
    unknown.code(2).stderr(predicates::str::contains("magnets"));
}
