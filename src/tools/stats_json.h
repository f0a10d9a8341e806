// SPDX-License-Identifier: Apache-2.0
// The `--stats` file: what a render did, in one versioned JSON object (docs/cli.md lists its keys).
#pragma once

#include <render/renderer.h>

#include <string>
#include <vector>

namespace stipple {

struct RunStats {
    std::string command;  // the whole command line
    std::string scene_path;
    std::string camera;
    SceneSize scene;
    RenderSettings settings;
    double load_seconds = 0.0;   // reading the files and building the scene graph
    double build_seconds = 0.0;  // what the renderer prepares before its first frame
    double write_seconds = 0.0;
    std::vector<FrameStats> frames;  // in order, at least one
    std::vector<std::string> warnings;
};

// Phases are sums over the whole run, counters those of the last frame. Keys are only added within
// a schema number.
std::string statsJson(const RunStats& stats);

// The most memory this process has had resident so far.
size_t peakMemoryBytes();

}  // namespace stipple
