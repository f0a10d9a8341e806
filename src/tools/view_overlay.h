// SPDX-License-Identifier: Apache-2.0
// What the viewer can show in place of, or over, its picture.
#pragma once

#include <tools/view_renderer.h>

namespace stipple {

enum class Overlay { kNone, kCut, kKinds, kCount, kDepth };
inline constexpr int kOverlayCount = 5;
inline constexpr const char* kOverlayNames[kOverlayCount] = {
    "none", "cut", "points green, triangles orange", "points a pixel", "depth"};

// Colours the picture by its counts or depths; what is shown as it is stays. image: of the picture,
// linear.
void applyOverlay(Overlay overlay, const ShownPicture& picture, Image& image);

// An edge of a box of the cut in shares of the picture's width and height; dim: how far it is, from
// 0 (near) to 1.
struct CutEdge {
    Vec2 a, b;
    float dim = 0.0f;
};
// Of the nearest boxes, as many as can be told apart. O(boxes).
std::vector<CutEdge> cutEdges(const ShownPicture& picture);

}  // namespace stipple
