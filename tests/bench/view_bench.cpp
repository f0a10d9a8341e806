// SPDX-License-Identifier: Apache-2.0
// The viewer without its window: frames a second and their quality while the camera moves, how long
// a standing picture takes to be as good as rays, how soon an edit is seen. Prints the figures of
// docs/performance.md.
// usage: bench_view SCENE [CAMERA [WIDTH HEIGHT [RAYS]]]; RAYS a pixel of the references
#include <core/stopwatch.h>
#include <render/compare.h>
#include <scenegraph/io/load.h>
#include <tools/view_camera.h>
#include <tools/view_renderer.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace stipple {
namespace {

constexpr double kMovingSeconds = 10.0;
constexpr double kPollSeconds = 1.0 / 60;  // the window's
constexpr int kComparedPictures = 3;
constexpr int kEdits = 10;

struct Bench {
    LiveScene& live;
    ViewRenderer& renderer;
    ThreadPool& pool;
    ViewWish wish;
    int rays;
};

// As a texture with linear filtering is shown.
Image scaledTo(const Image& image, int width, int height) {
    Image out(width, height, {"R", "G", "B", "A"});
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const float fx = std::clamp((x + 0.5f) * image.width / width - 0.5f, 0.0f,
                                        image.width - 1.0f),
                        fy = std::clamp((y + 0.5f) * image.height / height - 0.5f, 0.0f,
                                        image.height - 1.0f);
            const int x0 = int(fx), y0 = int(fy), x1 = std::min(x0 + 1, image.width - 1),
                      y1 = std::min(y0 + 1, image.height - 1);
            for (int c = 0; c < 4; ++c) {
                const float top = glm::mix(image.pixel(x0, y0)[c], image.pixel(x1, y0)[c], fx - x0),
                            low = glm::mix(image.pixel(x0, y1)[c], image.pixel(x1, y1)[c], fx - x0);
                out.pixel(x, y)[c] = glm::mix(top, low, fy - y0);
            }
        }
    }
    return out;
}

Image castRays(const Bench& bench, const Camera& camera, int rays, uint64_t seed) {
    FrameRequest request;
    request.camera = camera;
    request.settings = bench.wish.settings;
    request.settings.method = Method::kRaycast;
    request.settings.samples = rays;
    request.settings.seed = seed;
    return bench.live.render(request).image;
}

double psnr(const Bench& bench, const Image& image, const Image& reference) {
    return compareImages(scaledTo(image, reference.width, reference.height),
                         scaledTo(reference, reference.width, reference.height), bench.pool)
        .psnr;
}

void sleepUntil(const Stopwatch& watch, double seconds) {
    const double left = seconds - watch.seconds();
    if (left > 0.0) std::this_thread::sleep_for(std::chrono::duration<double>(left));
}

// Flies forward and turns, ten metres and ten degrees a second.
void measureMoving(Bench& bench) {
    struct Moment {
        Camera camera;
        ShownPicture picture;
    };
    std::vector<Camera> cameras{bench.wish.camera};
    std::vector<Moment> shown;
    std::vector<double> seconds;
    const Stopwatch watch;
    for (int poll = 0; watch.seconds() < kMovingSeconds; ++poll) {
        cameras.push_back(turned(flown(cameras.back(), DVec3(0, 0, 10.0 * kPollSeconds)),
                                 radians(10.0) * kPollSeconds, 0.0));
        bench.wish.camera = cameras.back();
        bench.renderer.show(bench.wish);
        sleepUntil(watch, (poll + 1) * kPollSeconds);
        ShownPicture picture;
        if (!bench.renderer.take(picture)) continue;
        seconds.push_back(watch.seconds());
        // Some that lie far from each other, for the comparison.
        if (seconds.back() < kMovingSeconds * double(shown.size() + 1) / (kComparedPictures + 1))
            continue;
        const auto camera = std::find_if(cameras.begin(), cameras.end(), [&](const Camera& c) {
            return c.eye == picture.view.eye_world;
        });
        if (camera != cameras.end()) shown.push_back({*camera, std::move(picture)});
    }
    // The first second finds how coarse pictures have to be.
    const auto settled = std::upper_bound(seconds.begin(), seconds.end(), 1.0);
    std::printf("moving: %.1f pictures/s\n",
                double(seconds.end() - settled) / (kMovingSeconds - 1.0));
    for (const Moment& moment : shown) {
        const Image& image = moment.picture.image;
        std::printf("    %d x %d, %.0f ms", image.width, image.height,
                    moment.picture.stats.seconds * 1e3);
        if (bench.rays > 0) {
            const Image reference = castRays(bench, moment.camera, bench.rays, 7);
            std::printf(", %.1f dB", psnr(bench, image, reference));
        }
        std::printf("\n");
        std::fflush(stdout);
    }
}

void measureStanding(Bench& bench) {
    // Once for what caches hold of the view.
    std::vector<ShownPicture> pictures;
    for (int round = 0; round < 2; ++round) {
        pictures.clear();
        bench.renderer.show(bench.wish);
        for (bool is_done = false; !is_done;) {
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
            ShownPicture picture;
            if (!bench.renderer.take(picture)) continue;
            is_done = picture.level + 1 == picture.level_count;
            pictures.push_back(std::move(picture));
        }
        std::printf("standing still, %s:", round == 0 ? "new view" : "view seen before");
        for (const ShownPicture& p : pictures)
            std::printf(" %.3g %% after %.2f s;", p.percent, p.full_seconds);
        std::printf("\n");
        std::fflush(stdout);
    }
    if (bench.rays == 0) return;
    const Image reference = castRays(bench, bench.wish.camera, bench.rays, 7);
    for (const ShownPicture& p : pictures)
        std::printf("    %.3g %%: %.1f dB\n", p.percent, psnr(bench, p.image, reference));
    std::printf("    rays, 16 a pixel: %.1f dB\n",
                psnr(bench, castRays(bench, bench.wish.camera, 16, 8), reference));
}

// From the edit to the first picture that has it.
void measureEdits(Bench& bench) {
    std::vector<double> seconds, frames;
    for (int i = 0; i < kEdits; ++i) {
        const Stopwatch watch;
        bench.renderer.edit([&](SceneEditor& editor) {
            const DVec3 at = bench.wish.camera.eye + 40.0 * bench.wish.camera.world_from_camera[2];
            editor.insert(editor.scene().root, ChildRef::mesh(0), {DMat3(1.0), at});
        });
        ShownPicture picture;
        while (!bench.renderer.take(picture))
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        seconds.push_back(watch.seconds());
        frames.push_back(picture.stats.seconds);
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        bench.renderer.take(picture);
    }
    std::sort(seconds.begin(), seconds.end());
    std::sort(frames.begin(), frames.end());
    std::printf("edit to picture: %.0f ms, of which the frame takes %.0f ms\n",
                seconds[kEdits / 2] * 1e3, frames[kEdits / 2] * 1e3);
}

int run(int argc, char** argv) {
    ThreadPool pool;
    Diagnostics diagnostics;
    Scene scene = loadScene(argv[1], {}, pool, diagnostics);
    ViewWish wish;
    for (const auto& [key, value] : scene.render_defaults)
        applySetting(wish.settings, key, value, scene.path);
    wish.settings.width = argc > 4 ? std::atoi(argv[3]) : 1280;
    wish.settings.height = argc > 4 ? std::atoi(argv[4]) : 720;
    const Camera* camera = argc > 2 ? scene.findCamera(argv[2]) : &scene.cameras[0];
    if (!camera) throw Error(ErrorCode::kInvalidArgument, argv[2], "no such camera");
    wish.camera = *camera;
    std::printf("%s, camera %s, %d x %d, %d threads\n", argv[1], camera->name.c_str(),
                wish.settings.width, wish.settings.height, pool.threadCount());
    LiveScene live(std::move(scene), pool);
    ViewRenderer renderer(live);
    Bench bench{live, renderer, pool, wish, argc > 5 ? std::atoi(argv[5]) : 64};
    measureMoving(bench);
    measureStanding(bench);
    measureEdits(bench);
    return 0;
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
    if (argc < 2) {
        std::fprintf(stderr, "usage: bench_view SCENE [CAMERA [WIDTH HEIGHT [RAYS]]]\n");
        return 2;
    }
    try {
        return stipple::run(argc, argv);
    } catch (const stipple::Error& error) {
        std::fprintf(stderr, "bench_view: %s\n", error.what());
        return 1;
    }
}
