//! Scenes with faces of their own: the examples of the documents are modelled and recorded, each
//! face under its name; a rig and a take of the command line go before those of a face that is
//! alone; `fabrig scene` shows and checks them.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::LazyLock;

use assert_cmd::Command;
use fabrig_core::pipeline::{RigFaceOptions, rig_face};
use fabrig_core::recording::RecordingReader;
use fabrig_core::scene::Scene;
use fabrig_core::template::{demo_face, human};
use serde_json::Value;

/// The file of the demo face's rig.
static RIG: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("face.fabrig");
    let go_on = &mut |_| ControlFlow::Continue(());
    let rigged = rig_face(&demo_face(), human(), &RigFaceOptions::default(), go_on).unwrap();
    rigged.rig.save(&path).unwrap();
    std::fs::read(path).unwrap()
});

/// A folder with the example scenes and what they name: a rig and a short take.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scenes");
    for entry in std::fs::read_dir(examples).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
    }
    std::fs::write(folder.path().join("face.fabrig"), &*RIG).unwrap();
    let take = "time,jawOpen,mouthSmileLeft\n0,0,0\n0.5,0.6,0.3\n1,0.1,0.8\n";
    std::fs::write(folder.path().join("take.csv"), take).unwrap();
    folder
}

fn run(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::cargo_bin("fabrig")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (
        output.status.code(),
        text(output.stdout),
        text(output.stderr),
    )
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let (code, said, errors) = run(folder, arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {errors}");
    serde_json::from_str(&said).unwrap()
}

#[test]
fn the_examples_are_modelled_and_recorded() {
    let folder = folder();
    let folder = folder.path();
    let animate =
        |scene: &str, out: &str| json(folder, &["animate", "--scene", scene, "-o", out, "--json"]);
    let lying = animate("lying_down.toml", "lying.mcap");
    assert_eq!(lying["frames"], 31);
    let wind = animate("wind_from_the_side.toml", "wind.mcap");
    let off = |report: &Value| report["settle_rms_max"].as_f64().unwrap();
    assert!(
        off(&lying) > 0.5 && off(&wind) > 0.5,
        "{} {}",
        off(&lying),
        off(&wind)
    );
    let both = animate("two_faces.toml", "two.mcap");
    assert_eq!(both["faces"][1][0], "bob");
    assert_eq!(both["faces"][1][1]["frames"], 37);
    let mut readers = RecordingReader::open_all(folder.join("two.mcap")).unwrap();
    let firsts: Vec<_> = readers
        .iter_mut()
        .map(|reader| reader.next_frame().unwrap().unwrap())
        .collect();
    let places: Vec<f64> = firsts.iter().map(|f| f.head.translation.vector.x).collect();
    assert!((places[0] + 130.0).abs() < 0.01 && (places[1] - 130.0).abs() < 0.01);
    let (code, _, errors) = run(
        folder,
        &["render", "two.mcap", "-o", "two.png", "--size", "64"],
    );
    assert_eq!(code, Some(0), "{errors}");
    let facts = json(folder, &["info", "two.mcap", "--json"]);
    assert_eq!(facts["vertices_of_surfaces"]["bob/skin"], 13_082);
}

#[test]
fn what_the_documents_show_of_scenes_is_read() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let mut count = 0;
    for page in ["scenes.md", "formats.md"] {
        let text = std::fs::read_to_string(docs.join(page)).unwrap();
        for block in text.split("```toml\n").skip(1) {
            let block = block.split("```").next().unwrap();
            Scene::from_toml(block).unwrap_or_else(|error| panic!("{page}: {error}\n{block}"));
            count += 1;
        }
    }
    assert!(count > 5, "{count}");
}

#[test]
fn a_scene_is_checked_and_shown() {
    let folder = folder();
    let folder = folder.path();
    let two = json(folder, &["scene", "check", "two_faces.toml", "--json"]);
    assert_eq!((&two["frames"], &two["fps"]), (&37.into(), &30.0.into()));
    let [ann, bob] = [0, 1].map(|face| &two["faces"][face]["simulated"]);
    assert_eq!((ann, bob), (&44.into(), &11.into()));
    let (_, said, _) = run(folder, &["scene", "check", "wind_from_the_side.toml"]);
    assert!(
        said.contains("gusts of 3000 mm/s") && said.contains("44 of 44 patches"),
        "{said}"
    );
    let (code, said, _) = run(folder, &["scene", "show"]);
    assert_eq!(code, Some(0));
    std::fs::write(folder.join("all.toml"), said).unwrap();
    let (code, said, errors) = run(folder, &["scene", "check", "all.toml"]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(said.contains("none of its own"), "{said}");
}

#[test]
fn the_command_line_goes_before_a_face_that_is_alone() {
    let folder = folder();
    let folder = folder.path();
    std::fs::write(folder.join("quick.csv"), "time,jawOpen\n0,0\n0.1,0.5\n").unwrap();
    let quick = ["--motion", "quick.csv", "-o", "out.mcap", "--json"];
    let of = |scene: &'static str, rig: &'static [&'static str]| {
        let mut arguments = vec!["animate", "--scene", scene];
        arguments.extend(rig);
        arguments.extend(quick);
        arguments
    };
    let report = json(folder, &of("lying_down.toml", &["face.fabrig"]));
    assert_eq!(
        (&report["frames"], &report["fps"]),
        (&4.into(), &30.0.into())
    );
    let (code, _, errors) = run(folder, &of("two_faces.toml", &[]));
    assert!(code == Some(1) && errors.contains("2 faces"), "{errors}");
    std::fs::write(folder.join("plain.toml"), "fps = 20\n").unwrap();
    let report = json(folder, &of("plain.toml", &["face.fabrig"]));
    assert_eq!(report["fps"], 20.0);
    let (code, _, errors) = run(
        folder,
        &["animate", "--scene", "plain.toml", "-o", "out.mcap"],
    );
    assert!(code == Some(1) && errors.contains("[[faces]]"), "{errors}");
}
