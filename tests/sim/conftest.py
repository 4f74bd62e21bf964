import json
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def reference() -> dict[str, Any]:
    """Numbers computed independently of this code for the corrected equations of the paper."""
    path = Path(__file__).parent.parent / "data" / "paper_reference.json"
    loaded: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return loaded
