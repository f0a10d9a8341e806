// SPDX-License-Identifier: Apache-2.0
// A picture hardly changes where the camera moves slowly: what is seen of a place on a surface,
// from frame to frame, against rays.
#include <gtest/gtest.h>
#include <tests/image/test_scene.h>

namespace stipple {
namespace {

constexpr int kWidth = 160, kHeight = 100, kFrames = 20;

// Trees, a ball and a box, of fine triangles, on a plane.
Scene& still(TestScene& t) {
    t.scene.lighting.suns.push_back({glm::normalize(Vec3(0.5f, 0.7f, 0.4f)), Vec3(3.0f)});
    t.add(makePrimitive("plane", 400000, Vec3(0.4f, 0.4f, 0.35f)),
          placed(DVec3(0.0), DVec3(120.0)));
    t.add(makePrimitive("sphere", 80000, Vec3(0.7f, 0.3f, 0.2f)),
          placed(DVec3(-7, 4, 10), DVec3(8.0)));
    t.add(makePrimitive("box", 100000, Vec3(0.3f, 0.4f, 0.7f)),
          placed(DVec3(8, 3, 10), DVec3(6.0), 0.5));
    TreeParams params;
    params.triangles = 4000;
    const uint32_t tree = addMesh(t.scene, makeTree(params));
    for (int i = 0; i < 30; ++i) {
        t.root.instances.add(
            ChildRef::mesh(tree),
            placed(DVec3(8.0 * (i % 10) - 36.0, 0.0, -8.0 * (i / 10)), DVec3(1.0), 2.4 * i));
    }
    return t.build();
}

// One pixel a frame at the trees' distance.
FrameRequest requestOf(int frame) {
    FrameRequest r;
    const double distance = 50.0, pixel = 2.0 * std::tan(0.5 * r.camera.fov_y) * distance / kHeight;
    const DVec3 aside(pixel * frame, 0.0, 0.0);
    r.camera = lookAt(DVec3(-4, 16, 46) + aside, DVec3(-4, 4, 0) + aside);
    r.settings.width = kWidth;
    r.settings.height = kHeight;
    return r;
}

std::vector<Image> framesOf(const Scene& scene, const RenderSettings& settings,
                            const std::vector<std::string>& aovs) {
    ThreadPool pool(2);
    Renderer renderer(scene, pool);
    std::vector<Image> frames;
    for (int f = 0; f < kFrames; ++f) {
        FrameRequest r = requestOf(f);
        r.settings.method = settings.method;
        r.settings.reconstruct = settings.reconstruct;
        r.settings.samples = settings.samples;
        r.aovs = aovs;
        frames.push_back(renderer.render(r).image);
    }
    return frames;
}

// A pixel's place in the next frame, of pixels that show the same surface in both.
struct Track {
    int frame, x, y;
    float next_x, next_y;
};

std::vector<Track> tracksOf(const std::vector<Image>& rays) {
    const int depth = rays[0].channelIndex("depth"), depth_max = rays[0].channelIndex("depth_max");
    std::vector<Track> tracks;
    for (int f = 0; f + 1 < kFrames; ++f) {
        const View view = makeView(requestOf(f).camera, kWidth, kHeight, 1),
                   next = makeView(requestOf(f + 1).camera, kWidth, kHeight, 1);
        for (int y = 0; y < kHeight; ++y) {
            for (int x = 0; x < kWidth; ++x) {
                const float z = rays[size_t(f)].pixel(x, y)[depth];
                if (!(z < kInfinity)) continue;
                Vec3 origin, direction;
                view.ray(float(x) + 0.5f, float(y) + 0.5f, origin, direction);
                const DVec3 p_world = view.eye_world + glm::transpose(view.camera_from_world) *
                                                           DVec3(origin + direction * z);
                const Vec3 p(next.camera_from_world * (p_world - next.eye_world));
                const Vec2 at = next.project(p) - 0.5f;
                if (!(at.x >= 0.0f && at.y >= 0.0f && at.x < kWidth - 1 && at.y < kHeight - 1))
                    continue;
                const float* there = rays[size_t(f) + 1].pixel(int(at.x + 0.5f), int(at.y + 0.5f));
                if (std::abs(there[depth] - p.z) > 0.02f * p.z || !(there[depth_max] < kInfinity))
                    continue;
                tracks.push_back({f, x, y, at.x, at.y});
            }
        }
    }
    return tracks;
}

// Of linear green, between a pixel and its place in the next frame, interpolated.
double meanChange(const std::vector<Image>& frames, const std::vector<Track>& tracks) {
    double sum = 0.0;
    for (const Track& t : tracks) {
        const Image& next = frames[size_t(t.frame) + 1];
        const int x = int(t.next_x), y = int(t.next_y);
        const float fx = t.next_x - float(x), fy = t.next_y - float(y);
        const float above = glm::mix(next.pixel(x, y)[1], next.pixel(x + 1, y)[1], fx),
                    below = glm::mix(next.pixel(x, y + 1)[1], next.pixel(x + 1, y + 1)[1], fx);
        sum += std::abs(glm::mix(above, below, fy) - frames[size_t(t.frame)].pixel(t.x, t.y)[1]);
    }
    return sum / double(tracks.size());
}

TEST(Flicker, isNotMuchMoreThanThatOfSixteenRays) {
    TestScene t;
    const Scene& scene = still(t);
    RenderSettings settings;
    settings.method = Method::kRaycast;
    settings.samples = 16;
    const std::vector<Image> rays = framesOf(scene, settings, {"depth"});
    const std::vector<Track> tracks = tracksOf(rays);
    ASSERT_GT(tracks.size(), size_t(kWidth * kHeight * kFrames / 4));
    const double of_rays = meanChange(rays, tracks);
    EXPECT_GT(of_rays, 1e-4);
    settings = RenderSettings();
    for (const Reconstruct reconstruct : kReconstructions) {
        settings.reconstruct = reconstruct;
        EXPECT_LE(meanChange(framesOf(scene, settings, {}), tracks), 1.5 * of_rays)
            << int(reconstruct);
    }
    // What the measure makes of flicker: another seed for every frame.
    std::vector<Image> random;
    for (int f = 0; f < kFrames; ++f) {
        ThreadPool pool(2);
        FrameRequest r = requestOf(f);
        r.settings.subpixels = 1;
        r.settings.seed = uint64_t(f) + 1;
        random.push_back(Renderer(scene, pool).render(r).image);
    }
    EXPECT_GT(meanChange(random, tracks), 1.5 * of_rays);
}

}  // namespace
}  // namespace stipple
