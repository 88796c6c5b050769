//! Bad input of every kind gives one line on standard error that says what, where and what
//! next, exit code 1 (failed) or 2 (wrong usage), and leaves no file behind.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

struct Case {
    folder: TempDir,
}

impl Case {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    }

    /// Runs `fabrig` and checks the one line, the code, and that only the inputs are there.
    fn fails(&self, args: &[&str], code: i32, parts: &[&str]) {
        let before = files(self.folder.path());
        let output = Command::cargo_bin("fabrig")
            .unwrap()
            .current_dir(self.folder.path())
            .args(args)
            .output()
            .unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{args:?}: {stderr}");
        assert_eq!(stderr.lines().count(), 1, "{args:?}: {stderr}");
        assert!(output.stdout.is_empty(), "{args:?}");
        for part in parts {
            assert!(stderr.contains(part), "{args:?}: no '{part}' in: {stderr}");
        }
        assert_eq!(files(self.folder.path()), before, "{args:?}");
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files
}

#[test]
fn faces() {
    let case = Case::new();
    let rig = |face: &str, code, parts: &[&str]| {
        case.fails(&["rig", face, "-o", "out.fabrig"], code, parts);
    };
    rig("missing.obj", 1, &["cannot read missing.obj"]);
    case.file("empty.obj", "");
    rig("empty.obj", 1, &["empty.obj", "0 vertices"]);
    case.file("points.obj", "v 0 0 0\nv 1 0 0\n");
    rig("points.obj", 1, &["2 vertices and 0 faces"]);
    case.file("nan.obj", format!("v 0 nan 0\n{TRIANGLE}"));
    rig(
        "nan.obj",
        1,
        &["nan.obj:1:", "'nan'", "not a finite number"],
    );
    case.file("range.obj", format!("{TRIANGLE}f 1 2 9\n"));
    rig("range.obj", 1, &["range.obj:5:", "vertex 9", "has 3"]);
    case.file("tiny.obj", TRIANGLE);
    rig("tiny.obj", 1, &["tiny.obj was not rigged", "triangle"]);
    case.file("face.fbx", "x");
    rig("face.fbx", 1, &["'fbx'", ".obj"]);
}

#[test]
fn usage() {
    let case = Case::new();
    case.file("tiny.obj", TRIANGLE);
    case.fails(
        &["rig", "tiny.obj", "-o", "out.fabrig", "--unit", "furlong"],
        2,
        &["'furlong'", "--unit", "mm, cm, m, in"],
    );
    case.fails(&["rig", "tiny.obj"], 2, &["--output"]);
    case.fails(&["fly"], 2, &["'fly'"]);
    case.fails(
        &["demo", "-o", "out.mcap", "--wind", "1,2"],
        2,
        &["--wind", "X,Y,Z"],
    );
    case.fails(
        &["rig", "tiny.obj", "-o", "no/such/folder/out.fabrig"],
        1,
        &["no/such/folder", "does not exist"],
    );
}

#[test]
fn landmarks() {
    let case = Case::new();
    case.file("tiny.obj", TRIANGLE);
    case.file("list.json", "[1, 2]");
    case.file("none.json", "{}");
    for (file, part) in [
        ("list.json", "landmark name to [x, y, z]"),
        ("none.json", "no landmarks"),
        ("missing.json", "cannot read"),
    ] {
        case.fails(
            &["rig", "tiny.obj", "-o", "out.fabrig", "--landmarks", file],
            1,
            &[file, part],
        );
    }
}

#[test]
fn rigs() {
    let case = Case::new();
    case.file("take.csv", "time,jawOpen\n0,0\n1,1\n");
    case.file("other.fabrig", "not a rig at all, just text");
    case.file("empty.fabrig", "");
    for (file, part) in [
        ("missing.fabrig", "missing.fabrig"),
        ("other.fabrig", "not a rig file"),
        ("empty.fabrig", "not a rig file"),
    ] {
        case.fails(
            &["animate", file, "--motion", "take.csv", "-o", "out.mcap"],
            1,
            &[file, part],
        );
    }
}

#[test]
fn scenes() {
    let case = Case::new();
    case.file("junk.fabrig", "no rig at all");
    for (name, content, parts) in [
        (
            "key.toml",
            "fps = 30\n[contact]\n  frction = 0.1\n",
            &["key.toml", "line 3, column 3", "`frction`", "`friction`"][..],
        ),
        (
            "word.toml",
            "[contact]\npairs = \"al\"\n",
            &["line 2, column 9", "`contact.pairs`", "mean `all`"],
        ),
        (
            "range.toml",
            "[turbulence]\nlength = -3\n",
            &["line 2, column 10", "`turbulence.length`", "from 0.1", "-3"],
        ),
        (
            "file.toml",
            "[[faces]]\nrig = \"range.tom\"\n",
            &["line 2, column 7", "`faces[0].rig`", "a file that is there"],
        ),
        (
            "rig.toml",
            "[[faces]]\nrig = \"range.toml\"\n",
            &["line 2, column 7", "`faces[0].rig`", "not a rig file"],
        ),
        (
            "junk.toml",
            "[[faces]]\nrig = \"junk.fabrig\"\n",
            &["line 2, column 7", "`faces[0].rig`", "not a rig file"],
        ),
        ("broken.toml", "fps = = 3\n", &["line 1, column 7"]),
    ] {
        case.file(name, content);
        case.fails(&["scene", "check", name], 1, parts);
        case.fails(&["animate", "--scene", name, "-o", "out.mcap"], 1, parts);
    }
    case.fails(
        &["scene", "check", "none.toml"],
        1,
        &["cannot read none.toml"],
    );
    case.fails(&["animate", "-o", "out.mcap"], 2, &["--motion"]);
}

#[test]
fn takes() {
    let case = Case::new();
    for (name, content, parts) in [
        (
            "unknown.csv",
            "time,jawOpne\n0,0\n",
            &["column 2", "'jawOpne'", "nearest: 'jawOpen'"][..],
        ),
        (
            "nan.csv",
            "time,jawOpen\n0,nan\n",
            &["row 2", "'jawOpen'", "'nan'"],
        ),
        (
            "range.csv",
            "time,jawOpen\n0,100\n",
            &["row 2", "'jawOpen'", "100", "clamped"],
        ),
        ("cut.csv", "time,jawOpen\n0,0\n1", &["cut.csv", "1 field"]),
        ("frames.csv", "frame,jawOpen\n0,0\n", &["frames per second"]),
        (
            "take.keys",
            "fabrig-keys 1\n0 jawOpen=2\n",
            &["take.keys:2:", "[0, 1]"],
        ),
        ("empty.csv", "", &["empty.csv"]),
    ] {
        case.file(name, content);
        case.fails(&["info", name], 1, parts);
    }
}

#[test]
fn pictures_and_recordings() {
    let case = Case::new();
    case.file("tiny.obj", TRIANGLE);
    case.file("cut.mcap", b"\x89MCAP0\r\n\x01\x02");
    case.fails(
        &["render", "tiny.obj", "-o", "out.png", "--view", "inside"],
        1,
        &["inside"],
    );
    case.fails(&["render", "tiny.obj", "-o", "out.gif"], 1, &["recording"]);
    case.fails(
        &["render", "tiny.obj", "-o", "out.png", "--pose", "jawOpen=1"],
        1,
        &["only a rig"],
    );
    case.fails(&["render", "cut.mcap", "-o", "out.png"], 1, &["cut.mcap"]);
}
