// SPDX-License-Identifier: Apache-2.0
// How long Embree takes to follow an edit: the yardstick of scenegraph/scene_editor.h.
#pragma once

#include <core/parallel.h>
#include <scenegraph/scene.h>

namespace stipple {

struct EmbreeMoveSeconds {
    double commit = 0.0;   // with the build quality that pictures are cast with
    double dynamic = 0.0;  // the scene flagged dynamic, low build quality
};

// Medians of `repetitions` commits of the largest group of meshes, each after one of its instances
// has moved. 0 where no group holds meshes. Throws as makeEmbreeRayCaster().
EmbreeMoveSeconds measureEmbreeMoves(const Scene& scene, int repetitions, int n_threads);

}  // namespace stipple
