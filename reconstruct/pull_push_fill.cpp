// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/pull_push_fill.h>

#include <algorithm>

namespace stipple {

namespace {

WeightedImage pull(const WeightedImage& fine) {
    WeightedImage coarse;
    coarse.reset((fine.width + 1) / 2, (fine.height + 1) / 2, fine.channels);
    const size_t n = size_t(fine.channels);
    for (int y = 0; y < fine.height; ++y) {
        for (int x = 0; x < fine.width; ++x) {
            const size_t from = size_t(y) * size_t(fine.width) + size_t(x);
            const size_t to = size_t(y / 2) * size_t(coarse.width) + size_t(x / 2);
            const float w = fine.weights[from];
            if (!(w > 0.0f)) continue;
            coarse.weights[to] += w;
            for (size_t c = 0; c < n; ++c)
                coarse.values[to * n + c] += w * fine.values[from * n + c];
        }
    }
    for (size_t i = 0; i < coarse.weights.size(); ++i) {
        const float w = coarse.weights[i];
        if (!(w > 0.0f)) continue;
        for (size_t c = 0; c < n; ++c) coarse.values[i * n + c] /= w;
        coarse.weights[i] = std::min(w, 1.0f);
    }
    return coarse;
}

// The finished coarse level has weight 1 where it knows anything, else 0.
void push(const WeightedImage& coarse, WeightedImage& fine) {
    const size_t n = size_t(fine.channels);
    for (int y = 0; y < fine.height; ++y) {
        for (int x = 0; x < fine.width; ++x) {
            const size_t to = size_t(y) * size_t(fine.width) + size_t(x);
            const float w = fine.weights[to];
            if (w >= 1.0f) continue;
            const int cx = x / 2, cy = y / 2;
            const int nx = std::clamp(cx + (x % 2 ? 1 : -1), 0, coarse.width - 1);
            const int ny = std::clamp(cy + (y % 2 ? 1 : -1), 0, coarse.height - 1);
            const size_t from[3] = {size_t(cy) * size_t(coarse.width) + size_t(cx),
                                    size_t(cy) * size_t(coarse.width) + size_t(nx),
                                    size_t(ny) * size_t(coarse.width) + size_t(cx)};
            const float share[3] = {0.5f, 0.25f, 0.25f};
            float total = 0.0f;
            for (int k = 0; k < 3; ++k) total += share[k] * coarse.weights[from[k]];
            if (!(total > 0.0f)) {
                if (w > 0.0f) fine.weights[to] = 1.0f;
                continue;
            }
            for (size_t c = 0; c < n; ++c) {
                float value = 0.0f;
                for (int k = 0; k < 3; ++k)
                    value += share[k] * coarse.weights[from[k]] * coarse.values[from[k] * n + c];
                float& result = fine.values[to * n + c];
                result = (w > 0.0f ? w * result : 0.0f) + (1.0f - w) * (value / total);
            }
            fine.weights[to] = 1.0f;
        }
    }
}

}  // namespace

void pullPush(WeightedImage& image, int levels) {
    std::vector<WeightedImage> pyramid;
    for (int level = 0; level < levels; ++level)
        pyramid.push_back(pull(level == 0 ? image : pyramid.back()));
    for (float& w : (levels > 0 ? pyramid.back() : image).weights) w = w > 0.0f ? 1.0f : 0.0f;
    for (int level = levels - 1; level >= 0; --level)
        push(pyramid[size_t(level)], level == 0 ? image : pyramid[size_t(level) - 1]);
    for (size_t i = 0; i < image.weights.size(); ++i) {
        if (image.weights[i] > 0.0f) continue;
        for (int c = 0; c < image.channels; ++c)
            image.values[i * size_t(image.channels) + size_t(c)] = 0.0f;
    }
}

}  // namespace stipple
