// SPDX-License-Identifier: Apache-2.0
#include <render/point_block_probe.h>

#include <core/stopwatch.h>
#include <sampling/random_sampler.h>
#include <sampling/surfel_visibility.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace stipple {

namespace {

using Mask = std::array<uint64_t, 2>;

// Bits of directions that share the first so many bits of their index.
constexpr int kPerUnion = 4;

InstanceFrame frameOf(const View& view) {
    Affine camera_from_world;
    camera_from_world.linear = view.camera_from_world;
    camera_from_world.translation = -(view.camera_from_world * view.eye_world);
    return makeInstanceFrame(camera_from_world, 0);
}

Mask unionsOf(const Mask& mask) {
    Mask result = {0, 0};
    for (int first = 0; first < kMaskDirections; first += kPerUnion) {
        const uint64_t four = uint64_t((1 << kPerUnion) - 1) << (first % 64);
        if (mask[size_t(first / 64)] & four) result[size_t(first / 64)] |= four;
    }
    return result;
}

}  // namespace

void limitVisibility(SurfelModel& model, bool with_cones, int mask_directions) {
    for (SurfelLevel& level : model.levels) {
        for (SurfelBlock& block : level.blocks) {
            if (!with_cones) block.cone_sine = 2.0f;
            if (mask_directions == 32) block.visible_from = unionsOf(block.visible_from);
            if (mask_directions == 0) block.visible_from = {~0ull, ~0ull};
        }
    }
}

CulledShares culledShares(const SurfelModel& model, const SurfelLevel& level, const View& view) {
    const ModelEye eye = makeModelEye(frameOf(view), model, view.orthographic);
    CulledShares shares;
    for (const SurfelBlock& block : level.blocks) {
        const bool by_cone = coneHides(eye, block), by_mask = maskHides(eye, block);
        shares.cone += by_cone, shares.mask += by_mask, shares.both += by_cone || by_mask;
    }
    const double n = double(std::max(level.blocks.size(), size_t(1)));
    shares.cone /= n, shares.mask /= n, shares.both /= n;
    return shares;
}

double culledByScreen(const SurfelModel& model, const SurfelLevel& level, const View& view, int n) {
    if (!makeModelEye(frameOf(view), model, view.orthographic).is_outside) return 0.0;
    const Mat3 world_from_camera(glm::transpose(view.camera_from_world));
    // Masks of 2^k x 2^k parts, k = 0..n: what their rays come from.
    std::vector<std::vector<Mask>> masks(size_t(n) + 1);
    for (int k = 0; k <= n; ++k) masks[size_t(k)].assign(size_t(1) << (2 * k), Mask{0, 0});
    constexpr int kRays = 8;  // between the corners of the smallest parts
    const int steps = kRays << n;
    for (int j = 0; j <= steps; ++j) {
        for (int i = 0; i <= steps; ++i) {
            Vec3 origin, direction;
            view.ray(float(i) * float(view.subWidth()) / float(steps),
                     float(j) * float(view.subHeight()) / float(steps), origin, direction);
            const int d = maskDirectionIndex(-(world_from_camera * direction));
            for (int k = 0; k <= n; ++k) {
                const int side = 1 << k, rays = kRays << (n - k);
                // Rays on a border belong to both sides.
                for (const int y : {(j - 1) / rays, j / rays}) {
                    for (const int x : {(i - 1) / rays, i / rays}) {
                        if (x < side && y < side)
                            masks[size_t(k)][size_t(y * side + x)][size_t(d / 64)] |= 1ull
                                                                                      << (d % 64);
                    }
                }
            }
        }
    }
    size_t culled = 0;
    for (const SurfelBlock& block : level.blocks) {
        Vec2 low(kInfinity), high(-kInfinity);
        for (int corner = 0; corner < 8; ++corner) {
            DVec3 p;
            for (int a = 0; a < 3; ++a)
                p[a] = corner >> a & 1 ? block.bounds.max[a] : block.bounds.min[a];
            const Vec3 camera(view.camera_from_world * (p - view.eye_world));
            const Vec2 at = view.project(camera);
            low = glm::min(low, at), high = glm::max(high, at);
        }
        const auto part = [](float v, int size, int side) {
            return std::clamp(int(v / float(size) * float(side)), 0, side - 1);
        };
        for (int k = n; k >= 0; --k) {
            const int side = 1 << k;
            const int x0 = part(low.x, view.subWidth(), side),
                      x1 = part(high.x, view.subWidth(), side),
                      y0 = part(low.y, view.subHeight(), side),
                      y1 = part(high.y, view.subHeight(), side);
            if (x0 != x1 || y0 != y1) continue;
            const Mask& mask = masks[size_t(k)][size_t(y0 * side + x0)];
            culled += !(mask[0] & block.visible_from[0]) && !(mask[1] & block.visible_from[1]);
            break;
        }
    }
    return double(culled) / double(std::max(level.blocks.size(), size_t(1)));
}

namespace {

// Takes what is drawn and has no use for it.
class NoPicture : public PointSink {
public:
    explicit NoPicture(const View& view) : region_{0, 0, view.subWidth(), view.subHeight()} {}
    bool take(const PointBlock& block) override {
        points += uint64_t(block.count);
        return false;
    }
    bool take(const TriangleBlock&) override { return false; }
    bool hides(const SubpixelRect&, float, bool) override { return false; }
    const SubpixelRect& region() const override { return region_; }

    uint64_t points = 0;

private:
    const SubpixelRect region_;
};

}  // namespace

WarpSeconds measureWarp(const Scene& scene, const SurfelModel& model, const SurfelLevel& level,
                        const View& view, const RenderSettings& settings, int repeats) {
    ThreadPool pool(1);
    RandomizedSampler sampler(scene);
    const FramePlan& plan = sampler.plan(view, settings, pool, nullptr);
    const auto emitter = sampler.makeEmitter();
    const ModelEye eye = makeModelEye(frameOf(view), model, view.orthographic);
    WarpSeconds least = {1e9, 1e9, 0, 0};
    for (int r = 0; r < repeats; ++r) {
        NoPicture sink(view);
        const Stopwatch warp;
        for (const Batch& batch : plan.batches) emitter->emit(batch, sink);
        least.warp = std::min(least.warp, warp.seconds());
        least.points = sink.points;
        emitter->forget();
        const Stopwatch visibility;
        size_t hidden = 0;
        for (const SurfelBlock& block : level.blocks)
            hidden += coneHides(eye, block) || maskHides(eye, block);
        least.visibility = std::min(least.visibility, visibility.seconds());
        least.hidden_blocks = hidden;
    }
    return least;
}

}  // namespace stipple
