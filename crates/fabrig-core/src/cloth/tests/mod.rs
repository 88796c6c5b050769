//! Tests of the whole solver, one file per concern.

mod accuracy;
mod analytic;
mod determinism;
mod equilibrium;
mod hard_cases;
mod hooks;
mod support;
mod variations;
