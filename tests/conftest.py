"""What all tests share."""

import os
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

# A process for each core runs tests; more threads would only turn in circles for a core that is taken. What must hold
# with any number of threads asks for them itself. Read when NumPy and OpenCV are loaded, here and in the processes
# that tests start; not OPENBLAS_NUM_THREADS, which would win over what such a test says.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")

# Bytecode is kept, whatever the shell says: or every process that a test starts compiles all that it imports anew, and
# pytest every test, which is a tenth of the time of the suite.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# The first call of a kernel compiles it; how long that takes is no property of the code under test.
settings.register_profile("perdure", deadline=None, derandomize=True)
settings.load_profile("perdure")


@pytest.fixture(autouse=True, scope="session")
def no_power_cut() -> Iterator[None]:
    """What is written need not be on the disk before a test goes on: others read it without."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, "fsync", lambda _: None)
        yield
