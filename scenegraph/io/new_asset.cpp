// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/new_asset.h>

#include <scenegraph/io/scene_reader.h>
#include <scenegraph/io/schemas.h>

namespace stipple {

namespace {

// "forest.scene.json: /assets/oak/file: reason" to "/file: reason": the asset is not in that file.
[[noreturn]] void rethrowFromAsset(const Error& error, const std::string& prefix) {
    std::string text = error.what();
    if (text.starts_with(prefix)) {
        text.erase(0, prefix.size());
        if (text.starts_with(": ")) text.erase(0, 2);
    }
    throw Error(error.code(), "", text);
}

}  // namespace

NewAsset loadNewAsset(const std::string& scene_path, const std::string& name, const Json& asset,
                      const LoadOptions& options, ThreadPool& pool, Diagnostics& diagnostics) {
    static const JsonSchema schema(kSceneSchemaText, "asset");
    if (const auto problem = schema.firstProblem(asset))
        throw Error(ErrorCode::kInvalidScene, jsonPointer(problem->path), problem->message);
    LoadContext context(options, diagnostics, folderOf(scene_path), &pool);
    SceneReader reader{context, pool, oneLine(scene_path, 300), context.folder, {}, {}, {}, {}, {}};
    const std::string prefix = reader.where({"assets", name});
    try {
        readAssets(reader, {{name, asset}});
        reader.scene.path = prefix;
        buildScene(reader.scene, pool);
    } catch (const Error& error) {
        rethrowFromAsset(error, prefix);
    }
    return {std::move(reader.scene), reader.children.at(name)};
}

}  // namespace stipple
