// SPDX-License-Identifier: Apache-2.0
// `stipple build`: from a scene or model to a prebuilt model.
#include <core/image.h>
#include <render/build_model.h>
#include <scenegraph/io/load.h>
#include <scenegraph/io/splats.h>
#include <scenegraph/io/surfel_file.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/output_file.h>
#include <tools/progress.h>
#include <tools/signals.h>

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

namespace stipple {

namespace {

const HelpText kHelp = {
    "stipple build ASSET --as point-blocks|splats -o MODEL.stipple [--set key=value]...",
    "Makes a model of points from a model or a scene: points on its surface at several densities, "
    "in blocks that know from where they are seen. Scenes use it like any other model. "
    "point-blocks: rays from 32 directions sample the surface, and as many samples are kept as "
    "leave no hole at unit magnification, where the model is `resolution` pixels wide. --set: "
    "resolution (256), tolerance_angle (25), lattice (triangles|squares), block_size (8), scored "
    "(on|off), partial (on|off), directions (6|32|128). splats: of a point cloud, as few discs as "
    "cover all points within `tolerance` (0.1, per cent of the diagonal) and color_tolerance "
    "(0.15); neighbours (12), points (200000, taken on meshes), relax (on|off), naive (on|off).",
    {"stipple build tree.glb --as point-blocks -o tree.stipple",
     "stipple build bunny.ply --as point-blocks --set resolution=512 -o bunny.stipple",
     "stipple build scan.ply --as splats --set tolerance=0.05 -o scan.stipple",
     "stipple render tree.stipple -o tree.png"}};

}  // namespace

ExitCode runBuild(const std::vector<std::string>& arguments) {
    CLI::App app;
    std::string input, kind, output, json;
    std::vector<std::string> sets;
    bool allow_outside = false, quiet = false;
    int threads = 0;
    uint64_t memory_limit_mb = 0;
    app.add_option("ASSET", input, "*.scene.json, .gltf, .glb, .ply or .obj")
        ->required()
        ->group("Arguments");
    app.add_option("--as", kind, "the kind of model: point-blocks or splats")
        ->required()
        ->type_name("KIND")
        ->group("Model");
    app.add_option("-o,--output", output, "the model: .stipple; appears whole or not at all")
        ->required()
        ->type_name("FILE")
        ->group("Model");
    app.add_option("--set", sets, "an option of the kind; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false)
        ->group("Model");
    app.add_option("--json", json, "write what was built, and how long it took, as JSON")
        ->type_name("FILE")
        ->group("Running");
    app.add_option("--threads", threads, "worker threads; 0 is one a core (default 0)")
        ->type_name("N")
        ->check(CLI::Range(0, 1024).description(""))
        ->group("Running");
    app.add_option("--memory-limit", memory_limit_mb,
                   "most memory that loading may take, in MB (default: the machine's)")
        ->type_name("MB")
        ->group("Running");
    app.add_flag("--allow-outside", allow_outside, "let a scene's paths leave its folder")
        ->group("Running");
    app.add_flag("-q,--quiet", quiet, "no progress, only warnings and errors")->group("Running");
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    const bool as_splats = kind == "splats";
    if (kind != "point-blocks" && !as_splats)
        throw Error(ErrorCode::kInvalidArgument, "--as",
                    "'" + kind + "' is not point-blocks or splats");
    checkOutputFile("-o", output, {".stipple"});
    if (!json.empty()) checkOutputFile("--json", json, {});
    PointBlockOptions block_options;
    SplatOptions splat_options;
    for (const std::string& set : sets) {
        const size_t equals = set.find('=');
        if (equals == std::string::npos)
            throw Error(ErrorCode::kInvalidArgument, "--set", "'" + set + "' is not KEY=VALUE");
        const std::string key = set.substr(0, equals), value = set.substr(equals + 1);
        as_splats ? applyOption(splat_options, key, value) : applyOption(block_options, key, value);
    }

    const CancelFlag& cancel = cancelOnSignals();
    Progress progress(quiet);
    progress.update("load", 0.0);
    ThreadPool pool(threads);
    Diagnostics diagnostics;
    const Scene scene =
        loadScene(input, {allow_outside, memory_limit_mb, &cancel}, pool, diagnostics);
    throwIfCancelled(cancel);
    progress.finish();
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);

    PointBlockReport blocks_report;
    SplatReport splats_report;
    const auto onProgress = [&](double fraction) { progress.update("build", fraction); };
    SurfelModel model;
    try {
        model = as_splats
                    ? buildSplats(scene, splat_options, pool, cancel, onProgress, splats_report)
                    : buildPointBlockModel(scene, block_options, pool, cancel, onProgress,
                                           blocks_report);
    } catch (const Error& error) {
        if (error.where().empty() && error.code() == ErrorCode::kInvalidArgument)
            throw Error(ErrorCode::kInvalidScene, input, error.what());
        throw;
    }
    model.source = std::filesystem::path(input).filename().string();
    const std::string text = surfelFileText(model);
    saveFile(output, text);
    progress.finish();
    size_t blocks = 0, surfels = 0;
    for (const SurfelLevel& level : model.levels)
        blocks += level.blocks.size(), surfels += level.size();
    nlohmann::ordered_json result = {{"schema", 1},
                                     {"kind", model.kind},
                                     {"surfels", model.levels[0].size()},
                                     {"blocks", model.levels[0].blocks.size()},
                                     {"levels", model.levels.size()},
                                     {"surfels_all_levels", surfels},
                                     {"blocks_all_levels", blocks},
                                     {"bytes", text.size()}};
    if (as_splats) {
        const SplatReport& r = splats_report;
        std::printf(
            "%s: %llu points, %llu splats; points lie within %.3g m of them, %.3g m on average\n",
            output.c_str(), static_cast<unsigned long long>(r.points),
            static_cast<unsigned long long>(r.splats), r.largest_distance, r.mean_distance);
        result.update({{"seconds", r.seconds},
                       {"points", r.points},
                       {"tolerance", r.tolerance},
                       {"largest_distance", r.largest_distance},
                       {"mean_distance", r.mean_distance}});
    } else {
        const PointBlockReport& r = blocks_report;
        std::printf(
            "%s: %zu points in %zu blocks at the finest of %zu levels, %zu points in all; "
            "%.1f bits a point\n",
            output.c_str(), model.levels[0].size(), model.levels[0].blocks.size(),
            model.levels.size(), surfels, 8.0 * double(text.size()) / double(surfels));
        result.update({{"seconds", r.seconds},
                       {"rays", r.rays},
                       {"samples_hit", r.samples_hit},
                       {"samples_chosen", r.samples_chosen},
                       {"points_per_pixel", r.per_pixel}});
    }
    if (!json.empty()) saveFile(json, result.dump(2) + "\n");
    return ExitCode::kDone;
}

}  // namespace stipple
