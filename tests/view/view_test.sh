#!/bin/bash
# view_test.sh STIPPLE: the viewer on a virtual screen, driven by real mouse and keys; its screenshots compared.
stipple=$1
for tool in Xvfb xdotool; do
    command -v $tool >/dev/null || { echo "skipped: $tool is not installed"; exit 0; }
done
work=$(mktemp -d)
cd "$work" || exit 1
fail() {
    echo "FAILED: $*"
    cat stderr.txt
    exit 1
}
cat >small.scene.json <<JSON
{
  "version": 1,
  "assets": { "ball": { "generate": "sphere", "triangles": 2000 }, "floor": { "generate": "plane" } },
  "groups": { "all": { "instances": [ { "child": "floor", "scale": 100 },
                                      { "child": "ball", "translation": [-3, 1, 0], "scale": 2 } ] } },
  "cameras": [ { "name": "front", "eye": [0, 4, 14], "target": [0, 1, 0] } ],
  "root": "all"
}
JSON
Xvfb -displayfd 3 -screen 0 800x600x24 3>display.txt 2>/dev/null &
screen=$!
trap 'kill $viewer $screen 2>/dev/null; rm -rf "$work"' EXIT
for _ in $(seq 100); do [[ -s display.txt ]] && break; sleep 0.1; done
[[ -s display.txt ]] || fail "no virtual screen"
export DISPLAY=:$(cat display.txt) LIBGL_ALWAYS_SOFTWARE=1
"$stipple" view small.scene.json --width 480 --height 360 --subpixels 2 --screenshot shot.png --quiet 2>stderr.txt &
viewer=$!
window=$(timeout 60 xdotool search --sync --name 'Stipple - small' | head -n 1)
[[ -n $window ]] || fail "no window"
xdotool windowmove "$window" 0 0
xdotool windowfocus "$window" 2>/dev/null
key() { xdotool key "$1"; sleep 1; }
# shot NAME [differs|equals OTHER]: a screenshot of the picture that has come to rest (two in a row are the same).
shot() {
    local i
    rm -f last.png
    for i in $(seq 60); do
        rm -f shot.png
        xdotool key F12
        sleep 0.3
        [[ -s shot.png ]] || continue
        if [[ -s last.png ]] && cmp -s shot.png last.png; then
            mv last.png "$1"
            case $2 in
                differs) cmp -s "$1" "$3" || return ;;
                equals) cmp -s "$1" "$3" && return ;;
                *) return ;;
            esac
        fi
        mv shot.png last.png
    done
    fail "$* never came"
}
shot started.png  # only now it is sure to listen
key h  # without the panel
shot before.png
# Plant on the floor, right of the middle.
key 2
xdotool mousemove 330 260 sleep 0.5 click 1
sleep 2
shot planted.png differs before.png
key ctrl+z
shot undone.png equals before.png
key ctrl+y
shot redone.png equals planted.png
key ctrl+s
grep -q '"placed"' small-edited.scene.json || fail "not saved"
# Select the first ball and remove it.
key 1
xdotool mousemove 170 190 sleep 0.5 click 1
sleep 2
key Delete
shot removed.png differs redone.png
# The brush plants several in one step.
key 3
xdotool mousemove 330 260 sleep 0.5 click 1
sleep 2
shot brushed.png differs removed.png
key ctrl+z
shot unbrushed.png equals removed.png
key 1
# Overlays, one after the other, and none again; the cut is drawn over the picture, not in screenshots.
key o
before=removed.png
for overlay in kinds counts depths; do
    key o
    shot $overlay.png differs $before
    before=$overlay.png
done
key o
shot plain.png equals removed.png
# Sparkling in ends where the other way ends.
key p
shot sparkled.png equals removed.png
key p
# Orbit, and back again.
xdotool mousemove 240 250 mousedown 1
xdotool mousemove 300 250
sleep 0.3
xdotool mouseup 1
sleep 0.3
shot orbited.png differs removed.png
kill -0 $viewer || fail "the viewer has ended"
[[ -n $KEEP ]] && cp ./*.png "$KEEP"
key ctrl+q
for _ in $(seq 50); do kill -0 $viewer 2>/dev/null || break; sleep 0.1; done
kill -0 $viewer 2>/dev/null && fail "Ctrl+Q does not end it"
wait $viewer || fail "exit code $?"
echo passed
