//! How long the rest of a run will take.

use std::collections::BTreeMap;

use super::job::Stage;

/// A share that says little yet about how long a job takes.
const LEAST_SHARE: f64 = 0.1;

/// A job of a run.
pub(super) struct Progressing {
    pub(super) stage: Stage,
    /// What its time goes with.
    pub(super) size: f64,
    /// How much of it is done, 0 to 1.
    pub(super) done: f64,
    /// Time it has taken so far. (s)
    pub(super) seconds: f64,
}

/// Time that the rest takes at the pace of what is done; `None` while some kind of job that is
/// left has not shown its pace. (s)
pub(super) fn remaining_secs(
    jobs: impl Iterator<Item = Progressing>,
    workers: usize,
) -> Option<f64> {
    /// Done size, time for it, size left.
    #[derive(Default)]
    struct Pace(f64, f64, f64);
    let mut paces: BTreeMap<Stage, Pace> = BTreeMap::new();
    let mut longest_left = 0.0f64;
    let mut left_jobs = 0;
    for job in jobs {
        let pace = paces.entry(job.stage).or_default();
        pace.2 += job.size * (1.0 - job.done);
        left_jobs += usize::from(job.done < 1.0);
        if job.done >= LEAST_SHARE && job.seconds > 0.0 {
            pace.0 += job.size * job.done;
            pace.1 += job.seconds;
            // One job is not shared out: the run is not over before its last one is.
            longest_left = longest_left.max(job.seconds * (1.0 - job.done) / job.done);
        }
    }
    let mut total = 0.0;
    for Pace(size, seconds, left) in paces.into_values() {
        if left > 0.0 {
            if size <= 0.0 {
                return None;
            }
            total += left * seconds / size;
        }
    }
    let at_a_time = workers.min(left_jobs).max(1);
    Some((total / at_a_time as f64).max(longest_left))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(stage: Stage, size: f64, done: f64, seconds: f64) -> Progressing {
        Progressing {
            stage,
            size,
            done,
            seconds,
        }
    }

    #[test]
    fn the_rest_goes_at_the_pace_of_what_is_done() {
        let jobs = || {
            [
                job(Stage::Rig, 1.0, 1.0, 3.0),
                job(Stage::Rig, 1.0, 0.0, 0.0),
                job(Stage::Record, 10.0, 1.0, 5.0),
                job(Stage::Record, 10.0, 0.5, 2.0),
                job(Stage::Record, 40.0, 0.0, 0.0),
            ]
            .into_iter()
        };
        // A rig of 3 s, and 45 s of takes at 7 s for 15.
        let alone = remaining_secs(jobs(), 1).unwrap();
        assert!((alone - (3.0 + 45.0 * 7.0 / 15.0)).abs() < 1e-9, "{alone}");
        let three = remaining_secs(jobs(), 3).unwrap();
        assert!((three - alone / 3.0).abs() < 1e-9, "{three}");
        // No more workers than jobs.
        assert_eq!(remaining_secs(jobs(), 3), remaining_secs(jobs(), 100));
    }

    #[test]
    fn nothing_is_said_before_it_is_known() {
        let jobs = [
            job(Stage::Rig, 1.0, 1.0, 3.0),
            job(Stage::Export, 1.0, 0.0, 0.0),
        ];
        assert_eq!(remaining_secs(jobs.into_iter(), 2), None);
        assert_eq!(remaining_secs([].into_iter(), 2), Some(0.0));
        let last = [job(Stage::Rig, 1.0, 0.5, 4.0)];
        assert_eq!(remaining_secs(last.into_iter(), 8), Some(4.0));
    }
}
