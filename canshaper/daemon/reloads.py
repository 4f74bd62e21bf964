"""Steps of a reload: a forked process reads the deployment while the loop continues."""

import logging
from collections.abc import Callable

from canshaper.daemon.config_reload import ConfigReload
from canshaper.machine.deployment import Deployment

log = logging.getLogger("canshaper")


class Reloads:
    """Reload of a deployment, in steps for which the loop does not wait.

    Args:
        load: reads the deployment; called in a forked process.
        refuse: called with the reason of a refused reload.

    Attributes:
        ready: valid deployment that was read and waits to be applied; None without one.
    """

    def __init__(self, load: Callable[[], Deployment], refuse: Callable[[str], object]) -> None:
        self._load = load
        self._refuse = refuse
        self._requested = False
        self._reading: ConfigReload | None = None
        self.ready: Deployment | None = None
        self._waiting_logged = False

    def request(self) -> None:
        """Begin a reload at the next step in neutral; a signal handler may call this."""
        self._requested = True

    def step(self, *, neutral: bool) -> None:
        """Take one step: begin to read, or take the result into ``ready``, or refuse.

        No step is taken while an axis moves: a fork costs a tick a millisecond, and the deployment
        may need modules that are not loaded yet.

        Args:
            neutral: whether every axis is neutral.
        """
        if not (self._requested or self._reading or self.ready):
            return
        if self._requested and neutral:
            self.end()  # the files may have changed since it began
            self._requested, self.ready = False, None
            try:
                self._reading = ConfigReload(self._load)
            except OSError as error:
                self._refuse(f"cannot read: {error.strerror}")
        elif self._reading and neutral and (result := self._reading.result()) is not None:
            self._reading = None
            if isinstance(result, Deployment):
                self.ready = result
            else:
                self._refuse(result)
        waiting = not neutral and bool(self._requested or self._reading or self.ready)
        if waiting and not self._waiting_logged:
            log.info("reload=waiting until every axis is neutral")
        self._waiting_logged = waiting

    def end(self) -> None:
        """Stop reading, if a process reads."""
        if self._reading:
            self._reading.end()
            self._reading = None
