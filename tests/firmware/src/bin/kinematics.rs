#![cfg_attr(target_os = "none", no_std, no_main)]
//! Forward kinematics of a PUMA 560, the bits of each tool pose.

truepose_firmware::program!(truepose_firmware::kinematics::print);
