// SPDX-License-Identifier: Apache-2.0
// Compare on pictures as it meets them: ray-cast, written to files and read back.
#include <render/compare.h>

#include <raycast/embree_raycaster.h>

#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>

namespace stipple {
namespace {

namespace fs = std::filesystem;

// A field of hills before a wall, seen along it: smooth shading, edges, background.
Scene hills() {
    Scene scene;
    scene.materials.resize(1);
    scene.materials[0].double_sided = true;
    Mesh mesh;
    constexpr uint32_t kSide = 60;
    for (uint32_t z = 0; z < kSide; ++z) {
        for (uint32_t x = 0; x < kSide; ++x) {
            const float fx = 0.2f * float(x) - 6.0f, fz = -0.4f * float(z);
            mesh.positions.push_back(Vec3(fx, 0.5f * std::sin(fx) * std::cos(fz), fz));
            if (x == 0 || z == 0) continue;
            const uint32_t k = z * kSide + x;
            mesh.triangles.push_back(UVec3(k - kSide - 1, k - kSide, k));
            mesh.triangles.push_back(UVec3(k - kSide - 1, k, k - 1));
        }
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    scene.meshes.push_back(mesh);
    Group group;
    group.instances.add(ChildRef::mesh(0), Affine());
    scene.groups.push_back(group);
    ThreadPool pool(1);
    buildScene(scene, pool);
    return scene;
}

// Shaded by the normal, with the channels that the measure of holes needs; four rays a pixel.
Image rayCast(const Scene& scene) {
    const View view = makeView(lookAt(DVec3(0, 1.5, 4), DVec3(0, 0, -6)), 160, 90, 2);
    const auto caster = makeEmbreeRayCaster(scene, view.eye_world, 1);
    const Mat3 world_from_camera(glm::transpose(view.camera_from_world));
    Image image(view.width, view.height, {"R", "G", "B", "coverage", "depth", "depth_max"});
    for (int y = 0; y < view.height; ++y) {
        for (int x = 0; x < view.width; ++x) {
            Ray rays[4];
            RayHit hits[4];
            for (int i = 0; i < 4; ++i) {
                Vec3 origin, direction;
                view.ray(float(2 * x + i % 2) + 0.5f, float(2 * y + i / 2) + 0.5f, origin,
                         direction);
                rays[i].origin = world_from_camera * origin;
                rays[i].direction = world_from_camera * direction;
            }
            caster->cast(rays, 4, hits, 0.0f);
            float* p = image.pixel(x, y);
            p[4] = kInfinity;
            for (const RayHit& hit : hits) {
                const bool there = hit.t < kInfinity;
                const Vec3 color = there ? hit.albedo * (0.5f + 0.5f * hit.normal_world.y)
                                         : Vec3(0.3f, 0.5f, 0.9f);
                for (int c = 0; c < 3; ++c) p[c] += 0.25f * color[c];
                if (!there) continue;
                p[3] += 0.25f;
                p[4] = std::min(p[4], hit.t);
                p[5] = std::max(p[5], hit.t);
            }
        }
    }
    return image;
}

TEST(CompareFiles, aPictureInEitherFormatIsNearlyThePicture) {
    const fs::path folder =
        fs::temp_directory_path() / ("stipple_compare_" + std::to_string(::getpid()));
    fs::create_directories(folder);
    const Image original = rayCast(hills());
    saveImage(original, (folder / "a.exr").string());
    saveImage(original, (folder / "a.png").string());
    const Image exr = loadImage((folder / "a.exr").string()),
                png = loadImage((folder / "a.png").string());
    fs::remove_all(folder);

    ThreadPool pool(1);
    const CompareResult exact = compareImages(exr, original, pool);
    EXPECT_EQ(exact.rmse, 0.0);
    EXPECT_EQ(exact.flip, 0.0);
    ASSERT_TRUE(exact.holes.has_value());
    EXPECT_EQ(exact.holes->count, 0u);

    // Rounding to bytes: at most half a byte.
    const CompareResult rounded = compareImages(png, exr, pool);
    EXPECT_LT(rounded.rmse, 0.5 / 255.0);
    EXPECT_GT(rounded.rmse, 0.0);
    EXPECT_LT(rounded.flip, 0.05);
    EXPECT_FALSE(rounded.holes.has_value());
}

TEST(CompareFiles, pixelsThatShowWhatLiesBehindAreCounted) {
    const Image reference = rayCast(hills());
    Image image = reference;
    size_t expected = 0;
    for (int y = 60; y < 80; y += 4) {
        for (int x = 10; x < 150; x += 5) {
            expected += image.pixel(x, y)[3] == 1.0f;
            image.pixel(x, y)[4] *= 10.0f;
            for (int c = 0; c < 3; ++c) image.pixel(x, y)[c] *= 0.7f;
        }
    }
    ThreadPool pool(1);
    const CompareResult r = compareImages(image, reference, pool);
    ASSERT_TRUE(r.holes.has_value());
    EXPECT_GT(expected, 50u);
    EXPECT_EQ(r.holes->count, expected);
    EXPECT_GT(r.flip, 0.0);
    EXPECT_LT(r.psnr, 50.0);
}

}  // namespace
}  // namespace stipple
