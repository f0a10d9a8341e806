// SPDX-License-Identifier: Apache-2.0
#include <render/build_model.h>

#include <raycast/embree_raycaster.h>

namespace stipple {

namespace {

// Mean width of what a material's surface is connected to, by area.
std::vector<float> patchWidths(const Scene& scene) {
    std::vector<double> width(scene.materials.size(), 0.0), area(scene.materials.size(), 1e-30);
    for (const Mesh& mesh : scene.meshes) {
        for (size_t t = 0; t < mesh.triangles.size(); ++t) {
            const double a = mesh.cumulative_area[t + 1] - mesh.cumulative_area[t];
            const uint16_t m = mesh.triangle_material[t];
            width[m] += a * double(mesh.strata[mesh.triangle_stratum[t]].patch_width);
            area[m] += a;
        }
    }
    std::vector<float> result;
    for (size_t m = 0; m < width.size(); ++m)
        result.push_back(float(std::min(width[m] / area[m], 1e12)));
    return result;
}

}  // namespace

SurfelModel buildPointBlockModel(const Scene& scene, const PointBlockOptions& options,
                                 ThreadPool& pool, const CancelFlag& cancel,
                                 const std::function<void(double fraction)>& progress,
                                 PointBlockReport& report) {
    const DBox3 bounds = sceneBounds(scene);
    const DVec3 center = bounds.isEmpty() ? DVec3(0.0) : 0.5 * (bounds.min + bounds.max);
    const auto caster = makeEmbreeRayCaster(scene, center, pool.threadCount());
    return buildPointBlocks(*caster, scene.materials, patchWidths(scene), bounds,
                            scene.groups[scene.root].area, options, pool, cancel, progress, report);
}

}  // namespace stipple
