#!/bin/sh
# Makes the two libraries of the report page again, in this folder. Needs npm.
#
# OGL draws the 3-D view: 48 kB for the parts used here, public domain; three.js needs 560 kB for
# the same. uPlot draws the curves: 51 kB, MIT.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm init -y >/dev/null
npm install --silent ogl@1.0.11 uplot@1.6.32 esbuild@0.28.2
echo "export { Camera, Geometry, Mesh, Program, Renderer, Sphere, Transform } from 'ogl';" >ogl.js
npx esbuild ogl.js --bundle --minify --format=iife --global-name=OGL --outfile="$here/ogl.min.js"
cp node_modules/uplot/dist/uPlot.iife.min.js "$here/uplot.min.js"
cp node_modules/uplot/dist/uPlot.min.css "$here/uplot.min.css"
cp node_modules/uplot/LICENSE "$here/uplot.LICENSE"
