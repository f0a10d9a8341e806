// SPDX-License-Identifier: Apache-2.0
// Compact storage of a group's instances: 32 bytes each for rotation, uniform scale and
// translation; any other affine map costs 100 bytes more.
#pragma once

#include <core/math.h>
#include <core/parallel.h>

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

namespace stipple {

// What an instance shows: a mesh or a group.
struct ChildRef {
    uint32_t bits = 0;

    static ChildRef mesh(uint32_t index) { return {index}; }
    static ChildRef group(uint32_t index) { return {index | 0x80000000u}; }
    // An empty place in an InstanceStore.
    static ChildRef none() { return {0x7fffffffu}; }
    bool isNone() const { return bits == 0x7fffffffu; }
    bool isGroup() const { return bits >> 31; }
    uint32_t index() const { return bits & 0x7fffffffu; }
    bool operator==(const ChildRef& o) const { return bits == o.bits; }
};

class InstanceStore {
public:
    // domain: a box of group space that holds the instances' translations; positions are kept to
    // 2^-32 of its size. Translations outside it are kept exactly, at the higher price.
    explicit InstanceStore(const DBox3& domain = DBox3{DVec3(-1), DVec3(1)});

    void add(ChildRef child, const Affine& group_from_child);
    // The same for scale * rotation: scale above 0, rotation a unit quaternion x, y, z, w.
    void addSimilarity(ChildRef child, const DVec3& translation, const glm::dvec4& rotation,
                       double scale);
    // Adds what make(chunk, store) puts into an empty store of the same domain, for every chunk in
    // [0, n_chunks): in this order, whatever the threads.
    void addChunks(ThreadPool& pool, size_t n_chunks,
                   const std::function<void(size_t chunk, InstanceStore& store)>& make);
    void reserve(size_t n) { records_.reserve(n); }
    size_t size() const { return records_.size(); }
    ChildRef child(size_t i) const { return records_[i].child; }
    Affine groupFromChild(size_t i) const;
    // Whether it is rotation, uniform scale (not zero) and translation.
    bool isSimilarity(size_t i) const { return records_[i].scale != 0.0f; }
    // maxAreaScale() of groupFromChild(i).linear, without decoding the rotation.
    double areaScale(size_t i) const;
    // Editing. Places may be empty; loops over all must leave those out.
    void set(size_t i, ChildRef child, const Affine& group_from_child);
    void setChild(size_t i, ChildRef child) { records_[i].child = child; }
    void erase(size_t i);
    void swap(size_t i, size_t j) { std::swap(records_[i], records_[j]); }
    void addEmpty(size_t n);
    // Reorders in place: new record i is old record order[i]. order: each once.
    void permute(const std::vector<uint32_t>& order);
    // Those that order, which ascends, leaves out go.
    void keep(const std::vector<uint32_t>& order);
    size_t bytes() const {
        return records_.capacity() * sizeof(Record) + general_.capacity() * sizeof(Affine);
    }

private:
    // scale 0 marks an index into general_ (in position[0]).
    struct Record {
        int32_t position[3] = {0, 0, 0};  // translation = origin_ + step_ * position
        float rotation[3] = {0, 0, 0};    // x, y, z of a unit quaternion with w >= 0
        float scale = 1.0f;               // uniform, negative: mirrored (all axes)
        ChildRef child = ChildRef::none();
    };
    static_assert(sizeof(Record) == 32);

    void append(const InstanceStore& other);
    Record makeRecord(ChildRef child, const Affine& group_from_child);
    // The nearest steps; false outside of the domain.
    bool quantize(const DVec3& translation, int32_t (&position)[3]) const;

    DVec3 origin_;
    DVec3 step_;
    std::vector<Record> records_;
    std::vector<Affine> general_;
    std::vector<uint32_t> free_general_;  // no record's
};

}  // namespace stipple
