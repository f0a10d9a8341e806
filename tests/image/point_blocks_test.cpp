// SPDX-License-Identifier: Apache-2.0
// Point-block models beside rays through their sources: quality, no holes from anywhere, no tears
// when magnified, every reconstruction, the same bits for any number of threads.
#include <core/rng.h>
#include <gtest/gtest.h>
#include <render/build_model.h>
#include <render/compare.h>
#include <render/point_block_probe.h>
#include <render/renderer.h>
#include <scenegraph/io/surfel_file.h>
#include <scenegraph/procedural/generators.h>
#include <tests/image/model_views.h>
#include <tests/image/test_scene.h>

#include <algorithm>
#include <filesystem>

namespace stipple {
namespace {

Scene sceneOf(GeneratedMesh made, ThreadPool& pool) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(2.0f)});
    scene.materials = made.materials;
    scene.textures = made.textures;
    scene.meshes.push_back(std::move(made.mesh));
    Group group;
    group.instances.add(ChildRef::mesh(0), Affine());
    scene.groups.push_back(std::move(group));
    buildScene(scene, pool);
    return scene;
}

// By way of its file.
Scene sceneOf(const SurfelModel& model, ThreadPool& pool) {
    const std::string path = (std::filesystem::temp_directory_path() /
                              ("stipple-test-" + std::to_string(getpid()) + ".stipple"))
                                 .string();
    saveFile(path, surfelFileText(model));
    Diagnostics diagnostics;
    Scene scene = loadScene(path, {true, 0, nullptr}, pool, diagnostics);
    std::filesystem::remove(path);
    return scene;
}

struct Pair {
    Scene source, model;
};

// The scene, and one that shows a model of it.
Pair makePair(GeneratedMesh made, int resolution, ThreadPool& pool) {
    Pair pair;
    pair.source = sceneOf(std::move(made), pool);
    PointBlockOptions options;
    options.resolution = resolution;
    PointBlockReport report;
    const CancelFlag cancel;
    const SurfelModel model = buildPointBlockModel(
        pair.source, options, pool, cancel, [](double) {}, report);
    pair.model = sceneOf(model, pool);
    pair.model.lighting = pair.source.lighting;
    return pair;
}

GeneratedMesh torus() { return makePrimitive("torus", 20000, Vec3(0.8f, 0.5f, 0.3f)); }

GeneratedMesh tree() {
    TreeParams params;
    params.species = "oak";
    params.triangles = 20000;
    return makeTree(params);
}

// At unit magnification times `zoom`, from a direction.
Camera cameraTo(const Scene& scene, const Vec3& from, int resolution, int pixels, double zoom) {
    const DBox3 bounds = sceneBounds(scene);
    const DVec3 center = 0.5 * (bounds.min + bounds.max);
    const double radius = 0.5 * glm::length(bounds.max - bounds.min);
    Camera camera = lookAt(center + DVec3(from) * radius * 4.0, center);
    // A pixel at the near side is as large as one of the model.
    const double pixel = 2.0 * radius / resolution / zoom;
    camera.fov_y = 2.0 * std::atan(0.5 * pixels * pixel / (3.0 * radius));
    return camera;
}

// Views from every step-th direction.
void expectLikeRays(GeneratedMesh made, int pixels, int step, double least_db, double most_holes) {
    ThreadPool pool(2);
    const Pair pair = makePair(std::move(made), pixels, pool);
    double worst = 1e9, holes = 0.0;
    for (int d = 0; d < kMaskDirections; d += step) {
        const Camera camera = cameraTo(pair.source, maskDirectionOf(d), pixels, pixels, 1.0);
        const Image one = draw(pair.source, camera, pixels, Method::kRaycast, 1, pool, 1),
                    many = draw(pair.source, camera, pixels, Method::kRaycast, 16, pool, 1),
                    points = draw(pair.model, camera, pixels, Method::kPoints, 1, pool, 1);
        worst = std::min(worst, compareImages(points, one, pool).psnr);
        holes += double(compareImages(points, many, pool).holes->count);
    }
    EXPECT_GE(worst, least_db);
    EXPECT_LE(holes, most_holes);  // in all pictures
}

// Lattices are finer where surfaces may be tilted more, and squares are smaller than triangles.
TEST(PointBlocks, finerLatticesNeedMoreMemory) {
    PointBlockOptions usual, steep, squares;
    steep.tolerance_angle = 80.0;
    squares.equilateral = false;
    EXPECT_GT(pointBlockBytes(squares), 1.1 * pointBlockBytes(usual));
    EXPECT_GT(pointBlockBytes(steep), 961e6);  // what a bunny takes
    EXPECT_LT(pointBlockBytes(usual), 300e6);
    steep.memory_limit_mb = 900;
    TestScene scene;
    scene.add(makePrimitive("box", 12, Vec3(0.5f)), Affine());
    ThreadPool pool(1);
    const CancelFlag cancel;
    PointBlockReport report;
    EXPECT_THROW(buildPointBlockModel(
                     scene.build(), steep, pool, cancel, [](double) {}, report),
                 Error);
}

TEST(PointBlocks, surfacesLookLikeRaysFromAnywhere) { expectLikeRays(torus(), 128, 5, 28.0, 4); }
TEST(PointBlocks, treesLookLikeRaysFromAnywhere) { expectLikeRays(tree(), 256, 21, 19.0, 10); }

TEST(PointBlocks, noTearsWhenMagnifiedAndAtTheEdgesOfAWideView) {
    ThreadPool pool(2);
    const Pair pair = makePair(torus(), 64, pool);
    for (const Reconstruct method :
         {Reconstruct::kPerPixel, Reconstruct::kGaussian, Reconstruct::kPullPush, Reconstruct::kEwa,
          Reconstruct::kBins}) {
        for (int d = 0; d < kMaskDirections; d += 31) {
            const Camera camera = cameraTo(pair.source, maskDirectionOf(d), 64, 256, 4.0);
            const Image rays = draw(pair.source, camera, 256, Method::kRaycast, 9, pool, 1),
                        points = draw(pair.model, camera, 256, Method::kPoints, 1, pool, 1, method);
            EXPECT_LE(compareImages(points, rays, pool).holes->count, 20u) << int(method);
        }
    }
    // Close before it, 90 degrees wide.
    Camera camera = lookAt(DVec3(0.0, 1.0, 0.4), DVec3(0.0));
    camera.fov_y = kPi / 2.0;
    const Image rays = draw(pair.source, camera, 256, Method::kRaycast, 9, pool, 1),
                points = draw(pair.model, camera, 256, Method::kPoints, 1, pool, 1);
    EXPECT_LE(compareImages(points, rays, pool).holes->count, 20u);
}

// A sample covers 1/K of a pixel: what is finer than a pixel may still be too coarse.
TEST(PointBlocks, noHolesAtManySamplesAPixel) {
    ThreadPool pool(2);
    const Pair pair = makePair(torus(), 64, pool);
    for (const double zoom : {0.6, 0.75, 0.9, 1.1}) {
        const Camera camera = cameraTo(pair.source, maskDirectionOf(31), 64, 96, zoom);
        const Image rays = draw(pair.source, camera, 96, Method::kRaycast, 16, pool, 1),
                    points = draw(pair.model, camera, 96, Method::kPoints, 4, pool, 1);
        EXPECT_LE(compareImages(points, rays, pool).holes->count, 2u) << zoom;
        EXPECT_GE(compareImages(points, rays, pool).psnr, 30.0) << zoom;
    }
}

// Patches as narrow as leaves are no surfaces whose holes are closed: discs must see to it.
TEST(PointBlocks, aSurfaceOfSmallPatchesIsClosedByEwa) {
    ThreadPool pool(2);
    GeneratedMesh made = torus();
    Mesh split = made.mesh;
    split.positions.clear(), split.normals.clear(), split.uvs.clear(), split.tangents.clear();
    for (UVec3& corners : split.triangles) {
        for (int k = 0; k < 3; ++k) {
            const uint32_t from = corners[k];
            corners[k] = uint32_t(split.positions.size());
            // By a hair apart.
            const Vec3 normal = made.mesh.normals[from];
            split.positions.push_back(made.mesh.positions[from] +
                                      normal * (1e-5f * float(split.positions.size() % 7)));
            split.normals.push_back(normal);
        }
    }
    made.mesh = std::move(split);
    const Pair pair = makePair(std::move(made), 64, pool);
    const Camera camera = cameraTo(pair.source, maskDirectionOf(3), 64, 256, 4.0);
    const Image rays = draw(pair.source, camera, 256, Method::kRaycast, 16, pool, 1),
                ewa = draw(pair.model, camera, 256, Method::kPoints, 1, pool, 2, Reconstruct::kEwa);
    EXPECT_LE(compareImages(ewa, rays, pool).holes->count, 20u);
    EXPECT_GE(compareImages(ewa, rays, pool).psnr, 40.0);

    // Nor do its discs cast shadows on each other.
    FrameRequest r;
    r.camera = camera;
    r.settings.width = r.settings.height = 256;
    r.settings.subpixels = 2;
    r.settings.shadows = true;
    const Image lit = Renderer(pair.model, pool).render(r).image;
    r.settings.method = Method::kRaycast;
    r.settings.samples = 16;
    const Image lit_by_rays = Renderer(pair.source, pool).render(r).image;
    EXPECT_GE(compareImages(lit, lit_by_rays, pool).psnr, 48.0);
}

// Share of random places of the surface that no disc of the finest level covers.
double uncoveredShare(const Scene& source, bool complete, ThreadPool& pool) {
    PointBlockOptions options;
    options.resolution = 64;
    options.directions = 6;  // much is seen at a slant
    options.complete = complete;
    PointBlockReport report;
    const CancelFlag cancel;
    const SurfelModel model = buildPointBlockModel(
        source, options, pool, cancel, [](double) {}, report);
    const SurfelLevel& level = model.levels[0];
    std::vector<Surfel> surfels;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i)
            surfels.push_back(unpackSurfel(level, block, i));
    }
    const Mesh& mesh = source.meshes[0];
    Rng rng{5};
    constexpr int kPlaces = 2000;
    int uncovered = 0;
    for (int i = 0; i < kPlaces; ++i) {
        const double area = rng.uniform(0.0, mesh.cumulative_area.back());
        const size_t t = size_t(std::upper_bound(mesh.cumulative_area.begin(),
                                                 mesh.cumulative_area.end(), area) -
                                mesh.cumulative_area.begin()) -
                         1;
        const UVec3& corners = mesh.triangles[t];
        const Vec3 p =
            (mesh.positions[corners.x] + mesh.positions[corners.y] + mesh.positions[corners.z]) /
            3.0f;
        const float reach = 0.5f * kDiscSide * std::sqrt(2.0f) * level.spacing;
        uncovered += std::none_of(surfels.begin(), surfels.end(), [&](const Surfel& s) {
            return glm::length(p - s.position) <= reach;
        });
    }
    return double(uncovered) / kPlaces;
}

TEST(PointBlocks, whatProjectionsSeeAtASlantIsCovered) {
    ThreadPool pool(2);
    const Scene source = sceneOf(torus(), pool);
    EXPECT_GT(uncoveredShare(source, false, pool), 0.01);
    EXPECT_LT(uncoveredShare(source, true, pool), 0.001);
}

TEST(PointBlocks, sameBitsForAnyThreadsBuiltAndDrawn) {
    ThreadPool one(1), three(3);
    const Pair a = makePair(tree(), 48, one), b = makePair(tree(), 48, three);
    EXPECT_EQ(surfelFileText(*a.model.meshes[0].surfels),
              surfelFileText(*b.model.meshes[0].surfels));
    const Camera camera = cameraTo(a.source, maskDirectionOf(3), 48, 100, 1.5);
    const Image x = draw(a.model, camera, 100, Method::kPoints, 1, one, 1),
                y = draw(b.model, camera, 100, Method::kPoints, 1, three, 1);
    EXPECT_EQ(x.data, y.data);
}

// Where a pixel has no point after all, those around it close it, if it is a surface.
TEST(PointBlocks, holesOfAPixelAreFilled) {
    ThreadPool pool(2);
    const Pair pair = makePair(torus(), 64, pool);
    const auto holesOf = [&](float patch_width) {
        SurfelModel model = *pair.model.meshes[0].surfels;
        for (SurfelFinish& finish : model.finishes) finish.patch_width = patch_width;
        // Every fourth point stands where another does.
        for (SurfelLevel& level : model.levels) {
            for (const SurfelBlock& block : level.blocks) {
                for (uint32_t i = block.first + 3; i < block.first + block.count; i += 4)
                    level.position[i] = level.position[i - 1];
            }
        }
        const Scene scene = sceneOf(model, pool);
        uint64_t holes = 0;
        for (int d = 3; d < kMaskDirections; d += 14) {
            const Camera camera = cameraTo(pair.source, maskDirectionOf(d), 64, 64, 1.0);
            const Image rays = draw(pair.source, camera, 64, Method::kRaycast, 16, pool, 1),
                        points = draw(scene, camera, 64, Method::kPoints, 1, pool, 1);
            holes += compareImages(points, rays, pool).holes->count;
        }
        return holes;
    };
    const uint64_t of_surface = holesOf(10.0f), of_leaves = holesOf(0.01f);
    EXPECT_GT(of_leaves, 50u);
    EXPECT_LT(of_surface, of_leaves / 4);
}

// What is seen through the back of a single-sided surface, as through a scan's openings.
TEST(PointBlocks, backsHideNothingBehindThem) {
    constexpr int kPixels = 96;
    ThreadPool pool(2);
    GeneratedMesh made = torus();
    Mesh plates;
    for (const float z : {-0.5f, 0.5f}) {
        // The farther one faces the viewer on the side of +z; the nearer one, all around before it,
        // faces away.
        const uint32_t first = uint32_t(plates.positions.size());
        const float half = z < 0.0f ? 0.3f : 1.0f;
        for (const Vec2& p : {Vec2(-1, -1), Vec2(1, -1), Vec2(1, 1), Vec2(-1, 1)}) {
            plates.positions.emplace_back(p * half, z);
            plates.normals.emplace_back(0.0f, 0.0f, z < 0.0f ? 1.0f : -1.0f);
        }
        const uint32_t b = z < 0.0f ? 1u : 2u, c = z < 0.0f ? 2u : 1u;
        plates.triangles.emplace_back(first, first + b, first + c);
        plates.triangles.emplace_back(first, first + b + 1u, first + c + 1u);
    }
    plates.triangle_material.assign(plates.triangles.size(), 0);
    made.mesh = std::move(plates);
    const Pair pair = makePair(std::move(made), kPixels, pool);
    ASSERT_FALSE(pair.source.materials[0].double_sided);
    const Camera camera = cameraTo(pair.source, Vec3(0.0f, 0.0f, 1.0f), kPixels, kPixels, 1.0);
    const Image rays = draw(pair.source, camera, kPixels, Method::kRaycast, 16, pool, 1),
                points = draw(pair.model, camera, kPixels, Method::kPoints, 1, pool, 1);
    double covered = 0.0;
    const int coverage = rays.channelIndex("coverage");
    for (int y = 0; y < kPixels; ++y) {
        for (int x = 0; x < kPixels; ++x) covered += double(rays.pixel(x, y)[coverage]);
    }
    EXPECT_GT(covered, 150.0);
    EXPECT_LE(compareImages(points, rays, pool).holes->count, 4u);
}

// A parallelogram that is seen from where u turns to v counter-clockwise.
void addPlate(Mesh& mesh, const Vec3& corner, const Vec3& u, const Vec3& v, const Vec3& normal) {
    const uint32_t first = uint32_t(mesh.positions.size());
    for (const Vec3& p : {corner, corner + u, corner + u + v, corner + v}) {
        mesh.positions.push_back(p);
        mesh.normals.push_back(normal);
    }
    mesh.triangles.emplace_back(first, first + 1u, first + 2u);
    mesh.triangles.emplace_back(first, first + 2u, first + 3u);
    mesh.triangle_material.resize(mesh.triangles.size(), 0);
}
void addPlate(Mesh& mesh, const Vec3& corner, const Vec3& u, const Vec3& v) {
    addPlate(mesh, corner, u, v, glm::normalize(glm::cross(u, v)));
}

// What lies behind an opening is seen from few directions, another part of it from each.
TEST(PointBlocks, whatIsSeenThroughANarrowOpeningIsCovered) {
    constexpr int kPixels = 128;
    // A box with an opening in its top, and a floor that is seen through it alone.
    constexpr float kSide = 0.6f, kOpen = 0.06f, kRest = kSide - kOpen;
    const Vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
    GeneratedMesh made = torus();
    Mesh plates;
    addPlate(plates, -kSide * (x + y + z), 2.0f * kSide * x, 2.0f * kSide * y);
    for (const Mat3& turn : {Mat3(x, y, z), Mat3(y, -x, z), Mat3(-x, -y, z), Mat3(-y, x, z)}) {
        addPlate(plates, turn * (-kSide * (x + y + z)), turn * (2.0f * kSide * x),
                 2.0f * kSide * z);
        addPlate(plates, turn * Vec3(-kSide, -kSide, kSide), turn * ((kSide + kOpen) * x),
                 turn * (kRest * y));
    }
    made.mesh = std::move(plates);
    ThreadPool pool(2);
    const Pair pair = makePair(std::move(made), kPixels, pool);
    uint64_t holes = 0;
    for (int j = -3; j <= 3; ++j) {
        for (int i = -3; i <= 3; ++i) {
            const Vec3 from = glm::normalize(0.12f * (float(i) * x + float(j) * y) + z);
            const Camera camera = cameraTo(pair.source, from, kPixels, kPixels, 1.0);
            const Image rays = draw(pair.source, camera, kPixels, Method::kRaycast, 16, pool, 1),
                        points = draw(pair.model, camera, kPixels, Method::kPoints, 1, pool, 1);
            holes += compareImages(points, rays, pool).holes->count;
        }
    }
    EXPECT_LE(holes, 2u);
}

// Walls of a narrow shaft: what is seen at a slant alone has the colour of its place nevertheless.
TEST(PointBlocks, coloursAreThoseOfTheirPlacesHoweverTheyAreSeen) {
    constexpr float kSide = 0.6f, kOpen = 0.05f, kRest = kSide - kOpen;
    const Vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
    GeneratedMesh made = torus();
    Mesh shaft;
    addPlate(shaft, Vec3(-kOpen, -kOpen, -kSide), 2.0f * kOpen * x, 2.0f * kOpen * y);
    for (const Mat3& turn : {Mat3(x, y, z), Mat3(y, -x, z), Mat3(-x, -y, z), Mat3(-y, x, z)}) {
        addPlate(shaft, turn * (-kSide * (x + y + z)), turn * (2.0f * kSide * x), 2.0f * kSide * z);
        addPlate(shaft, turn * Vec3(-kSide, -kSide, kSide), turn * ((kSide + kOpen) * x),
                 turn * (kRest * y));
        addPlate(shaft, turn * Vec3(-kOpen, -kOpen, -kSide), 2.0f * kSide * z,
                 turn * (2.0f * kOpen * x));
    }
    // Black above, white below.
    for (const Vec3& p : shaft.positions) shaft.uvs.emplace_back(0.5f, 0.5f - 0.5f * p.z / kSide);
    Texture halves;
    constexpr int kTexels = 128;
    halves.levels.resize(1);
    halves.levels[0].width = halves.levels[0].height = kTexels;
    for (int i = 0; i < kTexels * kTexels; ++i) {
        const uint8_t v = i < kTexels * kTexels / 2 ? 0 : 255;
        halves.levels[0].rgba.insert(halves.levels[0].rgba.end(), {v, v, v, 255});
    }
    buildMipmaps(halves);
    made.mesh = std::move(shaft);
    made.textures = {halves};
    made.materials[0].base_texture = 0;
    made.materials[0].base_color = Vec3(1.0f);
    ThreadPool pool(2);
    const Pair pair = makePair(std::move(made), 128, pool);
    const SurfelLevel& level = pair.model.meshes[0].surfels->levels[0];
    int of_shaft = 0, mixed = 0;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            const float height = std::abs(s.position.z);
            // Where the halves meet, and where the picture repeats.
            if (height < 4.0f * level.spacing || height > 0.5f) continue;
            of_shaft += std::abs(s.position.x) < 0.1f && std::abs(s.position.y) < 0.1f;
            mixed += std::abs(s.albedo.g - (s.position.z < 0.0f ? 1.0f : 0.0f)) > 0.05f;
        }
    }
    EXPECT_GT(of_shaft, 200);
    EXPECT_EQ(mixed, 0);
}

// Shading normals smoothed over few triangles point away from where the surface is still seen.
TEST(PointBlocks, conesHideNoSurfaceWhoseShadingNormalsPointAway) {
    constexpr int kPixels = 96;
    GeneratedMesh made = torus();
    Mesh plate;
    addPlate(plate, Vec3(-1, -1, 0), Vec3(2, 0, 0), Vec3(0, 2, 0), Vec3(0.766f, 0.0f, 0.643f));
    made.mesh = std::move(plate);
    ThreadPool pool(2);
    const Pair pair = makePair(std::move(made), kPixels, pool);
    const Camera camera = cameraTo(pair.source, Vec3(-0.85f, 0.0f, 0.527f), kPixels, kPixels, 1.0);
    const Image rays = draw(pair.source, camera, kPixels, Method::kRaycast, 16, pool, 1),
                points = draw(pair.model, camera, kPixels, Method::kPoints, 1, pool, 1);
    EXPECT_EQ(compareImages(points, rays, pool).holes->count, 0u);
}

// Splats are no larger than what a point stands for, or both sides of a crease reach over it.
TEST(PointBlocks, creasesOfWhatIsMagnifiedAreNarrowByEwa) {
    ThreadPool pool(2);
    const Pair pair = makePair(makePrimitive("box", 12, Vec3(0.8f, 0.5f, 0.3f)), 64, pool);
    const Camera camera = cameraTo(pair.source, maskDirectionOf(3), 64, 256, 4.0);
    const Image rays = draw(pair.source, camera, 256, Method::kRaycast, 9, pool, 1),
                points =
                    draw(pair.model, camera, 256, Method::kPoints, 1, pool, 1, Reconstruct::kEwa);
    const CompareResult result = compareImages(points, rays, pool);
    EXPECT_GT(result.psnr, 39.5);
    EXPECT_LE(result.holes->count, 4u);
}

// Masks know of a direction what is seen from where its part of the sphere ends.
TEST(PointBlocks, masksHideNothingWhereTheirDirectionsMeet) {
    constexpr int kPixels = 128;
    ThreadPool pool(2);
    const Pair pair = makePair(tree(), kPixels, pool);
    Scene without = pair.model;
    auto model = std::make_shared<SurfelModel>(*pair.model.meshes[0].surfels);
    limitVisibility(*model, true, 0);
    without.meshes[0].surfels = std::move(model);
    Renderer masked(pair.model, pool), all(without, pool);
    int lost = 0;
    for (int m = 0; m < kMaskDirections; m += 3) {
        Vec3 farthest = maskDirectionOf(m);
        for (int i = 0; i < 4000; ++i) {
            const float y = 1.0f - (2.0f * float(i) + 1.0f) / 4000.0f, turn = float(i) * 2.4f;
            const float r = std::sqrt(1.0f - y * y);
            const Vec3 d(r * std::cos(turn), y, r * std::sin(turn));
            if (maskDirectionIndex(d) == m &&
                glm::dot(d, maskDirectionOf(m)) < glm::dot(farthest, maskDirectionOf(m)))
                farthest = d;
        }
        FrameRequest request;
        request.camera = cameraTo(pair.source, farthest, kPixels, kPixels, 1.0);
        request.settings.width = request.settings.height = kPixels;
        request.settings.subpixels = 1;
        request.settings.fill = false;
        request.aovs = {"depth"};
        const Image a = masked.render(request).image, b = all.render(request).image;
        const int depth = a.channelIndex("depth");
        for (int y = 0; y < kPixels; ++y) {
            for (int x = 0; x < kPixels; ++x)
                lost += a.pixel(x, y)[depth] > 1.02f * b.pixel(x, y)[depth];
        }
    }
    EXPECT_EQ(lost, 0);
}

// Bit by bit, with and without leaving out what is hidden.
void expectSameForAnyTiles(const Scene& scene, const std::vector<Camera>& cameras,
                           const std::vector<Reconstruct>& methods, ThreadPool& pool) {
    Renderer renderer(scene, pool);
    for (const Reconstruct method : methods) {
        for (size_t c = 0; c < cameras.size(); ++c) {
            FrameRequest request;
            request.camera = cameras[c];
            request.settings.width = request.settings.height = 100;
            request.settings.subpixels = 1;
            request.settings.splat_size = 3.0;
            request.settings.reconstruct = method;
            for (const bool culls : {false, true}) {
                request.settings.culling = culls;
                request.settings.tile_size = 1024;
                const Image whole = renderer.render(request).image;
                for (const int tile : {8, 13, 31}) {
                    request.settings.tile_size = tile;
                    EXPECT_TRUE(whole.data == renderer.render(request).image.data)
                        << "method " << int(method) << " camera " << c << " culling " << culls
                        << " tile " << tile;
                }
            }
        }
    }
}

const std::vector<Reconstruct> kAllMethods = {Reconstruct::kPerPixel, Reconstruct::kSplat,
                                              Reconstruct::kGaussian, Reconstruct::kPullPush,
                                              Reconstruct::kEwa,      Reconstruct::kBins};

// Blocks that lie elsewhere are left out of each tile: none that shows may be.
TEST(PointBlocks, samePictureForAnyTiles) {
    ThreadPool pool(2);
    const Pair pair = makePair(tree(), 48, pool);
    const DBox3 bounds = sceneBounds(pair.source);
    const DVec3 center = 0.5 * (bounds.min + bounds.max);
    std::vector<Camera> cameras = {cameraTo(pair.source, maskDirectionOf(3), 48, 100, 1.5),
                                   cameraTo(pair.source, maskDirectionOf(60), 48, 100, 9.0)};
    // From within, and from aside without perspective.
    cameras.push_back(lookAt(center, center + DVec3(0.3, -0.2, 1.0)));
    cameras.back().fov_y = 1.6;
    cameras.push_back(cameras[0]);
    cameras.back().orthographic = true;
    cameras.back().height = 0.3 * (bounds.max.y - bounds.min.y);
    expectSameForAnyTiles(pair.model, cameras, kAllMethods, pool);
}

// What a point shows in several subpixels depends on where they are.
TEST(PointBlocks, samePictureOfWhatShinesForAnyTiles) {
    ThreadPool pool(2);
    Pair pair = makePair(torus(), 48, pool);
    for (Material& material : pair.model.materials)
        material.roughness = 0.2f, material.metallic = 0.5f;
    pair.model.lighting.points.push_back({DVec3(0.5, 1.5, 0.5), Vec3(5.0f)});
    expectSameForAnyTiles(pair.model,
                          {cameraTo(pair.source, maskDirectionOf(3), 48, 100, 0.7),
                           cameraTo(pair.source, maskDirectionOf(60), 48, 100, 3.0)},
                          kAllMethods, pool);
}

}  // namespace
}  // namespace stipple
