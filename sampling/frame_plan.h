// SPDX-License-Identifier: Apache-2.0
// The coarse cut: which parts of the scene are in view, near enough to each other to be sorted and
// hidden as a whole, and which triangles are left to the z-buffer. Drawing opens the parts further,
// where they are not hidden. Based on: Wand et al. 2001 ("Choosing Groups", "Handling of large
// triangles").
#pragma once

#include <core/points.h>
#include <core/raster_job.h>
#include <core/settings.h>
#include <sampling/instance_frame.h>
#include <scenegraph/scene.h>

#include <vector>

namespace stipple {

// What a batch draws: a node of a group or of a mesh.
struct PlannedNode {
    Affine camera_from_child;
    ChildRef child;
    uint32_t node = 0;  // of its octree
    uint64_t path = 0;  // hash of the instance path
};

// Draw i of the raster job shows this.
struct RasterInstance {
    InstanceFrame frame;
    uint32_t mesh = 0;
};

struct FramePlan {
    std::vector<PlannedNode> nodes;
    std::vector<Batch> batches;  // batches[i].index == i draws nodes[i]
    RasterJob raster;
    std::vector<RasterInstance> raster_instances;
    uint64_t raster_triangles = 0;
};

// Plans one view. With rasterize_all everything in the frustum goes to the z-buffer (the zbuffer
// method). Parallel; the same plan for any number of threads. O(cut) time and memory. Throws
// kCancelled.
FramePlan planFrame(const Scene& scene, const View& view, const RenderSettings& settings,
                    bool rasterize_all, ThreadPool& pool, const CancelFlag* cancel);

}  // namespace stipple
