"""``canshaper run``: the daemon."""

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
    from canshaper.service import journal
    from canshaper.service.daemon import Daemon

    journal.set_up()
    try:
        daemon = Daemon(loader(file, interface, channel))
    except (DeploymentError, BusError) as error:
        raise fail(error) from None
    daemon.run()
