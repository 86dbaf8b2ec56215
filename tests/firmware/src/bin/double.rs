#![cfg_attr(target_os = "none", no_std, no_main)]
//! Answers requests to the compensator in double precision.

truepose_firmware::program!(truepose_firmware::double::print);
