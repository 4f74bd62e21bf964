"""The black box of a daemon in a test, at its end: as it would be read from its files."""

import pickle
from pathlib import Path
from typing import Any

from canshaper.blackbox import keeper
from canshaper.blackbox.file import Box, chunks, read_box
from canshaper.blackbox.recorder import Recorder
from canshaper.blackbox.write import header_of
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.deployment import Deployment


class Kept(keeper.BlackBox):
    """Keeps what a daemon has recorded, for every deployment that it had."""

    boxes: list[tuple[bytes, bytes]]  # deployment before it was used, box

    def __init__(self, folder: Path | None = None) -> None:
        super().__init__(folder)
        self.boxes = []
        self._fresh = b""

    def around(
        self, gated: GatedController, controller: Controller, kind: type[Recorder] = Recorder
    ) -> Recorder:
        deployment = controller.deployment
        if self._deployment and self._deployment.identity != deployment.identity:
            self._keep()
        self._fresh = pickle.dumps(deployment)
        return super().around(gated, controller, kind)

    def close(self) -> None:
        self._keep()
        super().close()

    def _keep(self) -> None:
        assert self._deployment is not None
        self._flush()
        header: dict[str, Any] = header_of(self._deployment, self._why)
        self.boxes.append((self._fresh, b"".join(chunks(header, self._ring.segments))))


def unpacked(one: tuple[bytes, bytes], folder: Path) -> tuple[Deployment, Box]:
    """A deployment as it was read, and the black box of its daemon."""
    path = folder / "test.blackbox"
    path.write_bytes(one[1])
    deployment = pickle.loads(one[0])
    assert isinstance(deployment, Deployment)
    return deployment, read_box(path)
