//! Only what a scene needs: patches that sleep, substeps that the motion asks for, skin that
//! moves.
//!
//! All of it keeps to one tolerance: the root mean square, over the nodes of any patch, by which
//! a frame may differ from the full model's. Every frame says by how much it may ([`EconomyReport`]).
//!
//! # Sleep
//!
//! A patch is *held* where its displacement u from its muscle shapes cannot change enough to
//! matter: it then keeps u, and goes where its shapes go. That is the quasi-static answer: no
//! substep is taken, and where the shapes stand nothing is done at all; a patch that was never
//! moved has u = 0 and stands exactly on them. Patches that share the lanes of a register sleep
//! together, when all of them are held. What holding may cost is the sum of
//!
//! - what swings: with A the amplitude in energy, `A' <= -c A + |a| / w0`, where w0 is the angular
//!   frequency of the magnet, c its damping and a the root mean square acceleration of the muscle
//!   shapes. Each mode of a patch is at least as stiff as the magnet alone, and in half a period
//!   all of its energy has been kinetic: A begins as the largest `v / w0` of that time;
//! - what the shapes stretch: [`STRAIN`] of how far they have gone;
//! - fields: `2 |da| / w0^2`, the overshoot of the magnet under a step in acceleration;
//! - neighbours and bones: `2 sqrt(k / k_magnet) |du|`, with du what the paired nodes have moved
//!   against their shapes, or bones against the nodes that they hold. With u on hand, the energy
//!   `k |du|^2 / 2` of u = 0 bounds that of the solution, of which the magnet's share is
//!   `k_magnet |u|^2 / 2`.
//!
//! Shapes that would go less than [`STILL_SHARE`] of the tolerance are not even evaluated: the
//! sum of `|dw| |Db|` over the shapes of a patch bounds how far.
//!
//! # Substeps
//!
//! With s substeps in place of n the result differs by `K (1/s - 1/n) X`, remembered for
//! [`MEMORY`]: one sweep per substep leaves an error of first order in the substep, as large as
//! what the cloth does against its muscle shapes. X is the largest of any patch that is awake, of
//! `|(u, v / w0)|` before the frame and what the acceleration of shapes and fields adds in it. K
//! is measured, over takes and random scenes, not proven; frames longer than 1/60 s, in which more can
//! begin, count as many times. Where it was not measured no substep is
//! spared: in other modes, with loose skin (wrinkle maps, rest lengths that stay neutral), with
//! other materials, and in a *storm*, where a patch is further from its shapes than [`STORM`] or the
//! wind is as strong: there it buckles, and a difference as small as rounding grows.
//!
//! # Bound
//!
//! Sleep and substeps together are the *estimate*, which is kept within the tolerance. Once anything
//! was left out, a patch that can rest in either of two folds may for a while rest in the other one
//! than the full model's does; in random scenes that was seen, rarely, and by less than [`SNAP`] of
//! X. Neither does snapping raise a difference by more than [`GROWTH`] of what it was, or of
//! [`ROUNDING`]. The *bound* is the estimate with the smaller of the two.
//!
//! # Storms
//!
//! The same holds in a storm, where snapping is common. So that little is there to be raised, a storm
//! is foreseen where a take says what comes ([`foresight`]): everything is modelled from [`AHEAD`]
//! before it, and by then nearly all of what was left out has died away: less than 0.0001 mm stays, and
//! in a strong gust that was seen to grow to 0.054 mm.
//!
//! # Skin
//!
//! A vertex is moved only where one of its patches has gone further than [`SKIN_SHARE`] of the
//! tolerance since it last did, or the mandible.

mod cases;
mod fields;
mod foresight;
mod options;
mod patch;
mod report;
mod thrift;
mod ways;

pub use cases::{EconomyCase, EconomyFrame, active_take, economy_case, random_economy_case};
pub(super) use fields::ActingFields;
pub(super) use foresight::Omen;
pub use options::{Economy, Tolerance};
pub(super) use patch::Present;
pub use report::EconomyReport;
pub(super) use thrift::{Plan, Thrift};

/// Of how far muscle shapes go, what the cloth's displacement changes by at most.
const STRAIN: f64 = 0.15;

/// Share of the tolerance that a patch that sleeps may be off by.
const SLEEP_SHARE: f64 = 0.7;

/// Share of the tolerance up to which substeps are spared.
const SUBSTEP_SHARE: f64 = 0.5;

/// Shapes that would go no further than this share of the tolerance are not evaluated.
const STILL_SHARE: f64 = 0.05;

/// Skin stays where its patches have gone no further than this share of the tolerance.
const SKIN_SHARE: f64 = 0.15;

/// K: what sparing substeps costs, against what the cloth does.
const SUBSTEP_ERROR: f64 = 2.0;

/// For how long an error lasts: it falls by a factor of e. (s)
const MEMORY: f64 = 0.2;

/// Displacement from the muscle shapes from which a patch buckles. (mm)
const STORM: f64 = 4.0;

/// What a patch that snaps from one fold to another differs by, against what it does.
const SNAP: f64 = 0.35;

/// By how much snapping may raise a difference.
const GROWTH: f64 = 1000.0;

/// What rounding makes of the same frames, once anything was left out. (mm)
const ROUNDING: f64 = 2e-4;

/// For how long everything is modelled after a storm, and after the face was put somewhere. (s)
const CALM: f64 = 0.3;

/// How far ahead of a storm everything is modelled. (s)
const AHEAD: f64 = 1.5;
