//! A scene with faces of its own, from its files to one recording.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use super::animate::{Cast, DEFAULT_RATE, Run, record_cast};
use super::frames::FrameMaker;
use super::patch_detail::PatchDetailError;
use super::{
    AnimateOptions, AnimateProgress, AnimateReport, PatchDetail, RigFaceOptions, recording_rate,
    rig_face,
};
use crate::Error;
use crate::edit::{Edits, edits_path};
use crate::facs::nearest_name;
use crate::mesh::io::{is_mesh_file, read_mesh};
use crate::motion::{self, Clip, ReadOptions};
use crate::registration::Progress;
use crate::rig::Rig;
use crate::scene::{Scene, SceneError, Simulation};
use crate::template::human;

/// A face of a scene with its files read.
#[derive(Debug, Clone)]
pub struct StagedFace {
    /// Its name in the scene.
    pub name: String,
    /// Its rig, edited.
    pub rig: Arc<Rig>,
    /// Its take, when and as fast as the scene plays it.
    pub clip: Option<Clip>,
    /// Name of the take's file.
    pub take_name: String,
    /// The take's own frame rate as it is played. (1/s)
    pub rate: Option<f64>,
    /// The scene as it sees it.
    pub scene: Scene,
}

/// What the simulation of a scene with faces took and did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageReport {
    /// For each face its name and report; the recording in them is the same.
    pub faces: Vec<(String, AnimateReport)>,
}

/// Reads the rigs, edits and takes of a scene, and rigs what is a mesh: once, where several faces are
/// of the same.
///
/// - `takes`: how takes are read
/// - `progress`: of rigging, as for [`rig_face`]
///
/// # Errors
///
/// [`Error::Scene`] with the place in the scene's text: for files that are not there with the
/// nearest that is, for those that cannot be used with the reason.
pub fn load_faces(
    scene: &Scene,
    takes: &ReadOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Vec<StagedFace>, Error> {
    let mut rigged = Rigged::new();
    let faces = 0..scene.faces.len();
    faces
        .map(|index| load_face(scene, index, takes, &mut rigged, progress))
        .collect()
}

/// Meshes that were rigged, by file and resolution.
type Rigged = BTreeMap<(PathBuf, Option<String>), Rig>;

fn load_face(
    scene: &Scene,
    index: usize,
    takes: &ReadOptions,
    rigged: &mut Rigged,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<StagedFace, Error> {
    let face = &scene.faces[index];
    let refused = |key: &str, error: Error| -> Error {
        let error = SceneError::File(Box::new(error));
        scene
            .source
            .at(&format!("faces[{index}].{key}"), error)
            .into()
    };
    let file = |key: &str, path: &Path| -> Result<PathBuf, Error> {
        let whole = scene.path_of(path);
        if whole.exists() {
            return Ok(whole);
        }
        let near = nearest_file(&whole);
        Err(scene
            .source
            .value(
                &format!("faces[{index}].{key}"),
                "a file that is there".to_owned(),
                format!("'{}'", whole.display()),
                near.as_deref(),
            )
            .into())
    };
    let rig_path = file("rig", &face.rig)?;
    let is_mesh = is_mesh_file(&rig_path);
    let detail = detail_of(scene, index, is_mesh)?;
    let mut rig = if is_mesh {
        let key = (rig_path.clone(), face.resolution.clone());
        if !rigged.contains_key(&key) {
            let rig = rig_mesh(&rig_path, detail, progress).map_err(|e| refused("rig", e))?;
            rigged.insert(key.clone(), rig);
        }
        rigged[&key].clone()
    } else {
        Rig::load(&rig_path).map_err(|e| refused("rig", e.into()))?
    };
    let (key, edits) = match &face.edits {
        Some(path) => ("edits", Some(Edits::load(file("edits", path)?))),
        None => ("rig", Edits::beside(&rig_path).transpose()),
    };
    if let Some(edits) = edits {
        edits
            .and_then(|edits| edits.apply(&mut rig))
            .map_err(|e| refused(key, e.into()))?;
    }
    let mut staged = StagedFace {
        name: face.display_name(),
        rig: Arc::new(rig),
        clip: None,
        take_name: String::new(),
        rate: None,
        scene: scene.for_face(index),
    };
    if let Some(path) = &face.motion {
        let take =
            motion::read(file("motion", path)?, takes).map_err(|e| refused("motion", e.into()))?;
        let clip = take
            .retimed(face.start, face.speed)
            .map_err(|e| scene.source.at(&format!("faces[{index}].speed"), e))?;
        staged.rate = Some(recording_rate(&take));
        let stem = path.file_stem().map(|stem| stem.to_string_lossy());
        staged.take_name = stem.unwrap_or_default().into_owned();
        staged.clip = Some(clip);
    }
    Ok(staged)
}

/// How fine the patches of a face become.
fn detail_of(scene: &Scene, index: usize, is_mesh: bool) -> Result<PatchDetail, Error> {
    let Some(text) = &scene.faces[index].resolution else {
        return Ok(PatchDetail::default());
    };
    let key = format!("faces[{index}].resolution");
    if !is_mesh {
        let expected = "nothing, as a rig has the patches it was made with (give a mesh as `rig`, \
                        or make it by `fabrig rig --resolution`)";
        let found = format!("'{text}'");
        return Err(scene
            .source
            .value(&key, expected.to_owned(), found, None)
            .into());
    }
    let read = text.parse::<PatchDetail>();
    read.map_err(|error| {
        let expected = PatchDetailError::EXPECTED.to_owned();
        scene
            .source
            .value(&key, expected, format!("'{}'", error.found), None)
            .into()
    })
}

/// Rigs a mesh as `fabrig rig` does by itself.
fn rig_mesh(
    path: &Path,
    detail: PatchDetail,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Rig, Error> {
    let mut options = RigFaceOptions::default();
    options.rig.resolution = detail.resolution();
    let rigged = rig_face(&read_mesh(path)?, human(), &options, progress)?;
    let mut rig = rigged.rig;
    // Without its pictures the face moves as well.
    let _ = rig.keep_appearance(path);
    Ok(rig)
}

/// The file in the same folder that is spelled most like one that is not there.
fn nearest_file(path: &Path) -> Option<String> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?;
    let is_alike = |name: &String| Path::new(name).extension() == path.extension();
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(is_alike)
        .collect();
    names.sort();
    let wanted = path.file_name()?.to_str()?;
    nearest_name(wanted, names.iter().map(String::as_str)).map(str::to_owned)
}

/// How long a scene lasts. (s)
///
/// # Errors
///
/// [`SceneError::Value`] where neither it nor a take says.
pub fn scene_duration(scene: &Scene, faces: &[StagedFace]) -> Result<f64, SceneError> {
    let ends = faces.iter().filter_map(|face| {
        let clip = face.clip.as_ref()?;
        Some(clip.times()[0] + clip.duration())
    });
    let last = ends.fold(None, |last: Option<f64>, end| {
        Some(last.map_or(end, |l| l.max(end)))
    });
    match scene.duration.or(last) {
        Some(duration) if duration >= 0.0 => Ok(duration),
        found => Err(scene.source.value(
            "duration",
            "seconds, as no face has a take that ends after the scene begins".to_owned(),
            found.map_or_else(|| "nothing".to_owned(), |end| end.to_string()),
            None,
        )),
    }
}

/// Frames a second of a scene: its own, or those of its first take that has a rate. (1/s)
pub fn scene_rate(scene: &Scene, faces: &[StagedFace]) -> f64 {
    let of_takes = faces.iter().find_map(|face| face.rate);
    scene.fps.or(of_takes).unwrap_or(DEFAULT_RATE)
}

/// Simulates the faces of a scene side by side and records them to `output`: where there are
/// several, the topics of each begin with its name.
///
/// - `options`: the names in it are not used; its frame rate goes before the scene's
/// - `progress`: as for [`super::animate`]
///
/// # Errors
///
/// [`Error::Scene`] and [`Error::Recording`]; then nothing is left at `output` that was not
/// there before.
pub fn animate_scene(
    scene: &Scene,
    faces: Vec<StagedFace>,
    output: &Path,
    options: &AnimateOptions,
    progress: &mut dyn FnMut(AnimateProgress) -> ControlFlow<()>,
) -> Result<StageReport, Error> {
    let fps = options.fps.unwrap_or_else(|| scene_rate(scene, &faces));
    let duration = scene_duration(scene, &faces)?;
    let is_alone = faces.len() == 1;
    let mut infos = Vec::with_capacity(faces.len());
    let mut makers = Vec::with_capacity(faces.len());
    for face in &faces {
        let maker = FrameMaker::new(&face.rig, options.recording);
        let options = AnimateOptions {
            rig_name: face.name.clone(),
            take_name: face.take_name.clone(),
            ..options.clone()
        };
        let mut info = maker.info(&face.rig, face.clip.as_ref(), &face.scene, fps, &options)?;
        if !is_alone {
            info.face.clone_from(&face.name);
        }
        infos.push(info);
        makers.push(maker);
    }
    let names: Vec<String> = faces.iter().map(|face| face.name.clone()).collect();
    let notes = |face: &StagedFace| face.clip.as_ref().map(|clip| clip.notes().clone());
    let cast = Cast {
        infos,
        takes: faces.iter().map(|f| notes(f).unwrap_or_default()).collect(),
        fps,
        duration,
    };
    let start = || start(faces, makers);
    let reports = record_cast(cast, start, output, &options.recording, progress)?;
    Ok(StageReport {
        faces: names.into_iter().zip(reports).collect(),
    })
}

/// Puts every face into its scene, at its start.
fn start(faces: Vec<StagedFace>, makers: Vec<FrameMaker>) -> Result<Vec<Run>, Error> {
    let start = |(face, maker): (StagedFace, FrameMaker)| -> Result<Run, Error> {
        let mut simulation = Simulation::new(face.rig, face.scene, face.clip)?;
        if simulation.time() != 0.0 {
            simulation.start_at(0.0)?;
        }
        Ok(Run::new(simulation, maker))
    };
    faces.into_iter().zip(makers).map(start).collect()
}

/// The rig's edits file that stands beside it, if it does, for who says what a scene reads.
pub fn edits_of(scene: &Scene, face: usize) -> Option<PathBuf> {
    let face = scene.faces.get(face)?;
    match &face.edits {
        Some(path) => Some(scene.path_of(path)),
        None => Some(edits_path(&scene.path_of(&face.rig))).filter(|path| path.exists()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::animate;
    use crate::recording::{RecordedFrame, RecordingError, RecordingReader};
    use crate::scene::tests::coarse_rig;

    const JAW: &str = "fabrig-keys 1\n0 jawOpen=0\n0.1 jawOpen=0.5\n0.2 jawOpen=0.1\n";
    const SMILE: &str = "fabrig-keys 1\n0 mouthSmileLeft=0\n0.2 mouthSmileLeft=0.8\n";
    const SCENE: &str = "fps = 50\nwind = [4000, 0, 0]\n[turbulence]\nseed = 4\n\
                         [recording]\nrecord = [\"skin\", \"patches\", \"weights\"]\n";
    const ANN: &str = "[[faces]]\nrig = \"ann.fabrig\"\nmotion = \"jaw.txt\"\n\
                       position = [-120, 0, 0]\nturn = [0, 0.5, 0]\n";
    const BOB: &str = "[[faces]]\nname = \"ann2\"\nrig = \"ann.fabrig\"\nmotion = \"smile.txt\"\n\
                       position = [120, 0, 0]\nstart = 0.06\nspeed = 0.5\n\
                       materials = { fat = { magnet_frequency_hz = 5 } }\n";

    fn go_on(_: Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        coarse_rig().save(folder.path().join("ann.fabrig")).unwrap();
        std::fs::write(folder.path().join("jaw.txt"), JAW).unwrap();
        std::fs::write(folder.path().join("smile.txt"), SMILE).unwrap();
        folder
    }

    fn read(folder: &Path, text: &str) -> Scene {
        let path = folder.join("shot.toml");
        std::fs::write(&path, text).unwrap();
        Scene::load(path).unwrap()
    }

    fn record(folder: &Path, text: &str, name: &str) -> (PathBuf, StageReport) {
        let scene = read(folder, text);
        let faces = load_faces(&scene, &ReadOptions::default(), &mut go_on).unwrap();
        let options = AnimateOptions {
            recording: scene.recording.options(),
            ..AnimateOptions::default()
        };
        let path = folder.join(name);
        let go_on = &mut |_| ControlFlow::Continue(());
        let report = animate_scene(&scene, faces, &path, &options, go_on).unwrap();
        (path, report)
    }

    fn frames(mut reader: RecordingReader) -> Vec<RecordedFrame> {
        std::iter::from_fn(|| reader.next_frame().unwrap()).collect()
    }

    #[test]
    fn faces_side_by_side_move_as_each_does_alone() {
        let folder = folder();
        let folder = folder.path();
        let (both, report) = record(folder, &format!("{SCENE}{ANN}{BOB}"), "both.mcap");
        // Bob starts late and slow: 0.06 s and 0.4 s.
        assert_eq!(report.faces[0].1.frames, 24);
        for (name, text) in [("ann", ANN), ("ann2", BOB)] {
            let alone = format!("duration = 0.46\n{SCENE}{text}");
            let (alone, _) = record(folder, &alone, "alone.mcap");
            let alone = frames(RecordingReader::open(&alone).unwrap());
            let together = frames(RecordingReader::open_face(&both, name).unwrap());
            assert_eq!(alone.len(), 12, "30 skin meshes a second of 50");
            assert_eq!(together, alone, "{name}");
        }
        let moved = |frame: &RecordedFrame| frame.head.translation.vector.x;
        let ann = frames(RecordingReader::open_face(&both, "ann").unwrap());
        assert!((moved(&ann[3]) + 120.0).abs() < 1e-9, "{}", moved(&ann[3]));
        let Err(error) = RecordingReader::open(&both) else {
            panic!("one of two faces was chosen silently");
        };
        assert!(
            matches!(&error, RecordingError::SeveralFaces { faces, .. } if faces == "ann, ann2")
        );
        let reader = RecordingReader::open_face(&both, "ann").unwrap();
        assert_eq!(reader.metadata()["ann2/take"], "smile");
        assert_eq!(reader.metadata()["fps"], "50");
        assert!(RecordingReader::open_face(&both, "bob").is_err());
    }

    #[test]
    fn a_face_alone_records_the_bytes_of_rig_and_take() {
        let folder = folder();
        let folder = folder.path();
        let text = format!("{SCENE}[[faces]]\nrig = \"ann.fabrig\"\nmotion = \"jaw.txt\"\n");
        let (of_scene, report) = record(folder, &text, "scene.mcap");
        assert_eq!(report.faces.len(), 1);
        let options = AnimateOptions {
            fps: Some(50.0),
            rig_name: "ann".to_owned(),
            take_name: "jaw".to_owned(),
            recording: read(folder, SCENE).recording.options(),
        };
        let clip = motion::read(folder.join("jaw.txt"), &ReadOptions::default()).unwrap();
        let of_take = folder.join("take.mcap");
        let rig = Rig::load(folder.join("ann.fabrig")).unwrap();
        let go_on = &mut |_| ControlFlow::Continue(());
        animate(
            Arc::new(rig),
            clip,
            read(folder, SCENE),
            &of_take,
            &options,
            go_on,
        )
        .unwrap();
        let [a, b] = [of_scene, of_take].map(|path| std::fs::read(path).unwrap());
        assert!(a == b, "{} and {} bytes", a.len(), b.len());
    }

    #[test]
    fn files_that_are_not_there_or_no_use_are_told_with_their_place() {
        let folder = folder();
        let said = |text: &str| {
            let error = load_faces(
                &read(folder.path(), text),
                &ReadOptions::default(),
                &mut go_on,
            )
            .unwrap_err();
            let mut message = error.to_string();
            let mut cause = std::error::Error::source(&error);
            while let Some(inner) = cause {
                message = format!("{message}: {inner}");
                cause = inner.source();
            }
            message
        };
        let message = said("[[faces]]\nrig = \"an.fabrig\"\n");
        for part in [
            "line 2, column 7",
            "`faces[0].rig`",
            "an.fabrig",
            "mean `ann.fabrig`",
        ] {
            assert!(message.contains(part), "no '{part}' in: {message}");
        }
        let message = said("[[faces]]\nrig = \"ann.fabrig\"\nmotion = \"ann.fabrig\"\n");
        for part in ["line 3, column 10", "`faces[0].motion`"] {
            assert!(message.contains(part), "no '{part}' in: {message}");
        }
        let scene = read(folder.path(), "[[faces]]\nrig = \"ann.fabrig\"\n");
        let error = scene_duration(
            &scene,
            &load_faces(&scene, &ReadOptions::default(), &mut go_on).unwrap(),
        )
        .unwrap_err();
        assert!(error.to_string().contains("`duration`"), "{error}");
    }

    #[test]
    fn a_mesh_is_rigged_at_the_resolution_that_the_scene_says() {
        let folder = folder();
        let folder = folder.path();
        crate::mesh::io::write_obj(folder.join("bare.obj"), &crate::template::demo_face()).unwrap();
        let text = "duration = 0.1\n\
                    [[faces]]\nname = \"a\"\nrig = \"bare.obj\"\nresolution = \"coarse\"\n\
                    [[faces]]\nname = \"b\"\nrig = \"bare.obj\"\nresolution = \"coarse\"\n";
        let mut stages = Vec::new();
        let mut progress = |step: Progress| {
            stages.push(step.fraction);
            ControlFlow::Continue(())
        };
        let scene = read(folder, text);
        let faces = load_faces(&scene, &ReadOptions::default(), &mut progress).unwrap();
        assert_eq!(faces[0].rig, faces[1].rig);
        let nodes = |rig: &Rig| {
            rig.patches
                .iter()
                .map(|p| p.patch.neutral.len())
                .sum::<usize>()
        };
        let coarse = coarse_rig();
        assert_eq!(nodes(&faces[0].rig), nodes(&coarse));
        let starts = stages.windows(2).filter(|w| w[1] < w[0]).count();
        assert_eq!(starts, 0, "it is rigged once: {stages:?}");
        let mut stopped = |_: Progress| ControlFlow::Break(());
        assert!(load_faces(&scene, &ReadOptions::default(), &mut stopped).is_err());
        for (text, expected) in [
            (
                "[[faces]]\nrig = \"bare.obj\"\nresolution = \"huge\"\n",
                "0.3mm",
            ),
            (
                "[[faces]]\nrig = \"ann.fabrig\"\nresolution = \"fine\"\n",
                "a mesh as `rig`",
            ),
        ] {
            let scene = read(folder, text);
            let error = load_faces(&scene, &ReadOptions::default(), &mut go_on).unwrap_err();
            let message = error.to_string();
            for part in ["line 3", "`faces[0].resolution`", expected] {
                assert!(message.contains(part), "no '{part}' in: {message}");
            }
        }
    }
}
