"""Settings and machines for all tests."""

import os

from hypothesis import settings

from tests.rigs.files import machine
from tests.rigs.forwarder import changed_rig, rig

__all__ = ["changed_rig", "machine", "rig"]

# No time limit per example: machines are noisy. On a build machine the examples are the same every
# time, so that a red run can be repeated; elsewhere every run tries new ones.
settings.register_profile("canshaper", deadline=None, derandomize="CI" in os.environ)
# For the coverage gate and the mutation run: few examples, always the same.
settings.register_profile("few", deadline=None, derandomize=True, max_examples=10)
settings.load_profile("canshaper")
