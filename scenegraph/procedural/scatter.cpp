// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <core/rng.h>
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/scatter.h>

#include <optional>

namespace stipple {

namespace {

constexpr uint64_t kMostInstances = uint64_t(1) << 31;  // one group holds no more (64 GiB)
constexpr double kThicketSize = 60.0;                   // metres
constexpr double kTwoPi = 2.0 * kPi;
constexpr uint64_t kChunkCells = 32768;  // about so many are filled by one thread at a time
constexpr double kTriesPerPlace = 16.0;  // where instances keep a distance from each other

[[noreturn]] void refuse(const std::string& message) {
    throw Error(ErrorCode::kInvalidArgument, "", message);
}

// Visits the cells of a grid along a z-order curve, so that neighbours in the store are neighbours
// in space. Works for any size: halves the longer side until a cell is left.
template <class Visit>
void visitCells(uint64_t x0, uint64_t z0, uint64_t nx, uint64_t nz, const Visit& visit) {
    if (nx == 1 && nz == 1) {
        visit(x0, z0);
    } else if (nx >= nz) {
        visitCells(x0, z0, nx / 2, nz, visit);
        visitCells(x0 + nx / 2, z0, nx - nx / 2, nz, visit);
    } else {
        visitCells(x0, z0, nx, nz / 2, visit);
        visitCells(x0, z0 + nz / 2, nx, nz - nz / 2, visit);
    }
}

struct CellRect {
    uint64_t x0, z0, nx, nz;
};

// The parts of the grid that visitCells() visits one after the other, of at most kChunkCells cells.
void zOrderParts(const CellRect& r, std::vector<CellRect>& parts) {
    if (r.nx * r.nz <= kChunkCells) {
        parts.push_back(r);
    } else if (r.nx >= r.nz) {
        zOrderParts({r.x0, r.z0, r.nx / 2, r.nz}, parts);
        zOrderParts({r.x0 + r.nx / 2, r.z0, r.nx - r.nx / 2, r.nz}, parts);
    } else {
        zOrderParts({r.x0, r.z0, r.nx, r.nz / 2}, parts);
        zOrderParts({r.x0, r.z0 + r.nz / 2, r.nx, r.nz - r.nz / 2}, parts);
    }
}

// Thickets and clearings: a density in [0, 2] with mean 1.
double thicket(uint64_t key, const DVec2& p) {
    return 2.0 * smoothStep(-0.3, 0.3, gradientNoise(key, p / kThicketSize).value);
}

// Quaternions x, y, z, w. The rotation that takes +y to the unit vector n, the shortest way.
glm::dvec4 uprightTo(const DVec3& n) {
    if (n.y < -1.0 + 1e-12) return glm::dvec4(1, 0, 0, 0);  // straight down: half a turn about x
    return glm::normalize(glm::dvec4(n.z, 0.0, -n.x, 1.0 + n.y));
}

glm::dvec4 turnAboutY(double angle) {
    return glm::dvec4(0.0, std::sin(0.5 * angle), 0.0, std::cos(0.5 * angle));
}

// First b, then a.
glm::dvec4 composed(const glm::dvec4& a, const glm::dvec4& b) {
    const DVec3 u(a), v(b);
    return glm::dvec4(a.w * v + b.w * u + glm::cross(u, v), a.w * b.w - glm::dot(u, v));
}

void check(const ScatterParams& p) {
    if (p.items.empty()) refuse("nothing to scatter");
    if (p.items.size() > 65536) refuse("more than 65536 kinds to scatter");
    double total = 0.0;
    for (const ScatterItem& item : p.items) {
        if (!(item.weight >= 0.0 && item.weight <= 1e12))
            refuse("a scatter weight must be in 0..1e12");
        total += item.weight;
    }
    if (!(total > 0.0)) refuse("all scatter weights are 0");
    if (p.count > kMostInstances)
        refuse("scatter count " + std::to_string(p.count) + " is above 2^31");
    if (!(p.size.x > 0.0 && p.size.x <= 1e9 && p.size.y > 0.0 && p.size.y <= 1e9))
        refuse("a scatter square's size must be above 0 and at most 1e9 metres");
    if (!(p.spacing >= 0.0 && p.spacing <= 1e9)) refuse("scatter spacing must be in 0..1e9 metres");
    if (!(std::abs(p.center.x) <= 1e9 && std::abs(p.center.y) <= 1e9))
        refuse("a scatter square's centre must be within 1e9 metres");
    if (!(p.min_scale > 0.0 && p.min_scale <= p.max_scale && p.max_scale <= 1e6)) {
        refuse("scatter scales must satisfy 0 < min_scale <= max_scale <= 1e6");
    }
    if (!(p.tilt >= 0.0 && p.tilt <= kPi)) refuse("scatter tilt must be in 0..180 degrees");
    if (!(p.align >= 0.0 && p.align <= 1.0)) refuse("scatter align must be in 0..1");
    if (!(p.clustering >= 0.0 && p.clustering <= 1.0)) refuse("scatter clustering must be in 0..1");
    if (!(std::abs(p.sink) <= 1e6)) refuse("scatter sink must be within 1e6 metres");
}

void check(const GridParams& p) {
    if (p.count_x < 1 || p.count_z < 1 || uint64_t(p.count_x) * p.count_z > kMostInstances) {
        refuse("a grid's counts must be at least 1 and their product at most 2^31");
    }
    const auto isLength = [](double x) { return std::abs(x) <= 1e9; };
    if (!isLength(p.spacing_x * p.count_x) || !isLength(p.spacing_z * p.count_z))
        refuse("a grid must be at most 1e9 metres wide");
    if (!(p.jitter >= 0.0 && isLength(p.jitter)))
        refuse("a grid's jitter must be in 0..1e9 metres");
    if (!(p.min_scale > 0.0 && p.min_scale <= p.max_scale && p.max_scale <= 1e6)) {
        refuse("grid scales must satisfy 0 < min_scale <= max_scale <= 1e6");
    }
    if (!(isLength(p.hill_height) && p.hill_size >= 1e-3 && p.hill_size <= 1e9)) {
        refuse(
            "a grid's hill_height must be within 1e9 metres and its hill_size in 0.001..1e9 "
            "metres");
    }
}

// The first item whose cumulated weight exceeds the draw.
size_t pickItem(const std::vector<double>& cumulated, double u) {
    const auto it = std::upper_bound(cumulated.begin(), cumulated.end(), u * cumulated.back());
    return std::min(size_t(it - cumulated.begin()), cumulated.size() - 1);
}

// A place that has been found good, with the random numbers that remain.
struct Place {
    DVec3 position;
    Vec3 normal;
    Rng rng;
};

class Scatterer {
public:
    Scatterer(const ScatterParams& params, const ScatterSurface& surface)
        : params_(params),
          surface_(surface),
          key_(hashCombine(params.seed, 0x5ca7)),
          peak_(1.0 + params.clustering) {
        for (const ScatterItem& item : params.items)
            cumulated_.push_back((cumulated_.empty() ? 0.0 : cumulated_.back()) + item.weight);
        // Places enough for the densest part: a cell holds one instance at most.
        const double wanted = scatterTries(params, surface) * peak_;
        if (surface.triangles) {
            const DBox3& b = surface.triangles->bounds();
            corner_ = DVec2(b.min.x, b.min.z);
            size_ = DVec2(b.max.x, b.max.z) - corner_;
            n_x_ = std::max<uint64_t>(1, uint64_t(std::ceil(wanted)));
        } else {
            size_ = params.size;
            corner_ = params.center - 0.5 * size_;
            n_x_ = cellsAlong(wanted * size_.x / size_.y);
            n_z_ = cellsAlong(wanted * size_.y / size_.x);
        }
        fill_ = scatterTries(params, surface) / (double(n_x_) * double(n_z_));
        limits_slope_ = surface.triangles || params.min_slope > 0.0 || params.max_slope < 0.5 * kPi;
        needs_normal_ = surface.field && (params.align > 0.0 || limits_slope_);
        most_upright_ = float(std::cos(std::max(params.min_slope, 0.0)));
        least_upright_ = float(std::cos(std::clamp(params.max_slope, 0.0, kPi)));
    }

    std::vector<CellRect> parts() const {
        std::vector<CellRect> parts;
        zOrderParts({0, 0, n_x_, n_z_}, parts);
        return parts;
    }

    // Calls visit(place) for all good places of a part.
    template <class Visit>
    void visitPlaces(const CellRect& part, const Visit& visit) const {
        visitCells(part.x0, part.z0, part.nx, part.nz, [&](uint64_t ix, uint64_t iz) {
            if (const std::optional<Place> place = tryCell(ix, iz)) visit(*place);
        });
    }

    void add(Place place, InstanceStore& instances) const {
        Rng& rng = place.rng;
        glm::dvec4 rotation = turnAboutY(rng.uniform(0.0, kTwoPi));
        const double scale = rng.uniform(params_.min_scale, params_.max_scale);
        if (params_.tilt > 0.0) {
            const double angle = rng.uniform(0.0, params_.tilt), azimuth = rng.uniform(0.0, kTwoPi),
                         s = std::sin(angle);
            rotation = composed(
                uprightTo(DVec3(s * std::cos(azimuth), std::cos(angle), s * std::sin(azimuth))),
                rotation);
        }
        DVec3 up(0.0, 1.0, 0.0);
        if (params_.align > 0.0) {
            const DVec3 mixed = glm::mix(up, DVec3(place.normal), params_.align);
            // Half way between up and down there is no direction.
            if (glm::length(mixed) > 1e-6) up = glm::normalize(mixed);
            rotation = composed(uprightTo(up), rotation);
        }
        const DVec3 down = surface_.triangles ? -up : DVec3(0, -1, 0);
        instances.addSimilarity(params_.items[pickItem(cumulated_, rng.uniform())].child,
                                place.position + params_.sink * down, rotation, scale);
    }

private:
    static uint64_t cellsAlong(double square) {
        return std::max<uint64_t>(1, uint64_t(std::ceil(std::sqrt(square))));
    }

    std::optional<Place> tryCell(uint64_t ix, uint64_t iz) const {
        Place place{DVec3(0.0), Vec3(0, 1, 0), Rng{hashCombine(key_, ix, iz)}};
        Rng& rng = place.rng;
        const double admission = rng.uniform();
        if (admission >= fill_ * peak_) return std::nullopt;
        const double u = rng.uniform(), v = rng.uniform();
        DVec2 p;
        if (surface_.triangles) {
            const TriangleSurface::Place found =
                surface_.triangles->at((double(ix) + rng.uniform()) / double(n_x_), u, v);
            place.position = found.position, place.normal = found.normal;
            p = DVec2(found.position.x, found.position.z);
        } else {
            p = corner_ +
                size_ / DVec2(double(n_x_), double(n_z_)) * DVec2(double(ix) + u, double(iz) + v);
        }
        if (params_.clustering > 0.0 || params_.density) {
            double density = 1.0 - params_.clustering;
            if (params_.clustering > 0.0) density += params_.clustering * thicket(key_, p);
            if (params_.density) {
                const DVec2 uv = (p - corner_) / glm::max(size_, DVec2(1e-30));
                density *= params_.density->at(uv.x, uv.y);
            }
            if (admission >= fill_ * density) return std::nullopt;
        }
        if (!surface_.triangles) {
            place.position =
                DVec3(p.x, surface_.field ? surface_.field->height(p.x, p.y) : 0.0, p.y);
        }
        const double y = place.position.y;
        if (!(y >= params_.min_height && y <= params_.max_height)) return std::nullopt;
        if (needs_normal_) place.normal = surface_.field->normal(p.x, p.y);
        if (limits_slope_ &&
            !(place.normal.y <= most_upright_ && place.normal.y >= least_upright_)) {
            return std::nullopt;
        }
        return place;
    }

    const ScatterParams& params_;
    const ScatterSurface& surface_;
    uint64_t key_;
    double peak_;  // of the density; its mean is 1
    std::vector<double> cumulated_;
    DVec2 corner_, size_;         // of what is seen from above
    uint64_t n_x_ = 1, n_z_ = 1;  // cells; on triangles equal shares of the area, in one row
    double fill_;                 // probability of a place for a density of 1
    bool limits_slope_, needs_normal_;
    float most_upright_, least_upright_;
};

// Keeps places that are at least `spacing` from all kept before, at most `most` of them; in an
// order that is random and has nothing to do with where they are. Dart throwing on a grid of cells
// as wide as the spacing, hashed. Based on: Cook. Stochastic Sampling in Computer Graphics. 1986.
std::vector<Place> keepDistance(std::vector<Place> places, double spacing, uint64_t most) {
    std::sort(places.begin(), places.end(),
              [](const Place& a, const Place& b) { return a.rng.key < b.rng.key; });
    size_t n_slots = 64;
    while (n_slots < 2 * places.size()) n_slots *= 2;
    constexpr uint32_t kNone = ~0u;
    std::vector<uint32_t> first(n_slots, kNone), next;
    std::vector<Place> kept;
    const auto slot = [&](const DVec3& cell) {
        const auto whole = [](double x) { return uint64_t(int64_t(x)); };
        return mixBits(whole(cell.x) * 0x9e3779b97f4a7c15ull +
                       whole(cell.y) * 0xc2b2ae3d27d4eb4full +
                       whole(cell.z) * 0x165667b19e3779f9ull) &
               (n_slots - 1);
    };
    // The cell itself first, corners last: most places are refused, and by who is near.
    std::array<DVec3, 27> neighbours;
    for (int i = 0; i < 27; ++i) neighbours[size_t(i)] = DVec3(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    std::stable_sort(neighbours.begin(), neighbours.end(), [](const DVec3& a, const DVec3& b) {
        return glm::dot(a, a) < glm::dot(b, b);
    });
    const auto isFree = [&](const DVec3& p, const DVec3& cell) {
        for (const DVec3& step : neighbours) {
            for (uint32_t k = first[slot(cell + step)]; k != kNone; k = next[k]) {
                const DVec3 d = kept[k].position - p;
                if (glm::dot(d, d) < spacing * spacing) return false;
            }
        }
        return true;
    };
    for (const Place& place : places) {
        if (kept.size() >= most) break;
        const DVec3 cell = glm::floor(place.position / spacing);
        if (!isFree(place.position, cell)) continue;
        uint32_t& head = first[slot(cell)];
        next.push_back(head);
        head = uint32_t(kept.size());
        kept.push_back(place);
    }
    return kept;
}

double scatterArea(const ScatterParams& params, const ScatterSurface& surface) {
    return surface.triangles ? surface.triangles->area() : params.size.x * params.size.y;
}

}  // namespace

float DensityMap::at(double u, double v) const {
    const double x = std::clamp(u * width - 0.5, 0.0, double(width - 1)),
                 y = std::clamp(v * height - 0.5, 0.0, double(height - 1));
    const int x0 = int(x), y0 = int(y), x1 = std::min(x0 + 1, width - 1),
              y1 = std::min(y0 + 1, height - 1);
    const float fx = float(x - x0), fy = float(y - y0);
    const auto value = [&](int i, int j) { return values[size_t(j) * size_t(width) + size_t(i)]; };
    return (value(x0, y0) * (1.0f - fx) + value(x1, y0) * fx) * (1.0f - fy) +
           (value(x0, y1) * (1.0f - fx) + value(x1, y1) * fx) * fy;
}

double scatterTries(const ScatterParams& params, const ScatterSurface& surface) {
    const double count = double(params.count);
    if (!(params.spacing > 0.0)) return count;
    const double tries =
        kTriesPerPlace * scatterArea(params, surface) / (params.spacing * params.spacing);
    return std::min(kTriesPerPlace * count, std::max(tries, kTriesPerPlace));
}

double scatterMost(const ScatterParams& params, const ScatterSurface& surface) {
    if (!(params.spacing > 0.0)) return double(params.count);
    // Discs of half the spacing fill at most 91 % of the plane: 1.16 of them a squared spacing.
    return std::min(double(params.count),
                    1.16 * scatterTries(params, surface) / kTriesPerPlace + 1);
}

void scatter(const ScatterParams& params, const ScatterSurface& surface, ThreadPool& pool,
             InstanceStore& instances) {
    check(params);
    if (params.count == 0) return;
    if (surface.triangles && !(surface.triangles->area() > 0.0))
        refuse("the surface to scatter on has no area");
    if (!(scatterTries(params, surface) <= double(kMostInstances)))
        refuse("scatter spacing is so small that there is room for more than 2^27 instances");
    const Scatterer scatterer(params, surface);
    const std::vector<CellRect> parts = scatterer.parts();
    if (!(params.spacing > 0.0)) {
        instances.reserve(instances.size() + params.count +
                          4 * uint64_t(std::sqrt(double(params.count))));
        instances.addChunks(pool, parts.size(), [&](size_t i, InstanceStore& store) {
            scatterer.visitPlaces(parts[i], [&](const Place& p) { scatterer.add(p, store); });
        });
        return;
    }
    std::vector<std::vector<Place>> found(parts.size());
    pool.forEach(parts.size(), [&](size_t i, int) {
        scatterer.visitPlaces(parts[i], [&](const Place& p) { found[i].push_back(p); });
    });
    std::vector<Place> places;
    for (std::vector<Place>& some : found) {
        places.insert(places.end(), some.begin(), some.end());
        some = std::vector<Place>();  // {} would keep the memory
    }
    places = keepDistance(std::move(places), params.spacing, params.count);
    instances.addChunks(pool, (places.size() + kChunkCells - 1) / kChunkCells,
                        [&](size_t chunk, InstanceStore& store) {
                            const size_t begin = chunk * kChunkCells;
                            const size_t end = std::min(places.size(), begin + kChunkCells);
                            for (size_t i = begin; i < end; ++i) scatterer.add(places[i], store);
                        });
}

DBox3 scatterDomain(const ScatterParams& params, const ScatterSurface& surface) {
    if (surface.triangles) {
        DBox3 box = surface.triangles->bounds();
        box.min -= std::abs(params.sink), box.max += std::abs(params.sink);
        return box;
    }
    float low = 0.0f, high = 0.0f;
    if (surface.field && !surface.field->heights.empty()) {
        const auto [least, most] =
            std::minmax_element(surface.field->heights.begin(), surface.field->heights.end());
        low = *least, high = *most;
    }
    const DVec2 half = 0.5 * params.size;
    return {DVec3(params.center.x - half.x, double(low) - params.sink, params.center.y - half.y),
            DVec3(params.center.x + half.x, double(high) - params.sink, params.center.y + half.y)};
}

void placeGrid(const GridParams& params, ThreadPool& pool, InstanceStore& instances) {
    check(params);
    const uint64_t key = hashCombine(params.seed, 0x641d);
    const DVec2 first(-0.5 * params.spacing_x * double(params.count_x - 1),
                      -0.5 * params.spacing_z * double(params.count_z - 1));
    const auto place = [&](uint64_t ix, uint64_t iz, InstanceStore& store) {
        Rng rng{hashCombine(key, ix, iz)};
        DVec2 p = first + DVec2(params.spacing_x * double(ix), params.spacing_z * double(iz));
        if (params.jitter > 0.0) {
            p.x += rng.uniform(-params.jitter, params.jitter);
            p.y += rng.uniform(-params.jitter, params.jitter);
        }
        double angle = 0.0, scale = 1.0;
        if (params.any_turn) {
            angle = rng.uniform(0.0, kTwoPi);
        } else if (params.quarter_turns) {
            angle = 0.5 * kPi * double(rng.next() >> 62);
        }
        if (params.min_scale != 1.0 || params.max_scale != 1.0)
            scale = rng.uniform(params.min_scale, params.max_scale);
        const double hill = params.hill_height == 0.0
                                ? 0.0
                                : 0.5 + 0.5 * gradientNoise(key, p / params.hill_size).value;
        store.addSimilarity(params.child, DVec3(p.x, params.hill_height * hill, p.y),
                            turnAboutY(angle), scale);
    };
    std::vector<CellRect> parts;
    zOrderParts({0, 0, params.count_x, params.count_z}, parts);
    instances.reserve(instances.size() + size_t(params.count_x) * params.count_z);
    instances.addChunks(pool, parts.size(), [&](size_t i, InstanceStore& store) {
        const CellRect& r = parts[i];
        store.reserve(r.nx * r.nz);
        visitCells(r.x0, r.z0, r.nx, r.nz, [&](uint64_t ix, uint64_t iz) { place(ix, iz, store); });
    });
}

DBox3 gridDomain(const GridParams& params) {
    const double x = 0.5 * std::abs(params.spacing_x) * double(params.count_x - 1) + params.jitter;
    const double z = 0.5 * std::abs(params.spacing_z) * double(params.count_z - 1) + params.jitter;
    return {DVec3(-x, std::min(0.0, params.hill_height), -z),
            DVec3(x, std::max(0.0, params.hill_height), z)};
}

}  // namespace stipple
