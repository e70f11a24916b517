//! The program `shakebench`.
fn main() {}
