// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/hybrid_surfels.h>

#include <core/rng.h>
#include <scenegraph/io/edges.h>
#include <scenegraph/surface_at.h>
#include <scenegraph/surfel_finish.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <tuple>
#include <unordered_map>
#include <unordered_set>

namespace stipple {

namespace {

constexpr int kMostLevels = 32;

// At barycentrics of a triangle; false where an alpha mask says that nothing is there.
bool sampleAt(const SampledSurface& s, uint32_t t, float u, float v, float spacing,
              SurfelSample& out) {
    const UVec3& corners = s.mesh.triangles[t];
    const uint32_t material = s.mesh.triangle_material[t];
    const Material& m = s.materials[material];
    if (m.alpha_mode != AlphaMode::kOpaque) {
        const float least = m.alpha_mode == AlphaMode::kMask ? m.alpha_cutoff : 0.5f;
        if (alphaAt(s.mesh, s.materials, s.textures, t, u, v) < least) return false;
    }
    const MeshSurface surface =
        surfaceAt(s.mesh, s.materials, s.textures, t, u, v, {spacing, Vec3(0.0f)});
    out.surfel.position = s.mesh.positions[corners.x] * (1.0f - u - v) +
                          s.mesh.positions[corners.y] * u + s.mesh.positions[corners.z] * v;
    out.surfel.normal = surface.normal_object;
    out.surfel.albedo = surface.albedo;
    out.finish_key = finishKey(s.materials, material, surface.finish);
    return true;
}

// Levels of a place of a square grid: those of even number are square grids, too, the others such
// grids turned by 45 degrees between them.
uint8_t gridLevels(int64_t i, int64_t j) {
    if (i == 0 && j == 0) return kMostLevels;
    const int shift = std::countr_zero(uint64_t(i | j));
    const bool is_diagonal = ((i >> shift) + (j >> shift)) % 2 == 0;
    return uint8_t(std::min(2 * shift + (is_diagonal ? 2 : 1), kMostLevels));
}

// Levels of place k along a line: a line's places become fewer by half with every second level.
uint8_t lineLevels(uint32_t k, double length_in_spacings) {
    if (k == 0)  // an end: as long as the line is not short
        return uint8_t(std::clamp(3 + int(2.0 * std::log2(std::max(length_in_spacings, 1.0))), 1,
                                  kMostLevels));
    return uint8_t(std::min(2 * std::countr_zero(k) + 2, kMostLevels));
}

}  // namespace

DMat3 raysFromObject(const Vec3& normal) {
    const Vec3 other = std::abs(normal.x) < 0.7f ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
    const DVec3 x = glm::normalize(glm::cross(DVec3(normal), DVec3(other)));
    return glm::transpose(DMat3(x, glm::cross(DVec3(normal), x), DVec3(normal)));
}

namespace {

int largestAxis(const DVec3& v) {
    const DVec3 n = glm::abs(v);
    return n.z >= n.x && n.z >= n.y ? 2 : n.y >= n.x ? 1 : 0;
}

}  // namespace

int rayAxis(const Mesh& mesh, uint32_t triangle, const DMat3& rays_from_object) {
    const UVec3& t = mesh.triangles[triangle];
    const DVec3 p(mesh.positions[t.x]);
    return largestAxis(rays_from_object *
                       glm::cross(DVec3(mesh.positions[t.y]) - p, DVec3(mesh.positions[t.z]) - p));
}

void sampleFace(const SampledSurface& surface, uint32_t t, const DMat3& rays_from_object,
                float spacing, std::vector<SurfelSample>& out) {
    const Mesh& mesh = surface.mesh;
    // Off the vertices of models that are made of whole numbers.
    const DVec3 off(0.371, 0.437, 0.413);
    DVec3 p[3];
    for (int k = 0; k < 3; ++k) {
        p[k] =
            rays_from_object * DVec3(mesh.positions[mesh.triangles[t][k]]) / double(spacing) + off;
    }
    const int axis = rayAxis(mesh, t, rays_from_object);
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const DVec2 q[3] = {{p[0][a], p[0][b]}, {p[1][a], p[1][b]}, {p[2][a], p[2][b]}};
    const double low = std::min({q[0].y, q[1].y, q[2].y}),
                 high = std::max({q[0].y, q[1].y, q[2].y});
    const DVec2 e1 = q[1] - q[0], e2 = q[2] - q[0];
    const double determinant = e1.x * e2.y - e1.y * e2.x;
    if (determinant == 0.0) return;
    for (int64_t j = int64_t(std::ceil(low)); double(j) < high; ++j) {
        double from = 1e300, to = -1e300;
        for (int k = 0; k < 3; ++k) {
            const DVec2 &c = q[k], &d = q[(k + 1) % 3];
            if ((c.y > double(j)) == (d.y > double(j))) continue;
            const double at = c.x + (d.x - c.x) * (double(j) - c.y) / (d.y - c.y);
            from = std::min(from, at), to = std::max(to, at);
        }
        for (int64_t i = int64_t(std::ceil(std::max(from, -1e15))); double(i) < to; ++i) {
            const DVec2 r = DVec2(double(i), double(j)) - q[0];
            const double u = (r.x * e2.y - r.y * e2.x) / determinant,
                         v = (e1.x * r.y - e1.y * r.x) / determinant;
            SurfelSample s;
            if (!sampleAt(surface, t, float(std::clamp(u, 0.0, 1.0)),
                          float(std::clamp(v, 0.0, 1.0 - std::clamp(u, 0.0, 1.0))), spacing, s))
                continue;
            s.levels = gridLevels(i, j);
            out.push_back(s);
        }
    }
}

namespace {

// A border's edge, between two pieces or at the end of the surface.
struct BorderEdge {
    uint32_t owner, other;  // pieces
    SharedEdge edge;
    uint32_t triangle;  // of the owner
};

// Walks the edges that two pieces share, in runs from end to end.
class BorderWalk {
public:
    BorderWalk(const SampledSurface& surface, const std::vector<uint32_t>& places,
               const BorderEdge* begin, const BorderEdge* end, float spacing,
               std::vector<SurfelSample>& out)
        : surface_(surface), places_(places), spacing_(spacing), out_(out) {
        for (const BorderEdge* e = begin; e < end; ++e) {
            edges_of_[e->edge.from].push_back(e);
            edges_of_[e->edge.to].push_back(e);
        }
        for (const auto& [place, edges] : edges_of_) {
            if (edges.size() != 2) {
                for (const BorderEdge* e : edges) walk(place, e);
            }
        }
        for (const BorderEdge* e = begin; e < end; ++e) walk(e->edge.from, e);  // loops
    }

private:
    void walk(uint32_t place, const BorderEdge* edge) {
        if (!done_.insert(edge).second) return;
        std::vector<std::pair<const BorderEdge*, uint32_t>> run = {{edge, place}};  // and its start
        double length = double(edge->edge.length);
        for (;;) {
            place = edge->edge.from == place ? edge->edge.to : edge->edge.from;
            const auto& next = edges_of_.at(place);
            if (next.size() != 2) break;
            edge = next[0] == edge ? next[1] : next[0];
            if (!done_.insert(edge).second) break;
            run.emplace_back(edge, place);
            length += double(edge->edge.length);
        }
        const uint32_t n = uint32_t(std::max(1.0, std::ceil(length / double(spacing_))));
        const double step = length / n;
        double before = 0.0;
        uint32_t k = 0;
        for (const auto& [e, start] : run) {
            const double along = double(e->edge.length);
            const bool is_last = e == run.back().first;
            for (; double(k) * step <= before + along * (is_last ? 1.000001 : 1.0) && k <= n; ++k) {
                const double share =
                    along > 0.0 ? std::clamp((double(k) * step - before) / along, 0.0, 1.0) : 0.0;
                add(*e, start, float(share), lineLevels(k == n ? 0 : k, length / double(spacing_)));
            }
            before += along;
        }
    }

    void add(const BorderEdge& e, uint32_t start, float share, uint8_t levels) {
        const UVec3& t = surface_.mesh.triangles[e.triangle];
        const uint32_t end = e.edge.from == start ? e.edge.to : e.edge.from;
        float weight[3] = {0.0f, 0.0f, 0.0f};
        for (int k = 0; k < 3; ++k) {
            if (places_[t[k]] == start) weight[k] = 1.0f - share;
            if (places_[t[k]] == end) weight[k] = share;
        }
        SurfelSample s;
        if (!sampleAt(surface_, e.triangle, weight[1], weight[2], spacing_, s)) return;
        s.levels = levels;
        out_.push_back(s);
    }

    const SampledSurface& surface_;
    const std::vector<uint32_t>& places_;
    const float spacing_;
    std::vector<SurfelSample>& out_;
    std::map<uint32_t, std::vector<const BorderEdge*>> edges_of_;
    std::unordered_set<const BorderEdge*> done_;
};

}  // namespace

std::vector<std::vector<SurfelSample>> sampleBorders(const SampledSurface& surface,
                                                     const SampledPieces& pieces) {
    const auto spacingOf = [&](uint32_t piece) { return pieces.spacing[pieces.patch_of[piece]]; };
    std::vector<BorderEdge> borders;
    for (const SharedEdge& e : sharedEdges(surface.mesh)) {
        const uint32_t a = pieces.piece_of[e.a],
                       b = e.b == kNoTriangle ? kNoTriangle : pieces.piece_of[e.b];
        if (a == b) continue;
        const bool a_owns =
            b == kNoTriangle || std::pair(spacingOf(a), a) < std::pair(spacingOf(b), b);
        borders.push_back({a_owns ? a : b, a_owns ? b : a, e, a_owns ? e.a : e.b});
    }
    std::stable_sort(borders.begin(), borders.end(), [](const BorderEdge& x, const BorderEdge& y) {
        return std::tie(x.owner, x.other) < std::tie(y.owner, y.other);
    });
    const std::vector<uint32_t> places = placesOf(surface.mesh);
    std::vector<std::vector<SurfelSample>> samples(pieces.spacing.size());
    for (size_t begin = 0; begin < borders.size();) {
        size_t end = begin;
        while (end < borders.size() && borders[end].owner == borders[begin].owner &&
               borders[end].other == borders[begin].other)
            ++end;
        const uint32_t owner = borders[begin].owner;
        BorderWalk(surface, places, borders.data() + begin, borders.data() + end, spacingOf(owner),
                   samples[pieces.patch_of[owner]]);
        begin = end;
    }
    return samples;
}

namespace {

// Keeps samples, in their order, that have none of those kept before within `distance` that face
// the same way.
class Thinner {
public:
    Thinner(const std::vector<SurfelSample>& samples, float distance)
        : samples_(samples), distance_(distance) {}

    bool keep(uint32_t index) {
        const Surfel& s = samples_[index].surfel;
        const Vec3 cell = glm::floor(s.position / distance_);
        for (int n = 0; n < 27; ++n) {
            const Vec3 other =
                cell + Vec3(float(n % 3 - 1), float(n / 3 % 3 - 1), float(n / 9 - 1));
            const auto found = kept_.find(keyOf(other));
            if (found == kept_.end()) continue;
            for (uint32_t k = found->second; k != kNone; k = next_[k]) {
                const Surfel& t = samples_[of_[k]].surfel;
                const Vec3 d = t.position - s.position;
                if (glm::dot(d, d) < distance_ * distance_ && glm::dot(t.normal, s.normal) > 0.0f)
                    return false;
            }
        }
        const auto [at, is_new] = kept_.emplace(keyOf(cell), kNone);
        next_.push_back(is_new ? kNone : at->second);
        of_.push_back(index);
        at->second = uint32_t(of_.size() - 1);
        return true;
    }

private:
    static constexpr uint32_t kNone = 0xffffffffu;
    static uint64_t keyOf(const Vec3& cell) {
        return hashCombine(uint64_t(int64_t(cell.x)), uint64_t(int64_t(cell.y)),
                           uint64_t(int64_t(cell.z)));
    }
    const std::vector<SurfelSample>& samples_;
    const float distance_;
    std::unordered_map<uint64_t, uint32_t> kept_;  // the last kept of a cell
    std::vector<uint32_t> next_, of_;
};

}  // namespace

void thinToLevels(std::vector<SurfelSample>& samples, float spacing, size_t few) {
    // Doubles are much nearer; of a square grid every second place is farther away.
    constexpr float kDouble = 0.5f, kThinned = 0.75f;
    std::stable_sort(
        samples.begin(), samples.end(),
        [](const SurfelSample& a, const SurfelSample& b) { return a.levels > b.levels; });
    Thinner first(samples, kDouble * spacing);
    size_t kept = 0;
    std::vector<uint8_t> is_kept(samples.size());
    for (uint32_t i = 0; i < samples.size(); ++i) is_kept[i] = first.keep(i);
    for (uint32_t i = 0; i < samples.size(); ++i) {
        if (is_kept[i]) samples[kept++] = samples[i];
    }
    samples.resize(kept);
    std::vector<uint32_t> level(samples.size()), next;
    for (uint32_t i = 0; i < samples.size(); ++i) level[i] = i, samples[i].levels = 1;
    for (int l = 1; l < kMostLevels; ++l) {
        Thinner thinner(samples, kThinned * spacing * std::exp2(0.5f * float(l)));
        next.clear();
        for (const uint32_t i : level) {
            if (thinner.keep(i)) next.push_back(i);
        }
        // What a level does not make sparser, another would not either.
        if (next.size() < few || next.size() * 10 > level.size() * 9) return;
        for (const uint32_t i : next) samples[i].levels = uint8_t(l + 1);
        std::swap(level, next);
    }
}

}  // namespace stipple
