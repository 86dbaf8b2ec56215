#![cfg_attr(target_os = "none", no_std, no_main)]
//! Answers the same requests by every method and prints each corrected command with the
//! instructions that it took.

use core::fmt::{self, Write};

fn print(out: &mut dyn Write) -> fmt::Result {
    truepose_firmware::methods::print(out, &truepose_firmware::clock())
}

truepose_firmware::program!(print);
