"""``canshaper run``: the daemon."""

import logging
import sys

from canshaper.cli.common import CHANNEL, FILE, INTERFACE, fail, loader


def run(
    file: str = FILE,
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
) -> None:
    """Shape the joystick commands of a deployment until SIGTERM or Ctrl-C.

    SIGHUP reads the file again; it is applied when it is valid and every axis is in neutral.

    Examples:

      canshaper run config/forwarder.yaml

      canshaper run config/forwarder.yaml --interface socketcan --channel can0
    """
    from canshaper.can.bus import BusError
    from canshaper.config.source import DeploymentError
    from canshaper.service.daemon import Daemon

    logging.basicConfig(
        stream=sys.stderr, level=logging.WARNING, format="%(asctime)s %(levelname)s %(message)s"
    )
    logging.getLogger("canshaper").setLevel(logging.INFO)
    try:
        daemon = Daemon(loader(file, interface, channel))
    except (DeploymentError, BusError) as error:
        raise fail(error) from None
    daemon.run()
