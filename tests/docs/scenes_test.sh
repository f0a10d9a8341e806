#!/usr/bin/env bash
# Takes the scene files out of docs/scenes.md and renders each; the pictures the page shows must be there and small.
# usage: scenes_test.sh STIPPLE DOCS_FOLDER
set -eu
stipple=$1
docs=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A file is a line with its name in backquotes and the fenced JSON that follows.
awk -v folder="$work" '
    /^`[a-z0-9-]+\.scene\.json`$/ { file = folder "/" substr($0, 2, length($0) - 2) }
    /^```json$/ { if (file == "") { print "JSON without a file name, line " NR; exit 1 } inside = 1; next }
    /^```$/ { if (inside) close(file); inside = 0; file = "" }
    inside { print > file }' "$docs/scenes.md"

cd "$work"
count=0
for scene in *.scene.json; do
    echo "$scene"
    "$stipple" render "$scene" -o "${scene%.scene.json}.png" --width 64 --height 36 --quiet >/dev/null
    count=$((count + 1))
    grep -q '"paths"' "$scene" || continue
    "$stipple" info "$scene" | sed -nE 's/^paths +[0-9]+: //p' | tr -d ',' | tr ' ' '\n' | while read -r path; do
        "$stipple" render "$scene" --path "$path" --frames 2 -o "$path%d.png" --width 64 --height 36 --quiet >/dev/null
        paths=$(find . -name "$path?.png" | wc -l)
        [[ $paths == 2 ]] || { echo "$scene: path $path: $paths pictures"; exit 1; }
    done
done
[[ -f flight1.png ]] || { echo "no path was drawn"; exit 1; }
[[ $count -ge 6 ]] || { echo "only $count scene files found"; exit 1; }

grep -oE 'images/scenes-[a-z0-9-]+\.jpg' "$docs/scenes.md" | while read -r picture; do
    [[ -f $docs/$picture ]] || { echo "$picture is missing"; exit 1; }
    [[ $(stat -c %s "$docs/$picture") -lt 150000 ]] || { echo "$picture is larger than 150 kB"; exit 1; }
done
echo "passed"
