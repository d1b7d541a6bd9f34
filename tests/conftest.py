"""Before anything loads BLAS: its threads fight over the small blocks of sparse factors."""

from os import environ

environ.setdefault("OPENBLAS_NUM_THREADS", "1")
