//! Compiles what of the FMI import has to be C.

fn main() {
    println!("cargo::rerun-if-changed=src/native/logger.c");
    cc::Build::new()
        .file("src/native/logger.c")
        .compile("shakebench_logger");
}
