#!/usr/bin/env bash
# Tests with margins near rounding, as on processors without AVX-512 and without AVX2: the kernels
# of BLAS, numpy and numba round differently with other instructions.
#
#   tests/processors.sh             about two minutes of processor time, half of them numba's compilation
#   PYTHON=python3.12 tests/processors.sh -x --durations 5
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(uname -m)" = x86_64 ] || { echo "processors.sh: the processors are those of x86-64; nothing is run" >&2; exit 0; }
python=${PYTHON:-.venv/bin/python}
code=$(mktemp -d)
trap 'rm -rf "$code"' EXIT

tests=(tests/test_rom_{reduction,parts,reduced_model}.py
    tests/test_fem_{factorisation,beam,elasticity,materials,patch,joints}.py
    tests/test_coupling_{damping,fit,reduced_wall}.py tests/test_dem_{ends,kernels}.py
    tests/test_dem_damping.py::test_velocities_are_those_of_an_independent_stiff_integrator)
found='import numpy; print(*numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", []))'
instructions=$("$python" -c "$found")
beyond_avx2=$(tr ' ' '\n' <<<"$instructions" | grep -vxE 'X86_V3|AVX|AVX2|FMA3|F16C' | tr '\n' ' ' || true)

as_on() { # name, kernels of BLAS, instructions that numpy leaves out, processor that numba compiles for
    echo "+ $1"
    OPENBLAS_NUM_THREADS=1 OPENBLAS_CORETYPE=$2 NPY_DISABLE_CPU_FEATURES=$3 NUMBA_CPU_NAME=$4 NUMBA_CPU_FEATURES='' \
        NUMBA_CACHE_DIR=$code/$4 "$python" -m pytest -p no:cacheprovider "${tests[@]}" "${@:5}"
}

if grep -qw avx2 /proc/cpuinfo; then
    as_on "a processor with AVX2 and without AVX-512" Haswell "$beyond_avx2" x86-64-v3 "$@"
fi
as_on "a processor with SSE alone" Prescott "$instructions" generic "$@"
