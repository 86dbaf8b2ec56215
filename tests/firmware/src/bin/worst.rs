#![cfg_attr(target_os = "none", no_std, no_main)]
//! Holds the worst case that the budget counts on against adversarial requests.

use core::fmt::{self, Write};

fn print(out: &mut dyn Write) -> fmt::Result {
    truepose_firmware::worst::print(out, &truepose_firmware::clock())
}

truepose_firmware::program!(print);
