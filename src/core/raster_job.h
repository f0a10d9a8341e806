// SPDX-License-Identifier: Apache-2.0
// What is left to the z-buffer, and what comes back: plain data between planning (sampling), the
// rasterizer and reconstruction.
#pragma once

#include <core/math.h>

#include <cstdint>
#include <vector>

namespace stipple {

inline constexpr uint32_t kNoNumber = 0xffffffffu;

struct TriangleRange {
    uint32_t first = 0;
    uint32_t count = 0;
};

// Some triangles of one instance of a mesh. Triangle t of the mesh gets the number first_number +
// t.
struct RasterDraw {
    uint32_t mesh = 0;         // index into the meshes given at creation
    Mat3 linear = Mat3(1.0f);  // p_camera = linear * p_object + translation (composed in double,
                               // relative to the eye)
    Vec3 translation = Vec3(0.0f);
    uint32_t first_number = 0;
    uint32_t range_begin = 0;  // ranges[range_begin, range_begin + range_count) of RasterJob
    uint32_t range_count = 0;
};

struct RasterJob {
    std::vector<RasterDraw> draws;
    std::vector<TriangleRange> ranges;
};

// One value a subpixel, row 0 on top.
struct RasterTarget {
    int width = 0;  // subpixels
    int height = 0;
    std::vector<float>
        depth;  // camera z at the subpixel's centre; infinite where nothing was drawn
    std::vector<uint32_t> number;  // of the nearest triangle; kNoNumber where nothing was drawn
};

}  // namespace stipple
