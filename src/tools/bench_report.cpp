// SPDX-License-Identifier: Apache-2.0
// The table and the JSON of `stipple bench`.
#include <tools/bench.h>
#include <tools/json_number.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kSchema = 1;

// What the tables and the JSON derive from what was measured.
struct PointRates {
    double cached = 0.0;       // points drawn a second and core
    double fresh = 0.0;        // without caches
    double limit = 0.0;        // points a second of all cores that the machine allows
    double limit_share = 0.0;  // of drawing from caches
};

const BenchMethod* findMethod(const CameraBench& camera, Method method) {
    for (const BenchMethod& m : camera.methods) {
        if (m.method == method) return &m;
    }
    return nullptr;
}

PointRates pointRates(const CameraBench& camera, int threads) {
    const BenchRun& run = findMethod(camera, Method::kPoints)->runs.back();
    const double points = double(run.stats.points_drawn);
    PointRates rates;
    rates.limit = median(camera.limit_points_per_second);
    rates.cached = points / run.still_seconds / threads;
    rates.fresh = points / camera.fresh_seconds / threads;
    rates.limit_share = rates.cached * threads / rates.limit;
    return rates;
}

std::string methodName(Method method) {
    RenderSettings settings;
    settings.method = method;
    return settingValue(settings, "method");
}

// The settings in which the runs of a method differ.
std::string settingsText(const RenderSettings& s) {
    char text[80];
    if (s.method == Method::kRaycast) {
        std::snprintf(text, sizeof text, "%g %s", s.samples, s.samples == 1.0 ? "ray" : "rays");
    } else if (s.method == Method::kZBuffer) {
        std::snprintf(text, sizeof text, "%dx%d", s.subpixels, s.subpixels);
    } else {
        std::snprintf(text, sizeof text, "%dx%d K=%.3g A=%g V=%g", s.subpixels, s.subpixels,
                      s.samples, s.area_threshold, s.visible_size);
    }
    return text;
}

__attribute__((format(printf, 2, 3))) void append(std::string& text, const char* format, ...) {
    char line[512];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    text += line;
}

void appendQuality(std::string& text, const CameraBench& camera, size_t q) {
    append(text, "\n  quality of %d %s a pixel\n", kQualityRays[q],
           kQualityRays[q] == 1 ? "ray" : "rays");
    append(text, "    %-8s %-24s %8s %7s %8s %9s %9s  %s\n", "method", "settings", "PSNR dB",
           "FLIP", "holes %", "still s", "moving s", "points are faster by");
    const BenchRun& points = findMethod(camera, Method::kPoints)->runs[q];
    for (const BenchMethod& method : camera.methods) {
        const BenchRun& run = method.runs[q];
        append(text, "    %-8s %-24s %8.2f %7.4f %8.4f %9.4f %9.4f",
               methodName(method.method).c_str(), settingsText(run.settings).c_str(),
               run.quality.psnr, run.quality.flip,
               run.quality.holes ? 100.0 * run.quality.holes->fraction : 0.0, run.still_seconds,
               run.moving_seconds);
        if (method.method != Method::kPoints && points.is_reached) {
            append(text, "  %.2fx still, %.2fx moving", run.still_seconds / points.still_seconds,
                   run.moving_seconds / points.moving_seconds);
        }
        text += run.is_reached ? "\n" : "  (quality not reached)\n";
    }
}

Json settingsJson(const RenderSettings& s) {
    return {{"samples", s.samples},
            {"subpixels", s.subpixels},
            {"area_threshold", s.area_threshold},
            {"visible_size", s.visible_size},
            {"seed", s.seed}};
}

// Times compare at equal quality only.
Json ratioJson(double seconds, double points_seconds, const BenchRun& points) {
    return points.is_reached ? Json(seconds / points_seconds) : Json(nullptr);
}

// JSON has no infinity: a picture that equals the reference has no PSNR.
Json decibels(double psnr) { return std::isfinite(psnr) ? Json(psnr) : Json(nullptr); }

Json runJson(const BenchRun& run, const BenchRun& points, int rays) {
    Json json = {{"rays", rays},
                 {"reached", run.is_reached},
                 {"settings", settingsJson(run.settings)},
                 {"psnr_db", decibels(run.quality.psnr)},
                 {"flip", run.quality.flip},
                 {"holes", run.quality.holes ? Json(run.quality.holes->fraction) : Json(nullptr)},
                 {"still_seconds", run.still_seconds},
                 {"moving_seconds", run.moving_seconds},
                 {"still_ratio", ratioJson(run.still_seconds, points.still_seconds, points)},
                 {"moving_ratio", ratioJson(run.moving_seconds, points.moving_seconds, points)},
                 {"points_drawn", run.stats.points_drawn}};
    json["phases"] = Json::array();
    for (const auto& [name, seconds] : run.stats.phases)
        json["phases"].push_back({{"name", name}, {"seconds", seconds}});
    return json;
}

Json cameraJson(const CameraBench& camera, const BenchResult& result) {
    Json json = {{"name", camera.camera},
                 {"reference",
                  {{"rays", result.options.reference_rays},
                   {"path", camera.reference_path},
                   {"cached", camera.is_reference_cached}}}};
    const BenchMethod& points = *findMethod(camera, Method::kPoints);
    const BenchRun& first = points.runs[kFirstPictureQuality];
    json["methods"] = Json::array();
    for (const BenchMethod& method : camera.methods) {
        Json m = {
            {"method", methodName(method.method)},
            {"first_picture",
             {{"rays", kQualityRays[kFirstPictureQuality]},
              {"load_seconds", method.cold.load_seconds},
              {"build_seconds", method.cold.build_seconds},
              {"frame_seconds", method.cold.frame_seconds},
              {"picture_seconds", method.cold.picture_seconds},
              {"total_seconds", method.cold.total_seconds},
              {"ratio", ratioJson(method.cold.picture_seconds, points.cold.picture_seconds, first)},
              {"total_ratio",
               ratioJson(method.cold.total_seconds, points.cold.total_seconds, first)},
              {"peak_bytes", method.cold.peak_bytes}}}};
        m["qualities"] = Json::array();
        for (size_t q = 0; q < kQualityRays.size(); ++q)
            m["qualities"].push_back(runJson(method.runs[q], points.runs[q], kQualityRays[q]));
        json["methods"].push_back(m);
    }
    const PointRates rates = pointRates(camera, result.threads);
    json["points"] = {{"cached_per_second_core", rates.cached},
                      {"fresh_per_second_core", rates.fresh},
                      {"fresh_frame_seconds", camera.fresh_seconds},
                      {"limit_per_second", rates.limit},
                      {"limit_bytes_per_second", rates.limit * MachineLimit::kBytesPerPoint},
                      {"limit_share", rates.limit_share}};
    json["rays_per_second"] = camera.rays_per_second;
    json["search"] = Json::array();
    for (const SearchStep& step : camera.search) {
        Json s = settingsJson(step.settings);
        s["psnr_db"] = decibels(step.psnr_db);
        s["seconds"] = step.seconds;
        json["search"].push_back(s);
    }
    return json;
}

}  // namespace

double median(std::vector<double> values) {
    const size_t middle = values.size() / 2;
    std::nth_element(values.begin(), values.begin() + middle, values.end());
    if (values.size() % 2 == 1) return values[middle];
    return 0.5 * (values[middle] + *std::max_element(values.begin(), values.begin() + middle));
}

std::string benchHeading(const BenchResult& result) {
    std::string text;
    append(text, "%s: %.4g instances, %.4g triangles; %d x %d, %d threads, medians of %d\n",
           result.options.scene_path.c_str(), result.scene.instances, result.scene.triangles_total,
           result.width, result.height, result.threads, result.options.repetitions);
    for (const std::string& line : result.left_out) text += line + "\n";
    return text;
}

std::string cameraTable(const CameraBench& camera, const BenchResult& result) {
    std::string text;
    append(text, "\ncamera %s (reference: %d rays a pixel)\n", camera.camera.c_str(),
           result.options.reference_rays);
    for (size_t q = 0; q < kQualityRays.size(); ++q) appendQuality(text, camera, q);
    const BenchMethod& points = *findMethod(camera, Method::kPoints);
    append(text, "\n  first picture, at the quality of %d rays\n",
           kQualityRays[kFirstPictureQuality]);
    append(text, "    %-8s %8s %8s %8s %10s %8s %9s  %s\n", "method", "load s", "build s",
           "frame s", "picture s", "total s", "peak MB", "points are faster by");
    for (const BenchMethod& method : camera.methods) {
        const ColdStart& cold = method.cold;
        append(text, "    %-8s %8.3f %8.3f %8.3f %10.3f %8.3f %9.1f",
               methodName(method.method).c_str(), cold.load_seconds, cold.build_seconds,
               cold.frame_seconds, cold.picture_seconds, cold.total_seconds,
               double(cold.peak_bytes) / 1e6);
        if (method.method != Method::kPoints && points.runs[kFirstPictureQuality].is_reached) {
            append(text, "  %.2fx without load, %.2fx with it",
                   cold.picture_seconds / points.cold.picture_seconds,
                   cold.total_seconds / points.cold.total_seconds);
        }
        text += method.runs[kFirstPictureQuality].is_reached ? "\n" : "  (quality not reached)\n";
    }
    const PointRates rates = pointRates(camera, result.threads);
    append(text,
           "\n  points a second and core, in millions: %.1f from caches, %.1f fresh draws "
           "(a frame takes %.2fx)\n",
           rates.cached / 1e6, rates.fresh / 1e6,
           camera.fresh_seconds / points.runs.back().still_seconds);
    append(text,
           "  the machine's limit, all cores: %.0f million points/s, %.1f GB/s; drawing from "
           "caches is %.1f %% of it\n",
           rates.limit / 1e6, rates.limit * MachineLimit::kBytesPerPoint / 1e9,
           100.0 * rates.limit_share);
    if (camera.rays_per_second > 0.0)
        append(text, "  raycast: %.2f million rays/s\n", camera.rays_per_second / 1e6);
    return text;
}

std::string editTable(const EditTimes& edits) {
    std::string text;
    append(text, "\nedits, one thread\n");
    const auto line = [&](const char* name, const EditQuantiles& q) {
        append(text, "    %-8s %8.2f us, 99 %% below %8.2f us\n", name, q.median * 1e6,
               q.p99 * 1e6);
    };
    line("insert", edits.insert);
    line("move", edits.move);
    line("remove", edits.remove);
    append(text, "    at once  %8.2f million inserts a second\n",
           edits.bulk_inserts_per_second * 1e-6);
    if (edits.frames.count > 0) {
        append(text,
               "    an edit of what is seen adds %.2f +- %.2f ms to a frame of %.1f ms, itself "
               "included\n",
               edits.frames.added_seconds * 1e3, edits.frames.added_error * 1e3,
               edits.frames.frame_seconds * 1e3);
    }
    if (edits.embree.commit > 0.0) {
        append(
            text,
            "    Embree's commit after a move: %.3f ms, %.0f times as long; dynamic, low quality: "
            "%.3f ms, %.0f times\n",
            edits.embree.commit * 1e3, edits.embree.commit / edits.move.median,
            edits.embree.dynamic * 1e3, edits.embree.dynamic / edits.move.median);
    }
    return text;
}

namespace {

Json editsJson(const EditTimes& edits) {
    const auto quantiles = [](const EditQuantiles& q) {
        return Json{{"median_seconds", q.median}, {"p99_seconds", q.p99}};
    };
    Json json = {{"insert", quantiles(edits.insert)},
                 {"move", quantiles(edits.move)},
                 {"remove", quantiles(edits.remove)},
                 {"bulk_inserts_per_second", edits.bulk_inserts_per_second}};
    if (edits.frames.count > 0) {
        json["frames"] = {{"count", edits.frames.count},
                          {"frame_seconds", edits.frames.frame_seconds},
                          {"added_seconds", edits.frames.added_seconds},
                          {"added_error_seconds", edits.frames.added_error},
                          {"edit_seconds", edits.frames.edit_seconds}};
    }
    if (edits.embree.commit > 0.0) {
        json["embree_commit_seconds"] = edits.embree.commit;
        json["embree_dynamic_commit_seconds"] = edits.embree.dynamic;
    }
    return json;
}

}  // namespace

std::string benchJson(const BenchResult& result) {
    Json json = {{"schema", kSchema},
                 {"version", STIPPLE_VERSION},
                 {"command", result.command},
                 {"scene",
                  {{"path", result.options.scene_path},
                   {"instances", jsonCount(result.scene.instances)},
                   {"triangles_total", jsonCount(result.scene.triangles_total)},
                   {"bytes", result.scene.bytes}}},
                 {"width", result.width},
                 {"height", result.height},
                 {"threads", result.threads},
                 {"repetitions", result.options.repetitions},
                 {"load_seconds", result.load_seconds},
                 {"limit_buffer_bytes", result.limit_buffer_bytes},
                 {"left_out", result.left_out}};
    json["cameras"] = Json::array();
    for (const CameraBench& camera : result.cameras)
        json["cameras"].push_back(cameraJson(camera, result));
    json["edits"] = editsJson(result.edits);
    // Names from files may not be UTF-8; replace what is not.
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace stipple
