// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <scenegraph/procedural/uv_grid.h>
#include <scenegraph/procedural/uv_grid_lattice.h>

#include <array>
#include <tuple>
#include <unordered_map>

namespace stipple {

namespace {

constexpr int kCurvedCells = 128;  // along curved sides, without tables
constexpr double kMostTriangles = 5e7;
// An edge is halved where two of its quarters differ by this much of its length: where it bends by
// more than about 30 degrees, or one part is stretched twice as much as another.
constexpr double kMostDifference = 0.2;

class UvGridBuilder {
public:
    UvGridBuilder(const UvGridParams& params, const GridLattice& us, const GridLattice& vs,
                  ThreadPool& pool)
        : params_(params),
          us_(us),
          vs_(vs),
          pool_(pool),
          surface_(params, DVec2(us.finestStep(), vs.finestStep())) {}

    void makeCells() {
        const size_t columns = size_t(us_.cellCount()) + 1, rows = size_t(vs_.cellCount()) + 1;
        const int step = us_.stepsPerCell();
        reserve(2.0 * double(columns - 1) * double(rows - 1));
        vertices_.resize(columns * rows);
        for (size_t k = 0; k < vertices_.size(); ++k)
            vertices_[k] = {int(k % columns) * step, int(k / columns) * step};
        positions_.resize(vertices_.size());
        forEachVertex([&](size_t k) { positions_[k] = positionAt(vertices_[k]); });
        triangles_.reserve(2 * (columns - 1) * (rows - 1));
        for (size_t j = 0; j + 1 < rows; ++j) {
            for (size_t i = 0; i + 1 < columns; ++i) {
                const uint32_t a = uint32_t(j * columns + i), b = a + 1, d = a + uint32_t(columns),
                               c = d + 1;
                addQuad({a, b, c, d}, triangles_);
            }
        }
    }

    void refine() {
        // The edges need about as much memory as their triangles will.
        const double before = double(triangles_.size());
        reserve(before);
        std::unordered_map<uint64_t, uint32_t> middles;  // by edge; kNone: it is not halved
        std::vector<UVec3> finer;
        finer.reserve(triangles_.size());
        const auto middleOf = [&](uint32_t a, uint32_t b) {
            const auto [it, is_new] = middles.try_emplace(edgeOf(a, b), kNone);
            if (is_new) it->second = halve(a, b);
            return it->second;
        };
        for (const UVec3& t : triangles_) {
            std::array<uint32_t, 3> corner{t.x, t.y, t.z}, middle;
            for (int k = 0; k < 3; ++k) middle[k] = middleOf(corner[k], corner[(k + 1) % 3]);
            split(corner, middle, finer);
            if (double(finer.size()) > kMostTriangles) {
                throw Error(ErrorCode::kInvalidArgument, "",
                            "refined to more than " + std::to_string(size_t(kMostTriangles)) +
                                " triangles");
            }
        }
        reserve(std::max(double(finer.size()) - 2.0 * before, 0.0));
        triangles_.swap(finer);
    }

    GridStretch measureStretch() const {
        std::vector<DVec3> base(vertices_.size());
        forEachVertex([&](size_t k) {
            const Lattice& at = vertices_[k];
            base[k] = surface_.base(us_.at(at.i), vs_.at(at.j));
        });
        double whole = 0.0;
        for (const UVec3& t : triangles_) whole += doubleArea(base, t);
        const double tiny = 1e-9 * whole / double(std::max<size_t>(triangles_.size(), 1));
        struct Side {
            uint64_t edge;
            float stretch;
        };
        std::vector<Side> sides;
        sides.reserve(3 * triangles_.size());
        for (const UVec3& t : triangles_) {
            const double flat = doubleArea(base, t);
            if (!(flat > tiny)) continue;
            // What is compressed does not pull apart.
            const float stretch = float(std::max(doubleArea(positions_, t) / flat, 1.0));
            for (int k = 0; k < 3; ++k) sides.push_back({edgeOf(t[k], t[(k + 1) % 3]), stretch});
        }
        parallelSort(pool_, sides, [](const Side& a, const Side& b) {
            return std::tie(a.edge, a.stretch) < std::tie(b.edge, b.stretch);
        });
        GridStretch result;
        size_t n_edges = 0, n_stretched = 0;
        for (size_t i = 0; i + 1 < sides.size(); ++i) {
            if (sides[i].edge != sides[i + 1].edge) continue;
            const double ratio = double(sides[i + 1].stretch) / double(sides[i].stretch);
            ++n_edges, n_stretched += ratio > kMostStretch;
            if (ratio <= result.most) continue;
            result.most = ratio;
            const Lattice& at = vertices_[size_t(sides[i].edge >> 32)];
            result.u = us_.at(at.i), result.v = vs_.at(at.j);
        }
        result.share = double(n_stretched) / double(std::max<size_t>(n_edges, 1));
        return result;
    }

    // is_detailed: for makeDetailNormals().
    Mesh finish(bool is_detailed) {
        const size_t n = vertices_.size();
        const bool has_tangents = params_.has_normal_map || is_detailed;
        Mesh mesh;
        mesh.positions.resize(n), mesh.normals.resize(n), mesh.uvs.resize(n);
        if (has_tangents) mesh.tangents.resize(n);
        if (is_detailed) mesh.more_uvs.emplace_back(n);
        forEachVertex([&](size_t k) {
            const Lattice& at = vertices_[k];
            DVec3 tangent;
            mesh.positions[k] = Vec3(positions_[k]);
            mesh.normals[k] = Vec3(surface_.normal(us_.at(at.i), vs_.at(at.j), tangent));
            const DVec2 uv(us_.unwrapped(at.i), 1.0 - vs_.unwrapped(at.j));
            mesh.uvs[k] = Vec2(uv * params_.texture_repeat);
            if (is_detailed) mesh.more_uvs[0][k] = Vec2(uv);
            if (has_tangents) mesh.tangents[k] = Vec4(Vec3(tangent), 1.0f);
        });
        mesh.triangles = std::move(triangles_);
        mesh.triangle_material.assign(mesh.triangles.size(), 0);
        return mesh;
    }

private:
    static constexpr uint32_t kNone = UINT32_MAX;
    struct Lattice {
        int i = 0, j = 0;
    };

    void reserve(double triangles) const {
        if (params_.reserve) params_.reserve(triangles);
    }
    template <class Body>
    void forEachVertex(const Body& body) const {
        constexpr size_t kRun = 4096;
        pool_.forEach((vertices_.size() + kRun - 1) / kRun, [&](size_t run, int) {
            const size_t end = std::min((run + 1) * kRun, vertices_.size());
            for (size_t k = run * kRun; k < end; ++k) body(k);
        });
    }
    DVec3 positionAt(const Lattice& at) const {
        return surface_.position(us_.at(at.i), vs_.at(at.j));
    }
    static uint64_t edgeOf(uint32_t a, uint32_t b) {
        return uint64_t(std::min(a, b)) << 32 | std::max(a, b);
    }
    static double doubleArea(const std::vector<DVec3>& positions, const UVec3& t) {
        return glm::length(
            glm::cross(positions[t.y] - positions[t.x], positions[t.z] - positions[t.x]));
    }

    // Along the shorter diagonal: ridges stay ridges.
    void addQuad(const std::array<uint32_t, 4>& q, std::vector<UVec3>& out) const {
        if (glm::distance(positions_[q[0]], positions_[q[2]]) <=
            glm::distance(positions_[q[1]], positions_[q[3]])) {
            out.push_back(UVec3(q[0], q[1], q[2]));
            out.push_back(UVec3(q[0], q[2], q[3]));
        } else {
            out.push_back(UVec3(q[1], q[2], q[3]));
            out.push_back(UVec3(q[1], q[3], q[0]));
        }
    }

    // The new vertex in the middle of an edge whose parts differ too much. Depends on the edge
    // alone, and on both sides of a seam it is the same.
    uint32_t halve(uint32_t a, uint32_t b) {
        const Lattice from = vertices_[a], to = vertices_[b];
        DVec3 at[5] = {positions_[a], {}, {}, {}, positions_[b]};
        for (int k = 1; k < 4; ++k) {
            const double share = 0.25 * k;
            at[k] = surface_.position(us_.at(from.i + (to.i - from.i) * share),
                                      vs_.at(from.j + (to.j - from.j) * share));
        }
        double difference = 0.0;
        for (int k = 0; k < 4; ++k) {
            for (int l = 0; l < k; ++l) {
                difference =
                    std::max(difference, glm::length((at[k + 1] - at[k]) - (at[l + 1] - at[l])));
            }
        }
        if (!(difference > kMostDifference * glm::distance(at[0], at[4]))) return kNone;
        vertices_.push_back({(from.i + to.i) / 2, (from.j + to.j) / 2});
        positions_.push_back(at[2]);
        return uint32_t(vertices_.size() - 1);
    }

    void split(const std::array<uint32_t, 3>& c, const std::array<uint32_t, 3>& m,
               std::vector<UVec3>& out) const {
        const int n = int(m[0] != kNone) + int(m[1] != kNone) + int(m[2] != kNone);
        if (n == 0) {
            out.push_back(UVec3(c[0], c[1], c[2]));
        } else if (n == 3) {
            for (int k = 0; k < 3; ++k) out.push_back(UVec3(c[k], m[k], m[(k + 2) % 3]));
            out.push_back(UVec3(m[0], m[1], m[2]));
        } else {
            // The first of the halved edges of which the one before is not.
            int k = 0;
            while (m[k] == kNone || m[(k + 2) % 3] != kNone) ++k;
            const uint32_t a = c[k], b = c[(k + 1) % 3], top = c[(k + 2) % 3], ab = m[k],
                           b_top = m[(k + 1) % 3];
            if (n == 1) {
                out.push_back(UVec3(a, ab, top));
                out.push_back(UVec3(ab, b, top));
            } else {
                out.push_back(UVec3(ab, b, b_top));
                addQuad({a, ab, b_top, top}, out);
            }
        }
    }

    const UvGridParams& params_;
    const GridLattice &us_, &vs_;
    ThreadPool& pool_;
    DisplacedSurface surface_;
    std::vector<Lattice> vertices_;
    std::vector<DVec3> positions_;
    std::vector<UVec3> triangles_;
};

// Texels of the finest table along one side (0: u, 1: v).
int tableCells(const UvGridParams& params, int side) {
    double most = 0.0;
    for (const GridDisplacement& d : params.displacements) {
        const GridTable::Level& finest = d.table.levels[0];
        most = std::max(most, (side == 0 ? finest.width : finest.height) * d.repeat[side]);
    }
    return int(std::min(std::ceil(most), 1e9));
}

void checkRepeat(DVec2 repeat, const GridSurfaceInfo& info) {
    for (int side = 0; side < 2; ++side) {
        if ((side == 0 ? info.is_closed_u : info.is_closed_v) &&
            repeat[side] != std::round(repeat[side])) {
            throw Error(ErrorCode::kInvalidArgument, "",
                        std::string("a ") + info.name + " closes on itself along " +
                            (side == 0 ? "u" : "v") +
                            ": tables must repeat a whole number of times there");
        }
    }
}

}  // namespace

UvGrid makeUvGrid(const UvGridParams& params, ThreadPool& pool) {
    const GridSurfaceInfo& info = gridSurface(params.shape.surface);
    if (params.refine < 0 || params.refine > kMostRefine) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "refine must be in 0.." + std::to_string(kMostRefine));
    }
    checkRepeat(params.texture_repeat, info);
    for (const GridDisplacement& d : params.displacements) checkRepeat(d.repeat, info);
    UvGrid grid;
    grid.table_cells_u = tableCells(params, 0), grid.table_cells_v = tableCells(params, 1);
    double u = GridLattice::wantedCells(grid.table_cells_u, info.is_curved_u ? kCurvedCells : 1),
           v = GridLattice::wantedCells(grid.table_cells_v, info.is_curved_v ? kCurvedCells : 1);
    const double shrink = std::min(std::sqrt(kMostCells / (u * v)), 1.0);
    u = params.cells_u > 0 ? params.cells_u : std::max(1.0, std::floor(u * shrink));
    v = params.cells_v > 0 ? params.cells_v : std::max(1.0, std::floor(v * shrink));
    grid.cells_u = int(u), grid.cells_v = int(v);
    if (2.0 * u * v > kMostTriangles) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a grid of " + std::to_string(grid.cells_u) + " x " +
                        std::to_string(grid.cells_v) + " cells has more than " +
                        std::to_string(size_t(kMostTriangles)) + " triangles");
    }
    const GridLattice us(grid.cells_u, grid.table_cells_u, info.is_closed_u, params.refine),
        vs(grid.cells_v, grid.table_cells_v, info.is_closed_v, params.refine);
    grid.finest_cell = DVec2(us.finestStep(), vs.finestStep());
    UvGridBuilder builder(params, us, vs, pool);
    builder.makeCells();
    for (int pass = 0; pass < params.refine; ++pass) builder.refine();
    grid.stretch = builder.measureStretch();
    grid.mesh = builder.finish(!params.has_normal_map && grid.isCoarserThanTables());
    return grid;
}

}  // namespace stipple
