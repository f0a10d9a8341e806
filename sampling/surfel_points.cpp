// SPDX-License-Identifier: Apache-2.0
#include <sampling/surfel_points.h>

#include <sampling/point_list.h>
#include <sampling/surfel_visibility.h>
#include <scenegraph/object_id.h>
#include <scenegraph/surface_at.h>

#include <cmath>

namespace stipple {

namespace {

// Discs no wider than this are drawn as points, too.
constexpr float kFewSubpixels = 3.0f;
// A model whose coarsest level is finer than this share of what is wanted is far.
constexpr float kFarShare = 0.5f;

// Subpixels that a ball touches, clipped to nothing; all of the region where it reaches the eye.
SubpixelRect ballRect(const View& view, const Vec3& c, float r, const SubpixelRect& region) {
    const float f = float(view.focal);
    if (view.orthographic) {
        return {int(std::floor(float(view.center_x) + f * (c.x - r))),
                int(std::floor(float(view.center_y) + f * (c.y - r))),
                int(std::ceil(float(view.center_x) + f * (c.x + r))) + 1,
                int(std::ceil(float(view.center_y) + f * (c.y + r))) + 1};
    }
    const float near = c.z - r, far = c.z + r;
    if (!(near > view.near_z)) return region;
    const auto low = [&](float v) { return v / (v < 0.0f ? near : far); };
    const auto high = [&](float v) { return v / (v < 0.0f ? far : near); };
    const auto bounded = [](float v) { return std::clamp(v, -1e8f, 1e8f); };
    return {int(std::floor(bounded(float(view.center_x) + f * low(c.x - r)))),
            int(std::floor(bounded(float(view.center_y) + f * low(c.y - r)))),
            int(std::ceil(bounded(float(view.center_x) + f * high(c.x + r)))) + 1,
            int(std::ceil(bounded(float(view.center_y) + f * high(c.y + r)))) + 1};
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
    std::array<int, 256> width_codes = {};  // of finishes, in metres of camera space
    ModelEye eye;
};

namespace {

// By how much more than at the picture's middle a place is stretched, depths being equal.
float stretch(const View& view, const Vec3& p, float depth) {
    return view.orthographic ? 1.0f : std::max(glm::length(p) / depth, 1.0f);
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
    const float wanted = 1.0f / float(std::sqrt(context_.settings.samples));
    const int n_levels = int(model.levels.size());
    if (!mesh.triangles.empty() && model.levels.back().spacing * per_metre < kFarShare * wanted)
        return false;
    int l = n_levels - 1;
    while (l > 0 && model.levels[size_t(l)].spacing * per_metre > wanted) --l;
    const SurfelLevel& level = model.levels[size_t(l)];
    Placed placed{frame, model, level, mesh_index,
                  l,     scale, {},    makeModelEye(frame, model, view.orthographic)};
    for (size_t i = 0; i < model.finishes.size(); ++i) {
        placed.width_codes[i] =
            int(patchWidthCode(model.finishes[i].patch_width * scale, kFirstMetreExponent));
    }
    const bool may_have_discs = !context_.sink->wantsSurfels();
    const float most = std::max(1.0f, wanted);  // subpixels between points without holes
    const float disc_reach = 4.0f * model.discSide() * level.spacing * scale;
    const float reach = float(maxLengthScale(frame.camera_from_object.linear));
    const SubpixelRect& region = context_.sink->region();
    for (const SurfelBlock& block : level.blocks) {
        if (coneHides(placed.eye, block) || maskHides(placed.eye, block)) continue;
        const Vec3 center(frame.camera_from_object.point(DVec3(block.bounds.center())));
        float radius = 0.5f * glm::length(block.bounds.extent()) * reach;
        // Each block by its own depth: only what is too near needs discs.
        const float z = std::max(center.z - radius, view.near_z);
        const float apart = level.spacing * scaled_focal *
                            (view.orthographic ? 1.0f : stretch(view, center, z) / z);
        const bool with_discs = may_have_discs && apart > most;
        if (with_discs) radius += disc_reach;
        if (center.z + radius <= view.near_z || center.z - radius > view.far_z) continue;
        const SubpixelRect rect = ballRect(view, center, radius, region);
        if (!rect.overlaps(region)) continue;
        if (context_.sink->hides(rect, std::max(center.z - radius, view.near_z), false)) continue;
        if (with_discs) drawDiscs(placed, block);
        // Discs seen edge on cover no subpixel: their middles do.
        if (!with_discs || apart < kFewSubpixels) drawPoints(placed, block);
    }
    return true;
}

uint32_t SurfelPoints::addRun(const Placed& placed, uint32_t first, bool is_disc) {
    const uint32_t number = context_.nextNumber();
    Run run;
    run.camera_from_normal = placed.frame.camera_from_normal;
    run.length_scale = placed.length_scale;
    run.child = ChildRef::mesh(placed.mesh);
    run.first_index = first;
    run.path = placed.frame.path;
    run.surfel_level = int16_t(placed.level_index);
    run.surfels_per_number_shift = is_disc ? 1 : 0;
    context_.runs.push_back(run);
    return number;
}

namespace {

// Of a block's points: camera space is base + x u + y v + z w, in quantization steps.
struct Warp {
    Vec3 base, x, y, z;
    float z_near, z_far;
};

__attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default"))) void warpPoints(
    const Warp& w, const uint32_t* __restrict packed, int count, uint32_t first_number,
    PointBlock& out) {
    // Plain locals and restricted pointers, or the compiler will not vectorize.
    const float xx = w.x.x, xy = w.x.y, xz = w.x.z, yx = w.y.x, yy = w.y.y, yz = w.y.z;
    const float zx = w.z.x, zy = w.z.y, zz = w.z.z, bx = w.base.x, by = w.base.y, bz = w.base.z;
    const float z_near = w.z_near, z_far = w.z_far;
    float* __restrict out_x = out.x;
    float* __restrict out_y = out.y;
    float* __restrict out_z = out.z;
    uint32_t* __restrict number = out.number;
    uint8_t* __restrict keep = out.keep;
    for (int i = 0; i < count; ++i) {
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
    warpPoints(warp, placed.level.position.data() + b.first, n, addRun(placed, b.first, false),
               out);
    const bool with_shapes = context_.sink->wantsSurfels();
    if (with_shapes || !placed.model.leaves_no_holes) {
        addWidths(placed, b);
        if (with_shapes) addShapes(placed, b);
    } else {
        // There are enough of them: none need be wider than its subpixel.
        std::fill(out.width, out.width + n, kNoPatch);
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
    // There are one to two of a grid's samples a subpixel: on wider patches than those whose holes
    // are closed they would widen silhouettes.
    const int widest = placed.model.leaves_no_holes ? kWidthCodes - 1 : int(kSurfaceCode);
    for (int i = 0; i < block_.count; ++i) {
        const int code =
            placed.width_codes[placed.level.albedo_finish[b.first + uint32_t(i)] >> 24];
        block_.width[i] = uint8_t(std::clamp(code + offset, 1, widest));
    }
}

// Its normals and areas.
void SurfelPoints::addShapes(const Placed& placed, const SurfelBlock& b) {
    const SurfelLevel& level = placed.level;
    // Discs with radii of their own cover all of the surface between them; what blends, less.
    const float side = level.spacing * placed.length_scale * (level.radius.empty() ? 1.0f : 0.5f);
    PointBlock& out = block_;
    for (int i = 0; i < out.count; ++i) {
        const uint32_t k = b.first + uint32_t(i);
        const Vec3 normal =
            glm::normalize(placed.frame.camera_from_normal * unpackNormal16(level.normal[k]));
        out.normal_x[i] = normal.x, out.normal_y[i] = normal.y, out.normal_z[i] = normal.z;
        const float share = level.radius.empty() ? 1.0f : surfelRadius(level.radius[k]);
        out.area[i] = side * side * share * share;
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

// Squares that stand for discs, two triangles each.
void SurfelPoints::drawDiscs(const Placed& placed, const SurfelBlock& b) {
    const SurfelLevel& level = placed.level;
    const ModelEye& eye = placed.eye;
    const Vec3 step = SurfelLevel::step(b);
    const Affine& to_camera = placed.frame.camera_from_object;
    const Mat3 linear(to_camera.linear);
    const View& view = context_.view;
    TriangleBlock& out = triangles_;
    constexpr uint32_t kDiscs = kBlockPoints / 2;
    for (uint32_t first = b.first; first < b.first + b.count; first += kDiscs) {
        const uint32_t end = std::min(first + kDiscs, b.first + b.count);
        out.count = 0;
        out.mask = nullptr;
        out.is_wide = false;
        for (uint32_t k = first; k < end; ++k) {
            const uint32_t packed = level.position[k];
            const Vec3 position =
                b.bounds.min + step * Vec3(positionPart(packed, 0), positionPart(packed, 1),
                                           positionPart(packed, 2));
            const Vec3 normal = unpackNormal16(level.normal[k]);
            const SurfelFinish& finish = placed.model.finishes[level.albedo_finish[k] >> 24];
            const Vec3 center(to_camera.point(DVec3(position)));
            const float share = level.radius.empty() ? 1.0f : surfelRadius(level.radius[k]);
            const float half = 0.5f * placed.model.discSide() * level.spacing * share;
            Vec3 a_object, c_object;
            tangents(normal, a_object, c_object);
            const Vec3 a = linear * (a_object * half), c = linear * (c_object * half);
            Vec3 corners[4] = {center - a - c, center + a - c, center + a + c, center + c - a};
            const float nearest = std::min(std::min(corners[0].z, corners[1].z),
                                           std::min(corners[2].z, corners[3].z));
            // Before the eye and with the front to it, or without any extent.
            if (!(nearest > view.near_z) || showsBack(eye, finish.material, normal, position))
                std::fill(corners, corners + 4, Vec3(0, 0, view.near_z * 2.0f));
            for (const int t : {0, 1}) {
                const int i = out.count++;
                const Vec3 vertices[3] = {corners[0], corners[1 + t], corners[2 + t]};
                for (int m = 0; m < 3; ++m) {
                    out.x[m][i] = vertices[m].x;
                    out.y[m][i] = vertices[m].y;
                    out.z[m][i] = vertices[m].z;
                }
            }
            const float width = finish.patch_width * placed.length_scale * float(view.focal);
            out.is_wide =
                out.is_wide || width >= kSurfaceWidth * (view.orthographic ? 1.0f : center.z);
        }
        out.first_number = addRun(placed, first, true) | kTriangleBit;
        if (!context_.sink->take(out)) context_.runs.pop_back();
    }
}

void surfelAttributes(const Scene& scene, const Mat3& world_from_camera, const Run& run,
                      uint32_t index, SurfaceSample& sample) {
    const Mesh& mesh = scene.meshes[run.child.index()];
    const SurfelLevel& level = mesh.surfels->levels[size_t(run.surfel_level)];
    const uint32_t bits = level.albedo_finish[index];
    const uint32_t finish = bits >> 24;
    sample.material = mesh.first_finish + finish;
    sample.albedo = unpackSrgb8(bits & 0xffffffu);
    sample.alpha = 1.0f;
    sample.finish = plainFinish(scene.materials[sample.material]);
    sample.patch_width = mesh.surfels->finishes[finish].patch_width * run.length_scale;
    sample.object = objectId(run.path);
    sample.normal_world = glm::normalize(
        world_from_camera * (run.camera_from_normal * unpackNormal16(level.normal[index])));
}

}  // namespace stipple
