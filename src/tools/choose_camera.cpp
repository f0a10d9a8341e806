// SPDX-License-Identifier: Apache-2.0
#include <tools/choose_camera.h>

namespace stipple {

const Camera& chooseCamera(const Scene& scene, const std::string& name, const std::string& where) {
    if (scene.cameras.empty()) throw Error(ErrorCode::kInvalidScene, scene.path, "has no camera");
    if (name.empty()) return scene.cameras.front();
    if (const Camera* camera = scene.findCamera(name)) return *camera;
    std::string known;
    for (const Camera& camera : scene.cameras) known += (known.empty() ? "" : ", ") + camera.name;
    throw Error(ErrorCode::kInvalidArgument, where,
                "there is no '" + name + "'; " + scene.path + " has: " + known);
}

}  // namespace stipple
