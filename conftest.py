"""What holds for all tests here: none judges how fast this machine is, byte code stays, algebra has one thread.

Nor does any see the calibrations and the settings of the user who runs them.
"""

import gc
import os
import sys
from tempfile import TemporaryDirectory

from hypothesis import HealthCheck, settings

# On top of what hypothesis itself chooses for a CI, where each property is tried with the full number of examples.
settings.register_profile(
    "any-machine",
    settings.default,
    max_examples=settings.default.max_examples if os.environ.get("CI") else 15,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("any-machine")

# Modules and syntax trees stay: to search them for cycles again and again took three quarters of the time of parsing.
gc.set_threshold(50_000, 20, 50)

# Also where the environment says no: else every process that a test starts would compile all it imports anew, and
# pytest would rewrite every file of tests in each worker of each run.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Before numpy is imported: the arrays of tests are small, and idle threads of the algebra spin on cores of others.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

_FOLDER = TemporaryDirectory(prefix="graspsense-tests-")
for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
    os.environ[name] = _FOLDER.name


def pytest_collection_finish() -> None:
    """Leave all that is imported by now out of every later search for cycles."""
    gc.freeze()
