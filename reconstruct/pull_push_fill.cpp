// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/pull_push_fill.h>

#include <algorithm>
#include <limits>
#include <optional>

namespace stipple {

namespace {

constexpr float kNoSurface = std::numeric_limits<float>::infinity();
// What a coarse pixel has where a silhouette crosses it.
enum class Side { kBoth, kFarthest };

class Pyramid {
public:
    Pyramid(const WeightedImage& image, const PullPushRules& rules, Side side)
        : rules_(rules), side_(side), levels_(size_t(rules.levels)) {
        for (int l = 0; l < rules.levels; ++l) pull(l == 0 ? image : levels_[size_t(l) - 1], l + 1);
        for (float& w : levels_.back().weights) w = w > 0.0f ? 1.0f : 0.0f;
        for (int l = rules.levels - 1; l > 0; --l) push(l);
    }

    // What the level above `level` has for a pixel of it: values into `sums`. Returns their depth,
    // infinite if there is nothing.
    float look(int level, int x, int y, std::vector<float>& sums) const {
        const WeightedImage& coarse = levels_[size_t(level)];
        const int cx = x / 2, cy = y / 2;
        const int nx = std::clamp(cx + (x % 2 ? 1 : -1), 0, coarse.width - 1);
        const int ny = std::clamp(cy + (y % 2 ? 1 : -1), 0, coarse.height - 1);
        const size_t from[3] = {size_t(cy) * size_t(coarse.width) + size_t(cx),
                                size_t(cy) * size_t(coarse.width) + size_t(nx),
                                size_t(ny) * size_t(coarse.width) + size_t(cx)};
        const float share[3] = {0.5f, 0.25f, 0.25f};
        float weights[3];
        for (int k = 0; k < 3; ++k) weights[k] = share[k] * coarse.weights[from[k]];
        float depth;
        return mean(coarse, from, weights, 3, level + 1, sums.data(), depth) > 0.0f ? depth
                                                                                    : kNoSurface;
    }

private:
    // The weighted mean of some pixels, of those on the farthest surface alone if this is its
    // pyramid. Returns the sum of the weights, 0 if none of them has a surface.
    float mean(const WeightedImage& image, const size_t* pixels, const float* weights, int count,
               int level, float* values, float& depth) const {
        const size_t n = size_t(image.channels);
        float farthest = 0.0f;
        for (int k = 0; k < count; ++k) {
            const float d = image.depths[pixels[k]];
            if (weights[k] > 0.0f && d < kNoSurface) farthest = std::max(farthest, d);
        }
        const float slack =
            rules_.slope * float(1 << level) * (rules_.orthographic ? 1.0f : farthest);
        const float nearest = side_ == Side::kBoth ? -kNoSurface : farthest - slack;
        float total = 0.0f;
        depth = 0.0f;
        std::fill(values, values + n, 0.0f);
        for (int k = 0; k < count; ++k) {
            const float w = weights[k], d = image.depths[pixels[k]];
            if (!(w > 0.0f) || !(d >= nearest && d < kNoSurface)) continue;
            total += w;
            depth += w * d;
            for (size_t c = 0; c < n; ++c) values[c] += w * image.values[pixels[k] * n + c];
        }
        if (!(total > 0.0f)) return 0.0f;
        for (size_t c = 0; c < n; ++c) values[c] /= total;
        depth /= total;
        return total;
    }

    // Makes level `level` of the one below.
    void pull(const WeightedImage& fine, int level) {
        WeightedImage& coarse = levels_[size_t(level) - 1];
        coarse.reset((fine.width + 1) / 2, (fine.height + 1) / 2, fine.channels);
        size_t to = 0;
        for (int y = 0; y < coarse.height; ++y) {
            for (int x = 0; x < coarse.width; ++x, ++to) {
                size_t from[4];
                float weights[4], depth;
                int count = 0;
                for (int v = 2 * y; v < std::min(2 * y + 2, fine.height); ++v) {
                    for (int u = 2 * x; u < std::min(2 * x + 2, fine.width); ++u) {
                        from[count] = size_t(v) * size_t(fine.width) + size_t(u);
                        weights[count] = fine.weights[from[count]];
                        ++count;
                    }
                }
                const float sum = mean(fine, from, weights, count, level,
                                       &coarse.values[to * size_t(fine.channels)], depth);
                if (!(sum > 0.0f)) continue;
                coarse.depths[to] = depth;
                coarse.weights[to] = std::min(sum, 1.0f);
            }
        }
    }

    // Fills the gaps of a level from the one above. All weights become 0 or 1.
    void push(int level) {
        WeightedImage& fine = levels_[size_t(level) - 1];
        const size_t n = size_t(fine.channels);
        std::vector<float> above(n);
        size_t to = 0;
        for (int y = 0; y < fine.height; ++y) {
            for (int x = 0; x < fine.width; ++x, ++to) {
                const float w = fine.weights[to];
                if (w >= 1.0f) continue;
                const float depth = look(level, x, y, above);
                if (w > 0.0f) fine.weights[to] = 1.0f;
                if (depth == kNoSurface) continue;
                fine.weights[to] = 1.0f;
                fine.depths[to] = w > 0.0f ? w * fine.depths[to] + (1.0f - w) * depth : depth;
                for (size_t c = 0; c < n; ++c) {
                    float& value = fine.values[to * n + c];
                    value = w * value + (1.0f - w) * above[c];
                }
            }
        }
    }

    const PullPushRules& rules_;
    const Side side_;
    std::vector<WeightedImage> levels_;  // level 1 first
};

}  // namespace

void WeightedImage::reset(int w, int h, int c) {
    width = w, height = h, channels = c;
    const size_t n = size_t(w) * size_t(h);
    values.assign(n * size_t(c), 0.0f);
    weights.assign(n, 0.0f);
    depths.assign(n, kNoSurface);
}

void pullPush(WeightedImage& image, const PullPushRules& rules) {
    const size_t n = size_t(image.channels);
    std::vector<float> both(n), back(n);
    std::optional<Pyramid> of_both, of_farthest;
    if (rules.levels > 0) of_both.emplace(image, rules, Side::kBoth);
    size_t i = 0;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x, ++i) {
            const float w = image.weights[i];
            if (w >= 1.0f) continue;
            float* values = &image.values[i * n];
            if (!(w > 0.0f)) std::fill(values, values + n, 0.0f);
            if (!of_both || of_both->look(0, x, y, both) == kNoSurface) continue;
            // What is missing of a pixel that shows a surface lies before it, and is of the pixel's
            // surface or of what covers it; where a pixel shows nothing, who covers it decides.
            float share = 1.0f;
            if (!(w > 0.0f) || image.depths[i] == kNoSurface) {
                if (!of_farthest) of_farthest.emplace(image, rules, Side::kFarthest);
                const float depth = of_farthest->look(0, x, y, back);
                share = std::min(rules.coverage(x, y, depth) / (1.0f - w), 1.0f);
            }
            for (size_t c = 0; c < n; ++c)
                values[c] =
                    w * values[c] + (1.0f - w) * (share * both[c] + (1.0f - share) * back[c]);
        }
    }
}

}  // namespace stipple
