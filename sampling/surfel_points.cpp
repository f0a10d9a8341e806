// SPDX-License-Identifier: Apache-2.0
#include <sampling/surfel_points.h>

#include <sampling/point_list.h>
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
    int first_material = 0;
};

bool SurfelPoints::draw(uint32_t mesh_index, const InstanceFrame& frame, float z_min) {
    const Mesh& mesh = context_.scene.meshes[mesh_index];
    const SurfelModel& model = *mesh.surfels;
    const View& view = context_.view;
    const float scale = float(std::sqrt(frame.area_scale));
    const float per_metre =
        scale * float(view.focal) / (view.orthographic ? 1.0f : std::max(z_min, view.near_z));
    const float wanted = 1.0f / float(std::sqrt(context_.settings.samples));
    const int n_levels = int(model.levels.size());
    if (!mesh.triangles.empty() && model.levels.back().spacing * per_metre < kFarShare * wanted)
        return false;
    int l = n_levels - 1;
    while (l > 0 && model.levels[size_t(l)].spacing * per_metre > wanted) --l;
    const SurfelLevel& level = model.levels[size_t(l)];
    Placed placed{frame, model, level, mesh_index, l, scale, {}, int(mesh.first_finish)};
    for (size_t i = 0; i < model.finishes.size(); ++i) {
        placed.width_codes[i] =
            int(patchWidthCode(model.finishes[i].patch_width * scale, kFirstMetreExponent));
    }
    const bool with_discs =
        !context_.sink->wantsSurfels() && level.spacing * per_metre > std::max(1.0f, wanted);
    // Discs seen edge on cover no subpixel: their middles do.
    const bool with_points = !with_discs || level.spacing * per_metre < kFewSubpixels;
    const float reach = float(maxLengthScale(frame.camera_from_object.linear));
    const SubpixelRect& region = context_.sink->region();
    for (const SurfelBlock& block : level.blocks) {
        const Vec3 center(frame.camera_from_object.point(DVec3(block.bounds.center())));
        float radius = 0.5f * glm::length(block.bounds.extent()) * reach;
        if (with_discs) radius += model.discSide() * level.spacing * scale * 4.0f;
        if (center.z + radius <= view.near_z || center.z - radius > view.far_z) continue;
        const SubpixelRect rect = ballRect(view, center, radius, region);
        if (!rect.overlaps(region) || isHiddenFromEye(frame, model, block)) continue;
        if (context_.sink->hides(rect, std::max(center.z - radius, view.near_z), false)) continue;
        if (with_discs) drawDiscs(placed, block);
        if (with_points) drawPoints(placed, block);
    }
    return true;
}

// The sides of a block from which nothing of it is seen.
bool SurfelPoints::isHiddenFromEye(const InstanceFrame& frame, const SurfelModel& model,
                                   const SurfelBlock& block) const {
    const bool orthographic = context_.view.orthographic;
    const DVec3 center(block.bounds.center());
    const Vec3 to_eye = orthographic ? Vec3(-frame.facing) : Vec3(frame.eye_object - center);
    if (block.cone_sine < 1.0f) {
        const Vec3 from_apex =
            orthographic ? to_eye : Vec3(frame.eye_object - DVec3(block.cone_apex));
        if (glm::dot(from_apex, block.cone_axis) < -block.cone_sine * glm::length(from_apex))
            return true;
    }
    // Masks were found from outside.
    const DVec3 margin = 0.1 * DVec3(model.bounds.extent());
    const bool is_outside =
        orthographic ||
        glm::any(glm::lessThan(frame.eye_object, DVec3(model.bounds.min) - margin)) ||
        glm::any(glm::greaterThan(frame.eye_object, DVec3(model.bounds.max) + margin));
    if (!is_outside) return false;
    const int d = maskDirectionIndex(to_eye);
    return !(block.visible_from[size_t(d / 64)] >> (d % 64) & 1);
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

void SurfelPoints::drawPoints(const Placed& placed, const SurfelBlock& b) {
    const SurfelLevel& level = placed.level;
    const View& view = context_.view;
    const Affine& to_camera = placed.frame.camera_from_object;
    const Vec3 base(to_camera.point(DVec3(b.bounds.min)));
    const DVec3 step(SurfelLevel::step(b));
    const Vec3 dx(to_camera.linear[0] * step.x), dy(to_camera.linear[1] * step.y),
        dz(to_camera.linear[2] * step.z);
    const int n = int(b.count);
    const uint32_t* __restrict packed = level.position.data() + b.first;
    const float z_near = view.near_z, z_far = view.far_z;
    PointBlock& out = block_;
    out.count = n;
    out.is_prebuilt = true;
    for (int i = 0; i < n; ++i) {
        const float u = float(int(positionPart(packed[i], 0))),
                    v = float(int(positionPart(packed[i], 1))),
                    w = float(int(positionPart(packed[i], 2)));
        out.x[i] = base.x + dx.x * u + dy.x * v + dz.x * w;
        out.y[i] = base.y + dx.y * u + dy.y * v + dz.y * w;
        const float z = base.z + dx.z * u + dy.z * v + dz.z * w;
        out.z[i] = z;
        out.keep[i] = uint8_t((z > z_near) & (z <= z_far));
    }
    const uint32_t number = addRun(placed, b.first, false);
    for (int i = 0; i < n; ++i) out.number[i] = number + uint32_t(i);
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

// Squares that stand for discs, two triangles each.
void SurfelPoints::drawDiscs(const Placed& placed, const SurfelBlock& b) {
    const SurfelLevel& level = placed.level;
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
            const Surfel s = unpackSurfel(level, b, k);
            const Vec3 center(to_camera.point(DVec3(s.position)));
            const Vec3 other = std::abs(s.normal.x) < 0.7f ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
            const float half = 0.5f * placed.model.discSide() * level.spacing * s.radius_share;
            const Vec3 a_object = glm::normalize(glm::cross(s.normal, other)) * half;
            const Vec3 a = linear * a_object, c = linear * glm::cross(s.normal, a_object);
            Vec3 corners[4] = {center - a - c, center + a - c, center + a + c, center + c - a};
            for (const Vec3& corner : corners) {
                // Before the eye, or not at all.
                if (corner.z > view.near_z) continue;
                for (Vec3& q : corners) q = Vec3(0, 0, view.near_z * 2.0f);
                break;
            }
            for (const int t : {0, 1}) {
                const int i = out.count++;
                const Vec3 vertices[3] = {corners[0], corners[1 + t], corners[2 + t]};
                for (int m = 0; m < 3; ++m) {
                    out.x[m][i] = vertices[m].x;
                    out.y[m][i] = vertices[m].y;
                    out.z[m][i] = vertices[m].z;
                }
            }
            const float width = placed.model.finishes[s.finish].patch_width * placed.length_scale *
                                float(view.focal);
            out.is_wide =
                out.is_wide || width >= kSurfaceWidth * (view.orthographic ? 1.0f : center.z);
        }
        out.first_number = addRun(placed, first, true) | kTriangleBit;
        if (!context_.sink->take(out)) context_.runs.pop_back();
    }
}

void surfelAttributes(const Scene& scene, const View& view, const Run& run, uint32_t index,
                      SurfaceSample& sample) {
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
    sample.normal_world =
        glm::normalize(Mat3(glm::transpose(view.camera_from_world)) *
                       (run.camera_from_normal * unpackNormal16(level.normal[index])));
}

}  // namespace stipple
