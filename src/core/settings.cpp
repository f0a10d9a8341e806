// SPDX-License-Identifier: Apache-2.0
// The settings table: every member of RenderSettings has one entry here, and nothing else knows its
// name, range or text form.
#include <core/nearest_name.h>
#include <core/settings.h>

#include <charconv>
#include <cmath>
#include <functional>

namespace stipple {

namespace {

struct Entry {
    SettingInfo info;
    std::function<bool(RenderSettings&, const std::string&)> set;  // false: not an allowed value
    std::function<std::string(const RenderSettings&)> get;
};

template <class T>
std::string textOf(T value) {
    char buffer[32];
    return std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
}

template <class T>
bool parseNumber(const std::string& text, T& value) {
    const char* end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, value);
    return error == std::errc() && rest == end;
}

template <class T>
Entry number(const char* key, T RenderSettings::*member, T lo, T hi, const char* unit,
             const char* help, bool has_option = true) {
    return {{key, textOf(lo) + ".." + textOf(hi), unit, help, has_option},
            [=](RenderSettings& settings, const std::string& text) {
                T value{};
                // note: written so that NaN fails as well.
                if (!parseNumber(text, value) || !(value >= lo && value <= hi)) return false;
                settings.*member = value;
                return true;
            },
            [=](const RenderSettings& settings) { return textOf(settings.*member); }};
}

template <class T>
struct Choice {
    const char* name;
    T value;
};

template <class T>
Entry choice(const char* key, T RenderSettings::*member, std::vector<Choice<T>> choices,
             const char* help, bool has_option = true) {
    std::string values;
    for (const Choice<T>& c : choices) values += (values.empty() ? "" : "|") + std::string(c.name);
    return {{key, values, "", help, has_option},
            [=](RenderSettings& settings, const std::string& text) {
                for (const Choice<T>& c : choices) {
                    if (text != c.name) continue;
                    settings.*member = c.value;
                    return true;
                }
                return false;
            },
            [=](const RenderSettings& settings) {
                for (const Choice<T>& c : choices) {
                    if (settings.*member == c.value) return std::string(c.name);
                }
                return std::string();
            }};
}

Entry onOff(const char* key, bool RenderSettings::*member, const char* help,
            bool has_option = true) {
    return choice<bool>(key, member, {{"on", true}, {"off", false}}, help, has_option);
}

// "off" is another name for 0 megabytes.
Entry cacheMb() {
    Entry entry = number("cache_mb", &RenderSettings::cache_mb, 0, 1 << 24, "MB",
                         "memory for point lists that later frames use again; a quarter as much "
                         "for shadow maps");
    entry.info.values += "|off";
    entry.set = [set = entry.set](RenderSettings& settings, const std::string& text) {
        return set(settings, text == "off" ? "0" : text);
    };
    return entry;
}

std::vector<Entry> makeEntries() {
    using S = RenderSettings;
    constexpr bool kOnlySet = false;
    return {
        number("width", &S::width, 1, 65536, "pixels", "width of the picture"),
        number("height", &S::height, 1, 65536, "pixels", "height of the picture"),
        choice<Method>("method", &S::method,
                       {{"points", Method::kPoints},
                        {"zbuffer", Method::kZBuffer},
                        {"raycast", Method::kRaycast}},
                       "how what is visible is found; zbuffer draws every triangle, raycast is "
                       "the reference"),
        number("samples", &S::samples, 0.001, 10000.0, "",
               "K, expected points per subpixel of exactly projected area; with raycast, rays a "
               "pixel: jittered, a single one through its centre"),
        number("subpixels", &S::subpixels, 1, 16, "subpixels",
               "subpixels along one side of a pixel"),
        choice<Sampler>("sampler", &S::sampler,
                        {{"stratified", Sampler::kStratified}, {"random", Sampler::kRandom}},
                        "how points are spread over a node's area"),
        choice<Reconstruct>("reconstruct", &S::reconstruct,
                            {{"per-pixel", Reconstruct::kPerPixel},
                             {"splat", Reconstruct::kSplat},
                             {"gaussian", Reconstruct::kGaussian},
                             {"pull-push", Reconstruct::kPullPush},
                             {"ewa", Reconstruct::kEwa},
                             {"bins", Reconstruct::kBins}},
                            "how points become a picture"),
        number("splat_size", &S::splat_size, 0.1, 64.0, "pixels",
               "side of a splat, or of the box that has a gaussian's variance"),
        onOff("shadows", &S::shadows, "shadows of suns, point and spot lights"),
        onOff("ao", &S::ao, "ambient occlusion: what is near darkens the light of the sky"),
        number("exposure", &S::exposure, -32.0, 32.0, "stops",
               "brightness, beside the scene file's exposure"),
        choice<Tone>("tone", &S::tone,
                     {{"none", Tone::kNone},
                      {"filmic", Tone::kFilmic},
                      {"aces", Tone::kAces},
                      {"agx", Tone::kAgx}},
                     "tone curve of .png pictures; .exr stays linear"),
        number("seed", &S::seed, uint64_t(0), ~uint64_t(0), "",
               "the same seed gives the same picture, bit for bit"),
        number("threads", &S::threads, 0, 1024, "threads", "worker threads; 0 is one a core"),
        cacheMb(),
        number("cut_ratio", &S::cut_ratio, 1.01, 100.0, "",
               "largest ratio of depths within a node of the cut", kOnlySet),
        number("area_threshold", &S::area_threshold, 0.0, 1e9, "subpixels",
               "triangles of more than this projected area (on surfaces: a quarter of it) are "
               "rasterized, not drawn as points",
               kOnlySet),
        number("large_triangle", &S::large_triangle, 0.0, 1e9, "subpixels",
               "triangles of more than this projected area go to OSMesa, before the tiles",
               kOnlySet),
        number("tile_size", &S::tile_size, 16, 4096, "subpixels", "largest side of a screen tile",
               kOnlySet),
        number("list_length", &S::list_length, 1, 1 << 24, "points",
               "most points taken from a node's list before the node is opened", kOnlySet),
        number("visible_size", &S::visible_size, 0.0, 4096.0, "subpixels",
               "meshes no larger than this are drawn by what can be seen of them from the eye's "
               "direction; larger is faster and less exact, 0 never does",
               kOnlySet),
        onOff(
            "orientation", &S::orientation,
            "draw points on parts of meshes whose triangles face alike for how much they face the "
            "eye",
            kOnlySet),
        onOff("culling", &S::culling, "skip batches behind what a tile has already drawn",
              kOnlySet),
        number("splat_world", &S::splat_world, 0.0, 1e6, "metres",
               "side of a splat in the world; 1 to 32 subpixels in the picture; 0 "
               "takes splat_size",
               kOnlySet),
        choice<PullPushCoverage>(
            "pull_push_coverage", &S::pull_push_coverage,
            {{"bilinear", PullPushCoverage::kBilinear}, {"squares", PullPushCoverage::kSquares}},
            "how a coarse depth buffer covers pixels behind it", kOnlySet),
        onOff("pull_push_threshold", &S::pull_push_threshold,
              "a coarse depth buffer hides only what lies three of its pixels behind", kOnlySet),
        number("ewa_prefilter", &S::ewa_prefilter, 0.0, 16.0, "subpixels",
               "standard deviation of the filter that ewa adds to a splat", kOnlySet),
        number("shadow_texel", &S::shadow_texel, 0.25, 16.0, "pixels",
               "side of a shadow map's texel where the camera sees it", kOnlySet),
        number("ao_radius", &S::ao_radius, 0.001, 1e6, "metres",
               "what is farther from a surface takes no light of the sky from it", kOnlySet),
        number("ao_rays", &S::ao_rays, 1, 1024, "rays",
               "for ambient occlusion with raycast, for each hit and side of a leaf", kOnlySet),
        onOff("fill", &S::fill, "per-pixel reconstruction removes hidden points and fills gaps",
              kOnlySet),
    };
}

const std::vector<Entry>& entries() {
    static const std::vector<Entry> table = makeEntries();
    return table;
}

const Entry& findEntry(const std::string& key, const std::string& where) {
    std::vector<std::string> keys;
    for (const Entry& entry : entries()) {
        if (entry.info.key == key) return entry;
        keys.push_back(entry.info.key);
    }
    const std::string nearest = nearestName(key, keys);
    throw Error(ErrorCode::kInvalidArgument, where,
                "unknown setting '" + key + "'" +
                    (nearest.empty() ? "" : "; did you mean '" + nearest + "'?"));
}

}  // namespace

const std::vector<SettingInfo>& settingsTable() {
    static const std::vector<SettingInfo> table = [] {
        std::vector<SettingInfo> infos;
        for (const Entry& entry : entries()) infos.push_back(entry.info);
        return infos;
    }();
    return table;
}

void applySetting(RenderSettings& settings, const std::string& key, const std::string& value,
                  const std::string& where) {
    const Entry& entry = findEntry(key, where);
    if (entry.set(settings, value)) return;
    throw Error(ErrorCode::kInvalidArgument, where,
                "'" + value + "' is not a value of " + key + " (" + entry.info.values + ")");
}

std::string settingValue(const RenderSettings& settings, const std::string& key) {
    return findEntry(key, "").get(settings);
}

}  // namespace stipple
