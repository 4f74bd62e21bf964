"""Settings for all tests."""

import os

from hypothesis import settings

# No time limit per example: machines are noisy. On a build machine the examples are the same every
# time, so that a red run can be repeated; elsewhere every run tries new ones.
settings.register_profile("canshaper", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("canshaper")
