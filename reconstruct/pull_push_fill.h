// SPDX-License-Identifier: Apache-2.0
// Pull-push: fills what is missing in a picture from coarser and coarser averages of what is there.
// Based on: Grossman. Point Sample Rendering. MIT MSc thesis, 1998, section 4.7.
//
// In the thesis a coarse pixel that a silhouette crosses is the mean of both sides, and what it
// fills beside the silhouette takes on the foreground's colour. A second pyramid here has only the
// farthest surface of each coarse pixel; it fills what the nearer one does not cover.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace stipple {

// Interleaved float channels, one weight in [0, 1] and the depth of its surface a pixel, row by
// row. What weighs something and has no surface (infinite depth) is filled, but fills nothing.
struct WeightedImage {
    int width = 0, height = 0, channels = 0;
    std::vector<float> values;
    std::vector<float> weights;
    std::vector<float> depths;

    // Nothing anywhere: weight 0, infinite depth.
    void reset(int w, int h, int c);
};

struct PullPushRules {
    int levels = 0;
    // Depth that one surface gains over a pixel's width, at most: metres, or metres per depth.
    float slope = 0.0f;
    bool orthographic = false;
    // How far [0, 1] what is nearer covers the depth at a pixel.
    std::function<float(int x, int y, float depth)> coverage;
};

// Replaces each value c of weight w by w c + (1 - w) c~. Pull: a coarser level has the weighted
// mean of four pixels and weight min(1, sum of weights), `levels` times. Push: c~ comes from the
// nearest coarser pixels with 1/2, 1/4 and 1/4, those of weight 0 on all levels left out. What
// nothing on any level reaches stays as it is, or becomes 0 where w = 0. Coarse pixels lie on
// multiples of 2^levels from the image's corner, so the corner must lie on one if tiles are to
// agree.
void pullPush(WeightedImage& image, const PullPushRules& rules);

}  // namespace stipple
