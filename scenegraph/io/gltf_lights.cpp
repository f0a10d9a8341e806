// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/gltf_lights.h>
#include <scenegraph/io/transform.h>

namespace stipple {

void addGltfLight(const GltfDocument& document, const tinygltf::Value& extension,
                  const Affine& world_from_node, const std::string& path, Lighting& lighting) {
    const int index = extension.Get("light").GetNumberAsInt();
    document.checkIndex(index, document.model.lights.size(), path + ".light", "lights");
    const tinygltf::Light& source = document.model.lights[index];
    const std::string light_path =
        "extensions.KHR_lights_punctual.lights[" + std::to_string(index) + "]";
    const Vec3 color = source.color.size() == 3
                           ? Vec3(source.color[0], source.color[1], source.color[2])
                           : Vec3(1.0f);
    const Vec3 strength = color * float(source.intensity);
    // Lights shine along -z.
    const DVec3 backwards = world_from_node.linear[2];
    const auto axis = [&] {
        if (!(glm::length(backwards) > 1e-30))
            document.fail(ErrorCode::kInvalidScene, path, "the light has no direction");
        return Vec3(glm::normalize(backwards));
    };
    if (source.type == "directional") {
        lighting.suns.push_back({axis(), strength});
        return;
    }
    if (source.type != "point" && source.type != "spot") {
        document.fail(ErrorCode::kInvalidScene, light_path + ".type",
                      inQuotes(source.type) + " is none of directional, point, spot");
    }
    PointLight light;
    light.position = world_from_node.translation;
    light.intensity = strength;
    light.range = float(source.range);
    if (source.type == "spot") {
        light.is_spot = true;
        light.axis = -axis();
        light.inner_cone = float(source.spot.innerConeAngle);
        light.outer_cone = float(source.spot.outerConeAngle);
        // (The default of pi / 4 is written with fewer digits than a float holds.)
        if (!(light.inner_cone >= 0.0f && light.inner_cone < light.outer_cone &&
              light.outer_cone <= float(0.5 * kPi) + 1e-6f)) {
            document.fail(ErrorCode::kInvalidScene, light_path + ".spot",
                          "the cone's angles must satisfy 0 <= inner < outer <= pi / 2");
        }
    }
    lighting.points.push_back(light);
}

}  // namespace stipple
