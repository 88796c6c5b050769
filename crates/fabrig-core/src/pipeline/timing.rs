//! Statistics of times per frame.

use serde::Serialize;

/// Times of many frames. (ms)
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct TimeStatistics {
    /// Half of the frames take at most this.
    pub median: f64,
    /// 95 % of the frames take at most this.
    pub p95: f64,
    /// 99 % of the frames take at most this.
    pub p99: f64,
    /// The slowest frame.
    pub max: f64,
    /// All frames together.
    pub total: f64,
}

impl TimeStatistics {
    /// Of these times (ms); all zero for none.
    pub fn of(mut times: Vec<f64>) -> Self {
        if times.is_empty() {
            return Self::default();
        }
        times.sort_by(f64::total_cmp);
        let count = times.len();
        let rank = |share: f64| times[((count as f64 * share).ceil() as usize).clamp(1, count) - 1];
        Self {
            median: rank(0.5),
            p95: rank(0.95),
            p99: rank(0.99),
            max: times[count - 1],
            total: times.iter().sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_of_the_sorted_times() {
        let times = TimeStatistics::of((1..=100).rev().map(f64::from).collect());
        assert_eq!(
            (times.median, times.p95, times.p99, times.max, times.total),
            (50.0, 95.0, 99.0, 100.0, 5050.0)
        );
        assert_eq!(TimeStatistics::of(vec![3.0]).p99, 3.0);
        assert_eq!(TimeStatistics::of(Vec::new()), TimeStatistics::default());
    }
}
