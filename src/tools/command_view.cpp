// SPDX-License-Identifier: Apache-2.0
// `stipple view`: a window on a scene, to look around and to plant, move and remove.
#include <scenegraph/io/load.h>
#include <tools/choose_camera.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/output_file.h>
#include <tools/progress.h>
#include <tools/signals.h>
#include <tools/view_window.h>

namespace stipple {

namespace {

struct ViewCommandLine {
    std::string scene;
    std::string camera;
    std::string save_as;
    std::string screenshot = "stipple-view.png";
    double frame_rate = 20.0;
    bool allow_outside = false;
    bool quiet = false;
    SettingOptions settings;
};

const HelpText kHelp = {"stipple view SCENE [options]",
                        "Opens a window on a scene. While the camera moves the picture is coarse, "
                        "then it becomes finer until "
                        "it is what the settings ask for. Click to plant assets of the scene file "
                        "and to select; drag, delete, "
                        "undo, save; the window lists its keys.",
                        {"stipple view scenes/forest.scene.json",
                         "stipple view my.scene.json --camera aerial --save-as my-2.scene.json"}};

void addOptions(CLI::App& app, ViewCommandLine& line) {
    app.add_option("SCENE", line.scene, kSceneFiles)->required()->group("Arguments");
    app.add_option("--camera", line.camera, "a camera of the scene (default: the first)")
        ->type_name("NAME")
        ->group("Window");
    app.add_option("--save-as", line.save_as,
                   "where Ctrl+S saves, in the scene's folder (default: NAME-edited.scene.json)")
        ->type_name("FILE")
        ->group("Window");
    app.add_option("--screenshot", line.screenshot, "what F12 writes (default: stipple-view.png)")
        ->type_name("FILE")
        ->group("Window");
    app.add_option("--frame-rate", line.frame_rate,
                   "frames a second while the camera moves; the picture is as coarse as that takes "
                   "(default 20)")
        ->type_name("N")
        ->check(CLI::Range(1.0, 1000.0).description(""))
        ->group("Window");
    line.settings.addTo(app);
    app.add_flag("--allow-outside", line.allow_outside, "let the scene's paths leave its folder")
        ->group("Running");
    app.add_flag("-q,--quiet", line.quiet, "no progress, only warnings and errors")
        ->group("Running");
}

}  // namespace

ExitCode runView(const std::vector<std::string>& arguments) {
    CLI::App app;
    ViewCommandLine line;
    addOptions(app, line);
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    checkOutputFile("--screenshot", line.screenshot, {".png", ".exr"});
    if (!line.save_as.empty()) checkOutputFile("--save-as", line.save_as, {".json"});

    const CancelFlag& cancel = cancelOnSignals();
    Progress progress(line.quiet);
    progress.update("load", 0.0);
    RenderSettings settings;
    line.settings.apply(settings);
    ThreadPool pool(settings.threads);
    Diagnostics diagnostics;
    Scene scene = loadScene(line.scene, {line.allow_outside, 0, &cancel}, pool, diagnostics);
    throwIfCancelled(cancel);
    progress.finish();
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);

    ViewOptions options;
    for (const auto& [key, value] : scene.render_defaults)
        applySetting(options.settings, key, value, scene.path);
    line.settings.apply(options.settings);
    options.settings.method = Method::kPoints;
    options.title = "Stipple - " + line.scene;
    options.screenshot_path = line.screenshot;
    options.frame_rate = line.frame_rate;
    constexpr std::string_view kSceneFile = ".scene.json";
    if (line.scene.ends_with(kSceneFile)) {
        options.save_path =
            line.save_as.empty()
                ? line.scene.substr(0, line.scene.size() - kSceneFile.size()) + "-edited.scene.json"
                : line.save_as;
    }
    const Camera camera = chooseCamera(scene, line.camera);
    std::vector<std::string> palette;
    for (const auto& [name, child] : scene.names) {
        if (child != ChildRef::group(scene.root)) palette.push_back(name);
    }
    LiveScene live(std::move(scene), pool);
    runViewWindow(live, camera, palette, options);
    return ExitCode::kDone;
}

}  // namespace stipple
