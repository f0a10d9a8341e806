// SPDX-License-Identifier: Apache-2.0
// One camera of `stipple bench`: the reference, the qualities to reach, the settings that reach
// them, then the timed rounds, in which the methods take turns.
#include <core/stopwatch.h>
#include <tools/bench.h>
#include <tools/bench_process.h>
#include <tools/bench_reference.h>
#include <tools/bench_search.h>
#include <tools/signals.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

using ProgressFn = std::function<void(const std::string&, double)>;

// Camera of moving frame `step`: each goes 0.2 % of the scene's distance aside and turns a little.
Camera movedCamera(const Camera& camera, double distance, int step) {
    Camera moved = camera;
    moved.eye += camera.world_from_camera[0] * (0.002 * distance * step);
    const double angle = 0.004 * step;
    const double c = std::cos(angle), s = std::sin(angle);
    const DMat3 turn(c, 0, -s, 0, 1, 0, s, 0, c);  // about +y
    moved.world_from_camera = turn * camera.world_from_camera;
    return moved;
}

// Median depth of what the reference shows; 1 where it shows nothing.
double typicalDistance(const Image& reference) {
    const int depth = reference.channelIndex("depth");
    std::vector<double> depths;
    for (int y = 0; y < reference.height; ++y) {
        for (int x = 0; x < reference.width; ++x) {
            const float d = reference.pixel(x, y)[depth];
            if (std::isfinite(d)) depths.push_back(d);
        }
    }
    return depths.empty() ? 1.0 : median(depths);
}

struct Timed {
    BenchRun* run = nullptr;
    Renderer* renderer = nullptr;
    std::unique_ptr<Renderer> own;  // of points: a cache that other settings do not fill
    std::vector<double> still, moving;
};

class CameraBencher {
public:
    CameraBencher(const Scene& scene, const Camera& camera, const RenderSettings& settings,
                  const BenchOptions& options, ThreadPool& pool, const CancelFlag& cancel,
                  const ProgressFn& progress)
        : camera_(camera),
          base_(settings),
          options_(options),
          pool_(pool),
          cancel_(cancel),
          progress_(progress),
          scene_(scene),
          search_(std::make_unique<Renderer>(scene, pool)),
          raycast_(scene, pool),
          zbuffer_(scene, pool) {
        result_.camera = camera.name;
    }

    CameraBench run(MachineLimit& limit) {
        const Reference reference =
            loadOrCastReference(raycast_, request(base_, camera_), options_.reference_rays,
                                [&](double fraction) { report("reference", fraction); });
        result_.reference_path = reference.path;
        result_.is_reference_cached = reference.is_cached;
        makeRaycastRuns(reference.image);
        makePointRuns(reference.image);
        if (options_.against_zbuffer) makeZBufferRuns(reference.image);
        timeFrames(typicalDistance(reference.image), limit);
        timeColdStarts();
        if (!options_.against_raycast) {  // it was there for the qualities only
            std::erase_if(result_.methods,
                          [](const BenchMethod& m) { return m.method == Method::kRaycast; });
        }
        return std::move(result_);
    }

private:
    void report(const char* what, double fraction) const {
        progress_(camera_.name + ": " + what, fraction);
    }

    FrameRequest request(const RenderSettings& settings, const Camera& camera) const {
        FrameRequest r;
        r.camera = camera;
        r.settings = settings;
        r.cancel = &cancel_;
        return r;
    }

    CompareResult qualityOf(Renderer& renderer, const RenderSettings& settings,
                            const Image& reference) {
        FrameRequest r = request(settings, camera_);
        r.aovs = {"depth", "coverage"};
        return compareImages(renderer.render(r).image, reference, pool_);
    }

    BenchMethod& addMethod(Method method) {
        BenchMethod& added = result_.methods.emplace_back();
        added.method = method;
        for (size_t q = 0; q < kQualityRays.size(); ++q) {
            added.runs[q].settings = base_;
            added.runs[q].settings.method = method;
        }
        return added;
    }

    void makeRaycastRuns(const Image& reference) {
        BenchMethod& raycast = addMethod(Method::kRaycast);
        for (size_t q = 0; q < kQualityRays.size(); ++q) {
            report("raycast", double(q) / double(kQualityRays.size()));
            BenchRun& run = raycast.runs[q];
            run.settings.samples = kQualityRays[q];
            run.settings.subpixels = 1;
            run.quality = qualityOf(raycast_, run.settings, reference);
            slowest_ray_seconds_ = raycast_.render(request(run.settings, camera_)).stats.seconds;
        }
        wanted_db_.clear();
        for (const BenchRun& run : raycast.runs) wanted_db_.push_back(run.quality.psnr);
    }

    void makePointRuns(const Image& reference) {
        RenderSettings base = base_;
        base.method = Method::kPoints;
        report("search", 0.0);
        int n_steps = 0;
        const double slow = kTooSlow * slowest_ray_seconds_;
        const double least_wanted = *std::min_element(wanted_db_.begin(), wanted_db_.end());
        result_.search =
            searchSettings(base, wanted_db_, slow, [&](const RenderSettings& settings) {
                SearchStep step;
                step.settings = settings;
                const Frame frame = search_->render(request(settings, camera_));  // fills caches
                step.psnr_db = compareImages(frame.image, reference, pool_).psnr;
                // What no quality asks for needs no exact time, unless it seems to be too slow.
                step.seconds = frame.stats.seconds;
                if (step.psnr_db >= least_wanted || step.seconds > slow)
                    step.seconds = search_->render(request(settings, camera_)).stats.seconds;
                report("search", std::min(1.0, double(++n_steps) / kUsualSteps));
                return step;
            });
        BenchMethod points;
        points.method = Method::kPoints;
        for (size_t q = 0; q < kQualityRays.size(); ++q) {
            report("confirm", double(q) / double(kQualityRays.size()));
            BenchRun& run = points.runs[q];
            const auto drawAgain = [&](const RenderSettings& settings) {
                run.settings = settings;
                run.settings.seed = base_.seed + 1;
                run.quality = qualityOf(*search_, run.settings, reference);
                return run.quality.psnr;
            };
            if (!fastestConfirmedStep(result_.search, wanted_db_[q], drawAgain))
                drawAgain(bestStep(result_.search).settings);
            run.is_reached = run.quality.psnr >= wanted_db_[q];
        }
        result_.methods.insert(result_.methods.begin(), points);
    }

    // As many samples a pixel as rays, in a regular grid.
    void makeZBufferRuns(const Image& reference) {
        BenchMethod& zbuffer = addMethod(Method::kZBuffer);
        for (size_t q = 0; q < kQualityRays.size(); ++q) {
            report("zbuffer", double(q) / double(kQualityRays.size()));
            BenchRun& run = zbuffer.runs[q];
            run.settings.subpixels = int(std::lround(std::sqrt(double(kQualityRays[q]))));
            run.quality = qualityOf(zbuffer_, run.settings, reference);
            run.is_reached = run.quality.psnr >= wanted_db_[q];
        }
    }

    // Every round draws each method at each quality once, and measures the machine's limit.
    void timeFrames(double distance, MachineLimit& limit) {
        search_.reset();  // its cache is no longer needed
        std::vector<Timed> timed;
        const auto add = [&](BenchRun& run) {
            Timed& t = timed.emplace_back();
            t.run = &run;
            if (run.settings.method == Method::kPoints) {
                t.own = std::make_unique<Renderer>(scene_, pool_);
                if (run.settings.cache_mb > 0) t.own->render(request(run.settings, camera_));
            }
            t.renderer = t.own                                     ? t.own.get()
                         : run.settings.method == Method::kRaycast ? &raycast_
                                                                   : &zbuffer_;
        };
        report("still frames", 0.0);
        for (BenchMethod& method : result_.methods) {
            if (method.method == Method::kRaycast && !options_.against_raycast) continue;
            for (BenchRun& run : method.runs) add(run);
        }
        BenchRun fresh;
        fresh.settings = result_.methods[0].runs.back().settings;
        fresh.settings.cache_mb = 0;
        add(fresh);
        const int n = options_.repetitions;
        for (int round = 0; round < n; ++round) {
            report("still frames", double(round) / n);
            result_.limit_points_per_second.push_back(limit.pointsPerSecond());
            for (Timed& t : timed) {
                if (t.run == &fresh && round > 0 && t.still[0] > kLongFrame) continue;
                t.run->stats = t.renderer->render(request(t.run->settings, camera_)).stats;
                t.still.push_back(t.run->stats.seconds);
            }
        }
        for (int round = 0; round < n; ++round) {
            report("moving frames", double(round) / n);
            const Camera moved = movedCamera(camera_, distance, round + 1);
            bool has_built = false;  // what rays need, for this eye
            for (Timed& t : timed) {
                if (t.run == &fresh) continue;
                // Building is not counted, and what it leaves in the processor's caches must not
                // be either.
                if (t.run->settings.method == Method::kRaycast && !has_built) {
                    t.renderer->render(request(t.run->settings, moved));
                    has_built = true;
                }
                t.moving.push_back(
                    t.renderer->render(request(t.run->settings, moved)).stats.seconds);
            }
        }
        for (Timed& t : timed) {
            t.run->still_seconds = median(t.still);
            if (!t.moving.empty()) t.run->moving_seconds = median(t.moving);
        }
        result_.fresh_seconds = fresh.still_seconds;
        for (const BenchMethod& method : result_.methods) {
            const BenchRun& run = method.runs.back();
            if (method.method == Method::kRaycast && run.still_seconds > 0.0)
                result_.rays_per_second = double(run.stats.points_drawn) / run.still_seconds;
        }
    }

    void timeColdStarts() {
        const int n = options_.repetitions;
        std::vector<std::vector<ColdStart>> runs(result_.methods.size());
        for (int round = 0; round < n; ++round) {
            report("first pictures", double(round) / n);
            for (size_t m = 0; m < runs.size(); ++m) {
                const BenchMethod& method = result_.methods[m];
                if (method.method == Method::kRaycast && !options_.against_raycast) continue;
                runs[m].push_back(runColdStart(
                    options_, camera_.name, method.runs[kFirstPictureQuality].settings, cancel_));
            }
        }
        for (size_t m = 0; m < runs.size(); ++m) {
            const auto medianOf = [&](auto member) {
                std::vector<double> values;
                for (const ColdStart& run : runs[m]) values.push_back(double(run.*member));
                return values.empty() ? 0.0 : median(values);
            };
            ColdStart& cold = result_.methods[m].cold;
            cold.load_seconds = medianOf(&ColdStart::load_seconds);
            cold.build_seconds = medianOf(&ColdStart::build_seconds);
            cold.frame_seconds = medianOf(&ColdStart::frame_seconds);
            // Medians of sums: load and build of one process belong together.
            cold.picture_seconds = medianOf(&ColdStart::picture_seconds);
            cold.total_seconds = medianOf(&ColdStart::total_seconds);
            cold.peak_bytes = uint64_t(medianOf(&ColdStart::peak_bytes));
        }
    }

    // Points that take so many times longer than the rays are not worth searching.
    static constexpr double kTooSlow = 1.5;
    // A fresh draw of more seconds is timed once: it is far slower than from caches, which is what
    // matters of it.
    static constexpr double kLongFrame = 5.0;
    static constexpr double kUsualSteps = 24;  // of a search, for its progress

    const Camera& camera_;
    const RenderSettings& base_;
    const BenchOptions& options_;
    ThreadPool& pool_;
    const CancelFlag& cancel_;
    const ProgressFn& progress_;
    const Scene& scene_;
    std::unique_ptr<Renderer> search_;
    Renderer raycast_, zbuffer_;
    std::vector<double> wanted_db_;  // of kQualityRays
    double slowest_ray_seconds_ = 0.0;
    CameraBench result_;
};

}  // namespace

CameraBench benchCamera(const Scene& scene, const Camera& camera, const RenderSettings& settings,
                        const BenchOptions& options, ThreadPool& pool, MachineLimit& limit,
                        const CancelFlag& cancel, const ProgressFn& progress) {
    return CameraBencher(scene, camera, settings, options, pool, cancel, progress).run(limit);
}

}  // namespace stipple
