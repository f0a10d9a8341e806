// SPDX-License-Identifier: Apache-2.0
// References of many rays a pixel, which take minutes: kept on disk from run to run.
#pragma once

#include <render/renderer.h>

#include <functional>
#include <string>

namespace stipple {

struct Reference {
    Image image;  // with coverage, depth and depth_max
    std::string path;
    bool is_cached = false;  // it came from the disk
};

// Ray-cast with `rays` rays a pixel and a seed of its own. The file's name is a hash of the
// program's version, the camera, the size, the rays and of a picture with few rays, which is cast
// each time: so whatever changes the picture, in the scene's files or in the program, makes another
// reference. request: camera, size, cancel. progress may be called from any thread, one at a time.
// The folder is $STIPPLE_CACHE, $XDG_CACHE_HOME/stipple or ~/.cache/stipple. Throws as
// Renderer::render(), and kIo if the folder cannot be written to.
Reference loadOrCastReference(Renderer& renderer, FrameRequest request, int rays,
                              const std::function<void(double fraction)>& progress);

}  // namespace stipple
