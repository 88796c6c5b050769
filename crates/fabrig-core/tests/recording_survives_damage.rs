//! A recording gives back what was recorded to its stated rounding, equal inputs give equal
//! bytes, a damaged file is refused with a typed error after its whole frames, and what a
//! killed recorder had flushed can be read.

use std::path::Path;

use fabrig_core::recording::{
    Frame, LogEvent, LogLevel, McapRecorder, RecordedFrame, RecordingError, RecordingInfo,
    RecordingOptions, RecordingReader, RecordingReport, SurfaceInfo,
};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

const SIDE: u32 = 24;

fn surface(name: &str, color: [u8; 4]) -> SurfaceInfo {
    let mut triangles = Vec::new();
    for v in 0..SIDE - 1 {
        for u in 0..SIDE - 1 {
            let p = v * SIDE + u;
            triangles.extend([[p, p + 1, p + SIDE + 1], [p, p + SIDE + 1, p + SIDE]]);
        }
    }
    SurfaceInfo {
        name: name.to_owned(),
        color,
        vertex_count: (SIDE * SIDE) as usize,
        triangles,
        vertex_colors: Vec::new(),
    }
}

fn info() -> RecordingInfo {
    RecordingInfo {
        face: String::new(),
        rig: "sheet".to_owned(),
        template: "none 1".to_owned(),
        fps: 60.0,
        seed: 7,
        skin: surface("skin", [220, 170, 150, 255]),
        patches: vec![
            surface("zygomaticus_major_l", [200, 40, 40, 255]),
            surface("zygomaticus_major_r", [40, 40, 200, 128]),
        ],
        parts: vec![SurfaceInfo {
            vertex_colors: (0..SIDE * SIDE).map(|v| [v as u8, 9, 80, 255]).collect(),
            ..surface("eye_l", [240; 4])
        }],
        colliders: None,
        weight_names: vec!["jawOpen".to_owned(), "mouthSmileLeft".to_owned()],
        plotted_weights: Vec::new(),
        stat_names: vec!["step_ms".to_owned()],
        extra: Vec::new(),
    }
}

/// A waving sheet at depth z. (mm)
fn sheet(z: f32, k: u64) -> Vec<Point3<f32>> {
    (0..SIDE * SIDE)
        .map(|i| {
            let (x, y) = ((i % SIDE) as f32 * 3.7, (i / SIDE) as f32 * 3.1);
            Point3::new(
                x - 40.0,
                y - 35.0,
                z + 4.0 * (0.1 * x + 0.2 * k as f32).sin(),
            )
        })
        .collect()
}

fn head(k: u64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(0.02 * k as f64, -0.01 * k as f64, 0.0);
    Isometry3::from_parts(Translation3::new(0.0, 3.0 * k as f64, -5.0), turn)
}

fn record(recorder: &mut McapRecorder, frames: u64) {
    for k in recorder.frame_count()..frames {
        let skin = sheet(0.0, k);
        let (left, right, eye) = (sheet(-5.0, k), sheet(-8.0, k), sheet(-12.0, k));
        let event = [LogEvent {
            level: LogLevel::Warning,
            message: "half way".to_owned(),
        }];
        recorder
            .record(&Frame {
                skin: &skin,
                patches: &[&left, &right],
                parts: &[&eye],
                contact: None,
                strains: &[],
                magnets: &[],
                head: head(k),
                weights: &[0.0, 0.01 * k as f32],
                stats: &[4.5],
                events: if k == 30 { &event } else { &[] },
            })
            .expect("recorded");
    }
}

fn write(path: &Path, frames: u64) -> RecordingReport {
    let mut recorder =
        McapRecorder::create(path, info(), RecordingOptions::default()).expect("created");
    record(&mut recorder, frames);
    recorder.finish().expect("finished")
}

/// Frames until the end or an error.
fn read(mut reader: RecordingReader) -> (Vec<RecordedFrame>, Option<RecordingError>) {
    let mut frames = Vec::new();
    loop {
        match reader.next_frame() {
            Ok(Some(frame)) => frames.push(frame),
            Ok(None) => return (frames, None),
            Err(error) => return (frames, Some(error)),
        }
    }
}

#[test]
fn what_is_recorded_comes_back_to_its_rounding() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("take.mcap");
    let report = write(&path, 60);
    assert_eq!(report.frames, 60);
    let count = |topic: &str| {
        let found = report.topics.iter().find(|t| t.topic == topic);
        found.map_or(0, |t| t.messages)
    };
    assert_eq!(count("/tf"), 60);
    assert_eq!(
        count("/rig/skin"),
        30,
        "meshes at half of 60 frames a second"
    );
    assert_eq!(count("/log"), 2);
    assert!(!folder.path().join("take.mcap.partial").exists());

    let reader = RecordingReader::open(&path).expect("opened");
    assert_eq!(reader.metadata()["rig"], "sheet");
    assert_eq!(reader.metadata()["seed"], "7");
    let (frames, error) = read(reader);
    assert!(error.is_none(), "{error:?}");
    assert_eq!(frames.len(), 30);
    let frame = &frames[10];
    assert!((frame.time_secs - 20.0 / 60.0).abs() < 1e-6);
    assert!((frame.head.translation.vector - head(20).translation.vector).norm() < 1e-9);
    assert!(frame.head.rotation.angle_to(&head(20).rotation) < 1e-9);
    let names: Vec<_> = frame.patches.iter().map(|p| p.info.clone()).collect();
    assert_eq!(names, info().patches);
    assert_eq!(frame.parts[0].info, info().parts[0]);
    let skin = frame.skin.as_ref().expect("skin");
    assert_eq!(skin.info, info().skin);
    for (surface, truth) in [
        (skin, sheet(0.0, 20)),
        (&frame.patches[1], sheet(-8.0, 20)),
        (&frame.parts[0], sheet(-12.0, 20)),
    ] {
        for (found, p) in surface.positions.iter().zip(&truth) {
            let off: Vector3<f64> = found - p.cast::<f64>();
            assert!(off.amax() < 0.0062, "{off:?}");
        }
    }
}

#[test]
fn strain_is_recorded_where_it_is_asked_for() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("take.mcap");
    let options = RecordingOptions {
        strain_hz: 15.0,
        ..RecordingOptions::default()
    };
    let mut recorder = McapRecorder::create(&path, info(), options).expect("created");
    let (sheet, still) = (sheet(0.0, 0), vec![0.1; (SIDE * SIDE) as usize]);
    let frame = Frame {
        skin: &sheet,
        patches: &[&sheet, &sheet],
        parts: &[&sheet],
        contact: None,
        strains: &[],
        magnets: &[],
        head: Isometry3::identity(),
        weights: &[0.0, 0.0],
        stats: &[0.0],
        events: &[],
    };
    let refused = recorder.record(&frame);
    let expected = "frame 0 has 0 patch strains, but the recording was opened with 2";
    assert!(refused.is_err_and(|e| e.to_string() == expected));
    let strains: [&[f32]; 2] = [&still, &still];
    let frame = Frame {
        contact: None,
        strains: &strains,
        magnets: &[],
        ..frame
    };
    for _ in 0..60 {
        recorder.record(&frame).expect("recorded");
    }
    let report = recorder.finish().expect("finished");
    let strain = report.topics.iter().find(|t| t.topic == "/rig/strain");
    assert_eq!(strain.map(|t| t.messages), Some(15));
    let (frames, error) = read(RecordingReader::open(&path).expect("opened"));
    assert!(error.is_none(), "{error:?}");
    assert_eq!((frames.len(), frames[0].patches.len()), (30, 2));
}

#[test]
fn equal_inputs_give_equal_bytes() {
    let folder = tempfile::tempdir().expect("folder");
    let bytes = |name: &str| {
        let path = folder.path().join(name);
        write(&path, 45);
        std::fs::read(path).expect("read")
    };
    assert!(bytes("a.mcap") == bytes("b.mcap"));
}

#[test]
fn a_cut_file_says_so_after_its_whole_frames() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("take.mcap");
    write(&path, 120);
    let bytes = std::fs::read(&path).expect("read");
    for share in [0.2, 0.6, 0.8] {
        let cut = (bytes.len() as f64 * share) as usize;
        std::fs::write(&path, &bytes[..cut]).expect("cut");
        let reader = match RecordingReader::open(&path) {
            Ok(reader) => reader,
            Err(error) => {
                assert!(matches!(error, RecordingError::Truncated { .. }), "{error}");
                continue;
            }
        };
        let (frames, error) = read(reader);
        assert!(
            matches!(error, Some(RecordingError::Truncated { frames: n, .. }) if n == frames.len()),
            "{share}: {error:?}"
        );
        let (recovered, error) = read(RecordingReader::with_recovery(&path).expect("opened"));
        assert!(error.is_none());
        assert!(recovered.len() >= frames.len() && recovered.len() < 60);
    }
}

#[test]
fn a_changed_byte_is_noticed() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("take.mcap");
    write(&path, 60);
    let bytes = std::fs::read(&path).expect("read");
    let mut noticed = 0;
    for k in 1..8 {
        let mut damaged = bytes.clone();
        let at = bytes.len() * k / 10;
        damaged[at] ^= 0x5a;
        std::fs::write(&path, &damaged).expect("damaged");
        let error = match RecordingReader::open(&path) {
            Ok(reader) => read(reader).1,
            Err(error) => Some(error),
        };
        noticed += usize::from(error.is_some());
    }
    // A byte may fall into an index that frames are not read by.
    assert!(noticed >= 6, "{noticed} of 7");
}

#[test]
fn what_is_no_recording_is_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("no.mcap");
    assert!(matches!(
        RecordingReader::open(&path),
        Err(RecordingError::Io { action: "open", .. })
    ));
    std::fs::write(&path, b"solid cube\nfacet normal 0 0 1\n").expect("written");
    assert!(matches!(
        RecordingReader::open(&path),
        Err(RecordingError::Container { .. })
    ));
    std::fs::write(&path, b"").expect("written");
    assert!(RecordingReader::open(&path).is_err());
}

#[test]
fn a_killed_recorder_leaves_its_flushed_frames() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("take.mcap");
    let partial = folder.path().join("take.mcap.partial");
    let mut recorder =
        McapRecorder::create(&path, info(), RecordingOptions::default()).expect("created");
    record(&mut recorder, 100);
    // What a kill leaves is what had reached the file by then.
    let left = std::fs::read(&partial).expect("partial");
    assert!(!path.exists());
    recorder.discard();
    assert!(!partial.exists());

    let killed = folder.path().join("killed.mcap");
    std::fs::write(&killed, left).expect("written");
    let (frames, error) = read(RecordingReader::with_recovery(&killed).expect("opened"));
    assert!(error.is_none());
    // Flushed every half second, the last flush perhaps still on its way: the first 60 of 100
    // frames are in the file, half of them with meshes.
    assert!(frames.len() >= 30, "{}", frames.len());
}

#[test]
fn a_dropped_recorder_closes_its_partial_file() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("take.mcap");
    let partial = folder.path().join("take.mcap.partial");
    let mut recorder =
        McapRecorder::create(&path, info(), RecordingOptions::default()).expect("created");
    record(&mut recorder, 20);
    drop(recorder);
    assert!(!path.exists());
    let (frames, error) = read(RecordingReader::open(&partial).expect("sound"));
    assert!(error.is_none());
    assert_eq!(frames.len(), 10);
}

#[test]
fn frames_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("take.mcap");
    let mut recorder =
        McapRecorder::create(&path, info(), RecordingOptions::default()).expect("created");
    let good = sheet(0.0, 0);
    let mut lost = good.clone();
    lost[5].y = f32::NAN;
    let frame = Frame {
        skin: &good,
        patches: &[&good, &good],
        parts: &[&good],
        contact: None,
        strains: &[],
        magnets: &[],
        head: Isometry3::identity(),
        weights: &[0.0, 0.0],
        stats: &[0.0],
        events: &[],
    };
    let short = Frame {
        skin: &good[1..],
        ..frame
    };
    assert!(matches!(
        recorder.record(&short),
        Err(RecordingError::FrameShape {
            expected: 576,
            found: 575,
            ..
        })
    ));
    let nowhere = Frame {
        skin: &lost,
        ..frame
    };
    assert!(matches!(
        recorder.record(&nowhere),
        Err(RecordingError::NotFinite { index: 5, .. })
    ));
    let few = Frame {
        weights: &[0.0],
        ..frame
    };
    assert!(matches!(
        recorder.record(&few),
        Err(RecordingError::FrameShape { .. })
    ));
    recorder.record(&frame).expect("good");
    assert_eq!(recorder.finish().expect("finished").frames, 1);

    let mut twice = info();
    twice.weight_names = vec!["a b".to_owned(), "a_b".to_owned()];
    assert!(matches!(
        McapRecorder::create(&path, twice, RecordingOptions::default()),
        Err(RecordingError::Info { .. })
    ));
}
