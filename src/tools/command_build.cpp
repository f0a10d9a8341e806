// SPDX-License-Identifier: Apache-2.0
// `stipple build`: from a scene or model to a prebuilt model.
#include <core/image.h>
#include <render/build_model.h>
#include <scenegraph/io/hybrid.h>
#include <scenegraph/io/hybrid_file.h>
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
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

namespace stipple {

namespace {

const HelpText kHelp = {
    "stipple build ASSET --as point-blocks|splats|hybrid -o MODEL.stipple [--set key=value]...",
    "Makes a model of points from a model or a scene: points on its surface at several densities, "
    "in blocks that know from where they are seen. Scenes use it like any other model. "
    "point-blocks: rays from 32 directions sample the surface, and as many samples are kept as "
    "leave no hole at unit magnification, where the model is `resolution` pixels wide. --set: "
    "resolution (256), tolerance_angle (25), lattice (triangles|squares), block_size (8), scored "
    "(on|off), partial (on|off), complete (on|off), directions (6|32|128). splats: of a point "
    "cloud, as few "
    "ellipses, cut at creases and borders, as cover all points within `tolerance` (0.1, per cent "
    "of the "
    "diagonal) and color_tolerance "
    "(0.15); neighbours (12), points (200000, taken on meshes), shape "
    "(ellipses|circles), cuts (on|off), relax (on|off), naive (on|off). hybrid: patches "
    "of the surface, each as triangles and as surfels, drawn by what costs less in a view: "
    "phase_one (0.3), phase_two (0.1), clusters (0: by these costs), flat_share (0), largest "
    "(1000), sampling (3), spacing (0), keep (both|triangles|surfels|flatness), paint "
    "(source|clusters), tolerance (0.1, of clouds' splats).",
    {"stipple build tree.glb --as point-blocks -o tree.stipple",
     "stipple build bunny.ply --as point-blocks --set resolution=512 -o bunny.stipple",
     "stipple build scan.ply --as splats --set tolerance=0.05 -o scan.stipple",
     "stipple build bunny.ply --as hybrid -o bunny.stipple",
     "stipple render tree.stipple -o tree.png"}};

using Json = nlohmann::ordered_json;

struct Built {
    std::string text;  // of the file
    std::string line;  // what it is, for people
    Json report;
};

struct BuildJob {
    const Scene& scene;
    ThreadPool& pool;
    const CancelFlag& cancel;
    BuildProgress progress;
    std::string source;  // file name
    uint64_t memory_limit_mb = 0;
};

// A kind of model: its options, and how it is made.
class ModelKind {
public:
    virtual ~ModelKind() = default;
    virtual void set(const std::string& key, const std::string& value) = 0;
    virtual Built build(const BuildJob& job) const = 0;
};

template <class... Values>
std::string formatted(const char* format, Values... values) {
    char line[512];
    std::snprintf(line, sizeof line, format, values...);
    return line;
}

std::string counted(uint64_t n, const char* thing) {
    return std::to_string(n) + " " + thing + (n == 1 ? "" : "s");
}

Json surfelReport(const SurfelModel& model, size_t bytes) {
    size_t blocks = 0, surfels = 0;
    for (const SurfelLevel& level : model.levels)
        blocks += level.blocks.size(), surfels += level.size();
    return {{"schema", 1},
            {"kind", model.kind},
            {"surfels", model.levels[0].size()},
            {"blocks", model.levels[0].blocks.size()},
            {"levels", model.levels.size()},
            {"surfels_all_levels", surfels},
            {"blocks_all_levels", blocks},
            {"bytes", bytes}};
}

class PointBlocksKind : public ModelKind {
public:
    void set(const std::string& key, const std::string& value) override {
        applyOption(options_, key, value);
    }
    Built build(const BuildJob& job) const override {
        PointBlockReport r;
        auto options = options_;
        options.memory_limit_mb = job.memory_limit_mb;
        SurfelModel model = buildPointBlockModel(
            job.scene, options, job.pool, job.cancel,
            [&](double fraction) { job.progress("points", fraction); }, r);
        model.source = job.source;
        Built built;
        built.text = surfelFileText(model);
        built.report = surfelReport(model, built.text.size());
        const size_t surfels = built.report["surfels_all_levels"];
        built.line = counted(model.levels[0].size(), "point") + " in " +
                     counted(model.levels[0].blocks.size(), "block") + " at the finest of " +
                     counted(model.levels.size(), "level") + ", " + counted(surfels, "point") +
                     formatted(" in all; %.1f bits a point",
                               8.0 * double(built.text.size()) / double(surfels));
        built.report.update({{"seconds", r.seconds},
                             {"rays", r.rays},
                             {"samples_hit", r.samples_hit},
                             {"samples_chosen", r.samples_chosen},
                             {"points_per_pixel", r.per_pixel}});
        return built;
    }

private:
    PointBlockOptions options_;
};

class SplatsKind : public ModelKind {
public:
    void set(const std::string& key, const std::string& value) override {
        applyOption(options_, key, value);
    }
    Built build(const BuildJob& job) const override {
        SplatReport r;
        auto options = options_;
        options.memory_limit_mb = job.memory_limit_mb;
        SurfelModel model = buildSplats(job.scene, options, job.pool, job.cancel, job.progress, r);
        model.source = job.source;
        if (r.same_places > 0) {
            printMessage("warning: " + job.source + ": " + counted(r.same_places, "point") +
                         (r.same_places == 1 ? " is" : " are") +
                         " left out: others lie at the very same places; the first of "
                         "each is kept");
        }
        Built built;
        built.text = surfelFileText(model);
        built.report = surfelReport(model, built.text.size());
        const std::string on_meshes =
            r.points_on_meshes == 0 ? ""
            : r.points_on_meshes == r.points
                ? " on meshes"
                : formatted(" (%llu on meshes)",
                            static_cast<unsigned long long>(r.points_on_meshes));
        built.line = counted(r.points, "point") + on_meshes + ", " + counted(r.splats, "splat") +
                     formatted("; points lie within %.3g m of them, %.3g m on average",
                               r.largest_distance, r.mean_distance);
        built.report.update({{"seconds", r.seconds},
                             {"points", r.points},
                             {"points_on_meshes", r.points_on_meshes},
                             {"same_places", r.same_places},
                             {"tolerance", r.tolerance},
                             {"largest_distance", r.largest_distance},
                             {"mean_distance", r.mean_distance}});
        return built;
    }

private:
    SplatOptions options_;
};

class HybridKind : public ModelKind {
public:
    void set(const std::string& key, const std::string& value) override {
        applyOption(options_, key, value);
    }
    Built build(const BuildJob& job) const override {
        HybridReport r;
        auto options = options_;
        options.memory_limit_mb = job.memory_limit_mb;
        HybridModel model = buildHybrid(job.scene, options, job.pool, job.cancel, job.progress, r);
        model.source = job.source;
        Built built;
        built.text = hybridFileText(model);
        built.line = counted(r.triangles, "triangle") + " in " + counted(r.clusters, "cluster") +
                     formatted(" (%.0f %% in flat ones), ", 100.0 * r.flat_share) +
                     (r.patches == 1 ? "1 patch" : std::to_string(r.patches) + " patches") + "; " +
                     counted(r.surfels, "surfel") + ", " + std::to_string(r.surfels_all_levels) +
                     " in all levels";
        built.report = {{"schema", 1},
                        {"kind", "hybrid"},
                        {"triangles", r.triangles},
                        {"triangles_all_levels", r.triangles_all_levels},
                        {"surfels", r.surfels},
                        {"surfels_all_levels", r.surfels_all_levels},
                        {"clusters_phase_one", r.clusters_phase_one},
                        {"clusters", r.clusters},
                        {"flat_clusters", r.flat_clusters},
                        {"flat_share", r.flat_share},
                        {"patches", r.patches},
                        {"bytes", built.text.size()},
                        {"seconds", r.seconds},
                        {"cluster_seconds", r.cluster_seconds},
                        {"sample_seconds", r.sample_seconds},
                        {"simplify_seconds", r.simplify_seconds}};
        return built;
    }

private:
    HybridOptions options_;
};

std::unique_ptr<ModelKind> makeKind(const std::string& name) {
    if (name == "point-blocks") return std::make_unique<PointBlocksKind>();
    if (name == "splats") return std::make_unique<SplatsKind>();
    if (name == "hybrid") return std::make_unique<HybridKind>();
    throw Error(ErrorCode::kInvalidArgument, "--as",
                "'" + name + "' is not point-blocks, splats or hybrid");
}

}  // namespace

ExitCode runBuild(const std::vector<std::string>& arguments) {
    CLI::App app;
    std::string input, kind, output, json;
    std::vector<std::string> sets;
    bool allow_outside = false, quiet = false;
    int threads = 0;
    uint64_t memory_limit_mb = 0;
    app.add_option("ASSET", input,
                   "*.scene.json, .gltf, .glb, .ply or .obj, without models of points")
        ->required()
        ->group("Arguments");
    app.add_option("--as", kind, "the kind of model: point-blocks, splats or hybrid")
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
                   "most memory that loading and building may take, in MB (default: the machine's)")
        ->type_name("MB")
        ->group("Running");
    app.add_flag("--allow-outside", allow_outside, "let a scene's paths leave its folder")
        ->group("Running");
    app.add_flag("-q,--quiet", quiet, "no progress, only warnings and errors")->group("Running");
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    const std::unique_ptr<ModelKind> model_kind = makeKind(kind);
    checkOutputFile("-o", output, {".stipple"});
    if (!json.empty()) checkOutputFile("--json", json, {});
    for (const std::string& set : sets) {
        const size_t equals = set.find('=');
        if (equals == std::string::npos)
            throw Error(ErrorCode::kInvalidArgument, "--set", "'" + set + "' is not KEY=VALUE");
        model_kind->set(set.substr(0, equals), set.substr(equals + 1));
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
    for (const Mesh& mesh : scene.meshes) {
        // Hybrids have the whole mesh that they were made from.
        if (mesh.surfels && !mesh.is_patch) {
            throw Error(ErrorCode::kUnsupported, input,
                        "'" + mesh.name +
                            "' is a model of points: build from what it was made from, not from "
                            "the mesh that stands for it");
        }
    }
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);

    Built built;
    try {
        built = model_kind->build(
            {scene, pool, cancel,
             [&](const char* step, double fraction) { progress.update(step, fraction); },
             std::filesystem::path(input).filename().string(), memory_limit_mb});
    } catch (const Error& error) {
        if (error.where().empty() && error.code() == ErrorCode::kInvalidArgument)
            throw Error(ErrorCode::kInvalidScene, input, error.what());
        throw;
    }
    saveFile(output, built.text);
    progress.finish();
    std::printf("%s: %s\n", output.c_str(), built.line.c_str());
    if (!json.empty()) saveFile(json, built.report.dump(2) + "\n");
    return ExitCode::kDone;
}

}  // namespace stipple
