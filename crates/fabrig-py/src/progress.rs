//! Progress, and Ctrl-C while the core is at work.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::errors::{FabrigError, input};

/// How often a computation that reports nothing looks for Ctrl-C.
const PATIENCE: Duration = Duration::from_millis(50);

/// Calls a Python function from a detached computation, and remembers what it raised.
pub(crate) struct Progress {
    callback: Option<Py<PyAny>>,
    is_bar: bool,
    is_abandoned: Arc<AtomicBool>,
    raised: Option<PyErr>,
}

impl Progress {
    /// From the argument `progress`: a function, `True` for a bar, `None` or `False` for none.
    pub(crate) fn new(py: Python<'_>, progress: Option<Py<PyAny>>) -> PyResult<Self> {
        let mut made = Self {
            callback: None,
            is_bar: false,
            is_abandoned: Arc::default(),
            raised: None,
        };
        let Some(progress) = progress else {
            return Ok(made);
        };
        let progress = progress.into_bound(py);
        if let Ok(wanted) = progress.cast::<PyBool>() {
            made.is_bar = wanted.is_true();
            if made.is_bar {
                let bar = py.import("fabrig._progress")?.call_method0("Bar")?;
                made.callback = Some(bar.unbind());
            }
        } else if progress.is_callable() {
            made.callback = Some(progress.unbind());
        } else {
            return Err(input(
                "progress: expected True for a bar, or a function of (what, share)",
            ));
        }
        Ok(made)
    }

    fn bar(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        let bar = self.callback.as_ref().filter(|_| self.is_bar)?;
        Some(bar.clone_ref(py))
    }

    /// Reports `(what, share)`; breaks on Ctrl-C or when the function raises.
    pub(crate) fn report(&mut self, what: &str, share: f64) -> ControlFlow<()> {
        if self.is_abandoned.load(Ordering::Relaxed) {
            return ControlFlow::Break(());
        }
        let result = Python::attach(|py| {
            py.check_signals()?;
            if let Some(callback) = &self.callback {
                callback.call1(py, (what, share))?;
            }
            Ok(())
        });
        match result {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.raised = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    /// The exception that stopped the computation, if one did.
    pub(crate) fn finish(self) -> PyResult<()> {
        Python::attach(|py| match self.bar(py) {
            Some(bar) => bar.call_method0(py, "close").map(drop),
            None => Ok(()),
        })?;
        match self.raised {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

/// As [`interruptible`], with progress: what is abandoned stops at its next report.
pub(crate) fn interruptible_with<T: Send + 'static>(
    py: Python<'_>,
    progress: Progress,
    work: impl FnOnce(&mut Progress) -> T + Send + 'static,
) -> PyResult<T> {
    let is_abandoned = Arc::clone(&progress.is_abandoned);
    let bar = progress.bar(py);
    let result = interruptible(py, move || {
        let mut progress = progress;
        let result = work(&mut progress);
        (result, progress.raised)
    });
    if let Some(bar) = bar {
        bar.call_method0(py, "close")?;
    }
    match result {
        Ok((result, None)) => Ok(result),
        Ok((_, Some(error))) => Err(error),
        Err(error) => {
            is_abandoned.store(true, Ordering::Relaxed);
            Err(error)
        }
    }
}

/// Runs a computation that cannot be stopped on a thread of its own, so that Ctrl-C ends the
/// wait for it; what it still computes then is thrown away.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    thread::Builder::new()
        .name("fabrig".to_owned())
        .spawn(move || sender.send(work()))?;
    loop {
        let receiver = &mut receiver;
        match py.detach(move || receiver.recv_timeout(PATIENCE)) {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(FabrigError::new_err(
                    "the computation broke off; its last words are on standard error",
                ));
            }
        }
    }
}
