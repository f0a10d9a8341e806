// SPDX-License-Identifier: Apache-2.0
#include <sampling/point_attributes.h>

#include <core/image.h>
#include <scenegraph/object_id.h>

namespace stipple {

LookupBeam sampleBeam(const View& view, float sub_x, float sub_y, const SurfaceSample& sample,
                      float length_scale, const Mat3& camera_from_normal) {
    Vec3 origin, direction;
    view.ray(sub_x, sub_y, origin, direction);
    // Normals go by the inverse transpose, up to a factor: its transpose takes directions back.
    return {(view.orthographic ? 1.0f : sample.depth) * sample.extent /
                (float(view.focal) * length_scale),
            glm::transpose(camera_from_normal) * direction};
}

void pointAttributes(const Scene& scene, const View& view, const Run& run, const ListBlock& list,
                     int lane, float sub_x, float sub_y, SurfaceSample& sample) {
    sample.material = list.material[lane];
    sample.alpha = float(list.alpha[lane]) / 255.0f;
    sample.patch_width = patchWidth(list.width[lane], kFirstMetreExponent) * run.length_scale;
    sample.shadow_slack = 0.0f;
    const Material& material = scene.materials[sample.material];
    uint64_t path = run.path;
    const Group* group = run.child.isGroup() ? &scene.groups[run.child.index()] : nullptr;
    const uint32_t instance = list.instance[lane];
    const bool is_prefiltered = group && group->depth > 1;
    if (is_prefiltered) {
        path = joinObjectPaths(path, instance, list.levels[lane]);
    } else if (group) {
        path = extendObjectPath(path, group->listed_index[instance]);
    }
    sample.object = objectId(path);

    Vec3 normal_camera;
    if (material.isTextured() && !is_prefiltered) {
        Mat3 camera_from_normal = run.camera_from_normal;
        float length_scale = run.length_scale;
        ChildRef mesh_ref = run.child;
        if (group) {
            mesh_ref = group->instances.child(instance);
            const DMat3 linear = group->instances.groupFromChild(instance).linear;
            const DMat3 area_map = cofactor(linear);
            const double area_scale = std::max(group->instances.areaScale(instance), 1e-30);
            const double side = glm::dot(linear[0], area_map[0]) < 0.0 ? -1.0 : 1.0;
            camera_from_normal = camera_from_normal * Mat3(area_map * (side / area_scale));
            length_scale *= float(std::sqrt(area_scale));
        }
        const Vec2 place = unpackPlace(list.albedo_or_place[lane]);
        const MeshSurface surface =
            surfaceAt(scene.meshes[mesh_ref.index()], scene.materials, scene.textures,
                      list.normal_or_triangle[lane], place.x, place.y,
                      sampleBeam(view, sub_x, sub_y, sample, length_scale, camera_from_normal));
        normal_camera = camera_from_normal * surface.normal_object;
        sample.albedo = surface.albedo;
        sample.finish = surface.finish;
        if (list.alpha[lane] < 255) sample.alpha = surface.alpha;
    } else {
        normal_camera = run.camera_from_normal * unpackOctahedral(list.normal_or_triangle[lane]);
        sample.albedo = unpackSrgb8(list.albedo_or_place[lane]);
        sample.finish = plainFinish(material);
    }
    sample.normal_world = glm::normalize(view.world_from_camera * normal_camera);
}

}  // namespace stipple
