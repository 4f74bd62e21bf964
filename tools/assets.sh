#!/bin/sh
# Fetch and pack the libraries of the live page into canshaper/studio/static/vendor; needs npm.
# The result is kept in the repository: neither the page nor its tests need this script.
set -eu
cd "$(dirname "$0")/.."
vendor=$PWD/canshaper/studio/static/vendor
THREE=0.187.0
UPLOT=1.6.32
ESBUILD=0.28.2

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
echo '{"private": true}' >package.json
npm install --silent --no-audit --no-fund --save-exact "three@$THREE" "uplot@$UPLOT" "esbuild@$ESBUILD"

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
for pinned in "three $THREE" "uplot $UPLOT"; do
  name=${pinned% *}
  ./node_modules/.bin/esbuild "$name.js" --bundle --minify --format=esm --legal-comments=none \
    --banner:js="/* $pinned, MIT licence: $name.LICENSE */" --outfile="$vendor/$name.js"
  cp "node_modules/$name/LICENSE" "$vendor/$name.LICENSE"
done
cp node_modules/uplot/dist/uPlot.min.css "$vendor/uplot.css"
