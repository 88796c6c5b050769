//! Code compiled for the vector instructions that this processor has.
//!
//! Lanes are plain arithmetic in loops; what is inlined into [`vectorized`] is compiled for the
//! baseline and for AVX2 (on x86), and the processor decides which of them runs. Both round alike,
//! so results have the same bits whichever does.
//!
//! AVX-512 was measured and left out: sixteen lanes made the bare kernels 1.7 times as quick but
//! frames no quicker (the state of sixteen patches is more than a second cache of 1 MB holds), and
//! eight lanes gained nothing from it.

/// Runs `work` compiled for the widest vector instructions that this processor has.
///
/// A closure would not do: it is compiled for the baseline unless it happens to be inlined.
pub(crate) fn vectorized<W: pulp::NullaryFnOnce>(work: W) -> W::Output {
    #[cfg(test)]
    if tests::is_baseline_forced() {
        return work.call();
    }
    pulp::Arch::new().dispatch(work)
}

/// The instructions that the solver's loops run on here.
pub fn instruction_set() -> &'static str {
    match pulp::Arch::new() {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        pulp::Arch::V3(_) => "AVX2 and FMA",
        _ => "the baseline of this kind of processor",
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    /// Tests that run meanwhile compute the same bits by other instructions.
    static IS_BASELINE: AtomicBool = AtomicBool::new(false);

    pub(super) fn is_baseline_forced() -> bool {
        IS_BASELINE.load(Ordering::Relaxed)
    }

    /// Runs `work` with what every processor of this kind has.
    pub(crate) fn with_baseline<T>(work: impl FnOnce() -> T) -> T {
        IS_BASELINE.store(true, Ordering::Relaxed);
        let result = work();
        IS_BASELINE.store(false, Ordering::Relaxed);
        result
    }
}
