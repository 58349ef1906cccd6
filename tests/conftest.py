"""What all tests share."""

from hypothesis import settings

# The first call of a kernel compiles it; how long that takes is no property of the code under test.
settings.register_profile("perdure", deadline=None, derandomize=True)
settings.load_profile("perdure")
