// SPDX-License-Identifier: Apache-2.0
#include <render/compare.h>

#include <render/flip.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace stipple {

namespace {

constexpr int kTile = 32;           // pixels
constexpr double kDarkTile = 0.02;  // mean linear luminance
constexpr float kDepthSlack = 1.02f;

void checkComparable(const Image& a, const Image& b) {
    const auto size = [](const Image& i) {
        return std::to_string(i.width) + "x" + std::to_string(i.height);
    };
    if (a.width != b.width || a.height != b.height) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "the pictures differ in size: " + size(a) + " and " + size(b));
    }
    if (a.width < 1 || a.height < 1 || a.channels.empty() || b.channels.empty()) {
        throw Error(ErrorCode::kInvalidArgument, "", "the pictures are empty");
    }
}

// Channels that hold red, green and blue: by name, else the first three, else the first for all
// (grey).
std::array<int, 3> colorChannels(const Image& image) {
    const std::array<int, 3> named{image.channelIndex("R"), image.channelIndex("G"),
                                   image.channelIndex("B")};
    if (named[0] >= 0 && named[1] >= 0 && named[2] >= 0) return named;
    return image.channelCount() >= 3 ? std::array<int, 3>{0, 1, 2} : std::array<int, 3>{0, 0, 0};
}

// R, G, B alone, clipped to [0, 1].
Image clippedColor(const Image& image) {
    const std::array<int, 3> channels = colorChannels(image);
    Image out(image.width, image.height, {"R", "G", "B"});
    const size_t n = size_t(image.width) * image.height;
    for (size_t i = 0; i < n; ++i) {
        const float* p = image.data.data() + i * image.channels.size();
        for (int c = 0; c < 3; ++c) {
            const float v = p[channels[c]];
            out.data[3 * i + c] = v > 0.0f ? std::min(v, 1.0f) : 0.0f;
        }
    }
    return out;
}

double meanSquaredDifference(const Image& a, const Image& b, ThreadPool& pool) {
    // Sums of rows are added in order: the same bits for any number of threads.
    std::vector<double> row_sum(a.height);
    pool.forEach(size_t(a.height), [&](size_t y, int) {
        const float *pa = a.pixel(0, int(y)), *pb = b.pixel(0, int(y));
        for (int i = 0; i < 3 * a.width; ++i) {
            const double d = double(srgbFromLinear(pa[i])) - double(srgbFromLinear(pb[i]));
            row_sum[y] += d * d;
        }
    });
    double sum = 0.0;
    for (double s : row_sum) sum += s;
    return sum / double(a.data.size());
}

// True for every pixel that is a hole; empty where channels are missing.
std::vector<bool> findHoles(const Image& image, const Image& reference) {
    const int a_coverage = image.channelIndex("coverage"), a_depth = image.channelIndex("depth");
    const int b_coverage = reference.channelIndex("coverage"),
              b_depth = reference.channelIndex("depth_max");
    if (a_coverage < 0 || a_depth < 0 || b_coverage < 0 || b_depth < 0) return {};
    std::vector<bool> holes(size_t(image.width) * image.height, false);
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            if (!(reference.pixel(x, y)[b_coverage] >= 0.9999f)) continue;
            float farthest = 0.0f;  // background beside a silhouette is no surface: its infinite
                                    // depth does not count
            for (int v = std::max(y - 1, 0); v <= std::min(y + 1, image.height - 1); ++v) {
                for (int u = std::max(x - 1, 0); u <= std::min(x + 1, image.width - 1); ++u) {
                    const float d = reference.pixel(u, v)[b_depth];
                    if (std::isfinite(d)) farthest = std::max(farthest, d);
                }
            }
            const float* p = image.pixel(x, y);
            holes[size_t(y) * image.width + x] =
                !(p[a_coverage] >= 0.5f && p[a_depth] <= kDepthSlack * farthest);
        }
    }
    return holes;
}

}  // namespace

CompareResult compareImages(const Image& image, const Image& reference, ThreadPool& pool) {
    checkComparable(image, reference);
    const Image a = clippedColor(image), b = clippedColor(reference);
    CompareResult result;
    result.pixels = uint64_t(image.width) * image.height;
    result.rmse = std::sqrt(meanSquaredDifference(a, b, pool));
    result.psnr = result.rmse > 0.0 ? -20.0 * std::log10(result.rmse)
                                    : std::numeric_limits<double>::infinity();
    double sum = 0.0;
    for (float e : flipMap(a, b, kFlipPixelsPerDegree, pool)) sum += e;
    result.flip = sum / double(result.pixels);
    const std::vector<bool> holes = findHoles(image, reference);
    if (!holes.empty()) {
        const uint64_t count = uint64_t(std::count(holes.begin(), holes.end(), true));
        result.holes = HoleCount{count, double(count) / double(result.pixels)};
    }
    return result;
}

Image differenceImage(const Image& image, const Image& reference, ThreadPool& pool) {
    checkComparable(image, reference);
    const std::vector<float> error =
        flipMap(clippedColor(image), clippedColor(reference), kFlipPixelsPerDegree, pool);
    const std::vector<bool> holes = findHoles(image, reference);
    Image out(image.width, image.height, {"R", "G", "B"});
    for (size_t i = 0; i < error.size(); ++i) {
        float* p = out.data.data() + 3 * i;
        for (int c = 0; c < 3; ++c) {
            const float ramp = std::clamp(3.0f * error[i] - float(c), 0.0f, 1.0f);
            p[c] = linearFromSrgb(!holes.empty() && holes[i] ? float(c > 0) : ramp);
        }
    }
    return out;
}

TileMeans tileMeans(const Image& image, const Image& reference) {
    checkComparable(image, reference);
    const auto luminance = [](const Image& i, const std::array<int, 3>& c, int x, int y) {
        const float* p = i.pixel(x, y);
        return 0.2126729 * p[c[0]] + 0.7151522 * p[c[1]] + 0.0721750 * p[c[2]];
    };
    const std::array<int, 3> a_channels = colorChannels(image),
                             b_channels = colorChannels(reference);
    TileMeans result;
    double sum = 0.0, squares = 0.0;
    for (int y0 = 0; y0 < image.height; y0 += kTile) {
        for (int x0 = 0; x0 < image.width; x0 += kTile) {
            const int x1 = std::min(x0 + kTile, image.width),
                      y1 = std::min(y0 + kTile, image.height);
            double a = 0.0, b = 0.0;
            for (int y = y0; y < y1; ++y) {
                for (int x = x0; x < x1; ++x) {
                    a += luminance(image, a_channels, x, y);
                    b += luminance(reference, b_channels, x, y);
                }
            }
            if (!(b > kDarkTile * (x1 - x0) * (y1 - y0))) continue;
            const double relative = (a - b) / b;
            ++result.tiles;
            sum += relative;
            squares += relative * relative;
            result.max = std::max(result.max, std::abs(relative));
        }
    }
    if (result.tiles > 0) {
        result.mean = sum / double(result.tiles);
        result.rms = std::sqrt(squares / double(result.tiles));
    }
    return result;
}

}  // namespace stipple
