// SPDX-License-Identifier: Apache-2.0
// Antialiasing of patterns whose every pixel can be told without drawing: a checkerboard texture
// that recedes until its cells are finer than a pixel, and fine lines. The reference is the
// pattern's formula, averaged over the pixel's square.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <tests/image/test_scene.h>

#include <map>

namespace stipple {
namespace {

constexpr int kWidth = 160, kHeight = 120;

// Whether the pattern is white at a place of the plane y = 0.
using Pattern = bool (*)(double x, double z);

// Grey of the pattern, with `grid` x `grid` rays a pixel.
Image averaged(const View& view, Pattern isWhite, int grid) {
    Image image;
    image.width = kWidth, image.height = kHeight;
    image.channels = {"R", "G", "B", "A"};
    image.data.resize(size_t(kWidth) * kHeight * 4);
    const DMat3 world_from_camera = glm::transpose(view.camera_from_world);
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
            int n_white = 0;
            for (int i = 0; i < grid * grid; ++i) {
                Vec3 origin, direction;
                view.ray(float(x) + (float(i % grid) + 0.5f) / float(grid),
                         float(y) + (float(i / grid) + 0.5f) / float(grid), origin, direction);
                const DVec3 d = world_from_camera * DVec3(direction);
                const DVec3 p = view.eye_world - d * (view.eye_world.y / d.y);
                n_white += isWhite(p.x, p.z);
            }
            float* pixel = image.pixel(x, y);
            pixel[0] = pixel[1] = pixel[2] = float(n_white) / float(grid * grid);
            pixel[3] = 1.0f;
        }
    }
    return image;
}

// Cells of a metre.
bool isWhiteCell(double x, double z) {
    return (int64_t(std::floor(x)) + int64_t(std::floor(z))) % 2 == 0;
}

constexpr int kLines = 24;
constexpr double kLineLength = 16.0, kLineWidth = 0.12, kLineGap = 4.0;

Affine lineAt(int i) {
    const double turn = kPi * i / kLines;
    return placed(DVec3(std::cos(turn), 0, -std::sin(turn)) * (kLineGap + 0.5 * kLineLength),
                  DVec3(kLineLength, 1.0, kLineWidth), turn);
}

// Lines like the spokes of half a wheel.
bool isWhiteLine(double x, double z) {
    static const std::vector<Affine> lines_from_world = [] {
        std::vector<Affine> result;
        for (int i = 0; i < kLines; ++i) result.push_back(inverse(lineAt(i)));
        return result;
    }();
    for (const Affine& line_from_world : lines_from_world) {
        const DVec3 p = line_from_world.point(DVec3(x, 0, z));
        if (std::abs(p.x) <= 0.5 && std::abs(p.z) <= 0.5) return true;
    }
    return false;
}

Material whiteMaterial() {
    Material material;
    material.base_color = Vec3(1.0f);
    material.unlit = true;
    material.double_sided = true;
    return material;
}

Scene& checkerboard(TestScene& t) {
    constexpr int kCells = 8, kTexels = 512, kRepeats = 128;
    Texture texture;
    texture.nearest = true;
    texture.levels.resize(1);
    Texture::Level& level = texture.levels[0];
    level.width = level.height = kTexels;
    for (int v = 0; v < kTexels; ++v) {
        for (int u = 0; u < kTexels; ++u) {
            const bool is_white = (u * kCells / kTexels + v * kCells / kTexels) % 2 == 0;
            level.rgba.insert(level.rgba.end(), 3, is_white ? 255 : 0);
            level.rgba.push_back(255);
        }
    }
    buildMipmaps(texture);
    t.scene.textures.push_back(texture);
    GeneratedMesh plane = makePrimitive("plane", 200000, Vec3(1.0f));
    plane.materials[0] = whiteMaterial();
    plane.materials[0].base_texture = 0;
    plane.mesh.uvs.clear();
    for (const Vec3& p : plane.mesh.positions)
        plane.mesh.uvs.push_back(Vec2(p.x, p.z) * float(kRepeats));
    t.add(std::move(plane), placed(DVec3(0.0), DVec3(kCells * kRepeats)));
    return t.build();
}

Scene& lines(TestScene& t) {
    Sky& sky = t.scene.lighting.sky;
    sky.zenith = sky.horizon = sky.ground = Vec3(0.0f);
    GeneratedMesh line = makePrimitive("plane", 20000, Vec3(1.0f));
    line.materials[0] = whiteMaterial();
    const uint32_t mesh = addMesh(t.scene, std::move(line));
    for (int i = 0; i < kLines; ++i) t.root.instances.add(ChildRef::mesh(mesh), lineAt(i));
    return t.build();
}

// PSNR of each reconstruction at the default numbers of subpixels and points, with all triangles as
// points.
std::map<Reconstruct, double> psnrs(const Scene& scene, Pattern pattern, const Camera& camera) {
    constexpr int kGrid = 16;
    FrameRequest r;
    r.camera = camera;
    r.settings.width = kWidth;
    r.settings.height = kHeight;
    r.settings.area_threshold = r.settings.large_triangle = 1e6;
    const Image reference = averaged(makeView(camera, kWidth, kHeight, 1), pattern, kGrid);
    ThreadPool pool(2);
    Renderer renderer(scene, pool);
    std::map<Reconstruct, double> result;
    for (const Reconstruct reconstruct : kReconstructions) {
        r.settings.reconstruct = reconstruct;
        const Frame frame = renderer.render(r);
        EXPECT_GT(frame.stats.points_kept, uint64_t(kWidth * kHeight / 4));
        result[reconstruct] = compareImages(frame.image, reference, pool).psnr;
        testing::Test::RecordProperty("psnr_" + std::to_string(int(reconstruct)),
                                      std::to_string(result[reconstruct]));
    }
    return result;
}

TEST(Antialiasing, ewaAveragesARecedingCheckerboard) {
    TestScene t;
    const auto psnr = psnrs(checkerboard(t), isWhiteCell, lookAt(DVec3(3, 14, 30), DVec3(0, 0, 0)));
    EXPECT_GE(psnr.at(Reconstruct::kEwa), 26.0);
    EXPECT_GT(psnr.at(Reconstruct::kEwa), psnr.at(Reconstruct::kGaussian) + 2.0);
    EXPECT_GT(psnr.at(Reconstruct::kEwa), psnr.at(Reconstruct::kPerPixel) + 4.0);
}

// Half a pixel wide.
TEST(Antialiasing, fineLinesAreAsWideAsTheyAre) {
    TestScene t;
    const auto psnr = psnrs(lines(t), isWhiteLine, lookAt(DVec3(0, 36, 1), DVec3(0, 0, -8)));
    EXPECT_GE(psnr.at(Reconstruct::kEwa), 26.0);
    EXPECT_GE(psnr.at(Reconstruct::kGaussian), 26.0);
}

}  // namespace
}  // namespace stipple
