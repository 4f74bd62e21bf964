"""Settings and machines for all tests."""

import os

from hypothesis import Phase, settings

from tests.rigs.files import machine
from tests.rigs.forwarder import changed_rig, rig

__all__ = ["changed_rig", "machine", "rig"]
pytest_plugins = ["tests.budget", "pytester"]

# No time limit per example: machines are noisy. On a build machine the examples are the same every
# time, so that a red run can be repeated; elsewhere every run tries new ones.
settings.register_profile("canshaper", deadline=None, derandomize="CI" in os.environ)
# For the coverage gate: few examples, always the same.
settings.register_profile("few", deadline=None, derandomize=True, max_examples=10)
# For the mutation run: the first failure is enough, without a smaller example.
settings.register_profile(
    "mutants", settings.get_profile("few"), phases=(Phase.explicit, Phase.generate)
)
settings.load_profile("canshaper")
