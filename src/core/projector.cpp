// SPDX-License-Identifier: Apache-2.0
#include <core/projector.h>

namespace stipple {

namespace {

// Pixels of the picture, and the depth; false where nothing arrives.
bool project(const Projector& projector, const DVec3& place, const Vec3& normal_world, Vec2& at,
             float& depth) {
    const View& view = projector.view;
    const DVec3 from_lens = place - view.eye_world;
    if (!(glm::dot(Vec3(from_lens), normal_world) < 0.0f)) return false;
    const Vec3 p(view.camera_from_world * from_lens);
    depth = p.z;
    if (!(p.z > view.near_z && p.z < view.far_z)) return false;
    at = view.project(p);
    return at.x >= 0.0f && at.x < float(view.width) && at.y >= 0.0f && at.y < float(view.height);
}

}  // namespace

bool isInBeam(const Projector& projector, const DVec3& place, const Vec3& normal_world) {
    Vec2 at;
    float depth;
    return project(projector, place, normal_world, at, depth);
}

Vec3 projectedColor(const Projector& projector, const Vec3& color, const DVec3& place,
                    const Vec3& normal_world, float width, float lit) {
    Vec2 at;
    float depth;
    if (!project(projector, place, normal_world, at, depth)) return color;
    const View& view = projector.view;
    const float texels = width * float(view.focal) / depth;
    const Vec4 thrown =
        sampleTexture(*projector.picture, at / Vec2(float(view.width), float(view.height)),
                      texels / float(std::max(view.width, view.height)));
    const Vec3 all =
        projector.mode == ProjectorMode::kReplace ? Vec3(thrown) : color * Vec3(thrown);
    return glm::mix(color, all, thrown.a * lit);
}

}  // namespace stipple
