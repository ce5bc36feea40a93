#!/usr/bin/env bash
# Makes .venv with everything Patina needs; the second time it only looks and returns.
# On Debian and Ubuntu missing system libraries are installed where we are root or have sudo
# without a password. What cannot be done is said in one line.
#
# Usage: setup.sh [window]   `window`: libraries for windows and Xvfb are required, not optional.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

need_window=${1:-}
python=${PYTHON:-python3}
stamp=.venv/.complete       # hash of what was installed, written last
unfinished=.venv/.unfinished # there while packages are being installed

say() { printf 'patina: %s\n' "$*" >&2; }
die() {
    say "$*"
    exit 1
}

# Each line: what to look for (a library, or a program in PATH) and the package that has it.
offscreen_libraries='
libGL.so.1 libgl1
libEGL.so.1 libegl1
libglib-2.0.so.0 libglib2.0-0
libfontconfig.so.1 libfontconfig1
libxkbcommon.so.0 libxkbcommon0
libdbus-1.so.3 libdbus-1-3
'
window_libraries='
libxcb-cursor.so.0 libxcb-cursor0
libxcb-icccm.so.4 libxcb-icccm4
libxcb-image.so.0 libxcb-image0
libxcb-keysyms.so.1 libxcb-keysyms1
libxcb-randr.so.0 libxcb-randr0
libxcb-render-util.so.0 libxcb-render-util0
libxcb-shape.so.0 libxcb-shape0
libxcb-xkb.so.1 libxcb-xkb1
libxkbcommon-x11.so.0 libxkbcommon-x11-0
Xvfb xvfb
xauth xauth
'

missing_packages() { # table of libraries -> packages that are missing
    "$python" - "$1" <<'PROBE'
import ctypes
import shutil
import sys


def found(name):
    if ".so" not in name:
        return shutil.which(name) is not None
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


rows = [line.split() for line in sys.argv[1].splitlines() if line]
print(" ".join(package for name, package in rows if not found(name)))
PROBE
}

as_root() { # run a command as root, or fail without asking for a password
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        sudo -n "$@"
    else
        return 100
    fi
}

apt_install() { # packages -> installs them, or fails after saying why in one line
    local log status=0
    command -v apt-get >/dev/null || {
        say "this system has no apt-get; please install what Debian calls: $*"
        return 1
    }
    as_root true || {
        say "system packages are missing; ask an administrator for: apt-get install $*"
        return 1
    }
    say "installing system packages: $*"
    log=$(mktemp)
    as_root apt-get -o DPkg::Lock::Timeout=120 update >"$log" 2>&1 || true
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=120 \
        install -y --no-install-recommends "$@" >>"$log" 2>&1 </dev/null || status=$?
    if [ "$status" != 0 ]; then
        say "apt-get could not install $*: $(grep '^[EW]:' "$log" | tail -n 1)"
    fi
    rm -f "$log"
    return "$status"
}

check_python() {
    command -v "$python" >/dev/null || die "there is no $python; install python3 (3.11 to 3.13)"
    "$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' ||
        die "needs Python 3.11 to 3.13, but $python is $("$python" -V 2>&1 | cut -d' ' -f2);" \
            "another one is taken by: make PYTHON=python3.12 …"
}

check_libraries() {
    [ "$(uname -s)" = Linux ] || return 0
    local venv offscreen window
    venv=$(missing_venv)
    offscreen=$(missing_packages "$offscreen_libraries")
    window=$(missing_packages "$window_libraries")
    [ -n "$venv$offscreen$window" ] || return 0
    # shellcheck disable=SC2086 # lists of packages
    apt_install $venv $offscreen $window && return 0
    [ -z "$venv$offscreen" ] && [ -z "$need_window" ] || exit 1
    say "going on without a window"
}

missing_venv() { # Debian keeps what makes virtual environments in a package of its own
    [ -x .venv/bin/pip ] || "$python" -c 'import ensurepip, venv' 2>/dev/null ||
        "$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'
}

fingerprint() { # changes with the requirements, the interpreter and the place of the folder
    {
        cat pyproject.toml .ci/setup.sh
        pwd -P
        "$python" -c 'import os, sys; print(sys.version, os.path.realpath(sys.executable))'
    } | sha256sum | cut -d' ' -f1
}

make_venv() {
    local venv
    rm -rf .venv
    venv=$(missing_venv)
    [ -z "$venv" ] || apt_install "$venv" || exit 1
    "$python" -m venv .venv || die "could not make the virtual environment .venv with $python"
}

install_packages() {
    local log=.venv/install.log
    touch "$unfinished"
    say "installing Python packages into .venv (a few minutes the first time)"
    .venv/bin/python -m pip install --disable-pip-version-check --no-input --progress-bar off \
        --prefer-binary -e '.[dev]' >"$log" 2>&1 ||
        die "pip failed: $(grep -i 'error' "$log" | tail -n 1) (all of it: $log)"
    .venv/bin/python -m pip check --disable-pip-version-check >>"$log" 2>&1 ||
        die "the installed Python packages contradict each other: see $log"
    rm -f "$unfinished"
}

if command -v flock >/dev/null; then # two makes at once: one installs, the other waits
    exec 9<.
    flock 9
fi
check_python
check_libraries
wanted=$(fingerprint)
[ -x .venv/bin/patina ] && [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ] && exit 0

rm -f "$stamp"
if [ -e "$unfinished" ] || ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    make_venv
elif ! .venv/bin/python - "$("$python" -c 'import sys; print(sys.version)')" <<'SAME'; then
import sys

sys.exit(sys.version != sys.argv[1])
SAME
    make_venv # made by another Python
fi
install_packages
echo "$wanted" >"$stamp"
