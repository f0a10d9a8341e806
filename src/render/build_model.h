// SPDX-License-Identifier: Apache-2.0
// From a scene to a prebuilt model of it.
#pragma once

#include <sampling/point_blocks.h>
#include <scenegraph/scene.h>

namespace stipple {

// A point-block model of all that the scene's root shows. Throws as buildPointBlocks().
SurfelModel buildPointBlockModel(const Scene& scene, const PointBlockOptions& options,
                                 ThreadPool& pool, const CancelFlag& cancel,
                                 const std::function<void(double fraction)>& progress,
                                 PointBlockReport& report);

}  // namespace stipple
