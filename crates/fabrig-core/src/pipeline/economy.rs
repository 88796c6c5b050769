//! What a take was spared: the sum of what its frames were.

use serde::Serialize;

use crate::scene::{EconomyReport, FrameReport};

/// Frames that must have been modelled whole before their time says what all would have taken.
const LEAST_WHOLE: usize = 5;
/// Share of the frames at either end of their times that say nothing: something else ran then.
const TRIMMED: f64 = 0.1;

/// What a take was spared.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct EconomySummary {
    /// Tolerance that was kept to; 0 where everything was modelled. (mm)
    pub tolerance: f64,
    /// Frames.
    pub frames: u64,
    /// Frames in which nothing at all was left out.
    pub whole_frames: u64,
    /// Patches that are cloth.
    pub patches: u32,
    /// Share of them that slept, over all frames. (0 to 1)
    pub slept: f64,
    /// Share of muscle shapes that were not evaluated. (0 to 1)
    pub not_evaluated: f64,
    /// Share of substeps, patch by patch, that were not taken. (0 to 1)
    pub substeps_spared: f64,
    /// Share of skin vertices that were not moved. (0 to 1)
    pub skin_left: f64,
    /// Largest estimate of the difference to the full model. (mm)
    pub estimate: f64,
    /// Largest bound of it: where patches snap from one fold to another. (mm)
    pub bound: f64,
    /// Frames in a storm, in which everything is modelled: patches are so far from their muscle
    /// shapes that they buckle.
    pub storm_frames: u64,
    /// Share of the time of simulating that was saved, against frames that were modelled whole;
    /// none where too few were.
    pub time_saved: Option<f64>,
}

/// Sums up frames.
#[derive(Default)]
pub(super) struct EconomyLog {
    reports: Vec<EconomyReport>,
    whole_ms: Vec<f64>,
    spared_ms: Vec<f64>,
}

impl EconomyLog {
    /// - `ms`: time that simulating the frame took
    pub(super) fn take(&mut self, report: &FrameReport, ms: f64) {
        let times = if report.economy.is_whole {
            &mut self.whole_ms
        } else {
            &mut self.spared_ms
        };
        times.push(ms);
        self.reports.push(report.economy);
    }

    /// - `tolerance`: that was kept to (mm)
    pub(super) fn summary(self, tolerance: f64) -> EconomySummary {
        let share = |part: &dyn Fn(&EconomyReport) -> [f64; 2]| -> f64 {
            let (part, whole) = self
                .reports
                .iter()
                .map(part)
                .fold((0.0, 0.0), |(a, b), p| (a + p[0], b + p[1]));
            if whole > 0.0 { part / whole } else { 0.0 }
        };
        let largest = |of: fn(&EconomyReport) -> f64| -> f64 {
            self.reports.iter().map(of).fold(0.0, f64::max)
        };
        let storm = self.reports.iter().filter(|r| r.is_storm);
        let count = self.reports.len();
        let (whole, spared) = (trimmed_mean(&self.whole_ms), trimmed_mean(&self.spared_ms));
        let spared_share = self.spared_ms.len() as f64 / count.max(1) as f64;
        let is_known = self.whole_ms.len() >= LEAST_WHOLE && whole > 0.0;
        EconomySummary {
            tolerance,
            frames: count as u64,
            whole_frames: self.whole_ms.len() as u64,
            patches: self.reports.iter().map(|r| r.patches).max().unwrap_or(0),
            slept: share(&|r| [f64::from(r.sleeping), f64::from(r.patches)]),
            not_evaluated: share(&|r| [f64::from(r.still), f64::from(r.patches)]),
            substeps_spared: share(&|r| {
                let full = f64::from(r.full_substeps) * f64::from(r.patches);
                let awake = f64::from(r.patches - r.sleeping.min(r.patches));
                [full - f64::from(r.substeps) * awake, full]
            }),
            skin_left: share(&|r| {
                let all = f64::from(r.skin_vertices);
                [all - f64::from(r.skin_moved), all]
            }),
            estimate: largest(|r| r.estimate),
            bound: largest(|r| r.bound),
            storm_frames: storm.count() as u64,
            time_saved: is_known.then(|| spared_share * (1.0 - spared / whole)),
        }
    }
}

/// The mean without what is longest and what is shortest; 0 of nothing.
fn trimmed_mean(times: &[f64]) -> f64 {
    let mut times = times.to_vec();
    times.sort_unstable_by(f64::total_cmp);
    let cut = (TRIMMED * times.len() as f64) as usize;
    let kept = &times[cut..times.len() - cut];
    kept.iter().sum::<f64>() / kept.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(sleeping: u32, substeps: u32, is_whole: bool) -> FrameReport {
        FrameReport {
            economy: EconomyReport {
                is_whole,
                patches: 4,
                sleeping,
                still: sleeping,
                substeps,
                full_substeps: 8,
                skin_vertices: 100,
                skin_moved: if is_whole { 100 } else { 20 },
                estimate: if is_whole { 0.0 } else { 0.05 },
                bound: if is_whole { 0.0 } else { 0.07 },
                is_storm: false,
            },
            ..FrameReport::default()
        }
    }

    #[test]
    fn shares_and_time_are_of_all_frames() {
        let mut log = EconomyLog::default();
        for _ in 0..5 {
            log.take(&frame(0, 8, true), 4.0);
        }
        for _ in 0..5 {
            log.take(&frame(2, 4, false), 1.0);
        }
        let summary = log.summary(0.1);
        assert_eq!((summary.frames, summary.whole_frames), (10, 5));
        assert_eq!((summary.slept, summary.not_evaluated), (0.25, 0.25));
        // Of 8 substeps of 4 patches, 4 of 2 were taken in half of the frames.
        assert_eq!((summary.substeps_spared, summary.skin_left), (0.375, 0.4));
        assert_eq!((summary.estimate, summary.bound), (0.05, 0.07));
        assert_eq!(summary.storm_frames, 0);
        assert_eq!(summary.time_saved, Some(1.0 - 25.0 / 40.0));
        // A frame in which something else ran changes nothing.
        let mut disturbed = EconomyLog::default();
        for ms in [4.0; 20].into_iter().chain([400.0]) {
            disturbed.take(&frame(0, 8, true), ms);
        }
        for ms in [1.0; 20].into_iter().chain([900.0]) {
            disturbed.take(&frame(2, 4, false), ms);
        }
        assert_eq!(disturbed.summary(0.1).time_saved, Some(0.5 * 0.75));
        let mut short = EconomyLog::default();
        short.take(&frame(0, 8, true), 4.0);
        assert_eq!(short.summary(0.1).time_saved, None);
    }
}
