//! The command line: arguments, files and screens; no modelling.
#![forbid(unsafe_code)]

mod arguments;
mod commands;
mod page;
mod screen;
mod stop;

use std::process::ExitCode;

use arguments::{Arguments, Command};
use clap::Parser;
use mimalloc::MiMalloc;

#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(other) => return help(&other),
    };
    let outcome = match arguments.command {
        Command::New(a) => commands::new(&a),
        Command::Check(a) => commands::check(&a),
        Command::Fmt(a) => commands::fmt(&a),
        Command::Library(a) => commands::library(&a),
        Command::Show(a) => commands::show(&a),
        Command::Loops(a) => commands::loops(&a),
        Command::Equations(a) => commands::equations(&a),
        Command::Compare(a) => commands::compare(&a),
        Command::Linearize(a) => commands::linearize(&a),
        Command::Simulate(a) => commands::simulate(&a),
        Command::Report(a) => commands::report(&a),
        Command::Fit(a) => commands::fit(&a),
        Command::Sweep(a) => commands::sweep(&a),
        Command::Run(a) => commands::run(&a),
        Command::Draw(a) => commands::draw(&a),
        Command::Export(a) => commands::export(&a),
    };
    ExitCode::from(outcome)
}

/// Prints help, the version, or what is wrong with the arguments.
fn help(what: &clap::Error) -> ExitCode {
    if what.use_stderr() {
        let _ = what.print();
        return ExitCode::from(u8::try_from(what.exit_code()).unwrap_or(2));
    }
    ExitCode::from(screen::printed(screen::print(&what.render().to_string()), 0))
}
