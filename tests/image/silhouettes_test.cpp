// SPDX-License-Identifier: Apache-2.0
// No reconstruction carries the foreground's colour far beyond the silhouette that rays see.
#include <gtest/gtest.h>
#include <tests/image/test_scene.h>

#include <utility>
#include <vector>

namespace stipple {
namespace {

constexpr int kWidth = 160, kHeight = 120;

// A red box, of fine triangles, before a blue wall; each has nothing of the other's colour, and the
// sky, which a hole would show, is black.
Scene& boxBeforeWall(TestScene& t) {
    t.scene.lighting.suns.push_back({glm::normalize(Vec3(0.3f, 0.5f, 1.0f)), Vec3(3.0f)});
    Sky& sky = t.scene.lighting.sky;
    sky.zenith = sky.horizon = sky.ground = Vec3(0.0f);
    t.add(makePrimitive("box", 200000, Vec3(0.8f, 0.0f, 0.0f)),
          placed(DVec3(0.0), DVec3(2.0, 1.6, 1.2), 0.6));
    t.add(makePrimitive("box", 200000, Vec3(0.0f, 0.0f, 0.8f)),
          placed(DVec3(0, 0, -6), DVec3(30, 30, 1)));
    return t.build();
}

// Pixels from which no ray sees the box within `reach` pixels.
std::vector<std::pair<int, int>> pixelsBeyond(const Image& rays, int reach) {
    std::vector<std::pair<int, int>> beyond;
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
            bool is_near = false;
            for (int v = std::max(y - reach, 0); v <= std::min(y + reach, kHeight - 1); ++v) {
                for (int u = std::max(x - reach, 0); u <= std::min(x + reach, kWidth - 1); ++u)
                    is_near |= rays.pixel(u, v)[0] > 0.0f;
            }
            if (!is_near) beyond.emplace_back(x, y);
        }
    }
    return beyond;
}

TEST(Silhouettes, areNotCarriedOverMoreThanTwoPixels) {
    TestScene t;
    const Scene& scene = boxBeforeWall(t);
    FrameRequest r;
    r.camera = lookAt(DVec3(1.5, 2, 5), DVec3(0.0));
    r.settings.width = kWidth;
    r.settings.height = kHeight;
    r.settings.method = Method::kRaycast;
    r.settings.samples = 64;
    ThreadPool pool(2);
    const Image rays = Renderer(scene, pool).render(r).image;
    int n_box = 0;
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) n_box += rays.pixel(x, y)[0] > rays.pixel(x, y)[2];
    }
    EXPECT_GT(n_box, 2000);
    const auto beyond = pixelsBeyond(rays, 2);
    EXPECT_GT(beyond.size(), 2000u);
    r.settings.method = Method::kPoints;
    r.settings.area_threshold = 1e6;  // all triangles as points
    r.settings.large_triangle = 1e6;
    for (const Reconstruct reconstruct : kReconstructions) {
        for (const int subpixels : {1, 2, 4}) {
            for (const double samples : {0.5, 1.0, 4.0}) {
                r.settings.reconstruct = reconstruct;
                r.settings.subpixels = subpixels;
                r.settings.samples = samples;
                const Frame frame = Renderer(scene, pool).render(r);
                EXPECT_GT(frame.stats.points_kept, uint64_t(kWidth * kHeight / 4));
                int reddish = 0;
                for (const auto& [x, y] : beyond) reddish += frame.image.pixel(x, y)[0] > 0.01f;
                EXPECT_EQ(reddish, 0) << int(reconstruct) << " " << subpixels << " " << samples;
            }
        }
    }
}

}  // namespace
}  // namespace stipple
