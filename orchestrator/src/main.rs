//! The program `shakebench`.

use std::process::ExitCode;

fn main() -> ExitCode {
    shakebench::cli::main()
}
