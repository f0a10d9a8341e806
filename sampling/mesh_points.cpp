// SPDX-License-Identifier: Apache-2.0
#include <sampling/mesh_points.h>

#include <core/rng.h>

#include <algorithm>

namespace stipple {

namespace {

// So few layers of surface hide little of each other.
constexpr float kFewLayers = 1.2f;
// Directions are blurred by this much of their length, or instances would change all at once when
// the eye crosses from one part of the sphere to the next.
constexpr double kBlur = 0.15;

Vec3 blurred(const DVec3& d, const InstanceFrame& frame) {
    const uint64_t h = hashCombine(frame.path, 7);
    const DVec3 blur(double(h & 0x1fffff), double(h >> 21 & 0x1fffff), double(h >> 42 & 0x1fffff));
    return Vec3(glm::normalize(d) + (blur * 0x1p-20 - 1.0) * kBlur);
}

}  // namespace

bool drawsWhatIsSeen(const RenderSettings& settings) {
    return settings.visible_size > 0.0 && settings.sampler != Sampler::kRandom;
}

SeenMesh seeMesh(TileContext& context, const InstanceFrame& frame, uint32_t mesh_index,
                 const RunDensity& density) {
    const Mesh& mesh = context.scene.meshes[mesh_index];
    if (!drawsWhatIsSeen(context.settings) || !hidesItself(mesh)) return SeenMesh();
    // Blended surfaces do not hide what lies behind them.
    const auto isBlended = [](const Stratum& stratum) { return stratum.blended; };
    if (drawsLayers(context.settings) &&
        std::any_of(mesh.strata.begin(), mesh.strata.end(), isBlended))
        return SeenMesh();
    const View& view = context.view;
    const DVec3 center(mesh.bounds.center());
    const DVec3 to_eye = view.orthographic ? -frame.facing : frame.eye_object - center;
    SeenMesh seen;
    seen.direction = directionIndex(blurred(to_eye, frame));
    const VisibleArea& visible = context.lists.visibleArea(mesh_index, seen.direction);
    if (visible.layers < kFewLayers) return SeenMesh();
    seen.layers = double(visible.layers);
    seen.whole_share =
        double(visible.whole_factor.at(float(1.0 / std::sqrt(std::max(density.drawn, 1e-30)))));
    // The projection factor of a surface that faces the eye.
    const double z = view.orthographic ? 1.0 : frame.camera_from_object.point(center).z;
    const double projection = view.focal * view.focal * glm::length(to_eye) / (z * z * z) *
                              (view.orthographic ? 1.0 : frame.volume_scale);
    const double kept = density.wanted * projection;  // per m^2 of what is covered
    seen.visible_share = kept * visible.covered() *
                         double(visible.visible_factor.at(float(1.0 / std::sqrt(kept)))) /
                         std::max(density.drawn * mesh.area, 1e-300);
    return seen;
}

void addMeshPoints(TileContext& context, PointWriter& points, const InstanceFrame& frame,
                   uint32_t mesh_index, uint32_t node_index, const SeenMesh& seen,
                   RunDensity density, double count) {
    const bool is_visible = node_index == 0 && seen.hasVisible();
    const int direction = is_visible ? seen.direction : ListName::kWhole;
    density.layers = is_visible ? 1.0 : seen.layers;
    const uint64_t key = hashCombine(context.settings.seed, frame.path, mesh_index, node_index);
    const uint32_t n =
        uint32_t(roundAtRandom(count * (is_visible ? seen.visible_share : seen.whole_share), key));
    // Parts of a mesh are near and have many points; whole ones may have few.
    const bool may_be_few = node_index == 0 || context.settings.sampler == Sampler::kRandom;
    const uint32_t first =
        may_be_few ? points.firstOf(hashCombine(frame.path, node_index, uint64_t(direction + 1)), n,
                                    uint32_t(context.settings.list_length))
                   : 0;
    points.add(frame, {ChildRef::mesh(mesh_index), node_index, direction}, density, first, n);
}

}  // namespace stipple
