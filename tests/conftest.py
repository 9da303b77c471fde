"""Workers share the processors: each keeps to one thread, or NumPy's would wait for each other's."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
