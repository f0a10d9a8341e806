// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <core/rng.h>
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/scatter.h>

namespace stipple {

namespace {

constexpr uint64_t kMostInstances = uint64_t(1) << 31;  // one group holds no more (64 GiB)
constexpr double kThicketSize = 60.0;                   // metres
constexpr double kTwoPi = 2.0 * kPi;

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

// Thickets and clearings: a density in [0, 2] with mean 1.
double thicket(uint64_t key, const DVec2& p) {
    return 2.0 * smoothStep(-0.3, 0.3, gradientNoise(key, p / kThicketSize).value);
}

// Rotation that takes +y to the unit vector n, the shortest way.
DMat3 uprightTo(const DVec3& n) {
    const double k = 1.0 / (1.0 + std::max(n.y, -0.999999));
    return DMat3(DVec3(1.0 - n.x * n.x * k, -n.x, -n.x * n.z * k), n,
                 DVec3(-n.x * n.z * k, -n.z, 1.0 - n.z * n.z * k));
}

// Turn about y, columns.
DMat3 turnAboutY(double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return DMat3(DVec3(c, 0.0, -s), DVec3(0.0, 1.0, 0.0), DVec3(s, 0.0, c));
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
    if (!(p.size > 0.0 && p.size <= 1e9))
        refuse("a scatter square's size must be above 0 and at most 1e9 metres");
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

}  // namespace

void scatter(const ScatterParams& params, const HeightField* field, InstanceStore& instances) {
    check(params);
    if (params.count == 0) return;
    const uint64_t key = hashCombine(params.seed, 0x5ca7);
    // Cells enough for the densest place: a cell holds one instance at most.
    const double peak = 1.0 + params.clustering;
    const uint64_t n =
        std::max<uint64_t>(1, uint64_t(std::ceil(std::sqrt(double(params.count) * peak))));
    const double cell = params.size / double(n);
    const double fill =
        double(params.count) / (double(n) * double(n));  // probability for a density of 1
    std::vector<double> cumulated;
    for (const ScatterItem& item : params.items)
        cumulated.push_back((cumulated.empty() ? 0.0 : cumulated.back()) + item.weight);
    const DVec2 corner = params.center - DVec2(0.5 * params.size);
    const bool limits_slope = params.min_slope > 0.0 || params.max_slope < 0.5 * kPi;
    const bool needs_normal = field && (params.align > 0.0 || limits_slope);
    const float most_upright = float(std::cos(std::max(params.min_slope, 0.0)));
    const float least_upright = float(std::cos(std::clamp(params.max_slope, 0.0, 0.5 * kPi)));
    instances.reserve(instances.size() + params.count +
                      4 * uint64_t(std::sqrt(double(params.count))));

    visitCells(0, 0, n, n, [&](uint64_t ix, uint64_t iz) {
        Rng rng{hashCombine(key, ix, iz)};
        const double admission = rng.uniform();
        if (admission >= fill * peak) return;
        const double u = rng.uniform(), v = rng.uniform();
        const DVec2 p = corner + cell * DVec2(double(ix) + u, double(iz) + v);
        if (params.clustering > 0.0) {
            const double density = 1.0 - params.clustering + params.clustering * thicket(key, p);
            if (admission >= fill * density) return;
        }
        const double y = field ? field->height(p.x, p.y) : 0.0;
        if (!(y >= params.min_height && y <= params.max_height)) return;
        const Vec3 normal = needs_normal ? field->normal(p.x, p.y) : Vec3(0, 1, 0);
        if (limits_slope && !(normal.y <= most_upright && normal.y >= least_upright)) return;

        Affine a;
        a.linear =
            turnAboutY(rng.uniform(0.0, kTwoPi)) * rng.uniform(params.min_scale, params.max_scale);
        if (params.tilt > 0.0) {
            const double angle = rng.uniform(0.0, params.tilt), azimuth = rng.uniform(0.0, kTwoPi),
                         s = std::sin(angle);
            a.linear =
                uprightTo(DVec3(s * std::cos(azimuth), std::cos(angle), s * std::sin(azimuth))) *
                a.linear;
        }
        if (params.align > 0.0) {
            a.linear =
                uprightTo(glm::normalize(glm::mix(DVec3(0, 1, 0), DVec3(normal), params.align))) *
                a.linear;
        }
        a.translation = DVec3(p.x, y - params.sink, p.y);
        instances.add(params.items[pickItem(cumulated, rng.uniform())].child, a);
    });
}

DBox3 scatterDomain(const ScatterParams& params, const HeightField* field) {
    float low = 0.0f, high = 0.0f;
    if (field && !field->heights.empty()) {
        const auto [least, most] =
            std::minmax_element(field->heights.begin(), field->heights.end());
        low = *least, high = *most;
    }
    const double half = 0.5 * params.size;
    return {DVec3(params.center.x - half, double(low) - params.sink, params.center.y - half),
            DVec3(params.center.x + half, double(high) - params.sink, params.center.y + half)};
}

void placeGrid(const GridParams& params, InstanceStore& instances) {
    check(params);
    const uint64_t key = hashCombine(params.seed, 0x641d);
    const DVec2 first(-0.5 * params.spacing_x * double(params.count_x - 1),
                      -0.5 * params.spacing_z * double(params.count_z - 1));
    instances.reserve(instances.size() + size_t(params.count_x) * params.count_z);
    visitCells(0, 0, params.count_x, params.count_z, [&](uint64_t ix, uint64_t iz) {
        Rng rng{hashCombine(key, ix, iz)};
        DVec2 p = first + DVec2(params.spacing_x * double(ix), params.spacing_z * double(iz));
        if (params.jitter > 0.0) {
            p.x += rng.uniform(-params.jitter, params.jitter);
            p.y += rng.uniform(-params.jitter, params.jitter);
        }
        Affine a;
        if (params.any_turn) {
            a.linear = turnAboutY(rng.uniform(0.0, kTwoPi));
        } else if (params.quarter_turns) {
            // Exact: no rounding of the sine of pi.
            const uint64_t turn = rng.next() >> 62;
            const double c = turn == 0   ? 1.0
                             : turn == 2 ? -1.0
                                         : 0.0,
                         s = turn == 1   ? 1.0
                             : turn == 3 ? -1.0
                                         : 0.0;
            a.linear = DMat3(DVec3(c, 0.0, -s), DVec3(0.0, 1.0, 0.0), DVec3(s, 0.0, c));
        }
        if (params.min_scale != 1.0 || params.max_scale != 1.0)
            a.linear *= rng.uniform(params.min_scale, params.max_scale);
        const double hill = params.hill_height == 0.0
                                ? 0.0
                                : 0.5 + 0.5 * gradientNoise(key, p / params.hill_size).value;
        a.translation = DVec3(p.x, params.hill_height * hill, p.y);
        instances.add(params.child, a);
    });
}

DBox3 gridDomain(const GridParams& params) {
    const double x = 0.5 * std::abs(params.spacing_x) * double(params.count_x - 1) + params.jitter;
    const double z = 0.5 * std::abs(params.spacing_z) * double(params.count_z - 1) + params.jitter;
    return {DVec3(-x, std::min(0.0, params.hill_height), -z),
            DVec3(x, std::max(0.0, params.hill_height), z)};
}

}  // namespace stipple
