#![cfg_attr(target_os = "none", no_std, no_main)]
//! Runs a control loop in a timer's interrupt and, below it, the link over the second UART:
//! `tools/cargo-thumb run --release -p truepose-firmware --bin link -- -serial pty`

#[cfg(target_os = "none")]
truepose_firmware::program!(truepose_firmware::above_link::run);

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This program needs the board: tools/cargo-thumb run ... --bin link");
}
