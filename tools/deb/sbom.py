"""Bill of materials of an installed canshaper, CycloneDX 1.6: ``sbom.py DIRECTORY VERSION``.

Python packages as they lie in the directory, and the JavaScript libraries of the live page and of
the site. The same content gives the same bytes; SOURCE_DATE_EPOCH is its time.
"""

import json
import os
import re
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import distributions
from pathlib import Path
from uuid import NAMESPACE_URL, uuid5

from bundled import licence
from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

BANNER = re.compile(r"/\* ([\w-]+) (\S+), (\w+) licence")
THEME = re.compile(r"([\w-]+)-([\d.]+)\.LICENSE")
LICENCES = LicenseFactory()


def packages(library: Path) -> Iterator[Component]:
    """Yield the Python packages in a directory, but for canshaper itself."""
    for one in sorted(distributions(path=[str(library)]), key=lambda d: d.name.lower()):
        if one.name != "canshaper":
            yield Component(
                name=one.name,
                version=one.version,
                type=ComponentType.LIBRARY,
                licenses=[LICENCES.make_from_string(licence(one))],
                purl=PackageURL("pypi", name=one.name.lower(), version=one.version),
            )


def scripts(vendor: Path) -> Iterator[Component]:
    """Yield the JavaScript libraries in a folder, by the banner in the first line of each file.

    Raises:
        SystemExit: a file has no banner.
    """
    for path in sorted(vendor.glob("*.js")):
        with path.open(encoding="utf-8") as file:
            banner = BANNER.match(file.readline())
        if banner is None:
            raise SystemExit(f"{path}: no banner with name, version and licence in its first line")
        name, version, terms = banner.groups()
        yield Component(
            name=name,
            version=version,
            type=ComponentType.LIBRARY,
            licenses=[LICENCES.make_from_string(terms)],
            purl=PackageURL("npm", name=name, version=version),
            hashes=[
                HashType(alg=HashAlgorithm.SHA_256, content=sha256(path.read_bytes()).hexdigest())
            ],
        )


def theme(site: Path) -> Iterator[Component]:
    """Yield the theme of the site, by the name of the file with its licence; none without one."""
    for path in sorted((site / "assets").glob("*.LICENSE")):
        if named := THEME.fullmatch(path.name):
            yield Component(
                name=named[1],
                version=named[2],
                type=ComponentType.LIBRARY,
                licenses=[LICENCES.make_from_string("MIT")],
                purl=PackageURL("pypi", name=named[1], version=named[2]),
            )


def bill(library: Path, version: str) -> str:
    """Return the bill of canshaper VERSION and of all in ``library``, as JSON."""
    root = Component(
        name="canshaper",
        version=version,
        type=ComponentType.APPLICATION,
        licenses=[LICENCES.make_from_string("Apache-2.0")],
        purl=PackageURL("pypi", name="canshaper", version=version),
    )
    program, site = library / "canshaper", library / "canshaper" / "data" / "site"
    vendored = scripts(program / "studio" / "static" / "vendor")
    parts = [*packages(library), *vendored, *scripts(site / "site"), *theme(site)]
    for one in (root, *parts):
        one.bom_ref.value = str(one.purl)  # a random one would be another in every build
    bom = Bom(components=parts)
    bom.metadata.component = root
    bom.register_dependency(root, parts)
    names = ",".join(str(one.purl) for one in (root, *parts))
    bom.serial_number = uuid5(NAMESPACE_URL, names)
    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    bom.metadata.timestamp = datetime.fromtimestamp(epoch, UTC)
    return json.dumps(json.loads(JsonV1Dot6(bom).output_as_string()), indent=2) + "\n"


if __name__ == "__main__":
    sys.stdout.write(bill(Path(sys.argv[1]), sys.argv[2]))
