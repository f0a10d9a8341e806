// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/instances.h>

#include <glm/gtc/quaternion.hpp>

namespace stipple {

namespace {

constexpr double kPositionSteps = 2147483647.0;  // int32 range on each side of the domain's centre

// Decomposes m into scale * rotation (scale < 0: all axes mirrored). False if it is anything else.
bool decomposeSimilarity(const DMat3& m, double& scale, glm::dquat& rotation) {
    const double determinant = glm::determinant(m);
    scale = std::cbrt(determinant);
    if (!(std::abs(scale) > 1e-30)) return false;
    const DMat3 r = m / scale;
    const DMat3 error = r * glm::transpose(r) - DMat3(1.0);
    for (int c = 0; c < 3; ++c) {
        if (glm::dot(error[c], error[c]) > 1e-12) return false;
    }
    rotation = glm::normalize(glm::quat_cast(r));
    if (rotation.w < 0.0) rotation = -rotation;
    return true;
}

}  // namespace

InstanceStore::InstanceStore(const DBox3& domain)
    : origin_(domain.center()),
      step_(glm::max(domain.extent() * 0.5, DVec3(1e-6)) / kPositionSteps) {}

void InstanceStore::add(ChildRef child, const Affine& group_from_child) {
    double scale;
    glm::dquat q;
    const DVec3 p = glm::round((group_from_child.translation - origin_) / step_);
    const bool in_domain = std::abs(p.x) <= kPositionSteps && std::abs(p.y) <= kPositionSteps &&
                           std::abs(p.z) <= kPositionSteps;
    if (in_domain && decomposeSimilarity(group_from_child.linear, scale, q)) {
        records_.push_back({{int32_t(p.x), int32_t(p.y), int32_t(p.z)},
                            {float(q.x), float(q.y), float(q.z)},
                            float(scale),
                            child});
    } else {
        records_.push_back({{int32_t(general_.size()), 0, 0}, {0, 0, 0}, 0.0f, child});
        general_.push_back(group_from_child);
    }
}

Affine InstanceStore::groupFromChild(size_t i) const {
    const Record& r = records_[i];
    if (r.scale == 0.0f) return general_[uint32_t(r.position[0])];
    const double x = r.rotation[0], y = r.rotation[1], z = r.rotation[2];
    const double w = std::sqrt(std::max(0.0, 1.0 - x * x - y * y - z * z));
    Affine a;
    a.linear = glm::mat3_cast(glm::dquat(w, x, y, z)) * double(r.scale);
    a.translation = origin_ + step_ * DVec3(r.position[0], r.position[1], r.position[2]);
    return a;
}

double InstanceStore::areaScale(size_t i) const {
    const Record& r = records_[i];
    if (r.scale == 0.0f) return maxAreaScale(general_[uint32_t(r.position[0])].linear);
    return double(r.scale) * double(r.scale);
}

void InstanceStore::permute(const std::vector<uint32_t>& order) {
    std::vector<Record> sorted(records_.size());
    for (size_t i = 0; i < order.size(); ++i) sorted[i] = records_[order[i]];
    records_ = std::move(sorted);
}

}  // namespace stipple
