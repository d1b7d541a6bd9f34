"""Before anything loads BLAS: its threads fight over the small blocks of sparse factors."""

import signal
from os import environ

environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# tests that start in the background inherit an ignored Ctrl-C, and so would the runs that they stop
signal.signal(signal.SIGINT, signal.default_int_handler)
