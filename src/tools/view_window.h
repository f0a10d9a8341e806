// SPDX-License-Identifier: Apache-2.0
// The viewer's window (GLFW, Dear ImGui): its picture, mouse, keys and panel.
#pragma once

#include <core/settings.h>
#include <render/live_scene.h>

#include <string>
#include <vector>

namespace stipple {

struct ViewOptions {
    std::string title;
    std::string save_path;        // for Ctrl+S; empty: cannot be saved
    std::string screenshot_path;  // for F12
    RenderSettings settings;
    double frame_rate = 20.0;  // target while the camera moves
};

// Opens a window and returns when it is closed. camera: at first. palette: what can be planted, by
// name. Throws kInternal where no window can be opened.
void runViewWindow(LiveScene& scene, const Camera& camera, const std::vector<std::string>& palette,
                   const ViewOptions& options);

}  // namespace stipple
