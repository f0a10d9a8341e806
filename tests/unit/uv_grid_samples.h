// SPDX-License-Identifier: Apache-2.0
// Tables that the tests of grids share.
#pragma once

#include <scenegraph/procedural/uv_grid.h>

namespace stipple {

// value(x, y): metres at texel centres, x and y in (0, 1), y downwards.
template <class Value>
GridTable tableOf(int width, int height, const Value& value) {
    std::vector<Vec3> texels;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x)
            texels.push_back(Vec3(float(value((x + 0.5) / width, (y + 0.5) / height))));
    }
    return makeGridTable(width, height, std::move(texels));
}

// Waves along both sides of a surface, which fade at v = 0 and 1.
inline GridDisplacement ripples(double amplitude, int along_u, int along_v,
                                int texels_a_wave = 12) {
    GridDisplacement d;
    d.table = tableOf(along_u * texels_a_wave, along_v * texels_a_wave, [&](double x, double y) {
        return amplitude * std::sin(2.0 * kPi * along_u * x) * std::sin(2.0 * kPi * along_v * y) *
               std::sin(kPi * y);
    });
    return d;
}

inline GridShape shapeOf(const std::string& surface) {
    GridShape shape;
    shape.surface = surface;
    return shape;
}

}  // namespace stipple
