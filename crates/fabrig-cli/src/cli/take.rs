//! Takes: what wrote them, what is done to them, and where they come from.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use fabrig_core::motion::TakeFormat;

/// What wrote a take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MotionFormat {
    /// Keyed text
    Keys,
    /// A table of ARKit's shapes: Live Link Face and others
    Arkit,
    /// OpenFace's CSV
    OpenFace,
    /// py-feat's CSV
    PyFeat,
    /// Face Cap's text
    FaceCap,
    /// MediaPipe's blendshapes, JSON or CSV
    MediaPipe,
}

impl From<MotionFormat> for TakeFormat {
    fn from(format: MotionFormat) -> Self {
        match format {
            MotionFormat::Keys => Self::Keys,
            MotionFormat::Arkit => Self::Arkit,
            MotionFormat::OpenFace => Self::OpenFace,
            MotionFormat::PyFeat => Self::PyFeat,
            MotionFormat::FaceCap => Self::FaceCap,
            MotionFormat::MediaPipe => Self::MediaPipe,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct TakeArgs {
    /// What wrote the take [default: found from its content]
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub(crate) motion_format: Option<MotionFormat>,
    /// Frames per second of a take that has frame numbers or no times
    #[arg(long, value_name = "FPS")]
    pub(crate) motion_fps: Option<f64>,
    /// Times of the take are milliseconds where seconds are usual
    #[arg(long)]
    pub(crate) motion_milliseconds: bool,
    /// Pass over columns of the take that are not known
    #[arg(long)]
    pub(crate) ignore_unknown_columns: bool,
    /// Clamp weights of the take that are outside [0, 1]
    #[arg(long)]
    pub(crate) clamp_weights: bool,
    /// Take the performer's neutral face off: its median over the first SECS, or FROM..TO
    #[arg(
        long,
        value_name = "SECS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "1",
        value_parser = parse_stretch
    )]
    pub(crate) calibrate_neutral: Option<[f64; 2]>,
    /// Multiply the weights of a shape: SHAPE=FACTOR; `all` for every shape; may be repeated
    #[arg(long, value_name = "SHAPE=FACTOR", value_parser = parse_gain)]
    pub(crate) gain: Vec<(String, f64)>,
    /// Exchange left and right
    #[arg(long)]
    pub(crate) swap_sides: bool,
    /// Leave `mouthClose` as it is where it exceeds `jawOpen`
    #[arg(long)]
    pub(crate) keep_mouth_close: bool,
    /// Bring the take to this many frames per second first, 1 to 240
    #[arg(long, value_name = "FPS")]
    pub(crate) resample: Option<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct RetargetArgs {
    /// Markers as C3D or TRC; or the rig's own mesh in motion: a folder of OBJ files, or .npy
    /// with shape (frames, vertices, 3)
    pub(crate) source: PathBuf,
    /// Rig of the face that the source shows
    #[arg(long, value_name = "FACE.fabrig")]
    pub(crate) rig: PathBuf,
    /// Where to write the take, a CSV of ARKit's shapes
    #[arg(short, long, value_name = "TAKE.csv")]
    pub(crate) output: PathBuf,
    /// Fit FACS action units instead of the shapes one by one: numbers with commas between
    #[arg(long, value_name = "1,2,4,...", value_delimiter = ',')]
    pub(crate) units: Vec<u32>,
    /// When the markers' face is neutral: the first SECS, or FROM..TO
    #[arg(long, value_name = "SECS", default_value = "0.2", value_parser = parse_stretch)]
    pub(crate) neutral: [f64; 2],
    /// JSON of marker name to the name of the landmark it stands at, three or more
    #[arg(long, value_name = "JSON")]
    pub(crate) places: Option<PathBuf>,
    /// Frames per second of an animated mesh
    #[arg(long, value_name = "FPS", default_value_t = 30.0)]
    pub(crate) source_fps: f64,
    /// The source is without head motion
    #[arg(long)]
    pub(crate) still_head: bool,
    /// Noise of the source's coordinates in mm: more is smoother [default: 0.5 for markers,
    /// 0.01 for a mesh]
    #[arg(long, value_name = "MM")]
    pub(crate) noise: Option<f64>,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `SECS` from the start, or `FROM..TO`. (s)
fn parse_stretch(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|t| t.is_finite());
    let stretch = match text.split_once("..") {
        Some((from, to)) => number(from).zip(number(to)),
        None => number(text).map(|to| (0.0, to)),
    };
    match stretch {
        Some((from, to)) if 0.0 <= from && from <= to => Ok([from, to]),
        _ => Err("expected seconds from the start, or FROM..TO".to_owned()),
    }
}

fn parse_gain(text: &str) -> Result<(String, f64), String> {
    let (name, factor) = text.split_once('=').unwrap_or((text, ""));
    match factor.trim().parse::<f64>() {
        Ok(factor) if factor.is_finite() && factor >= 0.0 => Ok((name.trim().to_owned(), factor)),
        _ => Err("expected SHAPE=FACTOR with a factor of at least 0".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_and_gains_are_read() {
        assert_eq!(parse_stretch("2"), Ok([0.0, 2.0]));
        assert_eq!(parse_stretch("1.5..2"), Ok([1.5, 2.0]));
        assert_eq!(
            parse_gain("mouthSmile=1.5"),
            Ok(("mouthSmile".to_owned(), 1.5))
        );
        for bad in ["", "x", "2..1", "-1..2", "nan"] {
            assert!(parse_stretch(bad).is_err(), "{bad}");
        }
        for bad in ["", "jawOpen", "jawOpen=-1", "jawOpen=inf"] {
            assert!(parse_gain(bad).is_err(), "{bad}");
        }
    }
}
