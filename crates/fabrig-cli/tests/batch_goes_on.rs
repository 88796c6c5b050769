//! A batch that is killed goes on where it was; one worker or two, killed or not, the bytes are
//! the same; what cannot be made is named, costs nothing else, and leaves no half of a file.

#![cfg(unix)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use fabrig_core::batch::{BenchWork, write_bench_work};
use serde_json::Value;

/// Two people, two clips of a third of a second.
fn work(folder: &Path) -> PathBuf {
    let work = BenchWork {
        faces: 2,
        clips: 2,
        seconds: 0.3,
        outputs: &[
            "path = \"data/{face}/{take}.npz\"\ncontent = \"dataset\"",
            "path = \"{face}/{take}.mcap\"",
        ],
    };
    write_bench_work(folder, &work).expect("written")
}

fn fabrig(manifest: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fabrig"));
    command
        .arg("batch")
        .arg(manifest)
        .arg("-o")
        .arg(out)
        .arg("--json");
    command
}

fn report(ended: &Output) -> Value {
    let said = String::from_utf8_lossy(&ended.stderr);
    serde_json::from_slice(&ended.stdout).unwrap_or_else(|e| panic!("{e}: {said}"))
}

/// Every file below a folder but the batch's own.
fn files(folder: &Path) -> BTreeMap<PathBuf, PathBuf> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder).expect("below").to_owned(), path);
            }
        }
    }
    found
}

fn results(out: &Path) -> BTreeMap<PathBuf, PathBuf> {
    let mut found = files(out);
    found.retain(|name, _| !name.starts_with(".fabrig"));
    found
}

fn records(out: &Path) -> Vec<PathBuf> {
    let found = files(out).into_keys();
    let records = found.filter(|name| name.starts_with(".fabrig") && name.ends_with_json());
    records.collect()
}

trait EndsWithJson {
    fn ends_with_json(&self) -> bool;
}

impl EndsWithJson for PathBuf {
    fn ends_with_json(&self) -> bool {
        self.extension().is_some_and(|e| e == "json")
    }
}

fn assert_nothing_half_written(out: &Path) {
    for name in files(out).into_keys() {
        let text = name.display().to_string();
        assert!(!text.ends_with(".partial"), "{text}");
    }
}

fn changed_at(path: &Path) -> SystemTime {
    std::fs::metadata(path)
        .and_then(|m| m.modified())
        .expect("time")
}

#[test]
fn a_killed_run_goes_on_and_comes_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("folder");
    let manifest = work(folder.path());
    let (killed, clean) = (folder.path().join("killed"), folder.path().join("clean"));
    let mut child = fabrig(&manifest, &killed)
        .args(["--jobs", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("started");
    let clock = Instant::now();
    // The first face's rig and at least one of its pairs.
    while !killed.exists() || records(&killed).len() < 3 {
        assert!(
            clock.elapsed() < Duration::from_secs(240),
            "nothing was made"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().expect("killed");
    child.wait().expect("ended");
    let kept: Vec<(PathBuf, SystemTime)> = records(&killed)
        .iter()
        .map(|record| {
            let output = record
                .strip_prefix(".fabrig")
                .expect("below")
                .with_extension("");
            let output = killed.join(output);
            let time = changed_at(&output);
            (output, time)
        })
        .collect();

    let ended = fabrig(&manifest, &killed)
        .args(["--jobs", "1"])
        .output()
        .expect("run");
    assert_eq!(ended.status.code(), Some(0));
    let counts = &report(&ended)["counts"];
    assert_eq!(counts["jobs"], 12);
    assert_eq!(counts["up_to_date"], kept.len());
    assert_eq!(counts["done"], 12 - kept.len());
    for (output, time) in &kept {
        assert_eq!(
            changed_at(output),
            *time,
            "{} was made again",
            output.display()
        );
    }
    assert_nothing_half_written(&killed);

    let ended = fabrig(&manifest, &clean)
        .args(["--jobs", "2"])
        .output()
        .expect("run");
    assert_eq!(ended.status.code(), Some(0));
    let first = report(&ended);
    assert_eq!(first["counts"]["done"], 12);
    assert!(first["throughput"].as_f64().is_some_and(|rate| rate > 0.0));
    let (one, two) = (results(&killed), results(&clean));
    assert!(one.keys().eq(two.keys()), "{one:?} {two:?}");
    for (name, path) in &one {
        let same = std::fs::read(path).expect("read") == std::fs::read(&two[name]).expect("read");
        assert!(same, "{} differs", name.display());
    }

    // Nothing is left to do, until a setting or a result changes.
    let ended = fabrig(&manifest, &clean).output().expect("run");
    assert_eq!(report(&ended)["counts"]["up_to_date"], 12);
    let clip = &two[Path::new("data/child/clip_1.npz")];
    std::fs::write(clip, "short").expect("written");
    let text = std::fs::read_to_string(&manifest).expect("read");
    std::fs::write(&manifest, text.replace("to = 0.3\n", "to = 0.2\n")).expect("written");
    let ended = fabrig(&manifest, &clean)
        .arg("--dry-run")
        .output()
        .expect("run");
    let planned = report(&ended);
    let again = planned.as_array().expect("list").iter();
    let again: Vec<&str> = again
        .filter(|row| row["standing"] != "up to date")
        .map(|row| row["output"].as_str().expect("text"))
        .collect();
    assert_eq!(
        again,
        [
            "data/child/clip_0.npz",
            "child/clip_0.mcap",
            "data/child/clip_1.npz",
            "data/demo/clip_0.npz",
            "demo/clip_0.mcap",
        ]
    );
    // One job by itself, as a worker elsewhere does it.
    let ended = fabrig(&manifest, &clean)
        .args(["--job", "data/child/clip_1.npz"])
        .output()
        .expect("run");
    assert_eq!(ended.status.code(), Some(0));
    assert_eq!(report(&ended)["output"], "data/child/clip_1.npz");
    let same = std::fs::read(clip).expect("read")
        == std::fs::read(&one[Path::new("data/child/clip_1.npz")]).expect("read");
    assert!(same, "the job alone came to other bytes");
}

#[test]
fn what_is_broken_is_named_and_the_rest_is_made() {
    let folder = tempfile::tempdir().expect("folder");
    let manifest = work(folder.path());
    let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("put");
    put("faces/words.obj", "this is no mesh\n");
    put(
        "faces/ball.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\n",
    );
    let broken = ["words", "ball", "gone"];
    let mut text = std::fs::read_to_string(&manifest).expect("read");
    for name in broken {
        text += &format!("[[faces]]\nfile = \"faces/{name}.obj\"\n");
    }
    text += "[[takes]]\nfile = \"lost.csv\"\n[[pairs]]\nfaces = [\"child\", \"words\", \"ball\", \
             \"gone\"]\n";
    std::fs::write(&manifest, text).expect("written");
    let out = folder.path().join("out");
    let ended = fabrig(&manifest, &out).output().expect("run");
    assert_eq!(ended.status.code(), Some(3));
    let report = report(&ended);
    let failures = report["failures"].as_array().expect("list");
    let named: Vec<(&str, &str)> = failures
        .iter()
        .map(|row| {
            (
                row["kind"].as_str().expect("kind"),
                row["subject"].as_str().expect("subject"),
            )
        })
        .collect();
    for name in broken {
        assert!(named.contains(&("face", name)), "{named:?}");
    }
    assert!(named.contains(&("take", "lost")), "{named:?}");
    assert_eq!(named.len(), 4, "{failures:?}");
    for row in failures {
        let message = row["message"].as_str().expect("text");
        assert!(message.len() > 20 && !message.contains('\n'), "{message}");
        assert!(row["outputs"].as_array().is_some_and(|o| !o.is_empty()));
    }
    assert!(out.join("child/clip_1.mcap").exists());
    // Two rigs, and of the one that has pairs its topology and two outputs a take.
    assert_eq!(report["counts"]["done"], 2 + 1 + 4);
    assert_nothing_half_written(&out);
}

/// Runs a script in a place of its own where it may mount, if this system lets it.
fn in_own_mounts(script: &str, arguments: &[&Path]) -> Option<Output> {
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--mount", "sh", "-ec", script, "sh"]);
    let probe = Command::new("unshare")
        .args(["--map-root-user", "--mount", "sh", "-ec"])
        .arg("mount -t tmpfs none /mnt")
        .output();
    if !probe.is_ok_and(|probe| probe.status.success()) {
        // Then full disks are not tried; full files are, below.
        return None;
    }
    Some(command.args(arguments).output().expect("run"))
}

#[test]
fn a_disk_that_takes_nothing_more_is_said() {
    let folder = tempfile::tempdir().expect("folder");
    let manifest = work(folder.path());
    let out = folder.path().join("out");
    std::fs::create_dir(&out).expect("folder");
    let program = Path::new(env!("CARGO_BIN_EXE_fabrig"));

    // A disk that holds a rig and little more, then one that cannot be written to at all.
    let script = "mount -t tmpfs -o size=10m none \"$3\"; code=0
         \"$1\" batch \"$2\" -o \"$3\" --json --jobs 1 > \"$4\" || code=$?
         (cd \"$3\"; find . -type f) > \"$5\"; mount -o remount,ro \"$3\"
         second=0; \"$1\" batch \"$2\" -o \"$3\" --json > \"$6\" || second=$?
         echo $code $second";
    let [full, listed, read_only] = ["full.json", "list", "ro.json"].map(|n| folder.path().join(n));
    let tried = in_own_mounts(
        script,
        &[program, &manifest, &out, &full, &listed, &read_only],
    );
    if let Some(ended) = tried {
        let said = String::from_utf8_lossy(&ended.stdout).into_owned();
        assert_eq!(
            said.trim(),
            "3 3",
            "{}",
            String::from_utf8_lossy(&ended.stderr)
        );
        let read = |path: &Path| -> Value {
            serde_json::from_slice(&std::fs::read(path).expect("read")).expect("report")
        };
        let report = read(&full);
        assert_eq!(report["failures"][0]["kind"], "disk", "{report:#}");
        let message = report["failures"][0]["message"].as_str().expect("text");
        assert!(message.contains("No space left"), "{message}");
        let counts = &report["counts"];
        let (done, lost) = (counts["done"].as_u64(), counts["lost"].as_u64());
        assert!(done >= Some(1) && lost >= Some(1), "{counts}");
        assert_eq!(counts["failed"], 1);
        let listed = std::fs::read_to_string(&listed).expect("read");
        assert!(!listed.contains(".partial"), "{listed}");
        let whole = listed
            .lines()
            .filter(|line| !line.contains("/.fabrig/"))
            .count() as u64;
        let index = u64::from(listed.contains("dataset.json"));
        assert_eq!(Some(whole - index), done, "{listed}");

        let report = read(&read_only);
        assert_eq!(report["failures"][0]["kind"], "disk");
        let message = report["failures"][0]["message"].as_str().expect("text");
        assert!(message.contains("Read-only"), "{message}");
        assert_eq!(report["counts"]["up_to_date"].as_u64(), done);
        assert_eq!(report["counts"]["done"], 0);
    }

    // Files that cannot grow: a limit that every system has.
    let limited = Command::new("sh")
        .args([
            "-c",
            "trap '' XFSZ; ulimit -f 600; exec \"$0\" batch \"$1\" -o \"$2\" --json",
        ])
        .args([program, &manifest, &out])
        .output()
        .expect("run");
    assert_eq!(limited.status.code(), Some(3));
    let said = report(&limited);
    let kinds: Vec<&str> = said["failures"]
        .as_array()
        .expect("list")
        .iter()
        .map(|row| row["kind"].as_str().expect("kind"))
        .collect();
    assert_eq!(kinds, ["output", "output"], "{said:#}");
    assert_eq!(said["counts"]["failed"], 2);
    assert_nothing_half_written(&out);
    assert!(results(&out).is_empty());

    // A place where no folder can be.
    let nowhere = manifest.join("out");
    let ended = fabrig(&manifest, &nowhere).output().expect("run");
    assert_eq!(ended.status.code(), Some(3));
    let said = report(&ended);
    assert_eq!(said["failures"][0]["kind"], "disk");
    assert_eq!(said["counts"]["lost"], 12);
}
