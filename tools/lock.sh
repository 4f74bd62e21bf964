#!/bin/sh
# Write the lists of exact versions with hashes that tools/deb.sh installs from, with the newest
# versions that fit: tools/deb/requirements.txt for the daemon, tools/deb/build-requirements.txt for
# what builds and describes the package. Both are kept in the repository.
set -eu
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pip-tools

compile() { # OUTPUT SOURCE
    "$work/venv/bin/pip-compile" --quiet --upgrade --generate-hashes --strip-extras --allow-unsafe \
        --no-header --no-annotate --no-emit-index-url --no-emit-find-links --no-emit-trusted-host \
        --output-file "$1" "$2"
}
cp pyproject.toml "$work"
(cd "$work" && compile requirements.txt pyproject.toml)
printf 'hatchling>=1.24\ncyclonedx-python-lib>=11\n' >"$work/build.in"
(cd "$work" && compile build-requirements.txt build.in)
for name in requirements build-requirements; do
    { echo "# Written by tools/lock.sh; pip installs nothing else."
      cat "$work/$name.txt"; } >"tools/deb/$name.txt"
done
