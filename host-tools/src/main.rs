//! The command `truepose`.
fn main() {}
