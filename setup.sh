#!/usr/bin/env bash
# Puts everything that Glint needs where it belongs: system libraries, .venv with the pinned packages, Glint itself.
# Safe to repeat; `make` calls it only when requirements.txt, pyproject.toml or this file has changed.
set -euo pipefail
cd "$(dirname "$0")"

fail() { echo "setup: $*" >&2; exit 1; }

wanted=$(cat .python-version)

# The first of: pyenv's version, python of that very name, python3 if it is of that version.
find_python() {
    local candidate
    for candidate in "$(pyenv prefix "$wanted" 2>/dev/null || true)/bin/python3" "python$wanted" python3; do
        if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info[:2] != tuple(map(int, sys.argv[1].split("."))))' \
            "$wanted" 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    fail "no Python $wanted with venv: install it (pyenv install $wanted, or apt-get install python$wanted python$wanted-venv)"
}

# Open3D opens these when it is imported; the packages' names are Debian's.
libraries=(libusb-1.0.so.0:libusb-1.0-0 libGL.so.1:libgl1 libEGL.so.1:libegl1 libX11.so.6:libx11-6 libudev.so.1:libudev1
    libgomp.so.1:libgomp1)

# A fresh machine upgrades itself, and holds apt's locks for minutes: wait for it.
lock_seconds=600
become=()
apt_get() {
    local log waited=0
    log=$(mktemp)
    until "${become[@]}" env LC_ALL=C DEBIAN_FRONTEND=noninteractive \
        apt-get -o "DPkg::Lock::Timeout=$lock_seconds" "$@" 2>"$log"; do
        if [ "$waited" -ge "$lock_seconds" ] || ! grep -qi "get lock\|unable to lock" "$log"; then
            cat "$log" >&2
            rm "$log"
            return 1
        fi
        [ "$waited" -eq 0 ] && echo "setup: waiting for another apt-get, at most $lock_seconds s" >&2
        sleep 5
        waited=$((waited + 5))
    done
    rm "$log"
}

install_libraries() {
    local python=$1 pair missing=()
    for pair in "${libraries[@]}"; do
        "$python" -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "${pair%%:*}" 2>/dev/null || missing+=("${pair##*:}")
    done
    [ ${#missing[@]} -eq 0 ] && return
    if [ "$(id -u)" -ne 0 ]; then
        sudo -n true 2>/dev/null || fail "system libraries are missing: sudo apt-get install ${missing[*]}"
        become=(sudo -n)
    fi
    command -v apt-get >/dev/null || fail "system libraries are missing; Debian calls their packages ${missing[*]}"
    echo "setup: installing ${missing[*]}"
    apt_get update -qq || true
    apt_get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null ||
        fail "apt-get install ${missing[*]} did not work: install them by hand"
}

python=$(find_python)
install_libraries "$python"

if ! .venv/bin/python -c 'import sys; sys.exit(sys.version_info[:2] != tuple(map(int, sys.argv[1].split("."))))' "$wanted" \
    2>/dev/null; then
    echo "setup: making .venv with $("$python" --version)"
    "$python" -m venv --clear .venv
fi

echo "setup: installing the pinned packages (about 2 GB, a minute or two the first time)"
pip=(.venv/bin/python -m pip --disable-pip-version-check install --quiet)
# All of it is listed, so pip need not resolve: it would meet newer releases that have no hash here.
"${pip[@]}" --no-deps --require-hashes -r requirements.txt
"${pip[@]}" --no-deps --no-build-isolation -e .
touch .venv/ready
echo "setup: done"
