// SPDX-License-Identifier: Apache-2.0
// How much sky reaches a place inside a crown, and from where: light through a coarse grid of leaf
// area, baked into vertex colours and normals, so that a crown shows light and dark masses without
// shadow rays.
#pragma once

#include <core/math.h>

#include <vector>

namespace stipple {

struct CrownLightSample {
    float openness;  // 0: no sky is seen, 1: all of it
    Vec3 outward;    // unit: the direction most light comes from
};

class CrownLight {
public:
    // leaves: places of equal leaf area, leaf_area square metres each. O(leaves + cells).
    CrownLight(const std::vector<Vec3>& leaves, float leaf_area);
    CrownLightSample at(const Vec3& p) const;

private:
    static constexpr int kCells = 28;  // along the longest side
    size_t index(int x, int y, int z) const { return (size_t(z) * size_[1] + y) * size_[0] + x; }
    std::vector<float> opticalDepth(const std::vector<float>& density, const int (&step)[3]) const;

    Vec3 origin_ = Vec3(0.0f);  // centre of cell (0, 0, 0)
    float cell_ = 1.0f;         // metres
    int size_[3] = {2, 2, 2};
    std::vector<Vec4> light_;  // outward direction (not normalized), openness
};

}  // namespace stipple
