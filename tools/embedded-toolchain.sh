#!/usr/bin/env bash
# Sees to everything that a Cortex-M build and its emulated run need.
#
#   tools/embedded-toolchain.sh [--check] [TARGET...]       TARGET: thumbv7em-none-eabihf
#
# Two ways lead to a core library for the target:
#   rustup   `rustup target add TARGET` was run: nothing of Rust is touched here;
#   Debian   the rustc of the *-web packages with its library sources, from which
#            tools/cargo-thumb builds core. Taken where the first is not there.
# Besides: the emulator, the Arm compiler and binutils, a C compiler for the counting plug-in.
#
# A second run finds everything in place and asks no archive. --check only looks: exit 1 and
# a list if something is missing.
set -euo pipefail
tools=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
. "$tools/lib/toolchain.sh"
. "$tools/lib/packages.sh"

look_only=
targets=()
while [ $# -gt 0 ]; do
    case $1 in
        --check) look_only=1 ;;
        --help | -h) awk 'NR > 1 && !/^#/ { exit } NR > 1 { sub(/^# ?/, ""); print }' "$0"; exit ;;
        -*) printf 'embedded-toolchain: no option %s\n' "$1" >&2; exit 2 ;;
        *) targets+=("$1") ;;
    esac
    shift
done
[ ${#targets[@]} -ne 0 ] || targets=("$default_target")

way=rustup
for target in "${targets[@]}"; do
    path_rustc_has_core "$target" || way=Debian
done

# One line each: what must be there, and the package that brings it.
requirements() {
    cat <<-END
	qemu-system-arm            qemu-system-arm
	arm-none-eabi-gcc          gcc-arm-none-eabi
	arm-none-eabi-objdump      binutils-arm-none-eabi
	cc                         gcc
	python3                    python3
	END
    [ $way = Debian ] || return 0
    cat <<-END
	$debian_sources/core/Cargo.toml    rust-web-src
	/usr/share/doc/rustc-web           rustc-web
	/usr/share/doc/cargo-web           cargo-web
	/usr/share/doc/rust-web-llvm       rust-web-llvm
	/usr/bin/cargo-clippy              rust-web-clippy
	END
    # Rust's default linker is a link into a package that carries LLVM's version in its name
    # and that the compiler only recommends.
    if [ -L /usr/bin/rust-lld ] && [ ! -e /usr/bin/rust-lld ]; then
        echo "/usr/bin/rust-lld $(basename "$(readlink /usr/bin/rust-lld)")"
    fi
}
missing() {
    local thing package
    requirements | while read -r thing package; do
        case $thing in
            /*) [ -e "$thing" ] || echo "$package" ;;
            *) command -v "$thing" >/dev/null || echo "$package" ;;
        esac
    done
}

# Twice: which linker package is wanted is known only once the compiler is there.
for _ in 1 2; do
    mapfile -t packages < <(missing)
    [ ${#packages[@]} -ne 0 ] || break
    if [ -n "$look_only" ]; then
        echo "embedded-toolchain: not installed: ${packages[*]}" >&2
        exit 1
    fi
    if ! install_packages "${packages[@]}"; then
        echo "embedded-toolchain: with rustup, 'rustup target add ${targets[*]}' gives the compiler's part" >&2
        exit 1
    fi
done
mapfile -t packages < <(missing)
if [ ${#packages[@]} -ne 0 ]; then
    echo "embedded-toolchain: installed, and still not found: ${packages[*]}" >&2
    exit 1
fi

qemu-system-arm --version | sed -n 1p
case $way in
    rustup) echo "$(rustc --version) with ${targets[*]}: cargo builds for it" ;;
    Debian) echo "$(/usr/bin/rustc --version) builds core for ${targets[*]}: tools/cargo-thumb in place of cargo" ;;
esac
