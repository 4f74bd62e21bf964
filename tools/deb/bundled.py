"""One line of the copyright file for each bundled Python package: ``bundled.py DIRECTORY``."""

import sys
from importlib.metadata import Distribution, distributions

LONGEST_NAME = 60  # some packages put the whole text of the licence where its name belongs


def licence(package: Distribution) -> str:
    """Return the licence's name, from the newest of the fields that packages have used for it.

    Raises:
        SystemExit: no field has a name of less than 60 letters.
    """
    classifiers = package.metadata.get_all("Classifier") or []
    named = [c.rpartition(" :: ")[2] for c in classifiers if c.startswith("License ::")]
    names = ("License-Expression", "License")
    fields = [field for name in names for field in package.metadata.get_all(name) or []]
    for field in (*fields, *named):
        if field and len(field) < LONGEST_NAME and field != "UNKNOWN":
            return str(field)
    raise SystemExit(f"{package.name} does not say its licence")


def main() -> None:
    """Print a line for each package in the directory that the command line names."""
    for package in sorted(distributions(path=[sys.argv[1]]), key=lambda p: p.name.lower()):
        print(f" {package.name} {package.version}: {licence(package)}")


if __name__ == "__main__":
    main()
