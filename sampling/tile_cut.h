// SPDX-License-Identifier: Apache-2.0
// Draws batches into a tile: opens their nodes near before far, where nothing hides them, down to
// those that are drawn as points or triangles. Based on: Wand et al. 2001 ("Choosing Groups").
#pragma once

#include <sampling/frame_plan.h>
#include <sampling/group_points.h>
#include <sampling/mesh_points.h>
#include <sampling/projection.h>
#include <sampling/surfel_points.h>
#include <sampling/triangle_writer.h>

namespace stipple {

class TileCut : public TileEmitter {
public:
    TileCut(const Scene& scene, const View& view, const RenderSettings& settings,
            const FramePlan& plan, PointLists& lists);

    void emit(const Batch& batch, PointSink& sink) override;
    void attributes(uint32_t number, float sub_x, float sub_y,
                    SurfaceSample& sample) const override;
    void prefetch(uint32_t number) const override;
    void forget() override;

private:
    // A child of a node that is being opened.
    struct Opened {
        BoxProjection box;
        uint32_t index = 0;  // of the node, or of the instance
        bool is_instance = false;
    };

    void drawGroupNode(ChildRef group, uint32_t node, const Affine& camera_from_group,
                       uint64_t path, const BoxProjection& box);
    bool drawAsPoints(ChildRef group, uint32_t node, const Affine& camera_from_group, uint64_t path,
                      const BoxProjection& box);
    void drawMesh(uint32_t mesh, uint32_t node, const Affine& camera_from_object, uint64_t path,
                  const BoxProjection& box);
    void drawPatches(const Mesh& mesh, const Affine& camera_from_object, uint64_t path);
    void drawMeshNode(const InstanceFrame& frame, uint32_t mesh, const SeenMesh& seen,
                      uint32_t node, const BoxProjection& box, uint32_t& triangle_frame);
    // facing: the largest |cos beta| of what is drawn.
    RunDensity meshDensity(const InstanceFrame& frame, const BoxProjection& box,
                           double facing) const;
    void collect(const Affine& camera_from_child, const Box3& bounds, uint32_t index,
                 bool is_instance);
    void sortCollected(size_t begin);
    bool isHidden(const BoxProjection& box) const {
        return context_.sink->hides(box.rect, box.z_min, false);
    }

    TileContext context_;
    const FramePlan& plan_;
    PointWriter points_;
    GroupPoints group_points_;
    TriangleWriter triangles_;
    SurfelPoints surfels_;
    std::vector<Opened> opened_;  // a stack: each opening uses its end
};

}  // namespace stipple
