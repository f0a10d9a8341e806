// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/normal_cone.h>

namespace stipple {

namespace {

// Covers the rounding of points' normals and of the arithmetic here.
constexpr float kSlack = 0.01f;

float sineOf(float cosine) { return std::sqrt(std::max(1.0f - cosine * cosine, 0.0f)); }

}  // namespace

NormalCone surroundingCone(const std::vector<WeightedCone>& parts) {
    NormalCone result;
    DVec3 sum(0.0);
    for (const WeightedCone& part : parts) {
        const DVec3 axis(part.cone.axis);
        sum += axis * (glm::dot(sum, axis) < 0.0 ? -part.area : part.area);
    }
    const double length = glm::length(sum);
    if (!(length > 0.0)) return result;
    result.axis = Vec3(sum / length);
    result.cos_spread = 1.0f;
    for (const WeightedCone& part : parts) {
        const float c = std::min(std::abs(glm::dot(result.axis, part.cone.axis)), 1.0f);
        const float spread = part.cone.cos_spread;
        // The cosine of the sum of both angles.
        const float both = c * spread - sineOf(c) * sineOf(spread);
        result.cos_spread = std::min(result.cos_spread, std::max(both, 0.0f));
    }
    return result;
}

float largestCosine(const NormalCone& cone, const Box3& box, const DVec3& eye, bool orthographic) {
    if (!(cone.cos_spread > 0.0f)) return 1.0f;
    Vec3 to_eye(eye);
    float sin_box = 0.0f;  // of the angle that the box's ball fills as seen from the eye
    if (!orthographic) {
        to_eye = Vec3(eye - DVec3(box.center()));
        const float distance = glm::length(to_eye);
        const float radius = 0.5f * glm::length(box.extent());
        if (!(distance > radius)) return 1.0f;
        sin_box = radius / distance;
    }
    const float cos_box = sineOf(sin_box);
    const float c = std::abs(glm::dot(cone.axis, glm::normalize(to_eye)));
    const float sin_spread = sineOf(cone.cos_spread);
    const float cos_slack = cone.cos_spread * cos_box - sin_spread * sin_box;
    if (!(cos_slack > 0.0f) || cos_slack <= c) return 1.0f;
    const float sin_slack = sin_spread * cos_box + cone.cos_spread * sin_box;
    const float largest = c * cos_slack + sineOf(c) * sin_slack + kSlack;
    return largest < 1.0f ? largest : 1.0f;
}

}  // namespace stipple
