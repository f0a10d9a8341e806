// SPDX-License-Identifier: Apache-2.0
#include <tools/json_number.h>
#include <tools/stats_json.h>

#include <sys/resource.h>

#include <fstream>

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kSchema = 1;

Json phasesJson(const RunStats& stats) {
    // Every phase is always there, so that readers need no special cases; new ones go to the end.
    std::vector<std::pair<std::string, double>> phases = {{"load", stats.load_seconds},
                                                          {"build", stats.build_seconds},
                                                          {"plan", 0.0},
                                                          {"draw", 0.0},
                                                          {"raster", 0.0},
                                                          {"reconstruct", 0.0},
                                                          {"shade", 0.0},
                                                          {"write", stats.write_seconds}};
    for (const FrameStats& frame : stats.frames) {
        for (const auto& [name, seconds] : frame.phases) {
            size_t i = 0;
            while (i < phases.size() && phases[i].first != name) ++i;
            if (i == phases.size()) phases.emplace_back(name, 0.0);
            phases[i].second += seconds;
        }
    }
    Json result = Json::array();
    for (const auto& [name, seconds] : phases) {
        result.push_back({{"name", name}, {"seconds", seconds}});
    }
    return result;
}

Json settingsJson(const RenderSettings& settings) {
    Json result = Json::object();
    for (const SettingInfo& info : settingsTable()) {
        const std::string text = settingValue(settings, info.key);
        // A word ("points", "on") is no JSON; a number is one.
        const Json number = Json::parse(text, nullptr, false);
        result[info.key] = number.is_number() ? number : Json(text);
    }
    return result;
}

}  // namespace

size_t peakMemoryBytes() {
    // why: getrusage also remembers what this process was before exec, which may be a large
    // script's interpreter.
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;) {
        size_t kilobytes = 0;
        if (word == "VmHWM:" && status >> kilobytes) return kilobytes * 1024;
    }
    rusage usage = {};
    getrusage(RUSAGE_SELF, &usage);
    return size_t(usage.ru_maxrss) * 1024;
}

std::string statsJson(const RunStats& stats) {
    const FrameStats& frame = stats.frames.back();
    Json json;
    json["schema"] = kSchema;
    json["version"] = STIPPLE_VERSION;
    json["command"] = stats.command;
    json["scene"] = {{"path", stats.scene_path},
                     {"camera", stats.camera},
                     {"instances", jsonCount(stats.scene.instances)},
                     {"instances_stored", jsonCount(stats.scene.stored_instances)},
                     {"triangles_unique", jsonCount(stats.scene.triangles_unique)},
                     {"triangles_total", jsonCount(stats.scene.triangles_total)},
                     {"bytes", stats.scene.bytes},
                     {"instance_bytes", stats.scene.instance_bytes}};
    json["settings"] = settingsJson(stats.settings);
    json["phases"] = phasesJson(stats);
    json["counters"] = {
        {"points_drawn", frame.points_drawn},       {"points_kept", frame.points_kept},
        {"points_culled", frame.points_culled},     {"batches", frame.batches},
        {"large_triangles", frame.large_triangles}, {"overestimation", frame.overestimation},
        {"shadow_points", frame.shadow_points},     {"look_points", frame.look_points}};
    json["memory"] = {{"peak_bytes", peakMemoryBytes()},
                      {"cache_bytes", frame.cache_bytes},
                      {"shadow_bytes", frame.shadow_bytes}};
    json["frames"] = Json::array();
    for (const FrameStats& f : stats.frames) json["frames"].push_back(f.seconds);
    json["warnings"] = stats.warnings;
    // Names from files may not be UTF-8; replace what is not.
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace stipple
