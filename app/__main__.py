"""Entry of the command `patina` and of ``python -m app``."""

import os

# Threaded BLAS gains nothing on our small systems, and stalls for seconds on a busy machine.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from app.cli import main  # noqa: E402

if __name__ == "__main__":
    main()
