// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/splat_bend.h>

#include <Eigen/Cholesky>

namespace stipple {

void bendNormals(const SplatPoints& points, const std::vector<uint32_t>& covered, Splat& splat) {
    constexpr size_t kFewest = 6;
    if (covered.size() < kFewest || !(splat.long_radius > 0.0f)) return;
    const Vec3 across = splat.across();
    // The normal is (u, v, 1) with u = c + xx a + xy b, v = d + xy a + yy b: as of a quadric, whose
    // second derivatives are symmetric. Least squares of c, d, xx, yy, xy; a and b in half axes.
    using Vector5 = Eigen::Matrix<double, 5, 1>;
    Eigen::Matrix<double, 5, 5> sums = Eigen::Matrix<double, 5, 5>::Zero();
    Vector5 right = Vector5::Zero();
    const double scale = 1.0 / double(splat.long_radius);
    for (const uint32_t i : covered) {
        const SplatPoint& p = points[i];
        const Vec3 d = p.position - splat.center;
        const double a = double(glm::dot(d, splat.along)) * scale,
                     b = double(glm::dot(d, across)) * scale;
        const Vec3& normal = p.shading_normal != Vec3(0) ? p.shading_normal : p.normal;
        const double facing = double(glm::dot(normal, splat.normal));
        constexpr double kLeastFacing = 0.3;
        if (facing < kLeastFacing) continue;
        Vector5 u, v;
        u << 1.0, 0.0, a, 0.0, b;
        v << 0.0, 1.0, 0.0, b, a;
        sums += u * u.transpose() + v * v.transpose();
        const double to_u = double(glm::dot(normal, splat.along)) / facing,
                     to_v = double(glm::dot(normal, across)) / facing;
        right += u * to_u + v * to_v;
    }
    // What few points in a row do not say stays flat.
    constexpr double kStiffness = 0.01;
    sums.diagonal().array() += kStiffness * double(covered.size());
    const Vector5 fit = sums.ldlt().solve(right);
    if (!fit.allFinite() || fit.array().abs().maxCoeff() > 2.0) return;
    splat.shading_normal =
        glm::normalize(splat.normal + splat.along * float(fit[0]) + across * float(fit[1]));
    splat.bend = Vec3(float(fit[2]), float(fit[3]), float(fit[4])) / splat.long_radius;
}

}  // namespace stipple
