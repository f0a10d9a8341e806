// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/visible_area.h>

#include <core/rng.h>
#include <scenegraph/surface_at.h>

#include <cmath>
#include <numeric>

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

bool hidesItself(const Mesh& mesh) {
    // So few triangles hide little of each other; a mesh of so many (a terrain) is seldom a plant,
    // and measuring it takes time and memory.
    constexpr size_t kFewTriangles = 64, kManyTriangles = 400000;
    return !mesh.is_patch && mesh.triangles.size() >= kFewTriangles &&
           mesh.triangles.size() <= kManyTriangles;
}

float SpacingTable::at(float spacing) const {
    const float octave = std::clamp(std::log2(spacing / first_spacing), 0.0f, kOctaves - 1.001f);
    const size_t i = size_t(octave);
    return factors[i] + (factors[i + 1] - factors[i]) * (octave - float(i));
}

namespace {

constexpr int kLargestGrid = 256;  // cells along a side
constexpr uint32_t kNoTriangle = 0xffffffffu;

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

// Sum of what is covered where points lie a block apart and cover squares of that size. `factor`
// of the points are drawn that one layer of surface asks for. Points of a stratified list on one
// layer keep away from each other: about (1 - 0.4 a)^2.5 of the places where a layer has `a` of
// them in reach are missed by all, not exp(-a); layers behind each other are independent.
double coveredBy(float factor, const std::vector<float>& layers, bool is_one_layer) {
    double covered = 0.0;
    const float layer = -2.5f * std::log(1.0f - 0.4f * factor);
    constexpr size_t kRun = 256;
    for (size_t k = 0; k < layers.size(); k += kRun) {
        const size_t end = std::min(layers.size(), k + kRun);
        float sum = 0.0f;
        if (is_one_layer) {
            for (size_t i = k; i < end; ++i) {
                const float open = std::max(1.0f - factor / 3.0f * layers[i], 0.0f);
                sum += 1.0f - open * open * open;
            }
        } else {
            for (size_t i = k; i < end; ++i) sum += 1.0f - expMinus(layer * layers[i]);
        }
        covered += double(sum);
    }
    return covered;
}

// The factor between low and high with which `target` is covered. What is covered grows with it,
// less and less.
float solveFactor(const std::vector<float>& layers, bool is_one_layer, double target, float low,
                  float high) {
    double at_low = target - coveredBy(low, layers, is_one_layer),
           at_high = target - coveredBy(high, layers, is_one_layer);
    if (at_low <= 0.0) return low;
    if (at_high >= 0.0) return high;
    for (int i = 0; i < 5 && at_low > 0.0; ++i) {
        const float factor = low + (high - low) * float(at_low / (at_low - at_high));
        const double at_factor = target - coveredBy(factor, layers, is_one_layer);
        (at_factor > 0.0 ? low : high) = factor;
        (at_factor > 0.0 ? at_low : at_high) = at_factor;
    }
    return at_low > 0.0 ? low + (high - low) * float(at_low / (at_low - at_high)) : low;
}

// A disc's width is four times its area over its outline; along the cells, the outline is longer.
constexpr float kWidth = 16.0f / 3.14159265f;

float patchWidthOf(const Grid& grid) {
    const auto isCovered = [&](int x, int y) {
        return x >= 0 && y >= 0 && x < grid.width && y < grid.height &&
               grid.front[size_t(y) * size_t(grid.width) + size_t(x)] != kNoTriangle;
    };
    uint64_t area = 0, outline = 0;
    for (int y = 0; y <= grid.height; ++y) {
        for (int x = 0; x <= grid.width; ++x) {
            const bool here = isCovered(x, y);
            area += here;
            outline += (here != isCovered(x - 1, y)) + (here != isCovered(x, y - 1));
        }
    }
    return outline > 0 ? kWidth * float(area) / float(outline) * grid.cell : 0.0f;
}

// Where gaps are much finer than the points' distances, what is covered is statistics. Wider gaps
// are left to the points' footprints, which know patches by themselves: in a crown points fall
// behind each other, too, so that it takes more (fitted to the coverage of single trees of four
// species, 14 to 48 subpixels high, at K = 0.3 to 12). By the ratio of the patch's width to the
// distance:
constexpr float kFineGaps = 0.8f, kWideGaps = 1.5f;
constexpr float kLeastVisible = 1.18f, kMostVisible = 2.0f;

void measureFactors(const Grid& grid, VisibleArea& result) {
    result.visible_factor.first_spacing = result.whole_factor.first_spacing = grid.cell;
    Density density;
    density.width = grid.width, density.height = grid.height;
    for (size_t i = 0; i < grid.front.size(); ++i) {
        density.whole.push_back(float(grid.layers[i]));
        density.visible.push_back(grid.front[i] != kNoTriangle ? 1.0f : 0.0f);
    }
    constexpr int kWidestWindow = 4;
    float whole_factor = 1.0f, visible_factor = 1.0f, spacing = grid.cell;
    for (int octave = 0, window = 1; octave < SpacingTable::kOctaves; ++octave, spacing *= 2.0f) {
        if (density.width * density.height > 1) {
            const std::vector<float> whole = windowMeans(density, density.whole, window),
                                     visible = windowMeans(density, density.visible, window);
            const double target = std::accumulate(visible.begin(), visible.end(), 0.0);
            whole_factor = solveFactor(whole, false, target, 0.0f, whole_factor);
            const float fine = (kWideGaps - result.patch_width / spacing) / (kWideGaps - kFineGaps);
            visible_factor = kLeastVisible;
            if (fine > 0.0f)
                visible_factor +=
                    std::min(fine, 1.0f) *
                    (solveFactor(visible, true, target, 1.0f, kMostVisible) - kLeastVisible);
        }
        result.whole_factor.factors[size_t(octave)] = whole_factor;
        result.visible_factor.factors[size_t(octave)] = visible_factor;
        if (window < kWidestWindow) {
            window *= 2;
        } else {
            density = halved(density);
        }
    }
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
    const double cell_area = double(grid.cell) * double(grid.cell);
    VisibleArea result;
    result.cumulative.reserve(cells.size() + 1);
    result.cumulative.push_back(0.0f);
    uint64_t before = 0;
    for (const uint32_t n : cells)
        result.cumulative.push_back(float(cell_area * double(before += n)));
    result.patch_width = patchWidthOf(grid);
    measureFactors(grid, result);
    uint64_t layers = 0;
    for (const uint16_t n : grid.layers) layers += n;
    if (covered > 0) result.layers = float(double(layers) / double(covered));
    return result;
}

}  // namespace stipple
