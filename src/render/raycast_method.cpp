// SPDX-License-Identifier: Apache-2.0
#include <render/raycast_method.h>

#include <core/rng.h>
#include <core/stopwatch.h>
#include <reconstruct/shade.h>

#include <array>
#include <mutex>

namespace stipple {

namespace {

constexpr int kTilePixels = 16;
constexpr int kLargestBlock = 4;
constexpr size_t kBatchRays = 256;

// Rays that are cast together, in an order in which neighbours are coherent.
struct RayBatch {
    std::vector<Ray> rays;
    std::vector<PixelSums*> sums;  // where each ray belongs; a pixel's rays are in order
    std::vector<uint64_t> keys;    // of random numbers, of each ray
    std::vector<RayHit> hits;
};

// How far off a surface secondary rays begin: what floats lose at that distance from the eye.
float offsetFrom(const Vec3& p) { return 1e-5f * std::max(glm::length(p), 0.01f); }

// Shadows by their definition: a ray from every hit to every light that may reach it.
class ShadowRays : public LightVisibility {
public:
    ShadowRays(const RayCaster& caster, const Lighting& lighting, const DVec3& eye_world)
        : caster_(caster),
          lighting_(lighting),
          eye_world_(eye_world),
          lamps_(lampsOf(lighting)),
          n_lights_(lighting.suns.size() + lamps_.size()) {}

    // For the hits of `rays`.
    void cast(const std::vector<Ray>& rays, const std::vector<RayHit>& hits) {
        is_hidden_.assign(n_lights_ * rays.size(), 0);
        for (size_t light = 0; light < n_lights_; ++light) {
            to_light_.clear();
            ray_of_.clear();
            for (size_t r = 0; r < rays.size(); ++r) {
                if (hits[r].t < kInfinity && addRay(rays[r], hits[r], light)) ray_of_.push_back(r);
            }
            hit_.resize(to_light_.size());
            caster_.occluded(to_light_.data(), to_light_.size(), hit_.data());
            for (size_t i = 0; i < ray_of_.size(); ++i)
                is_hidden_[ray_of_[i] * n_lights_ + light] = hit_[i];
        }
    }
    void select(size_t ray) { ray_ = ray; }
    float ofSun(size_t sun, const SurfaceSample&) const override { return visible(sun); }
    float ofLamp(size_t lamp, const SurfaceSample&) const override {
        return visible(lighting_.suns.size() + lamp);
    }

private:
    float visible(size_t light) const { return is_hidden_[ray_ * n_lights_ + light] ? 0.0f : 1.0f; }

    // False if a lamp does not shine there, or is there.
    bool addRay(const Ray& ray, const RayHit& hit, size_t light) {
        const Vec3 p = ray.origin + ray.direction * hit.t;
        const float offset = offsetFrom(p);
        Vec3 direction;
        float end = kInfinity;
        if (light < lighting_.suns.size()) {
            direction = lighting_.suns[light].direction_to_light;
        } else {
            const PointLight& lamp = lamps_[light - lighting_.suns.size()];
            const Vec3 to_lamp = Vec3(lamp.position - eye_world_) - p;
            if (incidentLight(lamp, to_lamp) == Vec3(0.0f)) return false;
            const float distance = glm::length(to_lamp);
            direction = to_lamp / distance;
            end = distance - kLampClearance;
            if (end <= 2.0f * offset) return false;
        }
        const float side = glm::dot(hit.normal_world, direction) < 0.0f ? -1.0f : 1.0f;
        to_light_.push_back(
            {p + hit.normal_world * (side * offset), 2.0f * offset, direction, end});
        return true;
    }

    const RayCaster& caster_;
    const Lighting& lighting_;
    DVec3 eye_world_;
    const std::vector<PointLight> lamps_;
    size_t n_lights_;
    std::vector<Ray> to_light_;
    std::vector<size_t> ray_of_;
    std::vector<uint8_t> hit_, is_hidden_;
    size_t ray_ = 0;
};

// Ambient occlusion by its definition: rays as long as the radius from every hit.
class AmbientRays : public AmbientVisibility {
public:
    AmbientRays(const RayCaster& caster, const RenderSettings& settings)
        : caster_(caster), radius_(float(settings.ao_radius)), n_rays_(size_t(settings.ao_rays)) {
        rays_.reserve(n_rays_);
        is_hit_.resize(n_rays_);
    }

    // The place of the hit, relative to the eye, and a key for its random directions.
    void select(const Vec3& p, uint64_t key) { p_ = p, key_ = key; }
    // From the end of each ray to the hit: what the hit would see stops it, so that the inside of a
    // wall does not.
    float of(const SurfaceSample&, const Vec3& normal) const override {
        const float offset = offsetFrom(p_);
        Vec3 u, v;
        tangents(normal, u, v);
        rays_.clear();
        for (size_t i = 0; i < n_rays_; ++i) {
            const uint64_t h = hashCombine(key_, i);
            const float share = (float(i) + uniformFloat(h)) / float(n_rays_);
            const float azimuth = 2.0f * float(kPi) * uniformFloat(mixBits(h));
            const Vec3 direction =
                normal * std::sqrt(1.0f - share) +
                (u * std::cos(azimuth) + v * std::sin(azimuth)) * std::sqrt(share);
            const Vec3 from = p_ + normal * offset;
            rays_.push_back({from + direction * radius_, 0.0f, -direction,
                             std::max(radius_ - 2.0f * offset, 0.0f)});
        }
        caster_.occluded(rays_.data(), rays_.size(), is_hit_.data());
        size_t n_open = 0;
        for (const uint8_t is_hit : is_hit_) n_open += !is_hit;
        return float(n_open) / float(n_rays_);
    }

private:
    const RayCaster& caster_;
    float radius_;
    size_t n_rays_;
    Vec3 p_ = Vec3(0);
    uint64_t key_ = 0;
    mutable std::vector<Ray> rays_;  // one instance a thread
    mutable std::vector<uint8_t> is_hit_;
};

// Offset of ray i of n in the pixel, in [0,1)^2: jittered in the cells of the squarest grid that n
// fills, over which what is left is random. A single ray goes through the centre: at a straight
// edge it sees what covers most of the pixel, with half the mean squared error of a random one.
Vec2 pixelOffset(int i, int n, uint64_t pixel_key) {
    if (n == 1) return Vec2(0.5f);
    const int side = int(std::sqrt(double(n)) + 1e-9);
    const uint64_t h = hashCombine(pixel_key, uint64_t(i));
    const float a = uniformFloat(h), b = uniformFloat(mixBits(h));
    if (i >= side * side) return Vec2(a, b);
    return Vec2((float(i % side) + a) / float(side), (float(i / side) + b) / float(side));
}

}  // namespace

void drawRays(const RayCaster& caster, const View& view, const std::vector<Material>& materials,
              const Lighting& lighting, ThreadPool& pool, const FrameRequest& request,
              Picture& picture, FrameStats& stats) {
    const Stopwatch watch;
    const int n_rays = std::max(1, int(std::lround(request.settings.samples)));
    const Mat3 camera_from_world(view.camera_from_world),
        world_from_camera(glm::transpose(view.camera_from_world));
    const int columns = (view.width + kTilePixels - 1) / kTilePixels,
              rows = (view.height + kTilePixels - 1) / kTilePixels;
    const float s = float(view.subpixels);
    // A ray stands for its share of the pixel; in perspective it widens with depth.
    const float footprint =
        view.orthographic ? 0.0f : s / float(view.focal) / std::sqrt(float(n_rays));
    if (request.progress) request.progress("draw", 0.0);
    std::atomic<size_t> done{0};
    std::mutex progress_mutex;
    const bool has_shadows = request.settings.shadows;
    const bool has_ao = request.settings.ao;
    const auto castAndShade = [&](RayBatch& batch, ShadowRays& shadows, AmbientRays& ambient) {
        batch.hits.resize(batch.rays.size());
        caster.cast(batch.rays.data(), batch.rays.size(), batch.hits.data(), footprint);
        if (has_shadows) shadows.cast(batch.rays, batch.hits);
        for (size_t r = 0; r < batch.rays.size(); ++r) {
            const RayHit& hit = batch.hits[r];
            PixelSums& sum = *batch.sums[r];
            if (!(hit.t < kInfinity)) {
                sum.addNothing();
                continue;
            }
            SurfaceSample sample;
            sample.depth = hit.t;
            const Vec3 p = batch.rays[r].origin + batch.rays[r].direction * hit.t;
            sample.position_camera = camera_from_world * p;
            sample.normal_world = hit.normal_world;
            sample.albedo = hit.albedo;
            sample.finish = hit.finish;
            sample.material = hit.material;
            sample.object = hit.object;
            shadows.select(r);
            ambient.select(p, batch.keys[r]);
            sum.add(sample, shade(sample, materials[hit.material], lighting, view,
                                  has_shadows ? &shadows : nullptr, has_ao ? &ambient : nullptr));
            sum.points += 1.0f;
        }
        batch.rays.clear();
        batch.sums.clear();
        batch.keys.clear();
    };
    pool.forEach(size_t(columns) * size_t(rows), [&](size_t t, int) {
        if (request.cancel && request.cancel->requested) return;
        const int x0 = int(t % columns) * kTilePixels, y0 = int(t / columns) * kTilePixels;
        const int x1 = std::min(x0 + kTilePixels, view.width),
                  y1 = std::min(y0 + kTilePixels, view.height);
        // Blocks of as few pixels as fill a packet with all their rays: rays that follow each other
        // go through the same nodes.
        const int side = n_rays >= 16 ? 1 : n_rays >= 4 ? 2 : kLargestBlock;
        std::vector<PixelSums> sums(kTilePixels * kTilePixels);
        RayBatch batch;
        std::array<uint64_t, kLargestBlock * kLargestBlock> pixel_keys;
        ShadowRays shadows(caster, lighting, view.eye_world);
        AmbientRays ambient(caster, request.settings);
        for (int by = y0; by < y1; by += side) {
            for (int bx = x0; bx < x1; bx += side) {
                const int ex = std::min(bx + side, x1), ey = std::min(by + side, y1);
                const auto keyOf = [&](int x, int y) -> uint64_t& {
                    return pixel_keys[size_t((y - by) * kLargestBlock + (x - bx))];
                };
                for (int y = by; y < ey; ++y) {
                    for (int x = bx; x < ex; ++x)
                        keyOf(x, y) = hashCombine(request.settings.seed, uint64_t(x), uint64_t(y));
                }
                for (int i = 0; i < n_rays; ++i) {
                    for (int y = by; y < ey; ++y) {
                        for (int x = bx; x < ex; ++x) {
                            const Vec2 o = pixelOffset(i, n_rays, keyOf(x, y));
                            Vec3 origin, direction;
                            view.ray((float(x) + o.x) * s, (float(y) + o.y) * s, origin, direction);
                            batch.rays.push_back({world_from_camera * origin, view.near_z,
                                                  world_from_camera * direction, view.far_z});
                            batch.keys.push_back(hashCombine(keyOf(x, y), uint64_t(i)));
                            batch.sums.push_back(
                                &sums[size_t(y - y0) * kTilePixels + size_t(x - x0)]);
                        }
                    }
                    if (batch.rays.size() < kBatchRays) continue;
                    if (request.cancel && request.cancel->requested) return;
                    castAndShade(batch, shadows, ambient);
                }
            }
        }
        castAndShade(batch, shadows, ambient);
        SkyRow sky;
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x)
                picture.write(x, y, sums[size_t(y - y0) * kTilePixels + size_t(x - x0)], sky);
        }
        const size_t n = ++done;
        if (request.progress && n % 64 == 0) {
            const std::lock_guard lock(progress_mutex);
            request.progress("draw", double(n) / (double(columns) * rows));
        }
    });
    if (request.cancel && request.cancel->requested)
        throw Error(ErrorCode::kCancelled, "", "cancelled");
    stats.points_drawn = stats.points_kept =
        uint64_t(n_rays) * uint64_t(view.width) * uint64_t(view.height);
    stats.phases.emplace_back("draw", watch.seconds());
}

}  // namespace stipple
