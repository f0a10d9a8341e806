// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_close.h>

#include <core/error.h>
#include <core/rng.h>

#include <algorithm>
#include <array>
#include <bit>

namespace stipple {

namespace {

// All in spacings of the splat's own point.
constexpr float kLeastGap = 0.1f;  // beyond the points, of those that begin
constexpr float kNoGap = 0.25f;    // what is narrower is none
// Beyond the points at most: a gap that is seen well is closed even where these are farther apart.
constexpr float kMostGap = 1.0f, kMostGapSeenWell = 1.5f, kSeenWell = 0.7f;  // the last a cosine
constexpr float kGapAtCrease = 1.15f;   // gaps, of splats that creases cut
constexpr float kShareAtCrease = 0.1f;  // or so many half axes there: large splats are flat
constexpr float kStep = 0.1f;           // by which splats grow
constexpr float kAlongRim = 0.35f;      // between the places that are looked at
constexpr float kAround = 2.5f;         // points up to there lie around a place
constexpr float kDepth = 3.0f;          // what lies deeper or higher is another surface
// Seen from aside noise puts points on all sides of what stands out: no turn as wide without any.
constexpr float kWidestTurn = 0.75f * float(kPi);
constexpr int kDirections = 32, kTurns = 16;

// What is drawn of a splat: an ellipse in its plane, the image of the unit circle.
struct Disc {
    Vec2 middle = Vec2(0);  // in the splat's frame
    glm::mat2 of_circle = glm::mat2(1.0f), to_circle = glm::mat2(1.0f);
    Vec3 center = Vec3(0), to_x = Vec3(0), to_y = Vec3(0);  // the same in space
};

bool isCut(const Splat& splat, const Vec2& p) {
    for (int c = 0; c < splat.n_cuts; ++c) {
        const Vec3& cut = splat.cuts[size_t(c)];
        if (glm::dot(Vec2(cut), p) > cut.z) return true;
    }
    return false;
}

void place(const Splat& splat, Disc& disc) {
    const Vec3 across = splat.across();
    disc.to_circle = glm::inverse(disc.of_circle);
    disc.center = splat.center + splat.along * disc.middle.x + across * disc.middle.y;
    const glm::mat2& m = disc.to_circle;
    disc.to_x = splat.along * m[0][0] + across * m[1][0];
    disc.to_y = splat.along * m[0][1] + across * m[1][1];
}

// at_crease: it is cut, and has to reach the cut all along.
Disc firstDisc(const Splat& splat, bool at_crease) {
    constexpr float kLeast = 1e-30f;
    const auto radius = [&](float covered) {
        const float gap = at_crease ? std::max(kGapAtCrease * splat.gap, kShareAtCrease * covered)
                                    : kLeastGap * splat.gap;
        return std::max(covered + gap, kLeast);
    };
    Disc disc;
    disc.of_circle = glm::mat2(radius(splat.long_radius), 0.0f, 0.0f, radius(splat.short_radius));
    place(splat, disc);
    return disc;
}

// Grows the disc so that the place lies on it, as little as that takes elsewhere.
void enclose(const Splat& splat, const Vec2& p, Disc& disc) {
    const Vec2 in_circle = disc.to_circle * (p - disc.middle);
    const float far = glm::length(in_circle);
    if (!(far > 1.0f)) return;
    // Touches the circle where it is farthest from the place, and is as curved there.
    const Vec2 to = in_circle / far;
    const float along = 0.5f * (1.0f + far), across = std::sqrt(along);
    disc.middle += disc.of_circle * (to * (along - 1.0f));
    disc.of_circle =
        disc.of_circle * (glm::mat2(across) + (along - across) * glm::outerProduct(to, to));
    place(splat, disc);
}

// The splat is the disc, no gap around it.
void apply(const Disc& disc, Splat& splat) {
    // The half axes are those of the matrix times its transpose.
    const glm::mat2 p = disc.of_circle * glm::transpose(disc.of_circle);
    const float mean = 0.5f * (p[0][0] + p[1][1]), half = 0.5f * (p[0][0] - p[1][1]),
                root = std::sqrt(half * half + p[1][0] * p[1][0]);
    const float angle = 0.5f * std::atan2(p[1][0], half);
    const Vec2 to(std::cos(angle), std::sin(angle));
    splat.along = glm::normalize(splat.along * to.x + splat.across() * to.y);
    splat.center = disc.center;
    splat.long_radius = std::sqrt(mean + root);
    splat.short_radius = std::sqrt(std::max(mean - root, 0.0f));
    splat.gap = 0.0f;
    for (int c = 0; c < splat.n_cuts; ++c) {
        Vec3& cut = splat.cuts[size_t(c)];
        const Vec2 line(cut);
        cut = Vec3(glm::dot(line, to), line.y * to.x - line.x * to.y,
                   std::max(cut.z - glm::dot(line, disc.middle), 0.0f));
    }
}

// Unit vectors evenly over the half sphere around z, each time turned by another angle.
std::array<std::array<Vec3, kDirections>, kTurns> makeDirections() {
    constexpr float kTurn = 2.0f * float(kPi), kGolden = 0.618034f;
    std::array<std::array<Vec3, kDirections>, kTurns> directions;
    for (int turn = 0; turn < kTurns; ++turn) {
        for (int i = 0; i < kDirections; ++i) {
            const float z = (float(i) + 0.5f) / float(kDirections), r = std::sqrt(1.0f - z * z),
                        at = kTurn * (kGolden * float(i) + float(turn) / float(kTurns));
            directions[size_t(turn)][size_t(i)] = Vec3(r * std::cos(at), r * std::sin(at), z);
        }
    }
    return directions;
}

class SplatCloser {
public:
    SplatCloser(const SplatPoints& points, const PointIndex& index,
                const std::vector<ChosenSplat>& chosen, std::vector<Splat>& splats)
        : points_(points),
          index_(index),
          chosen_(chosen),
          splats_(splats),
          first_open_(splats.size(), 0),
          directions_(makeDirections()) {
        first_.assign(points.size() + 1, 0);
        for (const ChosenSplat& s : chosen) {
            for (const uint32_t i : s.covered) ++first_[i + 1];
        }
        for (size_t i = 0; i < points.size(); ++i) first_[i + 1] += first_[i];
        of_point_.resize(first_.back());
        std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
        for (uint32_t s = 0; s < chosen.size(); ++s) {
            for (const uint32_t i : chosen[s].covered) of_point_[next[i]++] = s;
        }
        for (size_t s = 0; s < splats.size(); ++s)
            discs_.push_back(firstDisc(splats[s], chosen[s].splat.n_cuts > 0));
    }

    void close(ThreadPool& pool, const CancelFlag& cancel) {
        std::vector<uint32_t> open;
        for (uint32_t s = 0; s < splats_.size(); ++s) open.push_back(s);
        std::vector<uint8_t> is_open(splats_.size(), 0);
        while (!open.empty()) {
            if (cancel.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
            forEach(pool, open.size(), [&](size_t k, Scratch& scratch) {
                is_open[open[k]] = isOpen(open[k], scratch);
            });
            std::erase_if(open, [&](uint32_t s) { return !is_open[s]; });
            // Those that come first among their neighbours grow, so that no two close one gap.
            std::vector<uint32_t> growing;
            for (const uint32_t s : open) {
                if (isFirst(s, is_open)) growing.push_back(s);
            }
            std::vector<Disc> grown(growing.size());
            forEach(pool, growing.size(),
                    [&](size_t k, Scratch& scratch) { grown[k] = closed(growing[k], scratch); });
            for (size_t k = 0; k < growing.size(); ++k) {
                discs_[growing[k]] = grown[k];
                is_open[growing[k]] = 0;
            }
            std::erase_if(open, [&](uint32_t s) { return !is_open[s]; });
        }
        for (size_t s = 0; s < splats_.size(); ++s) apply(discs_[s], splats_[s]);
    }

private:
    struct Scratch {
        std::vector<NearPoint> near;
        std::vector<uint32_t> around;
        std::vector<float> angles;
    };

    template <class Visit>
    static void forEach(ThreadPool& pool, size_t n, const Visit& visit) {
        constexpr size_t kChunk = 16;
        pool.forEach((n + kChunk - 1) / kChunk, [&](size_t chunk, int) {
            Scratch scratch;
            for (size_t k = chunk * kChunk; k < std::min(n, (chunk + 1) * kChunk); ++k)
                visit(k, scratch);
        });
    }

    // Small ones grow first: that is where the surface is bent, and there others overlap most.
    bool isFirst(uint32_t s, const std::vector<uint8_t>& is_open) const {
        const auto areaOf = [&](uint32_t t) {
            return splats_[t].long_radius * splats_[t].short_radius;
        };
        for (const uint32_t i : chosen_[s].covered) {
            for (uint32_t k = first_[i]; k < first_[i + 1]; ++k) {
                const uint32_t t = of_point_[k];
                if (!is_open[t] || t == s) continue;
                if (areaOf(t) != areaOf(s) ? areaOf(t) < areaOf(s) : t < s) return false;
            }
        }
        return true;
    }

    int placesAlongRim(const Splat& splat) const {
        constexpr int kFewest = 8, kMost = 1024;
        const float length = 2.0f * float(kPi) * (splat.long_radius + splat.gap);
        return splat.gap > 0.0f
                   ? int(std::clamp(length / (kAlongRim * splat.gap), float(kFewest), float(kMost)))
                   : 0;
    }

    static Vec2 onCircle(int k, int n) {
        const float angle = 2.0f * float(kPi) * (float(k) + 0.5f) / float(n);
        return Vec2(std::cos(angle), std::sin(angle));
    }

    // Whether one could look through beside the splat; begins where one could the last time.
    bool isOpen(uint32_t s, Scratch& scratch) {
        const int n = placesAlongRim(splats_[s]);
        Vec2 wanted;
        for (int j = 0; j < n; ++j) {
            const int k = (j + first_open_[s]) % n;
            if (!isOpenAt(s, discs_[s], onCircle(k, n), scratch, wanted)) continue;
            first_open_[s] = k;
            return true;
        }
        return false;
    }

    // As large as it takes that one could not, as far as it may.
    Disc closed(uint32_t s, Scratch& scratch) const {
        constexpr int kMostSteps = 16;
        Disc disc = discs_[s];
        const int n = placesAlongRim(splats_[s]);
        Vec2 wanted;
        for (int k = 0; k < n; ++k) {
            for (int step = 0; step < kMostSteps; ++step) {
                if (!isOpenAt(s, disc, onCircle(k, n), scratch, wanted)) break;
                enclose(splats_[s], wanted, disc);
            }
        }
        return disc;
    }

    // Whether one could look through beside a place on the rim: from some direction a line there
    // meets none of the splats around, but the wide splat, and has points on all sides. wanted: a
    // place in the splat's plane that would be on it then.
    bool isOpenAt(uint32_t s, const Disc& own, const Vec2& on_circle, Scratch& scratch,
                  Vec2& wanted) const {
        const Splat& splat = splats_[s];
        const Vec3 across = splat.across();
        const Vec2 to_rim = own.of_circle * on_circle, on_rim = own.middle + to_rim,
                   tangent = own.of_circle * Vec2(-on_circle.y, on_circle.x);
        if (isCut(splat, on_rim)) return false;
        const auto inSpace = [&](const Vec2& v) { return splat.along * v.x + across * v.y; };
        const Vec3 outwards = inSpace(to_rim), at = own.center + outwards;
        findNear(s, at, scratch.near);
        const uint64_t turn = hashCombine(s, uint64_t(std::lround(on_circle.x * 1e6f) + 1000000));
        const auto& directions = directions_[size_t(turn % kTurns)];
        std::array<Vec3, kDirections> from, q;
        std::array<Vec2, kDirections> on_plane;
        uint32_t open = 0;
        for (size_t i = 0; i < kDirections; ++i) {
            const Vec3& d = directions[i];
            from[i] = inSpace(Vec2(d)) + splat.normal * d.z;
            Vec3 off = glm::cross(inSpace(tangent), from[i]);
            off *= kNoGap * splat.gap / std::max(glm::length(off), 1e-30f);
            if (glm::dot(off, outwards) < 0.0f) off = -off;
            q[i] = at + off;
            const Vec3 on = off - from[i] * (glm::dot(off, splat.normal) / d.z);
            on_plane[i] = on_rim + Vec2(glm::dot(on, splat.along), glm::dot(on, across));
            const float most = splat.gap * (d.z > kSeenWell ? kMostGapSeenWell : kMostGap);
            constexpr float kMostOf = 0.75f;  // of the way there it may grow
            const Vec2 beside = glm::mix(on_rim, on_plane[i], kMostOf) /
                                (Vec2(splat.long_radius, splat.short_radius) + most);
            if (glm::dot(beside, beside) > 1.0f || isCut(splat, on_plane[i])) continue;
            open |= 1u << i;
        }
        open = missedByOthers(s, q, from, open, scratch);
        std::erase_if(scratch.near, [&](const NearPoint& p) {
            return glm::dot(points_[p.index].normal, splat.normal) <= 0.0f;
        });
        constexpr size_t kFewestAround = 3;
        if (scratch.near.size() < kFewestAround) return false;
        for (; open; open &= open - 1) {
            const size_t i = size_t(std::countr_zero(open));
            if (!isAmong(scratch, q[i], from[i])) continue;
            wanted = glm::mix(on_rim, on_plane[i], kStep / kNoGap);
            return true;
        }
        return false;
    }

    // The points around a place, nearest first.
    void findNear(uint32_t s, const Vec3& at, std::vector<NearPoint>& near) const {
        constexpr size_t kMostNear = 64;
        index_.within(at, kAround * splats_[s].gap, near);
        if (near.size() > kMostNear) {
            std::nth_element(near.begin(), near.begin() + kMostNear, near.end());
            near.resize(kMostNear);
        }
        std::sort(near.begin(), near.end());
    }

    // Of lines through places, those that meet none of what covers the points around.
    uint32_t missedByOthers(uint32_t s, const std::array<Vec3, kDirections>& q,
                            const std::array<Vec3, kDirections>& from, uint32_t open,
                            Scratch& scratch) const {
        std::vector<uint32_t>& around = scratch.around;
        around.clear();
        const float depth = kDepth * splats_[s].gap;
        for (const NearPoint& p : scratch.near) {
            for (uint32_t k = first_[p.index]; k < first_[p.index + 1]; ++k) {
                if (!open) return 0;
                const uint32_t t = of_point_[k];
                if (t == s || std::find(around.begin(), around.end(), t) != around.end()) continue;
                around.push_back(t);
                const Splat& other = splats_[t];
                const bool is_alike = glm::dot(other.normal, splats_[s].normal) > 0.0f;
                for (uint32_t left = open; left; left &= left - 1) {
                    const size_t i = size_t(std::countr_zero(left));
                    if (!is_alike && glm::dot(other.normal, from[i]) <= 0.0f) continue;
                    if (isMet(t, q[i], from[i], depth)) open &= ~(1u << i);
                }
            }
        }
        return open;
    }

    bool isMet(uint32_t t, const Vec3& q, const Vec3& from, float depth) const {
        const Splat& splat = splats_[t];
        const Disc& disc = discs_[t];
        Vec3 off = q - disc.center;
        const float along = -glm::dot(off, splat.normal) / glm::dot(from, splat.normal);
        if (!(std::abs(along) <= depth)) return false;
        off += from * along;
        const float x = glm::dot(off, disc.to_x), y = glm::dot(off, disc.to_y);
        if (!(x * x + y * y <= 1.0f)) return false;
        if (splat.n_cuts == 0) return true;
        const Vec3 in_frame = off + disc.center - splat.center;
        return !isCut(splat,
                      Vec2(glm::dot(in_frame, splat.along), glm::dot(in_frame, splat.across())));
    }

    // Whether there are points on all sides of a place, seen from a direction: it is not beyond a
    // silhouette or a border.
    bool isAmong(Scratch& scratch, const Vec3& q, const Vec3& from) const {
        Vec3 u, v;
        tangents(from, u, v);
        std::vector<float>& angles = scratch.angles;
        angles.clear();
        for (const NearPoint& p : scratch.near) {
            const Vec3 off = points_[p.index].position - q;
            angles.push_back(std::atan2(glm::dot(off, v), glm::dot(off, u)));
        }
        std::sort(angles.begin(), angles.end());
        float widest = 2.0f * float(kPi) + angles.front() - angles.back();
        for (size_t i = 1; i < angles.size(); ++i)
            widest = std::max(widest, angles[i] - angles[i - 1]);
        return widest < kWidestTurn;
    }

    const SplatPoints& points_;
    const PointIndex& index_;
    const std::vector<ChosenSplat>& chosen_;
    std::vector<Splat>& splats_;
    std::vector<Disc> discs_;                 // a splat
    std::vector<int> first_open_;             // a splat: the place along its rim
    std::vector<uint32_t> first_, of_point_;  // what covers a point
    const std::array<std::array<Vec3, kDirections>, kTurns> directions_;
};

}  // namespace

void narrowGaps(const SplatPoints& points, const PointIndex& index,
                const std::vector<ChosenSplat>& chosen, std::vector<Splat>& splats,
                ThreadPool& pool, const CancelFlag& cancel) {
    SplatCloser(points, index, chosen, splats).close(pool, cancel);
}

}  // namespace stipple
