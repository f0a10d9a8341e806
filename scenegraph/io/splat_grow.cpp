// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_grow.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

namespace stipple {

namespace {

constexpr float kFacing = 0.2f;  // cosine: what is turned more lies on another side
constexpr float kBack = -0.7f;   // what is turned more lies behind
// Thinner ellipses would stand for what noise there is, and need more triangles than they save.
constexpr float kThinnest = 0.25f;
// No place of a surface is farther from a point than about this many spacings.
constexpr float kGap = 1.0f;
// Of a ball that was looked at, all is known that lies so near its middle.
constexpr float kLeastKnown = 0.9f;

bool looksLike(const SplatPoint& a, const Vec3& color, uint8_t finish, const SplatRules& rules) {
    const Vec3 d = glm::abs(a.color - color);
    return std::max({d.x, d.y, d.z}) <= rules.color_tolerance && a.finish == finish;
}

}  // namespace

bool isInside(const Splat& splat, const Vec3& position) {
    const Vec3 d = position - splat.center;
    const float a = glm::dot(d, splat.along), b = glm::dot(d, splat.across());
    for (int i = 0; i < splat.n_cuts; ++i) {
        const Vec3& cut = splat.cuts[size_t(i)];
        if (cut.x * a + cut.y * b > cut.z) return false;
    }
    const float short_radius = std::max(splat.short_radius, 1e-30f),
                long_radius = std::max(splat.long_radius, 1e-30f);
    const float u = a / long_radius, v = b / short_radius;
    return u * u + v * v <= 1.0001f;
}

bool covers(const Splat& splat, const SplatPoint& p, const SplatRules& rules) {
    return std::abs(glm::dot(p.position - splat.center, splat.normal)) <=
               rules.tolerance * 1.0001f &&
           glm::dot(p.normal, splat.normal) >= kFacing &&
           looksLike(p, splat.color, splat.finish, rules) && isInside(splat, p.position);
}

bool contradicts(const SplatPoint& point, const Splat& splat, const SplatRules& rules) {
    if (!isInside(splat, point.position) || covers(splat, point, rules)) return false;
    const Vec3 d = point.position - splat.center;
    const float height = std::abs(glm::dot(d, splat.normal));
    if (height > splat.long_radius || height < 2.0f * rules.tolerance) return false;
    if (glm::dot(point.normal, splat.normal) >= kFacing) return true;
    // Another side of the same thing, below it or beyond a crease.
    if (height > 2.0f * (point.spacing + rules.tolerance)) return false;
    const float a = glm::dot(d, splat.along), b = glm::dot(d, splat.across());
    for (int i = 0; i < splat.n_cuts; ++i) {
        const Vec3& cut = splat.cuts[size_t(i)];
        if (cut.x * a + cut.y * b > cut.z - point.spacing) return false;
    }
    return true;
}

SplatGrower::Frame SplatGrower::frameOf(uint32_t point, const Vec3& normal) const {
    Frame frame;
    frame.origin = points_[point].position;
    frame.normal = normal;
    tangents(normal, frame.along, frame.across);
    return frame;
}

// Beyond one of the cuts, or of the surface there.
bool SplatGrower::isBeyondCut(const Grown& grown, const Around& p) const {
    for (int i = 0; i < grown.n_cuts; ++i) {
        const Cut& cut = grown.cuts[size_t(i)];
        if (cut.to.x * p.a + cut.to.y * p.b > cut.end) return true;
        const SplatPoint& point = points_[p.index];
        if (glm::dot(point.normal, cut.normal) > 0.9f &&
            std::abs(glm::dot(point.position - cut.on_plane, cut.normal)) <=
                rules_.tolerance + 0.25f * point.spacing)
            return true;
    }
    return false;
}

// Whether p lies on another side of a crease that the plane meets next to it; cuts there.
bool SplatGrower::cut(Grown& grown, uint32_t point, const Around& p) const {
    constexpr float kLeastSine = 0.3f, kNextTo = 2.0f;  // spacings
    const SplatPoint& other = points_[p.index];
    const Frame& frame = grown.frame;
    if (!rules_.has_cuts || grown.n_cuts == kMostDiscCuts || !other.is_at_crease) return false;
    const Vec2 g(glm::dot(other.normal, frame.along), glm::dot(other.normal, frame.across));
    const float sine = glm::length(g);
    if (sine < kLeastSine) return false;
    const float height = p.height - 0.5f * (grown.lowest + grown.highest);
    Cut cut;
    cut.to = g / sine;
    cut.end =
        glm::dot(cut.to, Vec2(p.a, p.b)) + glm::dot(other.normal, frame.normal) * height / sine;
    if (cut.end < 0.0f) cut.to = -cut.to, cut.end = -cut.end;
    const float beyond = glm::dot(cut.to, Vec2(p.a, p.b)) - cut.end;
    if (std::hypot(beyond, height) > kNextTo * std::max(other.spacing, points_[point].spacing))
        return false;
    // The surfaces meet rather than leave a slit.
    cut.end += 0.5f * rules_.tolerance;
    cut.normal = other.normal;
    cut.on_plane = other.position;
    grown.cuts[size_t(grown.n_cuts++)] = cut;
    return true;
}

// The points up to that distance, of those the wanted ones on ellipses up to a measure; returns how
// many there are up to the distance. They are sorted as far as they are looked at: sortNext().
template <class IsWanted>
size_t SplatGrower::lookAround(const Vec3& center, const Frame& frame, float reach,
                               float most_measure, const IsWanted& isWanted) {
    order_.clear();
    n_sorted_ = 0;
    size_t n = 0;
    index_.forEachWithin(center, reach, [&](const PointIndex::Item& item) {
        ++n;
        const Vec3 d = item.position - frame.origin;
        const float a = glm::dot(d, frame.along), b = glm::dot(d, frame.across);
        const float measure = frame.measure(a, b);
        if (measure <= most_measure && isWanted(item.index))
            order_.push_back({measure, item.index, a, b, glm::dot(d, frame.normal)});
    });
    return n;
}

// Whether there is a point after so many; it is in its place then.
bool SplatGrower::sortNext(size_t done) {
    if (done < n_sorted_) return true;
    if (done == order_.size()) return false;
    const auto begin = order_.begin() + std::ptrdiff_t(n_sorted_);
    // As many as there were: most growths end soon.
    n_sorted_ = std::min(order_.size(), n_sorted_ + std::max<size_t>(64, n_sorted_));
    const auto end = order_.begin() + std::ptrdiff_t(n_sorted_);
    if (end != order_.end()) std::nth_element(begin, end, order_.end());
    std::sort(begin, end);
    return true;
}

// What is drawn reaches beyond what is covered, farther still where a gap has to be closed; creases
// cut it there, too.
void SplatGrower::cutRim(Grown& grown, uint32_t seed) {
    constexpr float kDrawn = 1.5f;
    const SplatPoint& center = points_[seed];
    const float reach = kDrawn * grown.radius + 2.0f * center.spacing;
    lookAround(center.position, grown.frame, reach / std::sqrt(grown.frame.ratio), reach,
               [&](uint32_t i) {
                   return points_[i].is_at_crease &&
                          glm::dot(points_[i].normal, grown.frame.normal) < kFacing;
               });
    std::sort(order_.begin(), order_.end());
    for (const Around& p : order_) {
        if (!isBeyondCut(grown, p)) cut(grown, seed, p);
    }
}

// Not so far that very many points lie there, as where something fine stands on something coarse.
float SplatGrower::reachOf(const Vec3& center, float reach) const {
    constexpr size_t kMostAround = 32768;
    constexpr float kLess = 0.85f;
    while (reach > 1e-15f && index_.countWithin(center, reach, kMostAround) > kMostAround)
        reach *= kLess;
    return reach;
}

// Over the points around, in order of the ellipse on which they lie, until one does not fit.
SplatGrower::Grown SplatGrower::growIn(uint32_t seed, const Frame& frame, float first_reach,
                                       size_t most) {
    const SplatPoint& center = points_[seed];
    const float long_share = 1.0f / std::sqrt(frame.ratio);
    const size_t n = index_.size();
    for (float wanted = std::max(first_reach, 1e-15f);; wanted *= 1.7f) {
        const float known = reachOf(center.position, wanted);
        const bool are_all = index_.countWithin(center.position, known, n) == n;
        // Beyond what was looked at, nothing is known; beyond all, nothing is.
        const float most_reach =
            are_all ? kInfinity : std::max(known - 2.0f * rules_.tolerance, kLeastKnown * known);
        const size_t n_around = lookAround(center.position, frame, known, most_reach / long_share,
                                           [](uint32_t) { return true; });
        Grown grown;
        grown.frame = frame;
        float tolerance = rules_.tolerance;
        for (size_t k = 0; sortNext(k); ++k) {
            const Around& p = order_[k];
            if (isBeyondCut(grown, p)) continue;
            const SplatPoint& point = points_[p.index];
            const float low = std::min(grown.lowest, p.height),
                        high = std::max(grown.highest, p.height);
            const float facing = glm::dot(point.normal, frame.normal);
            if (high - low > 2.0f * tolerance || facing < kFacing ||
                !looksLike(point, center.color, center.finish, rules_)) {
                // Another side of what this lies on, away from here.
                const float off = 0.5f * std::abs(p.height) - center.spacing;
                if (facing < kFacing && off > tolerance) continue;
                if (cut(grown, seed, p)) continue;
                // The back of a sheet that is as thin as that.
                if (facing < kBack && point.is_facing) continue;
                // A large tolerance is no hindrance where less would do to tell sides apart.
                if (facing < kFacing && off > center.spacing &&
                    grown.highest - grown.lowest <= 2.0f * off) {
                    tolerance = off;
                    continue;
                }
                grown.is_ended = true;
                break;
            }
            grown.lowest = low, grown.highest = high;
            grown.radius = p.measure;
            ++grown.n_points;
        }
        grown.is_ended = grown.is_ended || are_all;
        if (grown.is_ended || n_around >= most || known < wanted) return grown;
    }
}

// The plane and the principal curvatures of the points that a circle grew over.
bool SplatGrower::fitQuadric(uint32_t seed, const Grown& circle, Frame& frame) const {
    constexpr size_t kFewest = 8;
    if (circle.n_points < kFewest || !(circle.radius > 0.0f)) return false;
    const Frame& from = circle.frame;
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    Eigen::Matrix<double, 6, 6> sums = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6 heights = Vector6::Zero();
    const double scale = 1.0 / double(circle.radius);
    for (const Around& p : order_) {
        if (p.measure > circle.radius) break;
        if (p.height < circle.lowest || p.height > circle.highest || isBeyondCut(circle, p))
            continue;
        const double a = double(p.a) * scale, b = double(p.b) * scale;
        Vector6 row;
        row << 1.0, a, b, a * a, a * b, b * b;
        sums += row * row.transpose();
        heights += row * (double(p.height) * scale);
    }
    sums.diagonal().array() += 1e-9 * sums.trace();
    const Vector6 q = sums.ldlt().solve(heights);
    if (!q.allFinite() || std::abs(q[1]) > 0.5 || std::abs(q[2]) > 0.5) return false;
    frame = frameOf(
        seed, glm::normalize(from.normal - from.along * float(q[1]) - from.across * float(q[2])));
    Eigen::Matrix2d curvature;
    curvature << q[3], 0.5 * q[4], 0.5 * q[4], q[5];
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
    solver.computeDirect(curvature);
    const Eigen::Vector2d k = solver.eigenvalues().cwiseAbs();
    const int flatter = k[0] < k[1] ? 0 : 1;
    const Eigen::Vector2d to = solver.eigenvectors().col(flatter);
    Vec3 along = from.along * float(to[0]) + from.across * float(to[1]);
    along -= frame.normal * glm::dot(frame.normal, along);
    if (glm::length(along) < 0.5f) return false;
    frame.along = glm::normalize(along);
    frame.across = glm::cross(frame.normal, frame.along);
    // Up to a height an ellipse reaches as far as the root of the curvature's inverse.
    const double ratio = std::sqrt(k[flatter] / std::max(k[1 - flatter], 1e-12));
    frame.ratio = std::clamp(float(ratio), kThinnest, 1.0f);
    return true;
}

Splat SplatGrower::grow(uint32_t seed, size_t most) {
    const SplatPoint& p = points_[seed];
    // Twice the spacing holds a dozen points of a surface.
    Grown best = growIn(seed, frameOf(seed, p.normal), 2.0f * p.spacing, most);
    Frame fitted;
    if (fitQuadric(seed, best, fitted)) {
        const float ratio = fitted.ratio;
        const auto consider = [&](float r) {
            fitted.ratio = r;
            const float reach = 1.2f * best.radius / std::sqrt(r) + p.spacing;
            Grown other = growIn(seed, fitted, reach, most);
            if (other.radius > best.radius) best = other;
        };
        consider(1.0f);
        constexpr float kAlmostRound = 0.85f;
        if (!rules_.are_circles && ratio < kAlmostRound) {
            consider(std::sqrt(ratio));
            consider(ratio);
        }
    }
    if (rules_.has_cuts) cutRim(best, seed);
    Splat splat;
    splat.normal = splat.shading_normal = best.frame.normal;
    splat.center = best.frame.origin + splat.normal * (0.5f * (best.lowest + best.highest));
    splat.along = best.frame.along;
    splat.long_radius = best.radius / std::sqrt(best.frame.ratio);
    splat.short_radius = best.radius * std::sqrt(best.frame.ratio);
    splat.gap = kGap * p.spacing;
    splat.color = p.color;
    splat.finish = p.finish;
    splat.n_cuts = best.n_cuts;
    for (int i = 0; i < best.n_cuts; ++i)
        splat.cuts[size_t(i)] = Vec3(best.cuts[size_t(i)].to, best.cuts[size_t(i)].end);
    return splat;
}

}  // namespace stipple
