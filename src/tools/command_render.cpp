// SPDX-License-Identifier: Apache-2.0
// `stipple render`: check the command line, load, draw, write.
#include <core/nearest_name.h>
#include <core/stopwatch.h>
#include <core/tone.h>
#include <render/renderer.h>
#include <scenegraph/io/load.h>
#include <tools/choose_camera.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/frame_names.h>
#include <tools/output_file.h>
#include <tools/progress.h>
#include <tools/signals.h>
#include <tools/stats_json.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <string_view>

namespace stipple {

namespace {

struct RenderOptions {
    std::string scene;
    std::string output;
    std::string camera;
    std::string path;
    int frames = 0;  // of the path; 0: not given
    std::vector<std::string> aovs;
    bool transparent = false;
    std::string progressive;
    int repeat = 1;
    uint64_t memory_limit_mb = 0;
    std::string debug_pixel;
    bool allow_outside = false;
    std::string stats;
    bool quiet = false;
    SettingOptions settings;
};

const std::vector<std::string> kAovNames = {"depth",  "normal",   "albedo",
                                            "object", "coverage", "count"};

const HelpText kHelp = {
    "stipple render SCENE -o OUT.png|OUT.exr [options]",
    "Draws a picture of a scene and prints its path. SCENE is a scene file (*.scene.json) or a "
    "single model (.gltf, .glb, .ply, .obj), for which a camera and a light are made. With --path, "
    "one picture for each place along a camera path.",
    {"stipple render scenes/forest.scene.json -o forest.png --width 1920 --height 1080",
     "stipple render scenes/forest.scene.json --path flight --frames 48 -o flight_%04d.png",
     "stipple render tree.glb -o tree.exr --aov depth,normal --samples 4 --stats tree.json"}};

void addOptions(CLI::App& app, RenderOptions& options) {
    app.add_option("SCENE", options.scene, kSceneFiles)->required()->group("Arguments");
    app.add_option(
           "-o,--output", options.output,
           "the picture: .png (sRGB, 8 bits) or .exr (linear floats); appears whole or not at all")
        ->required()
        ->type_name("FILE")
        ->group("Picture");
    app.add_option("--camera", options.camera, "a camera of the scene (default: the first)")
        ->type_name("NAME")
        ->group("Picture");
    app.add_option(
           "--path", options.path,
           "a camera path of the scene, drawn as --frames pictures; -o is a pattern such as "
           "out_%04d.png")
        ->type_name("NAME")
        ->group("Picture");
    app.add_option("--frames", options.frames,
                   "pictures along the path, numbered from 0; first and last are its ends")
        ->type_name("N")
        ->check(CLI::Range(1, 1000000).description(""))
        ->group("Picture");
    app.add_option("--aov", options.aovs,
                   "further channels of an .exr, separated by commas: depth, normal, albedo, "
                   "object, coverage, count")
        ->type_name("NAMES")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->group("Picture");
    app.add_flag("--transparent", options.transparent,
                 "leave the background out; alpha is coverage")
        ->group("Picture");
    app.add_option(
           "--progressive", options.progressive,
           "also pictures of 1, 10, 50, 75 and 100 % of the samples, as they come; a pattern "
           "such as OUT_%03d.png, numbered by the per cent")
        ->type_name("PATTERN")
        ->group("Picture");
    options.settings.addTo(app);
    app.add_option(
           "--repeat", options.repeat,
           "draw the frame this often; --stats lists the times, the first one cold (default 1)")
        ->type_name("N")
        ->check(CLI::Range(1, 100000).description(""))
        ->group("Running");
    app.add_option("--memory-limit", options.memory_limit_mb,
                   "most memory that loading may take, in MB (default: the machine's)")
        ->type_name("MB")
        ->group("Running");
    app.add_option("--debug-pixel", options.debug_pixel,
                   "print to stderr what happens at this pixel")
        ->type_name("X,Y")
        ->group("Running");
    app.add_flag("--allow-outside", options.allow_outside, "let the scene's paths leave its folder")
        ->group("Running");
    app.add_option("--stats", options.stats, "write times, counters and memory as JSON")
        ->type_name("FILE.json")
        ->group("Running");
    app.add_flag("-q,--quiet", options.quiet, "no progress, only warnings and errors")
        ->group("Running");
}

// Throws unless `text` is "X,Y" within the picture.
void checkDebugPixel(const std::string& text, const RenderSettings& settings) {
    int x = 0, y = 0, length = 0;
    if (std::sscanf(text.c_str(), "%d,%d%n", &x, &y, &length) != 2 ||
        size_t(length) != text.size()) {
        throw Error(ErrorCode::kInvalidArgument, "--debug-pixel", "'" + text + "' is not X,Y");
    }
    if (x < 0 || y < 0 || x >= settings.width || y >= settings.height) {
        throw Error(ErrorCode::kInvalidArgument, "--debug-pixel",
                    text + " is outside the picture of " + std::to_string(settings.width) + " x " +
                        std::to_string(settings.height));
    }
}

// The picture's file, or those of the path's pictures.
std::vector<std::string> outputNames(const RenderOptions& options) {
    if (options.path.empty()) return {options.output};
    std::vector<std::string> names;
    for (int i = 0; i < options.frames; ++i) names.push_back(frameName("-o", options.output, i));
    return names;
}

// Per cent of the samples that --progressive shows. Points are prefixes of their lists, so each
// picture holds the points of the one before.
constexpr int kStages[] = {1, 10, 50, 75, 100};

// --path and --frames belong together; what chooses one frame contradicts them.
void checkPathOptions(const RenderOptions& options) {
    if (options.path.empty() != (options.frames == 0)) {
        throw Error(ErrorCode::kInvalidArgument, options.path.empty() ? "--frames" : "--path",
                    options.path.empty() ? "needs --path" : "needs --frames");
    }
    if (options.path.empty()) return;
    const char* other = !options.camera.empty()        ? "--camera"
                        : options.repeat > 1           ? "--repeat"
                        : !options.debug_pixel.empty() ? "--debug-pixel"
                        : !options.progressive.empty() ? "--progressive"
                                                       : nullptr;
    if (other)
        throw Error(ErrorCode::kInvalidArgument, "--path", std::string("contradicts ") + other);
}

// What can be said about the command line before the scene is loaded.
void checkOptions(const RenderOptions& options) {
    checkPathOptions(options);
    for (const std::string& name : outputNames(options))
        checkOutputFile("-o", name, {".png", ".exr"});
    if (!options.stats.empty()) checkOutputFile("--stats", options.stats, {});
    for (const int stage : kStages) {
        if (options.progressive.empty()) break;
        checkOutputFile("--progressive", frameName("--progressive", options.progressive, stage),
                        {".png", ".exr"});
    }
    for (const std::string& aov : options.aovs) {
        if (std::find(kAovNames.begin(), kAovNames.end(), aov) != kAovNames.end()) continue;
        const std::string nearest = nearestName(aov, kAovNames);
        throw Error(
            ErrorCode::kInvalidArgument, "--aov",
            "unknown channel '" + aov + "'" +
                (nearest.empty() ? "; --help lists them" : "; did you mean '" + nearest + "'?"));
    }
    if (!options.aovs.empty() && lowerExtension(options.output) != ".exr") {
        throw Error(ErrorCode::kInvalidArgument, "--aov",
                    "needs an .exr output; .png holds colour only");
    }
    RenderSettings settings;
    options.settings.apply(settings);
    makeView(Camera(), settings.width, settings.height,
             settings.subpixels);  // throws for absurd sizes
}

// Defaults, then the scene file's (which the loader has checked), then the command line's.
RenderSettings effectiveSettings(const RenderOptions& options, const Scene& scene) {
    RenderSettings settings;
    for (const auto& [key, value] : scene.render_defaults)
        applySetting(settings, key, value, scene.path);
    options.settings.apply(settings);
    return settings;
}

// What the pictures are seen with, in order.
std::vector<Camera> chooseCameras(const Scene& scene, const RenderOptions& options) {
    if (options.path.empty()) return {chooseCamera(scene, options.camera)};
    const CameraPath* path = scene.findPath(options.path);
    if (!path) {
        std::string known;
        for (const CameraPath& p : scene.paths) known += (known.empty() ? "" : ", ") + p.name;
        throw Error(ErrorCode::kInvalidArgument, "--path",
                    "there is no '" + options.path + "'; " + scene.path +
                        (known.empty() ? " has none" : " has: " + known));
    }
    std::vector<Camera> cameras;
    for (int i = 0; i < options.frames; ++i)
        cameras.push_back(cameraAt(*path, i / std::max(options.frames - 1.0, 1.0)));
    return cameras;
}

// Few samples first: what is drawn by points; what other methods take is theirs.
void drawStages(const RenderOptions& options, FrameRequest request, Renderer& renderer,
                RunStats& stats) {
    const double samples = request.settings.samples;
    constexpr double kLeastSamples = 0.001;  // as the settings table has it
    for (const int stage : kStages) {
        request.settings.samples = std::max(kLeastSamples, samples * stage / 100.0);
        if (request.settings.method == Method::kRaycast)
            request.settings.samples = std::max(1.0, std::round(request.settings.samples));
        Frame frame = renderer.render(request);
        stats.frames.push_back(frame.stats);
        const std::string name = frameName("--progressive", options.progressive, stage);
        if (lowerExtension(name) == ".png") applyTone(request.settings.tone, frame.image);
        saveImage(frame.image, name);
        std::cout << name << std::endl;  // now: others may be waiting for it
    }
}

// What an .exr says about how it was made. A .png says nothing, so that equal pictures are equal
// files.
std::map<std::string, std::string> imageMetadata(const RunStats& stats, const std::string& output) {
    if (lowerExtension(output) != ".exr") return {};
    std::map<std::string, std::string> metadata = {{"stipple:version", STIPPLE_VERSION},
                                                   {"stipple:command", stats.command},
                                                   {"stipple:camera", stats.camera}};
    for (const SettingInfo& info : settingsTable()) {
        metadata["stipple:" + info.key] = settingValue(stats.settings, info.key);
    }
    return metadata;
}

}  // namespace

ExitCode runRender(const std::vector<std::string>& arguments) {
    CLI::App app;
    RenderOptions options;
    addOptions(app, options);
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    checkOptions(options);

    const CancelFlag& cancel = cancelOnSignals();
    Progress progress(options.quiet);
    RunStats stats;
    stats.command = joinCommand("render", arguments);
    stats.scene_path = options.scene;

    progress.update("load", 0.0);
    const Stopwatch load_watch;
    Diagnostics diagnostics;
    RenderSettings command_line_settings;
    options.settings.apply(command_line_settings);
    ThreadPool load_pool(command_line_settings.threads);
    const LoadOptions load_options = {options.allow_outside, options.memory_limit_mb, &cancel};
    const Scene scene = loadScene(options.scene, load_options, load_pool, diagnostics);
    throwIfCancelled(cancel);
    stats.load_seconds = load_watch.seconds();
    progress.finish();
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);

    const std::vector<Camera> cameras = chooseCameras(scene, options);
    const std::vector<std::string> outputs = outputNames(options);
    // A single picture tells its phases, many how far they are.
    const bool is_series = !options.path.empty();
    size_t done = 0;
    FrameRequest request;
    request.settings = effectiveSettings(options, scene);
    request.transparent = options.transparent;
    request.aovs = options.aovs;
    request.debug_pixel = options.debug_pixel;
    request.cancel = &cancel;
    request.progress = [&](const char* phase, double fraction) {
        if (!is_series) return progress.update(phase, fraction);
        const std::string_view name = phase;
        const double part = name == "draw" ? fraction : name == "write" ? 1.0 : 0.0;
        progress.update("pictures", (double(done) + part) / double(outputs.size()));
    };
    if (!options.debug_pixel.empty()) checkDebugPixel(options.debug_pixel, request.settings);
    stats.settings = request.settings;
    stats.camera = cameras.front().name;
    stats.scene = sceneSize(scene);
    stats.warnings = diagnostics.warnings;

    const Stopwatch build_watch;
    ThreadPool pool(request.settings.threads);
    Renderer renderer(scene, pool);
    stats.build_seconds = build_watch.seconds();
    for (; done < outputs.size(); ++done) {
        request.camera = cameras[done];
        if (!options.progressive.empty()) drawStages(options, request, renderer, stats);
        Frame frame;
        for (int i = 0; i < options.repeat; ++i) {
            frame = renderer.render(request);
            stats.frames.push_back(frame.stats);
            throwIfCancelled(cancel);
        }
        if (!frame.stats.debug_text.empty())
            std::fprintf(stderr, "%s\n", frame.stats.debug_text.c_str());
        request.progress("write", 0.0);
        const Stopwatch write_watch;
        if (lowerExtension(outputs[done]) == ".png") applyTone(request.settings.tone, frame.image);
        saveImage(frame.image, outputs[done], imageMetadata(stats, outputs[done]));
        stats.write_seconds += write_watch.seconds();
        if (is_series)
            std::cout << outputs[done] << std::endl;  // now: others may be waiting for it
    }
    if (!options.stats.empty()) saveFile(options.stats, statsJson(stats));
    progress.finish();
    if (!is_series) std::cout << options.output << "\n";
    return ExitCode::kDone;
}

}  // namespace stipple
