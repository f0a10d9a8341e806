// SPDX-License-Identifier: Apache-2.0
// Samples of a surface by place, and what their discs cover.
#pragma once

#include <core/math.h>

#include <unordered_map>
#include <vector>

namespace stipple {

class CoverGrid {
public:
    // reach: radius of a sample's disc. Deeper than half of it lies another surface.
    explicit CoverGrid(float reach) : reach_(reach) {}

    void add(const Vec3& position, const Vec3& normal) {
        const Vec3 cell = glm::floor(position / kCell / reach_);
        cells_[key(int(cell.x), int(cell.y), int(cell.z))].push_back({position, normal});
    }
    // Whether a disc that faces about the same way has the place in it. O(discs around).
    bool covers(const Vec3& position, const Vec3& normal) const {
        const Vec3 low = glm::floor((position - reach_) / kCell / reach_),
                   high = glm::floor((position + reach_) / kCell / reach_);
        for (int z = int(low.z); z <= int(high.z); ++z) {
            for (int y = int(low.y); y <= int(high.y); ++y) {
                for (int x = int(low.x); x <= int(high.x); ++x) {
                    const auto found = cells_.find(key(x, y, z));
                    if (found == cells_.end()) continue;
                    for (const Disc& disc : found->second) {
                        if (isIn(disc, position, normal)) return true;
                    }
                }
            }
        }
        return false;
    }

private:
    static constexpr float kCell = 2.0f;  // reaches along a cell's side
    struct Disc {
        Vec3 position, normal;
    };
    bool isIn(const Disc& disc, const Vec3& position, const Vec3& normal) const {
        constexpr float kFacing = 0.5f, kDepth = 0.5f;
        const Vec3 off = position - disc.position;
        const float height = glm::dot(off, disc.normal);
        return glm::dot(off, off) - height * height <= reach_ * reach_ &&
               std::abs(height) <= kDepth * reach_ && glm::dot(normal, disc.normal) >= kFacing;
    }
    static uint64_t key(int x, int y, int z) {
        constexpr uint64_t kMask = (1 << 21) - 1;
        return (uint64_t(x) & kMask) << 42 | (uint64_t(y) & kMask) << 21 | (uint64_t(z) & kMask);
    }

    const float reach_;
    std::unordered_map<uint64_t, std::vector<Disc>> cells_;
};

}  // namespace stipple
