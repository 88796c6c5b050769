//! The economical run beside the full one: on a take, and on random scenes.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use std::fmt::Write;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Point3;

use super::ways::rms_distance;
use super::{Economy, EconomyReport, ROUNDING};
use crate::Error;
use crate::motion::{Clip, parse_keys};
use crate::rig::Rig;
use crate::scene::{Scene, Simulation};

/// Length of a random scene. (s)
const LENGTH: f64 = 3.0;

/// One frame of both runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EconomyFrame {
    /// Largest root mean square difference of any patch. (mm)
    pub patch: f64,
    /// Root mean square difference of the skin. (mm)
    pub skin: f64,
    /// Largest difference of a vertex of the skin. (mm)
    pub vertex: f64,
    /// What the economical run says of itself.
    pub report: EconomyReport,
    /// Time of the full run's frame and of the economical one's: the shortest of all times that
    /// they were taken. (ms)
    pub times: [f64; 2],
}

/// Both runs of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EconomyCase {
    /// What was run.
    pub name: String,
    /// (mm)
    pub tolerance: f64,
    /// Frame by frame.
    pub frames: Vec<EconomyFrame>,
}

impl EconomyCase {
    /// Frames whose difference is larger than the bound that was printed.
    pub fn broken_bounds(&self) -> usize {
        let is_broken = |f: &&EconomyFrame| f.patch > f.report.bound + ROUNDING;
        self.frames.iter().filter(is_broken).count()
    }

    /// Largest difference of a patch. (mm)
    pub fn worst(&self) -> f64 {
        self.frames.iter().map(|f| f.patch).fold(0.0, f64::max)
    }

    /// Time of the economical run against the full one's.
    pub fn time_share(&self) -> f64 {
        let sum = |k: usize| self.frames.iter().map(|f| f.times[k]).sum::<f64>();
        sum(1) / sum(0)
    }

    /// Frames in a storm.
    pub fn storm_frames(&self) -> usize {
        self.frames.iter().filter(|f| f.report.is_storm).count()
    }
}

/// Runs a take with and without economy, side by side.
///
/// - `from`: where in the take it starts (s, from its first frame)
/// - `dt`: duration of a frame (s)
/// - `repeats`: how often both are run, for their times
///
/// # Errors
///
/// [`Error::Scene`].
pub fn economy_case(
    name: &str,
    rig: &Arc<Rig>,
    (scene, clip): (&Scene, &Clip),
    economy: Economy,
    [from, dt]: [f64; 2],
    frame_count: usize,
    repeats: usize,
) -> Result<EconomyCase, Error> {
    let mut case = EconomyCase {
        name: name.to_owned(),
        tolerance: economy.tolerance.on(rig),
        frames: both_runs(rig, (scene, clip), economy, [from, dt], frame_count)?,
    };
    for _ in 1..repeats {
        let again = both_runs(rig, (scene, clip), economy, [from, dt], frame_count)?;
        for (frame, again) in case.frames.iter_mut().zip(&again) {
            let [full, own] = again.times;
            frame.times = [frame.times[0].min(full), frame.times[1].min(own)];
        }
    }
    Ok(case)
}

fn both_runs(
    rig: &Arc<Rig>,
    (scene, clip): (&Scene, &Clip),
    economy: Economy,
    [from, dt]: [f64; 2],
    frame_count: usize,
) -> Result<Vec<EconomyFrame>, Error> {
    let with = |economy: Economy| -> Result<Simulation, Error> {
        let scene = Scene {
            economy,
            ..scene.clone()
        };
        let mut simulation = Simulation::new(Arc::clone(rig), scene, Some(clip.clone()))?;
        simulation.start_at(simulation.time() + from)?;
        Ok(simulation)
    };
    let mut runs = [with(Economy::OFF)?, with(economy)?];
    let mut frames = Vec::with_capacity(frame_count);
    for _ in 0..frame_count {
        let mut times = [0.0; 2];
        let mut report = EconomyReport::default();
        for (run, time) in runs.iter_mut().zip(&mut times) {
            let clock = Instant::now();
            report = run.advance(dt)?.economy;
            *time = clock.elapsed().as_secs_f64() * 1e3;
        }
        let [full, economical] = &runs;
        let patches = (0..rig.patches.len()).map(|p| {
            let both = [full, economical].map(|run| run.patch_positions(p));
            rms_distance(both[0], both[1])
        });
        frames.push(EconomyFrame {
            patch: patches.fold(0.0, f64::max),
            skin: rms_distance(full.skin(), economical.skin()),
            vertex: largest_distance(full.skin(), economical.skin()),
            report,
            times,
        });
    }
    Ok(frames)
}

/// A take in which all of a face moves all the time: each shape on its own keys, by a seed.
///
/// # Errors
///
/// [`Error::Motion`] never for shapes that a take may name.
pub fn active_take(shapes: &[String], seconds: f64) -> Result<Clip, Error> {
    let mut random = Random(ChaCha8Rng::seed_from_u64(1));
    let mut lines = Vec::new();
    for shape in shapes {
        let mut time = random.within(0.0, 0.3);
        while time < seconds {
            lines.push((time, format!("{shape}={:.3}", random.within(0.0, 0.5))));
            time += random.within(0.2, 0.4);
        }
    }
    Ok(parse_keys(&keys(lines, seconds), "an active take")?)
}

/// A take of keys that stand in any order.
fn keys(mut lines: Vec<(f64, String)>, seconds: f64) -> String {
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut text = String::from("fabrig-keys 1\n");
    for (time, line) in lines {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{time:.4} {line}");
    }
    let _ = writeln!(text, "{seconds} end");
    text
}

fn largest_distance(a: &[Point3<f32>], b: &[Point3<f32>]) -> f64 {
    let largest = a.iter().zip(b).map(|(p, q)| (p - q).norm_squared());
    f64::from(largest.fold(0.0, f32::max)).sqrt()
}

/// A random scene, by its seed: some of a face's shapes on keys near and far in time, a third of
/// them with the head turning, a fifth with gravity from elsewhere, a fifth with wind, some shaken;
/// at 24 to 120 frames a second and a tolerance of 0.02 to 0.5 mm.
///
/// # Errors
///
/// [`Error`] as of the two runs.
pub fn random_economy_case(rig: &Arc<Rig>, seed: u64) -> Result<EconomyCase, Error> {
    let mut random = Random(ChaCha8Rng::seed_from_u64(seed));
    let clip = parse_keys(&random.take(&rig.shape_names), "a random take")?;
    let scene = Scene::from_toml(&random.scene())?;
    let rates = [24.0, 30.0, 60.0, 60.0, 60.0, 120.0];
    let dt = 1.0 / rates[random.index(rates.len())];
    let tolerances = [0.02, 0.05, 0.1, 0.2, 0.5];
    let economy = Economy::within(tolerances[random.index(tolerances.len())]);
    let name = format!("random scene {seed}");
    let frame_count = (LENGTH / dt).round() as usize;
    let of = (&scene, &clip);
    economy_case(&name, rig, of, economy, [0.0, dt], frame_count, 1)
}

struct Random(ChaCha8Rng);

impl Random {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    fn index(&mut self, count: usize) -> usize {
        self.0.random_range(0..count)
    }

    fn is(&mut self, probability: f64) -> bool {
        self.within(0.0, 1.0) < probability
    }

    fn take(&mut self, shapes: &[String]) -> String {
        let mut lines: Vec<(f64, String)> = Vec::new();
        for _ in 0..=self.index(20) {
            let shape = &shapes[self.index(shapes.len())];
            let mut time = self.within(0.05, 1.0);
            while time < LENGTH {
                let weight = if self.is(0.3) {
                    0.0
                } else {
                    self.within(0.0, 1.0)
                };
                let join = if self.is(0.1) { " linear" } else { "" };
                lines.push((time, format!("{shape}={weight:.3}{join}")));
                time += if self.is(0.2) {
                    self.within(0.6, 2.0)
                } else {
                    self.within(0.08, 0.6)
                };
            }
        }
        if self.is(0.35) {
            let mut time = self.within(0.1, 0.5);
            while time < LENGTH {
                let (yaw, pitch) = (self.within(-30.0, 30.0), self.within(-15.0, 15.0));
                lines.push((time, format!("head.yaw={yaw:.1} head.pitch={pitch:.1}")));
                time += self.within(0.2, 0.8);
            }
        }
        keys(lines, LENGTH)
    }

    fn scene(&mut self) -> String {
        let mut text = String::new();
        if self.is(0.2) {
            let g = [(); 3].map(|()| self.within(-9810.0, 9810.0));
            let _ = writeln!(text, "gravity = {g:.0?}");
        }
        if self.is(0.2) {
            let wind = [15_000.0, 5000.0, 15_000.0].map(|most| self.within(-most, most));
            let (intensity, time) = (self.within(0.0, 6000.0), self.within(0.1, 0.5));
            let _ = writeln!(
                text,
                "wind = {wind:.0?}\n[turbulence]\nintensity = {intensity:.0}\nlength = 300\n\
                 time = {time:.2}\nseed = {}",
                self.index(100)
            );
        }
        if self.is(0.15) {
            let (intensity, time) = (self.within(100.0, 4000.0), self.within(0.04, 0.3));
            let _ = writeln!(
                text,
                "[shake]\nintensity = {intensity:.0}\ntime = {time:.2}\nseed = {}",
                self.index(100)
            );
        }
        text
    }
}
