// SPDX-License-Identifier: Apache-2.0
#include <render/build_model.h>

#include <raycast/embree_raycaster.h>
#include <scenegraph/io/load_context.h>
#include <scenegraph/surfel_finish.h>

namespace stipple {

SurfelModel buildPointBlockModel(const Scene& scene, const PointBlockOptions& options,
                                 ThreadPool& pool, const CancelFlag& cancel,
                                 const std::function<void(double fraction)>& progress,
                                 PointBlockReport& report) {
    budgetBeside(scene, options.memory_limit_mb)
        .require(pointBlockBytes(options), "--set",
                 "point blocks of this resolution, tolerance angle and so many directions");
    const DBox3 bounds = sceneBounds(scene);
    const DVec3 center = bounds.isEmpty() ? DVec3(0.0) : 0.5 * (bounds.min + bounds.max);
    const auto caster = makeEmbreeRayCaster(scene, center, pool.threadCount());
    return buildPointBlocks(*caster, scene.materials, materialPatchWidths(scene), bounds,
                            scene.groups[scene.root].area, options, pool, cancel, progress, report);
}

}  // namespace stipple
