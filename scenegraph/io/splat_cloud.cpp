// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_cloud.h>

#include <core/error.h>
#include <scenegraph/io/splat_bend.h>
#include <scenegraph/io/splat_border.h>
#include <scenegraph/io/splat_choice.h>
#include <scenegraph/io/splat_pack.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr size_t kMostPoints = size_t(1) << 27;
// A removed point leaves no hole if another lies within so many spacings.
constexpr float kStillClosed = 1.5f;

void checkPoints(const std::vector<CloudPoint>& points, size_t n_before) {
    if (points.size() + n_before > kMostPoints)
        throw Error(ErrorCode::kInvalidArgument, "", "more than 2^27 points");
    for (const CloudPoint& p : points) {
        constexpr double kMostCoordinate = 1e15;
        if (!(std::abs(p.position.x) < kMostCoordinate &&
              std::abs(p.position.y) < kMostCoordinate && std::abs(p.position.z) < kMostCoordinate))
            throw Error(ErrorCode::kInvalidArgument, "", "a point's coordinate is no number");
    }
}

}  // namespace

SplatCloud::SplatCloud(const std::vector<CloudPoint>& points, const SplatOptions& options,
                       ThreadPool& pool, const SurfelFinish& finish)
    : options_(options), finish_(finish) {
    checkPoints(points, 0);
    DBox3 bounds;
    for (const CloudPoint& p : points) bounds.extend(p.position);
    if (!points.empty()) middle_ = bounds.center();
    rules_ = rulesOf(options, points.empty() ? 1.0 : glm::length(bounds.extent()));
    std::vector<Vec3> positions;
    for (const CloudPoint& p : points) {
        points_.push_back(pointOf(p));
        positions.push_back(points_.back().position);
    }
    index_.build(positions);
    is_there_.assign(points.size(), 1);
    splats_of_.resize(points.size());
    if (points.empty()) return;
    const CancelFlag cancel;
    findNormals(points_, index_, options.neighbours, pool, cancel);
    for (const ChosenSplat& s :
         chooseSplats(points_, index_, rules_, options.relax, pool, cancel, [](double) {}))
        add(s.splat, s.covered);
}

SplatPoint SplatCloud::pointOf(const CloudPoint& point) const {
    SplatPoint p;
    p.position = Vec3(point.position - middle_);
    const float length = glm::length(point.normal);
    if (length > 0.0f && length < 1e30f) p.normal = point.normal / length;
    p.color = point.color;
    p.roughness = 1.0f / 3.0f;  // until its plane is known
    return p;
}

// Points below n_turned are right.
void SplatCloud::turnAsNeighbours(uint32_t i, uint32_t n_turned) {
    float most = 0.0f;
    for (const NearPoint& p : near_) {
        if (p.index >= n_turned || p.index == i) continue;
        const float dot = glm::dot(points_[p.index].normal, points_[i].normal);
        if (std::abs(dot) > std::abs(most)) most = dot;
    }
    if (most < 0.0f) points_[i].normal *= -1.0f;
}

uint32_t SplatCloud::append(const std::vector<CloudPoint>& points) {
    checkPoints(points, points_.size());
    const uint32_t first = uint32_t(points_.size()), end = first + uint32_t(points.size());
    for (const CloudPoint& p : points) {
        index_.insert(uint32_t(points_.size()), pointOf(p).position);
        points_.push_back(pointOf(p));
    }
    is_there_.resize(end, 1);
    splats_of_.resize(end);
    std::vector<uint32_t> wrong;
    std::vector<NearPoint> more;
    for (uint32_t i = first; i < end; ++i) {
        const bool is_given = points_[i].normal != Vec3(0.0f);
        fitPlane(points_, index_, options_.neighbours, i, near_);
        if (points_[i].normal == Vec3(0.0f)) points_[i].normal = Vec3(0, 1, 0);
        if (!is_given) turnAsNeighbours(i, i);
        const Vec3 beside = normalBesideCrease(points_, index_, options_.neighbours, i, more);
        points_[i].is_at_crease = beside != Vec3(0.0f);
        if (points_[i].is_at_crease) points_[i].normal = beside;
        placeBySplats(i, wrong);
        changed_.push_back(i);
    }
    removeSplats(wrong);
    coverUncovered();
    return first;
}

// What covers its neighbours (near_) may cover it, or may not be what a cloud with it would have.
void SplatCloud::placeBySplats(uint32_t i, std::vector<uint32_t>& wrong) {
    // They lie anywhere in memory: to wait for all at once takes less time.
    for (const NearPoint& p : near_) __builtin_prefetch(&splats_of_[p.index]);
    for (const NearPoint& p : near_) __builtin_prefetch(splats_of_[p.index].data());
    std::vector<uint32_t> tried;
    for (const NearPoint& p : near_) {
        if (p.index == i) continue;
        for (const uint32_t s : splats_of_[p.index]) {
            if (std::find(tried.begin(), tried.end(), s) != tried.end()) continue;
            tried.push_back(s);
            if (covers(splats_[s].splat, points_[i], rules_)) {
                link(i, s);
            } else if (contradicts(points_[i], splats_[s].splat, rules_) &&
                       4 * ++splats_[s].n_against > splats_[s].n_points) {
                wrong.push_back(s);
            }
        }
    }
    if (splats_of_[i].empty()) uncovered_.push_back(i);
}

void SplatCloud::remove(const std::vector<uint32_t>& numbers) {
    std::vector<uint32_t> sorted = numbers;
    std::sort(sorted.begin(), sorted.end());
    if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
        throw Error(ErrorCode::kInvalidArgument, "", "a point is to be removed twice");
    for (const uint32_t i : numbers) {
        if (i >= points_.size() || !is_there_[i]) {
            throw Error(ErrorCode::kInvalidArgument, "",
                        "there is no point " + std::to_string(i) + " to remove");
        }
    }
    for (const uint32_t i : numbers) {
        index_.remove(i, points_[i].position);
        is_there_[i] = 0;
    }
    changed_.insert(changed_.end(), numbers.begin(), numbers.end());
    std::vector<uint32_t> wrong;
    for (const uint32_t i : numbers) {
        index_.nearest(points_[i].position, 1, near_);
        const float closed = kStillClosed * points_[i].spacing;
        const bool opens_hole = near_.empty() || near_[0].squared > closed * closed;
        for (const uint32_t s : splats_of_[i]) {
            Placed& placed = splats_[s];
            if (splats_of_[i].size() == 1 && --placed.n_alone == 0) not_needed_.push_back(s);
            if (--placed.n_points == 0) {
                unused_.push_back(s);
            } else if (opens_hole && 2 * placed.n_points < placed.n_first) {
                wrong.push_back(s);
            }
        }
        splats_of_[i].clear();
    }
    removeSplats(wrong);
    coverUncovered();
}

void SplatCloud::add(const Splat& splat, const std::vector<uint32_t>& covered) {
    uint32_t s = uint32_t(splats_.size());
    if (unused_.empty()) {
        splats_.emplace_back();
    } else {
        s = unused_.back();
        unused_.pop_back();
    }
    splats_[s] = {.splat = splat, .n_first = uint32_t(covered.size())};
    for (const uint32_t i : covered) link(i, s);
}

void SplatCloud::link(uint32_t point, uint32_t s) {
    std::vector<uint32_t>& of_point = splats_of_[point];
    if (of_point.empty()) {
        ++splats_[s].n_alone;
    } else if (of_point.size() == 1 && --splats_[of_point[0]].n_alone == 0) {
        not_needed_.push_back(of_point[0]);
    }
    of_point.push_back(s);
    ++splats_[s].n_points;
}

// May name a splat more than once, or one that is gone.
void SplatCloud::removeSplats(const std::vector<uint32_t>& splats) {
    for (const uint32_t s : splats) {
        Placed& placed = splats_[s];
        if (placed.n_points == 0) continue;
        index_.within(placed.splat.center, placed.splat.reach(rules_.tolerance), near_);
        for (const NearPoint& p : near_) {
            std::vector<uint32_t>& of_point = splats_of_[p.index];
            const auto found = std::find(of_point.begin(), of_point.end(), s);
            if (found == of_point.end()) continue;
            of_point.erase(found);
            if (of_point.empty()) {
                uncovered_.push_back(p.index);
            } else if (of_point.size() == 1) {
                ++splats_[of_point[0]].n_alone;
            }
        }
        placed.n_points = 0;
        unused_.push_back(s);
    }
}

// Greedy, but among a few candidates at a time, none much larger than what is to be covered.
void SplatCloud::coverUncovered() {
    constexpr size_t kCandidates = 3, kFewest = 64;
    SplatGrower grower(points_, index_, rules_);
    std::vector<uint32_t> covered, most_covered;
    while (!uncovered_.empty()) {
        Splat best;
        size_t most = 0;
        const size_t n = uncovered_.size(), n_tried = std::min(n, kCandidates);
        for (size_t c = 0; c < n_tried; ++c) {
            const uint32_t seed = uncovered_[(2 * c + 1) * n / (2 * n_tried)];
            const Splat splat = grower.grow(seed, std::clamp(2 * n, kFewest, kMostCovered));
            findCovered(splat, points_, index_, rules_, covered);
            if (std::find(covered.begin(), covered.end(), seed) == covered.end())
                covered.push_back(seed);
            size_t gain = 0;
            for (const uint32_t i : covered) gain += splats_of_[i].empty();
            if (gain <= most) continue;
            most = gain;
            best = splat;
            most_covered = covered;
        }
        add(best, most_covered);
        std::erase_if(uncovered_, [&](uint32_t i) { return !splats_of_[i].empty(); });
    }
    for (const uint32_t s : not_needed_) {
        if (splats_[s].n_alone == 0) removeSplats({s});
    }
    not_needed_.clear();
}

void SplatCloud::drawChanged() {
    constexpr size_t kMostPairs = size_t(1) << 27;  // beyond, all are made anew
    const bool are_many = changed_.size() * splats_.size() > kMostPairs;
    std::vector<uint32_t> covered;
    for (Placed& placed : splats_) {
        if (placed.n_points == 0) continue;
        const float reach =
            std::max(drawnReach(placed.splat), placed.splat.reach(rules_.tolerance));
        const auto isReached = [&](uint32_t point) {
            const Vec3 d = points_[point].position - placed.splat.center;
            return glm::dot(d, d) <= reach * reach;
        };
        if (placed.is_drawn && !are_many &&
            std::none_of(changed_.begin(), changed_.end(), isReached))
            continue;
        placed.drawn = placed.splat;
        findCovered(placed.splat, points_, index_, rules_, covered);
        bendNormals(points_, covered, placed.drawn);
        if (rules_.has_cuts) cutAtBorders(index_, placed.drawn);
        placed.is_drawn = true;
    }
    changed_.clear();
}

SurfelModel SplatCloud::model() {
    DBox3 bounds;
    double area = 0.0;
    for (size_t i = 0; i < points_.size(); ++i) {
        if (!is_there_[i]) continue;
        bounds.extend(middle_ + DVec3(points_[i].position));
        area += areaOf(points_[i]);
    }
    if (bounds.isEmpty())
        throw Error(ErrorCode::kInvalidScene, "", "a cloud has no points to make splats of");
    drawChanged();
    std::vector<Splat> splats;
    for (const Placed& placed : splats_) {
        if (placed.n_points > 0) splats.push_back(placed.drawn);
    }
    SurfelFinish finish = finish_;
    finish.patch_width = float(glm::length(bounds.extent()));
    return packSplats(splats, {finish}, middle_, enclosingFloatBox(bounds), area);
}

}  // namespace stipple
