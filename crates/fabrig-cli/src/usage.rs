//! Wrong usage in one line; help and version as they are.

use std::process::ExitCode;

use clap::error::ErrorKind;

/// Prints what clap found and returns the exit code.
pub(crate) fn report(error: &clap::Error) -> ExitCode {
    let is_asked_for = matches!(
        error.kind(),
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion
    );
    if is_asked_for || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        // Nothing is lost when the reader of a pipe has gone.
        let _ = error.print();
        return ExitCode::from(if is_asked_for { 0 } else { 2 });
    }
    let text = error.to_string();
    let lines = text.lines().map(str::trim);
    let said: Vec<&str> = lines
        .take_while(|line| !line.starts_with("For more information"))
        .filter(|line| !line.is_empty())
        .collect();
    crate::console::Console::new().note(&said.join(" "));
    ExitCode::from(2)
}
