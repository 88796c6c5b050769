//! How sites on a rig's skin answer to its controls.
//!
//! The skin is nearly linear in the weights but for the jaw, which turns: the response is
//! linearized at several openings of it. A fit corrects the rest by evaluating the rig itself.

use std::sync::Arc;

use nalgebra::{DMatrix, Vector3};

use super::{Controls, RetargetError};
use crate::Vector;
use crate::rig::Rig;
use crate::scene::{FacePose, Scene, Simulation};

/// Openings of the jaw at which the response is linearized.
const OPENINGS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// Half the step by which the jaw itself is differentiated.
const JAW_STEP: f64 = 0.05;

/// A place on the skin: a blend of up to three vertices of the user's mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Vertices of the mesh.
    pub vertices: [u32; 3],
    /// Their shares, which sum to 1.
    pub shares: [f64; 3],
}

impl Site {
    /// One vertex.
    pub fn vertex(vertex: u32) -> Self {
        Self {
            vertices: [vertex; 3],
            shares: [1.0, 0.0, 0.0],
        }
    }
}

/// A rig seen at some sites, as a function of controls.
pub struct ResponseModel {
    simulation: Simulation,
    controls: Controls,
    sites: Vec<Site>,
    /// One per opening: displacements for a control going from 0 to 1 (mm), shape
    /// [3 site_count, control_count].
    responses: Vec<DMatrix<f64>>,
    /// Control that opens the jaw most.
    jaw: Option<usize>,
    jaw_shape: Option<usize>,
}

impl ResponseModel {
    /// Poses the rig in every control at every opening of the jaw.
    ///
    /// # Errors
    ///
    /// [`RetargetError`] where a site names a vertex that the mesh has not, or the rig cannot
    /// be posed.
    pub fn new(rig: Arc<Rig>, controls: Controls, sites: Vec<Site>) -> Result<Self, RetargetError> {
        let vertex_count = rig.face.vertex_count();
        for site in &sites {
            if let Some(&v) = site.vertices.iter().find(|&&v| v as usize >= vertex_count) {
                return Err(RetargetError::Count {
                    what: "vertices or more, as a site asks for",
                    expected: v as usize + 1,
                    found: vertex_count,
                });
            }
        }
        if sites.is_empty() {
            return Err(RetargetError::Empty {
                what: "there is no site to fit: no vertex or marker is left",
            });
        }
        let jaw_shape = rig.jaw.shapes.open.map(|shape| shape as usize);
        let mut jaw = None;
        if let Some(shape) = jaw_shape {
            let mut most = 0.5;
            for control in 0..controls.count() {
                let mut values = vec![0.0; controls.count()];
                values[control] = 1.0;
                let opens = controls.weights(&values)?[shape];
                if opens > most {
                    (most, jaw) = (opens, Some(control));
                }
            }
        }
        let mut model = Self {
            simulation: Simulation::new(rig, Scene::without_dynamics(), None)?,
            controls,
            sites,
            responses: Vec::new(),
            jaw,
            jaw_shape,
        };
        let openings = if jaw.is_some() {
            &OPENINGS[..]
        } else {
            &OPENINGS[..1]
        };
        for &opening in openings {
            let response = model.linearized(opening)?;
            model.responses.push(response);
        }
        Ok(model)
    }

    fn linearized(&mut self, opening: f64) -> Result<DMatrix<f64>, RetargetError> {
        let mut base = vec![0.0; self.controls.count()];
        if let Some(jaw) = self.jaw {
            base[jaw] = opening;
        }
        let rest = self.displacements(&base)?;
        let mut response = DMatrix::zeros(3 * self.sites.len(), base.len());
        for control in 0..base.len() {
            let mut values = base.clone();
            let column = if Some(control) == self.jaw {
                let (low, high) = ((opening - JAW_STEP).max(0.0), (opening + JAW_STEP).min(1.0));
                values[control] = high;
                let above = self.displacements(&values)?;
                values[control] = low;
                let below = self.displacements(&values)?;
                difference(&above, &below, 1.0 / (high - low))
            } else {
                values[control] = 1.0;
                difference(&self.displacements(&values)?, &rest, 1.0)
            };
            for (site, d) in column.iter().enumerate() {
                response
                    .fixed_view_mut::<3, 1>(3 * site, control)
                    .copy_from(d);
            }
        }
        Ok(response)
    }

    /// Displacements of the sites from rest for values of the controls. [mm, head frame]
    ///
    /// # Errors
    ///
    /// [`RetargetError`] where the values do not fit the controls.
    pub fn displacements(&mut self, values: &[f64]) -> Result<Vec<Vector>, RetargetError> {
        let weights = self.controls.weights(values)?;
        let mut pose = FacePose::neutral(weights.len());
        pose.weights = weights;
        self.simulation.reset(pose)?;
        let rest = self.simulation.rest_skin();
        let now = self.simulation.skin();
        let moved = |v: u32| -> Vector3<f64> { (now[v as usize] - rest[v as usize]).cast() };
        Ok(self
            .sites
            .iter()
            .map(|site| {
                let corners = site.vertices.iter().zip(site.shares);
                corners.map(|(&v, share)| moved(v) * share).sum()
            })
            .collect())
    }

    /// The response at the opening nearest to the one that `values` make, and its index.
    pub(super) fn response(&self, values: &[f64]) -> Result<(usize, &DMatrix<f64>), RetargetError> {
        let opening = match self.jaw_shape.filter(|_| self.jaw.is_some()) {
            Some(shape) => f64::from(self.controls.weights(values)?[shape]),
            None => 0.0,
        };
        let distance = |k: usize| (OPENINGS[k] - opening).abs();
        let nearest =
            (0..self.responses.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let nearest = nearest.unwrap_or(0);
        Ok((nearest, &self.responses[nearest]))
    }

    /// Responses at every opening.
    pub(super) fn responses(&self) -> &[DMatrix<f64>] {
        &self.responses
    }

    /// The controls.
    pub fn controls(&self) -> &Controls {
        &self.controls
    }

    /// The sites.
    pub fn sites(&self) -> &[Site] {
        &self.sites
    }

    /// The rig.
    pub fn rig(&self) -> &Arc<Rig> {
        self.simulation.rig()
    }

    /// Where the sites are at rest. [mm, head frame]
    pub fn rest(&self) -> Vec<crate::Point> {
        let rest = self.simulation.rest_skin();
        let at = |v: u32| rest[v as usize].cast::<f64>().coords;
        self.sites
            .iter()
            .map(|site| {
                let corners = site.vertices.iter().zip(site.shares);
                crate::Point::from(corners.map(|(&v, share)| at(v) * share).sum::<Vector>())
            })
            .collect()
    }

    /// The farthest that each site is moved by any control alone. (mm)
    pub fn mobility(&self) -> Vec<f64> {
        let most = |site: usize, response: &DMatrix<f64>| {
            (0..response.ncols())
                .map(|c| response.fixed_view::<3, 1>(3 * site, c).norm())
                .fold(0.0, f64::max)
        };
        (0..self.sites.len())
            .map(|site| most(site, &self.responses[0]))
            .collect()
    }

    /// The farthest that each control alone moves any site. (mm)
    pub fn reach(&self) -> Vec<f64> {
        let response = &self.responses[0];
        (0..response.ncols())
            .map(|c| {
                (0..self.sites.len())
                    .map(|site| response.fixed_view::<3, 1>(3 * site, c).norm())
                    .fold(0.0, f64::max)
            })
            .collect()
    }
}

fn difference(a: &[Vector], b: &[Vector], factor: f64) -> Vec<Vector> {
    a.iter().zip(b).map(|(a, b)| (a - b) * factor).collect()
}
