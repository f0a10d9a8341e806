#!/usr/bin/env bash
# Runs one case against the program: exit codes, one-line errors, what is on stdout, which files are left.
# usage: cli_test.sh STIPPLE REPOSITORY CASE
set -u
stipple=$1
repository=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1

fail() {
    echo "FAILED: $*"
    echo "--- stdout" && head -c 2000 stdout.txt
    echo "--- stderr" && head -c 2000 stderr.txt
    exit 1
} 2>/dev/null

# run ARGUMENTS...: sets $code, stdout.txt and stderr.txt.
run() {
    "$stipple" "$@" >stdout.txt 2>stderr.txt
    code=$?
}

# expect_ok ARGUMENTS...
expect_ok() {
    run "$@"
    [[ $code == 0 ]] || fail "exit code $code: $*"
}

# expect_error CODE REGEX ARGUMENTS...: nothing on stdout, one line on stderr that starts with "stipple: ".
expect_error() {
    local expected=$1 regex=$2
    shift 2
    run "$@"
    [[ $code == "$expected" ]] || fail "exit code $code, not $expected: $*"
    [[ ! -s stdout.txt ]] || fail "something on stdout"
    [[ $(grep -c '^stipple: ' stderr.txt) == 1 && $(tail -n 1 stderr.txt) == stipple:\ * ]] ||
        fail "not one line of error"
    tail -n 1 stderr.txt | grep -qE -- "$regex" || fail "the error does not match '$regex'"
}

expect_stdout() { grep -qE -- "$1" stdout.txt || fail "stdout lacks '$1'"; }
expect_no_file() { [[ -z $(find . -name "$1") ]] || fail "there is a file $1"; }

# A scene of one sphere; $1: further keys, each with a comma at its end.
write_scene() {
    cat >scene.scene.json <<JSON
{
  "version": 1, ${1:-}
  "assets": { "ball": { "generate": "sphere", "triangles": 500 } },
  "cameras": [ { "name": "front", "eye": [0, 0, 3], "target": [0, 0, 0] },
               { "name": "top", "eye": [0, 3, 0.1], "target": [0, 0, 0] } ],
  "root": "ball"
}
JSON
}
tiny=(--width 32 --height 24)

case_no_arguments() {
    run
    [[ $code == 2 ]] || fail "exit code $code"
    [[ ! -s stdout.txt ]] || fail "something on stdout"
    grep -q '^Usage: stipple' stderr.txt || fail "no usage"
}

case_help() {
    for arguments in --help help "help render" "render --help" "info -h" "compare --help" "bench --help" "generate --help" "help settings"; do
        # shellcheck disable=SC2086
        expect_ok $arguments
        [[ -s stdout.txt && ! -s stderr.txt ]] || fail "help belongs on stdout: $arguments"
    done
    expect_ok render --help
    expect_stdout '1280'
    expect_stdout 'Examples:'
    expect_ok help settings
    expect_stdout 'cut_ratio.* '
}

# docs/cli.md names every option of every command, and no option that does not exist.
case_help_names_every_option() {
    for command in render info compare bench edit view study build generate; do "$stipple" help "$command"; done |
        grep -oE -- '^  (-. )?--[a-z-]+' | grep -oE -- '--[a-z-]+' | sort -u >have.txt
    grep -oE -- '--[a-z][a-z-]*' "$repository/docs/cli.md" | sort -u >documented.txt
    [[ $(wc -l <have.txt) -gt 20 ]] || fail "cannot read the help"
    diff have.txt documented.txt || fail "docs/cli.md and --help differ"
    "$stipple" help settings | grep -oE '^  [a-z_]+' | tr -d ' ' >settings.txt
    while read -r key; do
        grep -qE -- "$key|--${key//_/-}" "$repository/docs/cli.md" || fail "docs/cli.md lacks $key"
    done <settings.txt
}

case_version() {
    expect_ok --version
    expect_stdout '^stipple [0-9]+\.[0-9]+\.[0-9]+$'
}

case_unknown_command() { expect_error 2 "did you mean 'render'" rendr; }
case_unknown_option() { expect_error 2 "unknown option '--wdith'; did you mean '--width'" render --wdith 5; }
case_option_without_value() { expect_error 2 '--width' render a.glb -o a.png --width; }

case_bad_setting() {
    expect_error 2 "did you mean 'samples'" render a.glb -o a.png --set sampels=1
    expect_error 2 'KEY=VALUE' render a.glb -o a.png --set samples
    expect_error 2 'points\|zbuffer\|raycast' render a.glb -o a.png --method magic
    expect_error 2 '--samples' render a.glb -o a.png --samples nan
    expect_error 2 '--threads' render a.glb -o a.png --threads -1
    expect_error 2 '--seed' render a.glb -o a.png --seed 1.5
}

case_aov_with_png() {
    write_scene
    expect_error 2 '--aov' render scene.scene.json -o a.png --aov depth
    expect_error 2 "did you mean 'normal'" render scene.scene.json -o a.exr --aov depth,norml
}

case_absurd_width() {
    write_scene
    expect_error 2 '65536' render scene.scene.json -o a.png --width 99999999999
    expect_error 2 'range' render scene.scene.json -o a.png --width 65536 --height 65536
    expect_no_file 'a.png'
}

case_output_extension() { expect_error 2 '\.png or \.exr' render a.glb -o a.jpg; }

case_unwritable_output() {
    write_scene
    expect_error 1 'no folder' render scene.scene.json -o missing/a.png
    expect_error 1 'no folder' render scene.scene.json -o a.png --stats missing/a.json
    mkdir folder.png
    expect_error 1 'not a regular file' render scene.scene.json -o folder.png
}

case_full_disk() {
    write_scene
    "$stipple" info scene.scene.json >/dev/full 2>stderr.txt
    code=$?
    : >stdout.txt
    [[ $code == 1 ]] || fail "exit code $code"
    grep -qx 'stipple: cannot write to standard output' stderr.txt || fail "wrong error"
    expect_error 1 'not a regular file' render scene.scene.json -o a.png --stats /dev/full
    expect_no_file 'a.png'
}

case_missing_file() {
    expect_error 3 'missing\.glb' render missing.glb -o a.png
    expect_error 3 'missing\.scene\.json' info missing.scene.json
    expect_error 3 'a\.png' compare a.png b.png
    expect_no_file 'a.png'
}

case_garbage_glb() {
    head -c 4096 /dev/urandom >garbage.glb
    expect_error 3 '^stipple: garbage\.glb: ' render garbage.glb -o a.png
    : >empty.glb
    expect_error 3 '^stipple: empty\.glb: ' info empty.glb
    "$stipple" generate rock -o rock.glb >/dev/null || fail "cannot generate"
    head -c 1000 rock.glb >cut.glb
    expect_error 3 '^stipple: cut\.glb: ' info cut.glb
}

case_json_syntax_error() {
    printf '{\n  "version": 1,\n  "root" "ball"\n}\n' >a.scene.json
    expect_error 3 'a\.scene\.json: line 3, column' info a.scene.json
}

case_schema_violation() {
    write_scene '"exposure": "bright",'
    expect_error 3 'scene\.scene\.json: /exposure: ' info scene.scene.json
    write_scene '"colour": 1,'
    expect_error 3 'colour' info scene.scene.json
}

case_bad_projectors() {
    local projector='"name": "p", "eye": [0, 0, 5], "target": [0, 0, 0]'
    write_scene '"projectors": [{ '"$projector"' }],'
    expect_error 3 '/projectors/0: .*picture' info scene.scene.json
    write_scene '"projectors": [{ '"$projector"', "picture": "none.png" }],'
    expect_error 3 'scene\.scene\.json: /projectors/0/picture: .*none\.png' info scene.scene.json
    echo "no picture" > bad.png
    write_scene '"projectors": [{ '"$projector"', "picture": "bad.png" }],'
    expect_error 3 'bad\.png' info scene.scene.json
    write_scene '"projectors": [{ "name": "p", "eye": [0, 0, 5], "target": [0, 0, 5], "picture": "bad.png" }],'
    expect_error 3 '/projectors/0/target: ' info scene.scene.json
}

case_unknown_asset() {
    write_scene '"groups": { "all": { "instances": [ { "child": "bell" } ] } },'
    sed -i 's/"root": "ball"/"root": "all"/' scene.scene.json
    expect_error 3 '/groups/all/instances/0/child: .*bell' info scene.scene.json
}

case_group_in_itself() {
    write_scene '"groups": { "a": { "instances": [ { "child": "b" } ] }, "b": { "instances": [ { "child": "a" } ] } },'
    sed -i 's/"root": "ball"/"root": "a"/' scene.scene.json
    expect_error 3 'scene\.scene\.json: .*itself' info scene.scene.json
}

case_too_many_instances() {
    write_scene '"groups": { "all": { "scatter": { "items": [ { "child": "ball" } ], "count": 1000000000000, "size": 1000 } } },'
    sed -i 's/"root": "ball"/"root": "all"/' scene.scene.json
    ulimit -v 16000000
    run info scene.scene.json
    [[ $code == 1 || $code == 3 ]] || fail "exit code $code"
    grep -qE '^stipple: scene\.scene\.json: /groups/all/scatter' stderr.txt || fail "wrong place"
}

case_path_leaves_folder() {
    mkdir inside
    "$stipple" generate rock -o rock.glb >/dev/null || fail "cannot generate"
    echo '{ "version": 1, "assets": { "rock": { "file": "../rock.glb" } }, "root": "rock" }' >inside/a.scene.json
    expect_error 3 '/assets/rock/file: .*outside' info inside/a.scene.json
    expect_ok info inside/a.scene.json --allow-outside
    ln -s ../rock.glb inside/link.glb
    sed -i 's|\.\./rock|link|' inside/a.scene.json
    expect_error 3 'outside' info inside/a.scene.json
}

case_bad_render_default() {
    write_scene '"render": { "sampels": 2 },'
    expect_error 3 "/render/sampels: .*did you mean 'samples'" info scene.scene.json
    write_scene '"render": { "width": 0 },'
    expect_error 3 '/render/width' info scene.scene.json
}

case_unknown_camera() {
    write_scene
    expect_error 2 "'side'.*front, top" render scene.scene.json -o a.png --camera side
}

case_debug_pixel_outside() {
    write_scene
    expect_error 2 '--debug-pixel' render scene.scene.json -o a.png "${tiny[@]}" --debug-pixel 32,0
    expect_error 2 '--debug-pixel' render scene.scene.json -o a.png "${tiny[@]}" --debug-pixel 3
    expect_ok render scene.scene.json -o a.png "${tiny[@]}" --debug-pixel 16,12
    grep -q '16' stderr.txt || fail "nothing about the pixel"
}

# Two keys on a circle about the ball.
path='"paths": [ { "name": "turn", "keys": [ { "eye": [0, 0, 3], "target": [0, 0, 0], "fov": 40 },
                                              { "eye": [3, 0, 0], "target": [0, 0, 0], "fov": 60 } ] } ],'

case_path_options() {
    write_scene "$path"
    expect_error 2 '--path: needs --frames' render scene.scene.json -o a%d.png --path turn
    expect_error 2 '--frames: needs --path' render scene.scene.json -o a.png --frames 3
    expect_error 2 '--frames' render scene.scene.json -o a%d.png --path turn --frames 0
    expect_error 2 '-o: .*needs one place' render scene.scene.json -o a.png --path turn --frames 3
    expect_error 2 '-o: .*needs one place' render scene.scene.json -o a%d-%d.png --path turn --frames 3
    expect_error 2 '-o: .*neither' render scene.scene.json -o a%s.png --path turn --frames 3
    expect_error 2 '-o: .*neither' render scene.scene.json -o a%04ld.png --path turn --frames 3
    expect_error 2 'contradicts --camera' render scene.scene.json -o a%d.png --path turn --frames 3 --camera top
    expect_error 2 'contradicts --repeat' render scene.scene.json -o a%d.png --path turn --frames 3 --repeat 2
    expect_error 2 "--path: there is no 'trun'; .*turn" render scene.scene.json -o a%d.png --path trun --frames 3
    mkdir a1.png
    expect_error 1 'a1\.png: .*not a regular file' render scene.scene.json -o a%d.png --path turn --frames 3
    expect_no_file 'a0.png'
    write_scene '"paths": [ { "name": "still", "keys": [ { "eye": [0, 0, 3], "target": [0, 0, 0] } ] } ],'
    expect_error 3 '/paths/0/keys' info scene.scene.json
}

case_path_pictures() {
    write_scene "$path"
    expect_ok info scene.scene.json
    expect_stdout '^paths +1: turn$'
    for method in points raycast; do
        expect_ok render scene.scene.json -o "100%%_%03d.png" "${tiny[@]}" --method $method \
            --path turn --frames 3 --stats a.json
        [[ $(cat stdout.txt) == $'100%_000.png\n100%_001.png\n100%_002.png' ]] || fail "not the pictures' paths"
        [[ $(tr -d ' \n' <a.json | grep -oE '"frames":\[[^]]*' | tr ',' '\n' | wc -l) == 3 ]] || fail "not 3 frames"
        grep -qE '^pictures: [0-9.]+ s$' stderr.txt || fail "no progress"
        # The ends are the pictures of cameras that stand there, for any state of the caches.
        write_scene "${path} \"exposure\": 0,"
        sed -i 's/"eye": \[0, 0, 3\], "target": \[0, 0, 0\] }/"eye": [0, 0, 3], "target": [0, 0, 0], "fov": 40 }/
                s/"eye": \[0, 3, 0.1\], "target": \[0, 0, 0\] }/"eye": [3, 0, 0], "target": [0, 0, 0], "fov": 60 }/' scene.scene.json
        expect_ok render scene.scene.json -o front.png "${tiny[@]}" --method $method --camera front
        expect_ok render scene.scene.json -o top.png "${tiny[@]}" --method $method --camera top
        cmp front.png 100%_000.png || fail "the first picture is another, $method"
        cmp top.png 100%_002.png || fail "the last picture is another, $method"
        cmp -s 100%_001.png 100%_000.png && fail "nothing moves"
    done
    expect_ok render scene.scene.json -o one%d.png "${tiny[@]}" --path turn --frames 1
    cmp one0.png 100%_000.png && fail "points and rays are the same bits"
    "$stipple" render scene.scene.json -o a%d.png --width 200 --height 150 --path turn --frames 1000000 >stdout.txt 2>stderr.txt &
    local pid=$!
    wait_for_handler $pid
    while [[ ! -e a1.png ]]; do sleep 0.05; done
    kill -TERM $pid
    wait $pid
    code=$?
    [[ $code == 6 ]] || fail "exit code $code"
    expect_no_file '*tmp*'
    while read -r picture; do "$stipple" compare "$picture" a0.png >/dev/null || fail "$picture is not whole"; done \
        < <(head -n 2 stdout.txt; tail -n 1 stdout.txt)
}

case_memory_limit() {
    "$stipple" generate terrain --count 2000000 -o terrain.glb >/dev/null || fail "cannot generate"
    expect_error 1 'terrain\.glb' info terrain.glb --memory-limit 20
    expect_error 1 'points to make splats of' build terrain.glb --as splats --set points=100000000 --memory-limit 2000 -o t.stipple
}

case_render_png() {
    write_scene
    for method in points zbuffer raycast; do
        expect_ok render scene.scene.json -o "$method.png" "${tiny[@]}" --method $method
        [[ $(cat stdout.txt) == "$method.png" ]] || fail "stdout is not the picture's path"
        [[ $(head -c 4 $method.png | tail -c 3) == PNG ]] || fail "no PNG"
        grep -qE '^write: [0-9.]+ s$' stderr.txt || fail "no line a phase"
    done
    expect_ok render scene.scene.json -o quiet.png "${tiny[@]}" --quiet --transparent --camera top
    [[ ! -s stderr.txt ]] || fail "not quiet"
}

case_render_exr_with_channels() {
    write_scene
    expect_ok render scene.scene.json -o a.exr "${tiny[@]}" --aov depth,normal,albedo,object,coverage,count
    for text in depth normal stipple:seed stipple:command; do
        grep -aq "$text" a.exr || fail "the header lacks $text"
    done
}

case_settings_precedence() {
    write_scene '"render": { "width": 20, "height": 10, "samples": 3, "shadows": false },'
    expect_ok render scene.scene.json -o a.png --height 12 --set height=14 --set subpixels=2 --stats a.json
    grep -q '"width": 20,' a.json || fail "not the scene file's width"
    grep -q '"height": 12,' a.json || fail "the option must win"
    grep -q '"samples": 3,' a.json || fail "not the scene file's samples"
    grep -q '"subpixels": 2,' a.json || fail "--set was ignored"
    grep -q '"seed": 1,' a.json || fail "not the default seed"
}

case_stats_file() {
    write_scene
    for method in points zbuffer raycast; do
        expect_ok render scene.scene.json -o a.png "${tiny[@]}" --method $method --repeat 3 --stats a.json
        for key in schema version command scene settings phases counters memory frames warnings \
            load build plan draw raster reconstruct shade write instances triangles_unique triangles_total bytes \
            points_drawn points_kept points_culled batches large_triangles overestimation peak_bytes cache_bytes; do
            grep -q "\"$key\"" a.json || fail "--stats lacks $key with $method"
        done
        [[ $(tr -d ' \n' <a.json | grep -oE '"frames":\[[^]]*' | tr ',' '\n' | wc -l) == 3 ]] || fail "not 3 frames"
    done
}

case_same_bits_for_any_threads() {
    write_scene
    for threads in 1 2 5; do
        expect_ok render scene.scene.json -o $threads.png --width 200 --height 150 --threads $threads --cache-mb off
    done
    cmp 1.png 2.png || fail "pictures differ"
    cmp 1.png 5.png || fail "pictures differ"
    expect_ok render scene.scene.json -o cached.png --width 200 --height 150 --repeat 2
    cmp 1.png cached.png || fail "the cached picture differs"
    for threads in 1 3; do
        expect_ok render scene.scene.json -o rays$threads.png --width 201 --height 151 --threads $threads --method raycast --samples 5
    done
    cmp rays1.png rays3.png || fail "ray-cast pictures differ"
}

# Waits until process $1 is the program and catches both signals: before, a signal says nothing about the
# program (between fork and exec the shell's own handlers show, and a background job ignores SIGINT).
wait_for_handler() {
    local caught=0
    for ((i = 0; i < 600; ++i)); do
        if [[ /proc/$1/exe -ef $stipple ]]; then
            caught=$(sed -n 's/^SigCgt:\t//p' "/proc/$1/status" 2>/dev/null)
            (((0x${caught:-0} & 0x4002) == 0x4002)) && return
        fi
        sleep 0.1
    done
    fail "it catches no signals"
}

# interrupt SIGNAL SECONDS ARGUMENTS...: expects exit code 6 and no picture.
interrupt() {
    local signal=$1 seconds=$2
    shift 2
    "$stipple" "$@" >stdout.txt 2>stderr.txt &
    local pid=$!
    wait_for_handler $pid
    sleep "$seconds"
    kill "-$signal" $pid || fail "it ended before it was interrupted"
    wait $pid
    code=$?
    [[ $code == 6 ]] || fail "exit code $code"
    [[ ! -s stdout.txt ]] || fail "something on stdout"
    [[ $(tail -n 1 stderr.txt) == 'stipple: '* ]] || fail "no message"
    expect_no_file 'a.png*'
    expect_no_file '*tmp*'
}

case_interrupt_render() {
    write_scene
    interrupt INT 2 render scene.scene.json -o a.png --method raycast --samples 10000
    interrupt TERM 2 render scene.scene.json -o a.png --repeat 100000
}

case_interrupt_load() {
    "$stipple" generate forest --count 5000000 -o big.scene.json >/dev/null || fail "cannot generate"
    sed -i 's/"triangles": 20000/"triangles": 300000/' big.scene.json
    interrupt INT 0.3 render big.scene.json -o a.png
}

case_info() {
    write_scene
    expect_ok info scene.scene.json
    expect_stdout '^cameras +2: front, top$'
    expect_stdout '^instances +1 '
    expect_ok info scene.scene.json --json
    expect_stdout '"triangles_total"'
    [[ ! -s stderr.txt ]] || fail "something on stderr"
}

case_export() {
    write_scene
    for file in a.glb a.gltf; do
        expect_ok info scene.scene.json --json --export $file
        local total
        total=$(grep '"triangles_total"' stdout.txt)
        expect_ok info $file --json
        expect_stdout "$total"
    done
    expect_error 2 '\.glb' info scene.scene.json --export a.obj
    "$stipple" generate landscape --count 100000000 -o big.scene.json >/dev/null || fail "cannot generate"
    expect_error 3 '^stipple: b\.glb: .*instances' info big.scene.json --export b.glb
    expect_no_file 'b.glb*'
}

case_compare() {
    write_scene
    expect_ok render scene.scene.json -o a.png "${tiny[@]}" --seed 1
    expect_ok render scene.scene.json -o b.png "${tiny[@]}" --camera top
    expect_ok render scene.scene.json -o small.png --width 16 --height 16
    expect_ok compare a.png a.png --json --fail-below 100
    expect_stdout '"identical": true'
    expect_ok compare a.png b.png -o difference.png
    expect_stdout '^PSNR +[0-9.]+ dB$'
    [[ -s difference.png ]] || fail "no picture of the differences"
    run compare a.png b.png --fail-below 90
    [[ $code == 4 ]] || fail "exit code $code, not 4"
    expect_error 5 '32 x 24.*16 x 16' compare a.png small.png
}

case_generate() {
    for kind in tree bush deadwood grass fern flowers litter rock terrain; do
        expect_ok generate $kind -o $kind.glb
        [[ $(cat stdout.txt) == $kind.glb ]] || fail "stdout is not the path"
        expect_ok info $kind.glb
    done
    expect_ok generate tree --seed 7 -o again.glb
    expect_ok generate tree --seed 7 -o same.glb
    cmp again.glb same.glb || fail "the same seed gives another tree"
    cmp -s again.glb tree.glb && fail "another seed gives the same tree"
    expect_ok generate forest --count 500 -o forest.scene.json
    expect_ok render forest.scene.json -o forest.png "${tiny[@]}"
    expect_ok generate landscape --count 100000000 -o landscape.scene.json
    expect_ok info landscape.scene.json --json
    expect_ok render landscape.scene.json -o landscape.png "${tiny[@]}"
    expect_error 2 "did you mean 'tree'" generate tre -o a.glb
    expect_error 2 '\.glb' generate tree -o a.obj
    expect_error 2 '\.scene\.json' generate forest -o a.json
    expect_error 2 '1000\.\.2000000' generate tree --count 3 -o a.glb
    expect_ok generate tree --species birch --season winter -o winter.glb
    expect_ok generate deadwood --species log --size 5 -o log.glb
    expect_error 2 'oak, beech, birch, spruce or pine' generate tree --species palm -o a.glb
    expect_error 2 'spring, summer, autumn or winter' generate tree --season monsoon -o a.glb
    expect_error 2 '--season' generate rock --season winter -o a.glb
    expect_error 2 '--species' generate fern --species oak -o a.glb
    expect_no_file a.glb
}

quick_bench=("${tiny[@]}" --repetitions 1 --reference-rays 64)

case_bench() {
    export STIPPLE_CACHE=$PWD/cache TMPDIR=$PWD/tmp
    mkdir tmp
    write_scene
    expect_ok bench scene.scene.json "${quick_bench[@]}" --json a.json
    for text in '^camera front' '^camera top' '^    points +[1-8]x' '^    raycast +16 rays' '^    zbuffer +4x4' \
        'quality of 1 ray a' 'first picture' "machine's limit" 'million rays/s'; do
        expect_stdout "$text"
    done
    grep -q '^top: reference: ' stderr.txt || fail "no progress"
    for key in schema version command scene width height threads repetitions load_seconds limit_buffer_bytes \
        left_out cameras reference methods first_picture build_seconds frame_seconds picture_seconds total_seconds ratio total_ratio peak_bytes \
        qualities reached settings samples subpixels area_threshold psnr_db flip holes still_seconds \
        moving_seconds still_ratio points_drawn phases cached_per_second_core fresh_per_second_core \
        limit_per_second limit_bytes_per_second limit_share rays_per_second search; do
        grep -q "\"$key\"" a.json || fail "--json lacks $key"
    done
    [[ $(grep -c '"method": "points"' a.json) == 2 ]] || fail "not two cameras"
    [[ $(grep -c '"method": "zbuffer"' a.json) == 2 ]] || fail "zbuffer is missing"
    # What was tried has the seed of the command line; what was judged has another.
    [[ $(grep -c '"seed": 2' a.json) == 6 ]] || fail "the quality was judged with the seed of the search"
    [[ $(grep -c '"still_seconds": 0.0,' a.json) == 0 ]] || fail "something was not timed"

    expect_ok bench scene.scene.json "${quick_bench[@]}" --camera top --against zbuffer --quiet
    [[ ! -s stderr.txt ]] || fail "not quiet"
    grep -qE '^camera front|^    raycast' stdout.txt && fail "measured what was not asked for"
    [[ -z $(ls tmp) ]] || fail "a temporary folder is left"
}

# Above its limit, zbuffer is left out and the rest goes on.
case_bench_without_zbuffer() {
    export STIPPLE_CACHE=$PWD/cache
    cat >big.scene.json <<JSON
{
  "version": 1,
  "assets": { "ball": { "generate": "sphere", "triangles": 20000 } },
  "groups": { "all": { "grid": { "child": "ball", "count_x": 260, "count_z": 260, "spacing_x": 3, "spacing_z": 3 } } },
  "cameras": [ { "name": "front", "eye": [0, 30, 90], "target": [0, 0, 0] } ],
  "root": "all"
}
JSON
    expect_ok bench big.scene.json "${quick_bench[@]}"
    expect_stdout '^zbuffer is left out'
    grep -qE '^    zbuffer' stdout.txt && fail "zbuffer was not left out"
    expect_stdout '^    raycast +16 rays'
}

# A plane of balls, 5 x 5, and a group that is shown twice.
write_edit_scene() {
    cat >edit.scene.json <<JSON
{
  "version": 1,
  "assets": {
    "ball": { "generate": "sphere", "triangles": 500 },
    "box": { "generate": "box" }
  },
  "groups": {
    "balls": { "grid": { "child": "ball", "count_x": 5, "count_z": 5, "spacing_x": 3, "spacing_z": 3 } },
    "all": { "instances": [
      { "child": "balls" },
      { "child": "balls", "translation": [0, 0, -20] },
      { "child": "box", "translation": [0, 4, 0] }
    ] }
  },
  "cameras": [ { "name": "front", "eye": [0, 12, 30], "target": [0, 0, -5] },
               { "name": "top", "eye": [0, 40, 1], "target": [0, 0, 0] } ],
  "root": "all"
}
JSON
}
small=(--width 160 --height 120)

case_edit() {
    write_edit_scene
    cat >edits.jsonl <<JSON
{"do": "render"}

{"do": "insert", "child": "box", "group": "balls", "translation": [1, 2, 1], "as": "mine"}
{"do": "render"}
{"do": "remove", "object": "mine"}
{"do": "render"}
{"do": "remove", "object": "1/12", "only_here": true}
{"do": "move", "group": "balls", "index": 3, "translation": [0, 5, 0]}
{"do": "replace", "object": "2", "child": "ball"}
{"do": "camera", "name": "top"}
{"do": "render", "output": "top.png"}
JSON
    expect_ok edit edit.scene.json --script edits.jsonl -o f_%d.png "${small[@]}" --stats stats.json --quiet
    expect_stdout '^{"group":"balls","index":25}$'
    expect_stdout '^f_2\.png$'
    expect_stdout '^top\.png$'
    cmp -s f_0.png f_2.png || fail "insert and remove are not the same as nothing"
    cmp -s f_0.png f_1.png && fail "the inserted box is not seen"
    grep -q '"median_seconds"' stats.json || fail "no times"
    # Standard input, one line at a time.
    echo '{"do": "remove", "object": "2"}' | "$stipple" edit edit.scene.json --script - --quiet ||
        fail "standard input"
}

# A grid whose table has a cliff, in a group that is shown twice.
write_grid_scene() {
    python3 - <<'PY' || fail "no table"
import struct, zlib
def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
open("cliff.png", "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 4, 1, 8, 0, 0, 0, 0))
    + chunk(b"IDAT", zlib.compress(b"\0\0\0\xff\xff")) + chunk(b"IEND", b""))
PY
    cat >grid.scene.json <<JSON
{
  "version": 1,
  "assets": { "cliff": { "generate": "grid", ${1:-\"surface\": \"plane\"}, "displacement": { "file": "cliff.png" } } },
  "groups": {
    "pair": { "instances": [ { "child": "cliff" }, { "child": "cliff", "translation": [1.2, 0, 0], "rotation": [0, 90, 0] } ] },
    "all": { "instances": [ { "child": "pair" }, { "child": "pair", "translation": [0, 0, -1.5], "scale": [1, 2, 1] } ] }
  },
  "cameras": [ { "name": "front", "eye": [2, 2, 4], "target": [0.5, 0.3, 0] } ],
  "lights": { "suns": [ { "direction": [-1, 1, 1], "irradiance": [2, 2, 2] } ] },
  "root": "all"
}
JSON
}

case_grid() {
    write_grid_scene '"refine": 0'
    expect_ok render grid.scene.json -o a.png "${tiny[@]}" --shadows on
    grep -q '^stipple: warning: grid.scene.json: /assets/cliff: the displaced surface pulls apart: at u 0' stderr.txt ||
        fail "no warning"
    write_grid_scene '"refine": 4'
    cat >edits.jsonl <<JSON
{"do": "move", "group": "pair", "index": 1, "translation": [1.5, 0.2, 0]}
{"do": "insert", "child": "cliff", "translation": [0, 0, 1.5]}
{"do": "render", "output": "a.png"}
{"do": "save", "output": "saved.scene.json"}
JSON
    expect_ok edit grid.scene.json --script edits.jsonl "${tiny[@]}" --quiet
    [[ ! -s stderr.txt ]] || fail "a warning where the grid is refined"
    grep -q '"refine": 4' saved.scene.json || fail "the rule is gone"
    expect_ok render saved.scene.json -o b.png "${tiny[@]}" --quiet
    cmp -s a.png b.png || fail "the saved scene is another"
    for method in zbuffer raycast; do
        expect_ok render saved.scene.json -o c.png "${tiny[@]}" --method $method --quiet
        run compare c.png b.png
        expect_stdout 'PSNR'
    done
}

case_grid_errors() {
    write_grid_scene '"surface": "blob"'
    expect_error 3 'grid.scene.json: /assets/cliff/surface: ' render grid.scene.json -o a.png
    write_grid_scene '"surface": "sphere", "size": [1, 2]'
    expect_error 3 'grid.scene.json: /assets/cliff/size: means nothing for a sphere' render grid.scene.json -o a.png
    write_grid_scene '"resolution": 16384'
    expect_error 3 'grid.scene.json: /assets/cliff: a grid of 16384 x 16384 cells' render grid.scene.json -o a.png
    write_grid_scene '"texture": "none.png"'
    expect_error 3 'grid.scene.json: /assets/cliff/texture: "none.png" cannot be opened' render grid.scene.json -o a.png
    write_grid_scene
    rm cliff.png
    expect_error 3 'grid.scene.json: /assets/cliff/displacement/file: "cliff.png" cannot be opened' \
        render grid.scene.json -o a.png
    echo "no picture, but long enough" >cliff.png
    expect_error 3 'grid.scene.json: /assets/cliff/displacement/file: not a PNG' render grid.scene.json -o a.png
    expect_no_file 'a.png'
}

case_edit_errors() {
    write_edit_scene
    cat >edits.jsonl <<JSON
{"do": "insert", "child": "bal"}
{"do": "insert", "child": "ball", "scale": 0}
{"do": "insert", "child": "ball", "translation": [1, 2]}
not json
{"do": "remove", "object": "7"}
{"do": "remove", "object": "0/12/3"}
{"do": "insert", "child": "all", "group": "balls"}
{"do": "remove", "objct": "2"}
{"do": "fly"}
{"do": "render"}
{"do": "save", "output": "/tmp/edit.scene.json"}
[1]
{"do": "insert", "child": "zebra"}
{"do": "insert", "child": "ball", "as": "12"}
{"do": "insert", "child": "ball", "scale": 1e30}
{"do": "render", "output": "a.png"}
{"do": "insert", "child": "ball", "as": "mine"}
{"do": "insert", "child": "ball", "as": "mine"}
{"do": "remove", "object": "mine"}
{"do": "insert", "child": "ball", "as": "mine"}
{"do": "replace", "object": "1/12", "only_here": true, "child": "all"}
{"do": "move", "object": "1/12", "only_here": true, "translation": [0, 0, 0], "scale": 1e6, "rotation": [1e9, 0, 0]}
{"do": "save", "output": "unchanged.scene.json"}
JSON
    expect_ok render edit.scene.json -o b.png "${small[@]}" --quiet
    "$stipple" edit edit.scene.json --script edits.jsonl "${small[@]}" --quiet >stdout.txt 2>stderr.txt
    [[ $? == 3 ]] || fail "exit code"
    [[ $(wc -l <stderr.txt) == 18 ]] || fail "not a line for each error"
    grep -q copy_of unchanged.scene.json && fail "an edit that was refused has copied a group"
    for line in "line 1: /child: .*did you mean \"ball\"" "line 2: singular" "line 3: /translation: " "line 4: " \
        "line 5: there is no instance 7" "line 6: " "line 7: group \"all\" contains \"balls\"" \
        "line 8: /objct: .*did you mean \"object\"" "line 9: /do: " "line 10: needs \"output\"" \
        "line 11: .*folder of edit.scene.json.*: edit.scene.json$" "line 12: " "line 13: /child: .*; known: .*\"ball\"" \
        "line 14: /as: .*digit" "line 15: /scale: .*up to 1e6" "line 18: /as: there is \"mine\" already"; do
        grep -qE "edits.jsonl: $line" stderr.txt || fail "no such error: $line"
    done
    cmp -s a.png b.png || fail "bad lines have changed something"
    expect_error 3 'missing\.jsonl' edit edit.scene.json --script missing.jsonl
}

# A saved scene looks the same, keeps its rules, and its instances keep their names.
case_edit_save() {
    write_edit_scene
    cat >edits.jsonl <<JSON
{"do": "insert", "child": "box", "group": "balls", "translation": [1, 2, 1]}
{"do": "insert", "child": "ball", "translation": [3, 2, 1], "scale": [1, 2, 1]}
{"do": "insert", "child": "ball", "group": "balls", "translation": [3, 5, 1]}
{"do": "remove", "group": "balls", "index": 26}
{"do": "remove", "object": "1/12", "only_here": true}
{"do": "move", "group": "balls", "index": 3, "translation": [0, 5, 0]}
{"do": "render", "output": "a.png"}
{"do": "save", "output": "saved.scene.json"}
JSON
    expect_ok edit edit.scene.json --script edits.jsonl "${small[@]}" --quiet
    grep -q '"grid"' saved.scene.json || fail "the rule is gone"
    grep -q '"copy_of": "balls"' saved.scene.json || fail "no copy"
    expect_ok render saved.scene.json -o b.png "${small[@]}" --quiet
    expect_ok compare a.png b.png --fail-below 45
    # Once more, from there: nothing changes but what is told; names go on.
    cat >more.jsonl <<JSON
{"do": "insert", "child": "box", "group": "balls", "translation": [0, 9, 0]}
{"do": "remove", "group": "balls", "index": 27}
{"do": "remove", "group": "balls", "index": 26}
{"do": "save", "output": "again.scene.json"}
JSON
    "$stipple" edit saved.scene.json --script more.jsonl --quiet >stdout.txt 2>stderr.txt
    [[ $? == 3 ]] || fail "a removed name was known"
    expect_stdout '"index":27'
    expect_ok render again.scene.json -o c.png "${small[@]}" --quiet
    expect_ok compare b.png c.png --fail-below 45
}

# Assets that come while the scene is looked at are in what is saved, and it looks the same.
case_edit_asset() {
    write_edit_scene
    expect_ok generate rock --count 300 -o rock.glb
    mkdir scene && cp rock.glb scene && mv edit.scene.json scene
    cat >edits.jsonl <<JSON
{"do": "asset", "name": "rock", "file": "rock.glb", "scale": 3}
{"do": "asset", "name": "oak", "generate": "tree", "species": "oak", "triangles": 2000, "height": 8}
{"do": "render", "output": "before.png"}
{"do": "insert", "child": "rock", "translation": [6, 2, 1]}
{"do": "insert", "child": "oak", "group": "balls", "translation": [-6, 0, 1]}
{"do": "render", "output": "a.png"}
{"do": "save", "output": "scene/saved.scene.json"}
JSON
    expect_ok edit scene/edit.scene.json --script edits.jsonl "${small[@]}" --stats stats.json --quiet
    grep -q '"asset": {' stats.json || fail "no times"
    cmp -s before.png a.png && fail "the assets are not seen"
    expect_ok render scene/saved.scene.json -o b.png "${small[@]}" --quiet
    expect_ok compare a.png b.png --fail-below 45
    # What cannot be is told, with the line, and changes nothing.
    cat >edits.jsonl <<JSON
{"do": "asset", "file": "rock.glb"}
{"do": "asset", "name": "ball", "file": "rock.glb"}
{"do": "asset", "name": "a", "file": "none.glb"}
{"do": "asset", "name": "b", "generate": "tree", "species": "oka"}
{"do": "asset", "name": "c", "generate": "tree", "triangle": 5}
{"do": "asset", "name": "d", "file": "../rock.glb"}
{"do": "asset", "name": "e"}
{"do": "asset", "name": "f", "file": "edit.scene.json"}
{"do": "insert", "child": "a"}
{"do": "save", "output": "scene/again.scene.json"}
JSON
    "$stipple" edit scene/edit.scene.json --script edits.jsonl --quiet >stdout.txt 2>stderr.txt
    [[ $? == 3 ]] || fail "exit code"
    [[ $(wc -l <stderr.txt) == 9 ]] || fail "not a line for each error"
    for line in 'line 1: needs "name"' 'line 2: /name: .*already' 'line 3: /file: ' 'line 4: /species: ' 'line 5: ' \
        'line 6: /file: ' 'line 7: ' 'line 8: /file: ' 'line 9: /child: '; do
        grep -qE "edits.jsonl: $line" stderr.txt || fail "no such error: $line"
    done
    grep -q '"a"' scene/again.scene.json && fail "an asset that could not be loaded was saved"
    [[ -s scene/again.scene.json ]] || fail "not saved"
}

case_edit_file_errors() {
    write_edit_scene
    with_edits() { sed "s|\"root\": \"all\"|\"root\": \"all\", \"edits\": $1|" edit.scene.json >bad.scene.json; }
    with_edits '{ "ballss": { "removed": [1] } }'
    expect_error 3 '/edits/ballss: .*did you mean "balls"' info bad.scene.json
    with_edits '{ "balls": { "removed": [25] } }'
    expect_error 3 '/edits/balls/removed/0: ' info bad.scene.json
    with_edits '{ "balls": { "removed": [2, 2] } }'
    expect_error 3 '/edits/balls/removed/1: ' info bad.scene.json
    with_edits '{ "balls": { "removed": [-2] } }'
    expect_error 3 '/edits/balls/removed/0' info bad.scene.json
    with_edits '{ "balls": { "placed": [ { "index": 1, "child": "bll" } ] } }'
    expect_error 3 '/edits/balls/placed/0/child: ' info bad.scene.json
    with_edits '{ "balls": { "placed": [ { "index": 1, "child": "ball", "scale": 0 } ] } }'
    expect_error 3 '/edits/balls/placed/0: ' info bad.scene.json
    with_edits '{ "balls": { "placed": [ { "index": 99999999999, "child": "ball" } ] } }'
    expect_error 3 '/edits/balls/placed/0/index: ' info bad.scene.json
    with_edits '{ "balls": { "next": 4294967294 } }'
    expect_error 1 'its edits need about 34.9 GB' info bad.scene.json --memory-limit 8000
    with_edits '{ "two": { "copy_of": "ball" } }'
    expect_error 3 '/edits/two/copy_of: ' info bad.scene.json
    with_edits '{ "ball": { "removed": [0] } }'
    expect_error 3 '/edits/ball: ' info bad.scene.json
    with_edits '{ "balls": { "placed": [ { "index": 4, "child": "all" } ] } }'
    expect_error 3 'contains itself' info bad.scene.json
}

case_bench_usage() {
    write_scene
    expect_error 2 "did you mean 'zbuffer'" bench scene.scene.json --against zbufer
    expect_error 2 'samples cannot be set' bench scene.scene.json --set samples=2
    expect_error 2 "'side'.*front, top" bench scene.scene.json --camera side
    expect_error 2 '--repetitions' bench scene.scene.json --repetitions 0
    expect_error 3 'missing\.glb' bench missing.glb
    expect_error 1 'no folder' bench scene.scene.json --json missing/a.json
    echo "a file" >cache
    STIPPLE_CACHE=$PWD/cache expect_error 1 'cache' bench scene.scene.json "${quick_bench[@]}" --quiet
}

# A reference is cast once for a camera; another scene needs another one.
case_bench_reference_cache() {
    export STIPPLE_CACHE=$PWD/cache
    write_scene
    local n=0
    one() {
        expect_ok bench scene.scene.json "${quick_bench[@]}" --against raycast --camera front --json a.json "$@"
        [[ $(find cache -type f | wc -l) == "$n" ]] || fail "not $n references: $*"
    }
    n=1; one
    one
    grep -q '"cached": true' a.json || fail "the reference was cast again"
    n=2; one --seed 2 --camera top
    n=2; one --threads 1
    sed -i 's/"triangles": 500/"triangles": 2000/' scene.scene.json
    n=3; one
    # One that is damaged is made again.
    find cache -type f -exec truncate -s 100 {} +
    one
    grep -q '"cached": false' a.json || fail "a damaged reference was used"
}

case_interrupt_bench() {
    export STIPPLE_CACHE=$PWD/cache
    write_scene
    interrupt INT 1 bench scene.scene.json --reference-rays 10000
    expect_no_file 'reference*'
}

# A study of the sphere; $1: further keys, each with a comma at its end.
write_study() {
    write_scene
    cat >ball.study.json <<JSON
{
  "scene": "scene.scene.json", ${1:-}
  "settings": { "width": 32, "height": 24, "reconstruct": "splat" },
  "repetitions": 3, "later_frames": 1, "reference_rays": 4,
  "sweeps": [ { "name": "points", "axes": { "samples": [0.5, 1, 2], "zoom": [1, 2] } },
              { "name": "raycast", "settings": { "method": "raycast" }, "axes": { "samples": [1] }, "reference": true } ],
  "plots": [ { "title": "a plot", "x": "points_drawn", "y": "later_seconds", "sweeps": ["points"], "fit": "linear" } ]
}
JSON
    export STIPPLE_CACHE=$PWD/cache
}

case_study() {
    write_study
    expect_ok study ball.study.json -o result --json out.json
    expect_stdout '^result/report\.html$'
    expect_stdout 'R² = '
    [[ $(wc -l <result/rows.csv) == 22 ]] || fail "not 21 rows"
    [[ $(cut -d, -f1 result/rows.csv | sort -u | wc -l) == 22 ]] || fail "a row is there twice"
    grep -q '"title": "a plot"' out.json || fail "no plot in the JSON"
    [[ -s result/pictures/$(sed -n 2p result/rows.csv | cut -d, -f1).png ]] || fail "no picture"
    # Each row says how it can be repeated, and what disturbed it.
    for column in scene_hash nest_grid later_frames reference_rays others_share; do
        head -n 1 result/rows.csv | tr , '\n' | grep -qx "$column" || fail "no column $column"
    done
    # Nothing is left to do, and nothing is done.
    cp result/rows.csv before.csv
    expect_ok study ball.study.json -o result
    cmp -s before.csv result/rows.csv || fail "rows changed"
    # Rows beside other work are counted.
    sed -e '2,$s/,[^,]*,\([^,]*\)$/,0.01,\1/' -e '3s/,[^,]*,\([^,]*\)$/,0.5,\1/' before.csv >result/rows.csv
    expect_ok study ball.study.json -o result
    expect_stdout 'during 1 of 21 rows'
    grep -q '"disturbed": 1' result/report.html || fail "the report does not warn"
    # The standard study of a scene.
    expect_ok study --help
}

case_study_point_blocks() {
    write_scene
    expect_ok study --point-blocks scene.scene.json -o result --resolution 16 --json out.json
    expect_stdout '^result/report\.html$'
    [[ $(ls result/*.csv | wc -l) == 10 ]] || fail "not ten tables"
    grep -q '^scene.scene,' result/models.csv || fail "no row of the model"
    grep -q '"name": "culling"' out.json || fail "a table is not in the JSON"
    # 200 views at unit magnification without a hole, and two other kinds of views.
    grep -Eq '^scene.scene,unit magnification,200,0,0,0,[0-9]' result/views.csv || fail "holes, or no views"
    [[ $(wc -l <result/views.csv) == 4 ]] || fail "not three kinds of views"
    grep -Eq 'warp_million_points_s$' result/phases.csv || fail "no speed of warping"
    # Blocks of 8 as the thesis has them are those of its tolerance angle.
    [[ $(grep -c '^scene.scene,"*block size, as the thesis"*,' result/sizes.csv) == 4 ]] || fail "not four sizes of blocks"
    # Chosen tables alone.
    expect_ok study --point-blocks scene.scene.json -o some --resolution 16 --tables models,screen
    [[ $(ls some/*.csv) == $'some/models.csv\nsome/screen.csv' ]] || fail "not the two tables asked for"
    expect_error 2 'tables' study --point-blocks scene.scene.json -o some --tables sise
    expect_error 2 'needs --point-blocks' study x.study.json --tables sizes -o result
    expect_error 2 'no study' study x.study.json --point-blocks scene.scene.json -o result
}

case_study_errors() {
    write_study
    expect_error 2 'STUDY' study -o result
    expect_error 2 'output' study ball.study.json
    expect_error 3 'missing\.study\.json' study missing.study.json -o result
    sed 's/"samples": \[0.5/"sampels": [0.5/' ball.study.json >bad.study.json
    expect_error 3 "/sweeps/0/axes/sampels/0.*did you mean 'samples'" study bad.study.json -o result
    sed 's/"points_drawn"/"points_drwan"/' ball.study.json >bad.study.json
    expect_error 3 '/plots/0/x.*"points_drawn"' study bad.study.json -o result
    sed 's/"points_drawn"/"sampler"/' ball.study.json >bad.study.json
    expect_error 3 '/plots/0/x.*"sampler" is a word' study bad.study.json -o result
    sed 's/"repetitions": 3/"repetitions": 0/' ball.study.json >bad.study.json
    expect_error 3 '/repetitions' study bad.study.json -o result
    sed 's/"zoom": \[1, 2\]/"camera": ["side"]/' ball.study.json >bad.study.json
    # Before anything is measured.
    expect_error 2 "bad\.study\.json.*'side'" study bad.study.json -o sided -q
    [[ $(wc -l <sided/rows.csv) == 1 ]] || fail "rows were measured"
    mkdir foreign && echo "a,b" >foreign/rows.csv
    expect_error 3 'foreign/rows\.csv' study ball.study.json -o foreign -q
    expect_error 3 'nowhere/rows\.csv' study --compare nowhere nowhere
}

# Interrupted at any moment, and started again, it completes with each row once.
case_study_resumes() {
    write_study
    sed 's/"repetitions": 3/"repetitions": 1000/' ball.study.json >long.study.json
    interrupt INT 1 study long.study.json -o result
    [[ $(wc -l <result/rows.csv) -gt 2 ]] || fail "nothing was kept"
    head -n 9 result/rows.csv >some.csv
    mv some.csv result/rows.csv
    expect_ok study ball.study.json -o result
    # As if it had been killed while it wrote: a line in the middle, then half a line.
    head -c 5000 result/rows.csv >half.csv
    mv half.csv result/rows.csv
    expect_ok study ball.study.json -o result
    [[ $(cut -d, -f1 result/rows.csv | sort -u | wc -l) == 22 && $(wc -l <result/rows.csv) == 22 ]] ||
        fail "rows are missing or there twice"
}

case_study_compare() {
    write_study
    expect_ok study ball.study.json -o one
    expect_ok study --compare one one --json same.json
    expect_stdout '^0 of [0-9]+ numbers changed'
    expect_ok study ball.study.json -o two
    # Twice the points drawn, as if the program had become worse.
    python3 - <<'PY'
import csv
rows = list(csv.DictReader(open('two/rows.csv')))
for row in rows: row['points_drawn'] = str(2 * float(row['points_drawn']))
out = csv.DictWriter(open('two/rows.csv', 'w'), rows[0].keys(), lineterminator='\n')
out.writeheader(); out.writerows(rows)
PY
    expect_ok study --compare one two
    expect_stdout 'points_drawn .* \+100.0 %'
    sed 's/"width": 32/"width": 30/; s/"repetitions": 3/"repetitions": 1/' ball.study.json >other.study.json
    expect_ok study other.study.json -o other
    expect_error 2 'no case in common' study --compare one other
}

# Groups of groups, edited at every level between frames: what is cached is what would be drawn anew.
case_edit_nested_caches() {
    cat >nest.scene.json <<JSON
{ "version": 1, "root": "field",
  "assets": { "oak": { "generate": "tree", "triangles": 2000 }, "ball": { "generate": "sphere" } },
  "groups": {
    "tile": { "grid": { "child": "oak", "count_x": 4, "count_z": 4, "spacing_x": 12, "spacing_z": 12 } },
    "block": { "grid": { "child": "tile", "count_x": 4, "count_z": 4, "spacing_x": 48, "spacing_z": 48 } },
    "field": { "grid": { "child": "block", "count_x": 4, "count_z": 4, "spacing_x": 192, "spacing_z": 192 } } },
  "cameras": [ { "name": "far", "eye": [0, 3000, 3000], "target": [0, 0, 0], "fov": 20 } ] }
JSON
    cat >edits.jsonl <<'JSON'
{"do":"render"}
{"do":"insert","group":"tile","child":"ball","translation":[3,20,0],"scale":9}
{"do":"render"}
{"do":"remove","group":"block","index":5}
{"do":"render"}
{"do":"remove","group":"field","index":2}
{"do":"insert","group":"block","child":"ball","translation":[30,40,0],"scale":40}
{"do":"render"}
JSON
    for mb in 0 64; do
        expect_ok edit nest.scene.json --script edits.jsonl -o "cache${mb}_%d.png" --width 96 --height 64 --cache-mb $mb
    done
    for i in 0 1 2 3; do
        cmp -s cache0_$i.png cache64_$i.png || fail "picture $i is another with a cache"
        [[ $i == 0 ]] || ! cmp -s cache64_$i.png cache64_$((i - 1)).png || fail "picture $i did not change"
    done
}

case_progressive() {
    write_scene
    sed -i 's/"triangles": 500/"triangles": 20000/' scene.scene.json  # small enough for points
    expect_ok render scene.scene.json -o last.png "${tiny[@]}" --progressive 'stage_%03d.png'
    for stage in 001 010 050 075 100; do
        [[ -s stage_$stage.png ]] || fail "no stage $stage"
        expect_stdout "^stage_$stage\\.png\$"
    done
    cmp -s stage_100.png last.png || fail "the last stage is not the picture"
    cmp -s stage_001.png stage_100.png && fail "one per cent is all of it"
    expect_error 2 'progressive' render scene.scene.json -o a.png --progressive stage.png
    expect_error 2 'progressive' render scene.scene.json -o a.png --progressive 'stage_%d.jpg'
}

case_build() {
    write_scene
    expect_ok build scene.scene.json --as point-blocks -o ball.stipple --set resolution=48 --json built.json
    expect_stdout 'bits a point'
    grep -q '"points_per_pixel"' built.json || fail "no report"
    expect_ok render ball.stipple -o ball.png "${tiny[@]}"
    expect_ok info ball.stipple
    expect_stdout 'point-blocks of scene\.scene\.json, [0-9,]+ points \([0-9]+ levels, the finest 0\.[0-9]+ m apart\); far away [0-9,]+ triangles stand for it'
    expect_ok info ball.stipple --json --export ball.glb
    expect_stdout '"kind": "point-blocks"'
    expect_stdout '"surfels_all_levels": '
    grep -q 'warning: ball\.stipple: a model of points' stderr.txt || fail "no warning"
    expect_error 3 "'ball\.stipple' is a model of points" build ball.stipple --as splats -o again.stipple
    # As an asset of a scene, instanced.
    cat >many.scene.json <<JSON
{ "version": 1, "assets": { "ball": { "file": "ball.stipple" } }, "root": "many",
  "groups": { "many": { "grid": { "child": "ball", "count_x": 3, "count_z": 3, "spacing_x": 2, "spacing_z": 2 } } } }
JSON
    expect_ok render many.scene.json -o many.png "${tiny[@]}"
}

case_build_hybrid() {
    write_scene
    expect_ok build scene.scene.json --as hybrid -o ball.stipple --json built.json
    expect_stdout '[0-9]+ triangles in 1 cluster \([0-9]+ % in flat ones\), 1 patch; [0-9]+ surfels'
    grep -q '"cluster_seconds"' built.json || fail "no report"
    expect_ok render ball.stipple -o ball.png "${tiny[@]}"
    expect_ok render scene.scene.json -o source.png "${tiny[@]}"
    expect_ok info ball.stipple
    expect_stdout 'hybrid of scene\.scene\.json, [0-9]+ patch(es)?, [0-9,]+ points'
    # As an asset of a scene, instanced, with every reconstruction and by rays.
    cat >many.scene.json <<JSON
{ "version": 1, "assets": { "ball": { "file": "ball.stipple" } }, "root": "many",
  "groups": { "many": { "grid": { "child": "ball", "count_x": 3, "count_z": 3, "spacing_x": 2, "spacing_z": 2 } } } }
JSON
    for reconstruct in per-pixel splat gaussian pull-push ewa; do
        expect_ok render many.scene.json -o many.png "${tiny[@]}" --reconstruct "$reconstruct"
    done
    expect_ok render many.scene.json -o rays.png "${tiny[@]}" --method raycast
    # A hybrid of hybrids.
    expect_ok build many.scene.json --as hybrid -o many.stipple --set keep=flatness --set flat_share=0.5
    expect_ok render many.stipple -o again.png "${tiny[@]}"
    expect_ok build scene.scene.json --as hybrid -o clusters.stipple --set paint=clusters --set clusters=12
    expect_error 2 "'phase'" build scene.scene.json --as hybrid -o a.stipple --set phase=1
    expect_error 2 'phase_one' build scene.scene.json --as hybrid -o a.stipple --set phase_one=11
    expect_error 2 'both' build scene.scene.json --as hybrid -o a.stipple --set keep=none
    expect_error 2 'coarser' build scene.scene.json --as hybrid -o a.stipple --set spacing=0.001
    head -c 2000 ball.stipple >cut.stipple
    expect_error 3 'cut\.stipple: ' render cut.stipple -o a.png
    printf '\x09' | dd of=ball.stipple bs=1 seek=8 conv=notrunc status=none
    expect_error 3 'has version 9; this program reads 1 to 4' render ball.stipple -o a.png
}

case_build_errors() {
    write_scene
    expect_ok build scene.scene.json --as splats -o splats.stipple --set points=2000
    expect_stdout '2000 points on meshes, [0-9]+ splats'
    for step in load points normals splats; do grep -qE "^$step: [0-9.]+ s\$" stderr.txt || fail "no line of $step"; done
    printf 'ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n1 2 3\n' >one.ply
    expect_ok build one.ply --as splats -o one.stipple
    expect_stdout ': 1 point, 1 splat; '
    expect_ok render splats.stipple -o splats.png "${tiny[@]}" --reconstruct ewa
    expect_error 2 'tolerance' build scene.scene.json --as splats -o a.stipple --set tolerance=0
    expect_error 2 "'voxels'" build scene.scene.json --as voxels -o a.stipple
    expect_error 2 'stipple' build scene.scene.json --as point-blocks -o a.png
    expect_error 2 'resolution' build scene.scene.json --as point-blocks -o a.stipple --set resolution=7
    expect_error 2 "'size'" build scene.scene.json --as point-blocks -o a.stipple --set size=7
    expect_error 3 'missing\.glb' build missing.glb --as point-blocks -o a.stipple
    expect_ok build scene.scene.json --as point-blocks -o ball.stipple --set resolution=32
    head -c 2000 ball.stipple >cut.stipple
    expect_error 3 'cut\.stipple: ' render cut.stipple -o a.png
    echo "no model" >text.stipple
    expect_error 3 'text\.stipple: is no model' render text.stipple -o a.png
    interrupt INT 1 build scene.scene.json --as point-blocks -o big.stipple --set resolution=2048
    expect_no_file 'big.stipple*'
}

declare -F "case_$3" >/dev/null || fail "there is no case $3"
"case_$3"
echo "passed"
