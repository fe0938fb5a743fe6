# Brings a fresh Debian 12, Ubuntu 22.04 or Ubuntu 24.04 to the point where the project builds. Sourced, not run.
#
# What is already there is left alone, so that a second run installs nothing and needs no network.
# Everything that is installed is named before it is.
# shellcheck shell=bash

readonly MIN_RUST=1.89
readonly MIN_CMAKE=3.28
# The newest Rust whose lints the sources were brought to pass: raise it when they pass a newer one.
readonly LINTED_RUST=1.99

say() { printf '%s\n' "$*"; }
fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

# newer_or_equal HAVE NEED: whether version HAVE is at least NEED.
newer_or_equal() { [ "$(printf '%s\n%s\n' "$2" "$1" | sort -V | head -n 1)" = "$2" ]; }

# first_version: the first dotted number on standard input.
first_version() { grep -oE '[0-9]+(\.[0-9]+)+' | head -n 1; }

# as_root COMMAND...: runs a command as root, through sudo where needed.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail "'$*' needs root: run it yourself, or install sudo"
    fi
}

# have_package NAME: whether a Debian package is installed.
have_package() { dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep -q '^install ok installed$'; }

# apt_update: refreshes the package lists, once a run.
apt_update() {
    [ -z "${apt_lists_fresh:-}" ] || return 0
    as_root apt-get update -qq
    apt_lists_fresh=1
}

# need_packages WHY NAME...: installs Debian packages that are missing.
need_packages() {
    local why=$1 name missing=()
    shift
    for name in "$@"; do
        have_package "$name" || missing+=("$name")
    done
    [ "${#missing[@]}" -gt 0 ] || return 0
    command -v apt-get >/dev/null || fail "this machine has no apt-get; install by hand, $why: ${missing[*]}"
    say "setup: installing system packages, $why: ${missing[*]}"
    apt_update
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

# need_compiler: a C compiler and linker, whoever installed them.
need_compiler() {
    if ! command -v cc >/dev/null || ! command -v ld >/dev/null; then
        need_packages "to link and to build zstd and lz4" gcc libc6-dev
    fi
}

# need_cmake: a CMake new enough for LightGBM; Debian 12 and Ubuntu 22.04 ship older ones.
need_cmake() {
    local tools=$1/target/setup version
    mkdir -p "$tools/bin"
    export PATH="$tools/bin:$PATH"
    version=$(cmake --version 2>/dev/null | first_version || true)
    ! newer_or_equal "${version:-0}" "$MIN_CMAKE" || return 0
    python3 -c 'import ensurepip, venv' 2>/dev/null || need_packages "to install CMake from PyPI" python3 python3-venv
    say "setup: installing CMake (found: ${version:-none}, needed for LightGBM: $MIN_CMAKE) from PyPI into $tools"
    rm -rf "$tools/python"
    if ! { python3 -m venv "$tools/python" && "$tools/python/bin/pip" install --quiet "cmake>=$MIN_CMAKE"; }; then
        say "setup: CMake could not be installed; all goes on but what builds LightGBM"
        return 0
    fi
    # Only cmake goes on the path: the rest of the environment would shadow the machine's Python.
    ln -sf ../python/bin/cmake "$tools/bin/cmake"
}

# has_feature TOP NAME: whether Cargo.toml has a cargo feature.
has_feature() { grep -qE "^$2 *= *\[" "$1/Cargo.toml"; }

# need_lightgbm TOP: what the build of LightGBM takes.
need_lightgbm() {
    need_cmake "$1"
    if has_feature "$1" residual; then
        need_packages "to read LightGBM's headers" libclang-dev
        need_packages "to compile LightGBM" g++ make
    fi
}

# rust_version: the version of the Rust compiler on the path; nothing where there is none.
rust_version() { rustc --version 2>/dev/null | first_version || true; }

# newer_than_linted: whether the Rust compiler on the path is newer than the one that the lints were last settled with.
newer_than_linted() { ! newer_or_equal "$LINTED_RUST" "$(rust_version | cut -d . -f 1,2)"; }

# need_rust [COMPONENT...]: a Rust toolchain that is new enough, with these components.
need_rust() {
    local version component missing=()
    [ -d "$HOME/.cargo/bin" ] && export PATH="$PATH:$HOME/.cargo/bin"
    version=$(rust_version)
    if ! newer_or_equal "${version:-0}" "$MIN_RUST" || ! command -v cargo >/dev/null; then
        need_rustup
        say "setup: installing the stable Rust toolchain (found: ${version:-none}, needed: $MIN_RUST) through rustup"
        rustup toolchain install stable --profile minimal --no-self-update
        # The machine's own default stays as it is.
        export RUSTUP_TOOLCHAIN=stable PATH="$HOME/.cargo/bin:$PATH"
        hash -r
        version=$(rust_version)
        newer_or_equal "${version:-0}" "$MIN_RUST" || fail "Rust ${version:-is missing}; $MIN_RUST is needed"
    fi
    for component in "$@"; do
        "cargo-${component#rust}" --version >/dev/null 2>&1 || missing+=("$component")
    done
    [ "${#missing[@]}" -gt 0 ] || return 0
    command -v rustup >/dev/null || fail "cargo lacks ${missing[*]}; install them the way you installed cargo"
    say "setup: adding to the Rust toolchain: ${missing[*]}"
    rustup component add "${missing[@]}"
}

# need_rustup: the distribution's package where it has one, else the project's own installer.
need_rustup() {
    ! command -v rustup >/dev/null || return 0
    # The distribution's rustup would push its own, older cargo off the machine; that one may be in use.
    if command -v apt-get >/dev/null && ! have_package cargo && ! have_package rustc; then
        apt_update
        if apt-cache policy rustup 2>/dev/null | awk '$1 == "Candidate:" && $2 != "(none)" { found = 1 } END { exit !found }'; then
            need_packages "to install Rust" rustup
            return 0
        fi
    fi
    need_packages "to fetch Rust" curl ca-certificates
    say "setup: installing rustup with its official installer, into ~/.cargo and ~/.rustup"
    local installer
    installer=$(mktemp)
    # The second is where the first leads to; some networks let only that one through.
    curl --proto '=https' --tlsv1.2 -sSf -o "$installer" https://sh.rustup.rs ||
        curl --proto '=https' --tlsv1.2 -sSf -o "$installer" https://static.rust-lang.org/rustup/rustup-init.sh ||
        fail "rustup could not be fetched; install Rust $MIN_RUST or newer by hand and run this again"
    sh "$installer" -y --no-modify-path --default-toolchain none ||
        fail "rustup could not be installed; install Rust $MIN_RUST or newer by hand and run this again"
    rm -f "$installer"
    export PATH="$HOME/.cargo/bin:$PATH"
}
