//! Progress callbacks, and Ctrl-C while the core is at work.

use std::ops::ControlFlow;

use pyo3::prelude::*;

/// Calls a Python function from a detached computation, and remembers what it raised.
pub(crate) struct Progress {
    callback: Option<Py<PyAny>>,
    raised: Option<PyErr>,
}

impl Progress {
    pub(crate) fn new(callback: Option<Py<PyAny>>) -> Self {
        Self {
            callback,
            raised: None,
        }
    }

    /// Reports `(what, share)`; breaks on Ctrl-C or when the function raises.
    pub(crate) fn report(&mut self, what: &str, share: f64) -> ControlFlow<()> {
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
        match self.raised {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}
