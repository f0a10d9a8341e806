// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/gltf_mesh.h>

#include <algorithm>
#include <numeric>
#include <optional>

namespace stipple {

namespace {

constexpr float kMaxCoordinate = 1e15f;  // areas and volumes stay finite

struct Primitive {
    std::vector<Vec3> positions, normals;  // normals may be empty
    std::vector<Vec2> uvs;                 // may be empty
    std::vector<Vec4> colors;              // may be empty
    std::vector<UVec3> triangles;
    uint16_t material = 0;
};

template <class V>
std::vector<V> asVectors(const std::vector<float>& values) {
    std::vector<V> result(values.size() / V::length());
    for (size_t i = 0; i < result.size(); ++i) {
        for (int c = 0; c < V::length(); ++c) result[i][c] = values[i * V::length() + c];
    }
    return result;
}

// Attribute `name` as vectors, empty if the primitive has none. Throws if it has another count than
// `n_vertices`.
template <class V>
std::vector<V> readAttribute(const GltfDocument& document, const tinygltf::Primitive& primitive,
                             const std::string& name, std::initializer_list<int> types, float fill,
                             size_t n_vertices, const std::string& path) {
    const auto it = primitive.attributes.find(name);
    if (it == primitive.attributes.end()) return {};
    const std::string place = path + ".attributes." + name;
    const size_t count = accessorCount(document, it->second, types, place);
    if (count != n_vertices) {
        document.fail(
            ErrorCode::kInvalidScene, place,
            "count " + std::to_string(count) + ", but POSITION has " + std::to_string(n_vertices));
    }
    return asVectors<V>(readFloats(document, it->second, V::length(), fill, place));
}

// Triangles of a list, strip or fan of indices. In a strip every second triangle turns the other
// way round.
std::vector<UVec3> assemble(const std::vector<uint32_t>& i, int mode) {
    std::vector<UVec3> triangles;
    if (mode == TINYGLTF_MODE_TRIANGLES) {
        triangles.reserve(i.size() / 3);
        for (size_t t = 0; t + 2 < i.size(); t += 3)
            triangles.emplace_back(i[t], i[t + 1], i[t + 2]);
        return triangles;
    }
    for (size_t t = 0; t + 2 < i.size(); ++t) {
        if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
            triangles.emplace_back(i[t], i[t + 1 + t % 2], i[t + 2 - t % 2]);
        } else {
            triangles.emplace_back(i[t + 1], i[t + 2], i[0]);
        }
    }
    return triangles;
}

Vec3 faceNormal(const Primitive& p, const UVec3& t) {
    const DVec3 a(p.positions[t.x]), b(p.positions[t.y]), c(p.positions[t.z]);
    const DVec3 n = glm::cross(b - a, c - a);
    const double length = glm::length(n);
    return length > 0.0 ? Vec3(n / length) : Vec3(0, 1, 0);
}

// Unit normals; where the file has a null vector the mean of the faces around takes its place.
void normalize(Primitive& p) {
    std::vector<uint8_t> is_null(p.normals.size(), 0);
    bool any_null = false;
    for (size_t i = 0; i < p.normals.size(); ++i) {
        const double length = glm::length(DVec3(p.normals[i]));
        is_null[i] = !(length > 1e-12);
        any_null |= bool(is_null[i]);
        p.normals[i] = is_null[i] ? Vec3(0.0f) : Vec3(DVec3(p.normals[i]) / length);
    }
    if (!any_null) return;
    for (const UVec3& t : p.triangles) {
        for (int c = 0; c < 3; ++c) {
            if (is_null[t[c]]) p.normals[t[c]] += faceNormal(p, t);
        }
    }
    for (size_t i = 0; i < p.normals.size(); ++i) {
        if (!is_null[i]) continue;
        const float length = glm::length(p.normals[i]);
        p.normals[i] = length > 1e-6f ? p.normals[i] / length : Vec3(0, 1, 0);
    }
}

// Gives every triangle its own vertices, with its flat normal.
void makeFlat(Primitive& p) {
    Primitive flat;
    flat.material = p.material;
    for (const UVec3& t : p.triangles) {
        const uint32_t first = uint32_t(flat.positions.size());
        for (int c = 0; c < 3; ++c) {
            flat.positions.push_back(p.positions[t[c]]);
            flat.normals.push_back(faceNormal(p, t));
            if (!p.uvs.empty()) flat.uvs.push_back(p.uvs[t[c]]);
            if (!p.colors.empty()) flat.colors.push_back(p.colors[t[c]]);
        }
        flat.triangles.emplace_back(first, first + 1, first + 2);
    }
    p = std::move(flat);
}

std::optional<Primitive> loadPrimitive(const GltfDocument& document,
                                       const tinygltf::Primitive& source, GltfMaterials& materials,
                                       const std::string& path) {
    LoadContext& context = document.context;
    if (source.mode < TINYGLTF_MODE_TRIANGLES) {
        context.warnOnce(document.name, "points and lines are skipped");
        return std::nullopt;
    }
    const auto position = source.attributes.find("POSITION");
    if (position == source.attributes.end()) {
        context.warnOnce(document.name, "primitives without positions are skipped");
        return std::nullopt;
    }
    if (!source.targets.empty()) context.warnOnce(document.name, "morph targets are ignored");

    const std::string position_path = path + ".attributes.POSITION";
    const size_t n = accessorCount(document, position->second, {TINYGLTF_TYPE_VEC3}, position_path);
    const size_t n_indices =
        source.indices < 0
            ? n
            : accessorCount(document, source.indices, {TINYGLTF_TYPE_SCALAR}, path + ".indices");
    const double n_triangles =
        source.mode == TINYGLTF_MODE_TRIANGLES ? double(n_indices / 3) : double(n_indices);
    context.budget.take(double(n) * kBytesPerVertex + n_triangles * kBytesPerTriangle,
                        document.where(path),
                        std::to_string(n) + " vertices and " +
                            std::to_string(uint64_t(n_triangles)) + " triangles");

    Primitive p;
    p.positions = asVectors<Vec3>(readFloats(document, position->second, 3, 0.0f, position_path));
    for (const Vec3& v : p.positions) {
        if (std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}) > kMaxCoordinate) {
            document.fail(ErrorCode::kInvalidScene, position_path, "a coordinate is beyond 1e15");
        }
    }
    std::vector<uint32_t> indices;
    if (source.indices >= 0) {
        indices = readIndices(document, source.indices, path + ".indices");
        for (uint32_t index : indices) {
            if (index >= n) {
                document.fail(
                    ErrorCode::kInvalidScene, path + ".indices",
                    "index " + std::to_string(index) + " >= vertex count " + std::to_string(n));
            }
        }
    } else {
        indices.resize(n);
        std::iota(indices.begin(), indices.end(), 0u);
    }
    if (source.mode == TINYGLTF_MODE_TRIANGLES && indices.size() % 3) {
        context.warnOnce(document.name, path + ": the last " + std::to_string(indices.size() % 3) +
                                            " indices are no triangle");
    }
    p.triangles = assemble(indices, source.mode);

    const GltfMaterial& material = materials.get(source.material, path + ".material");
    p.material = material.index;
    p.normals =
        readAttribute<Vec3>(document, source, "NORMAL", {TINYGLTF_TYPE_VEC3}, 0.0f, n, path);
    p.colors = readAttribute<Vec4>(document, source, "COLOR_0",
                                   {TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4}, 1.0f, n, path);
    for (Vec4& color : p.colors) color = glm::max(color, Vec4(0.0f));
    if (material.base_texture.is_textured) {
        const std::string set = "TEXCOORD_" + std::to_string(material.base_texture.texcoord);
        p.uvs = readAttribute<Vec2>(document, source, set, {TINYGLTF_TYPE_VEC2}, 0.0f, n, path);
        if (p.uvs.empty())
            context.warnOnce(document.name, path + " is textured, but has no " + set);
        for (Vec2& uv : p.uvs) uv = material.base_texture.apply(uv);
    }
    if (!p.normals.empty()) normalize(p);
    return p;
}

// Appends `from` to `to`, which has `n_before` elements where it is not empty; missing elements
// become `fill`.
template <class V>
void appendAttribute(std::vector<V>& to, const std::vector<V>& from, size_t n_before, size_t n_new,
                     const V& fill) {
    if (to.empty() && from.empty()) return;
    to.resize(n_before, fill);
    to.insert(to.end(), from.begin(), from.end());
    to.resize(n_before + n_new, fill);
}

}  // namespace

Mesh loadGltfMesh(const GltfDocument& document, int index, GltfMaterials& materials) {
    const tinygltf::Mesh& source = document.model.meshes[index];
    const std::string path = "meshes[" + std::to_string(index) + "]";
    Mesh mesh;
    mesh.name = source.name.empty() ? path : source.name;
    std::vector<Primitive> primitives;
    for (size_t i = 0; i < source.primitives.size(); ++i) {
        document.context.throwIfCancelled();
        const std::string primitive_path = path + ".primitives[" + std::to_string(i) + "]";
        auto p = loadPrimitive(document, source.primitives[i], materials, primitive_path);
        if (p && !p->triangles.empty()) primitives.push_back(std::move(*p));
    }
    const bool any_normals = std::any_of(primitives.begin(), primitives.end(),
                                         [](const auto& p) { return !p.normals.empty(); });
    for (Primitive& p : primitives) {
        if (any_normals && p.normals.empty()) {
            document.context.budget.take(double(p.triangles.size()) * 3.0 * kBytesPerVertex,
                                         document.where(path), "flat normals");
            makeFlat(p);
        }
        const size_t before = mesh.positions.size(), n = p.positions.size();
        if (before + n > std::numeric_limits<uint32_t>::max()) {
            document.fail(ErrorCode::kUnsupported, path, "more than 2^32 vertices");
        }
        appendAttribute(mesh.normals, p.normals, before, n, Vec3(0, 1, 0));
        appendAttribute(mesh.uvs, p.uvs, before, n, Vec2(0.0f));
        appendAttribute(mesh.colors, p.colors, before, n, Vec4(1.0f));
        mesh.positions.insert(mesh.positions.end(), p.positions.begin(), p.positions.end());
        for (const UVec3& t : p.triangles) mesh.triangles.push_back(t + uint32_t(before));
        mesh.triangle_material.resize(mesh.triangles.size(), p.material);
        p = Primitive();
    }
    return mesh;
}

}  // namespace stipple
