#!/usr/bin/env bash
# Tests with margins near rounding, as they run on other processors: BLAS, numpy and numba round
# differently with the instructions that each processor has.
#
#   tests/processors.sh             some minutes
#   PYTHON=python3.12 tests/processors.sh -x --durations 5
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-.venv/bin/python}
code=$(mktemp -d)
trap 'rm -rf "$code"' EXIT

tests=(tests/test_rom_reduction.py tests/test_rom_parts.py tests/test_rom_reduced_model.py
    tests/test_rom_many_contacts.py tests/test_fem_factorisation.py tests/test_fem_beam.py
    tests/test_coupling_damping.py tests/test_dem_parts.py)
simd=$("$python" -c 'import numpy; print(*numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", []))')

on() { # name, kernels of BLAS, vector instructions that numpy is to leave out, processor of numba
    echo "+ $1"
    OPENBLAS_NUM_THREADS=1 OPENBLAS_CORETYPE=$2 NPY_DISABLE_CPU_FEATURES=$3 NUMBA_CPU_NAME=$4 NUMBA_CPU_FEATURES='' \
        NUMBA_CACHE_DIR=$code/$4 "$python" -m pytest -p no:cacheprovider "${tests[@]}" "${@:5}"
}

on "AVX2 and fused products, without AVX-512" Haswell "${simd//X86_V3/}" x86-64-v3 "$@"
on "SSE alone" Prescott "$simd" generic "$@"
