// SPDX-License-Identifier: Apache-2.0
// Growing clouds of splats: after any edits all points lie within the tolerance of a splat, there
// are about as many as in a fresh build, and what is asked wrongly changes nothing. And their index
// of points beside a search of all.
#include <core/error.h>
#include <core/rng.h>
#include <gtest/gtest.h>
#include <scenegraph/io/splat_cloud.h>
#include <scenegraph/io/surfel_file.h>

#include <algorithm>

namespace stipple {
namespace {

CloudPoint onSphere(double z, double angle, double radius = 1.0) {
    const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
    const DVec3 p(r * std::cos(angle), z, r * std::sin(angle));
    return {p * radius, Vec3(0), Vec3(0.8f)};
}

std::vector<CloudPoint> sphere(int n, double radius = 1.0) {
    std::vector<CloudPoint> points;
    for (int i = 0; i < n; ++i)
        points.push_back(onSphere(1.0 - (2.0 * i + 1.0) / n, 2.399963 * i, radius));
    return points;
}

// Of the points, how many no splat of the model covers, and how many face inwards.
size_t uncovered(const std::vector<CloudPoint>& points, const SurfelModel& model,
                 double tolerance) {
    const SurfelLevel& level = model.levels[0];
    std::vector<Surfel> splats;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i)
            splats.push_back(unpackSurfel(level, block, i));
    }
    size_t count = 0;
    for (const CloudPoint& p : points) {
        const bool is_covered = std::any_of(splats.begin(), splats.end(), [&](const Surfel& s) {
            const Vec3 d = Vec3(p.position) - s.position;
            const std::array<Vec3, 2> axes = s.axes();
            const float radius = level.spacing * s.radius_share * kDiscSide / kSidePerRadius;
            const float u = glm::dot(d, axes[0]) / glm::dot(axes[0], axes[0]) / radius,
                        v = glm::dot(d, axes[1]) / glm::dot(axes[1], axes[1]) / radius;
            // Positions are kept in steps of a block.
            return u * u + v * v <= 1.01f &&
                   std::abs(glm::dot(d, s.normal)) <= float(tolerance) * 1.5f;
        });
        count += !is_covered;
    }
    return count;
}

SplatOptions coarse() {
    SplatOptions options;
    options.tolerance = 0.3;
    return options;
}

TEST(SplatCloud, growsToWhatAFreshBuildMakes) {
    ThreadPool pool(2);
    std::vector<CloudPoint> all = sphere(8000);
    SplatCloud fresh(all, coarse(), pool);
    // The upper half first, then the rest by hundreds.
    std::sort(all.begin(), all.end(),
              [](const CloudPoint& a, const CloudPoint& b) { return a.position.y > b.position.y; });
    SplatCloud cloud({all.begin(), all.begin() + 4000}, coarse(), pool);
    const double tolerance = cloud.tolerance();
    for (size_t i = 4000; i < all.size(); i += 100) {
        EXPECT_EQ(
            cloud.append({all.begin() + std::ptrdiff_t(i), all.begin() + std::ptrdiff_t(i) + 100}),
            uint32_t(i));
    }
    EXPECT_EQ(cloud.pointCount(), 8000u);
    EXPECT_EQ(uncovered(all, cloud.model(), tolerance), 0u);
    EXPECT_EQ(uncovered(all, fresh.model(), fresh.tolerance()), 0u);
    // Its tolerance is that of the half sphere, 0.87 of the other.
    EXPECT_LT(double(cloud.splatCount()), 1.6 * double(fresh.splatCount()));
    checkSurfelModel(cloud.model(), "cloud");
    // Facing outwards, though no normals were given.
    const SurfelModel model = cloud.model();
    for (const SurfelBlock& block : model.levels[0].blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(model.levels[0], block, i);
            EXPECT_GT(glm::dot(s.normal, glm::normalize(s.position)), 0.9f);
        }
    }
}

TEST(SplatCloud, shrinksToWhatIsLeft) {
    ThreadPool pool(2);
    const std::vector<CloudPoint> all = sphere(8000);
    SplatCloud cloud(all, coarse(), pool);
    std::vector<uint32_t> numbers;
    std::vector<CloudPoint> left;
    for (uint32_t i = 0; i < all.size(); ++i) {
        if (all[i].position.y > 0.2) {
            numbers.push_back(i);
        } else {
            left.push_back(all[i]);
        }
    }
    for (size_t i = 0; i < numbers.size(); i += 100) {
        cloud.remove({numbers.begin() + std::ptrdiff_t(i),
                      numbers.begin() + std::ptrdiff_t(std::min(i + 100, numbers.size()))});
    }
    EXPECT_EQ(cloud.pointCount(), left.size());
    const SurfelModel model = cloud.model();
    EXPECT_EQ(uncovered(left, model, cloud.tolerance()), 0u);
    // Of splats of radius 0.2 none is left that lies where nothing is.
    for (const SurfelBlock& block : model.levels[0].blocks) EXPECT_LT(block.bounds.max.y, 0.4f);
    // And back again.
    std::vector<CloudPoint> again;
    for (const uint32_t i : numbers) again.push_back(all[i]);
    cloud.append(again);
    EXPECT_EQ(uncovered(all, cloud.model(), cloud.tolerance()), 0u);
}

TEST(SplatCloud, aSurfaceThatMovesIsFollowed) {
    ThreadPool pool(2);
    const std::vector<CloudPoint> before = sphere(4000), after = sphere(4000, 1.05);
    SplatCloud cloud(before, coarse(), pool);
    for (uint32_t i = 0; i < 4000; i += 100) {
        std::vector<uint32_t> numbers;
        for (uint32_t k = i; k < i + 100; ++k) numbers.push_back(k);
        cloud.append({after.begin() + i, after.begin() + i + 100});
        cloud.remove(numbers);
    }
    EXPECT_EQ(cloud.pointCount(), 4000u);
    EXPECT_EQ(uncovered(after, cloud.model(), cloud.tolerance()), 0u);
}

// At borders, too, that come and go.
TEST(SplatCloud, modelsBetweenEditsAreThoseThereWouldBeWithout) {
    ThreadPool pool(2);
    std::vector<CloudPoint> all = sphere(8000);
    std::sort(all.begin(), all.end(),
              [](const CloudPoint& a, const CloudPoint& b) { return a.position.y > b.position.y; });
    const std::vector<CloudPoint> half(all.begin(), all.begin() + 4000);
    SplatCloud often(half, coarse(), pool), once(half, coarse(), pool);
    for (size_t i = 4000; i < 6000; i += 100) {
        const std::vector<CloudPoint> more(all.begin() + std::ptrdiff_t(i),
                                           all.begin() + std::ptrdiff_t(i) + 100);
        for (SplatCloud* cloud : {&often, &once}) cloud->append(more);
        often.model();
    }
    EXPECT_EQ(surfelFileText(often.model()), surfelFileText(once.model()));
    for (uint32_t i = 5900; i >= 3000; i -= 100) {
        std::vector<uint32_t> numbers;
        for (uint32_t k = i; k < i + 100; ++k) numbers.push_back(k);
        for (SplatCloud* cloud : {&often, &once}) cloud->remove(numbers);
        often.model();
    }
    EXPECT_EQ(surfelFileText(often.model()), surfelFileText(once.model()));
}

TEST(SplatCloud, mayBecomeEmptyAndStartEmpty) {
    ThreadPool pool(1);
    SplatCloud cloud({}, coarse(), pool);
    EXPECT_THROW(cloud.model(), Error);
    EXPECT_EQ(cloud.append({CloudPoint{}}), 0u);
    EXPECT_EQ(cloud.splatCount(), 1u);
    checkSurfelModel(cloud.model(), "one");
    cloud.remove({0});
    EXPECT_EQ(cloud.splatCount(), 0u);
    EXPECT_THROW(cloud.model(), Error);
    // Many at one place.
    cloud.append(std::vector<CloudPoint>(500));
    EXPECT_EQ(cloud.pointCount(), 500u);
    EXPECT_GE(cloud.splatCount(), 1u);
}

TEST(SplatCloud, refusesWhatMakesNoSense) {
    ThreadPool pool(1);
    SplatCloud cloud(sphere(100), coarse(), pool);
    CloudPoint bad;
    bad.position.y = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(cloud.append({CloudPoint{}, bad}), Error);
    EXPECT_THROW(cloud.remove({100}), Error);
    EXPECT_THROW(cloud.remove({3, 4, 3}), Error);
    EXPECT_EQ(cloud.pointCount(), 100u);
    cloud.remove({3});
    EXPECT_THROW(cloud.remove({3}), Error);
    EXPECT_EQ(cloud.pointCount(), 99u);
}

TEST(PointIndex, findsWhatASearchOfAllFinds) {
    Rng rng{3};
    std::vector<Vec3> positions;
    const auto place = [&] {
        return Vec3(float(rng.uniform(-1, 1)), std::round(float(rng.uniform(-2, 2))),
                    float(rng.uniform(-1, 1)));
    };
    for (int i = 0; i < 500; ++i) positions.push_back(place());
    PointIndex index;
    index.build(positions);
    std::vector<uint8_t> is_there(500, 1);
    for (int round = 0; round < 3000; ++round) {
        const uint32_t i = uint32_t(rng.uniform(0, double(positions.size())));
        if (round % 3 == 0 && is_there[i]) {
            index.remove(i, positions[i]);
            is_there[i] = 0;
        } else {
            // In a row, so that one side of the tree grows.
            positions.push_back(round % 2 ? place() : Vec3(float(round) * 0.001f, 0, 0));
            is_there.push_back(1);
            index.insert(uint32_t(positions.size() - 1), positions.back());
        }
        if (round % 50 != 0) continue;
        const Vec3 p = place();
        std::vector<NearPoint> all, found;
        for (uint32_t k = 0; k < positions.size(); ++k) {
            const Vec3 d = positions[k] - p;
            if (is_there[k]) all.push_back({glm::dot(d, d), k});
        }
        ASSERT_EQ(index.size(), all.size());
        std::sort(all.begin(), all.end());
        index.nearest(p, 20, found);
        ASSERT_EQ(found.size(), 20u);
        for (size_t k = 0; k < 20; ++k) EXPECT_EQ(found[k].index, all[k].index);
        index.within(p, 0.5f, found);
        std::sort(found.begin(), found.end());
        size_t n = 0;
        while (n < all.size() && all[n].squared <= 0.25f) ++n;
        ASSERT_EQ(found.size(), n);
        for (size_t k = 0; k < n; ++k) EXPECT_EQ(found[k].index, all[k].index);
        EXPECT_EQ(index.countWithin(p, 0.5f, positions.size()), n);
        EXPECT_EQ(index.countWithin(p, 0.5f, n / 2) > n / 2, n > n / 2);
    }
}

}  // namespace
}  // namespace stipple
