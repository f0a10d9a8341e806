// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/uv_grid.h>

namespace stipple {

namespace {

constexpr int kPoleSteps = 64;  // places around a pole of which it is the mean

}  // namespace

DisplacedSurface::DisplacedSurface(const UvGridParams& params, DVec2 footprint)
    : params_(params), info_(gridSurface(params.shape.surface)), footprint_(footprint) {
    const auto isPoint = [&](double v) { return base(0.0, v) == base(0.5, v); };
    pole_bottom_ = info_.is_closed_u && isPoint(0.0);
    pole_top_ = info_.is_closed_u && isPoint(1.0);
}

DVec3 DisplacedSurface::offset(const GridPlace& place, double u, double v) const {
    DVec3 sum(0.0);
    for (const GridDisplacement& d : params_.displacements) {
        const DVec3 metres = d.table.at(DVec2(u, 1.0 - v) * d.repeat, footprint_ * d.repeat,
                                        info_.is_closed_u || d.repeat.x != 1.0,
                                        info_.is_closed_v || d.repeat.y != 1.0);
        switch (d.along) {
            case GridDisplacement::Along::kNormal:
                sum += place.normal * metres.x;
                break;
            case GridDisplacement::Along::kSurface:
                sum += place.tangent * metres.x +
                       glm::cross(place.normal, place.tangent) * metres.y + place.normal * metres.z;
                break;
            case GridDisplacement::Along::kObject:
                sum += metres;
                break;
        }
    }
    return sum;
}

DVec3 DisplacedSurface::position(double u, double v) const {
    const GridPlace place = info_.at(params_.shape, u, v);
    if (params_.displacements.empty()) return place.position;
    if (!isPole(v)) return place.position + offset(place, u, v);
    DVec3 sum(0.0);
    for (int k = 0; k < kPoleSteps; ++k) {
        const double around = (k + 0.5) / kPoleSteps;
        sum += offset(info_.at(params_.shape, around, v), around, v);
    }
    return place.position + sum / double(kPoleSteps);
}

DVec3 DisplacedSurface::crossDifference(double u, double v, DVec3& along_u) const {
    const auto around = [](double x, double step, bool is_closed) {
        const DVec2 ends(x - step, x + step);
        return is_closed ? ends : glm::clamp(ends, 0.0, 1.0);
    };
    const DVec2 us = around(u, 0.5 * footprint_.x, info_.is_closed_u),
                vs = around(v, 0.5 * footprint_.y, info_.is_closed_v);
    along_u = position(us.y, v) - position(us.x, v);
    return glm::cross(along_u, position(u, vs.y) - position(u, vs.x));
}

DVec3 DisplacedSurface::normal(double u, double v, DVec3& tangent) const {
    const GridPlace place = info_.at(params_.shape, u, v);
    tangent = place.tangent;
    DVec3 along_u, sum(0.0);
    if (isPole(v)) {
        const double beside = v < 0.5 ? 0.5 * footprint_.y : 1.0 - 0.5 * footprint_.y;
        for (int k = 0; k < kPoleSteps; ++k)
            sum += crossDifference((k + 0.5) / kPoleSteps, beside, along_u);
    } else {
        sum = crossDifference(u, v, along_u);
        const double length = glm::length(along_u);
        if (length > 0.0) tangent = along_u / length;
    }
    const double length = glm::length(sum);
    return length > 0.0 ? sum / length : place.normal;
}

}  // namespace stipple
