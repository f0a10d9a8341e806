// SPDX-License-Identifier: Apache-2.0
// Pull-push: fills what is missing in a picture from coarser and coarser averages of what is there.
// Based on: Grossman. Point Sample Rendering. MIT MSc thesis, 1998, section 4.7.
#pragma once

#include <cstddef>
#include <vector>

namespace stipple {

// Interleaved float channels and one weight in [0, 1] a pixel, row by row.
struct WeightedImage {
    int width = 0, height = 0, channels = 0;
    std::vector<float> values;
    std::vector<float> weights;

    void reset(int w, int h, int c) {
        width = w, height = h, channels = c;
        values.assign(size_t(w) * size_t(h) * size_t(c), 0.0f);
        weights.assign(size_t(w) * size_t(h), 0.0f);
    }
};

// Replaces each value c of weight w by w c + (1 - w) c~. Pull: a coarser level has the weighted
// mean of four pixels and weight min(1, sum of weights), `levels` times. Push: c~ comes from the
// nearest coarser pixels with 1/2, 1/4 and 1/4, those of weight 0 on all levels left out. What
// nothing on any level reaches becomes 0. Coarse pixels lie on multiples of 2^levels from the
// image's corner, so the corner must lie on one if tiles are to agree.
void pullPush(WeightedImage& image, int levels);

}  // namespace stipple
