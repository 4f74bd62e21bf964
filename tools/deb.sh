#!/bin/sh
# Build the Debian package: tools/deb.sh [VERSION] writes dist/canshaper_VERSION_ARCH.deb and prints
# its name.
#
# Everything the daemon needs but Python itself lies in /usr/lib/canshaper, so the package neither
# uses nor disturbs Python packages of the system. It fits the Python of the machine it was built on.
# With the site and the manual pages in it where these were built: make deb does that.
# Plain dpkg-deb with the files of tools/deb: no root, no debhelper. DEBFULLNAME and DEBEMAIL name
# the maintainer; SOURCE_DATE_EPOCH the time, else that of the last commit.
set -eu
umask 022
cd "$(dirname "$0")/.."

python=/usr/bin/python3 # the system's: the package runs with it
work=out/deb
root=$work/root
library=$root/usr/lib/canshaper
documents=$root/usr/share/doc/canshaper

install_missing() {
    [ $# -gt 0 ] || return 0
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        echo "installing $*" >&2
        apt-get -q -y install --no-install-recommends "$@" >/dev/null 2>&1 ||
            { apt-get -q update >/dev/null && apt-get -q -y install "$@" >/dev/null; }
    else
        echo "building the Debian package needs, please install: $*" >&2
        exit 1
    fi
}

missing=
[ -x "$python" ] || missing="$missing python3 python3-venv"
command -v dpkg-shlibdeps >/dev/null || missing="$missing dpkg-dev"
install_missing $missing
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "canshaper needs Python 3.11 or newer as $python" >&2
    exit 1
}
minor=$("$python" -c 'import sys; print(sys.version_info.minor)')
"$python" -c 'import ensurepip' 2>/dev/null || install_missing "python3.$minor-venv"

# What comes before a release is less than it: 0.2.0~dev5+gabcdef0 for dpkg.
version=${1:-$("$python" tools/version.py | sed 's/\.dev/~dev/')}
architecture=$(dpkg --print-architecture)
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || date +%s)}
export SOURCE_DATE_EPOCH PYTHONHASHSEED=0

rm -rf "$work"
mkdir -p "$library" "$documents" "$root/DEBIAN" "$root/usr/bin" \
    "$root/usr/share/canshaper" "$root/lib/systemd/system" "$root/etc/canshaper/dbc" \
    "$root/usr/share/lintian/overrides" dist

# The daemon and what it imports. dpkg keeps the list of files; pip's own lists would name this
# directory.
"$python" -m venv "$work/venv"
pip_install() { "$work/venv/bin/pip" install --quiet --disable-pip-version-check "$@"; }
# Exact versions with hashes (tools/lock.sh): the same package today and in a year, or none.
pip_install --require-hashes -r tools/deb/build-requirements.txt
pip_install --no-compile --require-hashes --target "$library" -r tools/deb/requirements.txt
pip_install --no-compile --no-deps --no-build-isolation --target "$library" --upgrade .
rm -rf "$library/bin" "$library"/*.dist-info/RECORD "$library"/*.dist-info/direct_url.json
find "$library" -name '*.py[ci]' -delete
# One copy of the shipped deployments, where an administrator looks for it.
mv "$library/canshaper/data/config" "$library/canshaper/data/dbc" "$root/usr/share/canshaper"
if [ -d "$library/canshaper/data/site" ]; then
    mv "$library/canshaper/data/site" "$root/usr/share/canshaper"
    ln -s ../../canshaper/site "$documents/html"
    mv "$library/share/man" "$root/usr/share"
    gzip -9n "$root/usr/share/man/man1"/*
    rmdir "$library/share"
else
    echo "without site and manual pages: make deb builds them" >&2
fi
rmdir "$library/canshaper/data"
ln -s ../../../share/canshaper "$library/canshaper/data"
mv "$root/usr/share/canshaper/config/systemd"/*.service "$root/lib/systemd/system"
mv "$root/usr/share/canshaper/config/systemd"/*.conf "$root/usr/share/canshaper"
mv "$root/usr/share/canshaper/config/networkd" "$root/usr/share/canshaper/config/udev" \
    "$root/usr/share/canshaper"
rmdir "$root/usr/share/canshaper/config/systemd"

# The administrator's copies: DBC files in a directory beside the deployments.
cp "$root/usr/share/canshaper/dbc"/* "$root/etc/canshaper/dbc"
for file in $(grep -l '^dbc:' "$root/usr/share/canshaper/config"/*.yaml); do
    sed -e 's|\.\./dbc/|dbc/|g' -e 's|\bconfig/\([a-z0-9-]*\.yaml\)|/etc/canshaper/\1|g' \
        "$file" >"$root/etc/canshaper/${file##*/}"
done

sed "s|@LIBRARY@|/usr/lib/canshaper|" tools/deb/canshaper >"$root/usr/bin/canshaper"
chmod 755 "$root/usr/bin/canshaper"
cp docs/*.md SECURITY.md "$documents"
"$work/venv/bin/python" tools/deb/sbom.py "$library" "$version" \
    >"$documents/sbom.cdx.json"
cp tools/deb/lintian-overrides "$root/usr/share/lintian/overrides/canshaper"
{ cat tools/deb/copyright && "$python" tools/deb/bundled.py "$library"; } >"$documents/copyright"
maintainer="${DEBFULLNAME:-canshaper} <${DEBEMAIL:-canshaper@example.org}>"
gzip -9n >"$documents/changelog.gz" <<END
canshaper ($version) unstable; urgency=medium

  * Version $version of canshaper.

 -- $maintainer  $(LC_ALL=C date -u -R -d "@$SOURCE_DATE_EPOCH")
END

# Same content, same package: bytecode that does not depend on times, and fixed times.
"$python" -m compileall -q -s "$root" --invalidation-mode unchecked-hash "$library"
sed "s|@LIBRARY@|$PWD/$library|" tools/deb/canshaper >"$work/canshaper"
for shell in bash zsh fish; do
    _CANSHAPER_COMPLETE=source_$shell "$python" -ISB "$work/canshaper" >"$work/completion.$shell"
done
install -D -m 644 "$work/completion.bash" "$root/usr/share/bash-completion/completions/canshaper"
install -D -m 644 "$work/completion.zsh" "$root/usr/share/zsh/vendor-completions/_canshaper"
install -D -m 644 "$work/completion.fish" "$root/usr/share/fish/vendor_completions.d/canshaper.fish"
# The administrator's copies must be good as they lie there.
for file in "$root"/etc/canshaper/*.yaml; do
    "$python" -ISB "$work/canshaper" check "$file" >/dev/null
done

find "$root" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
find "$root" -name '*.so' -exec chmod 644 {} +

# C libraries that the binary parts need, from the libraries themselves.
mkdir -p "$work/debian"
printf 'Source: canshaper\n\nPackage: canshaper\nArchitecture: any\n' >"$work/debian/control"
libraries=$(cd "$work" && find "$PWD/root" -name '*.so' -exec dpkg-shlibdeps -O {} + \
    2>shlibdeps.log | sed -n 's/^shlibs:Depends=//p')
[ -n "$libraries" ] || {
    cat "$work/shlibdeps.log" >&2
    exit 1
}

# As dpkg counts: KiB of each file, and one for everything else.
size=$(find "$root" -path "$root/DEBIAN" -prune -o -printf '%y %s\n' |
    awk '{ n += $1 == "f" ? int(($2 + 1023) / 1024) : 1 } END { print n }')
sed -e "s%@VERSION@%$version%" -e "s%@ARCHITECTURE@%$architecture%" \
    -e "s%@MAINTAINER@%$maintainer%" -e "s%@LIBRARIES@%$libraries%" \
    -e "s%@MINOR@%$minor%" -e "s%@NEXT@%$((minor + 1))%" \
    -e "s%@SIZE@%$size%" \
    tools/deb/control >"$root/DEBIAN/control"
for script in postinst prerm postrm; do
    install -m 755 "tools/deb/$script" "$root/DEBIAN"
done
(
    cd "$root"
    find etc -type f | LC_ALL=C sort | sed 's|^|/|' >DEBIAN/conffiles
    find usr lib -type f | LC_ALL=C sort | xargs -d '\n' md5sum >DEBIAN/md5sums
)
package=dist/canshaper_${version}_$architecture.deb
dpkg-deb --root-owner-group --build "$root" "$package" >/dev/null
echo "$package"
