// SPDX-License-Identifier: Apache-2.0
// Builds the octree over a mesh: connected patches, strata, Morton order, nodes, distribution list.
#include <scenegraph/mesh.h>

#include <core/error.h>
#include <core/material.h>
#include <scenegraph/morton.h>

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <tuple>

namespace stipple {

namespace {

constexpr uint32_t kLeafTriangles = 64;

Error sceneError(const std::string& where, const std::string& message) {
    return Error(ErrorCode::kInvalidScene, where, message);
}

void checkArrays(const Mesh& mesh, size_t n_materials, const std::string& where) {
    const size_t n = mesh.positions.size();
    if ((!mesh.normals.empty() && mesh.normals.size() != n) ||
        (!mesh.uvs.empty() && mesh.uvs.size() != n) ||
        (!mesh.colors.empty() && mesh.colors.size() != n) ||
        (!mesh.tangents.empty() && mesh.tangents.size() != n) ||
        std::any_of(mesh.more_uvs.begin(), mesh.more_uvs.end(),
                    [&](const auto& layer) { return !layer.empty() && layer.size() != n; }) ||
        mesh.triangle_material.size() != mesh.triangles.size()) {
        throw sceneError(where, "vertex arrays differ in length");
    }
    for (size_t i = 0; i < n; ++i) {
        if (!isFinite(DVec3(mesh.positions[i]))) {
            throw sceneError(where, "position " + std::to_string(i) + " is not finite");
        }
    }
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
        const UVec3& v = mesh.triangles[t];
        const uint32_t largest = std::max({v.x, v.y, v.z});
        if (largest >= n) {
            throw sceneError(where, "triangle " + std::to_string(t) + ": index " +
                                        std::to_string(largest) + " >= vertex count " +
                                        std::to_string(n));
        }
        if (mesh.triangle_material[t] >= n_materials) {
            throw sceneError(where, "triangle " + std::to_string(t) + ": material " +
                                        std::to_string(mesh.triangle_material[t]) +
                                        " >= material count " + std::to_string(n_materials));
        }
    }
}

// Its length is the triangle's area.
DVec3 areaVector(const Mesh& mesh, const UVec3& t) {
    const DVec3 a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
    return 0.5 * glm::cross(b - a, c - a);
}

double triangleArea(const Mesh& mesh, const UVec3& t) { return glm::length(areaVector(mesh, t)); }

struct DisjointSets {
    std::vector<uint32_t> parent;
    explicit DisjointSets(size_t n) : parent(n) { std::iota(parent.begin(), parent.end(), 0u); }
    uint32_t find(uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    }
    void join(uint32_t a, uint32_t b) { parent[find(a)] = find(b); }
};

// Vertices at the same position count as one: uv seams and flat shading duplicate them. Returns the
// vertex that stands for each.
std::vector<uint32_t> joinVertices(const Mesh& mesh) {
    const size_t n = mesh.positions.size();
    std::vector<uint32_t> order(n), same(n);
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](uint32_t v) {
        const Vec3& p = mesh.positions[v];
        return std::tie(p.x, p.y, p.z);
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
    for (size_t i = 0; i < n; ++i) {
        same[order[i]] =
            i > 0 && key(order[i]) == key(order[i - 1]) ? same[order[i - 1]] : order[i];
    }
    return same;
}

// What is measured of a connected patch.
struct Patch {
    double area = 0.0;
    double boundary = 0.0;  // length of the edges that only one triangle has
    Box3 bounds;

    // Width of the flat strip with that area and boundary; of a tube with that area and length
    // where there is hardly a boundary.
    double width() const {
        const double length = glm::length(DVec3(bounds.extent()));
        const double strip = boundary > 0.0 ? 4.0 * area / boundary : 1e300;
        return strip < length ? strip : area / (kPi * std::max(length, 1e-30));
    }
};

// Width of the connected patch that each triangle belongs to.
std::vector<double> patchWidths(const Mesh& mesh, const std::vector<double>& areas) {
    const std::vector<uint32_t> same = joinVertices(mesh);
    DisjointSets sets(mesh.positions.size());
    std::vector<std::pair<uint32_t, uint32_t>> edges;
    edges.reserve(mesh.triangles.size() * 3);
    for (const UVec3& t : mesh.triangles) {
        sets.join(same[t.x], same[t.y]);
        sets.join(same[t.x], same[t.z]);
        for (int k = 0; k < 3; ++k) edges.push_back(std::minmax(same[t[k]], same[t[(k + 1) % 3]]));
    }
    std::vector<Patch> patches(mesh.positions.size());
    for (size_t t = 0; t < areas.size(); ++t) {
        Patch& patch = patches[sets.find(same[mesh.triangles[t].x])];
        patch.area += areas[t];
        for (int k = 0; k < 3; ++k) patch.bounds.extend(mesh.positions[mesh.triangles[t][k]]);
    }
    std::sort(edges.begin(), edges.end());
    for (size_t i = 0; i < edges.size();) {
        size_t end = i + 1;
        while (end < edges.size() && edges[end] == edges[i]) ++end;
        if (end == i + 1) {
            patches[sets.find(edges[i].first)].boundary += glm::distance(
                DVec3(mesh.positions[edges[i].first]), DVec3(mesh.positions[edges[i].second]));
        }
        i = end;
    }
    std::vector<double> result(mesh.triangles.size());
    for (size_t t = 0; t < areas.size(); ++t)
        result[t] = patches[sets.find(same[mesh.triangles[t].x])].width();
    return result;
}

// Area class of the slides' "additional classification by triangle area": a factor of 4 each.
int areaClass(double area) { return int(std::floor(0.5 * std::log2(std::max(area, 1e-30)))); }

struct StratumKey {
    bool double_sided, masked, blended;
    int patch_class, triangle_class;
    bool operator<(const StratumKey& o) const {
        return std::tie(double_sided, masked, blended, patch_class, triangle_class) <
               std::tie(o.double_sided, o.masked, o.blended, o.patch_class, o.triangle_class);
    }
};

// Numbers the strata: one a key, the sparsest merged into a neighbour until they are few.
std::map<StratumKey, uint8_t> chooseStrata(const std::map<StratumKey, uint32_t>& histogram,
                                           size_t n_triangles) {
    struct Entry {
        uint32_t count;
        std::vector<StratumKey> keys;
    };
    std::vector<Entry> entries;
    for (const auto& [key, count] : histogram) entries.push_back({count, {key}});
    const auto mergeable = [](const Entry& a, const Entry& b) {
        return a.keys[0].double_sided == b.keys[0].double_sided &&
               a.keys[0].masked == b.keys[0].masked && a.keys[0].blended == b.keys[0].blended;
    };
    while (entries.size() > 1) {
        size_t best = entries.size();
        for (size_t i = 0; i + 1 < entries.size(); ++i) {
            if (!mergeable(entries[i], entries[i + 1])) continue;
            if (best == entries.size() || entries[i].count + entries[i + 1].count <
                                              entries[best].count + entries[best + 1].count) {
                best = i;
            }
        }
        if (best == entries.size()) break;
        const uint32_t smaller = std::min(entries[best].count, entries[best + 1].count);
        if (entries.size() <= size_t(kMaxStrata) && smaller * 20 > n_triangles) break;
        entries[best].count += entries[best + 1].count;
        auto& keys = entries[best].keys;
        keys.insert(keys.end(), entries[best + 1].keys.begin(), entries[best + 1].keys.end());
        entries.erase(entries.begin() + best + 1);
    }
    std::map<StratumKey, uint8_t> result;
    for (size_t i = 0; i < entries.size(); ++i) {
        for (const StratumKey& key : entries[i].keys) result[key] = uint8_t(i);
    }
    return result;
}

class OctreeBuilder {
public:
    OctreeBuilder(Mesh& mesh, const std::vector<uint64_t>& codes) : mesh_(mesh), codes_(codes) {}

    void build() {
        mesh_.nodes.clear();
        mesh_.nodes.push_back({});
        const uint32_t n = uint32_t(mesh_.triangles.size());
        const uint8_t first = n ? mesh_.triangle_stratum.front() : 0;
        if (n == 0 || mesh_.triangle_stratum.back() == first) {
            fill(0, 0, n, 0, first);
            return;
        }
        // Several strata: the root's children are their roots.
        std::vector<std::pair<uint32_t, uint32_t>> ranges;
        for (uint32_t begin = 0; begin < n;) {
            const uint8_t s = mesh_.triangle_stratum[begin];
            uint32_t end = begin;
            while (end < n && mesh_.triangle_stratum[end] == s) ++end;
            ranges.emplace_back(begin, end);
            begin = end;
        }
        const uint32_t first_child = addChildren(ranges.size());
        for (size_t i = 0; i < ranges.size(); ++i) {
            fill(first_child + uint32_t(i), ranges[i].first, ranges[i].second, 0,
                 mesh_.triangle_stratum[ranges[i].first]);
        }
        finishInner(0, first_child, uint8_t(ranges.size()), 0, n, kMixedStratum);
    }

private:
    uint32_t addChildren(size_t count) {
        const uint32_t first = uint32_t(mesh_.nodes.size());
        mesh_.nodes.resize(first + count);
        return first;
    }

    void finishInner(uint32_t index, uint32_t first_child, uint8_t count, uint32_t begin,
                     uint32_t end, uint8_t stratum) {
        MeshNode node;
        node.first_triangle = begin;
        node.triangle_count = end - begin;
        node.first_child = first_child;
        node.child_count = count;
        node.stratum = stratum;
        cones_.clear();
        for (uint32_t c = first_child; c < first_child + count; ++c) {
            cones_.push_back({mesh_.nodes[c].normals, mesh_.nodes[c].area});
            node.bounds.extend(mesh_.nodes[c].bounds);
            node.max_triangle_area =
                std::max(node.max_triangle_area, mesh_.nodes[c].max_triangle_area);
        }
        node.normals = surroundingCone(cones_);
        node.area = mesh_.cumulative_area[end] - mesh_.cumulative_area[begin];
        mesh_.nodes[index] = node;
    }

    // Makes nodes[index] the node over sorted triangles [begin, end), whose codes agree above
    // `level`.
    void fill(uint32_t index, uint32_t begin, uint32_t end, int level, uint8_t stratum) {
        if (end - begin <= kLeafTriangles || level == kMortonLevels) {
            MeshNode node;
            node.first_triangle = begin;
            node.triangle_count = end - begin;
            node.stratum = stratum;
            cones_.clear();
            for (uint32_t t = begin; t < end; ++t) {
                const UVec3& v = mesh_.triangles[t];
                for (int k = 0; k < 3; ++k) node.bounds.extend(mesh_.positions[v[k]]);
                // Not from the cumulated sums, in which small triangles beside large ones vanish.
                const DVec3 n = areaVector(mesh_, v);
                const double area = glm::length(n);
                node.max_triangle_area = std::max(node.max_triangle_area, float(area));
                cones_.push_back({{Vec3(n / area), 1.0f}, area});
            }
            node.normals = surroundingCone(cones_);
            node.area = mesh_.cumulative_area[end] - mesh_.cumulative_area[begin];
            mesh_.nodes[index] = node;
            return;
        }
        const int shift = 3 * (kMortonLevels - 1 - level);
        std::vector<std::pair<uint32_t, uint32_t>> ranges;
        for (uint32_t b = begin; b < end;) {
            const uint64_t cell = codes_[b] >> shift;
            uint32_t e = b;
            while (e < end && codes_[e] >> shift == cell) ++e;
            ranges.emplace_back(b, e);
            b = e;
        }
        if (ranges.size() == 1) return fill(index, begin, end, level + 1, stratum);
        const uint32_t first_child = addChildren(ranges.size());
        for (size_t i = 0; i < ranges.size(); ++i) {
            fill(first_child + uint32_t(i), ranges[i].first, ranges[i].second, level + 1, stratum);
        }
        finishInner(index, first_child, uint8_t(ranges.size()), begin, end, stratum);
    }

    Mesh& mesh_;
    const std::vector<uint64_t>& codes_;
    std::vector<WeightedCone> cones_;
};

}  // namespace

void buildMesh(Mesh& mesh, const std::vector<Material>& materials, const std::string& where) {
    checkArrays(mesh, materials.size(), where);

    // Zero-area triangles cannot be seen; they would only upset the lists.
    std::vector<double> areas;
    size_t kept = 0;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
        const double area = triangleArea(mesh, mesh.triangles[t]);
        if (!(area > 0.0)) continue;
        if (!std::isfinite(area))
            throw sceneError(where, "triangle " + std::to_string(t) + " has no finite area");
        mesh.triangles[kept] = mesh.triangles[t];
        mesh.triangle_material[kept++] = mesh.triangle_material[t];
        areas.push_back(area);
    }
    mesh.triangles.resize(kept);
    mesh.triangle_material.resize(kept);

    const std::vector<double> patches = patchWidths(mesh, areas);
    std::vector<StratumKey> keys(kept);
    std::map<StratumKey, uint32_t> histogram;
    for (size_t t = 0; t < kept; ++t) {
        const Material& m = materials[mesh.triangle_material[t]];
        keys[t] = {m.double_sided, m.alpha_mode != AlphaMode::kOpaque,
                   m.alpha_mode == AlphaMode::kBlend, areaClass(patches[t] * patches[t]),
                   areaClass(areas[t])};
        ++histogram[keys[t]];
    }
    const std::map<StratumKey, uint8_t> strata = chooseStrata(histogram, kept);

    mesh.bounds = Box3();
    for (const UVec3& t : mesh.triangles) {
        for (int k = 0; k < 3; ++k) mesh.bounds.extend(mesh.positions[t[k]]);
    }
    const DVec3 extent = kept ? DVec3(mesh.bounds.extent()) : DVec3(1.0);
    const double side = std::max({extent.x, extent.y, extent.z, 1e-30});

    std::vector<uint64_t> codes(kept);
    std::vector<uint8_t> stratum(kept);
    for (size_t t = 0; t < kept; ++t) {
        const UVec3& v = mesh.triangles[t];
        const DVec3 centroid =
            (DVec3(mesh.positions[v.x]) + DVec3(mesh.positions[v.y]) + DVec3(mesh.positions[v.z])) /
            3.0;
        codes[t] = mortonCode(centroid, DVec3(mesh.bounds.min), side);
        stratum[t] = strata.at(keys[t]);
    }
    std::vector<uint32_t> order(kept);
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        return std::tie(stratum[a], codes[a], a) < std::tie(stratum[b], codes[b], b);
    });
    const auto permuted = [&](const auto& v) {
        auto r = v;
        for (size_t i = 0; i < kept; ++i) r[i] = v[order[i]];
        return r;
    };
    mesh.triangles = permuted(mesh.triangles);
    mesh.triangle_material = permuted(mesh.triangle_material);
    codes = permuted(codes);
    areas = permuted(areas);
    mesh.triangle_stratum = permuted(stratum);
    const std::vector<double> sorted_patches = permuted(patches);
    const std::vector<StratumKey> sorted_keys = permuted(keys);

    mesh.cumulative_area.assign(kept + 1, 0.0);
    mesh.strata.assign(kept ? mesh.triangle_stratum.back() + 1u : 1u, {});
    std::vector<double> stratum_area(mesh.strata.size(), 0.0),
        stratum_patch(mesh.strata.size(), 0.0);
    for (size_t t = 0; t < kept; ++t) {
        mesh.cumulative_area[t + 1] = mesh.cumulative_area[t] + areas[t];
        const uint8_t s = mesh.triangle_stratum[t];
        Stratum& out = mesh.strata[s];
        out.max_triangle_area = std::max(out.max_triangle_area, float(areas[t]));
        out.double_sided = sorted_keys[t].double_sided;
        out.masked = sorted_keys[t].masked;
        out.blended = sorted_keys[t].blended;
        stratum_area[s] += areas[t];
        stratum_patch[s] += areas[t] * sorted_patches[t];
    }
    for (size_t s = 0; s < mesh.strata.size(); ++s) {
        if (stratum_area[s] > 0.0)
            mesh.strata[s].patch_width = float(stratum_patch[s] / stratum_area[s]);
    }
    mesh.area = mesh.cumulative_area.back();
    OctreeBuilder(mesh, codes).build();
    mesh.source_bounds = mesh.surfels ? mesh.surfels->bounds : mesh.bounds;
    const auto extendBy = [&](const Box3& box) {
        if (!box.isEmpty()) mesh.bounds.extend(box.min), mesh.bounds.extend(box.max);
    };
    if (mesh.surfels) extendBy(mesh.surfels->drawn_bounds);
    for (const MeshPatch& patch : mesh.patches) extendBy(patch.bounds);
    mesh.nodes[0].bounds = mesh.bounds;
}

size_t Mesh::bytes() const {
    size_t more_uv_bytes = 0;
    for (const auto& layer : more_uvs) more_uv_bytes += layer.size() * sizeof(Vec2);
    const size_t surfel_bytes = surfels ? surfels->bytes() : 0;
    return surfel_bytes + more_uv_bytes + tangents.size() * sizeof(Vec4) +
           positions.size() * sizeof(Vec3) + normals.size() * sizeof(Vec3) +
           uvs.size() * sizeof(Vec2) + colors.size() * sizeof(Vec4) +
           triangles.size() * (sizeof(UVec3) + sizeof(uint16_t) + sizeof(uint8_t)) +
           nodes.size() * sizeof(MeshNode) + cumulative_area.size() * sizeof(double);
}

}  // namespace stipple
