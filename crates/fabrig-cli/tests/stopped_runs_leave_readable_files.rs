//! Ctrl-C ends a run with exit code 3, a word on standard error and a whole recording of the
//! frames there were; a killed run leaves a partial file of which the flushed frames are read.

#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fabrig_core::recording::RecordingReader;

/// Starts the demo and waits until some of the recording is in the file.
fn started(output: &Path) -> (Child, PathBuf) {
    let child = Command::new(env!("CARGO_BIN_EXE_fabrig"))
        .args(["demo", "-o"])
        .arg(output)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    let mut partial = output.as_os_str().to_owned();
    partial.push(".partial");
    let partial = PathBuf::from(partial);
    let clock = Instant::now();
    while std::fs::metadata(&partial).map_or(0, |file| file.len()) < 2 << 20 {
        assert!(
            clock.elapsed() < Duration::from_secs(120),
            "nothing recorded"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    (child, partial)
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args([name, &child.id().to_string()])
        .status();
    assert!(sent.expect("kill").success());
}

/// Frames with meshes, and the time of the last. (s)
fn frames(mut reader: RecordingReader) -> (usize, f64) {
    let (mut count, mut last) = (0, 0.0);
    while let Some(frame) = reader.next_frame().expect("readable") {
        count += 1;
        last = frame.time_secs;
    }
    (count, last)
}

#[test]
fn ctrl_c_leaves_a_whole_recording_and_says_so() {
    let folder = tempfile::tempdir().expect("folder");
    let output = folder.path().join("demo.mcap");
    let (child, partial) = started(&output);
    signal(&child, "-INT");
    let ended = child.wait_with_output().expect("ended");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(3), "{said}");
    let recorded: usize = said
        .split("stopped after ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next()?.parse().ok())
        .unwrap_or_else(|| panic!("says nothing of stopping: {said}"));
    assert!(!partial.exists());
    let (count, last) = frames(RecordingReader::open(&output).expect("whole"));
    // Meshes at 30 of 60 frames a second.
    assert_eq!(count, recorded.div_ceil(2), "{said}");
    assert!(last < 12.0, "the take was recorded to its end");
    assert!(folder.path().join("demo.foxglove.json").exists());
}

#[test]
fn a_killed_run_leaves_its_flushed_frames() {
    let folder = tempfile::tempdir().expect("folder");
    let output = folder.path().join("demo.mcap");
    let (mut child, partial) = started(&output);
    signal(&child, "-KILL");
    child.wait().expect("ended");
    assert!(!output.exists());
    let (count, _) = frames(RecordingReader::with_recovery(&partial).expect("opened"));
    // A chunk holds half a second: fifteen frames with meshes.
    assert!(count >= 14, "{count}");
}
