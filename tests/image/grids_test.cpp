// SPDX-License-Identifier: Apache-2.0
// Grids cover what they should: 1 within, on edges as much of a pixel as lies within, whatever the
// density of the grid and its slope; ripples show in silhouettes; nothing shines through.
#include <gtest/gtest.h>
#include <render/compare.h>
#include <render/renderer.h>

#include <array>

#include "../unit/uv_grid_samples.h"
#include "test_scene.h"

namespace stipple {
namespace {

constexpr int kSize = 80;  // pixels along a side of the pictures

// Adds a grid's mesh with a material of that colour, shown as it is.
uint32_t addGrid(Scene& scene, const UvGridParams& params, const Vec3& color) {
    ThreadPool pool(2);
    Mesh mesh = makeUvGrid(params, pool).mesh;
    for (uint16_t& m : mesh.triangle_material) m = uint16_t(scene.materials.size());
    Material& material = scene.materials.emplace_back();
    material.base_color = color;
    material.unlit = material.double_sided = true;
    scene.meshes.push_back(std::move(mesh));
    return uint32_t(scene.meshes.size() - 1);
}

struct Placed {
    uint32_t mesh;
    Affine group_from_mesh;
};

void build(Scene& scene, const std::vector<Placed>& placed) {
    scene.path = "test";
    Group root;
    root.instances = InstanceStore(DBox3{DVec3(-500), DVec3(500)});
    for (const Placed& p : placed) root.instances.add(ChildRef::mesh(p.mesh), p.group_from_mesh);
    scene.groups.push_back(std::move(root));
    ThreadPool pool(2);
    buildScene(scene, pool);
}

// Orthographic, along -z, a metre a pixel.
FrameRequest request(Reconstruct reconstruct) {
    FrameRequest r;
    r.camera = lookAt(DVec3(0, 0, 400), DVec3(0));
    r.camera.orthographic = true;
    r.camera.height = kSize;
    r.camera.near_z = 1.0;
    r.settings.width = r.settings.height = kSize;
    r.settings.reconstruct = reconstruct;
    r.transparent = true;
    return r;
}

Image render(const Scene& scene, const FrameRequest& r) {
    ThreadPool pool(2);
    return Renderer(scene, pool).render(r).image;
}

Image castRays(const Scene& scene, FrameRequest r) {
    r.settings.method = Method::kRaycast;
    r.settings.samples = 64;
    return render(scene, r);
}

float channel(const Image& image, int x, int y, int c) {
    return image
        .data[(size_t(y) * size_t(image.width) + size_t(x)) * image.channels.size() + size_t(c)];
}

// A plane of that size in the picture, turned away from the eye and then in the picture.
constexpr DVec2 kSide(44.0, 52.0);
DMat3 turned(double slope, double roll) {
    const double c = std::cos(slope), s = std::sin(slope), cr = std::cos(roll), sr = std::sin(roll);
    return DMat3(DVec3(cr, sr, 0), DVec3(-sr, cr, 0), DVec3(0, 0, 1)) *
           DMat3(DVec3(c, 0, -s), DVec3(s, 0, c), DVec3(0, -1, 0));
}
constexpr DVec2 kCenter(0.21, 0.33);

// How much of each pixel the plane covers: the mean over it, or weighed as the gaussian
// reconstruction does, with the variance of a pixel.
std::vector<double> planeFractions(double roll, bool is_gaussian) {
    constexpr int kFine = 16, kReach = 2;
    const int n = (kSize + 2 * kReach) * kFine;
    const auto isWithin = [&](int i, int j) {
        const DVec2 p = DVec2(i + 0.5, j + 0.5) / double(kFine) - double(kReach + kSize / 2) -
                        DVec2(kCenter.x, -kCenter.y);
        const DVec2 q(std::cos(roll) * p.x - std::sin(roll) * p.y,
                      std::sin(roll) * p.x + std::cos(roll) * p.y);
        return std::abs(q.x) < 0.5 * kSide.x && std::abs(q.y) < 0.5 * kSide.y;
    };
    std::vector<double> weights(size_t((2 * kReach + 1) * kFine), 0.0);
    double sum = 0.0;
    for (size_t i = 0; i < weights.size(); ++i) {
        const double x = (double(i) + 0.5) / kFine - kReach - 0.5;
        weights[i] = is_gaussian ? std::exp(-6.0 * x * x) : (std::abs(x) < 0.5 ? 1.0 : 0.0);
        sum += weights[i];
    }
    // Along rows, then along columns.
    std::vector<double> rows(size_t(n) * kSize, 0.0), result(size_t(kSize) * kSize, 0.0);
    for (int j = 0; j < n; ++j) {
        for (int x = 0; x < kSize; ++x) {
            for (size_t k = 0; k < weights.size(); ++k) {
                if (weights[k] > 0.0 && isWithin(x * kFine + int(k), j))
                    rows[size_t(j) * kSize + size_t(x)] += weights[k] / sum;
            }
        }
    }
    for (int y = 0; y < kSize; ++y) {
        for (int x = 0; x < kSize; ++x) {
            for (size_t k = 0; k < weights.size(); ++k) {
                result[size_t(y) * kSize + size_t(x)] +=
                    rows[(size_t(y) * kFine + k) * kSize + size_t(x)] * weights[k] / sum;
            }
        }
    }
    return result;
}

struct Case {
    Reconstruct reconstruct;
    double cells_a_pixel;
    double slope;  // degrees
    bool all_as_points;
};

class GridCoverage : public testing::TestWithParam<Case> {};

TEST_P(GridCoverage, isOneWithinAndTheFractionOnEdges) {
    const Case& c = GetParam();
    UvGridParams params;
    params.shape.size = DVec2(kSide.x / std::cos(radians(c.slope)), kSide.y);
    params.cells_u = int(std::sqrt(c.cells_a_pixel) * kSide.x);
    params.cells_v = int(std::sqrt(c.cells_a_pixel) * kSide.y);
    Scene scene;
    const uint32_t plane = addGrid(scene, params, Vec3(1.0f));
    build(scene, {});
    // Errors of pixels by a fifth of their fraction.
    std::array<double, 5> error{}, count{};
    double within = 0.0, n_within = 0.0, n_low = 0.0;
    for (const double roll : {7.0, 25.0, 61.0}) {
        scene.groups[0].instances = InstanceStore(DBox3{DVec3(-500), DVec3(500)});
        scene.groups[0].instances.add(
            ChildRef::mesh(plane), {turned(radians(c.slope), radians(roll)), DVec3(kCenter, 0.0)});
        ThreadPool pool(2);
        buildScene(scene, pool);
        FrameRequest r = request(c.reconstruct);
        if (c.all_as_points) r.settings.area_threshold = r.settings.large_triangle = 1e9;
        const Image image = render(scene, r);
        const std::vector<double> fractions =
            planeFractions(radians(roll), c.reconstruct == Reconstruct::kGaussian);
        for (int y = 0; y < kSize; ++y) {
            for (int x = 0; x < kSize; ++x) {
                const double fraction = fractions[size_t(y) * kSize + size_t(x)],
                             covered = double(channel(image, x, y, 3));
                if (fraction > 0.9999) {
                    within += covered, n_within += 1.0, n_low += covered < 0.98;
                } else if (fraction > 0.001) {
                    const size_t bin = std::min(size_t(fraction * 5.0), size_t(4));
                    error[bin] += covered - fraction, count[bin] += 1.0;
                }
            }
        }
    }
    EXPECT_NEAR(within / n_within, 1.0, 0.02);
    EXPECT_LT(n_low / n_within, 0.01);
    // Per-pixel covers 2 x 2 subpixels a point and so widens silhouettes of fine grids.
    if (c.reconstruct == Reconstruct::kPerPixel && c.cells_a_pixel > 4.0) return;
    for (size_t bin = 0; bin < error.size(); ++bin)
        EXPECT_NEAR(error[bin] / count[bin], 0.0, 0.05) << "fractions from " << 0.2 * double(bin);
}

std::vector<Case> coverageCases() {
    std::vector<Case> cases;
    for (const Reconstruct r :
         {Reconstruct::kPerPixel, Reconstruct::kGaussian, Reconstruct::kEwa, Reconstruct::kBins}) {
        for (const double slope : {0.0, 40.0, 60.0, 80.0}) {
            for (const double cells : {0.25, 1.0, 4.0, 16.0})
                cases.push_back({r, cells, slope, false});
            if (r != Reconstruct::kPerPixel) cases.push_back({r, 16.0, slope, true});
        }
    }
    return cases;
}
INSTANTIATE_TEST_SUITE_P(grids, GridCoverage, testing::ValuesIn(coverageCases()),
                         [](const auto& info) {
                             const Case& c = info.param;
                             return std::to_string(int(c.reconstruct)) + "_cells" +
                                    std::to_string(int(100 * c.cells_a_pixel)) + "_slope" +
                                    std::to_string(int(c.slope)) +
                                    (c.all_as_points ? "_points" : "");
                         });

// Where the silhouette around the picture's middle lies, in pixels, in 1-degree steps: the covered
// length along each direction.
std::vector<double> silhouette(const Image& image) {
    std::vector<double> radii;
    for (int degree = 0; degree < 360; ++degree) {
        const double a = radians(degree);
        double length = 0.0;
        for (double r = 0.125; r < 0.5 * kSize - 1.0; r += 0.25) {
            const double x = 0.5 * kSize + r * std::cos(a) - 0.5,
                         y = 0.5 * kSize + r * std::sin(a) - 0.5;
            const int i = int(x), j = int(y);
            const double fx = x - i, fy = y - j;
            length +=
                0.25 *
                ((channel(image, i, j, 3) * (1 - fx) + channel(image, i + 1, j, 3) * fx) *
                     (1 - fy) +
                 (channel(image, i, j + 1, 3) * (1 - fx) + channel(image, i + 1, j + 1, 3) * fx) *
                     fy);
        }
        radii.push_back(length);
    }
    return radii;
}

double range(const std::vector<double>& values) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    return *most - *least;
}

TEST(Grids, ripplesShowInTheSilhouette) {
    const auto ballScene = [](double amplitude, int texels_a_wave) {
        UvGridParams params;
        params.shape = shapeOf("sphere");
        params.displacements.push_back(ripples(amplitude, 12, 6, texels_a_wave));
        Scene scene;
        const uint32_t ball = addGrid(scene, params, Vec3(0.8f));
        build(scene, {{ball, {DMat3(60.0) * turned(0.5, 0.3), DVec3(0.0)}}});
        return scene;
    };
    const Scene smooth = ballScene(0.0, 6);
    for (const int texels_a_wave : {6, 24}) {
        const Scene scene = ballScene(0.05, texels_a_wave);
        for (const Reconstruct r : {Reconstruct::kGaussian, Reconstruct::kEwa}) {
            const std::vector<double> points = silhouette(render(scene, request(r))),
                                      rays = silhouette(castRays(scene, request(r)));
            double sum = 0.0, worst = 0.0;
            for (size_t i = 0; i < rays.size(); ++i) {
                sum += points[i] - rays[i];
                worst = std::max(worst, std::abs(points[i] - rays[i]));
            }
            EXPECT_LT(worst, 0.5) << "pixels";
            EXPECT_LT(std::abs(sum) / 360.0, 0.1) << "pixels";
            EXPECT_GT(range(points), 0.9 * range(rays));
            EXPECT_GT(range(points), 4.0 * range(silhouette(render(smooth, request(r)))));
        }
    }
}

TEST(Grids, nothingShinesThroughAFoldedSheet) {
    UvGridParams params;
    params.shape.size = DVec2(50.0);
    GridDisplacement d = ripples(7.0, 3, 3, 32);
    params.displacements.push_back(d);
    Scene front, both;
    const uint32_t sheet = addGrid(front, params, Vec3(0.2f, 0.3f, 0.4f));
    addGrid(both, params, Vec3(0.2f, 0.3f, 0.4f));
    const uint32_t behind = addGrid(both, params, Vec3(1.0f, 0.0f, 0.0f));
    const DMat3 lean = turned(radians(50.0), 0.4);
    build(front, {{sheet, {lean, DVec3(0.0)}}});
    build(both, {{sheet, {lean, DVec3(0.0)}}, {behind, {lean, DVec3(6.0, -4.0, -25.0)}}});
    for (const Reconstruct r : kReconstructions) {
        for (const bool all_as_points : {false, true}) {
            // Per-pixel leaves single subpixels open where points alone draw what is steep.
            if (all_as_points && r == Reconstruct::kPerPixel) continue;
            FrameRequest frame = request(r);
            if (all_as_points) frame.settings.area_threshold = frame.settings.large_triangle = 1e9;
            const Image rays = castRays(front, frame), seen = render(both, frame);
            int n_within = 0, n_red = 0, n_behind = 0;
            for (int y = 1; y + 1 < kSize; ++y) {
                for (int x = 1; x + 1 < kSize; ++x) {
                    bool is_within = true;
                    for (int j = -1; j <= 1; ++j) {
                        for (int i = -1; i <= 1; ++i)
                            is_within = is_within && channel(rays, x + i, y + j, 3) > 0.999f;
                    }
                    const bool is_red = channel(seen, x, y, 0) > 0.22f;
                    n_behind += channel(seen, x, y, 0) > 0.9f;
                    n_within += is_within, n_red += is_within && is_red;
                }
            }
            EXPECT_GT(n_within, 600);
            EXPECT_GT(n_behind, 100);  // the sheet behind can be seen beside the other
            EXPECT_EQ(n_red, 0) << int(r) << (all_as_points ? " as points" : "");
        }
    }
}

// Striped, rippled balls in groups of groups, near and far, with their shadows on a rippled floor.
Scene nestedScene() {
    Scene scene;
    Texture stripes;
    stripes.levels.push_back(
        {4, 1, {230, 220, 200, 255, 230, 220, 200, 255, 40, 50, 110, 255, 40, 50, 110, 255}});
    buildMipmaps(stripes);
    scene.textures.push_back(std::move(stripes));
    UvGridParams ball, floor;
    ball.shape = shapeOf("sphere");
    ball.displacements.push_back(ripples(0.04, 10, 5));
    ball.texture_repeat = DVec2(6.0, 1.0);
    floor.shape.size = DVec2(60.0);
    floor.displacements.push_back(ripples(0.5, 4, 4));
    for (const UvGridParams* params : {&ball, &floor}) {
        addGrid(scene, *params, Vec3(0.7f));
        scene.materials.back().unlit = scene.materials.back().double_sided = false;
    }
    scene.materials[0].base_texture = 0;
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.5f, 0.8f, 0.4f)), Vec3(2.5f)});
    Group row, field;
    row.instances = InstanceStore(DBox3{DVec3(-20), DVec3(20)});
    for (int i = 0; i < 10; ++i) {
        Affine a;
        a.linear = turned(0.3 * i, 0.5 * i) * DMat3(2.0);
        a.translation = DVec3(2.6 * (i - 4.5), 1.4, 0.0);
        row.instances.add(ChildRef::mesh(0), a);
    }
    field.instances = InstanceStore(DBox3{DVec3(-100), DVec3(100)});
    for (int i = 0; i < 12; ++i)
        field.instances.add(ChildRef::group(0), {DMat3(1.0), DVec3(0.0, 0.3, 2.4 * (i - 9))});
    field.instances.add(ChildRef::mesh(1), Affine());
    scene.groups.push_back(std::move(row));
    scene.groups.push_back(std::move(field));
    scene.root = 1;
    scene.path = "test";
    ThreadPool pool(2);
    buildScene(scene, pool);
    return scene;
}

TEST(Grids, nestedInstancesWithShadowsAreWhatRaysSee) {
    const Scene scene = nestedScene();
    FrameRequest r;
    r.camera = lookAt(DVec3(3, 6, 16), DVec3(0, 0.5, -6));
    r.settings.width = 200;
    r.settings.height = 120;
    r.settings.shadows = true;
    r.aovs = {"depth", "coverage"};
    const Image rays = castRays(scene, r);
    ThreadPool pool(2);
    for (const Reconstruct reconstruct : kReconstructions) {
        r.settings.reconstruct = reconstruct;
        const CompareResult result = compareImages(render(scene, r), rays, pool);
        EXPECT_GE(result.psnr, 26.0) << settingValue(r.settings, "reconstruct");
        ASSERT_TRUE(result.holes);
        // Per-pixel leaves single holes at one point a subpixel, as on any fine mesh.
        EXPECT_LE(result.holes->fraction, reconstruct == Reconstruct::kPerPixel ? 1e-3 : 0.0)
            << settingValue(r.settings, "reconstruct");
    }
}

TEST(Grids, whatIsSeenThroughThemInBinsIsWhatRaysSee) {
    UvGridParams ball, sheet;
    ball.shape = shapeOf("sphere");
    ball.displacements.push_back(ripples(0.05, 10, 5));
    sheet.shape.size = DVec2(50.0);
    sheet.displacements.push_back(ripples(4.0, 3, 3, 32));
    Scene scene;
    const uint32_t balls = addGrid(scene, ball, Vec3(0.9f, 0.5f, 0.1f));
    scene.materials[0].alpha = 0.4f;
    scene.materials[0].alpha_mode = AlphaMode::kBlend;
    const uint32_t behind = addGrid(scene, sheet, Vec3(0.1f, 0.3f, 0.8f));
    build(scene, {{balls, {DMat3(40.0), DVec3(-8.0, 4.0, 30.0)}},
                  {balls, {DMat3(30.0), DVec3(10.0, -6.0, 60.0)}},
                  {behind, {turned(0.7, 0.3), DVec3(0.0)}}});
    const FrameRequest r = request(Reconstruct::kBins);
    ThreadPool pool(2);
    EXPECT_GE(compareImages(render(scene, r), castRays(scene, r), pool).psnr, 30.0);
}

}  // namespace
}  // namespace stipple
