// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <scenegraph/procedural/uv_grid_surface.h>

namespace stipple {

namespace {

const DVec3 kUp(0.0, 1.0, 0.0);

// A turn about y from +z towards +x: the way outwards there, and the way on.
struct Turn {
    DVec3 out, on;
    explicit Turn(double angle)
        : out(std::sin(angle), 0.0, std::cos(angle)), on(std::cos(angle), 0.0, -std::sin(angle)) {}
};

GridPlace planeAt(const GridShape& s, double u, double v) {
    return {DVec3((u - 0.5) * s.size.x, 0.0, (0.5 - v) * s.size.y), DVec3(1.0, 0.0, 0.0), kUp};
}

GridPlace frustumAt(double bottom, double top, double height, double u, double v) {
    const Turn turn(2.0 * kPi * u);
    return {turn.out * glm::mix(bottom, top, v) + kUp * ((v - 0.5) * height), turn.on,
            glm::normalize(turn.out * height + kUp * (bottom - top))};
}

GridPlace discAt(const GridShape& s, double u, double v) {
    return frustumAt(s.radius, 0.0, 0.0, u, v);
}

GridPlace cylinderAt(const GridShape& s, double u, double v) {
    return frustumAt(s.radius, s.radius, s.height, u, v);
}

GridPlace coneAt(const GridShape& s, double u, double v) {
    return frustumAt(s.radius, s.top_radius, s.height, u, v);
}

GridPlace sphereAt(const GridShape& s, double u, double v) {
    const Turn turn(2.0 * kPi * u);
    // The poles are one point exactly.
    const double ring = v > 0.0 && v < 1.0 ? std::sin(kPi * v) : 0.0;
    const DVec3 normal = turn.out * ring - kUp * std::cos(kPi * v);
    return {normal * s.radius, turn.on, normal};
}

GridPlace torusAt(const GridShape& s, double u, double v) {
    const Turn turn(2.0 * kPi * u);
    // The seam lies inside.
    const double angle = 2.0 * kPi * v - kPi;
    const DVec3 normal = turn.out * std::cos(angle) + kUp * std::sin(angle);
    return {turn.out * s.radius + normal * s.tube, turn.on, normal};
}

GridPlace paraboloidAt(const GridShape& s, double u, double v) {
    const Turn turn(2.0 * kPi * u);
    const double r = 1.0 - v;
    return {turn.out * (s.radius * r) + kUp * (s.height * (0.5 - r * r)), turn.on,
            glm::normalize(kUp * s.radius + turn.out * (2.0 * s.height * r))};
}

// Of one sheet.
GridPlace hyperboloidAt(const GridShape& s, double u, double v) {
    const Turn turn(2.0 * kPi * u);
    const double t = 2.0 * v - 1.0, growth = s.radius * s.radius - s.waist * s.waist,
                 r = std::sqrt(s.waist * s.waist + growth * t * t);
    return {turn.out * r + kUp * (0.5 * t * s.height), turn.on,
            glm::normalize(turn.out * (r * s.height) - kUp * (2.0 * t * growth))};
}

GridPlace helicoidAt(const GridShape& s, double u, double v) {
    const double angle = 2.0 * kPi * s.turns, r = s.radius * (1.0 - v);
    const Turn turn(angle * u);
    return {turn.out * r + kUp * ((u - 0.5) * s.height),
            glm::normalize(turn.on * (angle * r) + kUp * s.height),
            glm::normalize(kUp * (angle * r) - turn.on * s.height)};
}

// A band of width `height` with half a twist.
GridPlace mobiusAt(const GridShape& s, double u, double v) {
    const Turn turn(2.0 * kPi * u);
    const double c = std::cos(kPi * u), d = std::sin(kPi * u), across = (v - 0.5) * s.height;
    const DVec3 width = turn.out * c + kUp * d;
    const DVec3 along =
        turn.on * (s.radius + across * c) + (kUp * c - turn.out * d) * (0.5 * across);
    return {turn.out * s.radius + width * across, glm::normalize(along),
            glm::normalize(glm::cross(along, width))};
}

}  // namespace

const std::vector<GridSurfaceInfo>& gridSurfaces() {
    static const std::vector<GridSurfaceInfo> surfaces = {
        {"plane", planeAt, false, false, false, false, {"size"}},
        {"disc", discAt, true, false, true, false, {"radius"}},
        {"sphere", sphereAt, true, false, true, true, {"radius"}},
        {"cylinder", cylinderAt, true, false, true, false, {"radius", "height"}},
        {"cone", coneAt, true, false, true, false, {"radius", "top_radius", "height"}},
        {"torus", torusAt, true, true, true, true, {"radius", "tube"}},
        {"paraboloid", paraboloidAt, true, false, true, true, {"radius", "height"}},
        {"hyperboloid", hyperboloidAt, true, false, true, true, {"radius", "waist", "height"}},
        {"helicoid", helicoidAt, false, false, true, true, {"radius", "height", "turns"}},
        {"mobius", mobiusAt, false, false, true, true, {"radius", "height"}},
    };
    return surfaces;
}

const GridSurfaceInfo& gridSurface(const std::string& name) {
    for (const GridSurfaceInfo& info : gridSurfaces()) {
        if (info.name == name) return info;
    }
    throw Error(ErrorCode::kInvalidArgument, "", "unknown surface '" + name + "'");
}

}  // namespace stipple
