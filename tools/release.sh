#!/bin/sh
# Build what is released into dist/: tools/release.sh [SUITE/ARCHITECTURE ...]
#
# Source distribution, the wheel that is made from it, Debian packages for each Debian and processor
# (default: bookworm and trixie, amd64 and arm64), for each package its bill of materials (CycloneDX),
# the licences of all that is bundled, a container image, and SHA256SUMS. Run by make release, which builds the site and
# the manual pages first. The same commit gives the same bytes.
set -eu
umask 022
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- bookworm/amd64 bookworm/arm64 trixie/amd64 trixie/arm64
work=$PWD/out/release
[ -z "$(git status --porcelain)" ] || {
    echo "there are changes that are not committed; a release is what a commit has" >&2
    exit 1
}
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH PIP_DISABLE_PIP_VERSION_CHECK=1

rm -rf dist "$work"
mkdir -p dist "$work/source"
.venv/bin/python -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --require-hashes -r tools/deb/build-requirements.txt
"$work/venv/bin/hatchling" build --target sdist --directory dist >/dev/null
sdist=$(echo dist/*.tar.gz)
tar -xzf "$sdist" --strip-components=1 -C "$work/source"
(cd "$work/source" && "$work/venv/bin/hatchling" build --target wheel --directory "$OLDPWD/dist") \
    >/dev/null
wheel=$(echo dist/*.whl)

# As a user has it: a new environment, an empty directory, no repository.
.venv/bin/python -m venv "$work/user"
"$work/user/bin/pip" install --quiet "$wheel[tools,studio]"
mkdir "$work/empty"
(
    cd "$work/empty"
    PATH=$work/user/bin:$PATH
    canshaper demo --lockstep >/dev/null
    canshaper studio --help >/dev/null
    mkfifo pages
    canshaper docs --port 0 >pages &
    exec 3<pages # open until the end: it has more to say than its address
    read -r _ url _ <&3
    python -c "from urllib.request import urlopen; assert b'canshaper' in urlopen('$url').read()"
    kill $!
)
echo "$wheel runs demo, studio and docs in an empty directory"

tools/image.sh "$wheel"

version=$(.venv/bin/python tools/version.py)
tools/debs.sh "$sdist" "$(echo "$version" | sed 's/\.dev/~dev/')" "$@"

for package in dist/*.deb; do
    rm -rf "$work/package"
    dpkg-deb -x "$package" "$work/package"
    cp "$work/package/usr/share/doc/canshaper/sbom.cdx.json" "${package%.deb}.cdx.json"
done
.venv/bin/python tools/deb/licences.py "$work/package/usr/lib/canshaper" \
    >"dist/canshaper-$version.licences.txt"
(cd dist && LC_ALL=C sha256sum ./* | sed 's|\./||' >SHA256SUMS)
cat dist/SHA256SUMS
