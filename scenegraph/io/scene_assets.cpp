// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/model.h>
#include <scenegraph/io/number_picture.h>
#include <scenegraph/io/picture.h>
#include <scenegraph/io/scene_reader.h>

#include <exception>
#include <limits>
#include <mutex>
#include <optional>

namespace stipple {

namespace {

// What a file holds, loaded once.
ChildRef loadOnce(SceneReader& reader, const Json& asset, const JsonPath& path) {
    const JsonPath file_path = joined(path, {"file"});
    const std::string& file = asset["file"].get_ref<const std::string&>();
    const std::filesystem::path full = reader.file(asset["file"], file_path);
    if (!isModelFile(full)) {
        throw Error(ErrorCode::kUnsupported, reader.where(file_path),
                    inQuotes(file) + " is no model (" + kModelExtensions + ")");
    }
    if (const auto it = reader.files.find(full.string()); it != reader.files.end())
        return it->second;
    // Cameras and lights of an asset that stands in many places mean nothing.
    const size_t n_cameras = reader.scene.cameras.size(),
                 n_suns = reader.scene.lighting.suns.size(),
                 n_points = reader.scene.lighting.points.size();
    const ChildRef child = loadModel(full, file, reader.scene, reader.context);
    reader.scene.cameras.resize(n_cameras);
    reader.scene.lighting.suns.resize(n_suns);
    reader.scene.lighting.points.resize(n_points);
    return reader.files[full.string()] = child;
}

ChildRef loadFile(SceneReader& reader, const std::string& name, const Json& asset,
                  const JsonPath& path) {
    const ChildRef model = loadOnce(reader, asset, path);
    double scale = 1.0;
    readMember(asset, "scale", scale);
    if (scale == 1.0) return model;
    const ChildRef scaled = addEmptyGroup(reader.scene, oneLine(name));
    reader.scene.groups[scaled.index()].instances.add(model, {DMat3(scale), DVec3(0.0)});
    return scaled;
}

// May run in several threads; `mutex` guards the reader.
GeneratedMesh generate(SceneReader& reader, std::mutex& mutex, const std::string& name,
                       const Json& asset, const JsonPath& path) {
    const std::string kind = asset["generate"].get<std::string>();
    const auto takeTriangles = [&](double triangles) {
        const std::lock_guard lock(mutex);
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
        readMember(asset, "season", p.season);
        takeTriangles(p.triangles);
        return makeTree(p);
    }
    if (kind == "bush") {
        BushParams p;
        readMember(asset, "species", p.species);
        readMember(asset, "seed", p.seed);
        readMember(asset, "height", p.height);
        readMember(asset, "triangles", p.triangles);
        readMember(asset, "season", p.season);
        takeTriangles(p.triangles);
        return makeBush(p);
    }
    if (kind == "deadwood") {
        DeadwoodParams p;
        readMember(asset, "form", p.form);
        readMember(asset, "seed", p.seed);
        readMember(asset, "length", p.length);
        readMember(asset, "triangles", p.triangles);
        takeTriangles(p.triangles);
        return makeDeadwood(p);
    }
    if (kind == "grass") {
        GrassParams p;
        readMember(asset, "seed", p.seed);
        readMember(asset, "height", p.height);
        readMember(asset, "radius", p.radius);
        readMember(asset, "blades", p.blades);
        readMember(asset, "season", p.season);
        constexpr double kMostTrianglesPerBlade = 16.0;
        takeTriangles(p.blades * kMostTrianglesPerBlade);
        return makeGrass(p);
    }
    if (kind == "fern") {
        FernParams p;
        readMember(asset, "seed", p.seed);
        readMember(asset, "height", p.height);
        readMember(asset, "fronds", p.fronds);
        readMember(asset, "season", p.season);
        constexpr double kMostTrianglesPerFrond = 80.0;
        takeTriangles(p.fronds * kMostTrianglesPerFrond);
        return makeFern(p);
    }
    if (kind == "flowers") {
        FlowersParams p;
        readMember(asset, "species", p.species);
        readMember(asset, "seed", p.seed);
        readMember(asset, "height", p.height);
        readMember(asset, "radius", p.radius);
        readMember(asset, "stems", p.stems);
        constexpr double kMostTrianglesPerStem = 70.0;
        takeTriangles(p.stems * kMostTrianglesPerStem);
        return makeFlowers(p);
    }
    if (kind == "litter") {
        LitterParams p;
        readMember(asset, "seed", p.seed);
        readMember(asset, "radius", p.radius);
        readMember(asset, "leaves", p.leaves);
        readMember(asset, "season", p.season);
        takeTriangles(2.0 * p.leaves);
        return makeLitter(p);
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
        readMember(asset, "erosion", p.erosion);
        readMember(asset, "water_level", p.water_level);
        const double surfaces = p.water_level > 0.0 ? 2.0 : 1.0;
        takeTriangles(surfaces * 2.0 * (p.resolution - 1.0) * (p.resolution - 1.0));
        HeightField field = makeHeightField(p);
        GeneratedMesh result = makeTerrain(p, field);
        const std::lock_guard lock(mutex);
        reader.terrains[name] = std::move(field);
        return result;
    }
    if (kind == "mist") {
        MistParams p;
        readMember(asset, "seed", p.seed);
        readMember(asset, "radius", p.radius);
        readMember(asset, "patches", p.patches);
        readMember(asset, "patch", p.patch);
        readMember(asset, "depth", p.depth);
        readVector(asset, "color", p.color);
        takeTriangles(2.0 * p.patches);
        return makeMist(p);
    }
    int triangles = 1000;
    float alpha = 1.0f;
    Vec3 color(0.8f);
    readMember(asset, "alpha", alpha);
    readMember(asset, "triangles", triangles);
    readVector(asset, "color", color);
    takeTriangles(triangles);
    return makePrimitive(kind, triangles, color, alpha);
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
    const JsonPath texture_path = joined(path, {"texture"});
    material.base_texture = addTexture(
        reader.scene, reader.file(source["texture"], texture_path), true, false, reader.context,
        reader.where(texture_path) + ": " +
            inQuotes(source["texture"].get_ref<const std::string&>()));
    Texture& texture = reader.scene.textures[size_t(material.base_texture)];
    texture.wrap_u = texture.wrap_v = Wrap::kClamp;
    return terrain;
}

// Grids are made one after the other, each by all threads.
bool isGrid(const Json& asset) {
    const auto it = asset.find("generate");
    return it != asset.end() && *it == "grid";
}

ChildRef addGenerated(SceneReader& reader, const std::string& name, GeneratedMesh generated,
                      const JsonPath& path) {
    generated.mesh.name = oneLine(name);
    const int first = int(reader.scene.textures.size());
    for (Material& material : generated.materials) {
        if (material.normal_map.texture != kNoTexture) material.normal_map.texture += first;
    }
    for (Texture& texture : generated.textures) reader.scene.textures.push_back(std::move(texture));
    return addModel(reader.scene, std::move(generated.mesh), std::move(generated.materials),
                    reader.where(path));
}

}  // namespace

void readAssets(SceneReader& reader, const Json& assets) {
    struct Job {
        std::string name;
        const Json* asset;
        std::optional<GeneratedMesh> result;  // nothing: from a file
        std::exception_ptr error;
    };
    std::vector<Job> jobs;
    for (const auto& [name, asset] : assets.items()) jobs.push_back({name, &asset, {}, {}});
    std::mutex mutex;
    reader.pool.forEach(jobs.size(), [&](size_t i, int) {
        Job& job = jobs[i];
        if (!job.asset->contains("generate") || isGrid(*job.asset)) return;
        const JsonPath path = {"assets", job.name};
        try {
            reader.context.throwIfCancelled();
            job.result = withPlace(
                reader, path, [&] { return generate(reader, mutex, job.name, *job.asset, path); });
        } catch (...) {  // the first one in order is reported, whatever the number of threads
            job.error = std::current_exception();
        }
    });
    for (Job& job : jobs) {
        if (job.error) std::rethrow_exception(job.error);
        const JsonPath path = {"assets", job.name};
        reader.context.throwIfCancelled();
        if (isGrid(*job.asset)) {
            reader.children[job.name] = withPlace(
                reader, path, [&] { return readGrid(reader, job.name, *job.asset, path); });
            continue;
        }
        if (job.asset->contains("height_map")) {
            job.result = withPlace(
                reader, path, [&] { return heightMapTerrain(reader, job.name, *job.asset, path); });
        }
        reader.children[job.name] =
            job.result ? addGenerated(reader, job.name, std::move(*job.result), path)
                       : loadFile(reader, job.name, *job.asset, path);
        job.result.reset();
    }
}

}  // namespace stipple
