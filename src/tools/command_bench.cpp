// SPDX-License-Identifier: Apache-2.0
// `stipple bench`: how fast points are beside rays and the z-buffer, at equal quality, in one run.
#include <core/nearest_name.h>
#include <core/stopwatch.h>
#include <scenegraph/io/load.h>
#include <tools/bench.h>
#include <tools/choose_camera.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/output_file.h>
#include <tools/progress.h>
#include <tools/signals.h>

#include <algorithm>
#include <cstdio>
#include <iostream>

namespace stipple {

namespace {

struct CommandLine {
    BenchOptions bench;
    std::vector<std::string> cameras;
    std::vector<std::string> against = {"raycast", "zbuffer"};
    std::string json;
    int width = 640, height = 480;
    bool quiet = false;
    SettingOptions settings;
};

const std::vector<std::string> kOpponents = {"raycast", "zbuffer"};
// What the bench chooses itself, and what has options of its own.
const std::vector<std::string> kOwnKeys = {"method", "samples", "subpixels", "width", "height"};

const HelpText kHelp = {
    "stipple bench SCENE [--camera NAME]... [--against raycast,zbuffer] [--json FILE]",
    "Measures the point method beside ray casting and the z-buffer, all in one run and taking "
    "turns: the time to reach the quality (PSNR) of 1, 4 and 16 rays a pixel, first and later "
    "frames, memory, and what the machine allows at most. Prints a table. References of many rays "
    "are kept in $STIPPLE_CACHE, $XDG_CACHE_HOME/stipple or ~/.cache/stipple.",
    {"stipple bench scenes/forest.scene.json --json forest.json",
     "stipple bench tree.glb --against raycast --width 320 --height 240 --reference-rays 256"}};

void addOptions(CLI::App& app, CommandLine& line) {
    app.add_option("SCENE", line.bench.scene_path, kSceneFiles)->required()->group("Arguments");
    app.add_option("--camera", line.cameras,
                   "a camera of the scene; repeatable (default: all of them)")
        ->type_name("NAME")
        ->allow_extra_args(false)
        ->group("Measured");
    app.add_option("--against", line.against,
                   "the other methods, separated by commas: raycast, zbuffer (default: both)")
        ->type_name("METHODS")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->group("Measured");
    app.add_option("--width", line.width, "width of the pictures (pixels, default 640)")
        ->type_name("N")
        ->check(CLI::Range(1, 65536).description(""))
        ->group("Measured");
    app.add_option("--height", line.height, "height of the pictures (pixels, default 480)")
        ->type_name("N")
        ->check(CLI::Range(1, 65536).description(""))
        ->group("Measured");
    app.add_option("--repetitions", line.bench.repetitions,
                   "how often each frame and each first picture is timed (default 5)")
        ->type_name("N")
        ->check(CLI::Range(1, 1000).description(""))
        ->group("Measured");
    app.add_option("--reference-rays", line.bench.reference_rays,
                   "rays a pixel of the reference (default 1024)")
        ->type_name("N")
        ->check(CLI::Range(1, 10000).description(""))
        ->group("Measured");
    app.add_option("--json", line.json, "write all that was measured as JSON")
        ->type_name("FILE")
        ->group("Running");
    line.settings.addTo(app, {"seed", "threads", "cache_mb"});
    app.add_flag("--allow-outside", line.bench.allow_outside,
                 "let the scene's paths leave its folder")
        ->group("Running");
    app.add_flag("-q,--quiet", line.quiet, "no progress, only warnings and errors")
        ->group("Running");
}

void checkCommandLine(CommandLine& line) {
    for (const std::string& name : line.against) {
        if (std::find(kOpponents.begin(), kOpponents.end(), name) != kOpponents.end()) continue;
        const std::string nearest = nearestName(name, kOpponents);
        throw Error(ErrorCode::kInvalidArgument, "--against",
                    "'" + name + "' is none of raycast and zbuffer" +
                        (nearest.empty() ? "" : "; did you mean '" + nearest + "'?"));
    }
    const auto has = [&](const char* name) {
        return std::find(line.against.begin(), line.against.end(), name) != line.against.end();
    };
    line.bench.against_raycast = has("raycast");
    line.bench.against_zbuffer = has("zbuffer");
    for (const std::string& key : kOwnKeys) {
        if (line.settings.sets(key))
            throw Error(ErrorCode::kInvalidArgument, "--set",
                        key + " cannot be set for bench; --help says what can");
    }
    if (!line.json.empty()) checkOutputFile("--json", line.json, {});
    makeView(Camera(), line.width, line.height, 1);  // throws for absurd sizes
}

constexpr int kEdits = 20000, kEditedFrames = 48;

std::vector<const Camera*> chooseCameras(const Scene& scene,
                                         const std::vector<std::string>& names) {
    std::vector<const Camera*> cameras;
    for (const std::string& name : names) cameras.push_back(&chooseCamera(scene, name));
    if (names.empty()) {
        chooseCamera(scene, "");  // throws if there is none
        for (const Camera& camera : scene.cameras) cameras.push_back(&camera);
    }
    return cameras;
}

RenderSettings baseSettings(const CommandLine& line, const Scene& scene) {
    RenderSettings settings;
    for (const auto& [key, value] : scene.render_defaults)
        applySetting(settings, key, value, scene.path);
    line.settings.apply(settings);
    settings.width = line.width;
    settings.height = line.height;
    settings.shadows = settings.ao = false;  // not what is compared
    return settings;
}

}  // namespace

ExitCode runBench(const std::vector<std::string>& arguments) {
    CLI::App app;
    CommandLine line;
    addOptions(app, line);
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    checkCommandLine(line);

    const CancelFlag& cancel = cancelOnSignals();
    Progress progress(line.quiet);
    BenchResult result;
    result.command = joinCommand("bench", arguments);
    RenderSettings command_line_settings;
    line.settings.apply(command_line_settings);
    ThreadPool pool(command_line_settings.threads);
    progress.update("load", 0.0);
    const Stopwatch load_watch;
    Diagnostics diagnostics;
    const LoadOptions load_options = {line.bench.allow_outside, 0, &cancel};
    const Scene scene = loadScene(line.bench.scene_path, load_options, pool, diagnostics);
    throwIfCancelled(cancel);
    result.load_seconds = load_watch.seconds();
    progress.finish();
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);

    const std::vector<const Camera*> cameras = chooseCameras(scene, line.cameras);
    RenderSettings settings = baseSettings(line, scene);
    settings.threads = command_line_settings.threads;
    result.scene = sceneSize(scene);
    if (line.bench.against_zbuffer && result.scene.triangles_total > kZBufferLimit) {
        char text[120];
        std::snprintf(text, sizeof text,
                      "zbuffer is left out: it draws every triangle, and these are more than %.0e",
                      kZBufferLimit);
        result.left_out.push_back(text);
        line.bench.against_zbuffer = false;
    }
    result.options = line.bench;
    result.width = line.width;
    result.height = line.height;
    result.threads = pool.threadCount();
    MachineLimit limit(settings.tile_size, pool);
    result.limit_buffer_bytes = limit.bufferBytes();
    for (const Camera* camera : cameras) {
        result.cameras.push_back(benchCamera(
            scene, *camera, settings, line.bench, pool, limit, cancel,
            [&](const std::string& what, double fraction) { progress.update(what, fraction); }));
        progress.finish();
        // A camera takes minutes: what is known is shown.
        if (result.cameras.size() == 1) std::cout << benchHeading(result);
        std::cout << cameraTable(result.cameras.back(), result) << std::flush;
    }
    progress.update("edits", 0.0);
    result.edits = measureEdits(scene, kEdits, line.bench.against_raycast, pool);
    RenderSettings edited_settings = settings;
    edited_settings.subpixels = 2;
    result.edits.frames =
        measureEditedFrames(scene, *cameras[0], edited_settings, kEditedFrames, pool);
    progress.finish();
    std::cout << editTable(result.edits);
    if (!line.json.empty()) saveFile(line.json, benchJson(result));
    return ExitCode::kDone;
}

}  // namespace stipple
