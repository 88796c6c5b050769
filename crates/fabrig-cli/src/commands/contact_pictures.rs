//! Pictures of the demo's contact story, drawn from its recording.

use std::path::Path;

use anyhow::{Context, Result, bail};
use fabrig_core::Point;
use fabrig_core::recording::{RecordedFrame, RecordingReader};
use fabrig_core::render::{
    FaceLook, Framing, Picture, RecordingContent, Sheet, View, recording_layers,
};
use fabrig_core::template::{JawHinge, human};

use crate::console::Console;

/// A picture with several moments side by side.
struct Story {
    file: &'static str,
    view: View,
    framing: Framing,
    /// (s)
    moments: &'static [f64],
}

const STORIES: [Story; 4] = [
    Story {
        file: "contact_lips.png",
        view: View::Front,
        framing: Framing::Mouth,
        moments: &[0.6, 0.8, 0.9, 0.97, 1.03, 1.2],
    },
    Story {
        file: "contact_finger.png",
        view: View::Angles {
            yaw: -12.0,
            pitch: 12.0,
        },
        framing: Framing::Face,
        moments: &[2.7, 3.1, 3.6, 4.0, 4.5, 5.2],
    },
    Story {
        file: "contact_ball.png",
        view: View::ThreeQuarter,
        framing: Framing::Face,
        moments: &[5.7, 5.8, 5.9],
    },
    Story {
        file: "contact_blink.png",
        view: View::Front,
        framing: Framing::Eyes,
        moments: &[7.4, 7.5, 7.7, 8.1, 8.5, 8.9],
    },
];

/// Width and height of one moment. (pixels)
const SIZE: [u32; 2] = [300, 250];
const COLUMNS: u32 = 3;

/// Draws all stories of a recording into a folder.
///
/// - `positions`, `hinge`: the face in the template's topology (mm)
pub(super) fn draw(
    console: &Console,
    recording: &Path,
    folder: &Path,
    positions: &[Point],
    hinge: &JawHinge,
) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let mut sheets: Vec<Sheet> = STORIES.iter().map(|_| Sheet::new()).collect();
    let total: usize = STORIES.iter().map(|story| story.moments.len()).sum();
    let mut done = 0;
    let mut reader = RecordingReader::open(recording)?;
    let mut first: Option<RecordedFrame> = None;
    let mut before = f64::NEG_INFINITY;
    while let Some(frame) = reader.next_frame()? {
        let now = frame.time_secs;
        for (story, sheet) in STORIES.iter().zip(&mut sheets) {
            // The first frame at or after a moment shows it.
            let is_due = |&&t: &&f64| before < t - 1e-6 && t - 1e-6 <= now;
            if frame.skin.is_none() || !story.moments.iter().any(|t| is_due(&t)) {
                continue;
            }
            let first = first.as_ref().unwrap_or(&frame);
            let look = FaceLook::default();
            let layers = recording_layers(&frame, first, RecordingContent::Face, &look)?;
            let picture = Picture::new(SIZE[0], SIZE[1])
                .with_view(story.view)
                .with_focus(story.framing.points(human(), positions, hinge))
                .with_layers(layers);
            sheet.push(picture.render()?, format!("{now:.2} s"));
            done += 1;
            if console
                .show("draw", done, total as u64, story.file)
                .is_break()
            {
                bail!("stopped; no picture was written");
            }
        }
        if frame.skin.is_some() {
            before = now;
        }
        first.get_or_insert(frame);
    }
    console.clear();
    for (story, sheet) in STORIES.iter().zip(&sheets) {
        let path = folder.join(story.file);
        sheet.compose(COLUMNS)?.save_png(&path)?;
        console.result(&path.display().to_string());
    }
    Ok(())
}
