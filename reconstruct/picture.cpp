// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/picture.h>

#include <core/vector_clones.h>
#include <reconstruct/shade.h>

#include <cstdio>

namespace stipple {

namespace {

std::vector<std::string> channelNames(const std::vector<std::string>& aovs) {
    std::vector<std::string> names{"R", "G", "B", "A"};
    for (const std::string& aov : aovs) {
        if (aov == "depth") {
            names.insert(names.end(), {"depth", "depth_max"});
        } else if (aov == "normal" || aov == "albedo") {
            const char* parts = aov == "normal" ? "XYZ" : "RGB";
            for (int i = 0; i < 3; ++i) names.push_back(aov + "." + parts[i]);
        } else if (aov == "object" || aov == "coverage" || aov == "count") {
            names.push_back(aov);
        } else {
            throw Error(
                ErrorCode::kInvalidArgument, "",
                "unknown AOV \"" + aov + "\" (depth, normal, albedo, object, coverage, count)");
        }
    }
    return names;
}

}  // namespace

Picture::Picture(const View& view, const Lighting& lighting, const std::vector<std::string>& aovs,
                 bool transparent)
    : view_(view),
      lighting_(lighting),
      transparent_(transparent),
      exposure_(std::exp2(lighting.exposure)),
      image_(view.width, view.height, channelNames(aovs)),
      depth_(image_.channelIndex("depth")),
      normal_(image_.channelIndex("normal.X")),
      albedo_(image_.channelIndex("albedo.R")),
      object_(image_.channelIndex("object")),
      coverage_(image_.channelIndex("coverage")),
      count_(image_.channelIndex("count")) {
    ray_x_.reserve(size_t(view.width));
    for (int x = 0; x < view.width; ++x) {
        Vec3 origin, direction;
        view.ray((float(x) + 0.5f) * float(view.subpixels), 0.0f, origin, direction);
        ray_x_.push_back(direction.x);
    }
}

std::string Picture::watchedPixel() const {
    const PixelSums& s = watched_;
    const float n = std::max(s.covered, 1.0f);
    const float* rgb = image_.pixel(watched_x_, watched_y_);
    char line[512];
    std::snprintf(line, sizeof line,
                  "pixel %d,%d: linear RGB %.5g %.5g %.5g; %g of %g samples covered; depth mean "
                  "%.6g, nearest %.6g, "
                  "farthest %.6g; albedo %.3g %.3g %.3g; object %u; %g points",
                  watched_x_, watched_y_, rgb[0], rgb[1], rgb[2], s.covered, s.samples, s.depth / n,
                  s.nearest, s.depth_max, s.albedo.x / n, s.albedo.y / n, s.albedo.z / n, s.object,
                  s.points);
    return line;
}

namespace {

// skyRadiance() of a sky without an environment in the directions (x[i], y, 1).
STIPPLE_VECTOR_CLONES void gradientSky(const Sky& sky, const Mat3& world_from_camera,
                                       const float* __restrict x, float y, int count,
                                       float* __restrict red, float* __restrict green,
                                       float* __restrict blue) {
    // Plain locals, or the compiler will not vectorize.
    const Mat3& m = world_from_camera;
    const float xx = m[0].x, xy = m[0].y, xz = m[0].z, zx = m[2].x, zy = m[2].y, zz = m[2].z;
    const float yx = m[1].x * y, yy = m[1].y * y, yz = m[1].z * y;
    const Vec3 h = sky.horizon, g = sky.ground, z = sky.zenith;
    for (int i = 0; i < count; ++i) {
        const float px = xx * x[i] + yx + zx, py = xy * x[i] + yy + zy, pz = xz * x[i] + yz + zz;
        const float up = py * (1.0f / std::sqrt(px * px + py * py + pz * pz));
        const bool is_below = up < 0.0f;
        const float t = skyShare(up);
        red[i] = h.x * (1.0f - t) + (is_below ? g.x : z.x) * t;
        green[i] = h.y * (1.0f - t) + (is_below ? g.y : z.y) * t;
        blue[i] = h.z * (1.0f - t) + (is_below ? g.z : z.z) * t;
    }
}

}  // namespace

// From pixel x on.
void Picture::findSky(int x, int y, SkyRow& sky) const {
    sky.x = x, sky.y = y;
    sky.count = std::min(SkyRow::kPixels, view_.width - x);
    Vec3 origin, direction;
    view_.ray(0.0f, (float(y) + 0.5f) * float(view_.subpixels), origin, direction);
    if (!lighting_.sky.environment) {
        gradientSky(lighting_.sky, view_.world_from_camera, ray_x_.data() + x, direction.y,
                    sky.count, sky.red.data(), sky.green.data(), sky.blue.data());
        return;
    }
    for (int i = 0; i < sky.count; ++i) {
        direction.x = ray_x_[size_t(x + i)];
        const Vec3 radiance =
            skyRadiance(lighting_.sky, glm::normalize(view_.world_from_camera * direction));
        sky.red[size_t(i)] = radiance.x;
        sky.green[size_t(i)] = radiance.y;
        sky.blue[size_t(i)] = radiance.z;
    }
}

void Picture::writeNothing(int x, int y, int count, float samples, SkyRow& sky) {
    if (transparent_ || image_.channelCount() > 4 || y == watched_y_) {
        PixelSums nothing;
        nothing.samples = samples;
        for (int i = 0; i < count; ++i) write(x + i, y, nothing, sky);
        return;
    }
    for (int i = 0; i < count;) {
        if (!sky.has(x + i, y)) findSky(x + i, y, sky);
        const int first = x + i - sky.x, n = std::min(count - i, sky.count - first);
        float* out = image_.pixel(x + i, y);
        for (int k = 0; k < n; ++k, out += 4) {
            const size_t from = size_t(first + k);
            out[0] = sky.red[from] * exposure_;
            out[1] = sky.green[from] * exposure_;
            out[2] = sky.blue[from] * exposure_;
            out[3] = 1.0f;
        }
        i += n;
    }
}

void Picture::write(int x, int y, const PixelSums& s, SkyRow& sky) {
    if (isWatched(x, y)) watched_ = s;
    const float coverage = s.samples > 0.0f ? s.covered / s.samples : 0.0f;
    Vec3 color = s.samples > 0.0f ? s.radiance / s.samples : Vec3(0.0f);
    if (!transparent_ && coverage < 1.0f) {
        if (!sky.has(x, y)) findSky(x, y, sky);
        const size_t i = size_t(x - sky.x);
        color += Vec3(sky.red[i], sky.green[i], sky.blue[i]) * (1.0f - coverage);
    }
    float* out = image_.pixel(x, y);
    for (int i = 0; i < 3; ++i) out[i] = color[i] * exposure_;
    out[3] = transparent_ ? coverage : 1.0f;
    const float per_covered = s.covered > 0.0f ? 1.0f / s.covered : 0.0f;
    if (depth_ >= 0) {
        out[depth_] = s.covered > 0.0f ? s.depth * per_covered : kInfinity;
        out[depth_ + 1] = s.covered > 0.0f ? s.depth_max : kInfinity;
    }
    if (normal_ >= 0) {
        const float length = glm::length(s.normal);
        for (int i = 0; i < 3; ++i) out[normal_ + i] = length > 0.0f ? s.normal[i] / length : 0.0f;
    }
    if (albedo_ >= 0) {
        for (int i = 0; i < 3; ++i) out[albedo_ + i] = s.albedo[i] * per_covered;
    }
    // 24 bits survive in a float.
    if (object_ >= 0) out[object_] = float(s.object & 0xffffffu);
    if (coverage_ >= 0) out[coverage_] = coverage;
    if (count_ >= 0) out[count_] = s.points;
}

}  // namespace stipple
