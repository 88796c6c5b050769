//! What may be left out.

use serde::{Deserialize, Serialize};

use crate::rig::Rig;
use crate::scene::SceneError;

/// By how much a frame may differ from the full model's: the root mean square over the nodes of
/// any patch. In text a number is millimetres, `"0.05 %"` a share of the face's height.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub enum Tolerance {
    /// (mm), 0 to 10.
    Millimetres(f64),
    /// (%) of the height of the face's patches, 0 to 5.
    Percent(f64),
}

impl Tolerance {
    /// Largest that is accepted, in millimetres and in percent.
    pub const MOST: [f64; 2] = [10.0, 5.0];

    /// On a face. (mm)
    pub fn on(&self, rig: &Rig) -> f64 {
        match self {
            Self::Millimetres(mm) => *mm,
            Self::Percent(percent) => {
                let nodes = rig.patches.iter().flat_map(|patch| &patch.patch.neutral);
                let (low, high) = nodes.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                    (a.min(p.y), b.max(p.y))
                });
                percent / 100.0 * (high - low).max(0.0)
            }
        }
    }

    fn check(&self) -> Result<(), SceneError> {
        let (value, most) = match self {
            Self::Millimetres(mm) => (*mm, Self::MOST[0]),
            Self::Percent(percent) => (*percent, Self::MOST[1]),
        };
        // Written so that NaN is out of range.
        if value >= 0.0 && value <= most {
            return Ok(());
        }
        Err(no_tolerance(&self.to_string()))
    }
}

impl std::fmt::Display for Tolerance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Millimetres(mm) => write!(f, "{mm} mm"),
            Self::Percent(percent) => write!(f, "{percent} %"),
        }
    }
}

impl std::str::FromStr for Tolerance {
    type Err = SceneError;

    /// Reads `0.1`, `0.1 mm`, `0.05 %` or `off`, which is 0.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        let text = text.trim();
        if text == "off" {
            return Ok(Self::Millimetres(0.0));
        }
        let (number, make): (&str, fn(f64) -> Self) = match text.strip_suffix('%') {
            Some(number) => (number, Self::Percent),
            None => (
                text.strip_suffix("mm").unwrap_or(text),
                Self::Millimetres as fn(f64) -> Self,
            ),
        };
        let read = number.trim().parse().ok().map(make);
        read.filter(|tolerance| tolerance.check().is_ok())
            .ok_or_else(|| no_tolerance(text))
    }
}

fn no_tolerance(found: &str) -> SceneError {
    SceneError::Tolerance {
        found: found.into(),
    }
}

/// A tolerance as text files have it.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Number(f64),
    Text(String),
}

impl TryFrom<Written> for Tolerance {
    type Error = SceneError;

    fn try_from(written: Written) -> Result<Self, SceneError> {
        match written {
            Written::Number(mm) => Ok(Self::Millimetres(mm)),
            Written::Text(text) => text.parse(),
        }
    }
}

impl From<Tolerance> for Written {
    fn from(tolerance: Tolerance) -> Self {
        match tolerance {
            Tolerance::Millimetres(mm) => Self::Number(mm),
            percent @ Tolerance::Percent(_) => Self::Text(percent.to_string()),
        }
    }
}

/// What may be left out, and how far the result may then be off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Economy {
    /// By how much a frame may differ from the full model's; 0 models everything.
    pub tolerance: Tolerance,
    /// Patches sleep while nothing acts on them. Not where anything can touch anything.
    pub sleep: bool,
    /// Patches sleep while their muscle shapes move, too, where these alone say where they are.
    pub quasi_static: bool,
    /// Frames take as few substeps as the motion allows, and at most
    /// [`substeps`](crate::cloth::ClothOptions::substeps). Not where anything can touch anything.
    pub substeps: bool,
    /// The skin is moved only where its patches moved.
    pub skin: bool,
}

impl Default for Economy {
    fn default() -> Self {
        Self {
            tolerance: Tolerance::Millimetres(0.1),
            sleep: true,
            quasi_static: true,
            substeps: true,
            skin: true,
        }
    }
}

impl Economy {
    /// Everything is modelled.
    pub const OFF: Self = Self {
        tolerance: Tolerance::Millimetres(0.0),
        sleep: false,
        quasi_static: false,
        substeps: false,
        skin: false,
    };

    /// All parts, within a tolerance. (mm)
    pub fn within(tolerance: f64) -> Self {
        Self {
            tolerance: Tolerance::Millimetres(tolerance),
            ..Self::default()
        }
    }

    /// Checks ranges.
    ///
    /// # Errors
    ///
    /// [`SceneError::Tolerance`].
    pub fn check(&self) -> Result<(), SceneError> {
        self.tolerance.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_read_in_millimetres_and_in_percent() {
        let read = |text: &str| text.parse::<Tolerance>();
        assert_eq!(read("0.1").unwrap(), Tolerance::Millimetres(0.1));
        assert_eq!(read(" 0.1 mm").unwrap(), Tolerance::Millimetres(0.1));
        assert_eq!(read("off").unwrap(), Tolerance::Millimetres(0.0));
        assert_eq!(read("0.05 %").unwrap(), Tolerance::Percent(0.05));
        for bad in ["", "-1", "11", "6%", "nan", "0.1 m", "inf"] {
            assert!(
                read(bad).is_err_and(|e| e.to_string().contains(bad)),
                "{bad}"
            );
        }
        for tolerance in [Tolerance::Millimetres(0.25), Tolerance::Percent(0.5)] {
            let text = serde_json::to_string(&tolerance).unwrap();
            assert_eq!(serde_json::from_str::<Tolerance>(&text).unwrap(), tolerance);
        }
    }
}
