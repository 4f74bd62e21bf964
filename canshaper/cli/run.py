"""``canshaper run``: the daemon."""

from canshaper.cli.common import CHANNEL, EXIT_NO_BUS, FILE, INTERFACE, fail, loader


def run(
    file: str = FILE,
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
) -> None:
    """Shape the joystick commands of a deployment until SIGTERM or Ctrl-C.

    SIGHUP reads the file again; it is applied when it is valid and every axis is in neutral. An
    interface that goes away is used again when it is back.

    Exit code 0 after a stop, 2 when the file is wrong, 3 when a bus cannot be opened.

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
    except DeploymentError as error:
        raise fail(error) from None
    except BusError as error:
        raise fail(error, EXIT_NO_BUS) from None
    daemon.run()
