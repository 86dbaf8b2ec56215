#![cfg_attr(target_os = "none", no_std, no_main)]
//! Holds two blobs, answers requests to the compensator, and prints each corrected command
//! with the instructions that it took.

use core::fmt::{self, Write};

fn print(out: &mut dyn Write) -> fmt::Result {
    truepose_firmware::compensation::print(out, &truepose_firmware::clock())
}

truepose_firmware::program!(print);
