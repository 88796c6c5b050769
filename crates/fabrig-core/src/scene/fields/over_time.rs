//! Values that a scene gives once and for all, or by keys in time.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::Curve;
use crate::{Point, Vector};

/// How keys are joined. Before the first and after the last their values hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Join {
    /// By straight lines.
    #[default]
    Straight,
    /// By the cubic spline that comes to rest at both ends and whose second derivative is
    /// continuous; between keys that turn sharply it may go past them.
    Smooth,
}

/// A value, or values by time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum OverTime<T> {
    /// The same at all times.
    Constant(T),
    /// By keys.
    Keyed(Keyed<T>),
}

/// Values by time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyed<T> {
    /// How keys are joined.
    #[serde(default)]
    pub join: Join,
    /// The keys, rising in time.
    pub keys: Vec<KeyedValue<T>>,
}

/// A value at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyedValue<T> {
    /// Time on the scene's axis. (s)
    pub time: f64,
    /// The value there.
    pub value: T,
}

impl<T> From<T> for OverTime<T> {
    fn from(value: T) -> Self {
        Self::Constant(value)
    }
}

impl From<[f32; 3]> for OverTime<Vector3<f32>> {
    fn from(value: [f32; 3]) -> Self {
        Self::Constant(value.into())
    }
}

impl<T: Copy> OverTime<T> {
    fn curve_of<const N: usize>(&self, numbers: impl Fn(&T) -> [f64; N]) -> Curve<N> {
        match self {
            Self::Constant(value) => Curve::constant(numbers(value)),
            Self::Keyed(keyed) => Curve::new(
                keyed.join,
                keyed.keys.iter().map(|key| key.time).collect(),
                keyed.keys.iter().map(|key| numbers(&key.value)).collect(),
            ),
        }
    }
}

impl OverTime<Vector3<f32>> {
    pub(in crate::scene) fn curve(&self) -> Curve<3> {
        self.curve_of(|v| [v.x, v.y, v.z].map(f64::from))
    }
}

impl OverTime<f64> {
    pub(in crate::scene) fn curve(&self) -> Curve<1> {
        self.curve_of(|v| [*v])
    }
}

/// What moves the head.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum HeadDrive {
    /// The take, where it has head motion; with `false` nothing does.
    Take(bool),
    /// Keys, whatever the take says.
    Keyed(HeadKeys),
}

/// Motion of the head by keys.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeadKeys {
    /// How keys are joined: straight joints jolt the face at every key.
    #[serde(default = "smooth")]
    pub join: Join,
    /// The keys, rising in time.
    pub keys: Vec<HeadKey>,
}

fn smooth() -> Join {
    Join::Smooth
}

/// Where the head is at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeadKey {
    /// Time on the scene's axis. (s)
    pub time: f64,
    /// Where the head has moved to from rest. (mm)
    #[serde(default = "Vector3::zeros")]
    pub position: Vector3<f64>,
    /// Turn about the neck's pivot: an axis times an angle. From key to key its three numbers
    /// are joined each on its own, so that a turn about one axis is just that, and 6.283 is a
    /// whole turn. (rad)
    #[serde(default = "Vector3::zeros")]
    pub rotation: Vector3<f64>,
}

impl HeadKeys {
    pub(in crate::scene) fn curve(&self) -> Curve<6> {
        let numbers = |key: &HeadKey| {
            let (p, r) = (key.position, key.rotation);
            [p.x, p.y, p.z, r.x, r.y, r.z]
        };
        Curve::new(
            self.join,
            self.keys.iter().map(|key| key.time).collect(),
            self.keys.iter().map(numbers).collect(),
        )
    }
}

/// From the head frame to where the head has moved, by a curve of [`HeadKeys`].
pub(in crate::scene) fn keyed_head(curve: &Curve<6>, time: f64, pivot: &Point) -> Isometry3<f64> {
    let [x, y, z, a, b, c] = curve.at(time);
    let turn = UnitQuaternion::from_scaled_axis(Vector::new(a, b, c));
    let shift = pivot.coords - turn * pivot.coords + Vector::new(x, y, z);
    Isometry3::from_parts(Translation3::from(shift), turn)
}
