//! Random fields of unit size: sums of waves with random directions, lengths and phases.
//!
//! A wave `cos(k . x + w t + phase)` has mean zero and mean square one half over space and time
//! whatever its numbers are, so a sum of waves with fixed amplitudes has exactly the size that is
//! asked for, for every seed, and is a function of place and time alone. That is Kraichnan's way
//! to make turbulence that is carried by no grid:
//!
//! - wave vectors `k` are normally distributed with standard deviation 1/L along each axis, and
//!   frequencies `w` with 1/T: velocities at two points r apart, or two times t apart, are
//!   correlated by `exp(-r^2/2L^2)` and `exp(-t^2/2T^2)`; energy over wave number is spread as
//!   `k^2 exp(-k^2 L^2/2)`, with its peak at a wavelength of 4.4 L;
//! - amplitudes stand across `k`, which leaves no divergence;
//! - directions come as the axes of randomly turned frames, and across each there are two
//!   amplitudes a quarter of a wave apart, one before the other at random: so the three
//!   components have one and the same mean square, and no correlation.
//!
//! # Source
//!
//! Kraichnan 1970, *Diffusion by a random velocity field*, Phys. Fluids 13, section II.

use nalgebra::UnitQuaternion;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{Point, Vector};

/// Turned frames of three wave vectors each.
const FRAME_COUNT: usize = 20;
/// Waves of a signal of time alone.
const SIGNAL_WAVES: usize = 24;

/// Two waves that share wave vector and frequency, with amplitudes across each other and a
/// quarter of a wave apart.
#[derive(Debug, Clone, Copy, PartialEq)]
struct WavePair {
    /// [rad/mm]
    vector: Vector,
    /// (rad/s)
    frequency: f64,
    amplitudes: [Vector; 2],
    phase: f64,
}

/// A field of velocities without divergence: each component has mean zero and mean square one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SolenoidalNoise {
    waves: Vec<WavePair>,
}

impl SolenoidalNoise {
    /// - `length`: L (mm), `time`: T (s)
    pub(super) fn new(seed: u64, length: f64, time: f64) -> Self {
        let mut random = Random::new(seed);
        // Waves of both amplitudes carry a mean square of 1/2 in the two directions across them;
        // over a frame that is 1 in every direction.
        let size = (1.0 / FRAME_COUNT as f64).sqrt();
        let mut waves = Vec::with_capacity(3 * FRAME_COUNT);
        for _ in 0..FRAME_COUNT {
            let turn = random.rotation();
            let axes = [Vector::x(), Vector::y(), Vector::z()].map(|axis| turn * axis);
            for k in 0..3 {
                // The length of a normally distributed vector.
                let number = random.normal_vector().norm() / length;
                let hand = if random.phase() < std::f64::consts::PI {
                    size
                } else {
                    -size
                };
                waves.push(WavePair {
                    vector: axes[k] * number,
                    frequency: random.normal() / time,
                    amplitudes: [axes[(k + 1) % 3] * size, axes[(k + 2) % 3] * hand],
                    phase: random.phase(),
                });
            }
        }
        Self { waves }
    }

    /// The field at a place (mm) and time (s).
    pub(super) fn at(&self, place: &Point, time: f64) -> Vector {
        let mut sum = Vector::zeros();
        for wave in &self.waves {
            let angle = wave.vector.dot(&place.coords) + wave.frequency * time + wave.phase;
            let (sin, cos) = angle.sin_cos();
            sum += wave.amplitudes[0] * cos + wave.amplitudes[1] * sin;
        }
        sum
    }
}

/// A random signal of `N` numbers over time: each has mean zero and mean square one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Signal<const N: usize> {
    /// Frequency (rad/s) and phase of each wave of each number.
    waves: Vec<[[f64; 2]; N]>,
}

impl<const N: usize> Signal<N> {
    /// - `time`: over which it changes (s)
    pub(super) fn new(seed: u64, time: f64) -> Self {
        let mut random = Random::new(seed);
        let wave = |random: &mut Random| [random.normal() / time, random.phase()];
        let waves = (0..SIGNAL_WAVES)
            .map(|_| std::array::from_fn(|_| wave(&mut random)))
            .collect();
        Self { waves }
    }

    /// The signal at a time. (s)
    pub(super) fn at(&self, time: f64) -> [f64; N] {
        let size = (2.0 / SIGNAL_WAVES as f64).sqrt();
        let mut sum = [0.0; N];
        for wave in &self.waves {
            for (total, [frequency, phase]) in sum.iter_mut().zip(wave) {
                *total += size * (frequency * time + phase).cos();
            }
        }
        sum
    }
}

/// Numbers from a seed.
struct Random(ChaCha8Rng);

impl Random {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn phase(&mut self) -> f64 {
        self.0.random_range(0.0..std::f64::consts::TAU)
    }

    /// Of the standard normal distribution (Box & Muller).
    fn normal(&mut self) -> f64 {
        let u: f64 = self.0.random_range(f64::MIN_POSITIVE..1.0);
        (-2.0 * u.ln()).sqrt() * self.phase().cos()
    }

    fn normal_vector(&mut self) -> Vector {
        Vector::new(self.normal(), self.normal(), self.normal())
    }

    /// Of all rotations alike: a quaternion of normally distributed numbers.
    fn rotation(&mut self) -> UnitQuaternion<f64> {
        let v = self.normal_vector();
        UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(self.normal(), v.x, v.y, v.z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_a_field_and_another_seed_another() {
        let [a, b, other] = [3, 3, 4].map(|seed| SolenoidalNoise::new(seed, 100.0, 0.5));
        assert_eq!(a, b);
        let place = Point::new(10.0, -40.0, 70.0);
        assert_eq!(a.at(&place, 1.25), b.at(&place, 1.25));
        assert!((a.at(&place, 1.25) - other.at(&place, 1.25)).norm() > 1e-3);
    }

    #[test]
    fn every_component_has_mean_zero_and_mean_square_one_for_every_seed() {
        for seed in 0..4 {
            let noise = SolenoidalNoise::new(seed, 100.0, 0.5);
            let mut random = Random::new(99 + seed);
            let (mut sum, mut squares) = (Vector::zeros(), Vector::zeros());
            let count = 20_000;
            for _ in 0..count {
                let place = Point::from(random.normal_vector() * 1e4);
                let u = noise.at(&place, 50.0 * random.normal());
                sum += u;
                squares += u.component_mul(&u);
            }
            let (mean, square) = (sum / f64::from(count), squares / f64::from(count));
            // Three standard deviations of a mean over this many samples are 0.021 and 0.03.
            assert!(mean.abs().max() < 0.025, "seed {seed}: mean {mean:?}");
            let off = (square - Vector::repeat(1.0)).abs().max();
            assert!(off < 0.04, "seed {seed}: mean square {square:?}");
        }
    }

    #[test]
    fn there_is_no_divergence() {
        let noise = SolenoidalNoise::new(5, 80.0, 0.3);
        let mut random = Random::new(6);
        let h = 0.05;
        for _ in 0..200 {
            let place = Point::from(random.normal_vector() * 300.0);
            let time = random.normal();
            let slope = |axis: Vector| {
                let ahead = noise.at(&(place + axis * h), time);
                (ahead - noise.at(&(place - axis * h), time)) / (2.0 * h)
            };
            let (dx, dy, dz) = (slope(Vector::x()), slope(Vector::y()), slope(Vector::z()));
            let divergence = dx.x + dy.y + dz.z;
            let size = (dx.norm_squared() + dy.norm_squared() + dz.norm_squared()).sqrt();
            assert!(divergence.abs() < 1e-4 * size, "{divergence} of {size}");
        }
    }

    #[test]
    fn what_is_near_is_alike_as_the_length_and_the_time_say() {
        let (length, span) = (100.0, 0.5);
        let mut random = Random::new(7);
        let (mut across, mut later, mut count) = (0.0, 0.0, 0.0);
        for seed in 0..60 {
            let noise = SolenoidalNoise::new(seed, length, span);
            for _ in 0..200 {
                let place = Point::from(random.normal_vector() * 1e4);
                let time = 10.0 * random.normal();
                let u = noise.at(&place, time);
                across += u.dot(&noise.at(&(place + Vector::x() * length), time));
                later += u.dot(&noise.at(&place, time + span));
                count += 3.0;
            }
        }
        let expected = (-0.5f64).exp();
        assert!((later / count - expected).abs() < 0.05, "{}", later / count);
        assert!(
            (across / count - expected).abs() < 0.06,
            "{}",
            across / count
        );
    }

    #[test]
    fn signals_have_mean_zero_and_mean_square_one() {
        let signal = Signal::<3>::new(11, 0.2);
        let count = 40_000;
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        for k in 0..count {
            let u = signal.at(f64::from(k) * 0.037);
            for c in 0..3 {
                sum[c] += u[c] / f64::from(count);
                squares[c] += u[c] * u[c] / f64::from(count);
            }
        }
        assert!(sum.iter().all(|m| m.abs() < 0.05), "{sum:?}");
        assert!(squares.iter().all(|s| (s - 1.0).abs() < 0.1), "{squares:?}");
        assert_eq!(signal, Signal::new(11, 0.2));
    }
}
