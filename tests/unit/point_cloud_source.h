// SPDX-License-Identifier: Apache-2.0
// A source of given points, and pictures of them: reconstructions without a scene.
#pragma once

#include <core/rng.h>
#include <render/tile_loop.h>

namespace stipple {

struct TestPoint {
    Vec3 position = Vec3(0);  // camera space
    Vec3 normal = Vec3(0, 0, -1);
    float area = 0.0f;   // m^2
    float width = 1e4f;  // of the patch, subpixels
    uint32_t material = 0;
    float alpha = 1.0f;  // below 1: of a blended surface
};

class PointCloudSource : public PointSource {
public:
    explicit PointCloudSource(std::vector<TestPoint> points) : points_(std::move(points)) {}

    std::unique_ptr<TileEmitter> makeEmitter() override {
        return std::make_unique<Emitter>(points_);
    }

private:
    class Emitter : public TileEmitter {
    public:
        explicit Emitter(const std::vector<TestPoint>& points) : points_(points) {}
        void emit(const Batch&, PointSink& sink) override {
            for (size_t begin = 0; begin < points_.size(); begin += kBlockPoints) {
                PointBlock block;
                block.count = int(std::min(points_.size() - begin, size_t(kBlockPoints)));
                for (int i = 0; i < block.count + kBlockPadding; ++i) {
                    const TestPoint& p = points_[std::min(begin + size_t(i), points_.size() - 1)];
                    block.x[i] = p.position.x, block.y[i] = p.position.y;
                    block.z[i] = p.position.z;
                    block.number[i] = uint32_t(begin) + uint32_t(i);
                    block.keep[i] = p.alpha < 1.0f ? kBlended : 1;
                    block.width[i] = patchWidthCode(p.width, kFirstSubpixelExponent);
                    block.normal_x[i] = p.normal.x, block.normal_y[i] = p.normal.y;
                    block.normal_z[i] = p.normal.z;
                    block.area[i] = p.area;
                }
                sink.take(block);
            }
        }
        void attributes(uint32_t number, float, float, SurfaceSample& sample) const override {
            sample.material = points_[number].material;
            sample.normal_world = points_[number].normal;
            sample.albedo = Vec3(0);
            sample.alpha = points_[number].alpha;
            sample.finish = SurfaceFinish();
            sample.finish.emissive[int(sample.material)] = 1.0f;  // red, green or blue
            sample.object = 1;
        }
        void forget() override {}

    private:
        const std::vector<TestPoint>& points_;
    };

    std::vector<TestPoint> points_;
};

// Materials shine in red, green and blue, nothing else does.
struct TestFrame {
    Camera camera;
    RenderSettings settings;
    std::vector<Material> materials;
    Lighting lighting;

    TestFrame() {
        camera.orthographic = true;
        camera.height = 40.0;
        camera.world_from_camera = DMat3(1.0);
        settings.width = 60;
        settings.height = 40;
        for (int i = 0; i < 3; ++i) {
            Material m;
            m.double_sided = true;
            materials.push_back(m);
        }
        lighting.sky.zenith = lighting.sky.horizon = lighting.sky.ground = Vec3(0);
    }
    // One metre is a pixel in the orthographic view.
    View view() const {
        return makeView(camera, settings.width, settings.height, drawnSettings(settings).subpixels);
    }

    // Points in front of a pixel rectangle, on z = z0 + slope x, settings.samples a subpixel,
    // jittered or, with `random`, independent.
    void addPlane(std::vector<TestPoint>& points, float x0, float x1, float y0, float y1, float z0,
                  float slope, uint32_t material, uint64_t seed, bool random = false) const {
        const double density = settings.samples * settings.subpixels * settings.subpixels;
        const double step = 1.0 / std::sqrt(density);
        const Vec3 normal = glm::normalize(Vec3(slope, 0, -1));
        Rng rng{seed};
        const int nx = int(std::ceil((x1 - x0) / step)), ny = int(std::ceil((y1 - y0) / step));
        for (int j = 0; j < ny; ++j) {
            for (int i = 0; i < nx; ++i) {
                const double x =
                    x0 + (random ? rng.uniform() * nx : double(i) + rng.uniform()) * step;
                const double y =
                    y0 + (random ? rng.uniform() * ny : double(j) + rng.uniform()) * step;
                if (x >= x1 || y >= y1) continue;
                TestPoint p;
                p.position = Vec3(float(x) - 0.5f * float(settings.width),
                                  float(y) - 0.5f * float(settings.height), z0 + slope * float(x));
                p.normal = normal;
                p.area = float(1.0 / (density * std::abs(normal.z)));
                p.material = material;
                points.push_back(p);
            }
        }
    }

    Image draw(const std::vector<TestPoint>& points, int threads = 2) const {
        FrameRequest request;
        request.settings = drawnSettings(settings);
        const View v = view();
        Picture picture(v, lighting, {"coverage", "depth"}, false);
        ReconstructionContext context;
        context.view = v;
        context.settings = request.settings;
        context.materials = &materials;
        context.lighting = &lighting;
        context.picture = &picture;
        PointCloudSource source(points);
        Batch batch;
        batch.rect = {0, 0, v.subWidth(), v.subHeight()};
        ThreadPool pool(threads);
        FrameStats stats;
        drawTiles(
            context, &source, {batch}, [](uint32_t, float, float, SurfaceSample&) {}, pool, request,
            stats);
        return picture.image();
    }
};

}  // namespace stipple
