//! Where work runs that is cut into many short parallel parts.

/// Does `work` on one of the threads that share parallel work.
///
/// A thread that is none of them hands each parallel part to them and sleeps until it is done: a
/// frame has dozens of parts of some microseconds, and falling asleep and waking takes as long.
/// So whoever cuts work into many of them begins here, and changes threads once.
pub(crate) fn among_workers<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}
