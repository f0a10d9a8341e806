// SPDX-License-Identifier: Apache-2.0
#include <sampling/patch_choice.h>

#include <sampling/node_class.h>

#include <cmath>

namespace stipple {

namespace {

// Where the triangle at a place of the surface has no more than so many subpixels on average,
// points on the mesh as a whole cost less, measured. But they leave some subpixels open, which show
// where a pixel has few.
constexpr double kSmallTriangle = 1.0, kSmallTriangleOfFew = 0.4;
constexpr int kFewSubpixels = 2;    // along a pixel's side
constexpr float kMostError = 0.5f;  // subpixels
// Of coarser triangles none may be left to the z-buffer, which knows only the finest.
constexpr double kBelowLarge = 0.9;

// Costs, in nanoseconds on one core, measured: a surfel of the level, a point on a triangle, a
// triangle, a subpixel that it covers, and what looking a subpixel's textures up adds to shading
// it.
constexpr double kSurfelCost = 15.0, kPointCost = 60.0, kTriangleCost = 40.0, kSubpixelCost = 20.0,
                 kTextureCost = 200.0;

// Area, object space: the mean over the surface, by octants and classes of area.
double triangleAtAPlace(const Mesh& mesh) {
    const MeshNode& root = mesh.nodes[0];
    double sum = 0.0;
    for (uint32_t c = root.first_child; c < root.first_child + root.child_count; ++c) {
        const MeshNode& node = mesh.nodes[c];
        sum += node.area * node.area / std::max(double(node.triangle_count), 1.0);
    }
    return root.child_count > 0 ? sum / root.area : root.max_triangle_area;
}

}  // namespace

bool drawsPatches(const Mesh& mesh, const BoxProjection& box, const DMat3& camera_from_object,
                  const View& view, const RenderSettings& settings) {
    if (mesh.patches.empty() || box.size <= float(settings.visible_size)) return false;
    const double small = view.subpixels > kFewSubpixels ? kSmallTriangle : kSmallTriangleOfFew;
    return projectedArea(triangleAtAPlace(mesh), box.bound * maxAreaScale(camera_from_object)) >
           small;
}

uint32_t choosePatch(const Scene& scene, const MeshPatch& patch, const BoxProjection& box,
                     double area_scale, const View& view, const RenderSettings& settings) {
    const float per_metre = float(std::sqrt(area_scale) * view.focal) /
                            (view.orthographic ? 1.0f : std::max(box.z_min, view.near_z));
    const double bound = box.bound * area_scale;
    uint32_t best = patch.surfels;
    double least = double(kInfinity);
    if (patch.surfels != MeshPatch::kNoMesh) {
        const float wanted = 1.0f / float(std::sqrt(settings.samples));
        for (const SurfelLevel& level : scene.meshes[patch.surfels].surfels->levels) {
            if (level.spacing * per_metre > wanted) break;
            least = kSurfelCost * double(level.size());
        }
    }
    for (size_t l = 0; l < patch.triangles.size(); ++l) {
        const MeshPatch::Triangles& level = patch.triangles[l];
        const Mesh& mesh = scene.meshes[level.mesh];
        const double largest = projectedArea(mesh.nodes[0].max_triangle_area, bound);
        if (l > 0 && (level.error * per_metre > kMostError ||
                      largest > kBelowLarge * settings.large_triangle))
            break;
        // Half of a surface faces the eye, at any angle: a quarter of its area is seen.
        const double covered = std::min(0.25 * projectedArea(mesh.area, bound), 1e12);
        const bool are_points = largest <= settings.area_threshold * kSurfaceThreshold;
        const double shading = patch.is_textured ? kTextureCost * covered : 0.0;
        const double drawing =
            are_points ? kPointCost * 4.0 * covered * settings.samples
                       : kTriangleCost * double(mesh.triangles.size()) + kSubpixelCost * covered;
        const double cost = drawing + shading;
        if (cost < least) least = cost, best = level.mesh;
    }
    return best;
}

}  // namespace stipple
