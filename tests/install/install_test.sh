#!/bin/bash
# install_test.sh CMAKE BUILD SOURCE GENERATOR TYPE
set -e
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$1" --install "$2" --prefix "$work/prefix" >"$work/install.txt"
"$work/prefix/bin/stipple" --version
"$1" -S "$3/examples" -B "$work/build" -G "$4" -DCMAKE_BUILD_TYPE="$5" -DCMAKE_PREFIX_PATH="$work/prefix" \
    ${CMAKE_CXX_COMPILER_LAUNCHER:+-DCMAKE_CXX_COMPILER_LAUNCHER=$CMAKE_CXX_COMPILER_LAUNCHER}
"$1" --build "$work/build"
cat >"$work/small.scene.json" <<JSON
{
  "version": 1,
  "assets": { "ball": { "generate": "sphere", "triangles": 500 },
              "floor": { "generate": "plane" } },
  "groups": { "all": { "instances": [ { "child": "floor", "scale": 400 } ] } },
  "cameras": [ { "name": "front", "eye": [0, 20, 0], "target": [0, 0, -60] } ],
  "root": "all"
}
JSON
cd "$work"
"$work/build/plant_trees" small.scene.json ball ring
"$work/prefix/bin/stipple" compare ring_before.png ring_after.png
cmp -s ring_before.png ring_after.png && { echo "the edit is not seen"; exit 1; }
"$work/build/plant_trees" missing.scene.json ball ring && { echo "no error"; exit 1; }
echo passed
