//! The program that logs is linked with what defmt keeps its texts in.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let set = |name| std::env::var_os(name).is_some();
    let on_target = std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "none");
    if on_target && set("CARGO_FEATURE_DEFMT") {
        println!("cargo::rustc-link-arg-bin=logs=-Tdefmt.x");
    }
}
