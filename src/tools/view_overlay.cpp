// SPDX-License-Identifier: Apache-2.0
#include <tools/view_overlay.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr size_t kMostBoxes = 1500;

// Black, blue, green, yellow, red, white for 0 to 1.
Vec3 heat(float t) {
    static const Vec3 kColors[] = {Vec3(0),       Vec3(0, 0, 1), Vec3(0, 0.8f, 0),
                                   Vec3(1, 1, 0), Vec3(1, 0, 0), Vec3(1)};
    const float x = std::clamp(t, 0.0f, 1.0f) * 5.0f;
    const int i = std::min(4, int(x));
    return glm::mix(kColors[i], kColors[i + 1], x - float(i));
}

void paint(float* pixel, const Vec3& color) {
    for (int i = 0; i < 3; ++i) pixel[i] = color[i];
}

// Green: as many as were asked for; white: 32 times as many.
void showCounts(const ShownPicture& picture, Image& image) {
    const int channel = image.channelIndex("count");
    const float wanted = float(picture.view.subpixels * picture.view.subpixels);
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            float* p = image.pixel(x, y);
            const float ratio = p[channel] / wanted;
            const float t = ratio <= 1.0f ? 0.4f * ratio : 0.4f + 0.6f * std::log2(ratio) / 5.0f;
            paint(p, heat(t));
        }
    }
}

// Near is bright; a step of grey is a step of the logarithm.
void showDepths(Image& image) {
    const int channel = image.channelIndex("depth");
    float nearest = kInfinity, farthest = 0.0f;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            const float depth = image.pixel(x, y)[channel];
            if (!std::isfinite(depth)) continue;
            nearest = std::min(nearest, std::max(depth, 1e-3f));
            farthest = std::max(farthest, depth);
        }
    }
    const float range = std::max(std::log(farthest / nearest), 1e-6f);
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            float* p = image.pixel(x, y);
            const float depth = std::max(p[channel], 1e-3f);
            const float grey =
                std::isfinite(depth) ? 1.0f - 0.9f * std::log(depth / nearest) / range : 0.0f;
            paint(p, Vec3(grey * grey));  // about as even to the eye
        }
    }
}

}  // namespace

void applyOverlay(Overlay overlay, const ShownPicture& picture, Image& image) {
    if (overlay == Overlay::kCount) showCounts(picture, image);
    if (overlay == Overlay::kDepth) showDepths(image);
}

std::vector<CutEdge> cutEdges(const ShownPicture& picture) {
    struct Box {
        const CutBox* box;
        float depth;
    };
    std::vector<Box> boxes;
    for (const CutBox& box : picture.cut) {
        float nearest = kInfinity;
        for (const Vec3& corner : box.corners) nearest = std::min(nearest, corner.z);
        // What reaches behind the eye has edges that cannot be drawn.
        if (nearest > 1e-3f) boxes.push_back({&box, nearest});
    }
    const size_t count = std::min(boxes.size(), kMostBoxes);
    std::partial_sort(boxes.begin(), boxes.begin() + std::ptrdiff_t(count), boxes.end(),
                      [](const Box& a, const Box& b) { return a.depth < b.depth; });
    const View& view = picture.view;
    const auto shareOf = [&](const Vec3& p) {
        const double scale = view.orthographic ? view.focal : view.focal / double(p.z);
        return Vec2(float((view.center_x + p.x * scale) / view.subWidth()),
                    float((view.center_y + p.y * scale) / view.subHeight()));
    };
    std::vector<CutEdge> edges;
    for (size_t i = 0; i < count; ++i) {
        for (int corner = 0; corner < 8; ++corner) {
            for (int axis = 0; axis < 3; ++axis) {
                if (corner >> axis & 1) continue;
                const std::array<Vec3, 8>& corners = boxes[i].box->corners;
                edges.push_back({shareOf(corners[size_t(corner)]),
                                 shareOf(corners[size_t(corner | 1 << axis)]),
                                 float(i) / float(count)});
            }
        }
    }
    return edges;
}

}  // namespace stipple
