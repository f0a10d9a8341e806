// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_close.h>

#include <core/error.h>
#include <scenegraph/io/splat_gap.h>

#include <algorithm>

namespace stipple {

namespace {

// All in spacings of the splat's own point.
constexpr float kLeastGap = 0.1f;       // beyond the points, of those that begin
constexpr float kShareAtCrease = 0.1f;  // a gap, or so many half axes, of splats that creases cut
constexpr float kAlongRim = 0.35f;      // between the places that are looked at

// What creases cut has to reach the cut all along. And where the surface is so bent that splats
// hold no point but their own, narrow ones would cut off bumps and show the plane of a point
// farther away.
bool isWholeGap(const ChosenSplat& chosen) {
    return chosen.splat.n_cuts > 0 || chosen.covered.size() < 2;
}

SplatDisc firstDisc(const Splat& splat, bool is_whole_gap) {
    constexpr float kLeast = 1e-30f;
    const auto radius = [&](float covered) {
        const float gap =
            is_whole_gap ? std::max(splat.gap, kShareAtCrease * covered) : kLeastGap * splat.gap;
        return std::max(covered + gap, kLeast);
    };
    SplatDisc disc;
    disc.of_circle = glm::mat2(radius(splat.long_radius), 0.0f, 0.0f, radius(splat.short_radius));
    disc.place(splat);
    return disc;
}

// Grows the disc so that the place lies on it, as little as that takes elsewhere.
void enclose(const Splat& splat, const Vec2& p, SplatDisc& disc) {
    const Vec2 in_circle = disc.to_circle * (p - disc.middle);
    const float far = glm::length(in_circle);
    if (!(far > 1.0f)) return;
    // Touches the circle where it is farthest from the place, and is as curved there.
    const Vec2 to = in_circle / far;
    const float along = 0.5f * (1.0f + far), across = std::sqrt(along);
    disc.middle += disc.of_circle * (to * (along - 1.0f));
    disc.of_circle =
        disc.of_circle * (glm::mat2(across) + (along - across) * glm::outerProduct(to, to));
    disc.place(splat);
}

// The splat is the disc, no gap around it.
void apply(const SplatDisc& disc, Splat& splat) {
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

class SplatCloser {
public:
    SplatCloser(const SplatPoints& points, const PointIndex& index,
                const std::vector<ChosenSplat>& chosen, std::vector<Splat>& splats)
        : chosen_(chosen),
          splats_(splats),
          drawn_(points, index, chosen, splats),
          first_open_(splats.size(), 0) {
        for (size_t s = 0; s < splats.size(); ++s)
            drawn_.discs[s] = firstDisc(splats[s], isWholeGap(chosen[s]));
    }

    void close(ThreadPool& pool, const CancelFlag& cancel) {
        std::vector<GapFinder> finders(size_t(pool.threadCount()), GapFinder(drawn_));
        std::vector<uint32_t> open;
        for (uint32_t s = 0; s < splats_.size(); ++s) open.push_back(s);
        std::vector<uint8_t> is_open(splats_.size(), 0);
        while (!open.empty()) {
            if (cancel.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
            forEach(pool, open.size(), [&](size_t k, size_t thread) {
                is_open[open[k]] = isOpen(open[k], finders[thread]);
            });
            std::erase_if(open, [&](uint32_t s) { return !is_open[s]; });
            // Those that come first among their neighbours grow, so that no two close one gap.
            std::vector<uint32_t> growing;
            std::vector<uint8_t> is_first(open.size());
            forEach(pool, open.size(),
                    [&](size_t k, size_t) { is_first[k] = isFirst(open[k], is_open); });
            for (size_t k = 0; k < open.size(); ++k) {
                if (is_first[k]) growing.push_back(open[k]);
            }
            std::vector<SplatDisc> grown(growing.size());
            forEach(pool, growing.size(), [&](size_t k, size_t thread) {
                grown[k] = closed(growing[k], finders[thread]);
            });
            for (size_t k = 0; k < growing.size(); ++k) {
                drawn_.discs[growing[k]] = grown[k];
                is_open[growing[k]] = 0;
            }
            std::erase_if(open, [&](uint32_t s) { return !is_open[s]; });
        }
        for (size_t s = 0; s < splats_.size(); ++s) apply(drawn_.discs[s], splats_[s]);
    }

private:
    template <class Visit>
    static void forEach(ThreadPool& pool, size_t n, const Visit& visit) {
        constexpr size_t kChunk = 16;
        pool.forEach((n + kChunk - 1) / kChunk, [&](size_t chunk, int thread) {
            for (size_t k = chunk * kChunk; k < std::min(n, (chunk + 1) * kChunk); ++k)
                visit(k, size_t(thread));
        });
    }

    // Small ones grow first: that is where the surface is bent, and there others overlap most.
    bool isFirst(uint32_t s, const std::vector<uint8_t>& is_open) const {
        const auto areaOf = [&](uint32_t t) {
            return splats_[t].long_radius * splats_[t].short_radius;
        };
        for (const uint32_t i : chosen_[s].covered) {
            for (uint32_t k = drawn_.first[i]; k < drawn_.first[i + 1]; ++k) {
                const uint32_t t = drawn_.of_point[k];
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
    bool isOpen(uint32_t s, GapFinder& finder) {
        const int n = placesAlongRim(splats_[s]);
        finder.startAt(s);
        Vec2 wanted;
        for (int j = 0; j < n; ++j) {
            const int k = (j + first_open_[s]) % n;
            if (!finder.isOpenAt(drawn_.discs[s], onCircle(k, n), wanted)) continue;
            first_open_[s] = k;
            return true;
        }
        return false;
    }

    // As large as it takes that one could not, as far as it may.
    SplatDisc closed(uint32_t s, GapFinder& finder) const {
        constexpr int kMostSteps = 16;
        SplatDisc disc = drawn_.discs[s];
        const int n = placesAlongRim(splats_[s]);
        finder.startAt(s);
        Vec2 wanted;
        for (int k = 0; k < n; ++k) {
            for (int step = 0; step < kMostSteps; ++step) {
                if (!finder.isOpenAt(disc, onCircle(k, n), wanted)) break;
                enclose(splats_[s], wanted, disc);
            }
        }
        return disc;
    }

    const std::vector<ChosenSplat>& chosen_;
    std::vector<Splat>& splats_;
    DrawnSplats drawn_;
    std::vector<int> first_open_;  // a splat: the place along its rim
};

}  // namespace

void narrowGaps(const SplatPoints& points, const PointIndex& index,
                const std::vector<ChosenSplat>& chosen, std::vector<Splat>& splats,
                ThreadPool& pool, const CancelFlag& cancel) {
    SplatCloser(points, index, chosen, splats).close(pool, cancel);
}

}  // namespace stipple
