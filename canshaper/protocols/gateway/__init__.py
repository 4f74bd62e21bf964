"""An inline gateway between joysticks and the machine: the kernel's rules, forwarding."""
