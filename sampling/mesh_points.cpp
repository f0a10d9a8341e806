// SPDX-License-Identifier: Apache-2.0
#include <sampling/mesh_points.h>

#include <core/rng.h>

namespace stipple {

namespace {

// So few triangles hide little of each other, and so few layers of surface.
constexpr size_t kFewTriangles = 64;
constexpr float kFewLayers = 1.2f;
// A mesh of more (a terrain) is seldom a plant, and measuring it takes time and memory.
constexpr size_t kManyTriangles = 400000;
// Where nearly all points lie on the whole surface, all may.
constexpr double kNearlyWhole = 0.97;
// Directions are blurred by this much of their length, or instances would change all at once when
// the eye crosses from one part of the sphere to the next.
constexpr double kBlur = 0.15;

Vec3 directionToEye(const View& view, const InstanceFrame& frame, const Box3& bounds) {
    const DVec3 d = view.orthographic ? -frame.facing : frame.eye_object - DVec3(bounds.center());
    const uint64_t h = hashCombine(frame.path, 7);
    const DVec3 blur(double(h & 0x1fffff), double(h >> 21 & 0x1fffff), double(h >> 42 & 0x1fffff));
    return Vec3(glm::normalize(d) + (blur * 0x1p-20 - 1.0) * kBlur);
}

}  // namespace

SeenMesh seeMesh(TileContext& context, const InstanceFrame& frame, uint32_t mesh_index,
                 double drawn) {
    SeenMesh seen;
    const Mesh& mesh = context.scene.meshes[mesh_index];
    if (!context.settings.visible_lists || context.settings.sampler == Sampler::kRandom ||
        mesh.triangles.size() < kFewTriangles || mesh.triangles.size() > kManyTriangles)
        return seen;
    seen.direction = directionIndex(directionToEye(context.view, frame, mesh.bounds));
    const VisibleArea& visible = context.lists.visibleArea(mesh_index, seen.direction);
    if (visible.layers < kFewLayers) return SeenMesh();
    const float spacing = float(1.0 / std::sqrt(drawn));
    seen.layers = double(visible.layers);
    seen.part_share = double(visible.whole_share.aloneAt(spacing));
    seen.whole_share = double(visible.whole_share.withVisibleAt(spacing));
    if (seen.whole_share <= kNearlyWhole) seen.visible = &visible;
    return seen;
}

void addMeshPoints(TileContext& context, PointWriter& points, const InstanceFrame& frame,
                   uint32_t mesh_index, uint32_t node_index, const SeenMesh& seen,
                   RunDensity density, double count) {
    density.layers = seen.layers;
    const MeshNode& node = context.scene.meshes[mesh_index].nodes[node_index];
    const uint64_t key = hashCombine(context.settings.seed, frame.path, mesh_index, node_index);
    const auto add = [&](int direction, uint32_t n) {
        // Parts of a mesh are near and have many points; whole ones may have few.
        const bool is_random = context.settings.sampler == Sampler::kRandom;
        const uint32_t first =
            node_index == 0 || is_random
                ? points.firstOf(hashCombine(frame.path, node_index, uint64_t(direction + 1)), n)
                : 0;
        points.add(frame, {ChildRef::mesh(mesh_index), node_index, direction}, density, first, n);
    };
    if (!seen.visible || node_index != 0) {
        add(ListName::kWhole, uint32_t(roundAtRandom(count * seen.part_share, key)));
        return;
    }
    const double on_visible =
        (1.0 - seen.whole_share) * seen.visible->area(node) / std::max(node.area, 1e-300);
    const double share = seen.whole_share + on_visible;
    const uint64_t total = roundAtRandom(count * share, key);
    const uint64_t n_visible = std::min(
        total, roundAtRandom(double(total) * (on_visible / std::max(share, 1e-300)), mixBits(key)));
    add(seen.direction, uint32_t(n_visible));
    add(ListName::kWhole, uint32_t(total - n_visible));
}

}  // namespace stipple
