//! How people differ: principal components of the source's identity targets.
//!
//! An identity is taken for the template plus the sum of all targets, each weighted by a normal
//! deviate of the recipe's standard deviation. The covariance of vertex positions is then known
//! in closed form; its leading eigenvectors, made mirror symmetric and free of similarities,
//! are the modes.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{DMatrix, SMatrix, SVector, SymmetricEigen};
use serde::Deserialize;

use super::crop::crop_head;
use super::identity::{dense, symmetric_left};
use super::source::{BaseMesh, read_body_target};
use crate::Vector;
use crate::atomic_file::write_atomically;
use crate::template::identity::{StoredModes, store_modes};
use crate::template::{Template, TemplateError};

/// The text of `identities.toml`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentityRecipe {
    neck_vertex: u32,
    millimetres_per_unit: f64,
    modes: usize,
    outlying_regions: Vec<String>,
    outlying_weight: f64,
    folders: BTreeMap<String, f64>,
    people: BTreeMap<String, f64>,
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

    /// Builds the modes from `data` and writes them as `identity.bin` is kept.
    ///
    /// # Errors
    ///
    /// [`TemplateError`]; the file is only replaced by a whole one.
    pub fn write(
        &self,
        data: &Path,
        template: &Template,
        path: &Path,
    ) -> Result<(), TemplateError> {
        let bytes = crate::template::geometry::pack(&self.stored(data, template)?)?;
        write_atomically(path, |file| file.write_all(&bytes)).map_err(|source| {
            TemplateError::Write {
                path: path.to_owned(),
                source,
            }
        })
    }

    fn stored(&self, data: &Path, template: &Template) -> Result<StoredModes, TemplateError> {
        let base = BaseMesh::read(data)?;
        let head = crop_head(&base, self.neck_vertex)?;
        if head.source.len() != template.skin.vertex_count() {
            return Err(TemplateError::Source {
                reason: "the head is not cut where the template's is".to_owned(),
            });
        }
        let deltas = |name: &str| -> Result<Vec<Vector>, TemplateError> {
            let all = dense(name, &read_body_target(data, name)?, &base)?;
            let own: Vec<Vector> = head
                .source
                .iter()
                .map(|&s| all[s as usize] * self.millimetres_per_unit)
                .collect();
            // A target of the left side alone stands for both.
            let gain = if side_of(name).is_some() { 2.0 } else { 1.0 };
            Ok(symmetric_left(&own, &own, &head.mirror)
                .into_iter()
                .map(|d| d * gain)
                .collect())
        };
        let mut fields: Vec<Vec<Vector>> = Vec::new();
        for (folder, deviation) in &self.folders {
            for name in names(data, folder)? {
                if side_of(&name) != Some('r') {
                    fields.push(scaled(deltas(&format!("{folder}/{name}"))?, *deviation));
                }
            }
        }
        let everybody = names(data, "macrodetails")?;
        for (start, deviation) in &self.people {
            let kind = everybody
                .iter()
                .filter(|n| n.starts_with(start.as_str()) && !n.contains("-baby"))
                .map(|n| deltas(&format!("macrodetails/{n}")))
                .collect::<Result<Vec<_>, _>>()?;
            let share = 1.0 / kind.len().max(1) as f64;
            let mean: Vec<Vector> = (0..head.source.len())
                .map(|v| kind.iter().map(|k| k[v]).sum::<Vector>() * share)
                .collect();
            for one in kind {
                let own = one.iter().zip(&mean).map(|(d, m)| d - m).collect();
                fields.push(scaled(own, *deviation));
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
        for field in &mut fields {
            without_similarity(template, &weights, field);
        }
        Ok(store_modes(
            &template.mirror,
            &principal(&fields, &weights, self.modes),
        ))
    }
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

/// Targets in a folder, sorted.
fn names(data: &Path, folder: &str) -> Result<Vec<String>, TemplateError> {
    let path = data.join("mpfb2/targets").join(folder);
    let failed = |source| TemplateError::Read {
        path: path.clone(),
        source,
    };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&path).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        if let Some(stem) = name.to_str().and_then(|n| n.strip_suffix(".target.gz")) {
            names.push(stem.to_owned());
        }
    }
    names.sort();
    Ok(names)
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
