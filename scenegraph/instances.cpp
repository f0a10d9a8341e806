// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/instances.h>

#include <glm/gtc/quaternion.hpp>

namespace stipple {

namespace {

constexpr double kPositionSteps = 2147483647.0;  // int32 range on each side of the domain's centre

// Decomposes m into scale * rotation (scale < 0: all axes mirrored). False if it is anything else.
bool decomposeSimilarity(const DMat3& m, double& scale, glm::dquat& rotation) {
    const double a = glm::dot(m[0], m[0]), b = glm::dot(m[1], m[1]), c = glm::dot(m[2], m[2]);
    const double tolerance = 1e-6 * a;
    const auto isSmall = [&](double x) { return std::abs(x) <= tolerance; };
    if (!(a > 1e-60) || !isSmall(a - b) || !isSmall(a - c) || !isSmall(glm::dot(m[0], m[1])) ||
        !isSmall(glm::dot(m[0], m[2])) || !isSmall(glm::dot(m[1], m[2]))) {
        return false;
    }
    scale = std::copysign(std::sqrt((a + b + c) / 3.0), glm::determinant(m));
    rotation = glm::normalize(glm::quat_cast(m * (1.0 / scale)));
    if (rotation.w < 0.0) rotation = -rotation;
    return true;
}

}  // namespace

InstanceStore::InstanceStore(const DBox3& domain)
    : origin_(domain.center()),
      step_(glm::max(domain.extent() * 0.5, DVec3(1e-6)) / kPositionSteps) {}

bool InstanceStore::quantize(const DVec3& translation, int32_t (&position)[3]) const {
    const DVec3 p = (translation - origin_) / step_;
    for (int i = 0; i < 3; ++i) {
        if (!(std::abs(p[i]) <= kPositionSteps)) return false;
        position[i] = int32_t(std::lrint(p[i]));
    }
    return true;
}

InstanceStore::Record InstanceStore::makeRecord(ChildRef child, const Affine& group_from_child) {
    Record r;
    r.child = child;
    double scale;
    glm::dquat q;
    if (quantize(group_from_child.translation, r.position) &&
        decomposeSimilarity(group_from_child.linear, scale, q)) {
        r.rotation[0] = float(q.x), r.rotation[1] = float(q.y), r.rotation[2] = float(q.z);
        r.scale = float(scale);
        return r;
    }
    uint32_t index = uint32_t(general_.size());
    if (free_general_.empty()) {
        general_.push_back(group_from_child);
    } else {
        index = free_general_.back();
        free_general_.pop_back();
        general_[index] = group_from_child;
    }
    r = Record();
    r.child = child;
    r.position[0] = int32_t(index);
    r.scale = 0.0f;
    return r;
}

void InstanceStore::add(ChildRef child, const Affine& group_from_child) {
    records_.push_back(makeRecord(child, group_from_child));
}

void InstanceStore::set(size_t i, ChildRef child, const Affine& group_from_child) {
    erase(i);
    records_[i] = makeRecord(child, group_from_child);
}

void InstanceStore::erase(size_t i) {
    Record& r = records_[i];
    if (r.scale == 0.0f) free_general_.push_back(uint32_t(r.position[0]));
    r = Record();
}

void InstanceStore::addEmpty(size_t n) { records_.resize(records_.size() + n); }

void InstanceStore::addSimilarity(ChildRef child, const DVec3& translation,
                                  const glm::dvec4& rotation, double scale) {
    const glm::dvec4 q = rotation.w < 0.0 ? -rotation : rotation;
    Record r;
    if (quantize(translation, r.position)) {
        r.rotation[0] = float(q.x), r.rotation[1] = float(q.y), r.rotation[2] = float(q.z);
        r.scale = float(scale);
        r.child = child;
        records_.push_back(r);
    } else {
        add(child, {glm::mat3_cast(glm::dquat(q.w, q.x, q.y, q.z)) * scale, translation});
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

void InstanceStore::append(const InstanceStore& other) {
    const size_t first = records_.size(), first_general = general_.size();
    records_.insert(records_.end(), other.records_.begin(), other.records_.end());
    if (other.general_.empty()) return;
    general_.insert(general_.end(), other.general_.begin(), other.general_.end());
    for (size_t i = first; i < records_.size(); ++i) {
        if (records_[i].scale == 0.0f)
            records_[i].position[0] = int32_t(uint32_t(records_[i].position[0]) + first_general);
    }
}

void InstanceStore::addChunks(ThreadPool& pool, size_t n_chunks,
                              const std::function<void(size_t, InstanceStore&)>& make) {
    // Some chunks at a time: what they hold is there twice for a moment.
    constexpr size_t kChunksAtATime = 32;
    InstanceStore empty;
    empty.origin_ = origin_, empty.step_ = step_;
    for (size_t first = 0; first < n_chunks; first += kChunksAtATime) {
        const size_t n = std::min(kChunksAtATime, n_chunks - first);
        std::vector<InstanceStore> parts(n, empty);
        pool.forEach(n, [&](size_t i, int) { make(first + i, parts[i]); });
        for (const InstanceStore& part : parts) append(part);
    }
}

void InstanceStore::permute(const std::vector<uint32_t>& order) {
    // Cycle by cycle, in place: a copy of all records is what a large scene's load would need most
    // memory for, where room was reserved for as many as have come.
    records_.shrink_to_fit();
    std::vector<bool> is_done(order.size(), false);
    for (size_t first = 0; first < order.size(); ++first) {
        if (is_done[first] || order[first] == first) continue;
        const Record kept = records_[first];
        size_t i = first;
        for (; order[i] != first; i = order[i]) {
            records_[i] = records_[order[i]];
            is_done[i] = true;
        }
        records_[i] = kept;
        is_done[i] = true;
    }
}

void InstanceStore::keep(const std::vector<uint32_t>& order) {
    for (size_t i = 0; i < order.size(); ++i) records_[i] = records_[order[i]];
    records_.resize(order.size());
}

}  // namespace stipple
