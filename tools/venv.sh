#!/bin/sh
# Make the virtual environment and install canshaper with the extras given: tools/venv.sh tools,dev
set -eu
cd "$(dirname "$0")/.."
export DEBIAN_FRONTEND=noninteractive PIP_DISABLE_PIP_VERSION_CHECK=1

find_python() {
    for candidate in ${PYTHON:-} python3 python3.14 python3.13 python3.12 python3.11; do
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
            echo "== installed on this system: $package (apt-get)"
            apt-get -q -y install "$package" >/dev/null 2>&1 ||
                { apt-get -q update >/dev/null && apt-get -q -y install "$package" >/dev/null; }
        else
            echo "this Python cannot make virtual environments; please install $package" >&2
            exit 1
        fi
    fi
    echo "== making .venv with $("$python" --version)"
    "$python" -m venv .venv
fi
echo "== installing canshaper[$1] into .venv, nothing outside of it"
# uv takes a tenth of pip's time; where it cannot be had, or does not reach what pip is set up for,
# pip does it. Compiled now, since the emulated machine of the tests compiles slowly.
uv=$(command -v uv || echo .venv/bin/uv)
[ -x "$uv" ] || .venv/bin/python -m pip install --quiet uv || true
[ -z "${PIP_CERT:-}" ] || export SSL_CERT_FILE="${SSL_CERT_FILE:-$PIP_CERT}"
if ! { [ -x "$uv" ] && "$uv" pip install --python .venv/bin/python --compile-bytecode \
    --editable ".[$1]"; }; then
    echo "== with pip"
    .venv/bin/python -m pip install --editable ".[$1]"
fi
