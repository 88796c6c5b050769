//! `fabrig completions` and `fabrig man`: what the command line says of itself.

use std::io::Write;

use anyhow::Result;
use clap::{Command, CommandFactory};

use super::Outcome;
use crate::cli::{Cli, CompletionsArgs};

pub(crate) fn completions(args: &CompletionsArgs) -> Result<Outcome> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "fabrig", &mut text);
    print(&text)
}

/// One page: the program, then every verb.
pub(crate) fn man() -> Result<Outcome> {
    let mut text = Vec::new();
    let mut program = Cli::command();
    program.build();
    clap_mangen::Man::new(program.clone()).render(&mut text)?;
    verbs(&program, &mut text)?;
    print(&text)
}

/// The verbs below a command, each under a heading of its own.
fn verbs(command: &Command, text: &mut Vec<u8>) -> Result<()> {
    for verb in command.get_subcommands() {
        if verb.get_name() == "help" {
            continue;
        }
        let name = verb.get_bin_name().unwrap_or_else(|| verb.get_name());
        writeln!(text, ".SH {}", name.to_uppercase())?;
        let page = clap_mangen::Man::new(verb.clone());
        page.render_description_section(text)?;
        page.render_synopsis_section(text)?;
        page.render_options_section(text)?;
        page.render_extra_section(text)?;
        verbs(verb, text)?;
    }
    Ok(())
}

fn print(text: &[u8]) -> Result<Outcome> {
    // A reader that has gone away wants no more.
    let _ = std::io::stdout().lock().write_all(text);
    Ok(Outcome::Done)
}
