#!/bin/sh
# Build a container image for desk work and continuous integration: tools/image.sh [WHEEL] writes
# dist/canshaper-VERSION.oci.tar, an OCI archive, which podman load reads.
#
# A minimal Debian from its own packages (mmdebstrap), Python packages in exact versions with hashes
# (tools/image/requirements.txt), the wheel. Needs root, or a user that may map users; no registry of
# images. What was written is tried: check, demo, the live page and the docs run in it.
set -eu
umask 022
cd "$(dirname "$0")/.."
suite=trixie python=3.13
work=$PWD/out/image
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
export SOURCE_DATE_EPOCH

missing=
for tool in mmdebstrap buildah; do
    command -v $tool >/dev/null || missing="$missing $tool"
done
[ -z "$missing" ] || if [ "$(id -u)" = 0 ]; then
    echo "installing$missing" >&2
    apt-get -q update >/dev/null && apt-get -q -y install --no-install-recommends $missing >/dev/null
else
    echo "building the image needs, please install:$missing" >&2
    exit 1
fi

rm -rf "$work"
mkdir -p "$work/wheels" dist
python3 -m venv "$work/venv"
"$work/venv/bin/pip" download --quiet --disable-pip-version-check --require-hashes --no-deps \
    --only-binary :all: --python-version "$python" --platform manylinux_2_28_x86_64 \
    --platform manylinux_2_27_x86_64 --platform manylinux_2_17_x86_64 --platform manylinux2014_x86_64 \
    --dest "$work/wheels" -r tools/image/requirements.txt
if [ $# -gt 0 ]; then
    cp "$1" "$work/wheels"
else
    "$work/venv/bin/pip" install --quiet --disable-pip-version-check --require-hashes \
        -r tools/deb/build-requirements.txt
    "$work/venv/bin/hatchling" build --target wheel --directory "$work/wheels" >/dev/null
fi
wheel=$(echo "$work"/wheels/canshaper-*.whl)
cat >"$work/install.sh" <<END
set -eu
python3 -m venv --without-pip /opt/canshaper
python3 -m venv /tmp/pip
/tmp/pip/bin/pip --python /opt/canshaper/bin/python install --quiet --no-index --no-deps --no-compile \\
    /wheels/*.whl
useradd --create-home --uid 1000 canshaper
install -d -o canshaper /work
rm -rf /tmp/pip /wheels /install.sh /var/log/apt /var/log/*.log /var/cache/ldconfig/aux-cache
END
mmdebstrap --quiet --variant=minbase --architectures=amd64 --include=python3,python3-venv,iproute2 \
    --customize-hook='mkdir "$1/wheels"' \
    --customize-hook="sync-in $work/wheels /wheels" \
    --customize-hook="upload $work/install.sh /install.sh" \
    --customize-hook='env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin chroot "$1" sh /install.sh' \
    "$suite" "$work/rootfs.tar"

# A store of its own; the image stays in no other.
buildah() {
    command buildah --root "$work/store" --runroot "$work/run" --storage-driver vfs "$@"
}
buildah build --quiet --isolation chroot --timestamp "$SOURCE_DATE_EPOCH" --tag canshaper \
    --file tools/image/Containerfile "$work" >/dev/null

archive=dist/$(basename "$wheel" | cut -d- -f1-2).oci.tar
rm -f "$archive"
buildah push --quiet canshaper "oci-archive:$archive:canshaper"

# What was written is what is tried.
one=$(buildah from "oci-archive:$archive")
try() { buildah run --isolation chroot "$one" -- "$@"; }
try canshaper --version
try canshaper check forwarder-robust.yaml >"$work/check.txt"
try canshaper demo --lockstep >"$work/demo.txt"
grep "residual sway" "$work/demo.txt"
try python3 - <tools/image/try.py
ls -l "$archive"
