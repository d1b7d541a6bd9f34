#!/bin/sh
# Builds the documentation into docs/_site; warnings are errors. `docs/build.sh all` first runs the
# commands of every page and computes the gallery again, some twenty minutes.
set -eu
cd "$(dirname "$0")/.."
if [ "${1:-}" = all ]; then
    .venv/bin/python docs/run_commands.py
    .venv/bin/python docs/gallery.py
fi
rm -rf docs/reference # pages of names that are gone
.venv/bin/python -m sphinx -E -W --keep-going -q docs docs/_site
echo "written: docs/_site/index.html"
