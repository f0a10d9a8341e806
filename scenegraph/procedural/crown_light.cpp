// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/crown_light.h>

#include <algorithm>

namespace stipple {

namespace {

// The cell that holds p (the lower corner of the eight cell centres around it) and the place
// between.
struct GridPlace {
    int cell[3];
    Vec3 fraction;
};

GridPlace placeInGrid(const Vec3& p, const Vec3& origin, float cell, const int (&size)[3]) {
    GridPlace place;
    for (int i = 0; i < 3; ++i) {
        const float x = std::clamp((p[i] - origin[i]) / cell, 0.0f, float(size[i] - 1));
        place.cell[i] = std::min(int(x), size[i] - 2);
        place.fraction[i] = x - float(place.cell[i]);
    }
    return place;
}

float cornerWeight(const GridPlace& place, int corner) {
    float w = 1.0f;
    for (int i = 0; i < 3; ++i) w *= corner >> i & 1 ? place.fraction[i] : 1.0f - place.fraction[i];
    return w;
}

}  // namespace

CrownLight::CrownLight(const std::vector<Vec3>& leaves, float leaf_area) {
    Box3 box;
    for (const Vec3& p : leaves) box.extend(p);
    if (box.isEmpty()) box.extend(Vec3(0.0f));
    const Vec3 extent = box.extent();
    cell_ = std::max(std::max({extent.x, extent.y, extent.z}) / float(kCells), 1e-4f);
    origin_ = box.min - 0.5f * cell_;
    for (int i = 0; i < 3; ++i) size_[i] = std::max(2, int(extent[i] / cell_) + 2);

    std::vector<float> density(size_t(size_[0]) * size_[1] * size_[2],
                               0.0f);  // m^2 of leaves per m^3
    const float share = leaf_area / (cell_ * cell_ * cell_);
    for (const Vec3& p : leaves) {
        const GridPlace place = placeInGrid(p, origin_, cell_, size_);
        for (int c = 0; c < 8; ++c) {
            density[index(place.cell[0] + (c & 1), place.cell[1] + (c >> 1 & 1),
                          place.cell[2] + (c >> 2))] += share * cornerWeight(place, c);
        }
    }

    light_.assign(density.size(), Vec4(0.0f));
    float total = 0.0f;
    for (int d = 0; d < 27; ++d) {
        if (d == 13) continue;
        const int step[3] = {d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1};
        const Vec3 direction = glm::normalize(Vec3(step[0], step[1], step[2]));
        const std::vector<float> depth = opticalDepth(density, step);
        const float sky = 0.5f * (1.0f + direction.y) *
                          (0.55f + 0.45f * direction.y);  // little comes from the ground
        total += sky;
        for (size_t i = 0; i < light_.size(); ++i) {
            const float through = std::exp(-depth[i]);
            light_[i] += Vec4(direction * (through * (0.35f + sky)), through * sky);
        }
    }
    for (Vec4& l : light_) l.w /= total;
}

// Optical depth from every cell to the outside along one of the 26 neighbour directions: each cell
// continues its neighbour's way, so cells are visited in the order in which light comes in.
std::vector<float> CrownLight::opticalDepth(const std::vector<float>& density,
                                            const int (&step)[3]) const {
    std::vector<float> depth(density.size(), 0.0f);
    const float length =
        cell_ * std::sqrt(float(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]));
    int begin[3], end[3], advance[3];
    for (int i = 0; i < 3; ++i) {
        const bool down = step[i] > 0;
        begin[i] = down ? size_[i] - 1 : 0;
        end[i] = down ? -1 : size_[i];
        advance[i] = down ? -1 : 1;
    }
    for (int z = begin[2]; z != end[2]; z += advance[2]) {
        for (int y = begin[1]; y != end[1]; y += advance[1]) {
            for (int x = begin[0]; x != end[0]; x += advance[0]) {
                const int n[3] = {x + step[0], y + step[1], z + step[2]};
                bool inside = true;
                for (int i = 0; i < 3; ++i) inside = inside && n[i] >= 0 && n[i] < size_[i];
                if (!inside) continue;
                const size_t neighbour = index(n[0], n[1], n[2]);
                // Leaves turned at random hide half their area.
                depth[index(x, y, z)] = depth[neighbour] + 0.5f * length * density[neighbour];
            }
        }
    }
    return depth;
}

CrownLightSample CrownLight::at(const Vec3& p) const {
    const GridPlace place = placeInGrid(p, origin_, cell_, size_);
    Vec4 sum(0.0f);
    for (int c = 0; c < 8; ++c) {
        sum += cornerWeight(place, c) *
               light_[index(place.cell[0] + (c & 1), place.cell[1] + (c >> 1 & 1),
                            place.cell[2] + (c >> 2))];
    }
    const Vec3 outward(sum);
    const float length = glm::length(outward);
    return {std::min(sum.w, 1.0f), length > 1e-4f ? outward / length : Vec3(0, 1, 0)};
}

}  // namespace stipple
