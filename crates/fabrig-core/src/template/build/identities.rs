//! How people differ: principal components of the source's identity targets.
//!
//! An identity is taken for the template plus the sum of all targets, each weighted by a normal
//! deviate of the recipe's standard deviation. Targets of whole people are taken from the mixture
//! of them that the template is, so that a person who is one of them all through lies along one
//! such direction. The covariance of vertex positions is then known in closed form; its leading
//! eigenvectors, free of similarities, are the modes: one set moves both sides alike, a smaller
//! one is the difference between them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::{DMatrix, SMatrix, SVector, SymmetricEigen};
use serde::Deserialize;

use super::crop::crop_head;
use super::identity::{dense, symmetric_left};
use super::source::{BaseMesh, read_body_target};
use crate::Vector;
use crate::atomic_file::write_atomically;
use crate::template::description::Description;
use crate::template::identity::{StoredModes, store_modes};
use crate::template::{Template, TemplateError};

/// The text of `identities.toml`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentityRecipe {
    neck_vertex: u32,
    millimetres_per_unit: f64,
    symmetric_modes: usize,
    antisymmetric_modes: usize,
    outlying_regions: Vec<String>,
    outlying_weight: f64,
    /// Targets that are left out.
    held_out: BTreeSet<String>,
    /// Standard deviation of the difference between left and right, in those of what they share.
    sided: f64,
    folders: BTreeMap<String, f64>,
    asymmetric: Asymmetric,
    people: Vec<Kind>,
}

/// A folder of targets that differ from side to side, in mirrored pairs `-l` and `-r`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asymmetric {
    folder: String,
    /// Standard deviation of what a pair shares.
    symmetric: f64,
    /// Standard deviation of its difference.
    antisymmetric: f64,
}

/// Targets of whole people that stand for each other: their weights sum to one.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kind {
    /// Starts of their names.
    starts: Vec<String>,
    deviation: f64,
}

impl IdentityRecipe {
    /// Reads the text of a recipe.
    ///
    /// # Errors
    ///
    /// [`TemplateError::Text`] with line and column.
    pub fn parse(text: &str) -> Result<Self, TemplateError> {
        toml::from_str(text).map_err(|source| TemplateError::Text {
            file: "identities.toml",
            source: Box::new(source),
        })
    }

    /// Names of the targets that are left out.
    pub fn held_out(&self) -> impl Iterator<Item = &str> {
        self.held_out.iter().map(String::as_str)
    }

    /// Builds the modes from `data` and writes them as `identity.bin` is kept.
    ///
    /// - `description`: the text of the template's own `template.toml`
    ///
    /// # Errors
    ///
    /// [`TemplateError`]; the file is only replaced by a whole one.
    pub fn write(
        &self,
        data: &Path,
        description: &str,
        template: &Template,
        path: &Path,
    ) -> Result<(), TemplateError> {
        let description = Description::parse(description)?;
        let average = description
            .build
            .map(|build| build.identity)
            .unwrap_or_default();
        let bytes = crate::template::geometry::pack(&self.stored(data, &average, template)?)?;
        write_atomically(path, |file| file.write_all(&bytes)).map_err(|source| {
            TemplateError::Write {
                path: path.to_owned(),
                source,
            }
        })
    }

    fn stored(
        &self,
        data: &Path,
        average: &BTreeMap<String, f64>,
        template: &Template,
    ) -> Result<StoredModes, TemplateError> {
        let base = BaseMesh::read(data)?;
        let head = crop_head(&base, self.neck_vertex)?;
        if head.source.len() != template.skin.vertex_count() {
            return Err(TemplateError::Source {
                reason: "the head is not cut where the template's is".to_owned(),
            });
        }
        let halves = |name: &str| -> Result<Halves, TemplateError> {
            let all = dense(name, &read_body_target(data, name)?, &base)?;
            let own: Vec<Vector> = head
                .source
                .iter()
                .map(|&s| all[s as usize] * self.millimetres_per_unit)
                .collect();
            let symmetric = symmetric_left(&own, &own, &head.mirror);
            let antisymmetric = own.iter().zip(&symmetric).map(|(d, s)| d - s).collect();
            Ok(Halves {
                symmetric,
                antisymmetric,
            })
        };
        let mut shared: Vec<Vec<Vector>> = Vec::new();
        let mut different: Vec<Vec<Vector>> = Vec::new();
        for (folder, &deviation) in &self.folders {
            for name in self.names(data, folder)? {
                // A target of the left side stands for the right one's too.
                match side_of(&name) {
                    Some('r') => {}
                    Some(_) => {
                        let halves = halves(&name)?;
                        shared.push(scaled(halves.symmetric, 2.0 * deviation));
                        let of_difference = 2.0 * deviation * self.sided;
                        different.push(scaled(halves.antisymmetric, of_difference));
                    }
                    None => shared.push(scaled(halves(&name)?.symmetric, deviation)),
                }
            }
        }
        for name in self.names(data, &self.asymmetric.folder)? {
            if name.ends_with("-l") {
                let halves = halves(&name)?;
                shared.push(scaled(halves.symmetric, self.asymmetric.symmetric));
                different.push(scaled(halves.antisymmetric, self.asymmetric.antisymmetric));
            }
        }
        for kind in &self.people {
            let is_one = |name: &str| {
                let own = name.rsplit('/').next().unwrap_or(name);
                kind.starts.iter().any(|s| own.starts_with(s))
            };
            let mut mixture = vec![Vector::zeros(); head.source.len()];
            for (name, &weight) in average.iter().filter(|(name, _)| is_one(name)) {
                for (m, d) in mixture.iter_mut().zip(halves(name)?.symmetric) {
                    *m += d * weight;
                }
            }
            for name in self.names(data, "macrodetails")? {
                if is_one(&name) && !name.contains("-baby") {
                    let own = halves(&name)?.symmetric;
                    let off = own.iter().zip(&mixture).map(|(d, m)| d - m).collect();
                    shared.push(scaled(off, kind.deviation));
                }
            }
        }
        let weights: Vec<f64> = template
            .regions
            .vertex_regions
            .iter()
            .map(|r| {
                let name = &template.regions.regions[r.0 as usize].name;
                let is_outlying = self.outlying_regions.iter().any(|o| name.starts_with(o));
                if is_outlying {
                    self.outlying_weight
                } else {
                    1.0
                }
            })
            .collect();
        for field in shared.iter_mut().chain(&mut different) {
            without_similarity(template, &weights, field);
        }
        Ok(store_modes(
            &template.mirror,
            &principal(&shared, &weights, self.symmetric_modes),
            &principal(&different, &weights, self.antisymmetric_modes),
        ))
    }

    /// Targets in a folder that are not held out, sorted, with the folder before their names.
    fn names(&self, data: &Path, folder: &str) -> Result<Vec<String>, TemplateError> {
        let path = data.join("mpfb2/targets").join(folder);
        let failed = |source| TemplateError::Read {
            path: path.clone(),
            source,
        };
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&path).map_err(failed)? {
            let name = entry.map_err(failed)?.file_name();
            if let Some(stem) = name.to_str().and_then(|n| n.strip_suffix(".target.gz")) {
                names.push(format!("{folder}/{stem}"));
            }
        }
        names.retain(|name| !self.held_out.contains(name));
        names.sort();
        Ok(names)
    }
}

/// A target's mirror symmetric part, and the rest. (mm)
struct Halves {
    symmetric: Vec<Vector>,
    antisymmetric: Vec<Vector>,
}

/// Whether a target's name starts with a side.
fn side_of(name: &str) -> Option<char> {
    let own = name.rsplit('/').next().unwrap_or(name);
    ['l', 'r']
        .into_iter()
        .find(|side| own.starts_with(&format!("{side}-")))
}

fn scaled(field: Vec<Vector>, by: f64) -> Vec<Vector> {
    field.into_iter().map(|d| d * by).collect()
}

/// Takes the least-squares shift, turn and change of size out of a field.
fn without_similarity(template: &Template, weights: &[f64], field: &mut [Vector]) {
    let generators = |v: usize| -> [Vector; 7] {
        let p = template.skin.positions()[v].coords / 100.0;
        let [x, y, z] = [Vector::x(), Vector::y(), Vector::z()];
        [x, y, z, x.cross(&p), y.cross(&p), z.cross(&p), p]
    };
    let mut a = SMatrix::<f64, 7, 7>::zeros();
    let mut b = SVector::<f64, 7>::zeros();
    for (v, d) in field.iter().enumerate() {
        let g = generators(v);
        for i in 0..7 {
            b[i] += weights[v] * g[i].dot(d);
            for j in 0..7 {
                a[(i, j)] += weights[v] * g[i].dot(&g[j]);
            }
        }
    }
    let Some(factor) = a.cholesky() else {
        return;
    };
    let x = factor.solve(&b);
    for (v, d) in field.iter_mut().enumerate() {
        for (g, x) in generators(v).iter().zip(x.iter()) {
            *d -= g * *x;
        }
    }
}

/// Leading components of fields that are drawn with unit deviation; each has the length of its
/// own standard deviation.
fn principal(fields: &[Vec<Vector>], weights: &[f64], count: usize) -> Vec<Vec<Vector>> {
    let gram = DMatrix::from_fn(fields.len(), fields.len(), |i, j| {
        if j > i {
            return 0.0;
        }
        fields[i]
            .iter()
            .zip(&fields[j])
            .zip(weights)
            .map(|((a, b), w)| w * a.dot(b))
            .sum()
    });
    let gram = DMatrix::from_fn(fields.len(), fields.len(), |i, j| {
        gram[(i.max(j), i.min(j))]
    });
    let eigen = SymmetricEigen::new(gram);
    let mut order: Vec<usize> = (0..fields.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order
        .into_iter()
        .take(count)
        .map(|k| {
            let u = eigen.eigenvectors.column(k);
            // Either sign is an eigenvector: the largest part is positive.
            let largest = u
                .iter()
                .copied()
                .fold(0.0, |m: f64, x| if x.abs() > m.abs() { x } else { m });
            let sign = if largest < 0.0 { -1.0 } else { 1.0 };
            (0..weights.len())
                .map(|v| {
                    fields
                        .iter()
                        .zip(u.iter())
                        .map(|(f, u)| f[v] * (sign * u))
                        .sum()
                })
                .collect()
        })
        .collect()
}
