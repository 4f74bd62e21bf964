"""The process around the controller: loop, buses, reload, service manager, control socket."""
