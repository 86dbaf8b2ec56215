# Sourced: Debian packages, with patience.

as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

# apt-get, again after a pause where an archive or another package manager was in the way.
apt_patiently() {
    local attempt
    for attempt in 1 2 3 4; do
        as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq \
            -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 "$@" </dev/null && return 0
        echo "apt-get $1: attempt $attempt failed" >&2
        as_root env DEBIAN_FRONTEND=noninteractive dpkg --force-confdef --configure -a </dev/null || true
        sleep $((attempt * 5))
    done
    return 1
}

# Installs the packages named; says nothing but their names unless it fails.
install_packages() {
    local log
    if ! command -v apt-get >/dev/null; then
        echo "no apt-get on this machine to install: $*" >&2
        return 1
    fi
    echo "installing: $*"
    log=$(mktemp)
    if { apt_patiently update && apt_patiently install -y --no-install-recommends "$@"; } >"$log" 2>&1; then
        rm -f "$log"
    else
        tail -n 40 "$log" >&2
        rm -f "$log"
        return 1
    fi
}
