#!/usr/bin/env bash
# The tests as on other processors of x86-64: BLAS, numpy and numba round differently where other
# instructions are used.
#
#   tests/tools/processors.sh                 tests near rounding as on each of them, a minute or two each
#   tests/tools/processors.sh sse             as on one: amd (AVX2), intel (AVX2), sse (SSE3 at most)
#   tests/tools/processors.sh in-turn         as on one, another one after each commit
#   tests/tools/processors.sh sse --quick     the whole quick suite, a quarter of an hour
#   tests/tools/processors.sh sse tests/rom/test_parts.py -x     some tests, with options of pytest
#   PYTHON=python3.12 tests/tools/processors.sh amd
set -euo pipefail
cd "$(dirname "$0")/../.."
[ "$(uname -m)" = x86_64 ] || { echo "processors.sh: the processors are those of x86-64; nothing is run" >&2; exit 0; }
python=${PYTHON:-.venv/bin/python}
every=(amd intel sse)
grep -qw avx2 /proc/cpuinfo || every=(sse)

case "${1:-}" in
    in-turn) names=("${every[$(($(git rev-list --count HEAD 2>/dev/null || date +%-j) % ${#every[@]}))]}") && shift ;;
    amd | intel | sse) names=("$1") && shift ;;
    *) names=("${every[@]}") ;;
esac

case "${1:-}" in
    --quick) shift ;;
    "") set -- tests/rom/test_{reduction,parts,reduced_model}.py \
        tests/fem/test_{factorisation,beam,elasticity,materials,contact_patch,joints}.py \
        tests/coupling/test_{damping,reduced_wall}.py tests/fit/test_fit.py \
        tests/dem/test_{ends,kernels}.py \
        tests/workflows/test_shaken_extremes.py \
        tests/dem/test_damping.py::test_velocities_are_those_of_an_independent_stiff_integrator ;;
esac

code=$(mktemp -d)
trap 'rm -rf "$code"' EXIT
found='import numpy; print(*numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", []))'
instructions=$("$python" -c "$found")
beyond_avx2=$(tr ' ' '\n' <<<"$instructions" | grep -vxE 'X86_V3|AVX|AVX2|FMA3|F16C' | tr '\n' ' ' || true)

as_on() { # name, kernels of BLAS, instructions that numpy leaves out, processor and features of numba
    echo "+ tests as on another processor: $1"
    OPENBLAS_NUM_THREADS=1 OPENBLAS_CORETYPE=$2 NPY_DISABLE_CPU_FEATURES=$3 NUMBA_CPU_NAME=$4 NUMBA_CPU_FEATURES=$5 \
        NUMBA_CACHE_DIR=$code/$1 "$python" -m pytest -p no:cacheprovider "${@:6}"
}

for name in "${names[@]}"; do
    case $name in
        amd) as_on amd Zen "$beyond_avx2" znver3 -sse4a "$@" ;; # sse4a: AMD's alone
        intel) as_on intel Haswell "$beyond_avx2" haswell '' "$@" ;;
        sse) as_on sse Prescott "$instructions" generic '' "$@" ;;
    esac
done
