#!/bin/sh
# Fetch and pack the libraries of the live page into canshaper/studio/static/vendor, and that of the
# site of the pages into tools/site/vendor; needs npm. The result is kept in the repository: neither
# page nor site nor their tests need this script.
#
# Versions stand in tools/assets/package.json, the hashes of their packages in package-lock.json,
# those of the result in vendor/SHA256SUMS. After a change of a version:
# npm install --package-lock-only --omit-lockfile-registry-resolved
set -eu
cd "$(dirname "$0")/.."
vendor=$PWD/canshaper/studio/static/vendor
site=$PWD/tools/site/vendor

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp tools/assets/package.json tools/assets/package-lock.json "$work"
cd "$work"
npm ci --silent --no-audit --no-fund

# Only what the page uses of three.js: the whole of it is four times as large.
cat >three.js <<'END'
export {
  AmbientLight, BufferAttribute, BufferGeometry, BoxGeometry, CanvasTexture, CircleGeometry, Color,
  CylinderGeometry, DirectionalLight, Fog, GridHelper, Group, HemisphereLight, Line,
  LineBasicMaterial, Mesh, MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, Quaternion,
  Scene, SphereGeometry, Sprite, SpriteMaterial, TorusGeometry, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
END
echo 'export { default } from "uplot";' >uplot.js
banner() { # NAME
  version=$(node -p "require('./node_modules/$1/package.json').version")
  echo "/* $1 $version, MIT licence: $1.LICENSE */"
}
for name in three uplot; do
  ./node_modules/.bin/esbuild "$name.js" --bundle --minify --format=esm --legal-comments=none \
    --banner:js="$(banner $name)" --outfile="$vendor/$name.js"
  cp "node_modules/$name/LICENSE" "$vendor/$name.LICENSE"
done
cp node_modules/uplot/dist/uPlot.min.css "$vendor/uplot.css"
cd "$vendor"
sha256sum three.LICENSE three.js uplot.LICENSE uplot.css uplot.js >SHA256SUMS
cd "$work"
mkdir -p "$site"
{ banner iframe-worker && cat node_modules/iframe-worker/shim/index.js; } >"$site/iframe-worker.js"
cp node_modules/iframe-worker/LICENSE "$site/iframe-worker.LICENSE"
cd "$site"
sha256sum iframe-worker.LICENSE iframe-worker.js >SHA256SUMS
