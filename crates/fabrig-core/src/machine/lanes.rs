//! Lane types: one text of every kernel for scalars and for several patches at once.
//!
//! A kernel written over [`Real`] runs on `f64` (the reference), on `f32`, and on lane types such
//! as [`F32x8`]. In the cloth lane k belongs to the k-th patch of a group: the patches of a group
//! share their grid, so no lane ever needs another lane's neighbour, and nothing is gathered.
//! Contact has pairs of elements in lanes, skin the nodes of a row.
//!
//! Only IEEE-exact operations are used (+, -, *, /, square root, comparison; never a fused
//! multiply-add or an approximate reciprocal), so a patch has the same bits whatever lane,
//! lane width, or instruction set it runs on.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A number, or several in the lanes of a register.
pub(crate) trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// How many lanes there are.
    const LANES: usize;

    /// The same value in every lane.
    fn splat(value: f64) -> Self;

    /// Replaces the value of one lane by one in single precision.
    fn load_lane(&mut self, lane: usize, value: f32);

    /// Value of one lane. By reference: a register would go through memory to be indexed.
    fn lane(&self, lane: usize) -> f64;

    /// Replaces the value of one lane.
    fn set_lane(&mut self, lane: usize, value: f64);

    /// Square root, lane by lane.
    fn sqrt(self) -> Self;

    /// The larger value, lane by lane.
    fn max(self, other: Self) -> Self;

    /// `if a < b { yes } else { no }`, lane by lane.
    fn select_less(a: Self, b: Self, yes: Self, no: Self) -> Self;

    /// Whether `a < b` in any lane.
    fn any_less(a: Self, b: Self) -> bool;
}

macro_rules! scalar_real {
    ($scalar:ty) => {
        impl Real for $scalar {
            const LANES: usize = 1;

            #[inline(always)]
            fn splat(value: f64) -> Self {
                value as $scalar
            }

            #[inline(always)]
            fn load_lane(&mut self, _lane: usize, value: f32) {
                *self = <$scalar>::from(value);
            }

            #[inline(always)]
            fn lane(&self, _lane: usize) -> f64 {
                f64::from(*self)
            }

            #[inline(always)]
            fn set_lane(&mut self, _lane: usize, value: f64) {
                *self = value as $scalar;
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                <$scalar>::sqrt(self)
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self < other { other } else { self }
            }

            #[inline(always)]
            fn select_less(a: Self, b: Self, yes: Self, no: Self) -> Self {
                if a < b { yes } else { no }
            }

            #[inline(always)]
            fn any_less(a: Self, b: Self) -> bool {
                a < b
            }
        }
    };
}

scalar_real!(f32);
scalar_real!(f64);

/// Declares a type of several lanes. Arithmetic is written as plain loops over the lanes, which
/// the compiler turns into register operations of the instruction set that the caller enabled.
macro_rules! lanes {
    ($(#[$doc:meta])* $name:ident, $scalar:ty, $count:literal, $bytes:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[repr(C, align($bytes))]
        pub(crate) struct $name(pub(crate) [$scalar; $count]);

        lanes!(@operator $name, $count, Add, add, +);
        lanes!(@operator $name, $count, Sub, sub, -);
        lanes!(@operator $name, $count, Mul, mul, *);
        lanes!(@operator $name, $count, Div, div, /);

        impl Neg for $name {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                let mut out = self.0;
                for lane in 0..$count {
                    out[lane] = -self.0[lane];
                }
                Self(out)
            }
        }

        impl AddAssign for $name {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }

        impl SubAssign for $name {
            #[inline(always)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }

        impl Real for $name {
            const LANES: usize = $count;

            #[inline(always)]
            fn splat(value: f64) -> Self {
                Self([value as $scalar; $count])
            }

            #[inline(always)]
            fn load_lane(&mut self, lane: usize, value: f32) {
                self.0[lane] = <$scalar>::from(value);
            }

            #[inline(always)]
            fn lane(&self, lane: usize) -> f64 {
                f64::from(self.0[lane])
            }

            #[inline(always)]
            fn set_lane(&mut self, lane: usize, value: f64) {
                self.0[lane] = value as $scalar;
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                let mut out = [0.0; $count];
                for lane in 0..$count {
                    out[lane] = self.0[lane].sqrt();
                }
                Self(out)
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self::select_less(self, other, other, self)
            }

            #[inline(always)]
            fn select_less(a: Self, b: Self, yes: Self, no: Self) -> Self {
                let mut out = [0.0; $count];
                for lane in 0..$count {
                    out[lane] = if a.0[lane] < b.0[lane] {
                        yes.0[lane]
                    } else {
                        no.0[lane]
                    };
                }
                Self(out)
            }

            #[inline(always)]
            fn any_less(a: Self, b: Self) -> bool {
                let mut any = false;
                for lane in 0..$count {
                    any |= a.0[lane] < b.0[lane];
                }
                any
            }
        }
    };
    (@operator $name:ident, $count:literal, $trait:ident, $method:ident, $operator:tt) => {
        impl $trait for $name {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut out = [0.0; $count];
                for lane in 0..$count {
                    out[lane] = self.0[lane] $operator other.0[lane];
                }
                Self(out)
            }
        }
    };
}

lanes!(
    /// Four single-precision lanes.
    F32x4, f32, 4, 16
);
lanes!(
    /// Eight single-precision lanes.
    F32x8, f32, 8, 32
);
lanes!(
    /// Eight double-precision lanes.
    F64x8, f64, 8, 64
);

/// A vector of three [`Real`]s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(crate) struct Vec3<R> {
    /// First component.
    pub(crate) x: R,
    /// Second component.
    pub(crate) y: R,
    /// Third component.
    pub(crate) z: R,
}

impl<R: Real> Vec3<R> {
    /// From three components.
    #[inline(always)]
    pub(crate) fn new(x: R, y: R, z: R) -> Self {
        Self { x, y, z }
    }

    /// The same vector in every lane.
    #[inline(always)]
    pub(crate) fn splat(v: [f64; 3]) -> Self {
        Self::new(R::splat(v[0]), R::splat(v[1]), R::splat(v[2]))
    }

    /// Zero in every lane.
    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self::splat([0.0; 3])
    }

    /// Scalar product.
    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> R {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Value of one lane.
    #[inline(always)]
    pub(crate) fn lane(&self, lane: usize) -> [f64; 3] {
        [self.x.lane(lane), self.y.lane(lane), self.z.lane(lane)]
    }

    /// Replaces the value of one lane.
    #[inline(always)]
    pub(crate) fn set_lane(&mut self, lane: usize, v: [f64; 3]) {
        self.x.set_lane(lane, v[0]);
        self.y.set_lane(lane, v[1]);
        self.z.set_lane(lane, v[2]);
    }
}

impl<R: Real> Add for Vec3<R> {
    type Output = Self;

    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<R: Real> Sub for Vec3<R> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<R: Real> Mul<R> for Vec3<R> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, s: R) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}

impl<R: Real> AddAssign for Vec3<R> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<R: Real> SubAssign for Vec3<R> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lane_does_what_a_scalar_does() {
        let a = [1.5_f32, -2.0, 0.3, 7.0, 1.0, -1e9, 0.0, 4.0];
        let b = [0.1_f32, 3.0, -0.7, 7.0, -1.0, 2.0, 5.0, 4.5];
        let (la, lb) = (F32x8(a), F32x8(b));
        for lane in 0..8 {
            let scalars = [
                a[lane] + b[lane],
                a[lane] - b[lane],
                a[lane] * b[lane],
                a[lane] / b[lane],
                -a[lane],
                (a[lane] * a[lane]).sqrt(),
                a[lane].max(b[lane]),
                if a[lane] < b[lane] { 1.0 } else { 2.0 },
            ];
            let lanes = [
                la + lb,
                la - lb,
                la * lb,
                la / lb,
                -la,
                (la * la).sqrt(),
                la.max(lb),
                Real::select_less(la, lb, F32x8::splat(1.0), F32x8::splat(2.0)),
            ];
            for (scalar, l) in scalars.iter().zip(lanes) {
                assert_eq!(scalar.to_bits(), l.0[lane].to_bits());
            }
        }
    }

    #[test]
    fn the_vector_product_is_orthogonal_and_right_handed() {
        let x = Vec3::<f64>::splat([1.0, 0.0, 0.0]);
        let y = Vec3::<f64>::splat([0.0, 1.0, 0.0]);
        assert_eq!(x.cross(y), Vec3::splat([0.0, 0.0, 1.0]));
    }
}
