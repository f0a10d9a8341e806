// SPDX-License-Identifier: Apache-2.0
// The raycast method: jittered rays a pixel, shaded and box-filtered like everything else.
#pragma once

#include <core/raycaster.h>
#include <reconstruct/picture.h>
#include <render/renderer.h>

namespace stipple {

// settings.samples rays a pixel: jittered strata (one centred ray for 1). Parallel by tile, the
// same bits for any number of threads.
void drawRays(const RayCaster& caster, const View& view, const std::vector<Material>& materials,
              const Lighting& lighting, ThreadPool& pool, const FrameRequest& request,
              Picture& picture, FrameStats& stats);

}  // namespace stipple
