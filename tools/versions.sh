#!/bin/sh
# The daemon's rooms at both ends of what pyproject.toml allows: the lowest version of every
# dependency on the oldest Python, and the newest of all on the newest Python that is here.
# Environments are in out/versions.
set -eu
cd "$(dirname "$0")/.."

pythons() { # every Python from 3.11 on that runs here, oldest first
    for minor in 11 12 13 14 15 16; do
        for candidate in "python3.$minor" "${PYENV_ROOT:-$HOME/.pyenv}/versions/3.$minor".*/bin/python; do
            if "$candidate" -c "import ensurepip, sys; sys.exit(sys.version_info[1] != $minor)" \
                2>/dev/null; then
                echo "$candidate"
                break
            fi
        done
    done
}

try() { # NAME PYTHON [PIP OPTIONS]
    name=$1 python=$2
    shift 2
    place=out/versions/$name
    echo "== $name: $("$python" --version)"
    "$python" -m venv --clear "$place"
    "$place/bin/pip" install --quiet --disable-pip-version-check "$@" \
        --editable ".[tools,studio,dev]"
    "$place/bin/canshaper" check config/forwarder.yaml >/dev/null
    "$place/bin/python" tools/quick.py --all
}

mkdir -p out/versions
oldest=$(pythons | head -1)
newest=$(pythons | tail -1)
[ -n "$oldest" ] || { echo "no Python from 3.11 on" >&2; exit 1; }
"$newest" tools/lowest.py >out/versions/lowest.txt
# Old libraries warn of each other.
PYTEST_ADDOPTS="-W ignore::DeprecationWarning" \
    try lowest "$oldest" --constraint out/versions/lowest.txt
try newest "$newest"
