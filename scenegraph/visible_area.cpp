// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/visible_area.h>

#include <core/rng.h>
#include <scenegraph/surface_at.h>

#include <cmath>

namespace stipple {

int directionIndex(const Vec3& d) {
    const int octant = (d.x < 0.0f) | (d.y < 0.0f) << 1 | (d.z < 0.0f) << 2;
    const float half = 0.5f * (std::abs(d.x) + std::abs(d.y) + std::abs(d.z));
    const int part = std::abs(d.x) > half   ? 0
                     : std::abs(d.y) > half ? 1
                     : std::abs(d.z) > half ? 2
                                            : 3;
    return octant * 4 + part;
}

Vec3 directionOf(int index) {
    Vec3 d(1.0f);
    if (index % 4 < 3) d[index % 4] = 4.0f;
    for (int axis = 0; axis < 3; ++axis) {
        if (index >> (2 + axis) & 1) d[axis] = -d[axis];
    }
    return glm::normalize(d);
}

float WholeShare::at(const std::array<float, kOctaves>& shares, float spacing) const {
    const float octave = std::clamp(std::log2(spacing / first_spacing), 0.0f, kOctaves - 1.001f);
    const int i = int(octave);
    return shares[size_t(i)] + (shares[size_t(i) + 1] - shares[size_t(i)]) * (octave - float(i));
}

namespace {

constexpr int kLargestGrid = 256;  // cells along a side
constexpr uint32_t kNoTriangle = 0xffffffffu;
// Edge-on triangles have few cells for much area: their share is taken no larger than this much.
constexpr float kSmallestCosine = 0.08f;

// The mesh as seen from a direction, cell by cell.
struct Grid {
    int width = 0, height = 0;
    float cell = 1.0f;             // object space, m
    std::vector<float> depth;      // of the nearest
    std::vector<uint32_t> front;   // triangle; kNoTriangle where there is nothing
    std::vector<uint16_t> layers;  // triangles, one behind the other
};

// Orthonormal: x and y span the grid, z points to the eye.
Mat3 gridFromObject(const Vec3& direction) {
    const Vec3 z = glm::normalize(direction);
    const Vec3 other = std::abs(z.y) < 0.9f ? Vec3(0, 1, 0) : Vec3(1, 0, 0);
    const Vec3 x = glm::normalize(glm::cross(other, z));
    return glm::transpose(Mat3(x, glm::cross(z, x), z));
}

class GridDrawer {
public:
    GridDrawer(const Mesh& mesh, const std::vector<Material>& materials,
               const std::vector<Texture>& textures, const Vec3& direction)
        : mesh_(mesh),
          materials_(materials),
          textures_(textures),
          grid_from_object_(gridFromObject(direction)) {}

    Grid draw() {
        points_.reserve(mesh_.positions.size());
        Box3 bounds;
        for (const Vec3& p : mesh_.positions) points_.push_back(grid_from_object_ * p);
        for (const UVec3& t : mesh_.triangles) {
            for (int k = 0; k < 3; ++k) bounds.extend(points_[t[k]]);
        }
        const Vec3 extent = bounds.extent();
        // About two cells a triangle, in front of each other or side by side.
        const float side =
            std::clamp(std::sqrt(float(mesh_.triangles.size())), 16.0f, float(kLargestGrid));
        grid_.cell = std::max({extent.x, extent.y, 1e-30f}) / side;
        grid_.width = std::max(1, int(std::ceil(extent.x / grid_.cell)));
        grid_.height = std::max(1, int(std::ceil(extent.y / grid_.cell)));
        const size_t cells = size_t(grid_.width) * size_t(grid_.height);
        grid_.depth.assign(cells, -kInfinity);
        grid_.front.assign(cells, kNoTriangle);
        grid_.layers.assign(cells, 0);
        for (Vec3& p : points_) p = (p - bounds.min) / grid_.cell;
        for (uint32_t t = 0; t < mesh_.triangles.size(); ++t) drawTriangle(t);
        return std::move(grid_);
    }

private:
    void drawTriangle(uint32_t t) {
        const UVec3& index = mesh_.triangles[t];
        const Vec3 a = points_[index.x], b = points_[index.y], c = points_[index.z];
        const float area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
        const Stratum& stratum = mesh_.strata[mesh_.triangle_stratum[t]];
        if (area == 0.0f || (area < 0.0f && !stratum.double_sided)) return;
        const auto firstCell = [](float lo) { return std::max(0, int(std::ceil(lo - 0.5f))); };
        const auto endCell = [](float hi, int n) {
            return std::min(n, int(std::floor(hi - 0.5f)) + 1);
        };
        const int x0 = firstCell(std::min({a.x, b.x, c.x})),
                  x1 = endCell(std::max({a.x, b.x, c.x}), grid_.width);
        const int y0 = firstCell(std::min({a.y, b.y, c.y})),
                  y1 = endCell(std::max({a.y, b.y, c.y}), grid_.height);
        if (x0 >= x1 || y0 >= y1) return;
        const float ux = (c.y - a.y) / area, uy = (a.x - c.x) / area;
        const float vx = (a.y - b.y) / area, vy = (b.x - a.x) / area;
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x) {
                const float px = float(x) + 0.5f - a.x, py = float(y) + 0.5f - a.y;
                const float u = px * ux + py * uy, v = px * vx + py * vy;
                if (u < 0.0f || v < 0.0f || u + v > 1.0f) continue;
                const size_t i = size_t(y) * size_t(grid_.width) + size_t(x);
                if (stratum.masked && !isThere(t, u, v, i)) continue;
                if (grid_.layers[i] < 0xffff) ++grid_.layers[i];
                const float depth = a.z + (b.z - a.z) * u + (c.z - a.z) * v;
                if (depth > grid_.depth[i]) grid_.depth[i] = depth, grid_.front[i] = t;
            }
        }
    }

    bool isThere(uint32_t t, float u, float v, size_t cell) const {
        const Material& material = materials_[mesh_.triangle_material[t]];
        const float alpha = alphaAt(mesh_, materials_, textures_, t, u, v);
        return material.alpha_mode == AlphaMode::kMask ? alpha >= material.alpha_cutoff
                                                       : uniformFloat(hashCombine(t, cell)) < alpha;
    }

    const Mesh& mesh_;
    const std::vector<Material>& materials_;
    const std::vector<Texture>& textures_;
    const Mat3 grid_from_object_;
    std::vector<Vec3> points_;  // grid space: cells
    Grid grid_;
};

// Layers of surface on average, over blocks of cells.
struct Density {
    int width = 0, height = 0;
    std::vector<float> whole, visible;

    size_t at(int x, int y) const { return size_t(y) * size_t(width) + size_t(x); }
};

Density halved(const Density& d) {
    Density r;
    r.width = (d.width + 1) / 2, r.height = (d.height + 1) / 2;
    r.whole.assign(size_t(r.width) * size_t(r.height), 0.0f);
    r.visible = r.whole;
    for (int y = 0; y < d.height; ++y) {
        for (int x = 0; x < d.width; ++x) {
            r.whole[r.at(x / 2, y / 2)] += 0.25f * d.whole[d.at(x, y)];
            r.visible[r.at(x / 2, y / 2)] += 0.25f * d.visible[d.at(x, y)];
        }
    }
    return r;
}

// Means over window x window blocks, at every place where they touch the picture.
std::vector<float> windowMeans(const Density& d, const std::vector<float>& values, int window) {
    const int width = d.width + window - 1, height = d.height + window - 1;
    std::vector<float> rows(size_t(width) * size_t(d.height), 0.0f),
        means(size_t(width) * size_t(height), 0.0f);
    for (int y = 0; y < d.height; ++y) {
        for (int x = 0; x < d.width; ++x) {
            for (int k = 0; k < window; ++k)
                rows[size_t(y) * size_t(width) + size_t(x + k)] += values[d.at(x, y)];
        }
    }
    const float share = 1.0f / float(window * window);
    for (int y = 0; y < d.height; ++y) {
        for (int k = 0; k < window; ++k) {
            for (int x = 0; x < width; ++x)
                means[size_t(y + k) * size_t(width) + size_t(x)] +=
                    share * rows[size_t(y) * size_t(width) + size_t(x)];
        }
    }
    return means;
}

// exp(-x) for x >= 0, within 1e-5; vectorizes.
inline float expMinus(float x) {
    const float y = x * 0.125f, odd = 0.5f * y, even = 1.0f + y * y * (1.0f / 12.0f);
    const float root = std::max(even - odd, 0.0f) / (even + odd);
    const float squared = root * root, fourth = squared * squared;
    return fourth * fourth;
}

// The share of the whole surface's points with which the mesh covers as much as it should, where
// points lie `window` blocks apart and cover squares of that size. Points of a stratified list on
// one layer of surface keep away from each other: about (1 - 0.4 a)^2.5 of the places where a layer
// has `a` of them in reach are missed by all, not exp(-a); layers behind each other are
// independent.
float solveShare(const std::vector<float>& whole, const std::vector<float>& visible,
                 bool with_visible) {
    double should = 0.0;
    for (const float v : visible) should += double(v);
    // What is covered grows with the share, less and less.
    const auto missing = [&](float share) {
        double covered = 0.0;
        const float layer = -2.5f * std::log(1.0f - 0.4f * share),
                    rest = with_visible ? 0.4f * (1.0f - share) : 0.0f;
        constexpr size_t kRun = 256;
        for (size_t k = 0; k < whole.size(); k += kRun) {
            const size_t end = std::min(whole.size(), k + kRun);
            float sum = 0.0f;
            for (size_t i = k; i < end; ++i) {
                const float open = 1.0f - rest * visible[i];
                sum += 1.0f - open * open * std::sqrt(open) * expMinus(layer * whole[i]);
            }
            covered += double(sum);
        }
        return should - covered;
    };
    float low = 0.0f, high = 1.0f;
    double at_low = missing(low), at_high = missing(high);
    if (at_high >= 0.0) return 1.0f;
    for (int i = 0; i < 5 && at_low > 0.0; ++i) {
        const float share = low + (high - low) * float(at_low / (at_low - at_high));
        const double at_share = missing(share);
        (at_share > 0.0 ? low : high) = share;
        (at_share > 0.0 ? at_low : at_high) = at_share;
    }
    return at_low > 0.0 ? low + (high - low) * float(at_low / (at_low - at_high)) : low;
}

WholeShare measureWholeShare(const Grid& grid) {
    WholeShare result;
    result.first_spacing = grid.cell;
    Density density;
    density.width = grid.width, density.height = grid.height;
    for (size_t i = 0; i < grid.front.size(); ++i) {
        density.whole.push_back(float(grid.layers[i]));
        density.visible.push_back(grid.front[i] != kNoTriangle ? 1.0f : 0.0f);
    }
    constexpr int kWidestWindow = 4;
    float with_visible = 1.0f, alone = 1.0f;
    for (int octave = 0, window = 1; octave < WholeShare::kOctaves; ++octave) {
        if (density.width * density.height > 1) {
            const std::vector<float> whole = windowMeans(density, density.whole, window),
                                     visible = windowMeans(density, density.visible, window);
            with_visible = std::min(with_visible, solveShare(whole, visible, true));
            alone = std::min(alone, solveShare(whole, visible, false));
        }
        result.with_visible[size_t(octave)] = with_visible;
        result.alone[size_t(octave)] = alone;
        if (window < kWidestWindow) {
            window *= 2;
        } else {
            density = halved(density);
        }
    }
    return result;
}

}  // namespace

VisibleArea measureVisibleArea(const Mesh& mesh, const std::vector<Material>& materials,
                               const std::vector<Texture>& textures, const Vec3& direction) {
    const Grid grid = GridDrawer(mesh, materials, textures, direction).draw();
    std::vector<uint32_t> cells(mesh.triangles.size(), 0);
    uint64_t covered = 0;
    for (const uint32_t t : grid.front) {
        if (t == kNoTriangle) continue;
        ++cells[t];
        ++covered;
    }
    const Vec3 to_eye = glm::normalize(direction);
    std::vector<double> visible(mesh.triangles.size(), 0.0);
    double projected = 0.0;
    for (size_t t = 0; t < visible.size(); ++t) {
        if (cells[t] == 0) continue;
        const UVec3& v = mesh.triangles[t];
        const Vec3 n = glm::cross(mesh.positions[v.y] - mesh.positions[v.x],
                                  mesh.positions[v.z] - mesh.positions[v.x]);
        const float cosine = std::abs(glm::dot(n, to_eye)) / std::max(glm::length(n), 1e-30f);
        visible[t] = double(cells[t]) / double(std::max(cosine, kSmallestCosine));
        projected += visible[t] * double(cosine);
    }
    // Together they cover what was found covered.
    const double cell_area = double(grid.cell) * double(grid.cell);
    const double scale = projected > 0.0 ? cell_area * double(covered) / projected : 0.0;
    VisibleArea result;
    result.cumulative.reserve(visible.size() + 1);
    double sum = 0.0;
    result.cumulative.push_back(0.0f);
    for (const double v : visible) result.cumulative.push_back(float(sum += scale * v));
    result.whole_share = measureWholeShare(grid);
    uint64_t layers = 0;
    for (const uint16_t n : grid.layers) layers += n;
    if (covered > 0) result.layers = float(double(layers) / double(covered));
    return result;
}

}  // namespace stipple
