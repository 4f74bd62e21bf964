#!/bin/sh
# Make the virtual environment and install canshaper with the extras given: tools/venv.sh tools,dev
set -eu
cd "$(dirname "$0")/.."

find_python() {
    for candidate in ${PYTHON:-} python3 python3.13 python3.12 python3.11; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    echo "canshaper needs Python 3.11 or newer; install one or name it: make PYTHON=/path/to/python" >&2
    exit 1
}

if [ ! -x .venv/bin/python ]; then
    python=$(find_python)
    # Debian and Ubuntu split venv and pip from Python.
    if ! "$python" -c 'import ensurepip' 2>/dev/null; then
        package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
        if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
            echo "installing $package"
            apt-get -q -y install "$package" >/dev/null 2>&1 ||
                { apt-get -q update >/dev/null && apt-get -q -y install "$package" >/dev/null; }
        else
            echo "this Python cannot make virtual environments; please install $package" >&2
            exit 1
        fi
    fi
    echo "making .venv"
    "$python" -m venv .venv
fi
echo "installing canshaper[$1] into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --editable ".[$1]"
