//! The command line: the only room that prints and exits.
#![forbid(unsafe_code)]

mod args;
mod causes;
mod commands;
mod demo;
mod fail;
mod interrupt;
mod ledgers;
mod memory;
mod open;
mod output;
mod progress;
mod say;
mod seen;
mod stage;
mod trees;

use args::{Cli, Command};
use clap::Parser;
use fail::Fail;
use std::process::ExitCode;

fn main() -> ExitCode {
    let words = args::with_default_command(std::env::args_os().collect());
    let words = match words {
        Ok(words) => words,
        Err(fail) => return report(&fail),
    };
    let cli = match Cli::try_parse_from(words) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are errors to clap; they print to standard output and succeed. A closed pipe is no news.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { fail::USAGE } else { 0 });
        }
    };
    let result = match cli.command {
        Command::Render(options) => commands::render::run(&options),
        Command::Compare(options) => commands::compare::run(&options),
        Command::Report(options) => commands::report::run(&options),
        Command::Error(options) => commands::error::run(&options),
        Command::Calibrate(options) => commands::calibrate::run(&options),
        Command::Predict(options) => commands::predict::run(&options),
        Command::Whatif(options) => commands::whatif::run(&options),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(fail) => report(&fail),
    }
}

fn report(fail: &Fail) -> ExitCode {
    crate::say::err!("hotspot-render: {}", fail.message);
    ExitCode::from(fail.code)
}
