// SPDX-License-Identifier: Apache-2.0
#include <sampling/surfel_points.h>

#include <core/image.h>
#include <core/vector_clones.h>
#include <sampling/point_list.h>
#include <sampling/surfel_visibility.h>
#include <scenegraph/disc_planes.h>
#include <scenegraph/object_id.h>
#include <scenegraph/surface_at.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

// Discs no wider than this are drawn as points, too.
constexpr float kFewSubpixels = 3.0f;
// Discs with a radius of more than this share of their distance are no ellipses in the picture.
constexpr float kNearShare = 0.25f;
// Nor are those that are seen edge on, with a radius of more than this share.
constexpr float kEdgeOn = 0.1f, kEdgeOnShare = 0.02f;
// A model whose coarsest level is finer than this share of what is wanted is far.
constexpr float kFarShare = 0.5f;

// Subpixels that a ball touches, clipped to nothing; all of the region where it reaches the eye.
SubpixelRect ballRect(const View& view, const Vec3& c, float r, const SubpixelRect& region) {
    const float f = float(view.focal);
    const auto bounded = [](float v) { return std::clamp(v, -1e8f, 1e8f); };
    if (view.orthographic) {
        return {int(std::floor(bounded(float(view.center_x) + f * (c.x - r)))),
                int(std::floor(bounded(float(view.center_y) + f * (c.y - r)))),
                int(std::ceil(bounded(float(view.center_x) + f * (c.x + r)))) + 1,
                int(std::ceil(bounded(float(view.center_y) + f * (c.y + r)))) + 1};
    }
    const float near = c.z - r, far = c.z + r;
    if (!(near > view.near_z)) return region;
    const auto low = [&](float v) { return v / (v < 0.0f ? near : far); };
    const auto high = [&](float v) { return v / (v < 0.0f ? far : near); };
    return {int(std::floor(bounded(float(view.center_x) + f * low(c.x - r)))),
            int(std::floor(bounded(float(view.center_y) + f * low(c.y - r)))),
            int(std::ceil(bounded(float(view.center_x) + f * high(c.x + r)))) + 1,
            int(std::ceil(bounded(float(view.center_y) + f * high(c.y + r)))) + 1};
}

// radius: of a circle as large, object space. area: what a unit of area in its plane becomes.
DiscShape shapeOf(const Surfel& s, float radius, const Mat3& linear, float& area) {
    const std::array<Vec3, 2> axes = s.axes();
    DiscShape shape;
    for (size_t k = 0; k < 2; ++k) shape.axis[k] = linear * axes[k];
    area = glm::length(glm::cross(shape.axis[0], shape.axis[1]));
    const float scale = std::sqrt(std::max(area, 1e-30f));
    for (Vec3& axis : shape.axis) axis /= scale;
    shape.n_cuts = s.n_cuts;
    // Along the long half axis u goes from -radius to radius, across it v does.
    for (int i = 0; i < s.n_cuts; ++i) {
        const Vec3& cut = s.cuts[size_t(i)];
        shape.cuts[size_t(i)] = Vec3(cut.x, cut.y * s.ratio, cut.z * radius * scale);
    }
    return shape;
}

}  // namespace

// One level of one instance.
struct SurfelPoints::Placed {
    const InstanceFrame& frame;
    const SurfelModel& model;
    const SurfelLevel& level;
    uint32_t mesh = 0;
    int level_index = 0;
    float length_scale = 1.0f;
    uint32_t frame_index = kNoFrame;
    std::array<int, 256> width_codes = {};  // of finishes, in metres of camera space
    ModelEye eye;
};

namespace {

// By how much more than at the picture's middle a place is stretched, depths being equal.
float stretch(const View& view, const Vec3& p, float depth) {
    return view.orthographic ? 1.0f : std::max(glm::length(p) / depth, 1.0f);
}

// What blocks' balls are tested against. Camera space.
struct Window {
    float near_z, far_z;
    // Edges of the region as x / z and y / z (orthographic: x and y), a little farther out.
    float left, right, top, bottom;
};

Window windowOf(const View& view, const SubpixelRect& region) {
    constexpr double kMargin = 2.0;  // subpixels: more than what floats may be off
    return {view.near_z,
            view.far_z,
            float((region.x0 - kMargin - view.center_x) / view.focal),
            float((region.x1 + kMargin - view.center_x) / view.focal),
            float((region.y0 - kMargin - view.center_y) / view.focal),
            float((region.y1 + kMargin - view.center_y) / view.focal)};
}

// Blocks that are tested at once.
constexpr int kTestedBlocks = 256;

template <bool kOrthographic>
inline __attribute__((always_inline)) void testLoop(
    const Window& window, const Mat3& linear, const Vec3& middle, float reach,
    const float* __restrict x, const float* __restrict y, const float* __restrict z,
    const float* __restrict radius, int count, int32_t* __restrict may_show) {
    // Plain locals and integers for truth, or the compiler will not vectorize.
    const float xx = linear[0].x, xy = linear[0].y, xz = linear[0].z;
    const float yx = linear[1].x, yy = linear[1].y, yz = linear[1].z;
    const float zx = linear[2].x, zy = linear[2].y, zz = linear[2].z;
    const float mx = middle.x, my = middle.y, mz = middle.z;
    const float near_z = window.near_z, far_z = window.far_z;
    const float left = window.left, right = window.right, top = window.top, bottom = window.bottom;
    constexpr float kRounding = 1e-5f;  // of a ball's place, and more than of its radius
    for (int i = 0; i < count; ++i) {
        const float px = mx + xx * x[i] + yx * y[i] + zx * z[i],
                    py = my + xy * x[i] + yy * y[i] + zy * z[i],
                    pz = mz + xz * x[i] + yz * y[i] + zz * z[i];
        const float r = radius[i] * reach * (1.0f + 1e-3f) +
                        kRounding * (std::abs(px) + std::abs(py) + std::abs(pz));
        const float near = pz - r, far = pz + r;
        const int is_deep = (far > near_z) & (near <= far_z);
        // Of a box around the ball: an edge right of the axis lies farthest left at its far side.
        const auto depth = [&](float edge, bool is_low) {
            return kOrthographic ? 1.0f : (edge < 0.0f) == is_low ? near : far;
        };
        const float x0 = px - r, x1 = px + r, y0 = py - r, y1 = py + r;
        const int is_inside = (x0 < right * depth(x0, true)) & (x1 > left * depth(x1, false)) &
                              (y0 < bottom * depth(y0, true)) & (y1 > top * depth(y1, false));
        const int reaches_eye = kOrthographic ? 0 : !(near > near_z);
        may_show[i] = is_deep & (is_inside | reaches_eye);
    }
}

// Which blocks of a level, from `first` on, may show in the window; no exact test.
STIPPLE_VECTOR_CLONES void testBlocks(bool orthographic, const Window& window, const Mat3& linear,
                                      const Vec3& middle, float reach, const SurfelBalls& balls,
                                      size_t first, int count, int32_t* may_show) {
    const float *x = balls.x.data() + first, *y = balls.y.data() + first,
                *z = balls.z.data() + first, *radius = balls.radius.data() + first;
    orthographic ? testLoop<true>(window, linear, middle, reach, x, y, z, radius, count, may_show)
                 : testLoop<false>(window, linear, middle, reach, x, y, z, radius, count, may_show);
}

}  // namespace

bool SurfelPoints::draw(uint32_t mesh_index, const InstanceFrame& frame, float z_min) {
    const Mesh& mesh = context_.scene.meshes[mesh_index];
    const SurfelModel& model = *mesh.surfels;
    const View& view = context_.view;
    const float scale = float(std::sqrt(frame.area_scale));
    const float scaled_focal = scale * float(view.focal);
    const Vec3 middle(frame.camera_from_object.point(DVec3(model.bounds.center())));
    // What reaches to the eye's side has blocks that are stretched more, and see to it themselves.
    const float nearest = std::max(z_min, view.near_z);
    const float per_metre =
        view.orthographic
            ? scaled_focal
            : scaled_focal / nearest * stretch(view, middle, std::max(middle.z, nearest));
    const float wanted = wantedSpacing();
    const int n_levels = int(model.levels.size());
    if (!mesh.triangles.empty() && model.levels.back().spacing * per_metre < kFarShare * wanted)
        return false;
    int l = n_levels - 1;
    while (l > 0 && model.levels[size_t(l)].spacing * per_metre > wanted) --l;
    const SurfelLevel& level = model.levels[size_t(l)];
    Placed placed{frame,      model, level,
                  mesh_index, l,     scale,
                  kNoFrame,   {},    makeModelEye(frame, model, view.orthographic)};
    if (!level.bends.empty()) {
        placed.frame_index = uint32_t(context_.frames.size());
        context_.frames.push_back(frame);
    }
    for (size_t i = 0; i < model.finishes.size(); ++i) {
        placed.width_codes[i] =
            int(patchWidthCode(model.finishes[i].patch_width * scale, kFirstMetreExponent));
    }
    const float reach = float(maxLengthScale(frame.camera_from_object.linear));
    const Window window = windowOf(view, context_.sink->region());
    const Mat3 linear(frame.camera_from_object.linear);
    std::array<int32_t, kTestedBlocks> may_show;
    for (size_t first = 0; first < level.blocks.size(); first += kTestedBlocks) {
        const int n = int(std::min(level.blocks.size() - first, size_t(kTestedBlocks)));
        testBlocks(view.orthographic, window, linear, middle, reach, level.balls, first, n,
                   may_show.data());
        for (int i = 0; i < n; ++i) {
            if (may_show[size_t(i)]) drawBlock(placed, first + size_t(i), reach);
        }
    }
    return true;
}

void SurfelPoints::drawBlock(const Placed& placed, size_t index, float reach) {
    const SurfelBlock& block = placed.level.blocks[index];
    if (coneHides(placed.eye, block) || maskHides(placed.eye, block)) return;
    const View& view = context_.view;
    const SurfelLevel& level = placed.level;
    const DiscSides& sides = block.sides;
    const SubpixelRect& region = context_.sink->region();
    const Vec3 center(placed.frame.camera_from_object.point(DVec3(block.bounds.center())));
    const float scaled_focal = placed.length_scale * float(view.focal);
    const float wanted = wantedSpacing();
    float radius = 0.5f * glm::length(block.bounds.extent()) * reach;
    // Each block by its own depth: only what is too near needs discs.
    const float z = std::max(center.z - radius, view.near_z);
    const float per_metre =
        scaled_focal * (view.orthographic ? 1.0f : stretch(view, center, z) / z);
    const bool may_be_discs = !context_.sink->wantsSurfels();
    has_near_ = !may_be_discs && !view.orthographic && sides.longest * reach > kEdgeOnShare * z &&
                findNear(placed, block, reach);
    const bool with_discs = may_be_discs ? sides.largest * per_metre > wanted : has_near_;
    // Discs seen edge on cover no subpixel: their middles do.
    const bool with_points =
        !may_be_discs || !with_discs || sides.smallest * per_metre < kFewSubpixels;
    if (with_discs || !may_be_discs) radius = level.balls.radius[index] * reach;
    if (center.z + radius <= view.near_z || center.z - radius > view.far_z) return;
    const SubpixelRect rect = ballRect(view, center, radius, region);
    if (!rect.overlaps(region)) return;
    if (context_.sink->hides(rect, std::max(center.z - radius, view.near_z), false)) return;
    if (with_discs) drawDiscs(placed, block);
    block_.is_coarse = !may_be_discs && level.spacing * per_metre > wanted;
    if (with_points) drawPoints(placed, block);
}

float SurfelPoints::wantedSpacing() const {
    return 1.0f / float(std::sqrt(context_.settings.samples));
}

// Into is_near_. False if there are none.
bool SurfelPoints::findNear(const Placed& placed, const SurfelBlock& block, float reach) {
    bool has_near = false;
    for (uint32_t i = 0; i < block.count; ++i) {
        const Surfel s = unpackSurfel(placed.level, block, block.first + i);
        const double z = placed.frame.camera_from_object.point(DVec3(s.position)).z;
        const float side = placed.level.spacing * s.radius_share / std::sqrt(s.ratio);
        const Vec3 to_eye = placed.eye.from(s.position);
        const bool is_edge_on =
            std::abs(glm::dot(s.normal, to_eye)) < kEdgeOn * glm::length(to_eye);
        is_near_[i] = double(side * reach) > double(is_edge_on ? kEdgeOnShare : kNearShare) * z;
        has_near = has_near || is_near_[i];
    }
    return has_near;
}

uint32_t SurfelPoints::addRun(const Placed& placed, uint32_t first, int numbers_shift) {
    const uint32_t number = context_.nextNumber();
    Run run;
    run.camera_from_normal = placed.frame.camera_from_normal;
    run.length_scale = placed.length_scale;
    run.child = ChildRef::mesh(placed.mesh);
    run.first_index = first;
    run.path = placed.frame.path;
    run.frame = placed.frame_index;
    run.surfel_level = int16_t(placed.level_index);
    run.numbers_per_surfel_shift = uint8_t(numbers_shift);
    context_.runs.push_back(run);
    return number;
}

namespace {

// Of a block's points: camera space is base + x u + y v + z w, in quantization steps.
struct Warp {
    Vec3 base, x, y, z;
    float z_near, z_far;
};

// A whole block, however many points are in it: a number of steps that the compiler knows.
STIPPLE_VECTOR_CLONES void warpPoints(const Warp& w,
                                      const std::array<uint32_t, kBlockPoints>& positions,
                                      uint32_t first_number, PointBlock& out) {
    // Plain locals and restricted pointers, or the compiler will not vectorize.
    const float xx = w.x.x, xy = w.x.y, xz = w.x.z, yx = w.y.x, yy = w.y.y, yz = w.y.z;
    const float zx = w.z.x, zy = w.z.y, zz = w.z.z, bx = w.base.x, by = w.base.y, bz = w.base.z;
    const float z_near = w.z_near, z_far = w.z_far;
    const uint32_t* __restrict packed = positions.data();
    float* __restrict out_x = out.x;
    float* __restrict out_y = out.y;
    float* __restrict out_z = out.z;
    uint32_t* __restrict number = out.number;
    uint8_t* __restrict keep = out.keep;
    for (int i = 0; i < kBlockPoints; ++i) {
        const float p = float(int(positionPart(packed[i], 0))),
                    q = float(int(positionPart(packed[i], 1))),
                    r = float(int(positionPart(packed[i], 2)));
        const float z = bz + xz * p + yz * q + zz * r;
        out_x[i] = bx + xx * p + yx * q + zx * r;
        out_y[i] = by + xy * p + yy * q + zy * r;
        out_z[i] = z;
        keep[i] = uint8_t((z > z_near) & (z <= z_far));
        number[i] = first_number + uint32_t(i);
    }
}

}  // namespace

void SurfelPoints::drawPoints(const Placed& placed, const SurfelBlock& b) {
    const View& view = context_.view;
    const Affine& to_camera = placed.frame.camera_from_object;
    const DVec3 step(SurfelLevel::step(b));
    const Warp warp = {Vec3(to_camera.point(DVec3(b.bounds.min))),
                       Vec3(to_camera.linear[0] * step.x),
                       Vec3(to_camera.linear[1] * step.y),
                       Vec3(to_camera.linear[2] * step.z),
                       view.near_z,
                       view.far_z};
    const int n = int(b.count);
    PointBlock& out = block_;
    out.count = n;
    out.is_prebuilt = true;
    std::array<uint32_t, kBlockPoints> positions = {};
    std::copy_n(placed.level.position.data() + b.first, n, positions.data());
    warpPoints(warp, positions, addRun(placed, b.first, 0), out);
    for (int i = 0; has_near_ && i < n; ++i) out.keep[i] &= uint8_t(!is_near_[size_t(i)]);
    const bool with_shapes = context_.sink->wantsSurfels();
    out.is_on_surface = false;
    if (with_shapes || !placed.model.leaves_no_holes) {
        addWidths(placed, b);
        if (with_shapes) addShapes(placed, b);
    } else {
        // There are enough of them: none need be wider than its subpixel. Where one has none after
        // all, those around it close it.
        std::fill(out.width, out.width + n, kNoPatch);
        out.is_on_surface = b.narrowest_patch * placed.length_scale * float(view.focal) >=
                            kSurfaceWidth * (view.orthographic ? 1.0f : warp.base.z);
    }
    if (!context_.sink->take(out)) context_.runs.pop_back();
}

// Patch widths of the block that was just made.
void SurfelPoints::addWidths(const Placed& placed, const SurfelBlock& b) {
    const View& view = context_.view;
    const Vec3 center(placed.frame.camera_from_object.point(DVec3(b.bounds.center())));
    const float z = view.orthographic ? 1.0f : std::max(center.z, view.near_z);
    const int offset = int(std::lround(std::log2(float(view.focal) / z) * kWidthsPerOctave)) +
                       (kFirstMetreExponent - kFirstSubpixelExponent) * kWidthsPerOctave;
    // Where there are one to two of a grid's samples a subpixel, on wider patches than those whose
    // holes are closed they would widen silhouettes.
    const int widest =
        placed.model.leaves_no_holes || block_.is_coarse ? kWidthCodes - 1 : int(kSurfaceCode);
    for (int i = 0; i < block_.count; ++i) {
        const int code =
            placed.width_codes[placed.level.albedo_finish[b.first + uint32_t(i)] >> 24];
        block_.width[i] = uint8_t(std::clamp(code + offset, 1, widest));
    }
}

// Surfels that all have the same radius have but shading normals.
void SurfelPoints::unpackDiscs(const SurfelLevel& level, const SurfelBlock& b) {
    for (uint32_t i = 0; i < b.count; ++i) {
        surfels_[i] = unpackSurfel(level, b, b.first + i);
        planes_[i] = surfels_[i].normal;
    }
    if (level.radius.empty())
        discPlanes(level.spacing, surfels_.data(), int(b.count), planes_.data());
}

// Its normals, areas and shapes.
void SurfelPoints::addShapes(const Placed& placed, const SurfelBlock& b) {
    const SurfelLevel& level = placed.level;
    // Discs with radii of their own cover all of the surface between them; what blends, less.
    const float side = level.spacing * placed.length_scale * (level.radius.empty() ? 1.0f : 0.5f);
    // Samples that leave no hole are one and a half a square of their spacing.
    const float share_of_square =
        level.radius.empty() && placed.model.leaves_no_holes ? 0.65f : 1.0f;
    const Mat3 linear(placed.frame.camera_from_object.linear);
    PointBlock& out = block_;
    out.shapes = level.shapes.empty() ? nullptr : shapes_.data();
    const bool are_discs = out.is_coarse || out.shapes;
    if (are_discs) unpackDiscs(level, b);
    for (int i = 0; i < out.count; ++i) {
        const uint32_t k = b.first + uint32_t(i);
        const Vec3 normal =
            glm::normalize(placed.frame.camera_from_normal *
                           (are_discs ? planes_[size_t(i)] : unpackNormal16(level.normal[k])));
        out.normal_x[i] = normal.x, out.normal_y[i] = normal.y, out.normal_z[i] = normal.z;
        const float share = level.radiusShare(k);
        out.area[i] = share_of_square * side * side * share * share;
        if (out.shapes) {
            const Surfel& s = surfels_[size_t(i)];
            const float radius = level.spacing * share * placed.model.discSide() / kSidePerRadius;
            float area = 1.0f;
            shapes_[size_t(i)] = shapeOf(s, radius, linear, area);
            out.area[i] = 0.25f * level.spacing * level.spacing * share * share * area;
        }
    }
}

namespace {

// Shading normals of what is seen at a grazing angle may well point away: that is no back.
constexpr float kGrazing = 0.3f;

bool showsBack(const ModelEye& eye, const Material& material, const Vec3& normal, const Vec3& p) {
    if (material.double_sided) return false;
    const Vec3 to_eye = eye.from(p);
    return glm::dot(normal, to_eye) < -kGrazing * glm::length(to_eye);
}

}  // namespace

// Polygons that stand for discs.
void SurfelPoints::drawDiscs(const Placed& placed, const SurfelBlock& b) {
    const SurfelLevel& level = placed.level;
    const Affine& to_camera = placed.frame.camera_from_object;
    const Mat3 linear(to_camera.linear);
    const View& view = context_.view;
    TriangleBlock& out = triangles_;
    std::array<Vec3, kMostDiscCorners> corners;
    unpackDiscs(level, b);
    // Of a square two triangles, of a hexagon four, of one with cuts up to eight.
    const auto shiftOf = [&](uint32_t k) {
        return level.shapes.empty() ? 1 : level.shapes[k].n_cuts == 0 ? 2 : 3;
    };
    for (uint32_t first = b.first; first < b.first + b.count;) {
        const int shift = shiftOf(first);
        out.count = 0;
        out.mask = nullptr;
        out.is_wide = false;
        uint32_t k = first;
        for (; k < b.first + b.count && shiftOf(k) == shift &&
               out.count + (1 << shift) <= kBlockPoints;
             ++k) {
            Surfel& s = surfels_[k - b.first];
            const Vec3 center(to_camera.point(DVec3(s.position)));
            // With the front to the eye, and not all behind it; among near ones these alone.
            const SurfelFinish& finish = placed.model.finishes[s.finish];
            const bool is_front = !showsBack(placed.eye, finish.material, s.normal, s.position) &&
                                  (!has_near_ || is_near_[k - b.first]);
            bool is_before_eye = false;
            s.normal = planes_[k - b.first];
            const int n = discPolygon(
                level, s, placed.model.discSide() * level.spacing * s.radius_share, corners);
            for (int c = 0; c < n; ++c) {
                corners[size_t(c)] = center + linear * corners[size_t(c)];
                is_before_eye = is_before_eye || corners[size_t(c)].z > view.near_z;
            }
            for (int t = 0; t < 1 << shift; ++t) {
                const bool is_there = is_front && is_before_eye && t + 2 < n;
                const Vec3 nowhere(0, 0, view.near_z * 2.0f);
                const Vec3 vertices[3] = {is_there ? corners[0] : nowhere,
                                          is_there ? corners[size_t(t) + 1] : nowhere,
                                          is_there ? corners[size_t(t) + 2] : nowhere};
                const int i = out.count++;
                for (int m = 0; m < 3; ++m) {
                    out.x[m][i] = vertices[m].x;
                    out.y[m][i] = vertices[m].y;
                    out.z[m][i] = vertices[m].z;
                }
            }
            const float width = finish.patch_width * placed.length_scale * float(view.focal);
            out.is_wide |= is_front && is_before_eye &&
                           width >= kSurfaceWidth * (view.orthographic ? 1.0f : center.z);
        }
        out.first_number = addRun(placed, first, shift) | kTriangleBit;
        if (!context_.sink->take(out)) context_.runs.pop_back();
        first = k;
    }
}

namespace {

// Radians. Splats that bend by less stand out by the bends of those beside them, too.
constexpr float kLittleBend = 0.2f;
// Of its own and of one beside: heights of a bend.
constexpr float kSplatSlack = 1.5f;

// By how much a flat splat and those beside it may lie off each other where they stand for one bent
// surface. Object space, m.
float heightOfBend(const SurfelModel& model, const SurfelLevel& level, const Surfel& s) {
    const float long_axis =
        level.spacing * s.radius_share * model.discSide() / (kSidePerRadius * std::sqrt(s.ratio));
    const Vec3 turn = glm::abs(s.bend) * Vec3(1.0f, s.ratio * s.ratio, 2.0f * s.ratio);
    const float bend = std::max({turn.x, turn.y, turn.z});
    return 0.5f * kSplatSlack * long_axis * (bend + std::min(bend, kLittleBend));
}

// Object space, unit. slack: SurfaceSample::shadow_slack, object space.
Vec3 normalAt(const TileContext& context, const SurfelModel& model, const SurfelLevel& level,
              const Run& run, uint32_t index, const Vec3& position_camera, float& slack) {
    slack = 0.0f;
    if (run.frame == kNoFrame) return unpackNormal16(level.normal[index]);
    const auto after =
        std::upper_bound(level.blocks.begin(), level.blocks.end(), index,
                         [](uint32_t i, const SurfelBlock& block) { return i < block.first; });
    const Surfel s = unpackSurfel(level, *(after - 1), index);
    slack = heightOfBend(model, level, s);
    const Affine& to_camera = context.frames[run.frame].camera_from_object;
    const DVec3 offset = DVec3(position_camera) - to_camera.point(DVec3(s.position));
    return bentNormal(level, s, model.discSide(), Vec3(glm::inverse(to_camera.linear) * offset));
}

// What stands out over a silhouette is splats that turn away from the eye there. Shading would turn
// their normals to the eye, and light them from the wrong side: they are lit as the silhouette is.
// Surface that is seen from behind turns away by more, but at grazing angles.
constexpr float kRimCosine = 0.5f;

Vec3 atSilhouette(const Vec3& normal, const Vec3& to_eye) {
    const float cosine = glm::dot(normal, to_eye);
    if (cosine >= 0.0f || cosine < -kRimCosine) return normal;
    return glm::normalize(normal - to_eye * (cosine - 1e-3f));
}

}  // namespace

void surfelAttributes(const TileContext& context, const Run& run, uint32_t index,
                      SurfaceSample& sample) {
    const Scene& scene = context.scene;
    const Mesh& mesh = scene.meshes[run.child.index()];
    const SurfelLevel& level = mesh.surfels->levels[size_t(run.surfel_level)];
    const uint32_t bits = level.albedo_finish[index];
    const uint32_t finish = bits >> 24;
    sample.material = mesh.first_finish + finish;
    sample.albedo = unpackSrgb8(bits & 0xffffffu);
    sample.alpha = 1.0f;
    sample.finish = plainFinish(scene.materials[sample.material]);
    // What lies within a disc is told apart no more.
    const float side = level.spacing * level.radiusShare(index);
    sample.patch_width =
        std::max(mesh.surfels->finishes[finish].patch_width, side) * run.length_scale;
    sample.object = objectId(run.path);
    const Mat3& world_from_camera = context.view.world_from_camera;
    const Vec3 normal = normalAt(context, *mesh.surfels, level, run, index, sample.position_camera,
                                 sample.shadow_slack);
    sample.shadow_slack *= run.length_scale;
    sample.normal_world = glm::normalize(world_from_camera * (run.camera_from_normal * normal));
    if (run.frame != kNoFrame) {
        const Vec3 to_eye = context.view.orthographic
                                ? -world_from_camera[2]
                                : glm::normalize(world_from_camera * -sample.position_camera);
        sample.normal_world = atSilhouette(sample.normal_world, to_eye);
    }
}

}  // namespace stipple
