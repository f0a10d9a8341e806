// SPDX-License-Identifier: Apache-2.0
// What `stipple bench` measures, as plain data between its parts: bench_camera.cpp measures a
// camera, bench_report.cpp makes the table and the JSON of it. All times are seconds of wall time,
// medians.
#pragma once

#include <render/compare.h>
#include <render/edit_times.h>
#include <render/renderer.h>
#include <tools/bench_limit.h>

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace stipple {

// The qualities at which methods are compared: that of so many rays a pixel.
inline constexpr std::array<int, 3> kQualityRays = {1, 4, 16};
// The one at which the first picture is timed.
inline constexpr size_t kFirstPictureQuality = 1;

struct BenchOptions {
    std::string scene_path;
    bool allow_outside = false;
    bool against_raycast = true;  // off: only its pictures are made, for the qualities
    bool against_zbuffer = true;
    int repetitions = 5;
    int reference_rays = 1024;
};

// A method with settings that reach a quality.
struct BenchRun {
    RenderSettings settings;
    bool is_reached = true;       // false: the best there was, below the quality; no ratios
    CompareResult quality;        // against the reference
    double still_seconds = 0.0;   // a frame like the one before, from caches
    double moving_seconds = 0.0;  // a frame after the camera has moved; without rebuilding for rays
    FrameStats stats;             // of a still frame
};

// A process of its own that loads, builds and draws one frame.
struct ColdStart {
    double load_seconds = 0.0;   // the file, and the groups' octrees, which points need
    double build_seconds = 0.0;  // Embree's scene, which rays need
    double frame_seconds = 0.0;
    double picture_seconds = 0.0;  // build and frame
    double total_seconds = 0.0;    // load, build and frame
    uint64_t peak_bytes = 0;
};

struct BenchMethod {
    Method method = Method::kPoints;
    std::array<BenchRun, kQualityRays.size()> runs;
    ColdStart cold;  // with the settings of kFirstPictureQuality
};

// One step of the search for the point method's settings.
struct SearchStep {
    RenderSettings settings;
    double psnr_db = 0.0;
    double seconds = 0.0;
};

struct CameraBench {
    std::string camera;
    std::string reference_path;
    bool is_reference_cached = false;
    std::vector<BenchMethod> methods;  // points first
    std::vector<SearchStep> search;
    double fresh_seconds = 0.0;  // the points of the highest quality without caches
    std::vector<double> limit_points_per_second;  // measured between the frames
    double rays_per_second = 0.0;                 // of the highest quality; 0 without raycast
};

struct BenchResult {
    std::string command;
    BenchOptions options;
    SceneSize scene;
    int width = 0, height = 0, threads = 0;
    double load_seconds = 0.0;
    size_t limit_buffer_bytes = 0;
    std::vector<std::string> left_out;  // a line for each method that is not measured
    std::vector<CameraBench> cameras;
    EditTimes edits;
};

double median(std::vector<double> values);

// Everything for one camera. settings: base for all methods. progress(what, fraction). Throws
// kCancelled and what rendering throws.
CameraBench benchCamera(const Scene& scene, const Camera& camera, const RenderSettings& settings,
                        const BenchOptions& options, ThreadPool& pool, MachineLimit& limit,
                        const CancelFlag& cancel,
                        const std::function<void(const std::string&, double)>& progress);

// The table, piece by piece.
std::string benchHeading(const BenchResult& result);
std::string cameraTable(const CameraBench& camera, const BenchResult& result);
std::string editTable(const EditTimes& edits);
// Schema in docs/cli.md.
std::string benchJson(const BenchResult& result);

}  // namespace stipple
