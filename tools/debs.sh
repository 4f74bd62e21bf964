#!/bin/sh
# Build the Debian package for other releases and processors of Debian, and try each where it is for:
# tools/debs.sh SOURCE_DISTRIBUTION VERSION [SUITE/ARCHITECTURE ...] writes dist/*.deb.
#
# Each is built by tools/deb.sh in a root directory of that Debian (mmdebstrap), with its Python, then
# installed there and run. A foreign processor is emulated (qemu-user). No network but for Debian's
# packages: pip installs from wheels with the hashes of tools/deb/*requirements.txt, fetched before.
set -eu
umask 022
cd "$(dirname "$0")/.."
sdist=$1 version=$2
shift 2
work=$PWD/out/release

install_missing() {
    [ $# -gt 0 ] || return 0
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        echo "installing $*" >&2
        apt-get -q -y install --no-install-recommends "$@" >/dev/null 2>&1 ||
            { apt-get -q update >/dev/null && apt-get -q -y install "$@" >/dev/null; }
    else
        echo "building for other Debian releases needs, please install: $*" >&2
        exit 1
    fi
}

emulate() { # ARCHITECTURE: whether its programs run here
    [ "$1" = "$(dpkg --print-architecture)" ] || arch-test "$1" >/dev/null 2>&1 && return
    install_missing qemu-user-static binfmt-support arch-test
    mountpoint -q /proc/sys/fs/binfmt_misc ||
        mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc || true
    update-binfmts --enable "qemu-$(echo "$1" | sed s/arm64/aarch64/)" || true
    arch-test "$1" >/dev/null || {
        echo "programs of $1 do not run here: binfmt_misc and qemu-user-static have to be set up" >&2
        exit 1
    }
}

wheels() { # PYTHON MACHINE DIRECTORY
    for list in build-requirements requirements; do
        "$work/venv/bin/pip" download --quiet --disable-pip-version-check --require-hashes --no-deps \
            --only-binary :all: --python-version "$1" --platform "manylinux_2_28_$2" \
            --platform "manylinux_2_17_$2" --platform "manylinux2014_$2" --dest "$3" \
            -r "tools/deb/$list.txt"
    done
}

build() { # SUITE ARCHITECTURE
    case $1 in
        bookworm) python=3.11 release=deb12 ;;
        trixie) python=3.13 release=deb13 ;;
        *) echo "expected bookworm or trixie, got $1" >&2; exit 1 ;;
    esac
    emulate "$2"
    place=$work/$1-$2
    rm -rf "$place"
    mkdir -p "$place/source" "$place/wheels"
    tar -xzf "$sdist" --strip-components=1 -C "$place/source"
    wheels "$python" "$(echo "$2" | sed 's/arm64/aarch64/; s/amd64/x86_64/')" "$place/wheels"
    cat >"$place/source/build-here.sh" <<END
set -eu
export SOURCE_DATE_EPOCH=$SOURCE_DATE_EPOCH PIP_NO_INDEX=1 PIP_FIND_LINKS=/wheels
export DEBFULLNAME='${DEBFULLNAME:-canshaper}' DEBEMAIL='${DEBEMAIL:-canshaper@example.org}'
cd /source
tools/deb.sh '$version+$release'
dpkg --install dist/*.deb >/dev/null
canshaper --version
canshaper check /etc/canshaper/forwarder-robust.yaml | head -1
test -e /usr/share/doc/canshaper/html/index.html
END
    mmdebstrap --quiet --variant=minbase --architectures="$2" \
        --include=python3,python3-venv,dpkg-dev \
        --customize-hook='mkdir "$1/source" "$1/wheels"' \
        --customize-hook="sync-in $place/source /source" \
        --customize-hook="sync-in $place/wheels /wheels" \
        --customize-hook='env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin chroot "$1" sh /source/build-here.sh' \
        --customize-hook="sync-out /source/dist $PWD/dist" \
        "$1" /dev/null
    rm -rf "$place"
}

command -v mmdebstrap >/dev/null || install_missing mmdebstrap
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || date +%s)}
[ -x "$work/venv/bin/pip" ] || python3 -m venv "$work/venv"
mkdir -p dist
for target in "${@:-}"; do
    [ -n "$target" ] || continue
    build "${target%/*}" "${target#*/}"
done
