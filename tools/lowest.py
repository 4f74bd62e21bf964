"""Print the lowest versions that pyproject.toml declares for what `make versions` installs."""

import re
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
extras = project["optional-dependencies"]
requirements = {*project["dependencies"], *extras["tools"], *extras["studio"], *extras["dev"]}
for requirement in sorted(requirements):
    match = re.match(r"([\w-]+)(?:\[[^\]]*\])?>=([\w.]+)", requirement)
    if not match:
        raise SystemExit(f"pyproject.toml: {requirement}: expected a lowest version (>=)")
    print(f"{match[1]}=={match[2]}")
