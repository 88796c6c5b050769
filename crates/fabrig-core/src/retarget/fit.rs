//! Controls that move the sites of a rig as a source moves.
//!
//! Over the frames t of a clip, with displacements x(w) of the rig's sites and d_t of the
//! source's (W their weights, which sum to 1 over the sites seen in a frame):
//!
//! `min sum_t 1/2 |x(w_t) - d_t|^2_W + l1 1'w_t + r/2 |w_t|^2 + lt/2 |w_t - w_(t-1)|^2`,
//! `0 <= w_t <= 1`
//!
//! Each frame is a box-constrained quadratic problem ([`solve_box_qp`]), linearized where it
//! stands and corrected by evaluating the rig, started from the frame before. With one pass
//! the frame before is held. With more, the first fits every frame by itself and the others go
//! back and forth and hold both neighbours, so that smoothing does not lag; only the first
//! and the last evaluate the rig.
//!
//! The three factors follow from what the numbers mean: with noise s of a coordinate, N sites,
//! typical weights b and typical rates v, `r = s^2 / (N b^2)`, `l1 = s^2 / (N b)`,
//! `lt = s^2 / (N (v dt)^2)`: the most likely weights under Gaussian noise, weights and rates.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::{BoxQp, ResponseModel, RetargetError, solve_box_qp};
use crate::Vector;
use crate::motion::Clip;

/// A control that moves no site by this much cannot be seen, and is left at rest. (mm)
const LEAST_REACH: f64 = 0.1;

/// What a fit assumes.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// Standard deviation of each coordinate of the source. (mm)
    pub noise: f64,
    /// Typical size of a weight.
    pub typical_weight: f64,
    /// Typical rate of a weight. (1/s); 0 for frames on their own
    pub typical_rate: f64,
    /// Prefer few strong weights over many weak ones.
    pub is_sparse: bool,
    /// Linearizations of a frame in the first pass.
    pub linearizations: usize,
    /// Passes over the clip.
    pub passes: usize,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            noise: 0.01,
            typical_weight: 0.35,
            typical_rate: 4.0,
            is_sparse: false,
            linearizations: 5,
            passes: 1,
        }
    }
}

impl FitOptions {
    /// For marker trajectories. Weights are expected to be large: some units move no marker by
    /// more than two or three times its noise, and what draws them to 0 would hide them.
    pub fn markers() -> Self {
        Self {
            noise: 0.5,
            typical_rate: 2.0,
            typical_weight: 0.5,
            passes: 12,
            ..Self::default()
        }
    }

    fn check(&self) -> Result<(), RetargetError> {
        for (option, value) in [
            ("noise", self.noise),
            ("typical_weight", self.typical_weight),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(RetargetError::Option {
                    option,
                    value,
                    condition: "above 0",
                });
            }
        }
        if !(self.typical_rate.is_finite() && self.typical_rate >= 0.0) {
            return Err(RetargetError::Option {
                option: "typical_rate",
                value: self.typical_rate,
                condition: "at least 0",
            });
        }
        Ok(())
    }
}

/// One frame of a source.
#[derive(Debug, Clone, PartialEq)]
pub struct FitFrame {
    /// (s)
    pub time: f64,
    /// Displacement of every site from the neutral face [mm, head frame]; `None` where it is
    /// not seen.
    pub displacements: Vec<Option<Vector>>,
}

/// How well a clip was fitted.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FitReport {
    /// Frames.
    pub frames: usize,
    /// Sites.
    pub sites: usize,
    /// Sites not seen, summed over the frames.
    pub unseen: usize,
    /// Controls that no site shows, left at rest.
    pub unseen_controls: Vec<String>,
    /// Root mean square distance of the rig's sites from the source's. (mm)
    pub residual_rms: f64,
    /// The same in the worst frame. (mm)
    pub residual_worst: f64,
    /// Largest distance of one site. (mm)
    pub residual_max: f64,
    /// Largest KKT residual of a frame's problem, in units of weight.
    pub kkt_residual: f64,
    /// Root mean square residual of each frame. (mm)
    pub residual_by_frame: Vec<f64>,
}

/// A fitted motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Retargeted {
    /// Weights of the rig's shapes.
    pub clip: Clip,
    /// Values of the controls, row-major, shape [frame_count, control_count].
    pub values: Vec<f64>,
    /// How well it was fitted.
    pub report: FitReport,
}

/// Fits the controls of a rig to a moving set of sites.
///
/// # Errors
///
/// [`RetargetError`] where the frames do not fit the sites or an option makes no sense.
pub fn fit_clip(
    model: &mut ResponseModel,
    frames: &[FitFrame],
    options: &FitOptions,
) -> Result<Retargeted, RetargetError> {
    options.check()?;
    check(model, frames)?;
    let mut fit = Fit::new(model, frames, options);
    let passes = options.passes.max(1);
    for pass in 0..passes {
        let count = frames.len();
        let holds = match pass {
            0 if passes == 1 => Holds::Previous,
            0 => Holds::Nothing,
            _ => Holds::Both,
        };
        let rounds = match pass {
            0 => options.linearizations.max(1),
            // The last pass answers for the rig as it is.
            _ if pass + 1 == passes => 1,
            _ => 0,
        };
        for step in 0..count {
            // Every other pass goes back, so that news travels both ways.
            let frame = if pass % 2 == 0 {
                step
            } else {
                count - 1 - step
            };
            if pass == 0 && frame > 0 {
                fit.values[frame] = fit.values[frame - 1].clone();
            }
            fit.frame(frame, rounds, holds)?;
        }
    }
    fit.finish()
}

fn check(model: &ResponseModel, frames: &[FitFrame]) -> Result<(), RetargetError> {
    if frames.is_empty() {
        return Err(RetargetError::Empty {
            what: "the source has no frames",
        });
    }
    for (frame, f) in frames.iter().enumerate() {
        let (expected, found) = (model.sites().len(), f.displacements.len());
        if expected != found {
            return Err(RetargetError::Count {
                what: "displacements, one per site",
                expected,
                found,
            });
        }
        let bad = |d: &Option<Vector>| d.is_some_and(|d| !d.iter().all(|c| c.is_finite()));
        if let Some(site) = f.displacements.iter().position(bad) {
            return Err(RetargetError::NotFinite {
                frame,
                what: format!("site {site}"),
            });
        }
    }
    Ok(())
}

/// Neighbours that a frame is drawn to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Holds {
    Nothing,
    Previous,
    Both,
}

/// A frame's data term about the values at which the rig was evaluated last.
struct Linearization {
    opening: usize,
    /// `J'(d - x(w)) + J'J w` over the sites seen, by their number.
    linear: DVector<f64>,
    /// One by the number of sites seen.
    scale: f64,
}

struct Fit<'a> {
    model: &'a mut ResponseModel,
    frames: &'a [FitFrame],
    options: &'a FitOptions,
    /// `J'J` over all sites, by opening.
    normals: Vec<DMatrix<f64>>,
    /// Controls that can be seen.
    seen: Vec<bool>,
    values: Vec<DVector<f64>>,
    /// `None` where no site is seen.
    linearizations: Vec<Option<Linearization>>,
    kkt: Vec<f64>,
}

impl<'a> Fit<'a> {
    fn new(model: &'a mut ResponseModel, frames: &'a [FitFrame], options: &'a FitOptions) -> Self {
        let normals = model
            .responses()
            .iter()
            .map(|j| j.transpose() * j)
            .collect();
        let seen = model.reach().iter().map(|&r| r >= LEAST_REACH).collect();
        let count = model.controls().count();
        Self {
            normals,
            seen,
            values: vec![DVector::zeros(count); frames.len()],
            linearizations: frames.iter().map(|_| None).collect(),
            kkt: vec![0.0; frames.len()],
            model,
            frames,
            options,
        }
    }

    /// Solves a frame, after evaluating the rig anew up to `rounds` times.
    fn frame(&mut self, frame: usize, rounds: usize, holds: Holds) -> Result<(), RetargetError> {
        if rounds == 0 {
            self.solve(frame, holds)?;
        }
        for _ in 0..rounds {
            self.linearize(frame)?;
            let moved = self.solve(frame, holds)?;
            if moved < 1e-5 {
                break;
            }
        }
        Ok(())
    }

    fn linearize(&mut self, frame: usize) -> Result<(), RetargetError> {
        let values = &self.values[frame];
        let now = self.model.displacements(values.as_slice())?;
        let (opening, response) = self.model.response(values.as_slice())?;
        let wanted = &self.frames[frame].displacements;
        let seen_sites = wanted.iter().flatten().count();
        let mut residual = DVector::zeros(3 * wanted.len());
        for (site, (wanted, now)) in wanted.iter().zip(&now).enumerate() {
            if let Some(d) = wanted {
                residual.fixed_rows_mut::<3>(3 * site).copy_from(&(d - now));
            }
        }
        let slope = response.tr_mul(&residual);
        let scale = 1.0 / seen_sites.max(1) as f64;
        let linear = (slope + self.normal(frame, opening) * values) * scale;
        self.linearizations[frame] = (seen_sites > 0).then_some(Linearization {
            opening,
            linear,
            scale,
        });
        Ok(())
    }

    /// `J'J` over the sites that a frame shows.
    fn normal(&self, frame: usize, opening: usize) -> DMatrix<f64> {
        let response = &self.model.responses()[opening];
        let mut normal = self.normals[opening].clone();
        for (site, wanted) in self.frames[frame].displacements.iter().enumerate() {
            if wanted.is_none() {
                let rows = response.fixed_rows::<3>(3 * site);
                normal -= rows.transpose() * rows;
            }
        }
        normal
    }

    /// Returns how far the values moved.
    fn solve(&mut self, frame: usize, holds: Holds) -> Result<f64, RetargetError> {
        let Some(found) = &self.linearizations[frame] else {
            return Ok(0.0);
        };
        let mut hessian = self.normal(frame, found.opening) * found.scale;
        let mut linear = found.linear.clone();
        self.add_priors(frame, holds, found.scale, &mut hessian, &mut linear);
        let problem = self.without_unseen(BoxQp { hessian, linear });
        let solution = solve_box_qp(&problem, &self.values[frame])?;
        let moved = (&solution.weights - &self.values[frame]).amax();
        self.kkt[frame] = solution.kkt_residual;
        self.values[frame] = solution.weights;
        Ok(moved)
    }

    fn add_priors(
        &self,
        frame: usize,
        holds: Holds,
        scale: f64,
        hessian: &mut DMatrix<f64>,
        linear: &mut DVector<f64>,
    ) {
        let FitOptions {
            noise,
            typical_weight,
            typical_rate,
            is_sparse,
            ..
        } = *self.options;
        let variance = noise * noise * scale;
        let mut diagonal = variance / (typical_weight * typical_weight);
        if is_sparse {
            linear.add_scalar_mut(-variance / typical_weight);
        }
        let mut hold = |other: usize| {
            let dt = (self.frames[other].time - self.frames[frame].time).abs();
            if typical_rate > 0.0 && dt > 0.0 {
                let lt = variance / (typical_rate * dt).powi(2);
                diagonal += lt;
                linear.axpy(lt, &self.values[other], 1.0);
            }
        };
        if frame > 0 && holds != Holds::Nothing {
            hold(frame - 1);
        }
        if frame + 1 < self.frames.len() && holds == Holds::Both {
            hold(frame + 1);
        }
        for i in 0..hessian.nrows() {
            hessian[(i, i)] += diagonal;
        }
    }

    /// Ties controls that cannot be seen to 0.
    fn without_unseen(&self, mut problem: BoxQp) -> BoxQp {
        for i in (0..self.seen.len()).filter(|&i| !self.seen[i]) {
            problem.hessian.row_mut(i).fill(0.0);
            problem.hessian.column_mut(i).fill(0.0);
            problem.hessian[(i, i)] = 1.0;
            problem.linear[i] = 0.0;
        }
        problem
    }

    fn finish(self) -> Result<Retargeted, RetargetError> {
        let names = self.model.controls().names().to_vec();
        let mut report = FitReport {
            frames: self.frames.len(),
            sites: self.model.sites().len(),
            unseen_controls: (names.iter().zip(&self.seen))
                .filter(|(_, seen)| !**seen)
                .map(|(name, _)| name.clone())
                .collect(),
            kkt_residual: self.kkt.iter().copied().fold(0.0, f64::max),
            ..FitReport::default()
        };
        let (mut total, mut total_count) = (0.0, 0usize);
        let mut weights = Vec::new();
        for (frame, values) in self.frames.iter().zip(&self.values) {
            let now = self.model.displacements(values.as_slice())?;
            let (mut sum, mut count) = (0.0, 0usize);
            for (wanted, now) in frame.displacements.iter().zip(&now) {
                let Some(wanted) = wanted else {
                    report.unseen += 1;
                    continue;
                };
                let distance = (wanted - now).norm();
                report.residual_max = report.residual_max.max(distance);
                sum += distance * distance;
                count += 1;
            }
            let rms = (sum / count.max(1) as f64).sqrt();
            report.residual_by_frame.push(rms);
            report.residual_worst = report.residual_worst.max(rms);
            total += sum;
            total_count += count;
            let of_shapes = self.model.controls().weights(values.as_slice())?;
            weights.extend(of_shapes.into_iter().map(|w| w.clamp(0.0, 1.0)));
        }
        report.residual_rms = (total / total_count.max(1) as f64).sqrt();
        let start = self.frames[0].time;
        let clip = Clip::new(
            self.frames.iter().map(|f| f.time - start).collect(),
            self.model.rig().shape_names.clone(),
            weights,
        )?;
        Ok(Retargeted {
            clip,
            values: self.values.iter().flat_map(|v| v.iter().copied()).collect(),
            report,
        })
    }
}
