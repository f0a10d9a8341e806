// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_gap.h>

#include <core/rng.h>

#include <algorithm>

namespace stipple {

namespace {

// All in spacings of the splat's own point.
constexpr float kNoGap = 0.25f;  // what is narrower is none
constexpr float kStep = 0.1f;    // by which splats grow
// Beyond the points at most: a gap that is seen well is closed even where these are farther apart.
constexpr float kMostGap = 1.0f, kMostGapSeenWell = 1.5f, kSeenWell = 0.7f;  // the last a cosine
constexpr float kAround = 2.5f;  // points up to there lie around a place
constexpr float kSlack = 1.0f;   // what lies around places is looked up once if so near
constexpr float kDepth = 3.0f;   // what lies deeper or higher is another surface
// Seen from aside noise puts points on all sides of what stands out: no turn as wide without any.
constexpr float kWidestTurn = 0.75f * float(kPi);
constexpr size_t kMostAround = 64, kMostLookedUp = 192;
constexpr int kDirections = 32, kTurns = 16;

struct Direction {
    Vec3 to = Vec3(0), u = Vec3(0), v = Vec3(0);  // all unit, at right angles
};
using Directions = std::array<std::array<Direction, kDirections>, kTurns>;

// Evenly over the half sphere around z, each time turned by another angle.
Directions makeDirections() {
    constexpr float kTurn = 2.0f * float(kPi), kGolden = 0.618034f;
    Directions directions;
    for (int turn = 0; turn < kTurns; ++turn) {
        for (int i = 0; i < kDirections; ++i) {
            const float z = (float(i) + 0.5f) / float(kDirections), r = std::sqrt(1.0f - z * z),
                        at = kTurn * (kGolden * float(i) + float(turn) / float(kTurns));
            Direction& d = directions[size_t(turn)][size_t(i)];
            d.to = Vec3(r * std::cos(at), r * std::sin(at), z);
            tangents(d.to, d.u, d.v);
        }
    }
    return directions;
}

const Directions& directions() {
    static const Directions made = makeDirections();
    return made;
}

}  // namespace

bool isBeyondCut(const Splat& splat, const Vec2& p) {
    for (int c = 0; c < splat.n_cuts; ++c) {
        const Vec3& cut = splat.cuts[size_t(c)];
        if (glm::dot(Vec2(cut), p) > cut.z) return true;
    }
    return false;
}

void SplatDisc::place(const Splat& splat) {
    const Vec3 across = splat.across();
    to_circle = glm::inverse(of_circle);
    center = splat.center + splat.along * middle.x + across * middle.y;
    to_x = splat.along * to_circle[0][0] + across * to_circle[1][0];
    to_y = splat.along * to_circle[0][1] + across * to_circle[1][1];
}

DrawnSplats::DrawnSplats(const SplatPoints& all_points, const PointIndex& point_index,
                         const std::vector<ChosenSplat>& chosen, const std::vector<Splat>& drawn)
    : points(all_points), index(point_index), splats(drawn), discs(drawn.size()) {
    first.assign(points.size() + 1, 0);
    for (const ChosenSplat& s : chosen) {
        for (const uint32_t i : s.covered) ++first[i + 1];
    }
    for (size_t i = 0; i < points.size(); ++i) first[i + 1] += first[i];
    of_point.resize(first.back());
    std::vector<uint32_t> next(first.begin(), first.end() - 1);
    for (uint32_t s = 0; s < chosen.size(); ++s) {
        for (const uint32_t i : chosen[s].covered) of_point[next[i]++] = s;
    }
}

void GapFinder::startAt(uint32_t splat) {
    const Splat& of = drawn_.splats[splat];
    s_ = splat;
    origin_ = of.center;
    along_ = of.along, across_ = of.across(), normal_ = of.normal;
    gap_ = of.gap;
    slack_ = -1.0f;
}

Vec3 GapFinder::inFrame(const Vec3& v) const {
    return Vec3(glm::dot(v, along_), glm::dot(v, across_), glm::dot(v, normal_));
}

bool GapFinder::isOpenAt(const SplatDisc& own, const Vec2& on_circle, Vec2& wanted) {
    const Vec2 on_rim = own.middle + own.of_circle * on_circle;
    if (isBeyondCut(drawn_.splats[s_], on_rim)) return false;
    aimBeside(own, on_circle);
    if (lines_.n == 0) return false;
    if (!(glm::length(on_rim - around_) <= slack_)) lookAround(on_rim);
    // No line leaves the places that are looked at by more than its length.
    const float far = kDepth + kNoGap;
    for (const Other& other : others_) {
        const float most = other.reach + far * gap_;
        const Vec3 off = Vec3(on_rim, 0.0f) - other.center;
        if (glm::dot(off, off) > most * most) continue;
        strikeMet(other);
        if (lines_.n == 0) return false;
    }
    findPoints(on_rim);
    constexpr size_t kFewestAround = 3;
    if (points_.size() < kFewestAround) return false;
    for (size_t i = 0; i < size_t(lines_.n); ++i) {
        if (!isAmong(Vec3(lines_.qx[i], lines_.qy[i], lines_.qz[i]), lines_.direction[i])) continue;
        wanted = glm::mix(on_rim, Vec2(lines_.on_x[i], lines_.on_y[i]), kStep / kNoGap);
        return true;
    }
    return false;
}

void GapFinder::Lines::keep(int from, int to) {
    const size_t f = size_t(from), t = size_t(to);
    for (Lane* lane : {&qx, &qy, &qz, &dx, &dy, &dz, &on_x, &on_y}) (*lane)[t] = (*lane)[f];
    direction[t] = direction[f];
}

// The lines beside a place on the rim, of those that the splat may grow to and that meet it there.
void GapFinder::aimBeside(const SplatDisc& own, const Vec2& on_circle) {
    const Splat& splat = drawn_.splats[s_];
    const uint64_t turn = hashCombine(s_, uint64_t(std::lround(on_circle.x * 1e6f) + 1000000));
    turn_ = int(turn % kTurns);
    const auto& towards = directions()[size_t(turn_)];
    const Vec2 to_rim = own.of_circle * on_circle, on_rim = own.middle + to_rim,
               tangent = own.of_circle * Vec2(-on_circle.y, on_circle.x);
    // Away from the middle.
    const float side = tangent.y * to_rim.x < tangent.x * to_rim.y ? -1.0f : 1.0f;
    const auto growable = [&](float most) {
        return 1.0f / (Vec2(splat.long_radius, splat.short_radius) + most * gap_);
    };
    const Vec2 seen_aside = growable(kMostGap), seen_well = growable(kMostGapSeenWell);
    lines_.n = 0;
    for (size_t i = 0; i < kDirections; ++i) {
        const Vec3& d = towards[i].to;
        Vec3 off(tangent.y * d.z, -tangent.x * d.z, tangent.x * d.y - tangent.y * d.x);
        off *= side * kNoGap * gap_ / std::max(glm::length(off), 1e-30f);
        const Vec2 on_plane = on_rim + Vec2(off) - Vec2(d) * (off.z / d.z);
        constexpr float kMostOf = 0.75f;  // of the way there it may grow
        const Vec2 beside =
            glm::mix(on_rim, on_plane, kMostOf) * (d.z > kSeenWell ? seen_well : seen_aside);
        if (glm::dot(beside, beside) > 1.0f || isBeyondCut(splat, on_plane)) continue;
        const size_t n = size_t(lines_.n++);
        lines_.qx[n] = on_rim.x + off.x, lines_.qy[n] = on_rim.y + off.y, lines_.qz[n] = off.z;
        lines_.dx[n] = d.x, lines_.dy[n] = d.y, lines_.dz[n] = d.z;
        lines_.on_x[n] = on_plane.x, lines_.on_y[n] = on_plane.y;
        lines_.direction[n] = int(i);
    }
}

// Looks up the points around a place, those that face as the splat does, and what covers them.
void GapFinder::lookAround(const Vec2& at) {
    around_ = at;
    slack_ = kSlack * gap_;
    const Vec3 place = origin_ + along_ * at.x + across_ * at.y;
    drawn_.index.within(place, kAround * gap_ + slack_, near_);
    if (near_.size() > kMostLookedUp) {
        slack_ = 0.0f;
        const float most = kAround * gap_ * kAround * gap_;
        std::erase_if(near_, [&](const NearPoint& p) { return p.squared > most; });
        if (near_.size() > kMostAround) {
            std::nth_element(near_.begin(), near_.begin() + kMostAround, near_.end());
            near_.resize(kMostAround);
        }
    }
    std::sort(near_.begin(), near_.end());
    others_.clear(), facing_.clear();
    looked_up_[s_] = ++time_;
    for (const NearPoint& p : near_) {
        const SplatPoint& point = drawn_.points[p.index];
        if (glm::dot(point.normal, normal_) > 0.0f)
            facing_.push_back(inFrame(point.position - origin_));
        for (uint32_t k = drawn_.first[p.index]; k < drawn_.first[p.index + 1]; ++k) {
            const uint32_t t = drawn_.of_point[k];
            if (looked_up_[t] == time_) continue;
            looked_up_[t] = time_;
            addOther(t);
        }
    }
}

void GapFinder::addOther(uint32_t t) {
    const Splat& splat = drawn_.splats[t];
    const SplatDisc& disc = drawn_.discs[t];
    Other other;
    other.center = inFrame(disc.center - origin_);
    other.normal = inFrame(splat.normal);
    other.to_x = inFrame(disc.to_x);
    other.to_y = inFrame(disc.to_y);
    const glm::mat2& m = disc.of_circle;
    other.reach = std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]));
    other.is_alike = other.normal.z > 0.0f;
    other.n_cuts = splat.n_cuts;
    for (size_t c = 0; c < size_t(splat.n_cuts); ++c) {
        const Vec3& cut = splat.cuts[c];
        other.cut_to[c] = inFrame(splat.along * cut.x + splat.across() * cut.y);
        other.cut_end[c] = cut.z - glm::dot(Vec2(cut), disc.middle);
    }
    others_.push_back(other);
}

// Leaves out the lines that meet the other splat.
void GapFinder::strikeMet(const Other& other) {
    Lines& l = lines_;
    const float depth = kDepth * gap_;
    const int is_alike = other.is_alike;
    std::array<int, kDirections> is_missed;
    int n_missed = 0;
    const size_t n = size_t(l.n);
    for (size_t i = 0; i < n; ++i) {
        const Vec3 d(l.dx[i], l.dy[i], l.dz[i]);
        Vec3 off = Vec3(l.qx[i], l.qy[i], l.qz[i]) - other.center;
        const float facing = glm::dot(d, other.normal),
                    towards = -glm::dot(off, other.normal) / facing;
        off += d * towards;
        const float x = glm::dot(off, other.to_x), y = glm::dot(off, other.to_y);
        int is_met = int(std::abs(towards) <= depth) & int(x * x + y * y <= 1.0f) &
                     (is_alike | int(facing > 0.0f));
        for (size_t c = 0; c < size_t(other.n_cuts); ++c)
            is_met &= int(!(glm::dot(off, other.cut_to[c]) > other.cut_end[c]));
        is_missed[i] = 1 - is_met;
        n_missed += 1 - is_met;
    }
    if (n_missed == l.n) return;
    int kept = 0;
    for (int i = 0; i < l.n && n_missed > 0; ++i) {
        if (is_missed[size_t(i)]) l.keep(i, kept++);
    }
    l.n = kept;
}

// Of what was looked up, the points around a place.
void GapFinder::findPoints(const Vec2& at) {
    points_.clear();
    const Vec3 place(at, 0.0f);
    const float most = kAround * gap_ * kAround * gap_;
    const auto squared = [&](const Vec3& p) { return glm::dot(p - place, p - place); };
    for (const Vec3& p : facing_) {
        if (squared(p) <= most) points_.push_back(p);
    }
    if (points_.size() <= kMostAround) return;
    std::nth_element(points_.begin(), points_.begin() + kMostAround, points_.end(),
                     [&](const Vec3& a, const Vec3& b) { return squared(a) < squared(b); });
    points_.resize(kMostAround);
}

// Whether there are points on all sides of a place, seen from a direction: it is not beyond a
// silhouette or a border.
bool GapFinder::isAmong(const Vec3& q, int direction) const {
    const Direction& d = directions()[size_t(turn_)][size_t(direction)];
    // In which eighths of a turn there are any: three in a row without are too many, one is not.
    constexpr std::array<uint8_t, 8> kEighth = {5, 4, 6, 7, 2, 3, 1, 0};
    static_assert(kWidestTurn > 0.7499f * float(kPi) && kWidestTurn < 0.7501f * float(kPi));
    unsigned some = 0;
    for (const Vec3& p : points_) {
        const float a = glm::dot(p - q, d.u), b = glm::dot(p - q, d.v);
        const unsigned which = unsigned(b >= 0.0f) << 2 | unsigned(a >= 0.0f) << 1 |
                               unsigned(std::abs(a) >= std::abs(b));
        some |= 1u << kEighth[which];
        if (some == 0xffu) return true;
    }
    const unsigned none = ~some & 0xffu, next = (none >> 1 | none << 7) & 0xffu,
                   after = (none >> 2 | none << 6) & 0xffu;
    if (none & next & after) return false;
    return !(none & next) || isAmongExactly(q, direction);
}

bool GapFinder::isAmongExactly(const Vec3& q, int direction) const {
    const Direction& d = directions()[size_t(turn_)][size_t(direction)];
    std::array<float, kMostAround> angles;
    size_t n = 0;
    for (const Vec3& p : points_)
        angles[n++] = std::atan2(glm::dot(p - q, d.v), glm::dot(p - q, d.u));
    std::sort(angles.begin(), angles.begin() + n);
    float widest = 2.0f * float(kPi) + angles[0] - angles[n - 1];
    for (size_t i = 1; i < n; ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
    return widest < kWidestTurn;
}

}  // namespace stipple
