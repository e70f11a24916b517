//! The program `shakebench`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    pack::program::declare();
    cli::main()
}
