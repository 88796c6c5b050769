//! SMPTE-like timecode, `hh:mm:ss:ff.sub`, as Live Link Face writes it.

/// A timecode taken apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Timecode {
    /// Whole seconds of the day.
    pub(super) seconds: f64,
    /// Frames past them, with a fraction.
    pub(super) frames: f64,
}

/// Rates that cameras count frames in.
const STANDARD_RATES: [f64; 7] = [24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 120.0];

const SECONDS_PER_DAY: f64 = 86_400.0;

impl Timecode {
    /// Parses `hh:mm:ss:ff` or `hh:mm:ss:ff.sub`; a `;` may stand for a `:` (drop frame).
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut fields = text.trim().split([':', ';']);
        let mut whole = |limit: u32| {
            let value: u32 = fields.next()?.parse().ok()?;
            (value < limit).then_some(f64::from(value))
        };
        let (hours, minutes, seconds) = (whole(24)?, whole(60)?, whole(60)?);
        let frames: f64 = fields.next()?.parse().ok()?;
        let is_valid = frames.is_finite() && frames >= 0.0 && fields.next().is_none();
        is_valid.then_some(Self {
            seconds: (hours * 60.0 + minutes) * 60.0 + seconds,
            frames,
        })
    }

    /// Seconds since midnight when `rate` frames make a second.
    fn at_rate(self, rate: f64) -> f64 {
        self.seconds + self.frames / rate
    }
}

/// Frames per second that the timecodes count in: the smallest standard rate above every
/// frame number. Live Link Face counts in 60ths whatever the capture rate.
pub(super) fn infer_rate(timecodes: &[Timecode]) -> Option<f64> {
    let most = timecodes.iter().map(|t| t.frames).fold(0.0, f64::max);
    STANDARD_RATES.into_iter().find(|&rate| most < rate)
}

/// Seconds since the first timecode, carried across midnight.
pub(super) fn seconds(timecodes: &[Timecode], rate: f64) -> Vec<f64> {
    let mut day = 0.0;
    let mut previous = f64::NEG_INFINITY;
    let start = timecodes.first().map_or(0.0, |t| t.at_rate(rate));
    timecodes
        .iter()
        .map(|timecode| {
            let mut time = timecode.at_rate(rate) + day;
            if time < previous - 0.5 * SECONDS_PER_DAY {
                day += SECONDS_PER_DAY;
                time += SECONDS_PER_DAY;
            }
            previous = time;
            time - start
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_parsed_strictly() {
        assert_eq!(
            Timecode::parse("13:13:04:31.652"),
            Some(Timecode {
                seconds: 47_584.0,
                frames: 31.652
            })
        );
        assert_eq!(Timecode::parse("00:00:01;02").map(|t| t.frames), Some(2.0));
        for bad in [
            "",
            "1:2:3",
            "1:2:3:x",
            "1:60:0:0",
            "24:0:0:0",
            "0:0:0:-1",
            "0:0:0:nan",
            "0:0:0:1:2",
        ] {
            assert_eq!(Timecode::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn the_rate_follows_from_the_numbers_and_midnight_is_crossed() {
        let codes: Vec<Timecode> = ["23:59:59:30.0", "23:59:59:59.5", "00:00:00:29.0"]
            .iter()
            .map(|text| Timecode::parse(text).unwrap())
            .collect();
        let rate = infer_rate(&codes).unwrap();
        assert_eq!(rate, 60.0);
        let times = seconds(&codes, rate);
        assert!((times[1] - 29.5 / 60.0).abs() < 1e-9);
        assert!((times[2] - 59.0 / 60.0).abs() < 1e-9);
    }
}
