// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_choice.h>

#include <core/error.h>
#include <core/rng.h>

#include <algorithm>
#include <queue>

namespace stipple {

namespace {

// Each point is covered by so many candidates, or is one: more find hardly fewer splats.
constexpr uint8_t kCandidatesAPoint = 12;

void throwIfAsked(const CancelFlag& cancel) {
    if (cancel.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
}

// The splats of points here and there, grown as far as they go.
std::vector<ChosenSplat> growCandidates(const SplatPoints& points, const PointIndex& index,
                                        const SplatRules& rules, ThreadPool& pool,
                                        const CancelFlag& cancel,
                                        const std::function<void(double)>& progress) {
    const size_t n = points.size();
    std::vector<std::pair<uint64_t, uint32_t>> order;
    for (uint32_t i = 0; i < n; ++i) order.emplace_back(hashCombine(i, 29), i);
    std::sort(order.begin(), order.end());
    std::vector<ChosenSplat> candidates;
    std::vector<uint8_t> count(n, 0);  // of candidates that cover a point
    // In batches that are grown at once, small ones first: what they cover need not grow.
    size_t batch = 64;
    for (size_t begin = 0; begin < n; begin += batch) {
        if (begin > 0) batch = std::min<size_t>(2 * batch, 8192);
        throwIfAsked(cancel);
        progress(double(begin) / double(n));
        std::vector<uint32_t> seeds;
        for (size_t k = begin; k < std::min(n, begin + batch); ++k) {
            if (count[order[k].second] < kCandidatesAPoint) seeds.push_back(order[k].second);
        }
        const size_t first = candidates.size();
        candidates.resize(first + seeds.size());
        constexpr size_t kChunk = 16;
        pool.forEach((seeds.size() + kChunk - 1) / kChunk, [&](size_t chunk, int) {
            SplatGrower grower(points, index, rules);
            for (size_t k = chunk * kChunk; k < std::min(seeds.size(), (chunk + 1) * kChunk); ++k) {
                ChosenSplat& candidate = candidates[first + k];
                candidate.splat = grower.grow(seeds[k], kMostCovered);
                findCovered(candidate.splat, points, index, rules, candidate.covered);
                // Its own point, whatever rounding makes of it.
                std::erase(candidate.covered, seeds[k]);
                candidate.covered.insert(candidate.covered.begin(), seeds[k]);
            }
        });
        for (size_t k = first; k < candidates.size(); ++k) {
            for (const uint32_t i : candidates[k].covered)
                count[i] = uint8_t(std::min<int>(count[i] + 1, 255));
        }
    }
    return candidates;
}

// Of what covers most points that none covers yet, the next.
std::vector<ChosenSplat> chooseGreedily(std::vector<ChosenSplat> candidates, size_t n_points,
                                        const CancelFlag& cancel) {
    struct Gain {
        size_t points;
        uint32_t candidate;
        bool operator<(const Gain& o) const {
            return points != o.points ? points < o.points : candidate > o.candidate;
        }
    };
    std::priority_queue<Gain> queue;
    for (uint32_t c = 0; c < candidates.size(); ++c) queue.push({candidates[c].covered.size(), c});
    std::vector<uint8_t> is_covered(n_points, 0);
    std::vector<ChosenSplat> chosen;
    size_t steps = 0;
    while (!queue.empty()) {
        if (++steps % 4096 == 0) throwIfAsked(cancel);
        const Gain top = queue.top();
        queue.pop();
        ChosenSplat& candidate = candidates[top.candidate];
        const size_t gain = size_t(std::count_if(candidate.covered.begin(), candidate.covered.end(),
                                                 [&](uint32_t i) { return !is_covered[i]; }));
        if (gain == 0) {
            candidate = {};
        } else if (gain < top.points) {
            queue.push({gain, top.candidate});
        } else {
            for (const uint32_t i : candidate.covered) is_covered[i] = 1;
            chosen.push_back(std::move(candidate));
        }
    }
    return chosen;
}

// Splats all of whose points others cover go, small ones first.
void leaveOutCovered(std::vector<ChosenSplat>& splats, size_t n_points) {
    std::vector<uint32_t> count(n_points, 0), order;
    for (uint32_t s = 0; s < splats.size(); ++s) {
        order.push_back(s);
        for (const uint32_t k : splats[s].covered) ++count[k];
    }
    const auto areaOf = [&](uint32_t s) {
        return splats[s].splat.long_radius * splats[s].splat.short_radius;
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        return areaOf(a) != areaOf(b) ? areaOf(a) < areaOf(b) : a < b;
    });
    for (const uint32_t s : order) {
        std::vector<uint32_t>& covered = splats[s].covered;
        if (std::any_of(covered.begin(), covered.end(), [&](uint32_t k) { return count[k] <= 1; }))
            continue;
        for (const uint32_t k : covered) --count[k];
        covered.clear();
    }
    std::erase_if(splats, [](const ChosenSplat& s) { return s.covered.empty(); });
}

}  // namespace

void findCovered(const Splat& splat, const SplatPoints& points, const PointIndex& index,
                 const SplatRules& rules, std::vector<uint32_t>& covered) {
    covered.clear();
    index.forEachWithin(
        splat.center, splat.reach(rules.tolerance), [&](const PointIndex::Item& item) {
            // Points lie anywhere in memory: those beyond it are not waited for.
            if (isInside(splat, item.position) && covers(splat, points[item.index], rules))
                covered.push_back(item.index);
        });
}

std::vector<ChosenSplat> chooseSplats(const SplatPoints& points, const PointIndex& index,
                                      const SplatRules& rules, bool relax, ThreadPool& pool,
                                      const CancelFlag& cancel,
                                      const std::function<void(double fraction)>& progress) {
    std::vector<ChosenSplat> splats =
        chooseGreedily(growCandidates(points, index, rules, pool, cancel,
                                      [&](double fraction) { progress(0.9 * fraction); }),
                       points.size(), cancel);
    if (relax) leaveOutCovered(splats, points.size());
    return splats;
}

std::vector<ChosenSplat> splatEachPoint(const SplatPoints& points) {
    std::vector<ChosenSplat> splats(points.size());
    for (uint32_t i = 0; i < points.size(); ++i) {
        const SplatPoint& p = points[i];
        Vec3 along, across;
        tangents(p.normal, along, across);
        splats[i] = {{.center = p.position,
                      .normal = p.normal,
                      .along = along,
                      .long_radius = p.spacing,
                      .short_radius = p.spacing,
                      .gap = 0.8f * p.spacing,
                      .color = p.color,
                      .finish = p.finish,
                      .shading_normal = p.normal},
                     {i}};
    }
    return splats;
}

}  // namespace stipple
