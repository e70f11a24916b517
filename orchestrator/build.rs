//! Compiles what of the FMI import has to be C.

fn main() {
    println!("cargo::rerun-if-changed=src/fmu/native/logger.c");
    cc::Build::new()
        .file("src/fmu/native/logger.c")
        .compile("shakebench_logger");
}
