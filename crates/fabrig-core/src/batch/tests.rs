//! Manifests, keys and standings; nothing is simulated here.

use std::path::Path;

use super::*;

const MANIFEST: &str = r#"
[[faces]]
file = "faces/*.obj"

[[takes]]
file = "takes/*.keys"
[[takes]]
file = "takes/hello.keys"
name = "start"
to = 0.5

[[outputs]]
path = "{face}/{take}.{format}"
formats = ["mcap", "glb"]
[[outputs]]
path = "data/{face}/{take}.npz"
content = "dataset"
[[outputs]]
path = "{face}.glb"
"#;

fn work() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    put("faces/ann.obj", "v 0 0 0\n");
    put("faces/bob.obj", "v 1 0 0\n");
    let keys = "fabrig-keys 1\n0 jawOpen=0\n1 jawOpen=1\n";
    put("takes/hello.keys", keys);
    put(
        "takes/shout.keys",
        "fabrig-keys 1\n0 jawOpen=0\n2 jawOpen=1\n",
    );
    put("work.toml", MANIFEST);
    folder
}

fn plan(folder: &Path, text: &str) -> Result<Plan, BatchError> {
    let manifest = Manifest::from_toml(text, &folder.join("work.toml"))?;
    Plan::new(manifest, &folder.join("out"), &PlanOptions::default())
}

fn keys(plan: &Plan) -> Vec<(String, String)> {
    let jobs = plan.jobs.iter().map(|planned| &planned.job);
    jobs.map(|job| (job.output.clone(), job.key.clone()))
        .collect()
}

fn changed(before: &Plan, after: &Plan) -> Vec<String> {
    let pairs = keys(before).into_iter().zip(keys(after));
    let differing = pairs.filter(|(a, b)| a != b);
    differing.map(|(_, (output, _))| output).collect()
}

#[test]
fn every_face_meets_every_take_once() {
    let folder = work();
    let plan = plan(folder.path(), MANIFEST).unwrap();
    let outputs: Vec<&str> = plan
        .jobs
        .iter()
        .filter(|planned| planned.job.task.face.name == "ann")
        .map(|planned| planned.job.output.as_str())
        .collect();
    assert_eq!(
        outputs,
        [
            "rigs/ann.fabrig",
            "ann.glb",
            "ann/hello.mcap",
            "ann/hello.glb",
            "data/ann/ann.face.npz",
            "data/ann/hello.npz",
            "ann/shout.mcap",
            "ann/shout.glb",
            "data/ann/shout.npz",
            "ann/start.mcap",
            "ann/start.glb",
            "data/ann/start.npz",
        ]
    );
    assert_eq!(plan.jobs.len(), 24);
    for (index, planned) in plan.jobs.iter().enumerate() {
        assert_eq!(
            planned.standing,
            Standing::Missing,
            "{}",
            planned.job.output
        );
        assert!(planned.needs.iter().all(|need| *need < index));
        let rig = format!("rigs/{}.fabrig", planned.job.task.face.name);
        let needs = if planned.job.stage == Stage::Rig {
            vec![]
        } else {
            vec![rig]
        };
        assert_eq!(planned.job.needs, needs, "{}", planned.job.output);
        assert_eq!(Job::from_text(&planned.job.to_text()).unwrap(), planned.job);
    }
    let start = plan.single("ann/start.mcap");
    assert!(
        matches!(&start, Err(BatchError::NotReady { needs, .. }) if needs == "rigs/ann.fabrig"),
        "{start:?}"
    );
    let half = plan.jobs.iter().find(|p| p.job.output == "ann/start.mcap");
    assert_eq!(half.unwrap().size, 0.5);
}

#[test]
fn what_changes_changes_what_comes_of_it_and_nothing_else() {
    let folder = work();
    let before = plan(folder.path(), MANIFEST).unwrap();
    assert_eq!(
        changed(&before, &plan(folder.path(), MANIFEST).unwrap()),
        [""; 0]
    );
    std::fs::write(folder.path().join("faces/bob.obj"), "v 2 0 0\n").unwrap();
    let after = plan(folder.path(), MANIFEST).unwrap();
    let bobs = changed(&before, &after);
    assert_eq!(bobs.len(), 12);
    assert!(bobs.iter().all(|output| output.contains("bob")), "{bobs:?}");
    let take = folder.path().join("takes/shout.keys");
    std::fs::write(&take, "fabrig-keys 1\n0 jawOpen=0\n2 jawOpen=0.5\n").unwrap();
    let shouts = changed(&after, &plan(folder.path(), MANIFEST).unwrap());
    assert_eq!(shouts.len(), 6);
    assert!(shouts.iter().all(|o| o.contains("shout")), "{shouts:?}");
    // Edits that a person puts beside a rig count, and rigs themselves stay.
    let before = plan(folder.path(), MANIFEST).unwrap();
    let edits = folder.path().join("out/rigs/ann.edits.toml");
    std::fs::create_dir_all(edits.parent().unwrap()).unwrap();
    std::fs::write(edits, "[patches.malar_fat_l]\nalpha = 1.2\n").unwrap();
    let edited = changed(&before, &plan(folder.path(), MANIFEST).unwrap());
    assert_eq!(edited.len(), 11);
    assert!(!edited.contains(&"rigs/ann.fabrig".to_owned()));
    // A folder of the same content elsewhere has the same keys.
    let (here, there) = (work(), work());
    let same = changed(
        &plan(here.path(), MANIFEST).unwrap(),
        &plan(there.path(), MANIFEST).unwrap(),
    );
    assert_eq!(same, [""; 0]);
}

#[test]
fn settings_of_an_output_are_its_own() {
    let folder = work();
    let before = plan(folder.path(), MANIFEST).unwrap();
    let text = MANIFEST.replace(
        "content = \"dataset\"",
        "content = \"dataset\"\nskin_hz = 1",
    );
    let after = changed(&before, &plan(folder.path(), &text).unwrap());
    assert_eq!(after.len(), 6);
    let text = format!("{MANIFEST}[[scenes]]\nsubsteps = 16\n");
    let after = changed(&before, &plan(folder.path(), &text).unwrap());
    assert_eq!(after.len(), 18);
}

#[test]
fn missing_inputs_lose_what_needs_them() {
    let folder = work();
    let text = format!(
        "{MANIFEST}[[faces]]\nfile = \"faces/eve.obj\"\n[[takes]]\nfile = \"takes/no.csv\"\n"
    );
    let plan = plan(folder.path(), &text).unwrap();
    let lost = plan
        .jobs
        .iter()
        .filter_map(|planned| match &planned.standing {
            Standing::Lost(failure) => Some((planned.job.output.as_str(), failure)),
            _ => None,
        });
    let lost: Vec<_> = lost.collect();
    // Everything of eve's, and of the take's for the other two.
    assert_eq!(lost.len(), 15 + 2 * 3, "{lost:?}");
    for (output, failure) in lost {
        let subject = if output.contains("eve") { "eve" } else { "no" };
        assert_eq!(failure.subject, subject, "{output}");
        assert!(failure.message.contains(subject), "{failure:?}");
    }
}

#[test]
fn only_brings_what_it_needs() {
    let folder = work();
    let manifest = || Manifest::from_toml(MANIFEST, &folder.path().join("work.toml")).unwrap();
    let out = folder.path().join("out");
    let asked = |only: &[&str]| {
        let only = only.iter().map(|&o| o.to_owned()).collect();
        let options = PlanOptions {
            only,
            verify: false,
        };
        let plan = Plan::new(manifest(), &out, &options)?;
        Ok::<_, BatchError>(
            plan.jobs
                .into_iter()
                .map(|p| p.job.output)
                .collect::<Vec<_>>(),
        )
    };
    assert_eq!(
        asked(&["bob/*.mcap"]).unwrap(),
        [
            "rigs/bob.fabrig",
            "bob/hello.mcap",
            "bob/shout.mcap",
            "bob/start.mcap"
        ]
    );
    let error = asked(&["bob/helo.mcap"]).unwrap_err();
    assert!(
        matches!(&error, BatchError::NoSuchOutput { nearest, .. } if nearest == "bob/hello.mcap"),
        "{error}"
    );
}

#[test]
fn manifests_that_cannot_be_meant_are_refused() {
    let folder = work();
    let faces = "[[faces]]\nfile = \"faces/*.obj\"\n[[takes]]\nfile = \"takes/*.keys\"\n";
    for (text, said) in [
        ("", "there is none"),
        (
            "[[faces]]\nfile = \"no/*.obj\"\n",
            "no file is called like that",
        ),
        ("[[faces]]\nname = \"x\"\n", "`file` is missing"),
        (
            "[[faces]]\nfile = \"faces/*.obj\"\nname = \"x\"\n",
            "leave one of them out",
        ),
        (
            "[[faces]]\nfile = \"a/x.obj\"\n[[faces]]\nfile = \"b/x.obj\"\n",
            "two faces are called 'x'",
        ),
        (
            &format!("{faces}[[outputs]]\npath = \"{{take}}.mcap\"\n"),
            "needs {face}",
        ),
        (
            &format!("{faces}[[outputs]]\npath = \"{{face}}.mcap\"\n"),
            "{take} must be in",
        ),
        (
            &format!("{faces}[[outputs]]\npath = \"{{face}}.pc2\"\n"),
            "{take} must be in",
        ),
        (
            &format!("{faces}[[outputs]]\npath = \"{{face}}/{{take}}.fbx\"\n"),
            "'fbx'",
        ),
        (
            &format!("{faces}[[outputs]]\npath = \"{{face}}.{{format}}\"\n"),
            "give both or none",
        ),
        (
            &format!("{faces}[[outputs]]\npath = \"../{{face}}.glb\"\n"),
            "below the output folder",
        ),
        (
            &format!("{faces}[[pairs]]\nfaces = [\"any\"]\n"),
            "nearest: 'ann'",
        ),
        (&format!("{faces}[[scenes]]\nfps = 0\n"), "above 0"),
        (&format!("rigs = \"x.fabrig\"\n{faces}"), "needs {face}"),
        (&format!("{faces}[[outputs]]\npath = 3\n"), "work.toml:6"),
    ] {
        let error = plan(folder.path(), text).unwrap_err();
        let error = failure::one_line(&error);
        assert!(error.contains(said), "{text}\n{error}");
    }
}

#[test]
fn a_table_is_a_manifest_too() {
    let folder = work();
    let path = folder.path().join("work.csv");
    let read = |text: &str| Manifest::from_csv(text, &path);
    let manifest = read(
        "face, take, output\n# a comment\nfaces/ann.obj, takes/hello.keys,\n\
         faces/bob.obj, takes/hello.keys, {face}-{take}.glb\nfaces/bob.obj,takes/shout.keys,\n\
         faces/ann.obj,,\n",
    )
    .unwrap();
    let plan = Plan::new(
        manifest,
        &folder.path().join("out"),
        &PlanOptions::default(),
    )
    .unwrap();
    let outputs: Vec<&str> = plan.jobs.iter().map(|p| p.job.output.as_str()).collect();
    assert_eq!(
        outputs,
        [
            "rigs/ann.fabrig",
            "ann/hello.mcap",
            "rigs/bob.fabrig",
            "bob-hello.glb",
            "bob/shout.mcap"
        ]
    );
    for (text, said) in [
        ("fase,take\na.obj,b.csv\n", "nearest: 'face'"),
        ("face,take\n,b.csv\n", "work.csv:2: the row has no face"),
        ("face,take\n*.obj,b.csv\n", "no wildcards"),
        ("face,take,unit\na.obj,b.csv,km\n", "unit"),
        (
            "face,take,unit\na.obj,b.csv,cm\na.obj,c.csv,mm\n",
            "work.csv:3",
        ),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(said), "{text}\n{error}");
    }
}
