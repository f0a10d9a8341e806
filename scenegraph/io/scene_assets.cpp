// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/gltf.h>
#include <scenegraph/io/number_picture.h>
#include <scenegraph/io/picture.h>
#include <scenegraph/io/scene_reader.h>

#include <limits>

namespace stipple {

namespace {

ChildRef loadFile(SceneReader& reader, const Json& asset, const JsonPath& path) {
    const JsonPath file_path = joined(path, {"file"});
    const std::string& file = asset["file"].get_ref<const std::string&>();
    const std::filesystem::path full = reader.file(asset["file"], file_path);
    std::string extension = full.extension().string();
    for (char& c : extension) c = char(std::tolower(uint8_t(c)));
    if (extension != ".gltf" && extension != ".glb") {
        throw Error(ErrorCode::kUnsupported, reader.where(file_path),
                    inQuotes(file) + " is neither .gltf nor .glb");
    }
    if (const auto it = reader.files.find(full.string()); it != reader.files.end())
        return it->second;
    // Cameras and lights of an asset that stands in many places mean nothing.
    const size_t n_cameras = reader.scene.cameras.size(),
                 n_suns = reader.scene.lighting.suns.size(),
                 n_points = reader.scene.lighting.points.size();
    const ChildRef child = loadGltf(full, file, reader.scene, reader.context);
    reader.scene.cameras.resize(n_cameras);
    reader.scene.lighting.suns.resize(n_suns);
    reader.scene.lighting.points.resize(n_points);
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
        HeightField& field = reader.terrains[name];
        field = makeHeightField(p);
        return makeTerrain(p, field);
    }
    int triangles = 1000;
    Vec3 color(0.8f);
    readMember(asset, "triangles", triangles);
    readVector(asset, "color", color);
    takeTriangles(triangles);
    return makePrimitive(kind, triangles, color);
}

// The heights of a picture's every step-th pixel.
HeightField readHeightMap(SceneReader& reader, const Json& source, const JsonPath& path) {
    const JsonPath file_path = joined(path, {"height_map"});
    const NumberPicture picture = readNumberPicture(reader.file(source["height_map"], file_path),
                                                    reader.context.budget, reader.where(file_path));
    int step = 1;
    readMember(source, "step", step);
    HeightField field;
    field.columns = (picture.width - 1) / step + 1, field.rows = (picture.height - 1) / step + 1;
    if (field.columns < 2 || field.rows < 2)
        reader.fail(path, "a height map needs two pixels along each side at least");
    const double triangles = 2.0 * (field.columns - 1) * (field.rows - 1);
    reader.context.budget.take(triangles * (kBytesPerTriangle + kBytesPerVertex),
                               reader.where(path),
                               std::to_string(uint64_t(triangles)) + " triangles");
    // Pixels stand for heights at their centres; the size spans from the first to the last.
    double spacing = 0.0, low = 0.0, high = picture.is_float ? 1.0 : 0.0;
    readMember(source, "spacing", spacing);
    field.size = spacing * step * DVec2(field.columns - 1, field.rows - 1);
    readMember(source, "low", low);
    readMember(source, "high", high);
    if (!picture.is_float && !source.contains("high"))
        reader.fail(path, "needs \"high\", the height in metres of the whitest pixel");
    field.heights.reserve(size_t(field.columns) * size_t(field.rows));
    for (int j = 0; j < field.rows; ++j) {
        for (int i = 0; i < field.columns; ++i) {
            const double height = low + (high - low) * double(picture.at(i * step, j * step, 0));
            if (!(std::abs(height) <= 1e7)) {
                reader.fail(file_path, "the height at pixel " + std::to_string(i * step) + ", " +
                                           std::to_string(j * step) +
                                           " is not a number within 10^7 metres");
            }
            field.heights.push_back(float(height));
        }
    }
    return field;
}

int addTexture(SceneReader& reader, const Json& file, const JsonPath& path) {
    const std::string where = reader.where(path);
    Texture texture;
    texture.name = oneLine(file.get<std::string>());
    texture.wrap_u = texture.wrap_v = Wrap::kClamp;
    texture.levels.push_back(
        decodePicture(readFile(reader.file(file, path), reader.context.budget, where),
                      reader.context.budget, where));
    reader.context.budget.take(double(texture.levels[0].rgba.size()) * 4.0 / 3.0, where,
                               "the texture's texels");
    buildMipmaps(texture);
    reader.scene.textures.push_back(std::move(texture));
    return int(reader.scene.textures.size()) - 1;
}

// A terrain from a height map, under a picture or coloured by height and slope.
GeneratedMesh heightMapTerrain(SceneReader& reader, const std::string& name, const Json& source,
                               const JsonPath& path) {
    HeightField& field = reader.terrains[name];
    field = readHeightMap(reader, source, path);
    if (!source.contains("texture")) {
        TerrainParams params;
        readMember(source, "style", params.style);
        readMember(source, "seed", params.seed);
        return makeTerrain(params, field);
    }
    if (source.contains("style")) reader.fail(path, "has both texture and style");
    GeneratedMesh terrain;
    terrain.mesh = heightFieldMesh(field);
    Material& material = terrain.materials.emplace_back();
    material.name = "ground";
    material.base_color = Vec3(1.0f);
    material.base_texture = addTexture(reader, source["texture"], joined(path, {"texture"}));
    return terrain;
}

ChildRef addGenerated(SceneReader& reader, const std::string& name, GeneratedMesh generated,
                      const JsonPath& path) {
    Scene& scene = reader.scene;
    const size_t first = scene.materials.size();
    if (first + generated.materials.size() > size_t(std::numeric_limits<uint16_t>::max()) + 1) {
        throw Error(ErrorCode::kUnsupported, reader.where(path),
                    "the scene has more than 65536 materials");
    }
    for (uint16_t& material : generated.mesh.triangle_material)
        material = uint16_t(material + first);
    for (Material& material : generated.materials) scene.materials.push_back(std::move(material));
    generated.mesh.name = oneLine(name);
    scene.meshes.push_back(std::move(generated.mesh));
    return ChildRef::mesh(uint32_t(scene.meshes.size() - 1));
}

}  // namespace

void readAsset(SceneReader& reader, const std::string& name, const Json& asset) {
    const JsonPath path = {"assets", name};
    if (asset.contains("file")) {
        reader.children[name] = loadFile(reader, asset, path);
        return;
    }
    GeneratedMesh generated = withPlace(reader, path, [&] {
        return asset.contains("height_map") ? heightMapTerrain(reader, name, asset, path)
                                            : generate(reader, name, asset, path);
    });
    reader.children[name] = addGenerated(reader, name, std::move(generated), path);
}

}  // namespace stipple
