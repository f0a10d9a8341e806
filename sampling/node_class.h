// SPDX-License-Identifier: Apache-2.0
// What becomes of a mesh node in a view: points, triangles rasterized tile by tile, triangles for
// the z-buffer, or opened. Based on: Wand et al. 2001 ("Choosing Groups", "Handling of large
// triangles: additional classification by triangle area").
#pragma once

#include <core/settings.h>
#include <sampling/projection.h>
#include <scenegraph/mesh.h>

namespace stipple {

enum class NodeClass { kOpen, kPoints, kTriangles, kLargeTriangles };

// Opening a node costs about as much as drawing this many points.
inline constexpr double kFewPoints = 16.0;
// Larger runs of large triangles are opened to find parts outside the frustum.
inline constexpr uint32_t kCullTriangles = 4096;
// A group's node with more points than this per subpixel is opened: most of it hides behind its own
// front.
inline constexpr double kMostOverdraw = 24.0;
// Unless its thinner side is no more subpixels than this: then its front cannot be told from the
// rest, and this many points a subpixel stand for it.
inline constexpr float kThinNode = 2.0f;
// What is drawn as points is drawn anew in each tile it touches, so groups are opened to this many
// subpixels across. Whatever the tiles: pages of shadows are small, and opening costs more there
// than points beyond the page. Larger groups leave too much to chance.
inline constexpr float kLargestGroupRun = 48.0f;
// Parts of meshes, which are near: the larger they are, the less even are their points.
inline constexpr float kLargestMeshRun = 32.0f;

// On surfaces, where points would have to close holes, triangles are rasterized from this share of
// settings.area_threshold on; in foliage points are cheaper for longer.
inline constexpr double kSurfaceThreshold = 0.25;

// area_scale: largest area scale of the instance. facing: the largest |cos beta| below the node;
// says only how many points there would be. Depends on nothing but the node and the view, so
// planning and drawing agree on triangles.
inline NodeClass classifyNode(const Mesh& mesh, const MeshNode& node, const BoxProjection& box,
                              double area_scale, double facing, const RenderSettings& settings) {
    const bool is_leaf = node.child_count == 0;
    const bool is_mixed = node.stratum == kMixedStratum;
    const double bound = box.bound * area_scale;
    const double largest = projectedArea(node.max_triangle_area, bound);
    const bool may_be_surface =
        is_mixed || projectedArea(double(mesh.strata[node.stratum].patch_width) *
                                      double(mesh.strata[node.stratum].patch_width),
                                  bound) > double(kSurfaceWidth * kSurfaceWidth);
    if (largest <= settings.area_threshold * (may_be_surface ? kSurfaceThreshold : 1.0)) {
        const double n = settings.samples * bound * facing * node.area;
        const bool fits = box.size <= kLargestMeshRun && n <= settings.list_length;
        const bool is_uniform = box.depth_ratio <= settings.cut_ratio;
        return is_leaf || (is_uniform && (fits || n <= kFewPoints)) ? NodeClass::kPoints
                                                                    : NodeClass::kOpen;
    }
    if (is_mixed) return NodeClass::kOpen;  // never a leaf
    // What is large at the far end of the box is large everywhere in it.
    const double far_largest = largest / (box.depth_ratio * box.depth_ratio);
    // The z-buffer keeps one layer. Triangles that reach behind the eye it alone can clip.
    const bool keeps_layers = drawsLayers(settings) && mesh.strata[node.stratum].blended &&
                              box.depth_ratio < std::numeric_limits<double>::infinity();
    if (!keeps_layers && (is_leaf ? largest : far_largest) > settings.large_triangle) {
        const bool is_short = is_leaf || box.is_inside || node.triangle_count <= kCullTriangles;
        return is_short ? NodeClass::kLargeTriangles : NodeClass::kOpen;
    }
    return is_leaf ? NodeClass::kTriangles : NodeClass::kOpen;
}

}  // namespace stipple
