// SPDX-License-Identifier: Apache-2.0
// What the OSMesa rasterizer draws: places, depths, numbers, sides, masks, clipping, tiles.
#include <core/error.h>
#include <raster/rasterizer.h>

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace stipple {
namespace {

// Meshes, materials and a job, for one rasterizer.
struct Stage {
    struct Arrays {
        std::vector<Vec3> positions;
        std::vector<Vec2> uvs;
        std::vector<Vec4> colors;
        std::vector<UVec3> triangles;
        std::vector<uint16_t> materials;
    };
    std::vector<Arrays> meshes;
    std::vector<Material> materials = {Material{}};
    std::vector<Texture> textures;
    RasterJob job;
    std::unique_ptr<Rasterizer> rasterizer;

    // Every three positions are a triangle.
    Arrays& addMesh(const std::vector<Vec3>& positions, uint16_t material = 0) {
        Arrays a;
        a.positions = positions;
        for (uint32_t i = 0; i + 2 < positions.size(); i += 3)
            a.triangles.emplace_back(i, i + 1, i + 2);
        a.materials.assign(a.triangles.size(), material);
        meshes.push_back(a);
        return meshes.back();
    }
    RasterDraw& addDraw(uint32_t mesh, uint32_t first_number,
                        const std::vector<TriangleRange>& ranges = {}) {
        RasterDraw draw;
        draw.mesh = mesh;
        draw.first_number = first_number;
        draw.range_begin = uint32_t(job.ranges.size());
        if (ranges.empty()) job.ranges.push_back({0, uint32_t(meshes[mesh].triangles.size())});
        job.ranges.insert(job.ranges.end(), ranges.begin(), ranges.end());
        draw.range_count = uint32_t(job.ranges.size()) - draw.range_begin;
        job.draws.push_back(draw);
        return job.draws.back();
    }
    void start(int n_threads = 0) {
        std::vector<RasterMesh> list;
        for (const Arrays& a : meshes)
            list.push_back({&a.positions, &a.uvs, &a.colors, &a.triangles, &a.materials});
        rasterizer = makeOsmesaRasterizer(std::move(list), materials, textures, n_threads);
    }
    RasterTarget render(const View& view, int n_threads = 0) {
        if (!rasterizer) start(n_threads);
        RasterTarget target;
        rasterizer->render(view, job, target);
        return target;
    }
};

// At depth 1 a unit is a pixel, and (0, 0) is the top left corner of the picture.
View pixelView(int width, int height) {
    View view;
    view.width = width;
    view.height = height;
    return view;
}

// Numbers modulo 10, '.' where there is nothing.
std::string picture(const RasterTarget& target) {
    std::string s;
    for (int y = 0; y < target.height; ++y) {
        for (int x = 0; x < target.width; ++x) {
            const uint32_t n = target.number[size_t(y) * target.width + x];
            s += n == kNoNumber ? '.' : char('0' + n % 10);
        }
        s += '\n';
    }
    return s;
}

// Two triangles, counter-clockwise seen from the front, which faces a camera that looks along +z
// with y down.
std::vector<Vec3> quad(float x0, float y0, float x1, float y1, float z) {
    const Vec3 a(x0, y0, z), b(x1, y0, z), c(x1, y1, z), d(x0, y1, z);
    return {a, c, b, a, d, c};
}

std::vector<Vec3> backwards(std::vector<Vec3> positions) {
    std::reverse(positions.begin(), positions.end());
    return positions;
}

TEST(RasterOsmesa, drawsATriangleAtItsPixels) {
    Stage stage;
    stage.addMesh({Vec3(1, 1, 1), Vec3(1, 6, 1), Vec3(6, 1, 1)});
    stage.addDraw(0, 3);
    // Row 0 is on top. Off the exact diagonal, which belongs to one side or the other by a rule of
    // the GL.
    stage.job.draws[0].translation = Vec3(0.1f, 0.1f, 0.0f);
    const RasterTarget target = stage.render(pixelView(8, 7));
    EXPECT_EQ(picture(target),
              "........\n"
              ".33333..\n"
              ".3333...\n"
              ".333....\n"
              ".33.....\n"
              ".3......\n"
              "........\n");
    EXPECT_EQ(target.depth[0], kInfinity);
    EXPECT_FLOAT_EQ(target.depth[1 * 8 + 1], 1.0f);
}

TEST(RasterOsmesa, samplesAtSubpixelCentres) {
    Stage stage;
    stage.addMesh(quad(0.3f, 0.3f, 0.7f, 0.9f, 1.0f));
    stage.addDraw(0, 5);
    View view = pixelView(2, 1);
    view.subpixels = 4;
    view.focal = 4.0;
    EXPECT_EQ(picture(stage.render(view)),
              "........\n"
              ".55.....\n"
              ".65.....\n"
              ".66.....\n");
}

// Triangles at random places, compared with the ray through each subpixel.
void checkDepths(bool orthographic, float near_z) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> unit(0.0f, 1.0f);
    Stage stage;
    stage.materials[0].double_sided = true;
    std::vector<Vec3> positions;
    for (int i = 0; i < 300; ++i) {
        const float z = 2.0f * std::pow(1e4f, unit(random));
        const Vec3 center((unit(random) - 0.5f) * z, (unit(random) - 0.5f) * z, z);
        for (int k = 0; k < 3; ++k) {
            positions.push_back(
                center +
                Vec3(unit(random) - 0.5f, unit(random) - 0.5f, unit(random) - 0.5f) * z * 0.6f);
        }
    }
    stage.addMesh(positions);
    stage.addDraw(0, 0);
    Camera camera;
    camera.orthographic = orthographic;
    camera.height = 5000.0;
    camera.near_z = near_z;
    View view = makeView(camera, 160, 120, 2);
    view.turnTo(DMat3(1.0));
    const RasterTarget target = stage.render(view);
    int n = 0;
    for (int y = 0; y < target.height; ++y) {
        for (int x = 0; x < target.width; ++x) {
            const size_t i = size_t(y) * target.width + x;
            if (target.number[i] == kNoNumber) {
                EXPECT_EQ(target.depth[i], kInfinity);
                continue;
            }
            ++n;
            ASSERT_LT(target.number[i], 300u);
            const DVec3 a(positions[3 * target.number[i]]), b(positions[3 * target.number[i] + 1]),
                c(positions[3 * target.number[i] + 2]);
            const DVec3 normal = glm::normalize(glm::cross(b - a, c - a));
            const DVec3 direction =
                DVec3((x + 0.5 - view.center_x) / view.focal,
                      (y + 0.5 - view.center_y) / view.focal, orthographic ? 0.0 : 1.0);
            const DVec3 along = orthographic ? DVec3(0, 0, 1) : direction,
                        origin = orthographic ? direction : DVec3(0);
            const double slope = glm::dot(normal, along) / glm::length(along);
            if (std::abs(slope) < 0.02)
                continue;  // seen edge-on, where the coordinates' own rounding is larger
            const double z = glm::dot(normal, a - origin) / glm::dot(normal, along);
            // The orthographic depth buffer is linear: its steps are a share of the scene's depth.
            EXPECT_NEAR(target.depth[i], z, 1e-5 * z + (orthographic ? 3e-7 * 2e4 : 0.0))
                << x << ' ' << y;
        }
    }
    EXPECT_GT(n, target.width * target.height / 3);
}

TEST(RasterOsmesa, givesExactDepthsInPerspective) { checkDepths(false, 0.05f); }
TEST(RasterOsmesa, givesExactDepthsOrthographically) { checkDepths(true, 0.05f); }

TEST(RasterOsmesa, keepsDepthsOfAGroundThatReachesFromTheEyeToTheHorizon) {
    Stage stage;
    stage.addMesh(quad(-1e5f, -1e5f, 1e5f, 1e5f, 0.0f));
    stage.materials[0].double_sided = true;
    RasterDraw& draw = stage.addDraw(0, 0);
    draw.linear = Mat3(Vec3(1, 0, 0), Vec3(0, 0, 1), Vec3(0, 1, 0));
    draw.translation = Vec3(0.0f, 1.7f, 0.0f);  // y is down: the eye is 1.7 m above it
    View view = makeView(Camera{}, 320, 240, 4);
    const RasterTarget target = stage.render(view);
    double worst = 0.0;
    for (int y = 0; y < target.height; ++y) {
        const double z = 1.7 * view.focal / (y + 0.5 - view.center_y);
        if (!(z > 0.0 && z < 0.99e5)) continue;
        for (int x = 0; x < target.width; x += 7) {
            const size_t i = size_t(y) * target.width + x;
            ASSERT_NE(target.number[i], kNoNumber) << x << ' ' << y;
            worst = std::max(worst, std::abs(target.depth[i] - z) / z);
        }
    }
    EXPECT_LT(worst, 1e-4);
    RecordProperty("worst_relative_error", std::to_string(worst));
}

TEST(RasterOsmesa, showsTheNearestWhateverTheOrder) {
    for (const bool near_first : {true, false}) {
        Stage stage;
        stage.addMesh(quad(0, 0, 6, 2, 1.0f));
        stage.addMesh(quad(3, 0, 9, 4, 1.5f));
        stage.addDraw(near_first ? 0 : 1, near_first ? 10 : 24);
        stage.addDraw(near_first ? 1 : 0, near_first ? 24 : 10);
        for (RasterDraw& d : stage.job.draws)
            d.linear[0][0] = d.linear[1][1] = d.mesh == 0 ? 1.0f : 1.5f;
        const RasterTarget target = stage.render(pixelView(8, 2));
        for (int i = 0; i < 16; ++i) {
            const bool nearest = i % 8 < 6;
            EXPECT_EQ(target.number[i] / 2, nearest ? 5u : 12u) << i;
            EXPECT_FLOAT_EQ(target.depth[i], nearest ? 1.0f : 1.5f);
        }
    }
}

TEST(RasterOsmesa, numbersTrianglesOverDrawsRangesAndMeshes) {
    Stage stage;
    std::vector<Vec3> strip, other;
    for (int i = 0; i < 8; ++i) {  // triangle i covers the centre of pixel i
        const std::vector<Vec3> t = {Vec3(i, 0, 1), Vec3(i, 1.5f, 1), Vec3(i + 0.9f, 0, 1)};
        strip.insert(strip.end(), t.begin(), t.end());
    }
    stage.addMesh(strip);
    stage.addMesh(std::vector<Vec3>(strip.begin(), strip.begin() + 9));
    stage.addDraw(
        0, 0,
        {{5, 2}, {1, 1}, {2, 1}, {7, 100}, {900, 5}});  // out of order, touching, beyond the end
    stage.addDraw(1, 1, {{1, 2}}).translation.y = 1.0f;
    stage.addDraw(0, 0xfffffff0u, {{3, 1}}).translation.y = 2.0f;  // numbers use all 32 bits
    const RasterTarget target = stage.render(pixelView(8, 3));
    EXPECT_EQ(picture(target),
              ".12..56"
              "7\n"
              ".23....."
              "\n"
              "...3...."
              "\n");  // 0xfffffff3 = 4294967283
    EXPECT_EQ(target.number[2 * 8 + 3], 0xfffffff3u);
}

TEST(RasterOsmesa, clipsAtTheNearPlaneAndCutsAtTheFarOne) {
    Stage stage;
    stage.materials[0].double_sided = true;
    // A floor one unit below the eye, from behind it to z = 100; focal 8 and horizon at row 4: row
    // y shows z = 8 / (y + 0.5 - 4).
    stage.addMesh({Vec3(-100, 1, -50), Vec3(100, 1, -50), Vec3(100, 1, 100), Vec3(-100, 1, -50),
                   Vec3(100, 1, 100), Vec3(-100, 1, 100)});
    stage.addDraw(0, 4);
    View view = pixelView(4, 12);
    view.focal = 8.0;
    view.center_x = 2.0;
    view.center_y = 4.0;
    view.near_z = 1.5f;  // row 9 shows 8 / 5.5 = 1.45
    view.far_z = 10.0f;  // row 4 shows 16
    const RasterTarget target = stage.render(view);
    for (int y = 0; y < 12; ++y) {
        for (int x = 0; x < 4; ++x) {
            const float z = 8.0f / (y + 0.5f - 4.0f);
            const bool there = z > 1.5f && z < 10.0f;
            EXPECT_EQ(target.number[y * 4 + x] != kNoNumber, there) << x << ' ' << y;
            if (there) {
                EXPECT_NEAR(target.depth[y * 4 + x], z, 1e-5f * z);
            }
        }
    }
    view.far_z = kInfinity;
    EXPECT_NEAR(stage.render(view).depth[4 * 4 + 1], 16.0f, 2e-4f);
    view.far_z = 1.0f;  // nothing is between
    EXPECT_EQ(stage.render(view).number, std::vector<uint32_t>(48, kNoNumber));
}

TEST(RasterOsmesa, seesBehindTheEyeOrthographically) {
    Stage stage;
    stage.addMesh(quad(0, 0, 2, 1, -30.0f));
    stage.addMesh(quad(0, 0, 4, 1, 1000.0f));
    stage.addMesh(quad(0, 0, 6, 1, 5000.0f));
    for (uint32_t i = 0; i < 3; ++i) stage.addDraw(i, 2 * i);
    View view = pixelView(8, 1);
    view.orthographic = true;
    view.near_z = -40.0f;
    view.far_z = 4000.0f;
    const RasterTarget target = stage.render(view);
    EXPECT_NEAR(target.depth[0], -30.0f, 1e-3f);
    EXPECT_NEAR(target.depth[3], 1000.0f, 1e-2f);
    EXPECT_EQ(target.depth[5], kInfinity);
    EXPECT_EQ(target.number[3] / 2, 1u);
}

TEST(RasterOsmesa, dropsBackFacesOfSingleSidedSurfaces) {
    Stage stage;
    stage.materials.resize(2);
    stage.materials[1].double_sided = true;
    stage.addMesh(quad(0, 0, 1, 1, 1.0f));
    stage.addMesh(backwards(quad(0, 0, 1, 1, 1.0f)));
    stage.addMesh(backwards(quad(0, 0, 1, 1, 1.0f)), 1);
    for (int mirrored = 0; mirrored < 2; ++mirrored) {
        for (uint32_t mesh = 0; mesh < 3; ++mesh) {
            RasterDraw& draw = stage.addDraw(mesh, 2 * mesh);
            draw.translation = Vec3(mesh, mirrored, 0);
            if (mirrored) draw.linear[0][0] = -1.0f, draw.translation.x += 1.0f;
        }
    }
    const RasterTarget target = stage.render(pixelView(3, 2));
    const std::vector<bool> there = {true, false, true, true, false, true};
    for (int i = 0; i < 6; ++i) EXPECT_EQ(target.number[i] != kNoNumber, there[i]) << i;
}

TEST(RasterOsmesa, agreesWithCounterClockwiseFrontsInTheWorld) {
    // An ordinary camera at z = 5 that looks at a triangle counter-clockwise in the xy plane, y up.
    Stage stage;
    stage.addMesh({Vec3(-1, -1, 0), Vec3(1, -1, 0), Vec3(0, 1, 0)});
    const View view = makeView(lookAt(DVec3(0, 0, 5), DVec3(0)), 9, 9, 1);
    RasterDraw& draw = stage.addDraw(0, 0);
    draw.linear = Mat3(view.camera_from_world);
    draw.translation = Vec3(view.camera_from_world * -view.eye_world);
    EXPECT_EQ(picture(stage.render(view)),
              ".........\n"
              ".........\n"
              "....0....\n"
              "....0....\n"
              "...000...\n"
              "...000...\n"
              "..00000..\n"
              ".........\n"
              ".........\n");
}

Texture halfTransparent() {
    Texture texture;  // 4 x 2 texels: the left half of the upper row and the right half of the
                      // lower one are there
    texture.nearest = true;
    Texture::Level level{4, 2, {}};
    for (const int alpha : {255, 255, 0, 0, 0, 0, 255, 255}) {
        for (int k = 0; k < 3; ++k) level.rgba.push_back(0);
        level.rgba.push_back(uint8_t(alpha));
    }
    texture.levels = {level};
    return texture;
}

TEST(RasterOsmesa, leavesOutMaskedTexels) {
    Stage stage;
    stage.textures = {halfTransparent()};
    stage.materials.resize(4);
    for (int i = 1; i < 4; ++i) stage.materials[i].alpha_mode = AlphaMode::kMask;
    stage.materials[1].base_texture = stage.materials[3].base_texture = 0;
    stage.materials[2].alpha_cutoff = 0.7f;
    stage.materials[3].alpha = 0.4f;  // below the cutoff everywhere
    const std::vector<Vec2> uvs = {Vec2(0, 0), Vec2(1, 1), Vec2(1, 0),
                                   Vec2(0, 0), Vec2(0, 1), Vec2(1, 1)};
    stage.addMesh(quad(0, 0, 8, 2, 1.0f), 1).uvs = uvs;
    stage.addMesh(quad(0, 2, 8, 4, 1.0f), 1);  // no uvs: no mask
    // Vertex alpha rises from 0 on the left to 1 on the right.
    stage.addMesh(quad(0, 4, 8, 5, 1.0f), 2);
    for (const Vec3& p : stage.meshes[2].positions)
        stage.meshes[2].colors.emplace_back(1, 1, 1, p.x / 8.0f);
    stage.addMesh(quad(0, 5, 8, 6, 1.0f), 3).uvs = uvs;
    stage.addMesh(quad(0, 0, 8, 6, 2.0f), 0);  // shows through
    for (uint32_t i = 0; i < 5; ++i) stage.addDraw(i, 10 * i + i + 1);
    stage.job.draws[4].linear[0][0] = stage.job.draws[4].linear[1][1] = 2.0f;
    RasterTarget target = stage.render(pixelView(8, 6));
    std::string s;
    for (size_t i = 0; i < target.number.size(); ++i) {
        s += char('0' + target.number[i] / 10);
        if (i % 8 == 7) s += '\n';
    }
    EXPECT_EQ(s,
              "00004444\n"
              "44440000\n"
              "11111111\n"
              "11111111\n"
              "44444422\n"
              "44444444\n");
}

TEST(RasterOsmesa, repeatsMirrorsAndClampsMasks) {
    for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
        Stage stage;
        stage.textures = {halfTransparent()};
        stage.textures[0].wrap_u = wrap;
        stage.materials[0].alpha_mode = AlphaMode::kBlend;
        stage.materials[0].base_texture = 0;
        stage.addMesh(quad(0, 0, 8, 1, 1.0f));
        for (const Vec3& p : stage.meshes[0].positions)
            stage.meshes[0].uvs.emplace_back(p.x / 4.0f, p.y / 4.0f);
        stage.addDraw(0, 0);
        std::string s = picture(stage.render(pixelView(8, 1)));
        for (char& c : s) c = c == '1' ? '0' : c;
        EXPECT_EQ(s, wrap == Wrap::kRepeat   ? "00..00..\n"
                     : wrap == Wrap::kMirror ? "00....00\n"
                                             : "00......\n");
    }
}

TEST(RasterOsmesa, fillsWithNothingWhenNothingIsDrawn) {
    Stage stage;
    stage.addMesh(quad(0, 0, 4, 4, 1.0f));
    RasterTarget target = stage.render(pixelView(5, 3));
    EXPECT_EQ(target.number, std::vector<uint32_t>(15, kNoNumber));
    EXPECT_EQ(target.depth, std::vector<float>(15, kInfinity));
    stage.addDraw(0, 0).translation.x = 100.0f;  // out of the picture
    stage.addDraw(0, 0).translation.z = -9.0f;   // behind the eye
    stage.addDraw(0, 0).translation.y = std::nanf("");
    stage.addDraw(0, 0, {{7, 3}});
    stage.job.draws.push_back({});  // no ranges
    EXPECT_EQ(stage.render(pixelView(5, 3)).number, std::vector<uint32_t>(15, kNoNumber));
}

TEST(RasterOsmesa, forgetsTheLastPicture) {
    Stage stage;
    stage.addMesh(quad(0, 0, 4, 4, 1.0f));
    stage.addDraw(0, 0);
    EXPECT_NE(stage.render(pixelView(4, 4)).number[5], kNoNumber);
    stage.job.draws[0].translation.x = 2.0f;
    for (const auto& [width, height] : {std::pair(4, 4), {7, 5}, {4, 4}, {64, 3}}) {
        const RasterTarget target = stage.render(pixelView(width, height));
        EXPECT_EQ(target.number[0], kNoNumber);
        EXPECT_EQ(target.depth[1], kInfinity);
        EXPECT_NE(target.number[2], kNoNumber);
    }
}

TEST(RasterOsmesa, drawsHugePicturesInTiles) {
    // Wider, and higher, than any target of the GL.
    for (const bool wide : {true, false}) {
        Stage stage;
        const float length = 40000.0f;
        stage.addMesh({Vec3(0, 0, 1), Vec3(length, 16, 1), Vec3(length, 0, 1)});
        stage.addDraw(0, 6);
        if (!wide) stage.job.draws[0].linear = Mat3(Vec3(0, 1, 0), Vec3(1, 0, 0), Vec3(0, 0, 1));
        const View view = wide ? pixelView(40000, 16) : pixelView(16, 40000);
        const RasterTarget target = stage.render(view);
        int wrong = 0;
        for (int i = 0; i < 40000; ++i) {
            for (int k = 0; k < 16; ++k) {
                // The edge is where k + 0.5 = 16 * (i + 0.5) / length; a snapped vertex may shift
                // it by a few pixels along it.
                const float distance = 16.0f * (float(i) + 0.5f) / length - (float(k) + 0.5f);
                if (std::abs(distance) < 0.01f) continue;
                const size_t at = wide ? size_t(k) * 40000 + i : size_t(i) * 16 + k;
                wrong += (target.number[at] == 6) != (distance > 0.0f);
                wrong += target.number[at] == 6 && std::abs(target.depth[at] - 1.0f) > 1e-5f;
            }
        }
        EXPECT_EQ(wrong, 0) << wide;
    }
}

// A heap of triangles with masked ones, and a hash of its picture.
uint64_t heapHash(int n_threads) {
    std::mt19937 random(11);
    const auto unit = [&] { return float(random() >> 8) * 0x1p-24f; };
    Stage stage;
    stage.textures = {halfTransparent()};
    stage.textures[0].nearest = false;
    stage.materials.resize(2);
    stage.materials[0].double_sided = true;
    stage.materials[1].alpha_mode = AlphaMode::kMask;
    stage.materials[1].base_texture = 0;
    std::vector<Vec3> positions;
    for (int i = 0; i < 3000; ++i)
        positions.emplace_back(unit() * 30 - 10, unit() * 30 - 10, 1 + 20 * unit());
    stage.addMesh(positions);
    for (int i = 0; i < 3000; ++i) stage.meshes[0].uvs.emplace_back(unit(), unit());
    for (int i = 0; i < 500; ++i) stage.meshes[0].materials[i] = 1;
    for (uint32_t i = 0; i < 5; ++i) stage.addDraw(0, 1000 * i).translation = Vec3(i, 0, i);
    View view = pixelView(300, 200);
    view.focal = 100.0;
    const RasterTarget target = stage.render(view, n_threads);
    uint64_t hash = 14695981039346656037u;
    const auto mix = [&](const void* data, size_t bytes) {
        for (size_t i = 0; i < bytes; ++i)
            hash = (hash ^ static_cast<const uint8_t*>(data)[i]) * 1099511628211u;
    };
    mix(target.depth.data(), target.depth.size() * 4);
    mix(target.number.data(), target.number.size() * 4);
    return hash;
}

// llvmpipe fixes its threads once a process, so every number of threads gets a process of its own.
TEST(RasterOsmesaDeathTest, drawsTheSameForAnyNumberOfThreads) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    const uint64_t expected = heapHash(0);
    for (const int n_threads : {1, 2, 7}) {
        EXPECT_EXIT(
            {
                std::fprintf(stderr, "hash %016llx",
                             static_cast<unsigned long long>(heapHash(n_threads)));
                std::exit(0);
            },
            testing::ExitedWithCode(0),
            [&] {
                char text[32];
                std::snprintf(text, sizeof(text), "hash %016llx",
                              static_cast<unsigned long long>(expected));
                return std::string(text);
            }());
    }
}

TEST(RasterOsmesa, takesTurnsWithAnotherRasterizer) {
    Stage first, second;
    first.addMesh(quad(0, 0, 1, 1, 1.0f));
    second.addMesh(quad(1, 0, 2, 1, 1.0f));
    first.addDraw(0, 2);
    second.addDraw(0, 4);
    for (int i = 0; i < 2; ++i) {
        EXPECT_EQ(first.render(pixelView(2, 1)).number[0] / 2, 1u);
        EXPECT_EQ(second.render(pixelView(2, 1)).number[1] / 2, 2u);
    }
    first.rasterizer.reset();
    EXPECT_EQ(second.render(pixelView(2, 1)).number[1] / 2, 2u);
    EXPECT_EQ(first.render(pixelView(2, 1)).number[0] / 2, 1u);  // started anew
}

TEST(RasterOsmesa, refusesDrawsThatNameNothing) {
    Stage stage;
    stage.addMesh(quad(0, 0, 2, 2, 1.0f));
    stage.addDraw(0, 0).mesh = 9;
    EXPECT_THROW(stage.render(pixelView(2, 2)), Error);
    stage.job.draws[0].mesh = 0;
    stage.job.draws[0].range_count = 0xffffffffu;
    EXPECT_THROW(stage.render(pixelView(2, 2)), Error);
    stage.job.draws[0].range_count = 1;
    EXPECT_NE(stage.render(pixelView(2, 2)).number[2], kNoNumber);  // and goes on
}

}  // namespace
}  // namespace stipple
