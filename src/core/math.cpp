// SPDX-License-Identifier: Apache-2.0
#include <core/math.h>

namespace stipple {

namespace {

bool isSimilarity(const DMat3& m) {
    const double a = glm::dot(m[0], m[0]), b = glm::dot(m[1], m[1]), c = glm::dot(m[2], m[2]);
    const double tolerance = 1e-6 * (a + b + c);
    return std::abs(a - b) < tolerance && std::abs(b - c) < tolerance &&
           std::abs(glm::dot(m[0], m[1])) < tolerance &&
           std::abs(glm::dot(m[0], m[2])) < tolerance && std::abs(glm::dot(m[1], m[2])) < tolerance;
}

double frobenius(const DMat3& m) {
    return std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
}

}  // namespace

double maxAreaScale(const DMat3& m) {
    // The cofactor matrix has the pairwise products of the singular values as its singular values;
    // its Frobenius norm bounds the largest.
    const double similarity =
        std::max({glm::dot(m[0], m[0]), glm::dot(m[1], m[1]), glm::dot(m[2], m[2])});
    return isSimilarity(m) ? similarity * (1 + 3e-6) : frobenius(cofactor(m));
}

double maxLengthScale(const DMat3& m) {
    const double similarity =
        std::sqrt(std::max({glm::dot(m[0], m[0]), glm::dot(m[1], m[1]), glm::dot(m[2], m[2])}));
    return isSimilarity(m) ? similarity * (1 + 3e-6) : frobenius(m);
}

}  // namespace stipple
