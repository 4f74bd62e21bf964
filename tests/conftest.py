"""Settings and machines for all tests."""

import os

from hypothesis import HealthCheck, Phase, settings

from tests.rigs.files import machine
from tests.rigs.forwarder import changed_rig, rig

__all__ = ["changed_rig", "machine", "rig"]
pytest_plugins = ["tests.budget", "pytester"]

# No time limit, not even for making the first examples: machines are noisy. On a build machine they
# are the same every time, so that a red run can be repeated; else every run has new ones.
settings.register_profile(
    "canshaper",
    deadline=None,
    derandomize="CI" in os.environ,
    suppress_health_check=[HealthCheck.too_slow],
)
base = settings.get_profile("canshaper")
# For `make test`, whose result depends on the code alone.
settings.register_profile("repeatable", base, derandomize=True)
# For the coverage gate: few examples, always the same.
settings.register_profile("few", base, derandomize=True, max_examples=10)
# For the mutation run: the first failure is enough, without a smaller example.
settings.register_profile(
    "mutants", settings.get_profile("few"), phases=(Phase.explicit, Phase.generate)
)
settings.load_profile("canshaper")
