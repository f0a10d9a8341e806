// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/model.h>
#include <scenegraph/io/scene_reader.h>

namespace stipple {

namespace {

ChildRef loadFile(SceneReader& reader, const Json& asset, const JsonPath& path) {
    JsonPath file_path = path;
    file_path.push_back("file");
    const std::string& file = asset["file"].get_ref<const std::string&>();
    const std::filesystem::path full =
        resolvePath(reader.context, reader.folder, file, reader.where(file_path));
    if (!isModelFile(full)) {
        throw Error(ErrorCode::kUnsupported, reader.where(file_path),
                    inQuotes(file) + " is no model (" + kModelExtensions + ")");
    }
    if (const auto it = reader.files.find(full.string()); it != reader.files.end())
        return it->second;
    // Cameras and lights of an asset that stands in many places mean nothing.
    const size_t n_cameras = reader.scene.cameras.size(),
                 n_suns = reader.scene.lighting.suns.size();
    const ChildRef child = loadModel(full, file, reader.scene, reader.context);
    reader.scene.cameras.resize(n_cameras);
    reader.scene.lighting.suns.resize(n_suns);
    return reader.files[full.string()] = child;
}

GeneratedMesh generate(SceneReader& reader, const std::string& name, const Json& asset,
                       const JsonPath& path) {
    const std::string kind = asset["generate"].get<std::string>();
    const auto takeTriangles = [&](double triangles) {
        // Leaves and blades share few vertices: two for each triangle.
        reader.context.budget.take(triangles * (kBytesPerTriangle + 2.0 * kBytesPerVertex),
                                   reader.where(path),
                                   std::to_string(uint64_t(triangles)) + " triangles");
    };
    if (kind == "tree") {
        TreeParams p;
        readMember(asset, "species", p.species);
        readMember(asset, "seed", p.seed);
        readMember(asset, "height", p.height);
        readMember(asset, "triangles", p.triangles);
        takeTriangles(p.triangles);
        return makeTree(p);
    }
    if (kind == "grass") {
        GrassParams p;
        readMember(asset, "seed", p.seed);
        readMember(asset, "height", p.height);
        readMember(asset, "radius", p.radius);
        readMember(asset, "blades", p.blades);
        constexpr double kMostTrianglesPerBlade = 16.0;
        takeTriangles(p.blades * kMostTrianglesPerBlade);
        return makeGrass(p);
    }
    if (kind == "rock") {
        RockParams p;
        readMember(asset, "seed", p.seed);
        readMember(asset, "radius", p.radius);
        readMember(asset, "subdivisions", p.subdivisions);
        takeTriangles(20.0 * std::pow(4.0, p.subdivisions));
        return makeRock(p);
    }
    if (kind == "terrain") {
        TerrainParams p;
        readMember(asset, "seed", p.seed);
        readMember(asset, "size", p.size);
        readMember(asset, "resolution", p.resolution);
        readMember(asset, "relief", p.relief);
        readMember(asset, "feature_size", p.feature_size);
        readMember(asset, "style", p.style);
        takeTriangles(2.0 * (p.resolution - 1.0) * (p.resolution - 1.0));
        Terrain& terrain = reader.terrains[name];
        terrain = {makeHeightField(p), p.size};
        return makeTerrain(p, terrain.field);
    }
    int triangles = 1000;
    Vec3 color(0.8f);
    readMember(asset, "triangles", triangles);
    readVector(asset, "color", color);
    takeTriangles(triangles);
    return makePrimitive(kind, triangles, color);
}

ChildRef addGenerated(SceneReader& reader, const std::string& name, GeneratedMesh generated,
                      const JsonPath& path) {
    generated.mesh.name = oneLine(name);
    return addModel(reader.scene, std::move(generated.mesh), std::move(generated.materials),
                    reader.where(path));
}

}  // namespace

void readAsset(SceneReader& reader, const std::string& name, const Json& asset) {
    const JsonPath path = {"assets", name};
    if (asset.contains("file")) {
        reader.children[name] = loadFile(reader, asset, path);
        return;
    }
    GeneratedMesh generated =
        withPlace(reader, path, [&] { return generate(reader, name, asset, path); });
    reader.children[name] = addGenerated(reader, name, std::move(generated), path);
}

}  // namespace stipple
