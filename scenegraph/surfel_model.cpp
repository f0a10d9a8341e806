// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/surfel_model.h>

#include <core/error.h>
#include <core/image.h>
#include <core/octahedral.h>
#include <scenegraph/disc_planes.h>
#include <scenegraph/morton.h>
#include <scenegraph/visible_area.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr int kPerDirection = kMaskDirections / kDirections;

// Corners of the spherical triangle of a direction of visible_area.h.
std::array<Vec3, 3> triangleOf(int index) {
    Vec3 axis[3] = {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
    for (int a = 0; a < 3; ++a) {
        if (index >> (2 + a) & 1) axis[a] = -axis[a];
    }
    const auto middle = [](const Vec3& a, const Vec3& b) { return glm::normalize(a + b); };
    const Vec3 xy = middle(axis[0], axis[1]), yz = middle(axis[1], axis[2]),
               zx = middle(axis[2], axis[0]);
    switch (index % 4) {
        case 0:
            return {axis[0], xy, zx};
        case 1:
            return {axis[1], yz, xy};
        case 2:
            return {axis[2], zx, yz};
        default:
            return {xy, yz, zx};
    }
}

struct MaskTable {
    std::array<Vec3, kMaskDirections> middles;
    MaskTable() {
        for (int d = 0; d < kDirections; ++d) {
            const std::array<Vec3, 3> t = triangleOf(d);
            const Vec3 ab = glm::normalize(t[0] + t[1]), bc = glm::normalize(t[1] + t[2]),
                       ca = glm::normalize(t[2] + t[0]);
            const Vec3 parts[kPerDirection] = {
                glm::normalize(t[0] + ab + ca), glm::normalize(t[1] + bc + ab),
                glm::normalize(t[2] + ca + bc), glm::normalize(ab + bc + ca)};
            for (int k = 0; k < kPerDirection; ++k)
                middles[size_t(d * kPerDirection + k)] = parts[k];
        }
    }
};

const MaskTable& maskTable() {
    static const MaskTable table;
    return table;
}

}  // namespace

uint8_t surfelRadiusCode(float share) {
    const float code = 128.0f + 8.0f * std::log2(std::max(share, 1e-6f));
    return uint8_t(std::clamp(std::ceil(code), 1.0f, 255.0f));  // never smaller than asked for
}

namespace {

// By how much a shape's radius is less than its code's, 256ths of an octave.
uint8_t shapeLess(float share) {
    const float octaves = (float(surfelRadiusCode(share)) - 128.0f) * 0.125f;
    const float less = 256.0f * (octaves - std::log2(std::max(share, 1e-6f)));
    return uint8_t(std::clamp(std::floor(less), 0.0f, 31.0f));
}

}  // namespace

float keptShapeRadius(float share) {
    return surfelRadius(surfelRadiusCode(share)) * std::exp2(-float(shapeLess(share)) / 256.0f);
}

float quantizedRatio(float ratio) {
    return std::clamp(std::round(ratio * 255.0f), 1.0f, 255.0f) / 255.0f;
}

Vec3 maskDirectionOf(int index) { return maskTable().middles[size_t(index)]; }

int maskDirectionIndex(const Vec3& direction) {
    const int first = directionIndex(direction) * kPerDirection;
    int best = first;
    float most = -kInfinity;
    for (int i = first; i < first + kPerDirection; ++i) {
        const float dot = glm::dot(direction, maskTable().middles[size_t(i)]);
        if (dot > most) most = dot, best = i;
    }
    return best;
}

uint16_t packNormal16(const Vec3& n) {
    const Vec2 p = octahedralOf(n);
    const auto q = [](float v) { return uint16_t(std::lround((v * 0.5f + 0.5f) * 255.0f)); };
    return uint16_t(q(p.x) | q(p.y) << 8);
}

Vec3 unpackNormal16(uint16_t packed) {
    constexpr float kStep = 2.0f / 255.0f;
    return octahedralNormal(float(packed & 255) * kStep - 1.0f, float(packed >> 8) * kStep - 1.0f);
}

size_t SurfelModel::bytes() const {
    size_t sum = sizeof(SurfelModel) + finishes.size() * sizeof(SurfelFinish);
    for (const SurfelLevel& level : levels) {
        sum += level.blocks.size() * (sizeof(SurfelBlock) + 4 * sizeof(float)) +
               level.radius.size() + level.size() * (2 * sizeof(uint32_t) + sizeof(uint16_t)) +
               level.shapes.size() * sizeof(SurfelShape) + level.cuts.size() * sizeof(SurfelCut) +
               level.bends.size() * sizeof(SurfelBend);
    }
    return sum;
}

namespace {

// The visibility cone of points with these normals (PSR, section 6.3), a little wider than it
// must be. is_shading: normals may be those of no surface, smoothed over few triangles: the planes
// through the points face away, too, where nothing is seen.
void makeCone(const Surfel* surfels, int count, bool is_shading, float spacing,
              SurfelBlock& block) {
    constexpr float kSlack = 0.25f;  // radians
    std::array<Vec3, 2 * kBlockSurfels> normals;
    Vec3 axis(0.0f), mean(0.0f);
    for (int i = 0; i < count; ++i) {
        normals[size_t(i)] = surfels[i].normal;
        axis += surfels[i].normal;
        mean += surfels[i].position / float(count);
    }
    const float length = glm::length(axis);
    if (length < 0.5f * float(count)) return;
    axis /= length;
    if (is_shading) discPlanes(spacing, surfels, count, normals.data() + count);
    const int n_normals = is_shading ? 2 * count : count;
    float least = 1.0f;
    for (int i = 0; i < n_normals; ++i) least = std::min(least, glm::dot(axis, normals[size_t(i)]));
    const float angle = std::acos(std::clamp(least, -1.0f, 1.0f)) + kSlack;
    if (angle >= 1.5f) return;
    float t = kInfinity;
    for (int i = 0; i < n_normals; ++i) {
        const Vec3& normal = normals[size_t(i)];
        t = std::min(t, glm::dot(surfels[i % count].position - mean, normal) /
                            std::max(glm::dot(axis, normal), 0.1f));
    }
    block.cone_axis = axis;
    block.cone_apex = mean + axis * (t - 0.05f * glm::length(block.bounds.extent()));
    block.cone_sine = std::sin(angle);
}

}  // namespace

namespace {

constexpr float kNormalSteps = 65535.0f, kTurn = 2.0f * float(kPi) / 65536.0f, kCutSteps = 32767.0f;

// Of a vector in a plane, from `along` towards `across`.
uint16_t turnOf(float along, float across) {
    return uint16_t(int(std::lround(std::atan2(across, along) / kTurn)) & 0xffff);
}

Vec3 unpackNormal32(const std::array<uint16_t, 2>& packed) {
    return octahedralNormal(float(packed[0]) * (2.0f / kNormalSteps) - 1.0f,
                            float(packed[1]) * (2.0f / kNormalSteps) - 1.0f);
}

SurfelShape packShape(const Surfel& s, std::vector<SurfelCut>& cuts) {
    SurfelShape shape;
    const Vec2 p = octahedralOf(s.normal);
    for (int k = 0; k < 2; ++k)
        shape.normal[size_t(k)] = uint16_t(std::lround((p[k] * 0.5f + 0.5f) * kNormalSteps));
    Vec3 u, v;
    tangents(unpackNormal32(shape.normal), u, v);
    shape.turn = turnOf(glm::dot(s.along, u), glm::dot(s.along, v));
    shape.ratio = uint8_t(std::lround(quantizedRatio(s.ratio) * 255.0f));
    shape.n_cuts = uint8_t(s.n_cuts) & 7;
    shape.less = shapeLess(s.radius_share) & 31;
    shape.first_cut = uint32_t(cuts.size());
    for (int i = 0; i < s.n_cuts; ++i) {
        const Vec3& cut = s.cuts[size_t(i)];
        cuts.push_back({turnOf(cut.x, cut.y),
                        int16_t(std::lround(std::clamp(cut.z, -1.0f, 1.0f) * kCutSteps))});
    }
    return shape;
}

void unpackShape(const SurfelLevel& level, uint32_t index, Surfel& s) {
    const SurfelShape& shape = level.shapes[index];
    s.normal = unpackNormal32(shape.normal);
    Vec3 u, v;
    tangents(s.normal, u, v);
    const float turn = float(shape.turn) * kTurn;
    s.along = u * std::cos(turn) + v * std::sin(turn);
    s.ratio = float(shape.ratio) / 255.0f;
    s.n_cuts = shape.n_cuts;
    for (int i = 0; i < s.n_cuts; ++i) {
        const SurfelCut& cut = level.cuts[shape.first_cut + uint32_t(i)];
        const float at = float(cut.turn) * kTurn;
        s.cuts[size_t(i)] = Vec3(std::cos(at), std::sin(at), float(cut.end) / kCutSteps);
    }
}

constexpr float kBendSteps = 64.0f;

SurfelBend packBend(const Surfel& s) {
    SurfelBend bend;
    for (int k = 0; k < 3; ++k)
        bend.slopes[size_t(k)] =
            int8_t(std::lround(std::clamp(s.bend[k] * kBendSteps, -127.0f, 127.0f)));
    return bend;
}

uint64_t interleave(uint32_t x, uint32_t y, uint32_t z) {
    return spreadBits(x) << 2 | spreadBits(y) << 1 | spreadBits(z);
}

}  // namespace

SurfelLevel packSurfels(std::vector<Surfel> surfels, const std::vector<SurfelFinish>& finishes,
                        float spacing, SurfelDiscs discs, std::vector<uint32_t>* place_in_level) {
    // Positions are then off by a sixty-fourth of a spacing at most.
    constexpr float kMostExtent = 32.0f;  // spacings
    SurfelLevel level;
    level.spacing = spacing;
    Box3 bounds;
    for (const Surfel& s : surfels) bounds.extend(s.position);
    // A block faces one of 32 ways; within, along a space-filling curve.
    struct Key {
        uint64_t key;
        uint32_t index;
    };
    std::vector<Key> order(surfels.size());
    const float side = std::max({bounds.extent().x, bounds.extent().y, bounds.extent().z, 1e-30f});
    // Cells of about 8 x 8 surfels: what faces several ways there makes several blocks.
    const float cell = std::max(8.0f * spacing, side / 1023.0f);
    for (uint32_t i = 0; i < surfels.size(); ++i) {
        const Vec3 q = (surfels[i].position - bounds.min) / cell;
        const Vec3 f = (surfels[i].position - bounds.min) / cell * 64.0f;
        const auto fine = [](float v) { return uint32_t(v) & 63u; };
        const uint64_t coarse = interleave(uint32_t(q.x), uint32_t(q.y), uint32_t(q.z));
        const uint64_t inner = interleave(fine(f.x), fine(f.y), fine(f.z));
        const uint64_t facing = uint64_t(directionIndex(surfels[i].normal));
        order[i] = {coarse << 23 | facing << 18 | inner, i};
    }
    std::sort(order.begin(), order.end(), [](const Key& a, const Key& b) {
        return a.key != b.key ? a.key < b.key : a.index < b.index;
    });
    std::vector<Surfel> sorted(surfels.size());
    if (place_in_level) place_in_level->resize(surfels.size());
    for (size_t i = 0; i < order.size(); ++i) {
        sorted[i] = surfels[order[i].index];
        if (place_in_level) (*place_in_level)[order[i].index] = uint32_t(i);
    }
    for (size_t begin = 0; begin < sorted.size();) {
        size_t end = begin;
        SurfelBlock block;
        bool is_single_sided = true;
        // A block goes on into the next cell or facing only while it is small.
        const uint64_t group = order[begin].key >> 18, coarse = order[begin].key >> 23;
        for (; end < sorted.size() && end - begin < size_t(kBlockSurfels); ++end) {
            const bool is_elsewhere = order[end].key >> 23 != coarse,
                       is_other = order[end].key >> 18 != group;
            if ((is_elsewhere && end - begin >= kBlockSurfels / 2) ||
                (is_other && end - begin >= kBlockSurfels * 3 / 4))
                break;
            // Nor into a cell that lies far away.
            Box3 wider = block.bounds;
            wider.extend(sorted[end].position);
            const Vec3 size = wider.extent();
            if (end > begin && std::max({size.x, size.y, size.z}) > kMostExtent * spacing) break;
            block.bounds = wider;
            is_single_sided =
                is_single_sided && !finishes[sorted[end].finish].material.double_sided;
        }
        block.first = uint32_t(begin);
        block.count = uint32_t(end - begin);
        if (is_single_sided)
            makeCone(&sorted[begin], int(block.count), discs == SurfelDiscs::kAlike, spacing,
                     block);
        const Vec3 extent = block.bounds.extent();
        for (size_t i = begin; i < end; ++i) {
            const Surfel& s = sorted[i];
            uint32_t position = 0;
            for (int a = 0; a < 3; ++a) {
                const float q =
                    extent[a] > 0.0f ? (s.position[a] - block.bounds.min[a]) / extent[a] : 0.0f;
                const float steps = float(positionSteps(a));
                position |= uint32_t(std::clamp(q, 0.0f, 1.0f) * steps + 0.5f) << kPositionShift[a];
            }
            level.position.push_back(position);
            const bool has_shape = discs == SurfelDiscs::kShapes;
            level.normal.push_back(packNormal16(has_shape ? s.shading_normal : s.normal));
            level.albedo_finish.push_back(packSrgb8(s.albedo) | uint32_t(s.finish) << 24);
            if (discs != SurfelDiscs::kAlike)
                level.radius.push_back(surfelRadiusCode(s.radius_share));
            if (has_shape) {
                level.shapes.push_back(packShape(s, level.cuts));
                level.bends.push_back(packBend(s));
            }
        }
        level.blocks.push_back(block);
        begin = end;
    }
    return level;
}

Surfel unpackSurfel(const SurfelLevel& level, const SurfelBlock& block, uint32_t i) {
    Surfel s;
    const uint32_t q = level.position[i];
    s.position =
        block.bounds.min +
        SurfelLevel::step(block) * Vec3(positionPart(q, 0), positionPart(q, 1), positionPart(q, 2));
    s.normal = unpackNormal16(level.normal[i]);
    const uint32_t bits = level.albedo_finish[i];
    s.albedo = unpackSrgb8(bits);
    s.finish = uint8_t(bits >> 24);
    s.radius_share = level.radiusShare(i);
    s.shading_normal = s.normal;
    if (!level.shapes.empty()) unpackShape(level, i, s);
    if (!level.bends.empty()) {
        for (int k = 0; k < 3; ++k)
            s.bend[k] = float(level.bends[i].slopes[size_t(k)]) / kBendSteps;
    }
    return s;
}

Vec3 bentNormal(const SurfelLevel& level, const Surfel& s, float side, const Vec3& offset) {
    const Vec3 across = glm::cross(s.normal, s.along);
    const float long_axis =
        level.spacing * s.radius_share * side / (kSidePerRadius * std::sqrt(s.ratio));
    Vec2 p = Vec2(glm::dot(offset, s.along), glm::dot(offset, across)) / long_axis;
    const float beyond = std::sqrt(p.x * p.x + p.y * p.y / (s.ratio * s.ratio));
    if (beyond > 1.0f) p /= beyond;
    return glm::normalize(s.shading_normal + s.along * (s.bend.x * p.x + s.bend.z * p.y) +
                          across * (s.bend.z * p.x + s.bend.y * p.y));
}

namespace {

// Takes away what lies beyond a line: x u + y v > end.
int cutPolygon(std::array<Vec2, kMostDiscCorners>& corners, int n, const Vec3& cut, float end) {
    std::array<Vec2, kMostDiscCorners> kept;
    int n_kept = 0;
    const auto beyond = [&](const Vec2& p) { return cut.x * p.x + cut.y * p.y - end; };
    for (int i = 0; i < n; ++i) {
        const Vec2 &a = corners[size_t(i)], &b = corners[size_t((i + 1) % n)];
        const float da = beyond(a), db = beyond(b);
        if (da <= 0.0f && n_kept < kMostDiscCorners) kept[size_t(n_kept++)] = a;
        if ((da < 0.0f && db > 0.0f) || (da > 0.0f && db < 0.0f)) {
            if (n_kept < kMostDiscCorners) kept[size_t(n_kept++)] = a + (b - a) * (da / (da - db));
        }
    }
    corners = kept;
    return n_kept;
}

}  // namespace

int discPolygon(const SurfelLevel& level, const Surfel& s, float side,
                std::array<Vec3, kMostDiscCorners>& corners) {
    if (level.shapes.empty()) {
        const Vec3 other = std::abs(s.normal.x) < 0.7f ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
        const Vec3 a = glm::normalize(glm::cross(s.normal, other)) * (0.5f * side),
                   b = glm::cross(s.normal, a);
        corners[0] = -a - b, corners[1] = a - b, corners[2] = a + b, corners[3] = b - a;
        return 4;
    }
    const float radius = side / kSidePerRadius, long_axis = radius / std::sqrt(s.ratio),
                short_axis = long_axis * s.ratio;
    const float root_3 = std::sqrt(3.0f);
    std::array<Vec2, kMostDiscCorners> flat;
    int n = 6;
    for (int i = 0; i < n; ++i) {
        const float angle = float(kPi) / 3.0f * float(i);
        flat[size_t(i)] =
            Vec2(std::cos(angle) * long_axis, std::sin(angle) * short_axis) * (2.0f / root_3);
    }
    for (int i = 0; i < s.n_cuts && n > 0; ++i)
        n = cutPolygon(flat, n, s.cuts[size_t(i)], s.cuts[size_t(i)].z * long_axis);
    const Vec3 across = glm::cross(s.normal, s.along);
    for (int i = 0; i < n; ++i)
        corners[size_t(i)] = s.along * flat[size_t(i)].x + across * flat[size_t(i)].y;
    return n;
}

namespace {

void measureBlock(const SurfelModel& model, const SurfelLevel& level, SurfelBlock& block) {
    block.narrowest_patch = kInfinity;
    for (uint32_t i = block.first; i < block.first + block.count; ++i) {
        const SurfelFinish& finish = model.finishes[level.albedo_finish[i] >> 24];
        block.narrowest_patch = std::min(block.narrowest_patch, finish.patch_width);
    }
    DiscSides& sides = block.sides;
    sides.smallest = sides.largest = sides.longest = level.spacing;
    if (level.radius.empty()) return;
    float least = kInfinity, most = 0.0f, longest = 0.0f;
    for (uint32_t i = block.first; i < block.first + block.count; ++i) {
        const float share = level.radiusShare(i);
        least = std::min(least, share), most = std::max(most, share);
        if (level.shapes.empty()) continue;
        const float ratio = float(level.shapes[i].ratio) / 255.0f;
        longest = std::max(longest, share / std::sqrt(ratio));
    }
    sides.smallest = level.spacing * least;
    sides.largest = level.spacing * most;
    sides.longest = std::max(level.spacing * longest, sides.largest);
}

// How far ewa's splats reach around a surfel, spacings: a kernel's end is the root of 2, and an
// ellipse may lie a tenth of itself beyond what its disc covers of a picture with perspective.
// Discs with radii of their own are drawn half as large, less than discSide().
constexpr float kSplatReach = 1.6f;

float splatReach(const SurfelLevel& level, const SurfelBlock& block) {
    return level.radius.empty() ? kSplatReach * block.sides.longest : 0.0f;
}

SurfelBalls ballsOf(const SurfelModel& model, const SurfelLevel& level) {
    SurfelBalls balls;
    const size_t n = level.blocks.size();
    for (std::vector<float>* part : {&balls.x, &balls.y, &balls.z, &balls.radius}) part->reserve(n);
    for (const SurfelBlock& block : level.blocks) {
        const Vec3 p(DVec3(block.bounds.center()) - DVec3(model.bounds.center()));
        balls.x.push_back(p.x), balls.y.push_back(p.y), balls.z.push_back(p.z);
        const float reach =
            std::max(model.discSide() * block.sides.longest, splatReach(level, block));
        balls.radius.push_back(0.5f * glm::length(block.bounds.extent()) + reach);
    }
    return balls;
}

// Of its discs, as polygons and as splats.
Box3 drawnBounds(const SurfelModel& model, const SurfelLevel& level, const SurfelBlock& block) {
    Box3 bounds = block.bounds;
    if (level.shapes.empty()) {  // squares that are turned any way
        const Vec3 reach(std::max(0.5f * std::sqrt(2.0f) * model.discSide() * block.sides.longest,
                                  splatReach(level, block)));
        return {bounds.min - reach, bounds.max + reach};
    }
    std::array<Vec3, kMostDiscCorners> corners;
    for (uint32_t i = block.first; i < block.first + block.count; ++i) {
        const Surfel s = unpackSurfel(level, block, i);
        const int n =
            discPolygon(level, s, model.discSide() * level.spacing * s.radius_share, corners);
        for (int c = 0; c < n; ++c) bounds.extend(s.position + corners[size_t(c)]);
    }
    return bounds;
}

}  // namespace

void measureDiscs(SurfelModel& model) {
    model.drawn_bounds = model.bounds;
    for (SurfelLevel& level : model.levels) {
        for (SurfelBlock& block : level.blocks) measureBlock(model, level, block);
        level.balls = ballsOf(model, level);
    }
    // Coarser levels are drawn where their discs would be no larger than a subpixel.
    const SurfelLevel& finest = model.levels[0];
    for (const SurfelBlock& block : finest.blocks) {
        const Box3 drawn = drawnBounds(model, finest, block);
        model.drawn_bounds.extend(drawn.min);
        model.drawn_bounds.extend(drawn.max);
    }
}

namespace {

bool isSane(const Vec3& v) {
    constexpr float kMost = 1e15f;
    return std::abs(v.x) < kMost && std::abs(v.y) < kMost && std::abs(v.z) < kMost;
}

void check(bool condition, const std::string& where, const char* what) {
    if (!condition) throw Error(ErrorCode::kParse, where, what);
}

}  // namespace

void checkMaterialNumbers(const Material& m, const std::string& where) {
    const float values[] = {m.alpha,      m.metallic,        m.roughness,   m.specular.x,
                            m.specular.y, m.specular.z,      m.emissive.x,  m.emissive.y,
                            m.emissive.z, m.specular_weight, m.translucency};
    for (const float v : values)
        check(v >= 0.0f && v < 1e15f, where, "has a finish that is no number");
}

void checkSurfelFinishes(const std::vector<SurfelFinish>& finishes, const std::string& where) {
    check(finishes.size() <= 256, where, "has more than 256 finishes");
    for (const SurfelFinish& finish : finishes) {
        checkMaterialNumbers(finish.material, where);
        check(finish.patch_width >= 0.0f && finish.patch_width < 1e15f, where,
              "has a finish that is no number");
    }
}

void checkSurfelLevels(const std::vector<SurfelLevel>& levels, size_t n_finishes,
                       const std::string& where) {
    check(levels.size() <= size_t(kMostSurfelLevels), where, "has more than 64 levels");
    for (const SurfelLevel& level : levels) {
        const size_t n = level.size();
        check(level.normal.size() == n && level.albedo_finish.size() == n &&
                  (level.radius.empty() || level.radius.size() == n) &&
                  (level.shapes.empty() || (level.shapes.size() == n && !level.radius.empty())) &&
                  (level.bends.empty() || level.bends.size() == level.shapes.size()),
              where, "has arrays of different lengths");
        for (const SurfelShape& shape : level.shapes) {
            check(shape.ratio > 0, where, "has a splat that is a line");
            check(shape.n_cuts <= kMostDiscCuts &&
                      uint64_t(shape.first_cut) + shape.n_cuts <= level.cuts.size(),
                  where, "has a splat whose cuts are not there");
        }
        check(n > 0, where, "has a level without surfels");
        check(level.spacing > 0.0f && level.spacing < 1e15f, where,
              "has a spacing that is no length");
        for (uint32_t i = 0; i < uint32_t(level.radius.size()); ++i) {
            const float ratio = level.shapes.empty() ? 1.0f : float(level.shapes[i].ratio) / 255.0f;
            check(level.spacing * level.radiusShare(i) < 1e15f * std::sqrt(ratio), where,
                  "has a splat whose size is no length");
        }
        uint64_t next = 0;
        for (const SurfelBlock& block : level.blocks) {
            check(block.first == next && block.count >= 1 && block.count <= uint32_t(kBlockSurfels),
                  where, "has blocks that do not follow each other");
            next += block.count;
            check(!block.bounds.isEmpty() && isSane(block.bounds.min) && isSane(block.bounds.max),
                  where, "has a block whose bounds are no box");
            check(isSane(block.cone_apex) && isSane(block.cone_axis) &&
                      std::abs(block.cone_sine) < 1e15f,
                  where, "has a block whose cone is no cone");
        }
        check(next == n, where, "has surfels that belong to no block");
        for (const uint32_t bits : level.albedo_finish)
            check((bits >> 24) < n_finishes, where, "has a surfel without a finish");
    }
}

void checkSurfelModel(const SurfelModel& model, const std::string& where) {
    check(model.kind == "point-blocks" || model.kind == "splats", where,
          "is a model of an unknown kind");
    check(!model.levels.empty(), where, "holds no surfels");
    check(!model.finishes.empty(), where, "needs 1 to 256 finishes");
    check(!model.bounds.isEmpty() && isSane(model.bounds.min) && isSane(model.bounds.max), where,
          "has bounds that are no box");
    check(model.area >= 0.0 && model.area < 1e30, where, "has an area that is no number");
    checkSurfelFinishes(model.finishes, where);
    checkSurfelLevels(model.levels, model.finishes.size(), where);
}

}  // namespace stipple
