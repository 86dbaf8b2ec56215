#![cfg_attr(target_os = "none", no_std, no_main)]
//! Calls the functions of the control loop for `tools/cost` to count.

truepose_firmware::program!(truepose_firmware::cost::print);
