"""``python -m canshaper``."""

from canshaper.cli.app import main

main()
