// SPDX-License-Identifier: Apache-2.0
// `stipple edit`: a scene that is changed line by line, looked at and saved.
#include <core/stopwatch.h>
#include <core/tone.h>
#include <render/live_scene.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/load.h>
#include <scenegraph/io/new_asset.h>
#include <scenegraph/io/scene_save.h>
#include <tools/choose_camera.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/edit_script.h>
#include <tools/frame_names.h>
#include <tools/output_file.h>
#include <tools/progress.h>
#include <tools/signals.h>
#include <tools/stats_json.h>

#include <algorithm>
#include <fstream>
#include <iostream>

namespace stipple {

namespace {

struct EditOptions {
    std::string scene;
    std::string script;
    std::string output;
    std::string stats;
    uint64_t memory_limit_mb = 0;
    bool allow_outside = false;
    bool quiet = false;
    SettingOptions settings;
};

const HelpText kHelp = {
    "stipple edit SCENE --script EDITS.jsonl|- [-o FRAME_%04d.png] [options]",
    "Changes a scene and draws it, one JSON object a line: {\"do\": \"insert\", \"child\": "
    "\"oak\", "
    "\"group\": \"trees\", \"translation\": [10, 0, 5]}. Commands are insert, remove, move, "
    "replace, restore, asset, camera, render and save; docs/cli.md lists their keys. A line with "
    "an error is "
    "reported and changes nothing; the others are done. Prints a line of JSON for each instance "
    "inserted, and the path of each file written.",
    {"stipple edit scenes/forest.scene.json --script edits.jsonl -o frame_%04d.png",
     "echo '{\"do\": \"remove\", \"object\": \"12\"}' | stipple edit my.scene.json --script -"}};

void addOptions(CLI::App& app, EditOptions& options) {
    app.add_option("SCENE", options.scene, kSceneFiles)->required()->group("Arguments");
    app.add_option("--script", options.script, "the edits, one a line; - is standard input")
        ->required()
        ->type_name("EDITS.jsonl")
        ->group("Edits");
    app.add_option("-o,--output", options.output,
                   "pictures of \"render\" lines that name none, numbered from 0: frame_%04d.png")
        ->type_name("PATTERN")
        ->group("Picture");
    options.settings.addTo(app);
    app.add_option("--memory-limit", options.memory_limit_mb,
                   "most memory that loading may take, in MB (default: the machine's)")
        ->type_name("MB")
        ->group("Running");
    app.add_flag("--allow-outside", options.allow_outside, "let the scene's paths leave its folder")
        ->group("Running");
    app.add_option("--stats", options.stats, "write times of edits and frames as JSON")
        ->type_name("FILE.json")
        ->group("Running");
    app.add_flag("-q,--quiet", options.quiet, "no progress, only warnings and errors")
        ->group("Running");
}

class EditSession {
public:
    EditSession(const EditOptions& options, Scene scene, ThreadPool& pool,
                const RenderSettings& settings, const CancelFlag& cancel)
        : options_(options), path_(scene.path), pool_(pool), live_(std::move(scene), pool) {
        request_.settings = settings;
        request_.cancel = &cancel;
        live_.edit([&](SceneEditor& editor) {
            request_.camera = chooseCamera(editor.scene(), "");
            for (uint32_t g = 0; g < editor.scene().groups.size(); ++g) editor.open(g);
        });
    }

    // Throws for a line that cannot be done; then it has changed nothing.
    void run(const std::string& line, const std::string& where) {
        const Json command = parseJson(line, where);
        if (!command.is_object()) throw Error(ErrorCode::kInvalidScene, "", "is no JSON object");
        const std::string what = stringOf(command, "do");
        bool is_edit = false;
        InstanceId edited;
        live_.edit([&](SceneEditor& editor) {
            const Stopwatch watch;
            is_edit = runEdit(command, editor, memory_, edited);
            if (is_edit) seconds_[what].push_back(watch.seconds());
            if (is_edit && what == "insert") {
                Json result = {{"group", editor.scene().groups[edited.group].name},
                               {"index", edited.index}};
                std::cout << result.dump() << std::endl;
            }
            if (what == "camera") request_.camera = cameraOf(command, editor.scene());
            if (what == "asset") addAsset(command, editor);
            if (what == "save") save(command, editor);
        });
        if (what == "render") render(command);
        if (!is_edit && what != "asset" && what != "camera" && what != "save" && what != "render") {
            throw Error(
                ErrorCode::kInvalidScene, "/do",
                "there is no " + inQuotes(what) +
                    "; insert, remove, move, replace, restore, asset, camera, render and save are");
        }
    }

    std::string stats() const {
        Json json = {{"version", STIPPLE_VERSION}, {"scene", path_}, {"frames", frames_}};
        json["edits"] = Json::object();
        for (auto [name, seconds] : seconds_) {
            std::sort(seconds.begin(), seconds.end());
            const auto quantile = [&](double q) {
                return seconds[std::min(seconds.size() - 1, size_t(q * double(seconds.size())))];
            };
            json["edits"][name] = {{"count", seconds.size()},
                                   {"median_seconds", quantile(0.5)},
                                   {"p99_seconds", quantile(0.99)},
                                   {"longest_seconds", seconds.back()}};
        }
        json["memory"] = {{"peak_bytes", peakMemoryBytes()}};
        return json.dump(2) + "\n";
    }

private:
    void render(const Json& command) {
        checkKeys(command, {"output"});
        std::string output = stringOf(command, "output", "");
        if (output.empty() && options_.output.empty())
            throw Error(ErrorCode::kInvalidScene, "",
                        "needs \"output\", or -o on the command line");
        if (output.empty()) output = frameName("-o", options_.output, next_frame_++);
        checkOutputFile("/output", output, {".png", ".exr"});
        Frame frame = live_.render(request_);
        frames_.push_back(frame.stats.seconds);
        if (lowerExtension(output) == ".png") applyTone(request_.settings.tone, frame.image);
        saveImage(frame.image, output, {});
        std::cout << output << std::endl;
    }

    void addAsset(const Json& command, SceneEditor& editor) {
        const auto [name, asset] = assetOf(command, editor.scene());
        Diagnostics diagnostics;
        const LoadOptions load_options = {options_.allow_outside, options_.memory_limit_mb,
                                          request_.cancel};
        const Stopwatch watch;
        NewAsset added = loadNewAsset(path_, name, asset, load_options, pool_, diagnostics);
        editor.addAsset(name, std::move(added.scene), added.child, asset.dump());
        seconds_["asset"].push_back(watch.seconds());
        for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);
    }

    void save(const Json& command, const SceneEditor& editor) {
        checkKeys(command, {"output"});
        const std::string output = stringOf(command, "output");
        saveScene(editor.scene(), editor.addedAssets(), output);
        std::cout << output << std::endl;
    }

    const EditOptions& options_;
    std::string path_;
    ThreadPool& pool_;
    LiveScene live_;
    FrameRequest request_;
    EditMemory memory_;
    int next_frame_ = 0;
    std::map<std::string, std::vector<double>> seconds_;  // by command
    std::vector<double> frames_;
};

}  // namespace

ExitCode runEditScene(const std::vector<std::string>& arguments) {
    CLI::App app;
    EditOptions options;
    addOptions(app, options);
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    if (!options.output.empty())
        checkOutputFile("-o", frameName("-o", options.output, 0), {".png", ".exr"});
    if (!options.stats.empty()) checkOutputFile("--stats", options.stats, {});
    RenderSettings command_line_settings;
    options.settings.apply(command_line_settings);
    std::ifstream file;
    if (options.script != "-") {
        file.open(options.script);
        if (!file) throw Error(ErrorCode::kFileNotFound, options.script, "cannot be read");
    }
    std::istream& script = options.script == "-" ? std::cin : file;

    const CancelFlag& cancel = cancelOnSignals();
    Progress progress(options.quiet);
    progress.update("load", 0.0);
    Diagnostics diagnostics;
    ThreadPool pool(command_line_settings.threads);
    const LoadOptions load_options = {options.allow_outside, options.memory_limit_mb, &cancel};
    Scene scene = loadScene(options.scene, load_options, pool, diagnostics);
    throwIfCancelled(cancel);
    progress.finish();
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);
    RenderSettings settings;
    for (const auto& [key, value] : scene.render_defaults)
        applySetting(settings, key, value, scene.path);
    options.settings.apply(settings);

    EditSession session(options, std::move(scene), pool, settings, cancel);
    bool all_done = true;
    size_t number = 0;
    for (std::string line; std::getline(script, line);) {
        throwIfCancelled(cancel);
        ++number;
        if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
        const std::string where = options.script + ": line " + std::to_string(number);
        try {
            session.run(line, where);
        } catch (const Error& error) {
            if (error.code() == ErrorCode::kCancelled) throw;
            all_done = false;
            const std::string text = error.what();
            printMessage(text.starts_with(where) ? text : where + ": " + text);
        }
    }
    if (!options.stats.empty()) saveFile(options.stats, session.stats());
    return all_done ? ExitCode::kDone : ExitCode::kInput;
}

}  // namespace stipple
