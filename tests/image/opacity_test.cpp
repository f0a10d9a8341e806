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

}  // namespace
}  // namespace stipple
