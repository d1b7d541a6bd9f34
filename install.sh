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

if ! "$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    echo "install.sh: $python must be Python 3.11 or newer with venv; on Debian: apt-get install python3-venv" >&2
    exit 1
fi

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

if [ -n "$missing" ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        export DEBIAN_FRONTEND=noninteractive
        # shellcheck disable=SC2086  one word per package
        { apt-get update -qq && apt-get install -y -qq --no-install-recommends $missing; } >/dev/null ||
            echo "install.sh: apt-get could not install $missing; meshing or pictures may fail" >&2
    else
        echo "install.sh: shared libraries are missing, meshing or pictures may fail; as root: apt-get install $missing" >&2
    fi
fi

[ -x .venv/bin/python ] || "$python" -m venv .venv
.venv/bin/python -m pip install --quiet --disable-pip-version-check \
    --constraint constraints.txt --editable ".${1:+[$1]}"
