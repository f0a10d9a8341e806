// SPDX-License-Identifier: Apache-2.0
#include <sampling/triangle_writer.h>

#include <core/rng.h>
#include <sampling/point_attributes.h>
#include <scenegraph/object_id.h>
#include <scenegraph/surface_at.h>

namespace stipple {

namespace {

// Barycentrics (u, v) of the ray's intersection with the triangle's plane, clamped to the triangle.
Vec2 intersectPlane(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& origin,
                    const Vec3& direction) {
    const Vec3 e1 = b - a, e2 = c - a, p = glm::cross(direction, e2), s = origin - a,
               q = glm::cross(s, e1);
    const float determinant = glm::dot(e1, p);
    const float inverse = determinant != 0.0f ? 1.0f / determinant : 0.0f;
    const float u = std::clamp(glm::dot(s, p) * inverse, 0.0f, 1.0f);
    return {u, std::clamp(glm::dot(direction, q) * inverse, 0.0f, 1.0f - u)};
}

}  // namespace

void triangleAttributes(const Scene& scene, const View& view, const InstanceFrame& frame,
                        uint32_t mesh_index, uint32_t triangle, float sub_x, float sub_y,
                        SurfaceSample& sample) {
    const Mesh& mesh = scene.meshes[mesh_index];
    const UVec3& t = mesh.triangles[triangle];
    const Mat3 linear(frame.camera_from_object.linear);
    const Vec3 translation(frame.camera_from_object.translation);
    Vec3 origin, direction;
    view.ray(sub_x, sub_y, origin, direction);
    const Vec2 uv = intersectPlane(linear * mesh.positions[t.x] + translation,
                                   linear * mesh.positions[t.y] + translation,
                                   linear * mesh.positions[t.z] + translation, origin, direction);
    const MeshSurface surface =
        surfaceAt(mesh, scene.materials, scene.textures, triangle, uv.x, uv.y,
                  sampleBeam(view, sub_x, sub_y, sample, float(std::sqrt(frame.area_scale)),
                             frame.camera_from_normal));
    sample.normal_world =
        glm::normalize(view.world_from_camera * (frame.camera_from_normal * surface.normal_object));
    sample.albedo = surface.albedo;
    sample.finish = surface.finish;
    sample.material = mesh.triangle_material[triangle];
    sample.alpha =
        scene.materials[sample.material].alpha_mode == AlphaMode::kBlend ? surface.alpha : 1.0f;
    sample.patch_width = mesh.strata[mesh.triangle_stratum[triangle]].patch_width *
                         float(std::sqrt(frame.area_scale));
    sample.shadow_slack = 0.0f;
    sample.object = objectId(frame.path);
}

// Alpha at a place on a triangle of the block.
class TriangleWriter::Mask : public MaskTest {
public:
    Mask(const TileContext& context, const Run& run, const TriangleBlock& block)
        : context_(context), run_(run), block_(block) {}
    bool isSurface(int triangle, float sub_x, float sub_y) const override {
        const Material& material = materialOf(triangle);
        if (material.alpha_mode == AlphaMode::kOpaque) return true;
        const float alpha = this->alpha(triangle, sub_x, sub_y);
        if (material.alpha_mode == AlphaMode::kMask) return alpha >= material.alpha_cutoff;
        if (context_.sink->wantsLayers()) return alpha >= kOpaqueAlpha;
        const uint64_t place = hashCombine(run_.path, run_.first_index + uint32_t(triangle),
                                           uint64_t(int64_t(sub_x)), uint64_t(int64_t(sub_y)));
        return uniformFloat(hashCombine(context_.settings.seed, place)) < alpha;
    }
    float alpha(int triangle, float sub_x, float sub_y) const override {
        Vec3 origin, direction;
        context_.view.ray(sub_x, sub_y, origin, direction);
        const Vec2 uv = intersectPlane(block_.vertex(0, triangle), block_.vertex(1, triangle),
                                       block_.vertex(2, triangle), origin, direction);
        const Scene& scene = context_.scene;
        return alphaAt(mesh(), scene.materials, scene.textures,
                       run_.first_index + uint32_t(triangle), uv.x, uv.y);
    }

private:
    const Mesh& mesh() const { return context_.scene.meshes[run_.child.index()]; }
    const Material& materialOf(int triangle) const {
        const uint32_t t = run_.first_index + uint32_t(triangle);
        return context_.scene.materials[mesh().triangle_material[t]];
    }

    const TileContext& context_;
    const Run& run_;
    const TriangleBlock& block_;
};

void TriangleWriter::add(uint32_t mesh_index, uint32_t node_index, uint32_t triangle_frame) {
    const InstanceFrame& frame = context_.frames[triangle_frame];
    const Mesh& mesh = context_.scene.meshes[mesh_index];
    const MeshNode& node = mesh.nodes[node_index];
    const Stratum& stratum = mesh.strata[node.stratum];
    const Mat3 linear(frame.camera_from_object.linear);
    const Vec3 translation(frame.camera_from_object.translation);
    block_.is_wide = isWide(frame, node, stratum);
    for (uint32_t first = 0; first < node.triangle_count; first += kBlockPoints) {
        TriangleBlock& block = block_;
        block.count = int(std::min<uint32_t>(kBlockPoints, node.triangle_count - first));
        block.first_number = context_.nextNumber() | kTriangleBit;
        block.blended = 0;
        block.is_clear = stratum.blended && context_.sink->wantsLayers();
        for (int i = 0; i < block.count; ++i) {
            const UVec3& t = mesh.triangles[node.first_triangle + first + uint32_t(i)];
            for (int k = 0; k < 3; ++k) {
                const Vec3 p = linear * mesh.positions[t[k]] + translation;
                block.x[k][i] = p.x, block.y[k][i] = p.y, block.z[k][i] = p.z;
            }
            // Textures and vertices' colours make it no more opaque.
            const uint16_t material =
                mesh.triangle_material[node.first_triangle + first + uint32_t(i)];
            block.is_clear &= context_.scene.materials[material].alpha < kOpaqueAlpha;
        }
        if (stratum.blended && context_.sink->wantsLayers()) {
            // A stratum's triangles are all blended.
            block.blended = ~uint64_t(0) >> (kBlockPoints - block.count);
        }
        Run run;
        run.child = ChildRef::mesh(mesh_index);
        run.first_index = node.first_triangle + first;
        run.frame = triangle_frame;
        run.path = frame.path;
        context_.runs.push_back(run);
        if (!stratum.double_sided) dropBackFaces(frame, block);
        const Mask mask(context_, run, block);
        block.mask = stratum.masked ? &mask : nullptr;
        if (!context_.sink->take(block)) context_.runs.pop_back();
    }
}

bool TriangleWriter::isWide(const InstanceFrame& frame, const MeshNode& node,
                            const Stratum& stratum) const {
    const View& view = context_.view;
    const float z = view.orthographic
                        ? 1.0f
                        : float(frame.camera_from_object.point(DVec3(node.bounds.center())).z);
    const float width = stratum.patch_width * float(std::sqrt(frame.area_scale));
    return width * float(view.focal) >= kSurfaceWidth * z;
}

// Single-sided triangles seen from behind become degenerate, so that numbers stay in place.
void TriangleWriter::dropBackFaces(const InstanceFrame& frame, TriangleBlock& block) const {
    const bool orthographic = context_.view.orthographic;
    const float sign = glm::determinant(frame.camera_from_object.linear) < 0.0 ? -1.0f : 1.0f;
    for (int i = 0; i < block.count; ++i) {
        const Vec3 a = block.vertex(0, i);
        const Vec3 n = glm::cross(block.vertex(1, i) - a, block.vertex(2, i) - a) * sign;
        if ((orthographic ? n.z : glm::dot(n, a)) < 0.0f) continue;
        for (int k = 1; k < 3; ++k) block.x[k][i] = a.x, block.y[k][i] = a.y, block.z[k][i] = a.z;
    }
}

}  // namespace stipple
