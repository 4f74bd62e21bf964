"""A deployment read again while the loop goes on, in a process of its own."""

import logging
from collections.abc import Callable

from canshaper.daemon.config_reload import ConfigReload
from canshaper.machine.deployment import Deployment

log = logging.getLogger("canshaper")


class Reloads:
    """Steps of a reload, none of which the loop waits for.

    Args:
        load: reads the deployment; called in another process.
        refuse: called with why a reload changes nothing.

    Attributes:
        ready: the deployment that was read, and is good; None where there is none.
    """

    def __init__(self, load: Callable[[], Deployment], refuse: Callable[[str], object]) -> None:
        self._load = load
        self._refuse = refuse
        self._requested = False
        self._reading: ConfigReload | None = None
        self.ready: Deployment | None = None
        self._waiting_logged = False

    def request(self) -> None:
        """Begin one at the next step; a signal handler may call it."""
        self._requested = True

    def step(self, *, neutral: bool) -> None:
        """Go a step towards the deployment as its files are now.

        Nothing is begun or taken while something moves: a new process costs a tick a millisecond,
        and what was read may need modules that are not loaded yet.

        Args:
            neutral: nothing moves.
        """
        if not (self._requested or self._reading or self.ready):
            return
        if self._requested and neutral:
            self.end()  # of files that may have changed since
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
        """End what is being read, if something is."""
        if self._reading:
            self._reading.end()
            self._reading = None
