// SPDX-License-Identifier: Apache-2.0
// Every knob of a picture, in one struct, and the one table from which command line, scene file and
// studies are made.
#pragma once

#include <core/error.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace stipple {

enum class Method { kPoints, kZBuffer, kRaycast };
enum class Reconstruct { kPerPixel, kSplat, kGaussian, kPullPush, kEwa, kBins };
enum class PullPushCoverage { kBilinear, kSquares };
enum class Sampler { kStratified, kRandom };
enum class Tone { kNone, kFilmic, kAces, kAgx };

struct RenderSettings {
    int width = 1280;  // pixels
    int height = 720;  // pixels
    Method method = Method::kPoints;
    double samples = 1.0;  // K: expected kept points per subpixel of exactly projected area;
                           // raycast: rays a pixel
    int subpixels = 4;     // along one side of a pixel
    Sampler sampler = Sampler::kStratified;
    Reconstruct reconstruct = Reconstruct::kPerPixel;
    double splat_size = 1.0;   // pixels, side of a square splat, or of the box that a Gaussian of
                               // the same variance stands for (gaussian)
    double splat_world = 0.0;  // metres, side of a splat in the world; 0: splat_size alone
    PullPushCoverage pull_push_coverage = PullPushCoverage::kBilinear;
    bool pull_push_threshold = true;  // a coarse depth hides only what lies three pixels behind it
    double ewa_prefilter = 0.4;       // standard deviation, subpixels
    bool shadows = false;
    double shadow_texel = 1.0;  // side of a shadow map's texel where it is seen, pixels
    bool ao = false;
    double ao_radius = 2.0;   // metres: what is farther occludes nothing
    int ao_rays = 16;         // raycast: a hit and side
    double exposure = 0.0;    // stops, beside the scene's
    Tone tone = Tone::kNone;  // of pictures that are shown (PNG)
    uint64_t seed = 1;
    int threads = 0;  // 0: one a core
    // Kept between frames: point lists, and a quarter as much of shadow maps; 0: off.
    int cache_mb = 256;
    double cut_ratio = 1.41;      // largest ratio of depths within a node of the cut
    double area_threshold = 4.0;  // triangles larger than this many subpixels are not drawn as
                                  // points; on surfaces a quarter of it
    double large_triangle =
        1024.0;  // triangles larger than this many subpixels go to OSMesa, before the tiles
    int list_length = 1024;      // most points taken from a node's list before the node is opened
    int tile_size = 384;         // most subpixels along a side of a screen tile (whole pixels)
    double visible_size = 32.0;  // meshes no larger than this many subpixels are drawn by what can
                                 // be seen of them from the eye's direction
    bool orientation = false;    // fewer points on parts of meshes that face the eye sideways
    bool culling = true;         // skip batches behind what a tile has already drawn
    bool fill = true;            // per-pixel: occlusion removal and filling

    bool operator==(const RenderSettings&) const = default;
};

// Whether blended surfaces are drawn in all their layers, each point with its alpha, for a
// reconstruction that puts the layers together; else a share alpha of their points is drawn, and
// those hide what lies behind.
inline bool drawsLayers(const RenderSettings& settings) {
    return settings.method == Method::kPoints && settings.reconstruct == Reconstruct::kBins;
}

// One setting as command line, JSON and help see it.
struct SettingInfo {
    std::string key;         // snake_case, as in --set key=value and the scene file
    std::string values;      // "1..65536", "on|off", "stratified|random"
    std::string unit;        // "pixels", "" if none
    std::string help;        // one sentence
    bool has_option = true;  // has a command line option of its own; else only --set reaches it
};
const std::vector<SettingInfo>& settingsTable();

// Sets one key from text. where: names the place in errors ("--set", "forest.scene.json:
// /render/samples"). Throws kInvalidArgument naming the nearest key or the allowed values.
void applySetting(RenderSettings& settings, const std::string& key, const std::string& value,
                  const std::string& where);
std::string settingValue(const RenderSettings& settings, const std::string& key);

}  // namespace stipple
