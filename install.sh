#!/bin/sh
# Installs beadwave into .venv of this checkout, and the shared libraries it needs where it may.
#
#   ./install.sh             the program
#   ./install.sh test        and what the tests need
#   ./install.sh test,fast   any extras of pyproject.toml
#
# PYTHON=python3.12 ./install.sh takes another interpreter.
set -eu
cd "$(dirname "$0")"
python=${PYTHON:-python3}

# as root, where there is apt: installs Debian packages, else fails
installed() {
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"; } >/dev/null
}
able() { "$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

able || { [ "$python" = python3 ] && installed python3-venv && able; } || {
    echo "install.sh: $python must be Python 3.11 or newer with venv; on Debian: apt-get install python3-venv" >&2
    exit 1
}

# the mesher and off-screen rendering load these by name; absent ones are printed as Debian packages
missing=$("$python" - <<'PYTHON'
import ctypes

PACKAGES = {
    "libGL.so.1": "libgl1",
    "libGLU.so.1": "libglu1-mesa",
    "libOSMesa.so.8": "libosmesa6",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libXrender.so.1": "libxrender1",
    "libgomp.so.1": "libgomp1",
}
for library, package in PACKAGES.items():
    try:
        ctypes.CDLL(library)
    except OSError:
        print(package, end=" ")
PYTHON
)
# the tests open the report page in a browser
case ",${1:-}," in *,test,*) command -v chromium >/dev/null || missing="${missing}chromium " ;; esac

# shellcheck disable=SC2086  one word per package
if [ -n "$missing" ] && ! installed $missing; then
    echo "install.sh: shared libraries are missing, meshing or pictures may fail; as root: apt-get install $missing" >&2
fi

[ -x .venv/bin/python ] || "$python" -m venv .venv
.venv/bin/python -m pip install --quiet --disable-pip-version-check \
    --constraint constraints.txt --editable ".${1:+[$1]}"
