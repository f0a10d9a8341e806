// SPDX-License-Identifier: Apache-2.0
// Which points belong to the surface that a subpixel shows: those whose depth differs from its
// front by no more than a slanted surface gains within a subpixel, or than the patch they lie on is
// wide.
#pragma once

#include <core/camera.h>
#include <core/points.h>

#include <array>
#include <cmath>

namespace stipple {

class FrontSlack {
public:
    explicit FrontSlack(const View& view) : orthographic_(view.orthographic) {
        for (int code = 0; code < kWidthCodes; ++code) {
            const float width =
                std::exp2(float(code) / float(kWidthsPerOctave) + float(kFirstSubpixelExponent));
            slack_[size_t(code)] = std::clamp(width, 1.0f, kMost) / float(view.focal);
        }
    }
    bool isOnFront(float z, float front, uint8_t width_code) const {
        return std::abs(z - front) <= slack_[width_code] * (orthographic_ ? 1.0f : z);
    }
    // A front nearer than this has no points at z or behind it.
    float frontOf(float z) const {
        const float most = slack_[kWidthCodes - 1] * 1.001f;  // rounding
        return z - most * (orthographic_ ? 1.0f : z);
    }

private:
    // A surface seen at 80 degrees gains 6 subpixels of depth for each subpixel sideways.
    static constexpr float kMost = 8.0f;  // subpixels
    const bool orthographic_;
    std::array<float, kWidthCodes> slack_;  // depth per depth, or metres
};

}  // namespace stipple
