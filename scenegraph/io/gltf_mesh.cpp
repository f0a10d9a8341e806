// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/gltf_mesh.h>

#include <scenegraph/io/gltf_primitive.h>
#include <scenegraph/io/point_discs.h>

#include <algorithm>
#include <numeric>

namespace stipple {

namespace {

constexpr float kMaxCoordinate = 1e15f;  // areas and volumes stay finite

// One primitive of the file, read attribute by attribute.
class PrimitiveReader {
public:
    PrimitiveReader(const GltfDocument& document, const tinygltf::Primitive& source,
                    const std::string& path)
        : document_(document), source_(source), path_(path) {
        if (source.extensions.count("KHR_draco_mesh_compression"))
            draco_ = decodeDraco(document, source, path);
    }

    bool has(const std::string& name) const { return source_.attributes.count(name) != 0; }

    // Attribute `name`, which must have `n` elements; empty if there is none.
    template <class V>
    std::vector<V> read(const std::string& name, std::initializer_list<int> types, float fill,
                        size_t n) const {
        const auto it = source_.attributes.find(name);
        if (it == source_.attributes.end()) return {};
        const std::string place = path_ + ".attributes." + name;
        if (const DracoAttribute* a = decoded(name)) {
            if (types.size() == 1 && a->components != V::length())
                document_.fail(ErrorCode::kInvalidScene, place, "has the wrong type for this");
            std::vector<V> result(draco_->vertex_count, V(fill));
            const int given = std::min(a->components, int(V::length()));
            for (size_t i = 0; i < result.size(); ++i) {
                for (int c = 0; c < given; ++c) result[i][c] = a->values[i * a->components + c];
            }
            return result;
        }
        return readVectors<V>(document_, it->second, types, fill, n, place);
    }

    size_t vertexCount() const {
        const std::string place = path_ + ".attributes.POSITION";
        const int index = source_.attributes.at("POSITION");
        if (decoded("POSITION")) return draco_->vertex_count;
        return accessorCount(document_, index, {TINYGLTF_TYPE_VEC3}, place);
    }
    size_t indexCount(size_t n_vertices) const {
        if (draco_) return draco_->indices.size();
        if (source_.indices < 0) return n_vertices;
        return accessorCount(document_, source_.indices, {TINYGLTF_TYPE_SCALAR},
                             path_ + ".indices");
    }
    std::vector<uint32_t> indices(size_t n_vertices) {
        if (draco_) return std::move(draco_->indices);
        std::vector<uint32_t> result;
        if (source_.indices < 0) {
            result.resize(n_vertices);
            std::iota(result.begin(), result.end(), 0u);
            return result;
        }
        result = readIndices(document_, source_.indices, path_ + ".indices");
        for (const uint32_t index : result) {
            if (index >= n_vertices) {
                document_.fail(ErrorCode::kInvalidScene, path_ + ".indices",
                               "index " + std::to_string(index) + " >= vertex count " +
                                   std::to_string(n_vertices));
            }
        }
        return result;
    }

private:
    const DracoAttribute* decoded(const std::string& name) const {
        if (!draco_) return nullptr;
        const auto it = draco_->attributes.find(name);
        return it == draco_->attributes.end() ? nullptr : &it->second;
    }

    const GltfDocument& document_;
    const tinygltf::Primitive& source_;
    std::string path_;
    std::optional<DracoPrimitive> draco_;
};

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

Vec3 faceNormal(const GltfPrimitive& p, const UVec3& t) {
    const DVec3 a(p.positions[t.x]), b(p.positions[t.y]), c(p.positions[t.z]);
    const DVec3 n = glm::cross(b - a, c - a);
    const double length = glm::length(n);
    return length > 0.0 ? Vec3(n / length) : Vec3(0, 1, 0);
}

// Unit normals; where the file has a null vector the mean of the faces around takes its place.
void normalize(GltfPrimitive& p) {
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
void makeFlat(GltfPrimitive& p) {
    std::vector<Vec3> normals;
    normals.reserve(p.triangles.size() * 3);
    for (const UVec3& t : p.triangles) normals.insert(normals.end(), 3, faceNormal(p, t));
    p.forEachArray([&](auto& values) {
        auto expanded = values;
        expanded.clear();
        expanded.reserve(p.triangles.size() * 3);
        for (const UVec3& t : p.triangles) {
            for (int c = 0; c < 3; ++c) expanded.push_back(values[t[c]]);
        }
        values = std::move(expanded);
    });
    p.normals = std::move(normals);
    for (size_t t = 0; t < p.triangles.size(); ++t)
        p.triangles[t] = uint32_t(t * 3) + UVec3(0, 1, 2);
}

// Points that the indices name become discs with the points' attributes; normals are the discs'.
void makeDiscs(GltfPrimitive& p, const std::vector<uint32_t>& indices, LoadContext& context,
               const std::string& where) {
    p.forEachArray([&](auto& values) {
        auto picked = values;
        picked.resize(indices.size());
        for (size_t i = 0; i < indices.size(); ++i) picked[i] = values[indices[i]];
        values = std::move(picked);
    });
    const PointDiscs discs = makePointDiscs(p.positions, p.normals, context, where);
    p.positions = discs.corners;
    p.triangles = discs.triangles;
    p.normals.clear();
    p.colors = perCorner(discs, p.colors);
    for (auto& layer : p.uvs) layer = perCorner(discs, layer);
}

std::optional<GltfPrimitive> loadPrimitive(const GltfDocument& document,
                                           const tinygltf::Primitive& source, const GltfPose& pose,
                                           GltfMaterials& materials, const std::string& path) {
    LoadContext& context = document.context;
    const bool is_points = source.mode == TINYGLTF_MODE_POINTS;
    if (source.mode < TINYGLTF_MODE_TRIANGLES && !is_points) {
        context.warnOnce(document.name, "lines are skipped");
        return std::nullopt;
    }
    if (!source.attributes.count("POSITION")) {
        context.warnOnce(document.name, "primitives without positions are skipped");
        return std::nullopt;
    }
    PrimitiveReader reader(document, source, path);
    const size_t n = reader.vertexCount(), n_indices = reader.indexCount(n);
    const double n_triangles = is_points                                ? 0.0
                               : source.mode == TINYGLTF_MODE_TRIANGLES ? double(n_indices / 3)
                                                                        : double(n_indices);
    context.budget.take(double(n) * kBytesPerVertex + n_triangles * kBytesPerTriangle,
                        document.where(path),
                        std::to_string(n) + " vertices and " +
                            std::to_string(uint64_t(n_triangles)) + " triangles");

    GltfPrimitive p;
    p.positions = reader.read<Vec3>("POSITION", {TINYGLTF_TYPE_VEC3}, 0.0f, n);
    checkPositions(document, p.positions, path + ".attributes.POSITION");
    const std::vector<uint32_t> indices = reader.indices(n);
    if (!is_points) p.triangles = assemble(indices, source.mode);
    if (source.mode == TINYGLTF_MODE_TRIANGLES && indices.size() % 3) {
        context.warnOnce(document.name, path + ": the last " + std::to_string(indices.size() % 3) +
                                            " indices are no triangle");
    }

    const GltfMaterial& material = materials.get(source.material, is_points, path + ".material");
    p.material = material.index;
    p.normals = reader.read<Vec3>("NORMAL", {TINYGLTF_TYPE_VEC3}, 0.0f, n);
    if (material.needs_tangents && !p.normals.empty()) {
        p.tangents = reader.read<Vec4>("TANGENT", {TINYGLTF_TYPE_VEC4}, 1.0f, n);
    }
    p.colors = reader.read<Vec4>("COLOR_0", {TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4}, 1.0f, n);
    for (Vec4& color : p.colors) color = glm::max(color, Vec4(0.0f));
    for (const GltfUvLayer& layer : material.uv_layers) {
        const std::string set = "TEXCOORD_" + std::to_string(layer.texcoord);
        p.uvs.push_back(reader.read<Vec2>(set, {TINYGLTF_TYPE_VEC2}, 0.0f, n));
        if (p.uvs.back().empty())
            context.warnOnce(document.name, path + " is textured, but has no " + set);
        for (Vec2& uv : p.uvs.back()) uv = layer.apply(uv);
    }
    applyPose(document, source, pose, path, p);
    if (is_points) {
        makeDiscs(p, indices, context, document.where(path));
    } else if (!p.normals.empty()) {
        normalize(p);
    }
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

void checkPositions(const GltfDocument& document, const std::vector<Vec3>& positions,
                    const std::string& place) {
    for (const Vec3& v : positions) {
        if (!(std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}) <= kMaxCoordinate)) {
            document.fail(ErrorCode::kInvalidScene, place, "a coordinate is beyond 1e15");
        }
    }
}

Mesh loadGltfMesh(const GltfDocument& document, int index, const GltfPose& pose,
                  GltfMaterials& materials) {
    const tinygltf::Mesh& source = document.model.meshes[index];
    const std::string path = "meshes[" + std::to_string(index) + "]";
    Mesh mesh;
    mesh.name = source.name.empty() ? path : source.name;
    std::vector<GltfPrimitive> primitives;
    mesh.is_cloud = true;  // if nothing but points is in it
    for (size_t i = 0; i < source.primitives.size(); ++i) {
        document.context.throwIfCancelled();
        const std::string primitive_path = path + ".primitives[" + std::to_string(i) + "]";
        auto p = loadPrimitive(document, source.primitives[i], pose, materials, primitive_path);
        if (!p || p->triangles.empty()) continue;
        mesh.is_cloud = mesh.is_cloud && source.primitives[i].mode == TINYGLTF_MODE_POINTS;
        primitives.push_back(std::move(*p));
    }
    mesh.is_cloud = mesh.is_cloud && !primitives.empty();
    const bool any_normals = std::any_of(primitives.begin(), primitives.end(),
                                         [](const auto& p) { return !p.normals.empty(); });
    for (GltfPrimitive& p : primitives) {
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
        appendAttribute(mesh.tangents, p.tangents, before, n, Vec4(0.0f));
        appendAttribute(mesh.colors, p.colors, before, n, Vec4(1.0f));
        if (!p.uvs.empty()) mesh.more_uvs.resize(std::max(mesh.more_uvs.size(), p.uvs.size() - 1));
        p.uvs.resize(mesh.more_uvs.size() + 1);
        appendAttribute(mesh.uvs, p.uvs[0], before, n, Vec2(0.0f));
        for (size_t layer = 1; layer < p.uvs.size(); ++layer)
            appendAttribute(mesh.more_uvs[layer - 1], p.uvs[layer], before, n, Vec2(0.0f));
        mesh.positions.insert(mesh.positions.end(), p.positions.begin(), p.positions.end());
        for (const UVec3& t : p.triangles) mesh.triangles.push_back(t + uint32_t(before));
        mesh.triangle_material.resize(mesh.triangles.size(), p.material);
        p = GltfPrimitive();
    }
    return mesh;
}

}  // namespace stipple
