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

for extra in $(echo "${1:-}" | tr ',' ' '); do
    grep -q "^$extra = \[" pyproject.toml || {
        echo "install.sh: there is no extra '$extra'; pyproject.toml lists them, as in ./install.sh test,fast" >&2
        exit 2
    }
done

able || { [ "$python" = python3 ] && installed python3-venv && able; } || {
    echo "install.sh: $python must be Python 3.11 or newer with venv; on Debian: apt-get install python3-venv" >&2
    exit 1
}

[ -x .venv/bin/python ] || { echo "install.sh: making .venv"; "$python" -m venv .venv; }
echo "install.sh: installing beadwave${1:+ with $1}, some minutes where nothing is downloaded yet"
.venv/bin/python -m pip install --quiet --disable-pip-version-check \
    --constraint constraints.txt --editable ".${1:+[$1]}"

echo "install.sh: looking for shared libraries"
# Debian packages that are missing: of shared libraries that what was installed loads, of the browser
# in which the tests open the report page, and of what drives it
missing() {
    .venv/bin/python -P workflows/installation/shared_libraries.py | tr '\n' ' '
    case ",${1:-}," in *,test,*)
        command -v chromium >/dev/null || printf 'chromium '
        /sbin/ldconfig -p | grep -q 'libatomic\.so\.1 ' || printf 'libatomic1 '
        ;;
    esac
}
packages=$(missing "$@")
# shellcheck disable=SC2086  one word per package
if [ -n "$packages" ] && ! { installed $packages && packages=$(missing "$@") && [ -z "$packages" ]; }; then
    echo "install.sh: Debian packages are missing, some of what was installed may fail; as root: apt-get install $packages" >&2
fi
echo "install.sh: done; .venv/bin/beadwave run --out runs/first is a first run, .venv/bin/beadwave -h lists the commands"
