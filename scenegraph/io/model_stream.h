// SPDX-License-Identifier: Apache-2.0
// What the kinds of model files (*.stipple) share: header, checksum, values one after the other.
// Reading and writing share the order of fields: transfer functions take a Writer or a Reader.
#pragma once

#include <scenegraph/io/load_context.h>
#include <scenegraph/surfel_model.h>

#include <bit>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace stipple {

static_assert(std::endian::native == std::endian::little, "model files are little-endian");

// Of the file's layout: surfels that are alike or circles, hybrids, splats with shapes, these with
// normals that turn.
inline constexpr uint32_t kSurfelVersion = 1, kHybridVersion = 2, kShapeVersion = 3,
                          kBendVersion = 4;

// The whole file: header and body.
std::string modelFileText(uint32_t version, const std::string& body);

struct ModelBody {
    uint32_t version = 0;
    const char* data = nullptr;  // within the text
    size_t size = 0;
};
// Checks header and checksum. Throws kParse for anything that is no such file, whole and undamaged;
// kUnsupported for an unknown version. where: names the file.
ModelBody modelBody(const std::string& text, const std::string& where);

class ModelWriter {
public:
    std::string text;

    template <class T>
    void value(T& v) {
        static_assert(std::is_trivially_copyable_v<T>);
        text.append(reinterpret_cast<const char*>(&v), sizeof v);
    }
    void string(std::string& s) {
        uint32_t n = uint32_t(s.size());
        value(n);
        text += s;
    }
    template <class T>
    void array(std::vector<T>& v) {
        uint64_t n = v.size();
        value(n);
        text.append(reinterpret_cast<const char*>(v.data()), n * sizeof(T));
    }
    template <class T, class Each>
    void list(std::vector<T>& v, size_t, const Each& each) {
        uint64_t n = v.size();
        value(n);
        for (T& item : v) each(item);
    }
};

class ModelReader {
public:
    ModelReader(const char* data, size_t size, MemoryBudget& budget, const std::string& where)
        : at_(data), end_(data + size), budget_(budget), where_(where) {}

    template <class T>
    void value(T& v) {
        std::memcpy(&v, take(sizeof v), sizeof v);
    }
    // Names: they reach messages and the terminal, so control characters are left out.
    void string(std::string& s);
    template <class T>
    void array(std::vector<T>& v) {
        uint64_t n = 0;
        value(n);
        requireItems(n, sizeof(T));
        budget_.take(double(n) * sizeof(T), where_, std::to_string(n) + " values");
        v.resize(n);
        if (n > 0) std::memcpy(v.data(), take(n * sizeof(T)), n * sizeof(T));
    }
    // least: bytes that an item has at least.
    template <class T, class Each>
    void list(std::vector<T>& v, size_t least, const Each& each) {
        uint64_t n = 0;
        value(n);
        requireItems(n, least);
        budget_.take(double(n) * sizeof(T), where_, std::to_string(n) + " items");
        v.resize(n);
        for (T& item : v) each(item);
    }
    bool isAtEnd() const { return at_ == end_; }

private:
    const char* take(uint64_t n) {
        if (n > uint64_t(end_ - at_))
            throw Error(ErrorCode::kParse, where_, "ends in the middle of its data");
        const char* from = at_;
        at_ += n;
        return from;
    }
    void requireItems(uint64_t n, size_t bytes_each) {
        if (n > uint64_t(end_ - at_) / bytes_each)
            throw Error(ErrorCode::kParse, where_, "ends in the middle of its data");
    }

    const char *at_, *end_;
    MemoryBudget& budget_;
    const std::string& where_;
};

template <class Stream>
void transferFinish(Stream& stream, SurfelFinish& finish) {
    Material& m = finish.material;
    uint8_t flags = uint8_t(m.double_sided | m.unlit << 1);
    stream.string(m.name);
    for (float* v : {&m.metallic, &m.roughness, &m.specular_weight, &m.translucency})
        stream.value(*v);
    stream.value(m.specular);
    stream.value(m.emissive);
    stream.value(finish.patch_width);
    stream.value(flags);
    m.double_sided = flags & 1;
    m.unlit = flags >> 1 & 1;
}

template <class Stream>
void transferBlock(Stream& stream, SurfelBlock& b) {
    for (Vec3* v : {&b.bounds.min, &b.bounds.max, &b.cone_apex, &b.cone_axis}) stream.value(*v);
    stream.value(b.cone_sine);
    stream.value(b.first);
    stream.value(b.count);
    for (uint64_t& bits : b.visible_from) stream.value(bits);
}

template <class Stream>
void transferLevels(Stream& stream, std::vector<SurfelLevel>& levels, uint32_t version) {
    constexpr size_t kLeastLevel = 44, kBlock = 76;
    stream.list(levels, kLeastLevel, [&](SurfelLevel& level) {
        stream.value(level.spacing);
        stream.list(level.blocks, kBlock,
                    [&](SurfelBlock& block) { transferBlock(stream, block); });
        stream.array(level.position);
        stream.array(level.normal);
        stream.array(level.albedo_finish);
        stream.array(level.radius);
        if (version >= kShapeVersion) {
            stream.array(level.shapes);
            stream.array(level.cuts);
        }
        if (version >= kBendVersion) stream.array(level.bends);
    });
}

template <class Stream>
void transferFinishes(Stream& stream, std::vector<SurfelFinish>& finishes) {
    constexpr size_t kLeastFinish = 49;
    stream.list(finishes, kLeastFinish,
                [&](SurfelFinish& finish) { transferFinish(stream, finish); });
}

}  // namespace stipple
