// SPDX-License-Identifier: Apache-2.0
// Object ids: a hash of the instance path from the root, the same for points, rasterized triangles
// and rays.
#pragma once

#include <core/rng.h>

#include <cstdint>

namespace stipple {

// Path of a child: slot is the instance's place in the scene file (Group::listed_index, or its
// index where that is empty). The root's path is 0.
inline uint64_t extendObjectPath(uint64_t parent, uint32_t slot) {
    return hashCombine(parent, slot);
}

// The id that pictures carry; never 0, which means nothing, nor in the 24 bits that a float keeps.
inline uint32_t objectId(uint64_t path) {
    const uint32_t id = uint32_t(path >> 32);
    return (id & 0xffffffu) != 0 ? id : id | 1u;
}

}  // namespace stipple
