//! When the next frame is due.

use std::time::{Duration, Instant};

/// Being late by more than this is not made up for: playing goes on from there.
const LATEST: Duration = Duration::from_millis(250);

/// Paces frames by the clock on the wall.
pub(super) struct Clock {
    speed: f64,
    due: Option<Instant>,
}

impl Clock {
    pub(super) fn new(speed: f64) -> Self {
        Self { speed, due: None }
    }

    /// How many times as quick; 0 pauses.
    pub(super) fn set_speed(&mut self, speed: f64) {
        self.speed = speed;
    }

    pub(super) fn is_paused(&self) -> bool {
        self.speed <= 0.0
    }

    /// Starts anew with the next frame.
    pub(super) fn forget(&mut self) {
        self.due = None;
    }

    /// A frame was sent that is shown for so long. (s)
    pub(super) fn add(&mut self, shown: f64) {
        let now = Instant::now();
        let due = self.due.filter(|due| now.duration_since(*due) < LATEST);
        // A day is as good as for ever, and fits.
        let wait = (shown / self.speed).clamp(0.0, 86_400.0);
        self.due = Some(due.unwrap_or(now) + Duration::from_secs_f64(wait));
    }

    /// How long to wait yet.
    pub(super) fn rest(&self) -> Option<Duration> {
        let rest = self.due?.checked_duration_since(Instant::now())?;
        (rest > Duration::ZERO).then_some(rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_due_one_after_the_other_and_quicker_at_speed() {
        let mut clock = Clock::new(2.0);
        clock.add(100.0);
        let first = clock.rest().expect("waits");
        clock.add(100.0);
        let second = clock.rest().expect("waits");
        assert!(first > Duration::from_secs(49) && first <= Duration::from_secs(50));
        assert!(second > Duration::from_secs(99) && second <= Duration::from_secs(100));
        clock.forget();
        assert_eq!(clock.rest(), None);
        clock.set_speed(0.0);
        assert!(clock.is_paused());
    }
}
