// SPDX-License-Identifier: Apache-2.0
// Object ids: a hash of the instance path from the root, the same for points, rasterized triangles
// and rays.
#pragma once

#include <core/rng.h>

#include <cstdint>

namespace stipple {

// Path of a child: slot is the instance's place in the scene file (Group::listed_index, or its
// index where that is empty). The root's path is 0.
inline constexpr uint64_t kPathFactor = 0xd1342543de82ef95ull;
inline uint64_t extendObjectPath(uint64_t parent, uint32_t slot) {
    return parent * kPathFactor + mixBits(slot + 0x632be59bd9b4e019ull);
}

// The low half of the path that goes on for `levels` instances with the low half of another, which
// began at 0: lists of points are shared by all instances of their group.
inline uint32_t joinObjectPaths(uint64_t outer, uint32_t inner, int levels) {
    uint32_t joined = uint32_t(outer);
    for (int i = 0; i < levels; ++i) joined *= uint32_t(kPathFactor);
    return joined + inner;
}

// The id that pictures carry; never 0, which means nothing, nor in the 24 bits that a float keeps.
// path: its low half suffices.
inline uint32_t objectId(uint64_t path) {
    const uint32_t id = mixBits32(uint32_t(path));
    return (id & 0xffffffu) != 0 ? id : id | 1u;
}

}  // namespace stipple
