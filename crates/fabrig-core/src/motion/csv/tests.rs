//! What the tables give, and what is refused.

use super::parse_csv;
use crate::motion::{Clip, MotionError, ReadOptions, TakeFormat};

fn parse(text: &str) -> Result<Clip, MotionError> {
    parse_csv(text, "take.csv", &ReadOptions::default())
}

#[test]
fn live_link_columns_become_channels_tracks_and_times() {
    let clip = parse(
        "Timecode,BlendShapeCount,EyeBlinkLeft,JAWOPEN,HeadYaw,HeadPitch,HeadRoll,\
         LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,RightEyePitch,RightEyeRoll\n\
         10:00:00:57.5,61,0.25,1.002,0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9\n\
         10:00:00:59.5,61,0.5,0,0,0,0,0,0,0,0,0,0\n\
         10:00:01:03.5,61,0.5,0,0,0,0,0,0,0,0,0,0\n",
    )
    .unwrap();
    assert_eq!(clip.channels(), ["eyeBlinkLeft", "jawOpen"]);
    assert_eq!(&clip.weights()[..2], [0.25, 1.0]);
    assert_eq!(clip.notes().clamped_weights, 1);
    assert_eq!(clip.notes().dropped_frames, 1);
    assert!((clip.times()[1] - 2.0 / 60.0).abs() < 1e-9);
    assert!((clip.duration() - 6.0 / 60.0).abs() < 1e-9);
    let head = clip.tracks().head[0];
    assert_eq!((head.yaw, head.pitch, head.roll), (-0.1, 0.2, -0.3));
    let [left, right] = clip.tracks().eyes[0];
    assert_eq!(
        (left.yaw, left.pitch, right.yaw, right.pitch),
        (-0.4, 0.5, -0.7, 0.8)
    );
}

#[test]
fn times_may_be_seconds_or_frames_with_a_rate() {
    let clip = parse("time;mouthSmile_L\n2.5;0\n3;1\n").unwrap();
    assert_eq!(clip.times(), [0.0, 0.5]);
    let milliseconds = ReadOptions {
        times_in_milliseconds: true,
        ..ReadOptions::default()
    };
    let text = "timestamp,jawOpen\n0,0\n40,1\n";
    let fast = parse_csv(text, "x", &milliseconds).unwrap();
    assert!((fast.duration() - 0.04).abs() < 1e-12);
    assert!(matches!(
        parse(text),
        Err(MotionError::RateOutOfRange { found, .. }) if found == 0.025
    ));
    assert_eq!(clip.channels(), ["mouthSmileLeft"]);
    for text in [
        "frame,jawOpen\n10,0\n11,0.5\n13,1\n",
        "jawOpen\n0\n0.5\n0.5\n1\n",
    ] {
        assert!(matches!(
            parse(text),
            Err(MotionError::FrameRateNeeded { .. })
        ));
        let options = ReadOptions {
            frame_rate: Some(10.0),
            ..ReadOptions::default()
        };
        let clip = parse_csv(text, "take.csv", &options).unwrap();
        assert!((clip.duration() - 0.3).abs() < 1e-12);
    }
}

#[test]
fn unknown_columns_are_named_with_the_nearest_known_one() {
    let text = "time,jawOpn\n0,1\n";
    match parse(text) {
        Err(MotionError::UnknownColumn {
            column: 2,
            found,
            nearest,
            ..
        }) => assert_eq!((found.as_str(), nearest.as_str()), ("jawOpn", "jawOpen")),
        other => panic!("{other:?}"),
    }
    let options = ReadOptions {
        ignore_unknown_columns: true,
        ..ReadOptions::default()
    };
    let clip = parse_csv("time,mood,jawOpen\n0,happy,1\n", "x", &options).unwrap();
    assert_eq!(clip.notes().ignored_columns, ["mood"]);
    assert!(matches!(
        parse("time,jawOpen,JAW_OPEN\n0,1,1\n"),
        Err(MotionError::DuplicateColumn {
            first: 2,
            second: 3,
            ..
        })
    ));
}

#[test]
fn bad_cells_are_named_by_row_and_column() {
    for cell in ["nan", "inf", "", "x"] {
        match parse(&format!("time,jawOpen\n0,0\n1,{cell}\n")) {
            Err(MotionError::BadCell {
                row: 3,
                column,
                found,
                ..
            }) => assert_eq!((column.as_str(), found.as_str()), ("jawOpen", cell)),
            other => panic!("{cell}: {other:?}"),
        }
    }
    assert!(matches!(
        parse("time,jawOpen\n0,1.2\n"),
        Err(MotionError::WeightOutOfRange { row: 2, .. })
    ));
    assert!(matches!(
        parse("timecode,jawOpen\n1:2,0\n"),
        Err(MotionError::BadCell {
            expected: "timecode",
            ..
        })
    ));
    assert!(matches!(
        parse("time,jawOpen\n0,0\n1\n"),
        Err(MotionError::Csv { .. })
    ));
}

#[test]
fn repeated_times_replace_and_time_never_runs_backwards() {
    let clip = parse("time,jawOpen\n0,0\n1,0.25\n1,0.5\n2,1\n").unwrap();
    assert_eq!(clip.weights(), [0.0, 0.5, 1.0]);
    assert_eq!(clip.notes().duplicate_rows, 1);
    assert!(matches!(
        parse("time,jawOpen\n0,0\n2,0\n1,0\n"),
        Err(MotionError::TimeBackwards { row: 4, .. })
    ));
}

#[test]
fn takes_without_anything_are_refused() {
    for text in ["", "time,jawOpen\n", "time,HeadYaw\n0,0\n"] {
        assert!(matches!(parse(text), Err(MotionError::Empty { .. })));
    }
    for frame_rate in [0.0, -1.0, f64::NAN] {
        let options = ReadOptions {
            frame_rate: Some(frame_rate),
            ..ReadOptions::default()
        };
        assert!(matches!(
            parse_csv("jawOpen\n0\n", "x", &options),
            Err(MotionError::BadFrameRate { .. })
        ));
    }
}

#[test]
fn open_face_intensities_pose_and_lost_frames() {
    let clip = parse(
        "frame, timestamp, confidence, success, gaze_0_x, pose_Tx, pose_Rx, pose_Ry, pose_Rz, \
         x_0, AU12_r, AU26_r, AU12_c\n\
         1, 0, 0.98, 1, 0, 5, 0.2, 0, 0, 9, 2.5, 0, 1\n\
         2, 0.04, 0.02, 0, 0, 5, 0, 0, 0, 9, 5, 5, 0\n\
         3, 0.08, 0.98, 1, 0, 5, 0, 0.3, 0.1, 9, 5, 5, 1\n",
    )
    .unwrap();
    assert_eq!(
        clip.channels(),
        ["jawOpen", "mouthSmileLeft", "mouthSmileRight"]
    );
    let rows: Vec<&[f32]> = clip.weights().chunks(3).collect();
    assert_eq!(rows[0], [0.0, 0.5, 0.5]);
    assert!((rows[2][0] - 0.4).abs() < 1e-6 && rows[2][1] == 1.0);
    assert!((rows[1][1] - 0.75).abs() < 1e-6, "filled from both sides");
    let gap = &clip.notes().gaps[0];
    assert_eq!((gap.start, gap.end, gap.frames), (0.04, 0.04, 1));
    let head = &clip.tracks().head;
    assert!(
        (head[0].pitch - 0.2).abs() < 1e-12,
        "positive Rx looks down"
    );
    assert!(
        head[2].yaw < -0.29,
        "positive Ry turns to the character's right"
    );
    assert!(head[2].roll < 0.0);
}

#[test]
fn py_feat_intensities_and_frames_without_a_face() {
    let options = ReadOptions {
        frame_rate: Some(25.0),
        ..ReadOptions::default()
    };
    let text = "FaceRectX,AU01,AU12,anger,input,frame,Identity\n\
                3,0.5,1,0.2,a.mp4,0,Person_0\n4,1,1,0.2,a.mp4,0,Person_1\n\
                ,,nan,,a.mp4,1,\n3,0.7,0.5,0.2,a.mp4,2,Person_0\n";
    let clip = parse_csv(text, "x", &options).unwrap();
    assert_eq!(clip.frame_count(), 3);
    let brow = clip.channel_indices(&["browInnerUp"])[0].unwrap();
    assert_eq!(clip.weights()[brow], 0.5);
    assert!((clip.weights()[clip.channels().len() + brow] - 0.6).abs() < 1e-6);
    assert_eq!((clip.notes().other_faces, clip.notes().gaps.len()), (1, 1));
    let unknown = parse_csv("frame,AU12,AU99\n0,1,1\n", "x", &options);
    assert!(matches!(
        unknown,
        Err(MotionError::UnknownColumn { column: 3, .. })
    ));
}

#[test]
fn a_format_may_be_asked_for() {
    let options = ReadOptions {
        format: Some(TakeFormat::OpenFace),
        frame_rate: Some(30.0),
        ..ReadOptions::default()
    };
    assert!(matches!(
        parse_csv("frame,AU12\n0,1\n", "x", &options),
        Err(MotionError::Empty { missing, .. }) if missing.contains("AU12_r")
    ));
}

#[test]
fn a_real_take_is_read() {
    let Some(shared) = std::env::var_os("FABRIG_SHARED") else {
        return;
    };
    let path = std::path::Path::new(&shared).join("mocap/livelinkface_rom.csv");
    let clip = crate::motion::read(path, &ReadOptions::default()).unwrap();
    assert_eq!((clip.frame_count(), clip.channels().len()), (4030, 52));
    assert!(clip.frame_rate().is_some_and(|f| (f - 30.0).abs() < 0.05));
    assert!((clip.duration() - 134.38).abs() < 0.05);
    assert_eq!(clip.notes().dropped_frames, 3);
    assert_eq!(clip.notes().clamped_weights, 1);
}

proptest::proptest! {
    #[test]
    fn no_text_makes_it_panic(text in "(time,|jawOpen|,|\n|[0-9.:;\"-]|nan|\t){0,60}") {
        let _ = crate::motion::parse(&text, "x", &ReadOptions::default());
    }
}
