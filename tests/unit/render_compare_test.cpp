// SPDX-License-Identifier: Apache-2.0
// The measures: closed forms, and FLIP against its formulas written out with two-dimensional
// filters.
#include <render/compare.h>

#include <core/rng.h>
#include <render/flip.h>

#include <gtest/gtest.h>

#include <array>
#include <functional>

namespace stipple {
namespace {

Image constant(int width, int height, const Vec3& color) {
    Image image(width, height, {"R", "G", "B"});
    for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = color[int(i % 3)];
    return image;
}

Image noise(int width, int height, uint64_t seed) {
    Image image(width, height, {"R", "G", "B"});
    Rng rng{seed};
    for (float& v : image.data) v = float(rng.uniform());
    return image;
}

Image blend(const Image& a, const Image& b, float t) {
    Image r = a;
    for (size_t i = 0; i < r.data.size(); ++i) r.data[i] += t * (b.data[i] - a.data[i]);
    return r;
}

TEST(RenderCompare, equalPicturesDoNotDiffer) {
    ThreadPool pool(2);
    const Image a = noise(70, 40, 1);
    const CompareResult r = compareImages(a, a, pool);
    EXPECT_EQ(r.pixels, 2800u);
    EXPECT_EQ(r.rmse, 0.0);
    EXPECT_TRUE(std::isinf(r.psnr));
    EXPECT_EQ(r.flip, 0.0);
    EXPECT_FALSE(r.holes.has_value());
}

TEST(RenderCompare, psnrIsOfClippedSrgbValues) {
    ThreadPool pool(1);
    const Image a = constant(8, 8, Vec3(linearFromSrgb(0.5f), 0.0f, -2.0f));
    const Image b = constant(8, 8, Vec3(linearFromSrgb(0.6f), 0.0f, 0.0f));
    const double rmse = std::sqrt(0.01 / 3.0);
    EXPECT_NEAR(compareImages(a, b, pool).rmse, rmse, 1e-6);
    EXPECT_NEAR(compareImages(a, b, pool).psnr, -20.0 * std::log10(rmse), 1e-4);
    // What is brighter than white is white.
    EXPECT_EQ(compareImages(constant(4, 4, Vec3(9.0f)), constant(4, 4, Vec3(1.0f)), pool).rmse,
              0.0);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(compareImages(constant(4, 4, Vec3(nan)), constant(4, 4, Vec3(1.0f)), pool).rmse, 1.0);
}

TEST(RenderCompare, onlyColourCountsWhateverElseThereIs) {
    ThreadPool pool(1);
    Image a(2, 2, {"depth", "B", "G", "R", "A"});
    for (int i = 0; i < 4; ++i) {
        const float p[5] = {1e9f, 0.3f, 0.2f, 0.1f, 0.5f};
        std::copy_n(p, 5, a.pixel(i % 2, i / 2));
    }
    EXPECT_EQ(compareImages(a, constant(2, 2, Vec3(0.1f, 0.2f, 0.3f)), pool).rmse, 0.0);
    Image gray(2, 2, {"Y"});
    std::fill(gray.data.begin(), gray.data.end(), 0.25f);
    EXPECT_EQ(compareImages(gray, constant(2, 2, Vec3(0.25f)), pool).rmse, 0.0);
}

TEST(RenderCompare, differentSizesCannotBeCompared) {
    ThreadPool pool(1);
    const auto code = [&](const Image& a, const Image& b) {
        try {
            compareImages(a, b, pool);
        } catch (const Error& e) {
            return e.code();
        }
        return ErrorCode::kInternal;
    };
    EXPECT_EQ(code(constant(4, 4, Vec3(0)), constant(4, 5, Vec3(0))), ErrorCode::kInvalidArgument);
    EXPECT_EQ(code(Image(), Image()), ErrorCode::kInvalidArgument);
}

// The pictures of the hole tests: 5x1 pixels, surface at depth 10 everywhere.
Image withDepth(const char* depth_name, int width) {
    Image image(width, 1, {"R", "G", "B", "coverage", depth_name});
    for (int x = 0; x < width; ++x) image.pixel(x, 0)[3] = 1.0f, image.pixel(x, 0)[4] = 10.0f;
    return image;
}

TEST(RenderCompare, holesAreWhereTheReferenceIsSolidAndThePictureIsNot) {
    ThreadPool pool(1);
    Image a = withDepth("depth", 10), b = withDepth("depth_max", 10);
    EXPECT_EQ(compareImages(a, b, pool).holes->count, 0u);

    a.pixel(0, 0)[3] = 0.4f;                             // too little surface
    a.pixel(2, 0)[4] = 10.3f;                            // one that lies behind
    a.pixel(4, 0)[4] = 10.1f;                            // within the slack
    a.pixel(6, 0)[4] = 14.0f, b.pixel(7, 0)[4] = 14.0f;  // the neighbour's depth
    a.pixel(9, 0)[3] = 0.0f, b.pixel(9, 0)[3] = 0.9f;    // the reference sees background there too
    const CompareResult r = compareImages(a, b, pool);
    ASSERT_TRUE(r.holes.has_value());
    EXPECT_EQ(r.holes->count, 2u);
    EXPECT_DOUBLE_EQ(r.holes->fraction, 0.2);
}

TEST(RenderCompare, backgroundBesideASilhouetteHidesNoHole) {
    ThreadPool pool(1);
    Image a = withDepth("depth", 2), b = withDepth("depth_max", 2);
    a.pixel(0, 0)[4] = 50.0f;
    b.pixel(1, 0)[3] = 0.0f, b.pixel(1, 0)[4] = kInfinity;
    EXPECT_EQ(compareImages(a, b, pool).holes->count, 1u);
    a.pixel(0, 0)[4] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(compareImages(a, b, pool).holes->count, 1u);
}

TEST(RenderCompare, flipOfBlackAndWhiteIsNearlyOne) {
    ThreadPool pool(1);
    const double flip =
        compareImages(constant(40, 40, Vec3(0)), constant(40, 40, Vec3(1)), pool).flip;
    EXPECT_GT(flip, 0.95);
    EXPECT_LE(flip, 1.0);
    // The largest colour difference of all.
    EXPECT_NEAR(
        compareImages(constant(40, 40, Vec3(0, 1, 0)), constant(40, 40, Vec3(0, 0, 1)), pool).flip,
        1.0, 1e-4);
}

TEST(RenderCompare, flipGrowsWithTheErrorAndIsSymmetric) {
    ThreadPool pool(2);
    const Image a = blend(noise(64, 64, 1), constant(64, 64, Vec3(0.5f)), 0.8f),
                b = noise(64, 64, 2);
    double last = 0.0;
    for (float t : {0.02f, 0.1f, 0.3f, 0.6f, 1.0f}) {
        const double flip = compareImages(blend(a, b, t), a, pool).flip;
        EXPECT_GT(flip, last);
        EXPECT_EQ(flip, compareImages(a, blend(a, b, t), pool).flip);
        last = flip;
    }
}

// FLIP with its filters as they stand in the paper: two-dimensional, normalized as a whole.
class FlipByDefinition {
public:
    FlipByDefinition(const Image& a, const Image& b, double ppd) : a_(a), b_(b), ppd_(ppd) {}

    double errorAt(int x, int y) const {
        const double largest = std::pow(hyab(lab(toXyz({0, 1, 0})), lab(toXyz({0, 0, 1}))), 0.7);
        const double e = std::pow(hyab(seen(a_, x, y), seen(b_, x, y)), 0.7), knee = 0.4 * largest;
        const double color =
            e < knee ? 0.95 * e / knee : 0.95 + 0.05 * (e - knee) / (largest - knee);
        const double edge = std::abs(feature(a_, x, y, 1) - feature(b_, x, y, 1));
        const double point = std::abs(feature(a_, x, y, 2) - feature(b_, x, y, 2));
        return std::pow(color, 1.0 - std::sqrt(std::max(edge, point) / std::sqrt(2.0)));
    }

private:
    using V = DVec3;
    static V toXyz(V c) {
        const DMat3 m(0.4124564, 0.2126729, 0.0193339, 0.3575761, 0.7151522, 0.1191920, 0.1804375,
                      0.0721750, 0.9503041);
        return (m * c) / (m * V(1.0));
    }
    static V toRgb(V relative) {
        const DMat3 m(0.4124564, 0.2126729, 0.0193339, 0.3575761, 0.7151522, 0.1191920, 0.1804375,
                      0.0721750, 0.9503041);
        return glm::clamp(glm::inverse(m) * (relative * (m * V(1.0))), V(0.0), V(1.0));
    }
    static V lab(V xyz) {
        const auto f = [](double t) {
            return t > std::pow(6.0 / 29.0, 3) ? std::cbrt(t) : t * 841.0 / 108.0 + 4.0 / 29.0;
        };
        const double l = 116 * f(xyz.y) - 16;
        return V(l, 0.01 * l * 500 * (f(xyz.x) - f(xyz.y)), 0.01 * l * 200 * (f(xyz.y) - f(xyz.z)));
    }
    static double hyab(V p, V q) { return std::abs(p.x - q.x) + std::hypot(p.y - q.y, p.z - q.z); }
    static V pixel(const Image& i, int x, int y) {
        const float* p = i.pixel(std::clamp(x, 0, i.width - 1), std::clamp(y, 0, i.height - 1));
        return toXyz(V(p[0], p[1], p[2]));
    }

    V seen(const Image& image, int x, int y) const {
        const int r = int(std::ceil(3 * std::sqrt(0.04 / (2 * kPi * kPi)) * ppd_));
        const auto term = [](double a, double b, double d2) {
            return a * std::sqrt(kPi / b) * std::exp(-kPi * kPi * d2 / b);
        };
        V sum(0.0), weights(0.0);
        for (int j = -r; j <= r; ++j) {
            for (int i = -r; i <= r; ++i) {
                const double d2 = (i * i + j * j) / (ppd_ * ppd_);
                const V w(term(1, 0.0047, d2), term(1, 0.0053, d2),
                          term(34.1, 0.04, d2) + term(13.5, 0.025, d2));
                const V c = pixel(image, x + i, y + j);
                sum += w * V(116 * c.y - 16, 500 * (c.x - c.y), 200 * (c.y - c.z));
                weights += w;
            }
        }
        const V c = sum / weights;
        const double luminance = (c.x + 16) / 116;
        return lab(toXyz(toRgb(V(luminance + c.y / 500, luminance, luminance - c.z / 200))));
    }

    double feature(const Image& image, int x, int y, int order) const {
        const double s = 0.5 * 0.082 * ppd_;
        const int r = int(std::ceil(3 * s));
        const auto weight = [&](int i, int j) {
            const double g = std::exp(-(i * i + j * j) / (2 * s * s));
            return order == 1 ? -i * g : (i * i / (s * s) - 1) * g;
        };
        double positive = 0, negative = 0;
        for (int j = -r; j <= r; ++j) {
            for (int i = -r; i <= r; ++i)
                (weight(i, j) > 0 ? positive : negative) += std::abs(weight(i, j));
        }
        double along_x = 0, along_y = 0;
        for (int j = -r; j <= r; ++j) {
            for (int i = -r; i <= r; ++i) {
                const double w = weight(i, j) / (weight(i, j) > 0 ? positive : negative);
                along_x += w * pixel(image, x + i, y + j).y;
                along_y += w * pixel(image, x + j, y + i).y;
            }
        }
        return std::hypot(along_x, along_y);
    }

    const Image &a_, &b_;
    double ppd_;
};

TEST(RenderCompare, flipAgreesWithItsDefinition) {
    ThreadPool pool(2);
    Image a = blend(noise(50, 140, 3), constant(50, 140, Vec3(0.2f, 0.5f, 0.3f)), 0.7f);
    Image b = blend(a, noise(50, 140, 4), 0.25f);
    for (int y = 60; y < 70; ++y) {  // an edge, across the border of two strips
        for (int x = 10; x < 30; ++x) a.pixel(x, y)[0] = 1.0f, b.pixel(x, y)[2] = 0.0f;
    }
    const std::vector<float> map = flipMap(a, b, 67.0f, pool);
    const FlipByDefinition definition(a, b, 67.0);
    for (const auto& [x, y] : std::vector<std::array<int, 2>>{
             {0, 0}, {49, 139}, {25, 63}, {25, 64}, {10, 66}, {31, 3}, {49, 70}}) {
        EXPECT_NEAR(map[size_t(y) * 50 + x], definition.errorAt(x, y), 1e-4) << x << "," << y;
    }
}

TEST(RenderCompare, resultsDoNotDependOnTheNumberOfThreads) {
    ThreadPool one(1), three(3);
    const Image a = noise(150, 200, 1), b = noise(150, 200, 2);
    const CompareResult x = compareImages(a, b, one), y = compareImages(a, b, three);
    EXPECT_EQ(x.rmse, y.rmse);
    EXPECT_EQ(x.flip, y.flip);
}

TEST(RenderCompare, differencePictureShowsErrorsAndHoles) {
    ThreadPool pool(1);
    Image a = withDepth("depth", 60), b = withDepth("depth_max", 60);
    for (int x = 40; x < 60; ++x) {
        for (int c = 0; c < 3; ++c) a.pixel(x, 0)[c] = 1.0f;
    }
    a.pixel(3, 0)[3] = 0.0f;
    const Image d = differenceImage(a, b, pool);
    EXPECT_EQ(d.pixel(8, 0)[0], 0.0f);
    EXPECT_EQ(d.pixel(3, 0)[0], 0.0f);
    EXPECT_EQ(d.pixel(3, 0)[2], 1.0f);
    EXPECT_EQ(d.pixel(55, 0)[0], 1.0f);
}

TEST(RenderCompare, tileMeansAreRelativeToBrightTiles) {
    Image b = constant(64, 40, Vec3(0.5f));  // four tiles, the lower two cut off
    for (int y = 0; y < 32; ++y) {
        for (int x = 0; x < 32; ++x) std::fill_n(b.pixel(x, y), 3, 0.01f);  // too dark
    }
    Image a = b;
    for (int y = 0; y < 32; ++y) {
        for (int x = 32; x < 64; ++x) std::fill_n(a.pixel(x, y), 3, 0.6f);
    }
    a.pixel(0, 0)[0] = 100.0f;
    const TileMeans t = tileMeans(a, b);
    EXPECT_EQ(t.tiles, 3u);
    EXPECT_NEAR(t.max, 0.2, 1e-6);
    EXPECT_NEAR(t.mean, 0.2 / 3.0, 1e-6);
    EXPECT_NEAR(t.rms, 0.2 / std::sqrt(3.0), 1e-6);
    EXPECT_EQ(tileMeans(constant(8, 8, Vec3(0)), constant(8, 8, Vec3(0))).tiles, 0u);
}

}  // namespace
}  // namespace stipple
