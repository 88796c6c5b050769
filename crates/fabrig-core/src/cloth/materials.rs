//! Cloth materials: the numbers of the paper's Table 2 (Maya nCloth's) and what they mean here.
//!
//! nCloth's numbers have no units. They are given units by one calibrated time,
//! [`TIME_UNIT`] = 1/87 s: a resistance r is a stiffness of `r / TIME_UNIT^2` per unit of mass
//! (7,569 s^-2), a stretch damping d a damping time of `d * TIME_UNIT` (force
//! `d * TIME_UNIT * k * rate`). The unit of mass is that of a node of mass 1. Then:
//!
//! - stretch and compression resistance: `k = r / T^2` per grid edge;
//! - shear resistance (Table 2 has none; nCloth's own default would be 0, under which a grid of
//!   springs is a mechanism): a number of the same kind, per cell diagonal;
//! - bend resistance: `k = r / T^2 / 50` per second difference of displacement. The factor
//!   makes the wavelength at which bending balances the magnet, `2 pi (k_bend/k_magnet)^(1/4)`
//!   edges, about five edges (a wrinkle the grid can show), where 1 would make it thirteen;
//! - overall damping: a rate in 1/s, as it stands;
//! - pressure: `k = 400 r / T^2` per node for a pad lifted as a whole off what it lies on, that is
//!   `k_volume = 400 r / T^2 * nodes / area^2`. Fat can hardly be compressed; with this factor
//!   Table 2's pressure keeps every pad of a face within 3 % of its volume under any gravity,
//!   where 1 would leave it a quarter.
//!
//! What the paper adds to nCloth, and Table 2 does not list, is the magnet. It is given by how
//! soft tissue moves: its frequency and its damping ratio. Cheek fat swings at about 7 Hz and
//! rings for two to four cycles; an active muscle is stiffer and near-critically damped. With
//! them the ratio of stretch to magnet stiffness is 13 for muscles and 31 for fat.
//!
//! The text form is TOML, one table per material, as in a template pack's `materials.toml`:
//!
//! ```toml
//! [fat]
//! mass = 1.0
//! stretch_resistance = 8.0
//! compression_resistance = 8.0
//! shear_resistance = 4.0
//! bend_resistance = 3.0
//! bend_angle_dropoff = 0.3
//! damping = 1.5
//! stretch_damping = 0.2
//! pressure = 0.3
//! magnet_frequency_hz = 7.0
//! magnet_damping_ratio = 0.12
//! ```

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The calibrated unit of time of nCloth's numbers. (s)
pub const TIME_UNIT: f64 = 1.0 / 87.0;

/// Share of [`TIME_UNIT`]'s stiffness in a second difference.
const BEND_SHARE: f64 = 1.0 / 50.0;

/// The same, in the volume of a pad lifted as a whole.
pub(crate) const PRESSURE_SHARE: f64 = 400.0;

/// A material, in nCloth's numbers (see the module's documentation for their units).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Mass of a node, > 0.
    pub mass: f64,
    /// Resistance of grid edges to being longer than at rest.
    pub stretch_resistance: f64,
    /// Resistance of grid edges to being shorter than at rest.
    pub compression_resistance: f64,
    /// Resistance of cell diagonals to changes of length.
    #[serde(default = "default_shear_resistance")]
    pub shear_resistance: f64,
    /// Resistance to bending more than the target does.
    pub bend_resistance: f64,
    /// 0: every bend angle is resisted alike; towards 1: small ones less. In [0, 1).
    pub bend_angle_dropoff: f64,
    /// Damping of velocity in the head frame. (1/s)
    #[serde(alias = "overall_damping")]
    pub damping: f64,
    /// Damping of the edges' change of length.
    pub stretch_damping: f64,
    /// Resistance to change of the volume under the patch; 0 for muscles.
    #[serde(default)]
    pub pressure: f64,
    /// Frequency at which a lone node swings about its target. (Hz)
    #[serde(default = "default_magnet_frequency")]
    pub magnet_frequency_hz: f64,
    /// Damping ratio of that swing relative to the target, 1 = critical.
    #[serde(default = "default_magnet_damping")]
    pub magnet_damping_ratio: f64,
}

fn default_shear_resistance() -> f64 {
    Material::LINEAR_MUSCLE.shear_resistance
}

fn default_magnet_frequency() -> f64 {
    Material::LINEAR_MUSCLE.magnet_frequency_hz
}

fn default_magnet_damping() -> f64 {
    Material::LINEAR_MUSCLE.magnet_damping_ratio
}

impl Material {
    /// Table 2, linear muscle.
    pub const LINEAR_MUSCLE: Self = Self {
        mass: 1.0,
        stretch_resistance: 10.0,
        compression_resistance: 10.0,
        shear_resistance: 5.0,
        bend_resistance: 5.0,
        bend_angle_dropoff: 0.3,
        damping: 0.72,
        stretch_damping: 0.1,
        pressure: 0.0,
        magnet_frequency_hz: 12.0,
        magnet_damping_ratio: 0.8,
    };

    /// Table 2, sphincter.
    pub const SPHINCTER: Self = Self {
        bend_angle_dropoff: 0.2,
        ..Self::LINEAR_MUSCLE
    };

    /// Table 2, fat pad.
    pub const FAT: Self = Self {
        mass: 1.0,
        stretch_resistance: 8.0,
        compression_resistance: 8.0,
        shear_resistance: 4.0,
        bend_resistance: 3.0,
        bend_angle_dropoff: 0.3,
        damping: 1.5,
        stretch_damping: 0.2,
        pressure: 0.3,
        magnet_frequency_hz: 7.0,
        magnet_damping_ratio: 0.12,
    };

    /// Stiffness of the magnet. [mass/s^2]
    pub fn magnet_stiffness(&self) -> f64 {
        let rate = std::f64::consts::TAU * self.magnet_frequency_hz;
        self.mass * rate * rate
    }

    /// Damping rate of the magnet. (1/s)
    pub fn magnet_damping(&self) -> f64 {
        2.0 * self.magnet_damping_ratio * std::f64::consts::TAU * self.magnet_frequency_hz
    }

    /// Stiffness of an edge that is too long. [mass/s^2]
    pub fn stretch_stiffness(&self) -> f64 {
        self.stretch_resistance / (TIME_UNIT * TIME_UNIT)
    }

    /// Stiffness of an edge that is too short. [mass/s^2]
    pub fn compression_stiffness(&self) -> f64 {
        self.compression_resistance / (TIME_UNIT * TIME_UNIT)
    }

    /// Stiffness of a diagonal. [mass/s^2]
    pub fn shear_stiffness(&self) -> f64 {
        self.shear_resistance / (TIME_UNIT * TIME_UNIT)
    }

    /// Stiffness of a second difference. [mass/s^2]
    pub fn bend_stiffness(&self) -> f64 {
        self.bend_resistance * BEND_SHARE / (TIME_UNIT * TIME_UNIT)
    }

    /// Stiffness of the volume of a patch. [mass/(s^2 mm^4)]
    ///
    /// - `area`: of the patch at rest [mm^2]
    pub fn pressure_stiffness(&self, node_count: usize, area: f64) -> f64 {
        if area > 0.0 {
            self.pressure * PRESSURE_SHARE / (TIME_UNIT * TIME_UNIT) * node_count as f64
                / (area * area)
        } else {
            0.0
        }
    }

    /// Damping of an edge over its stiffness. (s)
    pub fn stretch_damping_time(&self) -> f64 {
        self.stretch_damping * TIME_UNIT
    }

    /// Stretch stiffness over magnet stiffness: how far a pull spreads (its square root, in
    /// edges), and how hard one sweep finds the solution. Infinite without a magnet.
    pub fn stiffness_ratio(&self) -> f64 {
        self.stretch_stiffness().max(self.compression_stiffness()) / self.magnet_stiffness()
    }

    /// Checks that every number is finite and in its range.
    ///
    /// # Errors
    ///
    /// The first number that is not, by name.
    pub fn validate(&self) -> Result<(), MaterialError> {
        let bounded = [
            ("mass", self.mass, f64::MIN_POSITIVE, 1e12),
            ("stretch_resistance", self.stretch_resistance, 0.0, 1e12),
            (
                "compression_resistance",
                self.compression_resistance,
                0.0,
                1e12,
            ),
            ("shear_resistance", self.shear_resistance, 0.0, 1e12),
            ("bend_resistance", self.bend_resistance, 0.0, 1e12),
            ("bend_angle_dropoff", self.bend_angle_dropoff, 0.0, 0.999),
            ("damping", self.damping, 0.0, 1e6),
            ("stretch_damping", self.stretch_damping, 0.0, 1e6),
            ("pressure", self.pressure, 0.0, 1e12),
            ("magnet_frequency_hz", self.magnet_frequency_hz, 0.0, 1e6),
            ("magnet_damping_ratio", self.magnet_damping_ratio, 0.0, 1e6),
        ];
        for (name, value, low, high) in bounded {
            // Written so that NaN is out of range.
            if !(value >= low && value <= high) {
                return Err(MaterialError::OutOfRange {
                    name,
                    value,
                    low,
                    high,
                });
            }
        }
        Ok(())
    }
}

/// Materials by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Materials {
    by_name: BTreeMap<String, Material>,
}

impl Materials {
    /// Reads the text of a pack's `materials.toml`.
    ///
    /// # Errors
    ///
    /// [`MaterialError::Parse`] with the place in the text, or [`MaterialError::Invalid`] with
    /// the material's name.
    pub fn parse(text: &str) -> Result<Self, MaterialError> {
        let materials: Self = toml::from_str(text).map_err(Box::new)?;
        for (name, material) in &materials.by_name {
            material
                .validate()
                .map_err(|source| MaterialError::Invalid {
                    material: name.clone(),
                    source: Box::new(source),
                })?;
        }
        Ok(materials)
    }

    /// The material called `name`.
    ///
    /// # Errors
    ///
    /// [`MaterialError::Unknown`], with the names there are.
    pub fn get(&self, name: &str) -> Result<&Material, MaterialError> {
        self.by_name
            .get(name)
            .ok_or_else(|| MaterialError::Unknown {
                name: name.to_owned(),
                known: self.by_name.keys().cloned().collect::<Vec<_>>().join(", "),
            })
    }

    /// Names and materials, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Material)> {
        self.by_name.iter().map(|(name, m)| (name.as_str(), m))
    }
}

impl Default for Materials {
    /// Table 2: `linear`, `sphincter`, `fat`.
    fn default() -> Self {
        let table = [
            ("linear", Material::LINEAR_MUSCLE),
            ("sphincter", Material::SPHINCTER),
            ("fat", Material::FAT),
        ];
        Self {
            by_name: table.map(|(n, m)| (n.to_owned(), m)).into_iter().collect(),
        }
    }
}

/// What can be wrong with materials.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// The text is not TOML, or lacks or misspells a number.
    #[error("cannot read materials")]
    Parse(#[from] Box<toml::de::Error>),
    /// A number of one material is out of range.
    #[error("material `{material}`")]
    Invalid {
        /// Its name.
        material: String,
        /// What is wrong with it.
        #[source]
        source: Box<MaterialError>,
    },
    /// A number is out of range, or no number.
    #[error("`{name}` is {value}, but must be between {low} and {high}")]
    OutOfRange {
        /// Its name.
        name: &'static str,
        /// What was given.
        value: f64,
        /// Smallest allowed.
        low: f64,
        /// Largest allowed.
        high: f64,
    },
    /// No material has this name.
    #[error("no material is called `{name}`; there are: {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The names there are.
        known: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE_2: &str = "
        [linear]
        mass = 1.0
        stretch_resistance = 10.0
        compression_resistance = 10.0
        bend_resistance = 5.0
        bend_angle_dropoff = 0.3
        damping = 0.72
        stretch_damping = 0.1

        [fat]
        mass = 1.0
        stretch_resistance = 8.0
        compression_resistance = 8.0
        shear_resistance = 4.0
        bend_resistance = 3.0
        bend_angle_dropoff = 0.3
        damping = 1.5
        stretch_damping = 0.2
        pressure = 0.3
        magnet_frequency_hz = 7.0
        magnet_damping_ratio = 0.12
    ";

    #[test]
    fn table_2_is_read_with_defaults_for_what_it_lacks() {
        let materials = Materials::parse(TABLE_2).unwrap();
        assert_eq!(materials.get("fat"), Ok(&Material::FAT));
        assert_eq!(materials.get("linear"), Ok(&Material::LINEAR_MUSCLE));
    }

    #[test]
    fn stiffness_ratios_are_those_documented() {
        assert!((Material::LINEAR_MUSCLE.stiffness_ratio() - 13.3).abs() < 0.1);
        assert!((Material::FAT.stiffness_ratio() - 31.3).abs() < 0.1);
    }

    #[test]
    fn errors_name_the_material_the_number_and_the_value() {
        let text = TABLE_2.replace("damping = 0.72", "damping = nan");
        let error = Materials::parse(&text).unwrap_err();
        let MaterialError::Invalid { material, source } = error else {
            panic!("{error:?}");
        };
        assert_eq!(material, "linear");
        assert!(
            source.to_string().starts_with("`damping` is NaN"),
            "{source}"
        );
        let text = TABLE_2.replace("mass = 1.0", "mas = 1.0");
        assert!(matches!(
            Materials::parse(&text),
            Err(MaterialError::Parse(_))
        ));
        let unknown = Materials::default().get("bone").unwrap_err();
        assert!(unknown.to_string().contains("fat, linear, sphincter"));
    }
}
