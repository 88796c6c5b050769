//! `fabrig bench`: measurements that the documentation quotes, one file each.

mod batch;
mod chain;
mod demo_scene;
mod economy;
mod pareto;
mod plot;
mod registration;
mod resolution;
mod runtime;
mod soft_tissue;
mod stability;
mod table3;
mod table3_page;
mod wrinkles;

use anyhow::Result;

use super::Outcome;
use crate::cli::BenchCommand;
use crate::console::Console;

pub(crate) fn run(console: &Console, command: &BenchCommand) -> Result<Outcome> {
    match command {
        BenchCommand::Chain { cloth, json } => chain::run(console, *cloth, *json),
        BenchCommand::Registration(args) => registration::run(console, args),
        BenchCommand::Batch(args) => batch::run(console, args),
        BenchCommand::Economy(args) => economy::run(console, args),
        BenchCommand::Pareto(args) => pareto::run(console, args),
        BenchCommand::Resolution(args) => resolution::run(console, args),
        BenchCommand::Runtime(args) => runtime::run(console, args),
        BenchCommand::Stability(args) => stability::run(console, args),
        BenchCommand::SoftTissue(args) => soft_tissue::run(console, args),
        BenchCommand::Table3(args) => table3::run(console, args),
        BenchCommand::Wrinkles(args) => wrinkles::run(console, args),
    }
}
