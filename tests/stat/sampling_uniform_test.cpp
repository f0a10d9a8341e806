// SPDX-License-Identifier: Apache-2.0
// Kept points are uniform over the projected area of what they stand for: chi-square over the
// pixels of a plane, over its triangles and over instances, under nested, sheared and mirrored
// transforms.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <sampling/random_sampler.h>
#include <scenegraph/procedural/generators.h>

#include "chi_square.h"

namespace stipple {
namespace {

// Takes all points of a frame and nothing else.
class Collector : public PointSink {
public:
    explicit Collector(const View& view)
        : view_(view), region_{0, 0, view.subWidth(), view.subHeight()} {}
    bool take(const PointBlock& block) override {
        for (int i = 0; i < block.count; ++i) {
            ++drawn;
            if (!block.keep[i]) continue;
            points.push_back(Vec3(block.x[i], block.y[i], block.z[i]));
            numbers.push_back(block.number[i]);
        }
        return true;
    }
    bool take(const TriangleBlock& block) override {
        triangles += size_t(block.count);
        return true;
    }
    bool hides(const SubpixelRect&, float, bool) override { return false; }
    const SubpixelRect& region() const override { return region_; }

    std::vector<Vec3> points;
    std::vector<uint32_t> numbers;
    size_t drawn = 0, triangles = 0;

private:
    View view_;
    SubpixelRect region_;
};

// A plane of fine triangles, under transforms nested twice: shear, mirror, non-uniform scale.
Scene planeScene(const Affine& inner, const Affine& outer, int inner_copies) {
    Scene scene;
    scene.path = "test";
    GeneratedMesh plane = makePrimitive("plane", 20000, Vec3(0.5f));
    for (Material& m : plane.materials) m.double_sided = true;
    scene.materials = plane.materials;
    scene.meshes.push_back(std::move(plane.mesh));
    Group tile, root;
    tile.name = "tile", root.name = "root";
    tile.instances = InstanceStore(DBox3{DVec3(-100), DVec3(100)});
    for (int i = 0; i < inner_copies; ++i) {
        Affine a = inner;
        a.translation.x += 1.5 * i;
        tile.instances.add(ChildRef::mesh(0), a);
    }
    root.instances.add(ChildRef::group(0), outer);
    scene.groups.push_back(std::move(tile));
    scene.groups.push_back(std::move(root));
    scene.root = 1;
    ThreadPool pool(1);
    buildScene(scene, pool);
    return scene;
}

MeshPoint pointOf(const Mesh& mesh, Sampler sampler, uint64_t list, uint32_t index) {
    const PointKey key{sampler, list, index};
    return meshPointAt(mesh.cumulative_area, mesh.nodes[0], listPosition(key), key);
}

struct Drawn {
    View view;
    Collector collector;
};

Drawn draw(const Scene& scene, const Camera& camera, RenderSettings settings, int width, int height,
           std::vector<uint32_t>* objects = nullptr) {
    const View view = makeView(camera, width, height, 1);
    ThreadPool pool(1);
    RandomizedSampler sampler(scene);
    const FramePlan& plan = sampler.plan(view, settings, pool, nullptr);
    Drawn drawn{view, Collector(view)};
    const auto emitter = sampler.makeEmitter();
    for (const Batch& batch : plan.batches) emitter->emit(batch, drawn.collector);
    if (objects) {
        for (const uint32_t number : drawn.collector.numbers) {
            SurfaceSample sample;
            emitter->attributes(number, 0.0f, 0.0f, sample);
            objects->push_back(sample.object);
        }
    }
    return drawn;
}

RenderSettings randomSettings(double k) {
    RenderSettings settings;
    settings.samples = k;
    settings.sampler = Sampler::kRandom;
    settings.area_threshold = settings.large_triangle = 1e9;  // all as points
    return settings;
}

Affine sheared() {
    Affine a;
    a.linear = DMat3(2.0, 0.3, 0.1, -0.4, 0.7, 0.2, 0.5, 0.0, -1.3);  // mirrored too
    return a;
}

void expectUniformOverPixels(const Camera& camera, const Affine& inner, const Affine& outer) {
    const Scene scene = planeScene(inner, outer, 1);
    const double k = 6.0;
    const int width = 96, height = 72;
    const Drawn drawn = draw(scene, camera, randomSettings(k), width, height);
    // Which pixels lie wholly within the projected parallelogram: all four corners do.
    const Affine world = outer * inner;
    const auto inside = [&](double x, double y) {
        Vec3 origin, direction;
        drawn.view.ray(float(x), float(y), origin, direction);
        const DMat3 world_from_camera = glm::transpose(drawn.view.camera_from_world);
        const Affine object = inverse(world);
        const DVec3 o = object.point(drawn.view.eye_world + world_from_camera * DVec3(origin));
        const DVec3 d = object.linear * (world_from_camera * DVec3(direction));
        const double t = -o.y / d.y;
        const DVec3 p = o + t * d;
        return t > 0.0 && std::abs(p.x) < 0.5 && std::abs(p.z) < 0.5;
    };
    std::vector<double> counts(size_t(width) * height, 0.0), seen, expected;
    for (const Vec3& p : drawn.collector.points) {
        const Vec2 s = drawn.view.project(p);
        if (s.x >= 0 && s.y >= 0 && s.x < width && s.y < height)
            ++counts[size_t(s.y) * width + size_t(s.x)];
    }
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            if (!inside(x, y) || !inside(x + 1, y) || !inside(x, y + 1) || !inside(x + 1, y + 1))
                continue;
            seen.push_back(counts[size_t(y) * width + x]);
            expected.push_back(k);
        }
    }
    ASSERT_GT(seen.size(), 300u);
    EXPECT_LT(chiSquare(seen, expected), criticalValue(double(seen.size())));
    // Never below the wanted density: the mean is k within three standard deviations.
    double mean = 0.0;
    for (const double c : seen) mean += c / double(seen.size());
    EXPECT_NEAR(mean, k, 3.0 * std::sqrt(k / double(seen.size())));
}

TEST(SamplingUniform, pixelsOfAPlaneSeenFromAbove) {
    expectUniformOverPixels(lookAt({0, 1.2, 0.3}, {0, 0, 0}), Affine(), Affine());
}

TEST(SamplingUniform, pixelsOfASlantedPlaneNearTheEye) {
    expectUniformOverPixels(lookAt({0.1, 0.25, 0.7}, {0, 0, 0}), Affine(), Affine());
}

TEST(SamplingUniform, pixelsUnderShearedMirroredNestedTransforms) {
    Affine outer;
    outer.linear = DMat3(0.6, 0, 0, 0, 1.5, 0.4, 0, 0, 1.1);
    outer.translation = DVec3(0.2, -0.1, 0.3);
    expectUniformOverPixels(lookAt({0.4, 1.5, 1.8}, {0.2, 0, 0.3}), sheared(), outer);
}

TEST(SamplingUniform, pixelsOfAnOrthographicView) {
    Camera camera = lookAt({0.5, 1.0, 0.8}, {0, 0, 0});
    camera.orthographic = true;
    camera.height = 1.2;
    expectUniformOverPixels(camera, sheared(), Affine());
}

// What faces the eye sideways is drawn with fewer points, and as many are kept.
TEST(SamplingUniform, orientationSavesPointsAndKeepsAsMany) {
    for (const Affine& inner : {Affine(), sheared()}) {
        const Scene scene = planeScene(inner, Affine(), 1);
        const Camera camera = lookAt({0.2, 0.9, 4.0}, {0, 0, 0});
        RenderSettings settings = randomSettings(20.0);
        const Drawn without = draw(scene, camera, settings, 320, 240);
        settings.orientation = true;
        const Drawn with = draw(scene, camera, settings, 320, 240);
        const double n = double(without.collector.points.size());
        ASSERT_GT(n, 10000.0);
        EXPECT_NEAR(double(with.collector.points.size()), n, 4.0 * std::sqrt(2.0 * n));
        EXPECT_GT(double(without.collector.drawn), 1.6 * double(with.collector.drawn));
        // Where lengths are scaled alike the bound is tight; else it holds for any direction.
        if (inner.linear == DMat3(1.0)) {
            EXPECT_LT(double(with.collector.drawn), 1.25 * n);
        }
    }
}

// Far away a whole group is sampled at once: its instances must get points by their projected
// areas.
TEST(SamplingUniform, instancesOfAFarGroup) {
    constexpr int kCopies = 24;
    const Scene scene = planeScene(sheared(), Affine(), kCopies);
    const Camera camera = lookAt({18, 900, 500}, {18, 0, 0});
    std::vector<uint32_t> objects;
    RenderSettings settings = randomSettings(4000.0);
    settings.tile_size = 4096;
    const Drawn drawn = draw(scene, camera, settings, 640, 480, &objects);
    std::map<uint32_t, double> counts;
    for (const uint32_t object : objects) ++counts[object];
    ASSERT_EQ(counts.size(), size_t(kCopies));
    ASSERT_GT(drawn.collector.points.size(), 2000u);
    std::vector<double> seen, expected;
    for (const auto& [object, count] : counts) {
        seen.push_back(count);
        expected.push_back(double(objects.size()) / kCopies);
    }
    // Equal planes at nearly equal distance: their projected areas agree to a few per mille.
    EXPECT_LT(chiSquare(seen, expected), criticalValue(kCopies - 1));
}

TEST(SamplingUniform, trianglesOfAMeshByTheirArea) {
    GeneratedMesh rock = makeRock({});
    std::vector<Material> materials = rock.materials;
    buildMesh(rock.mesh, materials, "rock");
    const Mesh& mesh = rock.mesh;
    const uint32_t n = 400000;
    std::vector<double> counts(mesh.triangles.size(), 0.0), expected;
    for (uint32_t i = 0; i < n; ++i) ++counts[pointOf(mesh, Sampler::kRandom, 77, i).triangle];
    for (size_t t = 0; t < counts.size(); ++t) {
        expected.push_back(n * (mesh.cumulative_area[t + 1] - mesh.cumulative_area[t]) / mesh.area);
    }
    EXPECT_LT(chiSquare(counts, expected), criticalValue(double(counts.size() - 1)));
}

// Stratified prefixes leave far fewer empty cells than random points do.
TEST(SamplingUniform, everyStratifiedPrefixIsWellSpread) {
    GeneratedMesh plane = makePrimitive("plane", 5000, Vec3(0.5f));
    buildMesh(plane.mesh, plane.materials, "plane");
    const Mesh& mesh = plane.mesh;
    constexpr int kSide = 32;
    const auto emptyShare = [&](Sampler sampler, uint32_t n) {
        std::vector<bool> hit(kSide * kSide, false);
        for (uint32_t i = 0; i < n; ++i) {
            const MeshPoint p = pointOf(mesh, sampler, 5, i);
            const UVec3& t = mesh.triangles[p.triangle];
            const Vec3 q = mesh.positions[t.x] * (1 - p.u - p.v) + mesh.positions[t.y] * p.u +
                           mesh.positions[t.z] * p.v;
            hit[size_t(std::clamp(int((q.z + 0.5f) * kSide), 0, kSide - 1)) * kSide +
                size_t(std::clamp(int((q.x + 0.5f) * kSide), 0, kSide - 1))] = true;
        }
        return double(std::count(hit.begin(), hit.end(), false)) / double(hit.size());
    };
    for (const int k : {1, 2, 3}) {
        const uint32_t n = uint32_t(k * kSide * kSide);
        EXPECT_NEAR(emptyShare(Sampler::kRandom, n), std::exp(-k), 0.04);
        EXPECT_LT(emptyShare(Sampler::kStratified, n), 0.8 * std::exp(-k));
    }
}

// Far instances take short aligned pieces of a list: each piece's first point may lie anywhere, and
// sixteen points in a row lie in sixteen different parts of the area.
TEST(SamplingUniform, shortPiecesOfAListLieAnywhere) {
    std::vector<double> first(16, 0.0);
    constexpr uint32_t kPieces = 1600;
    for (uint32_t piece = 0; piece < kPieces; ++piece) {
        std::vector<int> parts(16, 0);
        // The random shift moves all points alike, so parts are counted from where it begins.
        const double begin = uniformDouble(99);
        for (uint32_t i = 0; i < 16; ++i) {
            double t = listPosition({Sampler::kStratified, 99, piece * 16 + i}) - begin;
            t -= std::floor(t);
            ++parts[size_t(t * 16.0)];
            if (i == 0) ++first[size_t(t * 16.0)];
        }
        EXPECT_EQ(std::count(parts.begin(), parts.end(), 1), 16) << piece;
    }
    EXPECT_LT(chiSquare(first, std::vector<double>(16, kPieces / 16.0)), criticalValue(15));
}

}  // namespace
}  // namespace stipple
