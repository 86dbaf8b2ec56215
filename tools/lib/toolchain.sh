# Sourced: which compiler serves a Cortex-M target.

default_target=thumbv7em-none-eabihf
debian_sources=/usr/lib/rustlib/src/rust/library

# True if the rustc that PATH finds comes with core for the target $1.
path_rustc_has_core() {
    local libraries
    command -v rustc >/dev/null || return 1
    libraries=$(rustc --target "$1" --print target-libdir 2>/dev/null) || return 1
    [ -n "$(find "$libraries" -name 'libcore-*.rlib' -print -quit 2>/dev/null)" ]
}
