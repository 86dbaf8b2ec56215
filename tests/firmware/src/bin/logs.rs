#![cfg_attr(target_os = "none", no_std, no_main)]
//! Logs with defmt what a controller meets, as frames on the emulator's standard output:
//! `DEFMT_LOG=trace tools/cargo-thumb run --release -p truepose-firmware --features defmt --bin logs`

#[cfg(target_os = "none")]
use defmt_semihosting as _;

#[cfg(target_os = "none")]
truepose_firmware::program!(truepose_firmware::logs::run);

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This program needs the board: tools/cargo-thumb run ... --bin logs");
}
