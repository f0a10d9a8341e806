// SPDX-License-Identifier: Apache-2.0
// All filters of the metric are sums of separable ones, so pictures are worked on in strips of rows
// with a halo above and below.
#include <render/flip.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace stipple {

namespace {

constexpr int kStripRows = 64;
constexpr float kColorExponent = 0.7f;    // q_c
constexpr float kColorKnee = 0.4f;        // p_c: this share of the largest colour error ...
constexpr float kColorKneeError = 0.95f;  // p_t: ... is mapped to this error
constexpr float kFeatureExponent = 0.5f;  // q_f
constexpr float kFeatureWidth =
    0.082f;  // w: degrees, width of the edges and points that are looked for

// a * sqrt(pi / b) * exp(-(pi d)^2 / b) at d degrees: a term of a contrast sensitivity function.
struct SensitivityTerm {
    double a, b;
};
constexpr SensitivityTerm kLuminance{1.0, 0.0047}, kRedGreen{1.0, 0.0053};
constexpr SensitivityTerm kBlueYellow[2] = {{34.1, 0.04}, {13.5, 0.025}};

using Kernel = std::vector<float>;  // odd length, centred

struct Kernels {
    Kernel luminance, red_green;
    std::array<Kernel, 2> blue_yellow;
    std::array<float, 2> blue_yellow_weight;  // of the two terms; they add up to 1
    Kernel smooth, edge, point;               // Gaussian, its first and second derivative
    int halo = 0;                             // largest radius
};

Kernel gaussian(double sigma, int radius, double* sum = nullptr) {
    std::vector<double> g(2 * radius + 1);
    double total = 0.0;
    for (int i = -radius; i <= radius; ++i)
        total += g[i + radius] = std::exp(-0.5 * i * i / (sigma * sigma));
    Kernel k(g.size());
    for (size_t i = 0; i < g.size(); ++i) k[i] = float(g[i] / total);
    if (sum) *sum = total;
    return k;
}

// Scales positive and negative weights so that each add up to 1 in size.
Kernel balanced(const std::vector<double>& g) {
    double positive = 0.0, negative = 0.0;
    for (double v : g) (v > 0.0 ? positive : negative) += std::abs(v);
    Kernel k(g.size());
    for (size_t i = 0; i < g.size(); ++i)
        k[i] = float(g[i] / (g[i] > 0.0 ? positive : std::max(negative, 1e-30)));
    return k;
}

Kernels makeKernels(double pixels_per_degree) {
    const auto sigma = [&](const SensitivityTerm& t) {
        return std::sqrt(t.b / 2.0) / kPi * pixels_per_degree;
    };
    const int radius = int(std::ceil(3.0 * sigma(kBlueYellow[0])));
    Kernels k;
    k.luminance = gaussian(sigma(kLuminance), radius);
    k.red_green = gaussian(sigma(kRedGreen), radius);
    double weights[2];
    for (int i = 0; i < 2; ++i) {
        double sum;
        k.blue_yellow[i] = gaussian(sigma(kBlueYellow[i]), radius, &sum);
        weights[i] = kBlueYellow[i].a * std::sqrt(kPi / kBlueYellow[i].b) * sum * sum;
    }
    for (int i = 0; i < 2; ++i)
        k.blue_yellow_weight[i] = float(weights[i] / (weights[0] + weights[1]));

    const double feature_sigma = 0.5 * kFeatureWidth * pixels_per_degree;
    const int feature_radius = int(std::ceil(3.0 * feature_sigma));
    k.smooth = gaussian(feature_sigma, feature_radius);
    std::vector<double> first, second;
    for (int i = -feature_radius; i <= feature_radius; ++i) {
        const double g = std::exp(-0.5 * i * i / (feature_sigma * feature_sigma));
        first.push_back(-i * g);
        second.push_back((i * i / (feature_sigma * feature_sigma) - 1.0) * g);
    }
    k.edge = balanced(first);
    k.point = balanced(second);
    k.halo = std::max(radius, feature_radius);
    return k;
}

// CIE XYZ of linear sRGB, relative to the XYZ of white.
Vec3 xyzFromRgb(const Vec3& c) {
    return Vec3((0.4124564f * c.x + 0.3575761f * c.y + 0.1804375f * c.z) / 0.950470f,
                (0.2126729f * c.x + 0.7151522f * c.y + 0.0721750f * c.z),
                (0.0193339f * c.x + 0.1191920f * c.y + 0.9503041f * c.z) / 1.088830f);
}
Vec3 rgbFromXyz(const Vec3& relative) {
    const Vec3 c(relative.x * 0.950470f, relative.y, relative.z * 1.088830f);
    return Vec3(3.2404542f * c.x - 1.5371385f * c.y - 0.4985314f * c.z,
                -0.9692660f * c.x + 1.8760108f * c.y + 0.0415560f * c.z,
                0.0556434f * c.x - 0.2040259f * c.y + 1.0572252f * c.z);
}

// The linearized opponent space in which the filters work.
Vec3 opponentFromXyz(const Vec3& c) {
    return Vec3(116.0f * c.y - 16.0f, 500.0f * (c.x - c.y), 200.0f * (c.y - c.z));
}
Vec3 xyzFromOpponent(const Vec3& c) {
    const float y = (c.x + 16.0f) / 116.0f;
    return Vec3(y + c.y / 500.0f, y, y - c.z / 200.0f);
}

float labCurve(float t) {
    constexpr float kDelta = 6.0f / 29.0f;
    return t > kDelta * kDelta * kDelta ? std::cbrt(t)
                                        : t / (3.0f * kDelta * kDelta) + 4.0f / 29.0f;
}

// L*a*b* with Hunt's adjustment: colours are less colourful where it is dark.
Vec3 huntLabFromXyz(const Vec3& c) {
    const float x = labCurve(c.x), y = labCurve(c.y), z = labCurve(c.z);
    const float lightness = 116.0f * y - 16.0f;
    return Vec3(lightness, 0.01f * lightness * 500.0f * (x - y),
                0.01f * lightness * 200.0f * (y - z));
}

// HyAB distance, raised to q_c.
float colorDistance(const Vec3& a, const Vec3& b) {
    const Vec3 d = a - b;
    return std::pow(std::abs(d.x) + std::sqrt(d.y * d.y + d.z * d.z), kColorExponent);
}

// Rows of floats: a strip with or without its halo.
struct Plane {
    int width, rows;
    std::vector<float> data;
    Plane(int w, int h) : width(w), rows(h), data(size_t(w) * h) {}
    float* row(int y) { return data.data() + size_t(y) * width; }
    const float* row(int y) const { return data.data() + size_t(y) * width; }
};

// Correlates every row with the kernel; outside, the border pixel is repeated.
Plane filterRows(const Plane& in, const Kernel& kernel) {
    const int radius = int(kernel.size()) / 2;
    Plane out(in.width, in.rows);
    std::vector<float> padded(in.width + 2 * radius);
    for (int y = 0; y < in.rows; ++y) {
        const float* row = in.row(y);
        std::fill_n(padded.begin(), radius, row[0]);
        std::copy_n(row, in.width, padded.begin() + radius);
        std::fill_n(padded.end() - radius, radius, row[in.width - 1]);
        float* result = out.row(y);
        for (size_t k = 0; k < kernel.size(); ++k) {
            const float* source = padded.data() + k;
            for (int x = 0; x < in.width; ++x) result[x] += kernel[k] * source[x];
        }
    }
    return out;
}

// Correlates columns; the halo is used up.
Plane filterColumns(const Plane& in, const Kernel& kernel, int halo) {
    const int radius = int(kernel.size()) / 2;
    Plane out(in.width, in.rows - 2 * halo);
    for (int y = 0; y < out.rows; ++y) {
        float* result = out.row(y);
        for (size_t k = 0; k < kernel.size(); ++k) {
            const float* source = in.row(y + halo - radius + int(k));
            for (int x = 0; x < in.width; ++x) result[x] += kernel[k] * source[x];
        }
    }
    return out;
}

// What the metric compares of one picture's strip.
struct StripFeatures {
    std::vector<Vec3> color;         // Hunt-adjusted L*a*b* of what the eye resolves
    std::vector<float> edge, point;  // sizes of first and second derivatives
};

std::vector<float> lengths(const Plane& x, const Plane& y) {
    std::vector<float> r(x.data.size());
    for (size_t i = 0; i < r.size(); ++i)
        r[i] = std::sqrt(x.data[i] * x.data[i] + y.data[i] * y.data[i]);
    return r;
}

StripFeatures stripFeatures(const Image& image, int first_row, int n_rows, const Kernels& k) {
    std::array<Plane, 3> opponent{Plane(image.width, n_rows + 2 * k.halo),
                                  Plane(image.width, n_rows + 2 * k.halo),
                                  Plane(image.width, n_rows + 2 * k.halo)};
    Plane gray(image.width, n_rows + 2 * k.halo);
    for (int y = 0; y < gray.rows; ++y) {
        const float* p = image.pixel(0, std::clamp(first_row + y - k.halo, 0, image.height - 1));
        for (int x = 0; x < image.width; ++x, p += 3) {
            const Vec3 xyz = xyzFromRgb(Vec3(p[0], p[1], p[2]));
            const Vec3 c = opponentFromXyz(xyz);
            for (int i = 0; i < 3; ++i) opponent[i].row(y)[x] = c[i];
            gray.row(y)[x] = xyz.y;
        }
    }
    StripFeatures out;
    {
        const auto filtered = [&](const Plane& p, const Kernel& kernel) {
            return filterColumns(filterRows(p, kernel), kernel, k.halo);
        };
        const Plane a = filtered(opponent[0], k.luminance), rg = filtered(opponent[1], k.red_green);
        const Plane by0 = filtered(opponent[2], k.blue_yellow[0]),
                    by1 = filtered(opponent[2], k.blue_yellow[1]);
        out.color.resize(a.data.size());
        for (size_t i = 0; i < out.color.size(); ++i) {
            const Vec3 c(
                a.data[i], rg.data[i],
                k.blue_yellow_weight[0] * by0.data[i] + k.blue_yellow_weight[1] * by1.data[i]);
            const Vec3 rgb = glm::clamp(rgbFromXyz(xyzFromOpponent(c)), Vec3(0.0f), Vec3(1.0f));
            out.color[i] = huntLabFromXyz(xyzFromRgb(rgb));
        }
    }
    const Plane smooth_rows = filterRows(gray, k.smooth);
    out.edge = lengths(filterColumns(filterRows(gray, k.edge), k.smooth, k.halo),
                       filterColumns(smooth_rows, k.edge, k.halo));
    out.point = lengths(filterColumns(filterRows(gray, k.point), k.smooth, k.halo),
                        filterColumns(smooth_rows, k.point, k.halo));
    return out;
}

}  // namespace

std::vector<float> flipMap(const Image& a, const Image& b, float pixels_per_degree,
                           ThreadPool& pool) {
    const Kernels kernels = makeKernels(pixels_per_degree);
    const float largest = colorDistance(huntLabFromXyz(xyzFromRgb(Vec3(0, 1, 0))),
                                        huntLabFromXyz(xyzFromRgb(Vec3(0, 0, 1))));
    const float knee = kColorKnee * largest;

    std::vector<float> error(size_t(a.width) * a.height);
    pool.forEach(size_t((a.height + kStripRows - 1) / kStripRows), [&](size_t strip, int) {
        const int first_row = int(strip) * kStripRows,
                  n_rows = std::min(kStripRows, a.height - first_row);
        const StripFeatures fa = stripFeatures(a, first_row, n_rows, kernels);
        const StripFeatures fb = stripFeatures(b, first_row, n_rows, kernels);
        float* out = error.data() + size_t(first_row) * a.width;
        for (size_t i = 0; i < fa.color.size(); ++i) {
            const float distance = colorDistance(fa.color[i], fb.color[i]);
            const float color = distance < knee
                                    ? kColorKneeError * distance / knee
                                    : kColorKneeError + (distance - knee) / (largest - knee) *
                                                            (1.0f - kColorKneeError);
            const float change =
                std::max(std::abs(fa.edge[i] - fb.edge[i]), std::abs(fa.point[i] - fb.point[i]));
            const float feature = std::pow(change * std::sqrt(0.5f), kFeatureExponent);
            out[i] = std::pow(std::min(color, 1.0f), 1.0f - std::min(feature, 1.0f));
        }
    });
    return error;
}

}  // namespace stipple
