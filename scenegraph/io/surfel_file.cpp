// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/surfel_file.h>

#include <core/rng.h>
#include <scenegraph/io/model.h>

#include <bit>
#include <cstring>
#include <type_traits>

namespace stipple {

namespace {

static_assert(std::endian::native == std::endian::little, "model files are little-endian");

constexpr char kMagic[8] = {'S', 'T', 'I', 'P', 'P', 'L', 'E', '\x1a'};
constexpr uint32_t kVersion = 1;

uint64_t checksum(const char* data, size_t size) {
    uint64_t key = size;
    for (size_t i = 0; i < size; i += 8) {
        uint64_t word = 0;
        std::memcpy(&word, data + i, std::min<size_t>(8, size - i));
        key = hashCombine(key, word);
    }
    return key;
}

// Values one after the other; reading and writing share the order of fields (transfer functions).
class Writer {
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

class Reader {
public:
    Reader(const char* data, size_t size, MemoryBudget& budget, const std::string& where)
        : at_(data), end_(data + size), budget_(budget), where_(where) {}

    template <class T>
    void value(T& v) {
        std::memcpy(&v, take(sizeof v), sizeof v);
    }
    void string(std::string& s) {
        uint32_t n = 0;
        value(n);
        s.assign(take(n), n);
    }
    template <class T>
    void array(std::vector<T>& v) {
        uint64_t n = 0;
        value(n);
        requireItems(n, sizeof(T));
        budget_.take(double(n) * sizeof(T), where_, std::to_string(n) + " values");
        v.resize(n);
        std::memcpy(v.data(), take(n * sizeof(T)), n * sizeof(T));
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
void transferModel(Stream& stream, SurfelModel& model) {
    constexpr size_t kLeastFinish = 49, kLeastLevel = 60, kBlock = 76;
    stream.string(model.kind);
    stream.string(model.source);
    stream.value(model.bounds.min);
    stream.value(model.bounds.max);
    stream.value(model.area);
    stream.list(model.finishes, kLeastFinish,
                [&](SurfelFinish& finish) { transferFinish(stream, finish); });
    stream.list(model.levels, kLeastLevel, [&](SurfelLevel& level) {
        stream.value(level.spacing);
        stream.list(level.blocks, kBlock,
                    [&](SurfelBlock& block) { transferBlock(stream, block); });
        stream.array(level.position);
        stream.array(level.normal);
        stream.array(level.albedo_finish);
        stream.array(level.radius);
    });
}

struct Header {
    char magic[8];
    uint32_t version;
    uint32_t flags;  // 0
    uint64_t size;   // of what follows
    uint64_t checksum;
};

}  // namespace

std::string surfelFileText(const SurfelModel& model) {
    SurfelModel copy = model;
    Writer writer;
    transferModel(writer, copy);
    Header header = {
        {}, kVersion, 0, writer.text.size(), checksum(writer.text.data(), writer.text.size())};
    std::memcpy(header.magic, kMagic, sizeof kMagic);
    return std::string(reinterpret_cast<const char*>(&header), sizeof header) + writer.text;
}

SurfelModel parseSurfelFile(const std::string& text, MemoryBudget& budget,
                            const std::string& where) {
    Header header;
    if (text.size() < sizeof header || std::memcmp(text.data(), kMagic, sizeof kMagic) != 0)
        throw Error(ErrorCode::kParse, where, "is no model made by 'stipple build'");
    std::memcpy(&header, text.data(), sizeof header);
    if (header.version != kVersion || header.flags != 0) {
        throw Error(ErrorCode::kUnsupported, where,
                    "has version " + std::to_string(header.version) + "; this program reads " +
                        std::to_string(kVersion));
    }
    const size_t size = text.size() - sizeof header;
    if (header.size != size) {
        throw Error(
            ErrorCode::kParse, where,
            "has " + std::to_string(size) + " bytes of data, not " + std::to_string(header.size));
    }
    if (header.checksum != checksum(text.data() + sizeof header, size))
        throw Error(ErrorCode::kParse, where, "is damaged: its checksum does not match");
    SurfelModel model;
    Reader reader(text.data() + sizeof header, size, budget, where);
    transferModel(reader, model);
    if (!reader.isAtEnd()) throw Error(ErrorCode::kParse, where, "has bytes behind its end");
    checkSurfelModel(model, where);
    return model;
}

namespace {

// Squares in place of surfels, of the area that their surface has, from the finest level that is
// not too large.
Mesh standInMesh(const SurfelModel& model) {
    constexpr size_t kMostSquares = 40000;
    const SurfelLevel* level = &model.levels.back();
    for (const SurfelLevel& l : model.levels) {
        if (l.size() <= kMostSquares) {
            level = &l;
            break;
        }
    }
    Mesh mesh;
    double area = 0.0;  // of all squares with a side of the spacing
    for (uint32_t i = 0; i < level->size(); ++i) {
        const double share = level->radius.empty() ? 1.0 : double(surfelRadius(level->radius[i]));
        area += share * share * double(level->spacing) * double(level->spacing);
    }
    const double shrink = area > 0.0 && model.area > 0.0 ? std::sqrt(model.area / area) : 1.0;
    for (const SurfelBlock& block : level->blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(*level, block, i);
            const Vec3 other = std::abs(s.normal.x) < 0.7f ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
            const float half = 0.5f * level->spacing * s.radius_share * float(shrink);
            const Vec3 a = glm::normalize(glm::cross(s.normal, other)) * half,
                       b = glm::cross(s.normal, a);
            const uint32_t first = uint32_t(mesh.positions.size());
            for (const Vec3& corner : {-a - b, a - b, a + b, b - a}) {
                // Within the source's bounds: both are looked at from the same default camera.
                mesh.positions.push_back(
                    glm::clamp(s.position + corner, model.bounds.min, model.bounds.max));
                mesh.normals.push_back(s.normal);
                mesh.colors.emplace_back(s.albedo, 1.0f);
            }
            mesh.triangles.emplace_back(first, first + 1, first + 2);
            mesh.triangles.emplace_back(first, first + 2, first + 3);
            mesh.triangle_material.insert(mesh.triangle_material.end(), 2, s.finish);
        }
    }
    return mesh;
}

}  // namespace

ChildRef loadSurfelModel(const std::filesystem::path& path, const std::string& name, Scene& scene,
                         LoadContext& context) {
    auto model = std::make_shared<SurfelModel>(
        parseSurfelFile(readFile(path, context.budget, name), context.budget, name));
    Mesh mesh = standInMesh(*model);
    mesh.name = name;
    mesh.first_finish = uint32_t(scene.materials.size());
    std::vector<Material> materials;
    for (const SurfelFinish& finish : model->finishes) {
        materials.push_back(finish.material);
        materials.back().base_color = Vec3(1.0f);
    }
    mesh.surfels = std::move(model);
    return addModel(scene, std::move(mesh), std::move(materials), name);
}

}  // namespace stipple
