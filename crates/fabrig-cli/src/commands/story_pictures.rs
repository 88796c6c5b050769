//! Pictures of the demo's stories, drawn from their recordings.

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
pub(super) struct Story {
    file: &'static str,
    view: View,
    framing: Framing,
    /// Whether the head is drawn as if it had not moved.
    is_steady: bool,
    /// Width and height of one moment. (pixels)
    size: [u32; 2],
    columns: u32,
    /// (s)
    moments: &'static [f64],
}

/// Defaults of a story's layout.
const PLAIN: Story = Story {
    file: "",
    view: View::Front,
    framing: Framing::Face,
    is_steady: false,
    size: [300, 250],
    columns: 3,
    moments: &[],
};

/// What touches and is touched.
pub(super) const CONTACT: [Story; 4] = [
    Story {
        file: "contact_lips.png",
        view: View::Front,
        framing: Framing::Mouth,
        moments: &[0.6, 0.8, 0.9, 0.97, 1.03, 1.2],
        ..PLAIN
    },
    Story {
        file: "contact_finger.png",
        view: View::Angles {
            yaw: -12.0,
            pitch: 12.0,
        },
        framing: Framing::Face,
        moments: &[2.7, 3.1, 3.6, 4.0, 4.5, 5.2],
        ..PLAIN
    },
    Story {
        file: "contact_ball.png",
        view: View::ThreeQuarter,
        framing: Framing::Face,
        moments: &[5.7, 5.8, 5.9],
        ..PLAIN
    },
    Story {
        file: "contact_blink.png",
        view: View::Front,
        framing: Framing::Eyes,
        moments: &[7.4, 7.5, 7.7, 8.1, 8.5, 8.9],
        ..PLAIN
    },
];

/// What skin and fat do by themselves.
pub(super) const PHYSICS: [Story; 6] = [
    Story {
        file: "physics_forehead.png",
        framing: Framing::Forehead,
        size: [420, 300],
        columns: 2,
        moments: &[0.2, 0.6, 0.8, 1.9],
        ..PLAIN
    },
    Story {
        file: "physics_crows_feet.png",
        view: View::Angles {
            yaw: 55.0,
            pitch: 0.0,
        },
        framing: Framing::EyeCorner,
        size: [420, 340],
        columns: 2,
        moments: &[2.5, 4.1],
        ..PLAIN
    },
    Story {
        file: "physics_lying_down.png",
        view: View::ThreeQuarter,
        is_steady: true,
        size: [380, 400],
        columns: 2,
        moments: &[4.7, 7.1],
        ..PLAIN
    },
    Story {
        file: "physics_wind.png",
        is_steady: true,
        size: [380, 400],
        columns: 2,
        moments: &[8.35, 9.2],
        ..PLAIN
    },
    Story {
        file: "physics_shake.png",
        size: [240, 260],
        columns: 6,
        moments: &[
            10.4, 10.4333, 10.4666, 10.5, 10.5333, 10.5666, 10.6, 10.6333, 10.6666, 10.7, 10.7333,
            10.7666,
        ],
        ..PLAIN
    },
    Story {
        file: "physics_jump.png",
        is_steady: true,
        size: [380, 400],
        columns: 4,
        // Standing, at the top, at the end of the landing, and as it swings back.
        moments: &[11.3, 12.1, 12.45, 12.52],
        ..PLAIN
    },
];

/// Draws all stories of a recording into a folder.
///
/// - `positions`, `hinge`: the face in the template's topology (mm)
/// - `stories`: those of what was recorded
pub(super) fn draw(
    console: &Console,
    recording: &Path,
    folder: &Path,
    positions: &[Point],
    hinge: &JawHinge,
    stories: &[Story],
) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let mut sheets: Vec<Sheet> = stories.iter().map(|_| Sheet::new()).collect();
    let total: usize = stories.iter().map(|story| story.moments.len()).sum();
    let mut done = 0;
    let mut reader = RecordingReader::open(recording)?;
    let mut first: Option<RecordedFrame> = None;
    let mut before = f64::NEG_INFINITY;
    while let Some(frame) = reader.next_frame()? {
        let now = frame.time_secs;
        for (story, sheet) in stories.iter().zip(&mut sheets) {
            // The first frame at or after a moment shows it.
            let is_due = |&&t: &&f64| before < t - 1e-6 && t - 1e-6 <= now;
            if frame.skin.is_none() || !story.moments.iter().any(|t| is_due(&t)) {
                continue;
            }
            let first = first.as_ref().unwrap_or(&frame);
            let look = FaceLook::default();
            let mut shown = frame.clone();
            if story.is_steady {
                shown.head = Default::default();
            }
            let layers = recording_layers(&shown, first, RecordingContent::Face, &look)?;
            let picture = Picture::new(story.size[0], story.size[1])
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
    for (story, sheet) in stories.iter().zip(&sheets) {
        let path = folder.join(story.file);
        sheet.compose(story.columns)?.save_png(&path)?;
        console.result(&path.display().to_string());
    }
    Ok(())
}
