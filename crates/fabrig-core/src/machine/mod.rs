//! What code runs on: lanes of registers, the vector instructions that a processor has, threads.

mod instructions;
mod lanes;
mod threads;

pub use instructions::instruction_set;
#[cfg(test)]
pub(crate) use instructions::tests::with_baseline;
pub(crate) use instructions::vectorized;
pub(crate) use lanes::{F32x4, F32x8, F64x8, Real, Vec3};
pub(crate) use threads::among_workers;
