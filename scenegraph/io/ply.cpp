// SPDX-License-Identifier: Apache-2.0
// PLY files. why: no PLY reader that checks its bounds is packaged.
#include <core/image.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/picture.h>
#include <scenegraph/io/ply_header.h>
#include <scenegraph/io/point_discs.h>
#include <scenegraph/io/polygon.h>

#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <sstream>

namespace stipple {

namespace {

// What the file holds, as far as it is drawn.
struct PlyContents {
    std::vector<Vec3> positions, normals;
    std::vector<Vec2> uvs;
    std::vector<Vec4> colors;       // linear
    std::vector<uint32_t> corners;  // of all polygons, one after the other
    std::vector<uint32_t> sizes;    // corners of each polygon
    bool has_faces = false;
};

// Hands out one value after the other.
class PlyValues {
public:
    PlyValues(std::string_view bytes, const PlyHeader& header, const std::string& where)
        : at_(bytes.data() + header.size),
          end_(bytes.data() + bytes.size()),
          encoding_(header.encoding),
          where_(where) {}

    size_t bytesLeft() const { return size_t(end_ - at_); }

    double next(PlyType type, const PlyElement& element, uint64_t index) {
        if (encoding_ == PlyEncoding::kAscii) return nextWord(element, index);
        const size_t size = plyTypeSize(type);
        if (bytesLeft() < size) fail(element, index, "the file is cut off");
        char raw[8];
        std::memcpy(raw, at_, size);
        at_ += size;
        constexpr bool kIsLittle = std::endian::native == std::endian::little;
        if ((encoding_ == PlyEncoding::kLittleEndian) != kIsLittle) std::reverse(raw, raw + size);
        switch (type) {
            case PlyType::kInt8:
                return asNumber<int8_t>(raw);
            case PlyType::kUint8:
                return asNumber<uint8_t>(raw);
            case PlyType::kInt16:
                return asNumber<int16_t>(raw);
            case PlyType::kUint16:
                return asNumber<uint16_t>(raw);
            case PlyType::kInt32:
                return asNumber<int32_t>(raw);
            case PlyType::kUint32:
                return asNumber<uint32_t>(raw);
            case PlyType::kFloat32:
                return asNumber<float>(raw);
            default:
                return asNumber<double>(raw);
        }
    }

    // The length of a list that starts here: no more than values can follow.
    uint64_t nextCount(const PlyProperty& list, const PlyElement& element, uint64_t index) {
        const double count = next(list.count_type, element, index);
        const size_t least =
            encoding_ == PlyEncoding::kAscii ? 1 : plyTypeSize(list.type);  // bytes a value
        if (!(count >= 0.0 && count * double(least) <= double(bytesLeft())))
            fail(element, index, "a list is longer than the file");
        return uint64_t(count);
    }

    // Bytes that an element takes at least.
    uint64_t leastSize(const PlyElement& element) const {
        uint64_t size = 0;
        for (const PlyProperty& p : element.properties) {
            size += encoding_ == PlyEncoding::kAscii
                        ? 1
                        : plyTypeSize(p.is_list ? p.count_type : p.type);
        }
        return size;
    }

    [[noreturn]] void fail(const PlyElement& element, uint64_t index,
                           const std::string& message) const {
        throw Error(ErrorCode::kParse,
                    where_ + ": " + oneLine(element.name, 40) + " " + std::to_string(index),
                    message);
    }

private:
    template <class T>
    static double asNumber(const char* raw) {
        T value;
        std::memcpy(&value, raw, sizeof value);
        return double(value);
    }

    double nextWord(const PlyElement& element, uint64_t index) {
        const auto isSpace = [](char c) { return c == ' ' || (c >= '\t' && c <= '\r'); };
        while (at_ < end_ && isSpace(*at_)) ++at_;
        if (at_ == end_) fail(element, index, "the file is cut off");
        if (*at_ == '+') ++at_;
        double value = 0.0;
        const auto [end, error] = std::from_chars(at_, end_, value);
        const bool is_range = error == std::errc::result_out_of_range;
        if ((error != std::errc() && !is_range) || (end < end_ && !isSpace(*end))) {
            const char* word_end = at_;
            while (word_end < end_ && !isSpace(*word_end)) ++word_end;
            fail(element, index,
                 inQuotes(std::string_view(at_, size_t(word_end - at_))) + " is no number");
        }
        if (is_range) value = std::strtod(std::string(at_, end).c_str(), nullptr);  // 0, infinite
        at_ = end;
        return value;
    }

    const char* at_;
    const char* end_;
    PlyEncoding encoding_;
    const std::string& where_;
};

// What a property of a vertex means.
enum Role {
    kX,
    kY,
    kZ,
    kNx,
    kNy,
    kNz,
    kU,
    kV,
    kRed,
    kGreen,
    kBlue,
    kAlpha,
    kRoles,
    kNone = kRoles
};

Role roleOf(const PlyProperty& property) {
    if (property.is_list) return kNone;
    struct Name {
        const char* text;
        Role role;
    };
    constexpr std::array<Name, 26> kNames = {{
        {"x", kX},
        {"y", kY},
        {"z", kZ},
        {"nx", kNx},
        {"ny", kNy},
        {"nz", kNz},
        {"normal_x", kNx},
        {"normal_y", kNy},
        {"normal_z", kNz},
        {"u", kU},
        {"v", kV},
        {"s", kU},
        {"t", kV},
        {"texture_u", kU},
        {"texture_v", kV},
        {"red", kRed},
        {"green", kGreen},
        {"blue", kBlue},
        {"alpha", kAlpha},
        {"r", kRed},
        {"g", kGreen},
        {"b", kBlue},
        {"a", kAlpha},
        {"diffuse_red", kRed},
        {"diffuse_green", kGreen},
        {"diffuse_blue", kBlue},
    }};
    for (const Name& name : kNames) {
        if (property.name == name.text) return name.role;
    }
    return kNone;
}

// Colours of integers count from 0 to their type's largest value.
double colorScale(PlyType type) {
    switch (type) {
        case PlyType::kUint16:
            return 1.0 / 65535.0;
        case PlyType::kFloat32:
        case PlyType::kFloat64:
            return 1.0;
        default:
            return 1.0 / 255.0;
    }
}

void readVertices(PlyValues& values, const PlyElement& element, LoadContext& context,
                  PlyContents& out) {
    std::array<bool, kRoles + 1> has{};
    std::vector<Role> roles;
    std::vector<double> scales;
    for (const PlyProperty& p : element.properties) {
        roles.push_back(roleOf(p));
        scales.push_back(roles.back() >= kRed && roles.back() <= kAlpha ? colorScale(p.type) : 1.0);
        has[roles.back()] = true;
    }
    if (!has[kX] || !has[kY] || !has[kZ]) values.fail(element, 0, "has no x, y and z");
    const bool has_normals = has[kNx] && has[kNy] && has[kNz], has_uvs = has[kU] && has[kV],
               has_colors = has[kRed] && has[kGreen] && has[kBlue];
    for (uint64_t i = 0; i < element.count; ++i) {
        if (i % 65536 == 0) context.throwIfCancelled();
        std::array<double, kRoles + 1> v{};
        v[kAlpha] = 1.0;
        for (size_t k = 0; k < roles.size(); ++k) {
            const PlyProperty& p = element.properties[k];
            if (p.is_list) {
                for (uint64_t n = values.nextCount(p, element, i); n > 0; --n)
                    values.next(p.type, element, i);
            } else {
                v[roles[k]] = values.next(p.type, element, i) * scales[k];
            }
        }
        out.positions.emplace_back(v[kX], v[kY], v[kZ]);
        if (has_normals) {
            const Vec3 n(v[kNx], v[kNy], v[kNz]);
            out.normals.push_back(isFinite(DVec3(n)) ? n : Vec3(0.0f));
        }
        if (has_uvs) {
            const Vec2 uv(v[kU], 1.0 - v[kV]);  // v points up in PLY files
            out.uvs.push_back(std::isfinite(uv.x) && std::isfinite(uv.y) ? uv : Vec2(0.0f));
        }
        if (has_colors) {
            const auto linear = [](double c) {
                return c > 0.0 ? linearFromSrgb(float(std::min(c, 1.0))) : 0.0f;  // NaN: 0
            };
            out.colors.emplace_back(linear(v[kRed]), linear(v[kGreen]), linear(v[kBlue]),
                                    v[kAlpha] > 0.0 ? float(std::min(v[kAlpha], 1.0)) : 0.0f);
        }
    }
}

// A strip as polygons of three corners; -1 starts another.
void addStrip(const std::vector<int64_t>& strip, PlyContents& out) {
    size_t start = 0;
    for (size_t i = 0; i < strip.size(); ++i) {
        if (strip[i] == -1) {
            start = i + 1;
        } else if (i >= start + 2) {
            const size_t turn = (i - start) % 2;  // every second triangle turns the other way round
            for (const size_t k : {i - 2, i - 1 + turn, i - turn})
                out.corners.push_back(uint32_t(strip[k]));
            out.sizes.push_back(3);
        }
    }
}

// Faces or strips: their list of indices; n_vertices: indices are below.
void readFaces(PlyValues& values, const PlyElement& element, uint64_t n_vertices, bool are_strips,
               LoadContext& context, const std::string& where, PlyContents& out) {
    std::vector<int64_t> list;
    bool has_list = false;
    for (uint64_t i = 0; i < element.count; ++i) {
        if (i % 65536 == 0) context.throwIfCancelled();
        for (const PlyProperty& p : element.properties) {
            if (!p.is_list) {
                values.next(p.type, element, i);
                continue;
            }
            const uint64_t n = values.nextCount(p, element, i);
            const bool is_wanted = p.name == "vertex_indices" || p.name == "vertex_index";
            if (!is_wanted) {
                for (uint64_t k = 0; k < n; ++k) values.next(p.type, element, i);
                continue;
            }
            has_list = true;
            list.clear();
            for (uint64_t k = 0; k < n; ++k) {
                const double index = values.next(p.type, element, i);
                const bool is_restart = are_strips && index == -1.0;
                if (!is_restart && !(index >= 0.0 && index < double(n_vertices))) {
                    values.fail(element, i,
                                "index " + std::to_string(int64_t(std::clamp(index, -1e15, 1e15))) +
                                    ", but there are " + std::to_string(n_vertices) + " vertices");
                }
                list.push_back(int64_t(index));
            }
            context.budget.take(double(n) * kBytesPerTriangle, where,
                                std::to_string(n) + " corners");
            if (are_strips) {
                addStrip(list, out);
            } else if (n >= 3) {
                out.corners.insert(out.corners.end(), list.begin(), list.end());
                out.sizes.push_back(uint32_t(n));
            }
        }
    }
    out.has_faces |= has_list;
}

PlyContents readContents(std::string_view bytes, const PlyHeader& header, const std::string& where,
                         LoadContext& context) {
    uint64_t n_vertices = 0;
    int n_vertex_elements = 0;
    for (const PlyElement& element : header.elements) {
        if (element.name == "vertex") n_vertices = element.count, ++n_vertex_elements;
    }
    if (n_vertex_elements != 1)
        throw Error(ErrorCode::kParse, where, "has not one element \"vertex\"");
    PlyContents contents;
    PlyValues values(bytes, header, where);
    for (const PlyElement& element : header.elements) {
        const uint64_t least = values.leastSize(element);
        if (least == 0 && element.name != "vertex") continue;
        if (least > 0 && element.count > values.bytesLeft() / least) {
            values.fail(element, element.count,
                        "does not fit into the " + std::to_string(values.bytesLeft()) +
                            " bytes that are left");
        }
        if (element.name == "vertex") {
            context.budget.take(double(element.count) * 2.0 * kBytesPerVertex, where,
                                std::to_string(element.count) + " vertices");
            readVertices(values, element, context, contents);
        } else if (element.name == "face" || element.name == "tristrips") {
            readFaces(values, element, n_vertices, element.name == "tristrips", context, where,
                      contents);
        } else {
            for (uint64_t i = 0; i < element.count; ++i) {
                for (const PlyProperty& p : element.properties) {
                    uint64_t n = p.is_list ? values.nextCount(p, element, i) : 1;
                    for (; n > 0; --n) values.next(p.type, element, i);
                }
            }
        }
    }
    return contents;
}

// Triangles of the polygons; those of vertices that are not finite are left out.
void addPolygons(PlyContents& contents, Mesh& mesh, const std::string& where,
                 LoadContext& context) {
    constexpr float kMaxCoordinate = 1e15f;  // areas stay finite
    std::vector<uint8_t> is_lost(contents.positions.size(), 0);
    for (size_t i = 0; i < is_lost.size(); ++i) {
        Vec3& p = contents.positions[i];
        is_lost[i] = !(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= kMaxCoordinate);
        if (is_lost[i]) p = Vec3(0.0f);
    }
    size_t n_lost = 0, at = 0;
    for (const uint32_t size : contents.sizes) {
        const std::span<const uint32_t> polygon(contents.corners.data() + at, size);
        at += size;
        if (std::any_of(polygon.begin(), polygon.end(), [&](uint32_t v) { return is_lost[v]; })) {
            ++n_lost;
        } else {
            triangulatePolygon(contents.positions, polygon, mesh.triangles);
        }
    }
    if (n_lost > 0) {
        context.warnOnce(
            where, std::to_string(n_lost) + " faces are left out: their vertices are not finite");
    }
    mesh.positions = std::move(contents.positions);
    for (Vec3& n : contents.normals) {
        const double length = glm::length(DVec3(n));
        n = length > 1e-12 && length < 1e30 ? Vec3(DVec3(n) / length) : Vec3(0.0f);
    }
    mesh.normals = std::move(contents.normals);
    mesh.uvs = std::move(contents.uvs);
    mesh.colors = std::move(contents.colors);
}

void addPoints(PlyContents& contents, Mesh& mesh, const std::string& where, LoadContext& context) {
    const PointDiscs discs = makePointDiscs(contents.positions, contents.normals, context, where);
    mesh.is_cloud = true;
    mesh.positions = discs.corners;
    mesh.triangles = discs.triangles;
    mesh.colors = perCorner(discs, contents.colors);
    mesh.uvs = perCorner(discs, contents.uvs);
}

// Georeferenced positions are so far from the origin that single precision rounds them.
void warnIfCoarse(const PlyContents& contents, const std::string& where, LoadContext& context) {
    Box3 bounds;
    for (const Vec3& p : contents.positions) {
        if (glm::length(DVec3(p)) < 1e15) bounds.extend(p);
    }
    if (bounds.isEmpty()) return;
    const Vec3 most = glm::max(glm::abs(bounds.min), glm::abs(bounds.max));
    const double step = double(std::max({most.x, most.y, most.z})) * 0x1p-23;
    constexpr double kMostShare = 1e-4;  // of the diagonal
    if (step <= kMostShare * glm::length(DVec3(bounds.extent()))) return;
    std::ostringstream text;
    text.precision(3);
    text << "positions are rounded to about " << step
         << " m: they are single precision and far from the origin, take away their offset first";
    context.warnOnce(where, text.str());
}

}  // namespace

ChildRef loadPly(const std::filesystem::path& path, const std::string& name, Scene& scene,
                 LoadContext& context) {
    const std::string where = oneLine(name, 300);
    const std::string bytes = readFile(path, context.budget, where);
    const PlyHeader header = parsePlyHeader(bytes, where);
    PlyContents contents = readContents(bytes, header, where, context);
    warnIfCoarse(contents, where, context);

    Material material;
    material.name = "default";
    material.double_sided = true;
    if (!header.texture_file.empty() && !contents.uvs.empty()) {
        const auto file = resolvePath(context, folderOf(path.string()), header.texture_file, where);
        material.base_texture = addTexture(scene, file, true, true, context,
                                           where + ": " + inQuotes(header.texture_file));
    }
    if (!contents.colors.empty() || material.base_texture != kNoTexture)
        material.base_color = Vec3(1.0f);

    Mesh mesh;
    mesh.name = oneLine(path.stem().string());
    if (contents.has_faces) {
        addPolygons(contents, mesh, where, context);
    } else {
        addPoints(contents, mesh, where, context);
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    return addModel(scene, std::move(mesh), {std::move(material)}, where);
}

}  // namespace stipple
