// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/load.h>

#include <scenegraph/io/json.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/scene_file.h>

#include <new>

namespace stipple {

namespace {

Scene loadAsset(const std::string& path, LoadContext& context) {
    Scene scene;
    const ChildRef child = loadModel(std::filesystem::path(path), path, scene, context);
    if (!child.isGroup()) {
        Group group;
        group.name = scene.meshes[child.index()].name;
        group.instances.add(child, Affine());
        scene.groups.push_back(std::move(group));
    }
    scene.root = child.isGroup() ? child.index() : uint32_t(scene.groups.size() - 1);
    if (scene.lighting.suns.empty() && scene.lighting.points.empty()) {
        Sun sun;
        sun.direction_to_light = glm::normalize(sun.direction_to_light);
        scene.lighting.suns.push_back(sun);
    }
    return scene;
}

}  // namespace

Scene loadScene(const std::string& path, const LoadOptions& options, ThreadPool& pool,
                Diagnostics& diagnostics) {
    try {
        LoadContext context(options, diagnostics, folderOf(path), &pool);
        context.throwIfCancelled();
        const bool is_asset = isModelFile(path);
        if (!is_asset && !path.ends_with(".scene.json")) {
            throw Error(ErrorCode::kUnsupported, oneLine(path, 300),
                        std::string("is neither a scene file (*.scene.json) nor a model (") +
                            kModelExtensions + ")");
        }
        Scene scene =
            is_asset ? loadAsset(path, context) : readSceneFile(path, path, context, pool);
        scene.path = path;
        context.throwIfCancelled();
        buildScene(scene, pool);
        const DBox3 bounds = sceneBounds(scene);
        if (bounds.isEmpty()) diagnostics.warn(oneLine(path, 300), "the scene is empty");
        // Single assets always have a camera of that name, before their own.
        if (scene.cameras.empty() || is_asset) {
            Camera camera = bounds.isEmpty() ? Camera() : cameraForBounds(sourceBounds(scene));
            camera.name = "default";
            scene.cameras.insert(scene.cameras.begin(), camera);
        }
        return scene;
    } catch (const Error&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw Error(ErrorCode::kOutOfMemory, oneLine(path, 300),
                    "the machine has not enough memory for it");
    } catch (const std::exception&
                 e) {  // a defect, but no reason to end a program that loads many files
        throw Error(ErrorCode::kInternal, oneLine(path, 300), oneLine(e.what()));
    }
}

}  // namespace stipple
