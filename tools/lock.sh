#!/bin/sh
# Write the lists of exact versions with hashes that packages and image are built from, with the newest
# versions that fit: tools/deb/requirements.txt for the daemon, tools/deb/build-requirements.txt for
# what builds and describes the package, tools/image/requirements.txt for desk work and the live page.
# All are kept in the repository.
set -eu
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pip-tools

compile() { # OUTPUT SOURCE [OPTIONS]
    output=$1 source=$2
    shift 2
    "$work/venv/bin/pip-compile" --quiet --upgrade --generate-hashes --strip-extras --allow-unsafe \
        --no-header --no-annotate --no-emit-index-url --no-emit-find-links --no-emit-trusted-host \
        --output-file "$output" "$@" "$source"
}
cp pyproject.toml "$work"
(cd "$work" && compile requirements.txt pyproject.toml)
(cd "$work" && compile image.txt pyproject.toml --extra tools --extra studio \
    --constraint requirements.txt)
printf 'hatchling>=1.24\ncyclonedx-python-lib>=11\n' >"$work/build.in"
(cd "$work" && compile build-requirements.txt build.in)
keep() { # NAME FILE
    { echo "# Written by tools/lock.sh; pip installs nothing else."
      cat "$work/$1.txt"; } >"$2"
}
keep requirements tools/deb/requirements.txt
keep build-requirements tools/deb/build-requirements.txt
keep image tools/image/requirements.txt
