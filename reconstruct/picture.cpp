// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/picture.h>

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
      world_from_camera_(glm::transpose(view.camera_from_world)),
      lighting_(lighting),
      transparent_(transparent),
      exposure_(std::exp2(lighting.exposure)),
      image_(view.width, view.height, channelNames(aovs)),
      depth_(image_.channelIndex("depth")),
      normal_(image_.channelIndex("normal.X")),
      albedo_(image_.channelIndex("albedo.R")),
      object_(image_.channelIndex("object")),
      coverage_(image_.channelIndex("coverage")),
      count_(image_.channelIndex("count")) {}

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

void Picture::write(int x, int y, const PixelSums& s) {
    if (isWatched(x, y)) watched_ = s;
    const float coverage = s.samples > 0.0f ? s.covered / s.samples : 0.0f;
    Vec3 color = s.samples > 0.0f ? s.radiance / s.samples : Vec3(0.0f);
    if (!transparent_ && coverage < 1.0f) {
        Vec3 origin, direction;
        view_.ray((float(x) + 0.5f) * float(view_.subpixels),
                  (float(y) + 0.5f) * float(view_.subpixels), origin, direction);
        const Vec3 world = glm::normalize(world_from_camera_ * direction);
        color += skyRadiance(lighting_.sky, world) * (1.0f - coverage);
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
