// SPDX-License-Identifier: Apache-2.0
#include <tools/block_study.h>

#include <core/image.h>
#include <render/build_model.h>
#include <render/compare.h>
#include <render/point_block_probe.h>
#include <render/renderer.h>
#include <scenegraph/io/load.h>
#include <scenegraph/io/surfel_file.h>
#include <tools/block_study_views.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <set>

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr int kViews = 4;       // of a model, evenly among the mask directions
constexpr int kCullViews = 26;  // of a model, for shares of blocks
constexpr int kFrames = kBlockStudyFrames;
constexpr double kEyeDistance = 4.0;  // from the middle, in radii

// How models are built, by what the thesis calls it.
struct Variant {
    std::string what, value;
    std::vector<std::pair<std::string, std::string>> set;
};

std::vector<Variant> sizeVariants() {
    std::vector<Variant> variants;
    // As the thesis builds: blocks as they come, whole.
    const auto add = [&](const std::string& what, const std::string& key,
                         const std::vector<std::string>& values, bool as_thesis,
                         std::vector<std::pair<std::string, std::string>> set) {
        if (as_thesis)
            set.insert(set.end(), {{"scored", "off"}, {"partial", "off"}, {"complete", "off"}});
        for (const std::string& value : values) {
            variants.push_back({what + (as_thesis ? ", as the thesis" : ""), value, set});
            variants.back().set.emplace_back(key, value);
        }
    };
    add("tolerance angle", "tolerance_angle", {"0", "15", "25", "35", "45"}, true, {});
    add("tolerance angle, squares", "tolerance_angle", {"0", "15", "25", "45"}, true,
        {{"lattice", "squares"}});
    add("block size", "block_size", {"4", "16", "32"}, true, {});
    add("tolerance angle", "tolerance_angle", {"15", "35"}, false, {});
    add("tolerance angle, squares", "tolerance_angle", {"45"}, false, {{"lattice", "squares"}});
    add("block size", "block_size", {"4", "16"}, false, {});
    return variants;
}

// A view of the source by rays.
struct Seen {
    Camera camera;
    Image one, many;  // one centred ray a pixel; 16
};

struct Asset {
    std::string name;
    Scene source;
    std::vector<Seen> views;  // kViews
};

// A model and a scene that shows it.
struct Built {
    SurfelModel model;
    PointBlockReport report;
    size_t bytes = 0;             // of the file
    double bits_per_point = 0.0;  // of all levels
    Scene scene;
};

struct Timed {
    double seconds = 1e9, draw = 1e9, finish = 1e9;
    Image image;
};

class BlockStudy {
public:
    BlockStudy(const BlockStudyOptions& options, Diagnostics& diagnostics)
        : options_(options), diagnostics_(diagnostics) {
        fs::create_directories(fs::path(options.folder) / "models");
        fs::create_directories(fs::path(options.folder) / "pictures");
    }

    std::vector<StudyTable> run() {
        std::set<std::string> names;
        for (const std::string& path : options_.assets) {
            Asset asset;
            asset.name = fs::path(path).stem().string();
            if (!names.insert(asset.name).second)
                throw Error(ErrorCode::kInvalidArgument, path, "another asset has the same name");
            asset.source =
                loadScene(path, {options_.allow_outside, 0, options_.cancel}, pool_, diagnostics_);
            // The same light for all.
            asset.source.lighting.suns = {{glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(2.0f)}};
            asset.source.lighting.points.clear();
            measure(asset);
            ++assets_done_;
        }
        std::vector<StudyTable> tables;
        for (StudyTable* table : {&models_, &views_, &phases_, &culling_, &sizes_, &visibility_,
                                  &screen_, &projections_, &quality_, &shadows_}) {
            if (!isWanted(table->name)) continue;
            if (table == &sizes_ || table == &visibility_ || table == &screen_ ||
                table == &projections_)
                addMeans(*table);
            tables.push_back(std::move(*table));
        }
        return tables;
    }

private:
    void progress() {
        if (options_.cancel && options_.cancel->requested)
            throw Error(ErrorCode::kCancelled, "", "cancelled");
        if (options_.progress) {
            options_.progress("measure",
                              (double(assets_done_) + double(steps_done_) / double(steps_)) /
                                  double(options_.assets.size()));
        }
        ++steps_done_;
    }
    bool isWanted(const std::string& table) const {
        const std::vector<std::string>& wanted = options_.tables;
        return wanted.empty() || std::find(wanted.begin(), wanted.end(), table) != wanted.end();
    }

    Built build(const Asset& asset, const std::vector<std::pair<std::string, std::string>>& set,
                const std::string& name) {
        PointBlockOptions options;
        options.resolution = options_.resolution;
        for (const auto& [key, value] : set) applyOption(options, key, value);
        Built built;
        built.model = buildPointBlockModel(
            asset.source, options, pool_, options_.cancel ? *options_.cancel : never_,
            [](double) {}, built.report);
        built.model.source = asset.name;
        show(asset, built, name);
        return built;
    }

    // The scene of a model, by way of its file.
    void show(const Asset& asset, Built& built, const std::string& name) {
        const std::string text = surfelFileText(built.model);
        built.bytes = text.size();
        size_t points = 0;
        for (const SurfelLevel& level : built.model.levels) points += level.size();
        built.bits_per_point = 8.0 * double(built.bytes) / double(points);
        const std::string path =
            (fs::path(options_.folder) / "models" / (name + ".stipple")).string();
        saveFile(path, text);
        built.scene = loadScene(path, {true, 0, options_.cancel}, pool_, diagnostics_);
        built.scene.lighting = asset.source.lighting;
    }

    // At unit magnification: a pixel at the near side is as large as one of the model.
    Camera camera(const Asset& asset, int view, int views) const {
        const DBox3 bounds = sceneBounds(asset.source);
        const DVec3 center = 0.5 * (bounds.min + bounds.max);
        const double radius = 0.5 * glm::length(bounds.max - bounds.min);
        const Vec3 from = maskDirectionOf((view * kMaskDirections + 37) / views % kMaskDirections);
        Camera camera = lookAt(center + DVec3(from) * radius * kEyeDistance, center);
        const double pixel = 2.0 * radius / options_.resolution;
        camera.fov_y =
            2.0 * std::atan(0.5 * options_.resolution * pixel / ((kEyeDistance - 1.0) * radius));
        camera.near_z = 0.01 * radius;
        return camera;
    }

    RenderSettings settings() const {
        RenderSettings s;
        s.width = s.height = options_.resolution;
        s.subpixels = 1;
        return s;
    }
    View viewOf(const Camera& camera) const {
        return makeView(camera, options_.resolution, options_.resolution, 1);
    }

    struct Shown {
        const Scene* scene;
        RenderSettings settings;
    };
    // The fastest of so many frames of each. They take turns, so what else the machine does
    // slows all alike.
    std::vector<Timed> drawInTurns(const std::vector<Shown>& shown, const Camera& camera,
                                   int frames = kFrames) {
        std::vector<std::unique_ptr<Renderer>> renderers;
        for (const Shown& one : shown)
            renderers.push_back(std::make_unique<Renderer>(*one.scene, one_thread_));
        FrameRequest request;
        request.camera = camera;
        request.cancel = options_.cancel;
        std::vector<Timed> result(shown.size());
        for (int f = 0; f < frames; ++f) {
            for (size_t i = 0; i < shown.size(); ++i) {
                request.settings = shown[i].settings;
                const Frame frame = renderers[i]->render(request);
                Timed& timed = result[i];
                timed.seconds = std::min(timed.seconds, frame.stats.seconds);
                for (const auto& [phase, seconds] : frame.stats.phases) {
                    if (phase == "draw") timed.draw = std::min(timed.draw, seconds);
                    if (phase == "reconstruct") timed.finish = std::min(timed.finish, seconds);
                }
            }
        }
        // The picture with what comparing asks for.
        request.aovs = {"depth", "coverage"};
        for (size_t i = 0; i < shown.size(); ++i) {
            request.settings = shown[i].settings;
            result[i].image = renderers[i]->render(request).image;
        }
        return result;
    }
    Timed draw(const Scene& scene, const Camera& camera, const RenderSettings& settings,
               int frames = kFrames) {
        return std::move(drawInTurns({{&scene, settings}}, camera, frames)[0]);
    }

    Image rays(const Scene& scene, const Camera& camera, int rays) {
        Renderer renderer(scene, pool_);
        FrameRequest request;
        request.camera = camera;
        request.settings = settings();
        request.settings.method = Method::kRaycast;
        request.settings.samples = rays;
        request.aovs = {"depth", "coverage"};
        request.cancel = options_.cancel;
        return renderer.render(request).image;
    }

    struct Drawn {
        double ms = 0.0, psnr = 0.0, holes = 0.0;  // means; holes: the sum
    };
    Drawn drawViews(const Asset& asset, const Scene& scene) {
        Drawn drawn;
        for (const Seen& seen : asset.views) {
            const Timed timed = draw(scene, seen.camera, settings());
            drawn.ms += timed.seconds * 1e3 / kViews;
            drawn.psnr += compareImages(timed.image, seen.one, pool_).psnr / kViews;
            drawn.holes += double(compareImages(timed.image, seen.many, pool_).holes->count);
        }
        return drawn;
    }

    // What fills one or two tables, in so many steps of progress.
    struct Part {
        std::string table, other_table;
        int steps;
        void (BlockStudy::*measure)(const Asset&, const Built&);
    };

    void measure(Asset& asset) {
        const Part parts[] = {
            {"models", "", 1, &BlockStudy::measureModel},
            {"views", "", 228, &BlockStudy::measureViews},
            {"phases", "", 1, &BlockStudy::measurePhases},
            {"culling", "screen", 1, &BlockStudy::measureCulling},
            {"visibility", "", 6, &BlockStudy::measureVisibility},
            {"quality", "", 1, &BlockStudy::measureQuality},
            {"shadows", "", 1, &BlockStudy::measureShadows},
            {"projections", "", 3, &BlockStudy::measureProjections},
            {"sizes", "", int(sizeVariants().size()), &BlockStudy::measureSizes},
        };
        const auto isPartWanted = [&](const Part& part) {
            return isWanted(part.table) ||
                   (!part.other_table.empty() && isWanted(part.other_table));
        };
        steps_done_ = 0;
        steps_ = 1;
        for (const Part& part : parts) steps_ += isPartWanted(part) ? size_t(part.steps) : 0;
        progress();
        const Built built = build(asset, {}, asset.name);
        for (int v = 0; v < kViews; ++v) {
            const Camera eye = camera(asset, v, kViews);
            asset.views.push_back({eye, rays(asset.source, eye, 1), rays(asset.source, eye, 16)});
        }
        for (const Part& part : parts) {
            if (isPartWanted(part)) (this->*part.measure)(asset, built);
        }
    }

    void measureModel(const Asset& asset, const Built& built) {
        progress();
        const Drawn drawn = drawViews(asset, built.scene);
        const SurfelLevel& level = built.model.levels[0];
        models_.rows.push_back({{asset.name},
                                {double(built.bytes) / 1e6, double(level.blocks.size()),
                                 double(level.size()), built.bits_per_point, built.report.per_pixel,
                                 built.report.seconds, drawn.ms, drawn.psnr, drawn.holes}});
        const auto path = [&](const char* kind) {
            return (fs::path(options_.folder) / "pictures" / (asset.name + kind)).string();
        };
        saveImage(draw(built.scene, asset.views[0].camera, settings(), 1).image,
                  path(".points.png"));
        saveImage(asset.views[0].one, path(".rays.png"));
    }

    void measureViews(const Asset& asset, const Built& built) {
        const std::pair<BlockViews, const char*> kinds[] = {
            {BlockViews::kUnit, "unit magnification"},
            {BlockViews::kMagnified, "magnified 4 times"},
            {BlockViews::kWide, "90 degrees wide"}};
        for (const auto& [kind, name] : kinds) {
            const BlockViewsResult result =
                measureBlockViews(asset.source, built.scene, built.model, kind, options_.resolution,
                                  pool_, options_.cancel, [&] { progress(); });
            views_.rows.push_back(
                {{asset.name, name},
                 {double(result.views), result.holes, double(result.views_with_holes),
                  result.most_holes, result.mean_psnr, result.worst_psnr}});
        }
    }

    void measurePhases(const Asset& asset, const Built& built) {
        progress();
        RenderSettings s = settings();
        std::vector<double> sums(7, 0.0);
        double warped = 0.0, warp_seconds = 0.0;
        for (int v = 0; v < kViews; ++v) {
            const Camera eye = camera(asset, v, kViews);
            const WarpSeconds warp = measureWarp(built.scene, built.model, built.model.levels[0],
                                                 viewOf(eye), s, kFrames);
            warped += double(warp.points);
            warp_seconds += warp.warp - warp.visibility;
            RenderSettings unfilled = s, pull_push = s;
            unfilled.fill = false;
            pull_push.reconstruct = Reconstruct::kPullPush;
            const std::vector<Timed> timed = drawInTurns(
                {{&built.scene, s}, {&built.scene, unfilled}, {&built.scene, pull_push}}, eye);
            const Timed &whole = timed[0], &without_fill = timed[1], &filled = timed[2];
            const double seconds[7] = {warp.visibility,        warp.warp - warp.visibility,
                                       whole.draw - warp.warp, whole.finish - without_fill.finish,
                                       without_fill.finish,    whole.seconds,
                                       filled.seconds};
            for (size_t i = 0; i < 7; ++i) sums[i] += seconds[i] * 1e3 / kViews;
        }
        sums.push_back(warped * 1e-6 / warp_seconds);
        phases_.rows.push_back({{asset.name}, sums});
    }

    void measureCulling(const Asset& asset, const Built& built) {
        progress();
        CulledShares sum;
        std::vector<double> by_screen(7, 0.0);
        for (int v = 0; v < kCullViews; ++v) {
            const View view = viewOf(camera(asset, v, kCullViews));
            const SurfelLevel& level = built.model.levels[0];
            const CulledShares shares = culledShares(built.model, level, view);
            sum.cone += shares.cone, sum.mask += shares.mask, sum.both += shares.both;
            for (int n = 0; n < 7; ++n)
                by_screen[size_t(n)] += culledByScreen(built.model, level, view, n);
        }
        const double percent = 100.0 / kCullViews;
        culling_.rows.push_back(
            {{asset.name}, {0.0, sum.cone * percent, sum.mask * percent, sum.both * percent}});
        for (size_t n = 0; n < by_screen.size(); ++n)
            screen_.rows.push_back({{asset.name, std::to_string(n)}, {by_screen[n] * percent}});
        screen_.rows.push_back({{asset.name, "each block"}, {sum.mask * percent}});
    }

    void measureVisibility(const Asset& asset, const Built& built) {
        std::vector<Built> limited;
        std::vector<std::string> names;
        for (const bool cones : {false, true}) {
            for (const int directions : {0, 32, 128}) {
                progress();
                limited.emplace_back().model = built.model;
                limitVisibility(limited.back().model, cones, directions);
                show(asset, limited.back(), asset.name + "-limited");
                names.push_back(
                    std::string(cones ? "cones" : "no cones") + ", " +
                    (directions ? std::to_string(directions) + " directions" : "no masks"));
            }
        }
        fs::remove(fs::path(options_.folder) / "models" / (asset.name + "-limited.stipple"));
        std::vector<Shown> shown;
        for (const Built& b : limited) shown.push_back({&b.scene, settings()});
        std::vector<double> ms(limited.size(), 0.0), warp_ms = ms;
        for (const Seen& seen : asset.views) {
            const std::vector<Timed> timed = drawInTurns(shown, seen.camera);
            for (size_t i = 0; i < limited.size(); ++i) {
                ms[i] += timed[i].seconds * 1e3 / kViews;
                warp_ms[i] +=
                    measureWarp(limited[i].scene, limited[i].model, limited[i].model.levels[0],
                                viewOf(seen.camera), settings(), kFrames)
                        .warp *
                    1e3 / kViews;
            }
        }
        for (size_t i = 0; i < limited.size(); ++i) {
            double culled = 0.0;
            for (int v = 0; v < kCullViews; ++v) {
                culled += culledShares(limited[i].model, limited[i].model.levels[0],
                                       viewOf(camera(asset, v, kCullViews)))
                              .both *
                          100.0 / kCullViews;
            }
            visibility_.rows.push_back({{asset.name, names[i]}, {culled, warp_ms[i], ms[i]}});
        }
    }

    void addQuality(const Asset& asset, const Scene& scene, const std::string& drawn,
                    const std::string& how, RenderSettings s) {
        s.reconstruct = Reconstruct::kPullPush;
        const Timed timed = draw(scene, asset.views[0].camera, s, 4);
        const CompareResult result = compareImages(timed.image, asset.views[0].many, pool_);
        quality_.rows.push_back(
            {{asset.name, drawn, how},
             {result.psnr, result.flip, double(result.holes->count), timed.seconds * 1e3}});
    }

    void measureQuality(const Asset& asset, const Built& built) {
        progress();
        RenderSettings squares = settings(), unlimited = settings();
        squares.pull_push_coverage = PullPushCoverage::kSquares;
        unlimited.pull_push_threshold = false;
        // Triangles must come as points, or there is nothing to fill.
        const auto asPoints = [](RenderSettings s) {
            s.area_threshold = s.large_triangle = 1e6;
            return s;
        };
        Scene backs = built.scene;
        for (Material& material : backs.materials) material.double_sided = true;
        addQuality(asset, built.scene, "model", "all as it is", settings());
        addQuality(asset, backs, "model", "backs stay", settings());
        addQuality(asset, asset.source, "mesh", "all as it is", asPoints(settings()));
        addQuality(asset, asset.source, "mesh", "opaque squares", asPoints(squares));
        addQuality(asset, asset.source, "mesh", "no depth threshold", asPoints(unlimited));
    }

    void measureShadows(const Asset& asset, const Built& built) {
        progress();
        Scene lit = built.scene;
        const Vec3 directions[3] = {{0.4f, 0.7f, 0.5f}, {-0.6f, 0.5f, 0.3f}, {0.1f, 0.4f, -0.8f}};
        lit.lighting.suns.clear();
        for (int n = 1; n <= 3; ++n) {
            lit.lighting.suns.push_back({glm::normalize(directions[n - 1]), Vec3(2.0f / float(n))});
            RenderSettings shadows = settings();
            shadows.shadows = true;
            const std::vector<Timed> timed =
                drawInTurns({{&lit, settings()}, {&lit, shadows}}, asset.views[0].camera);
            const double without = timed[0].seconds * 1e3, with = timed[1].seconds * 1e3;
            shadows_.rows.push_back({{asset.name, std::to_string(n)},
                                     {without, with, (with - without) / n / without * 100.0}});
        }
    }

    void measureProjections(const Asset& asset, const Built& built) {
        for (const char* directions : {"6", "32", "128"}) {
            progress();
            const bool is_default = std::string(directions) == "32";
            Built other;
            if (!is_default) other = build(asset, {{"directions", directions}}, "variant");
            const Built& b = is_default ? built : other;
            const Drawn drawn = drawViews(asset, b.scene);
            projections_.rows.push_back(
                {{asset.name, directions},
                 {double(b.model.levels[0].size()), double(b.model.levels[0].blocks.size()),
                  b.report.seconds, drawn.ms, drawn.psnr, drawn.holes}});
        }
    }

    // Sizes and times relative to the model as it is built by default.
    void measureSizes(const Asset& asset, const Built& built) {
        const auto add = [&](const std::string& what, const std::string& value, const Built& b,
                             double time, double draw_time) {
            sizes_.rows.push_back(
                {{asset.name, what, value},
                 {double(b.model.levels[0].size()), double(b.model.levels[0].blocks.size()),
                  double(b.bytes) / double(built.bytes), time, draw_time, b.report.seconds}});
        };
        for (const char* what : {"tolerance angle", "block size"})
            add(what, std::string(what) == "block size" ? "8" : "25", built, 1.0, 1.0);
        for (const Variant& variant : sizeVariants()) {
            progress();
            const Built b = build(asset, variant.set, "variant");
            double time = 0.0, draw_time = 0.0;
            for (const Seen& seen : asset.views) {
                const std::vector<Timed> timed =
                    drawInTurns({{&b.scene, settings()}, {&built.scene, settings()}}, seen.camera);
                time += timed[0].seconds / timed[1].seconds / kViews;
                draw_time += timed[0].draw / timed[1].draw / kViews;
            }
            add(variant.what, variant.value, b, time, draw_time);
            // The same model by its block size.
            if (variant.what == "tolerance angle, as the thesis" && variant.value == "25")
                add("block size, as the thesis", "8", b, time, draw_time);
        }
        fs::remove(fs::path(options_.folder) / "models" / "variant.stipple");
    }

    // Rows of means over the assets, by all labels but the first.
    static void addMeans(StudyTable& table) {
        std::vector<StudyTableRow> means;
        std::vector<double> counts;
        for (const StudyTableRow& row : table.rows) {
            std::vector<std::string> labels = row.labels;
            labels[0] = "mean";
            const auto found = std::find_if(means.begin(), means.end(), [&](const auto& mean) {
                return mean.labels == labels;
            });
            const size_t k = size_t(found - means.begin());
            if (found == means.end()) {
                means.push_back({labels, std::vector<double>(row.values.size(), 0.0)});
                counts.push_back(0.0);
            }
            for (size_t i = 0; i < row.values.size(); ++i) means[k].values[i] += row.values[i];
            counts[k] += 1.0;
        }
        for (size_t k = 0; k < means.size(); ++k) {
            for (double& value : means[k].values) value /= counts[k];
        }
        table.rows.insert(table.rows.begin(), means.begin(), means.end());
    }

    const BlockStudyOptions& options_;
    Diagnostics& diagnostics_;
    ThreadPool pool_, one_thread_{1};
    const CancelFlag never_;
    size_t assets_done_ = 0, steps_done_ = 0, steps_ = 1;

    StudyTable models_ = blockStudyTable("models");
    StudyTable views_ = blockStudyTable("views");
    StudyTable phases_ = blockStudyTable("phases");
    StudyTable culling_ = blockStudyTable("culling");
    StudyTable sizes_ = blockStudyTable("sizes");
    StudyTable visibility_ = blockStudyTable("visibility");
    StudyTable screen_ = blockStudyTable("screen");
    StudyTable projections_ = blockStudyTable("projections");
    StudyTable quality_ = blockStudyTable("quality");
    StudyTable shadows_ = blockStudyTable("shadows");
};

}  // namespace

std::vector<StudyTable> runBlockStudy(const BlockStudyOptions& options, Diagnostics& diagnostics) {
    return BlockStudy(options, diagnostics).run();
}

}  // namespace stipple
