#![cfg_attr(target_os = "none", no_std, no_main)]
//! Calls the functions of the control loop for `tools/cost` to count.

use core::fmt::{self, Write};

fn print(out: &mut dyn Write) -> fmt::Result {
    truepose_firmware::cost::print(out, &truepose_firmware::clock())
}

truepose_firmware::program!(print);
