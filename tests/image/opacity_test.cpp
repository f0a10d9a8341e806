// SPDX-License-Identifier: Apache-2.0
// Single trees before an empty background cover as much by points as by rays, whatever the density
// of points and the size of the trees; gaps between leaves stay open.
#include <gtest/gtest.h>
#include <render/renderer.h>
#include <scenegraph/procedural/generators.h>

namespace stipple {
namespace {

constexpr double kTreeHeight = 24.0;

// Trees of one species in a row, turned differently.
Scene rowOfTrees(const std::string& species) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    TreeParams params;
    params.species = species;
    params.height = kTreeHeight;
    params.triangles = 20000;
    GeneratedMesh tree = makeTree(params);
    scene.materials = tree.materials;
    scene.meshes.push_back(std::move(tree.mesh));
    Group row;
    row.instances = InstanceStore(DBox3{DVec3(-200), DVec3(200)});
    for (int i = 0; i < 12; ++i) {
        Affine a;
        const double angle = 2.4 * i;
        a.linear = DMat3(std::cos(angle), 0, -std::sin(angle), 0, 1, 0, std::sin(angle), 0,
                         std::cos(angle));
        a.translation = DVec3(18.0 * (i - 5.5), 0.0, 0.0);
        row.instances.add(ChildRef::mesh(0), a);
    }
    scene.groups.push_back(std::move(row));
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

// Sum of coverage over a picture in which trees are `tree_pixels` high.
double covered(const Scene& scene, double tree_pixels, Method method, double samples) {
    FrameRequest r;
    constexpr double kDistance = 4000.0;
    r.camera = lookAt(DVec3(0.0, 500.0, kDistance), DVec3(0.0, 10.0, 0.0));
    r.settings.height = int(2.0 * tree_pixels);
    r.settings.width = int(230.0 / kTreeHeight * tree_pixels);
    r.camera.fov_y = 2.0 * std::atan(kTreeHeight / kDistance);
    r.settings.method = method;
    r.settings.samples = samples;
    r.transparent = true;
    ThreadPool pool(2);
    const Image image = Renderer(scene, pool).render(r).image;
    double sum = 0.0;
    for (size_t i = 3; i < image.data.size(); i += image.channels.size()) sum += image.data[i];
    return sum;
}

class Opacity : public testing::TestWithParam<std::string> {};

TEST_P(Opacity, treesCoverWhatRaysSeeForAnyDensity) {
    const Scene scene = rowOfTrees(GetParam());
    for (const double tree_pixels : {7.0, 13.0, 26.0, 90.0}) {
        const double rays = covered(scene, tree_pixels, Method::kRaycast, 64);
        for (const double k : {0.3, 1.0, 3.0, 12.0}) {
            const double points = covered(scene, tree_pixels, Method::kPoints, k);
            EXPECT_NEAR(points / rays, 1.0, 0.07) << tree_pixels << " pixels high, K = " << k;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(species, Opacity, testing::Values("oak", "spruce", "birch", "pine"));

// A square of trees of which each is far smaller than a subpixel, as groups of groups of groups.
Scene farSquares(int levels) {
    Scene scene = rowOfTrees("oak");
    scene.groups.clear();
    Group tree;
    tree.instances = InstanceStore(DBox3{DVec3(-1), DVec3(1)});
    tree.instances.add(ChildRef::mesh(0), Affine());
    scene.groups.push_back(std::move(tree));
    double step = 24.0;
    for (int level = 0; level < levels; ++level, step *= 4.0) {
        Group square;
        square.instances = InstanceStore(DBox3{DVec3(-step * 4), DVec3(step * 4)});
        for (int i = 0; i < 16; ++i) {
            Affine a;
            // Off the lattice, or it makes patterns with that of the pixels.
            const double off = level == 0 ? 0.3 : 0.0;
            const double x = i % 4 - 1.5 + off * std::sin(37.0 * i),
                         z = i / 4 - 1.5 + off * std::sin(91.0 * i);
            a.translation = DVec3(step * x, 0.0, step * z);
            square.instances.add(ChildRef::group(uint32_t(level)), a);
        }
        scene.groups.push_back(std::move(square));
    }
    scene.root = uint32_t(levels);
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

TEST(OpacityFarAway, groupsOfGroupsCoverWhatRaysSee) {
    double mean = 0.0;
    for (const int levels : {4, 6, 8}) {
        const Scene scene = farSquares(levels);
        const double side = 24.0 * std::pow(4.0, levels);
        FrameRequest r;
        r.camera = lookAt(DVec3(0.0, side, 0.2 * side), DVec3(0.0));
        r.camera.fov_y = 0.6;
        r.camera.near_z = side * 0.01;
        r.settings.width = r.settings.height = 96;
        r.settings.subpixels = 2;
        r.transparent = true;
        ThreadPool pool(2);
        Renderer renderer(scene, pool);
        const auto coverage = [&](Method method, double samples) {
            r.settings.method = method;
            r.settings.samples = samples;
            const Image image = renderer.render(r).image;
            double sum = 0.0;
            for (size_t i = 3; i < image.data.size(); i += image.channels.size())
                sum += image.data[i];
            return sum / (96.0 * 96.0);
        };
        const double rays = coverage(Method::kRaycast, 16);
        EXPECT_GT(rays, 0.2);
        // The same list is shown many times, so single pictures deviate.
        for (const double k : {0.3, 1.0, 4.0}) {
            const double ratio = coverage(Method::kPoints, k) / rays;
            EXPECT_NEAR(ratio, 1.0, 0.2) << levels << " levels, K " << k;
            mean += ratio / 9.0;
        }
    }
    EXPECT_NEAR(mean, 1.0, 0.05);
}

}  // namespace
}  // namespace stipple
