// SPDX-License-Identifier: Apache-2.0
// What the parts that draw one tile share: the frame, the sink, and what numbers stand for.
#pragma once

#include <core/points.h>
#include <sampling/instance_frame.h>
#include <sampling/point_list.h>
#include <scenegraph/scene.h>

#include <vector>

namespace stipple {

inline constexpr uint32_t kNoFrame = 0xffffffffu;

// What attributes() must know of 64 consecutive numbers.
struct Run {
    Mat3 camera_from_normal = Mat3(1.0f);
    float length_scale = 1.0f;  // camera space over the child's space: root of the area scale
    ChildRef child;             // mesh or group
    uint32_t node = 0;
    int direction = ListName::kWhole;  // of the node's list
    const ListBlock* block = nullptr;  // of first_index; null where the points are made anew
    uint32_t first_index = 0;          // of the node's list, or of the mesh's triangles
    uint64_t path = 0;                 // of the mesh's or the group's instance
    // Index into frames: of triangles of a mesh, and of surfels whose normals turn.
    uint32_t frame = kNoFrame;
    int16_t surfel_level = -1;             // of a prebuilt model's surfels, from first_index on
    uint8_t numbers_per_surfel_shift = 0;  // 1: a surfel has two numbers, of its disc's triangles
};

struct TileContext {
    const Scene& scene;
    const View& view;
    const RenderSettings& settings;
    PointLists& lists;
    PointSink* sink = nullptr;
    std::vector<Run> runs;
    std::vector<InstanceFrame> frames;

    // Below kSurfaceBit; the one thing that may throw while a tile is drawn.
    uint32_t nextNumber() const {
        if (runs.size() >= kSurfaceBit / kBlockPoints) {
            throw Error(ErrorCode::kUnsupported, "",
                        "too many points in one tile: take fewer samples or smaller tiles");
        }
        return uint32_t(runs.size()) * kBlockPoints;
    }
    const Run& runOf(uint32_t number) const {
        return runs[(number & ~kAnyTriangle) / kBlockPoints];
    }
};

}  // namespace stipple
