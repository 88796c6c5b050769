//! Hard cases: input that breaks solvers, each with a claim, a figure and a bar.
//!
//! The solver has to stay finite, come back, and say what it did. Every case is run by
//! `fabrig bench stability` and, in its short form, by the tests.

mod cases;
pub(crate) mod patches;
mod random;
mod sides;

use serde::{Deserialize, Serialize};

pub use random::random_scenes;

/// A hard case and how it went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseResult {
    /// What is claimed.
    pub claim: String,
    /// The worst figure seen; infinite where something was not finite.
    pub worst: f64,
    /// The most that the figure may be.
    pub limit: f64,
    /// Unit of the figure.
    pub unit: String,
}

impl CaseResult {
    /// A case with its figure.
    pub fn new(claim: &str, worst: f64, limit: f64, unit: &str) -> Self {
        Self {
            claim: claim.to_owned(),
            worst: if worst.is_finite() {
                worst
            } else {
                f64::INFINITY
            },
            limit,
            unit: unit.to_owned(),
        }
    }

    /// Whether the claim holds.
    pub fn is_passed(&self) -> bool {
        self.worst <= self.limit
    }
}

/// How much of the long cases is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Frames at a held target.
    pub held_frames: usize,
    /// Random scenes.
    pub random_scenes: u64,
}

impl Extent {
    /// What a test run can afford.
    pub const SHORT: Self = Self {
        held_frames: 5_000,
        random_scenes: 120,
    };
    /// What `fabrig bench stability` runs.
    pub const USUAL: Self = Self {
        held_frames: 20_000,
        random_scenes: 100,
    };
    /// All of it.
    pub const FULL: Self = Self {
        held_frames: 1_000_000,
        random_scenes: 1_000,
    };
}

/// Runs every case. `progress` hears how many of how many are done and stops the rest by
/// `false`.
pub fn stability(
    extent: Extent,
    progress: &mut dyn FnMut(usize, usize) -> bool,
) -> Vec<CaseResult> {
    let all = cases::all(extent);
    let total = all.len();
    let mut results = Vec::new();
    for (index, case) in all.into_iter().enumerate() {
        results.push(case());
        if !progress(index + 1, total) {
            break;
        }
    }
    results
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_hard_case_holds() {
        for case in stability(Extent::SHORT, &mut |_, _| true) {
            println!("{}: {:.3e} {}", case.claim, case.worst, case.unit);
            assert!(
                case.is_passed(),
                "{}: {} {} is over {}",
                case.claim,
                case.worst,
                case.unit,
                case.limit
            );
        }
    }

    #[test]
    fn what_is_not_finite_does_not_pass() {
        assert!(!CaseResult::new("", f64::NAN, 1.0, "mm").is_passed());
        assert!(!CaseResult::new("", 2.0, 1.0, "mm").is_passed());
        assert!(CaseResult::new("", 1.0, 1.0, "mm").is_passed());
    }
}
