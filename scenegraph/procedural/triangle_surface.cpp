// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/triangle_surface.h>

namespace stipple {

namespace {

bool hasIndices(const Mesh& mesh, const UVec3& t) {
    const size_t n = mesh.positions.size();
    return t.x < n && t.y < n && t.z < n;
}

}  // namespace

TriangleSurface::TriangleSurface(std::vector<SurfacePart> parts) : parts_(std::move(parts)) {
    double sum = 0.0;
    for (const SurfacePart& part : parts_) {
        first_.push_back(cumulative_area_.size());
        for (const UVec3& t : part.mesh->triangles) {
            if (hasIndices(*part.mesh, t)) {
                DVec3 corner[3];
                for (int c = 0; c < 3; ++c)
                    corner[c] = part.group_from_mesh.point(DVec3(part.mesh->positions[t[c]]));
                const double area =
                    0.5 * glm::length(glm::cross(corner[1] - corner[0], corner[2] - corner[0]));
                if (area > 0.0 && std::isfinite(area)) {
                    sum += area;
                    for (const DVec3& p : corner) bounds_.extend(p);
                }
            }
            cumulative_area_.push_back(sum);
        }
    }
}

TriangleSurface::Place TriangleSurface::at(double t, double u, double v) const {
    // The first triangle whose cumulated area exceeds the target; those without an area never do.
    const double target = std::min(t * area(), std::nextafter(area(), 0.0));
    const uint64_t global =
        uint64_t(std::upper_bound(cumulative_area_.begin(), cumulative_area_.end(), target) -
                 cumulative_area_.begin());
    const size_t part =
        size_t(std::upper_bound(first_.begin(), first_.end(), global) - first_.begin()) - 1;
    const Mesh& mesh = *parts_[part].mesh;
    const Affine& group_from_mesh = parts_[part].group_from_mesh;
    const UVec3& triangle = mesh.triangles[global - first_[part]];
    // Evenly over the triangle: the half of the parallelogram beyond its diagonal is folded back.
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    const double w = 1.0 - u - v;
    const DVec3 a(mesh.positions[triangle.x]), b(mesh.positions[triangle.y]),
        c(mesh.positions[triangle.z]);
    const DVec3 flat = glm::cross(b - a, c - a);
    DVec3 normal = flat;
    if (!mesh.normals.empty()) {
        const DVec3 smooth = w * DVec3(mesh.normals[triangle.x]) +
                             u * DVec3(mesh.normals[triangle.y]) +
                             v * DVec3(mesh.normals[triangle.z]);
        if (glm::dot(smooth, smooth) > 1e-12) normal = smooth;
    }
    // Area vectors go with the cofactors, which turn them inside out where the map mirrors.
    const double side = glm::determinant(group_from_mesh.linear) < 0.0 ? -1.0 : 1.0;
    normal = cofactor(group_from_mesh.linear) * normal * side;
    return {group_from_mesh.point(w * a + u * b + v * c), Vec3(glm::normalize(normal))};
}

}  // namespace stipple
