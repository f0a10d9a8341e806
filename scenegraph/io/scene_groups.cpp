// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/instance_buffer.h>
#include <scenegraph/io/instance_json.h>
#include <scenegraph/io/number_picture.h>
#include <scenegraph/io/scene_reader.h>
#include <scenegraph/io/schemas.h>

#include <deque>
#include <functional>
#include <limits>
#include <optional>

namespace stipple {

namespace {

// The box of the translations, as far as they can be read; what is wrong is found by
// addInstances().
DBox3 instancesDomain(const Json& instances) {
    DBox3 box;
    for (const Json& source : instances) {
        DVec3 p(0);
        double matrix[16];
        if (source.is_object()) {
            if (const auto it = source.find("translation"); it != source.end())
                readNumbers(*it, 3, kMaxInstanceLength, &p.x);
            if (const auto it = source.find("matrix");
                it != source.end() && readNumbers(*it, 16, kMaxInstanceLength, matrix)) {
                p = DVec3(matrix[12], matrix[13], matrix[14]);
            }
        }
        box.extend(p);
    }
    return box;
}

void addInstances(SceneReader& reader, const Json& instances, InstanceStore& store,
                  const JsonPath& group_path) {
    size_t i = 0;
    for (const Json& source : instances) {
        if (i % 65536 == 0) reader.context.throwIfCancelled();
        JsonInstance instance;
        const auto path = [&] { return joined(group_path, {"instances", std::to_string(i)}); };
        if (!readInstance(source, instance)) {
            static const JsonSchema schema(kSceneSchemaText, "instance");
            const auto problem = schema.firstProblem(source);
            JsonPath full = path();
            if (!problem) reader.fail(full, "is not an instance");
            full.insert(full.end(), problem->path.begin(), problem->path.end());
            reader.fail(full, problem->message);
        }
        const auto child = reader.children.find(*instance.child);
        if (child == reader.children.end())
            reader.child(*instance.child, joined(path(), {"child"}));  // throws
        Affine transform;
        if (const char* problem = makeTransform(instance, transform)) reader.fail(path(), problem);
        store.add(child->second, transform);
        ++i;
    }
}

template <class T>
void checkOrder(const SceneReader& reader, const T& low, const T& high, const char* what,
                const JsonPath& path) {
    if (low > high) reader.fail(path, std::string("min_") + what + " > max_" + what);
}

// A scatter rule with all that it refers to.
struct ScatterRule {
    ScatterParams params;
    ScatterSurface surface;
    std::optional<TriangleSurface> triangles;
    std::optional<DensityMap> density;
};

// The triangles of an asset: a mesh, or the meshes of a file's nodes.
TriangleSurface assetTriangles(SceneReader& reader, ChildRef asset, const JsonPath& path) {
    std::vector<SurfacePart> parts;
    double n_triangles = 0.0;
    const std::function<void(ChildRef, const Affine&)> add = [&](ChildRef child,
                                                                 const Affine& asset_from_child) {
        if (!child.isGroup()) {
            const Mesh& mesh = reader.scene.meshes[child.index()];
            parts.push_back({&mesh, asset_from_child});
            n_triangles += double(mesh.triangles.size());
            return;
        }
        const InstanceStore& nodes = reader.scene.groups[child.index()].instances;
        for (size_t i = 0; i < nodes.size(); ++i)
            add(nodes.child(i), asset_from_child * nodes.groupFromChild(i));
    };
    add(asset, Affine());
    reader.context.budget.require(n_triangles * sizeof(double), reader.where(path),
                                  "the areas of its triangles");
    return TriangleSurface(std::move(parts));
}

DensityMap readDensityMap(SceneReader& reader, const Json& file, const JsonPath& path) {
    const NumberPicture picture =
        readNumberPicture(reader.file(file, path), reader.context.budget, reader.where(path));
    DensityMap map{picture.width, picture.height, {}};
    map.values.reserve(size_t(picture.width) * size_t(picture.height));
    for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) {
            const float value = picture.at(x, y, 0);
            map.values.push_back(value > 0.0f ? std::min(value, 1.0f) : 0.0f);
        }
    }
    return map;
}

void readScatter(SceneReader& reader, const Json& source, const JsonPath& path, ScatterRule& rule) {
    ScatterParams& p = rule.params;
    if (source.contains("on")) {
        const JsonPath on_path = joined(path, {"on"});
        const std::string& on = source["on"].get_ref<const std::string&>();
        const ChildRef asset = reader.child(on, on_path);
        if (reader.groups.contains(on)) reader.fail(on_path, "is a group; scatter takes an asset");
        if (const auto it = reader.terrains.find(on); it != reader.terrains.end()) {
            rule.surface.field = &it->second;
            p.size = it->second.size;
        } else {
            rule.triangles.emplace(assetTriangles(reader, asset, on_path));
            rule.surface.triangles = &*rule.triangles;
            for (const char* key : {"size", "center"}) {
                if (source.contains(key)) {
                    reader.fail(joined(path, {key}), std::string("has no meaning on ") +
                                                         inQuotes(on) + ", which is no terrain");
                }
            }
        }
    }
    for (size_t i = 0; i < source["items"].size(); ++i) {
        const Json& item = source["items"][i];
        ScatterItem result;
        result.child = reader.child(item["child"].get<std::string>(),
                                    joined(path, {"items", std::to_string(i), "child"}));
        readMember(item, "weight", result.weight);
        p.items.push_back(result);
    }
    readMember(source, "spacing", p.spacing);
    constexpr uint64_t kMostSpaced = uint64_t(1) << 27;
    if (p.spacing > 0.0) p.count = kMostSpaced;  // as many as find room
    readMember(source, "count", p.count);
    if (source.contains("size")) p.size = DVec2(source["size"].get<double>());
    readVector(source, "center", p.center);
    readDegrees(source, "min_slope", p.min_slope);
    readDegrees(source, "max_slope", p.max_slope);
    readMember(source, "min_height", p.min_height);
    readMember(source, "max_height", p.max_height);
    readMember(source, "min_scale", p.min_scale);
    readMember(source, "max_scale", p.max_scale);
    readDegrees(source, "tilt", p.tilt);
    readMember(source, "align", p.align);
    readMember(source, "sink", p.sink);
    readMember(source, "clustering", p.clustering);
    readMember(source, "seed", p.seed);
    checkOrder(reader, p.min_slope, p.max_slope, "slope", path);
    checkOrder(reader, p.min_height, p.max_height, "height", path);
    checkOrder(reader, p.min_scale, p.max_scale, "scale", path);
    if (const auto file = source.find("density_map"); file != source.end()) {
        rule.density.emplace(readDensityMap(reader, *file, joined(path, {"density_map"})));
        p.density = &*rule.density;
    }
    constexpr double kBytesPerTry = 160.0;  // a place, twice while they are joined
    if (p.spacing > 0.0) {
        reader.context.budget.require(kBytesPerTry * scatterTries(p, rule.surface),
                                      reader.where(path), "places that keep their distance");
    }
}

GridParams readGrid(const SceneReader& reader, const Json& source, const JsonPath& path) {
    GridParams p;
    p.child = reader.child(source["child"].get<std::string>(), joined(path, {"child"}));
    readMember(source, "count_x", p.count_x);
    readMember(source, "count_z", p.count_z);
    readMember(source, "spacing_x", p.spacing_x);
    readMember(source, "spacing_z", p.spacing_z);
    readMember(source, "jitter", p.jitter);
    readMember(source, "quarter_turns", p.quarter_turns);
    readMember(source, "any_turn", p.any_turn);
    readMember(source, "min_scale", p.min_scale);
    readMember(source, "max_scale", p.max_scale);
    readMember(source, "hill_height", p.hill_height);
    readMember(source, "hill_size", p.hill_size);
    readMember(source, "seed", p.seed);
    checkOrder(reader, p.min_scale, p.max_scale, "scale", path);
    return p;
}

}  // namespace

void readGroup(SceneReader& reader, uint32_t index, const Json& group, const Json& instances) {
    const std::string& name = reader.scene.groups[index].name;
    const JsonPath path = {"groups", name};
    DBox3 domain = instancesDomain(instances);
    double total = double(instances.size());
    const auto count = [&](double n, const JsonPath& place) {
        reader.context.budget.take(n * kBytesPerInstance, reader.where(place),
                                   std::to_string(uint64_t(n)) + " instances");
        total += n;
        if (total > double(std::numeric_limits<uint32_t>::max())) {
            throw Error(ErrorCode::kUnsupported, reader.where(place),
                        "more than 2^32 instances in one group; nest groups instead");
        }
    };
    reader.context.budget.take(total * kBytesPerInstance, reader.where(path),
                               std::to_string(instances.size()) + " instances");
    const JsonPath buffer_path = joined(path, {"buffer"}), scatter_path = joined(path, {"scatter"}),
                   grid_path = joined(path, {"grid"});
    std::optional<InstanceBuffer> buffer;
    if (group.contains("buffer")) {
        buffer.emplace(reader, group["buffer"], buffer_path);
        count(double(buffer->size()), buffer_path);
        domain.extend(buffer->domain());
    }
    // One rule or a list; in place, as a rule's parameters point into it.
    std::deque<ScatterRule> rules;
    std::vector<JsonPath> rule_paths;
    if (const auto source = group.find("scatter"); source != group.end()) {
        for (size_t i = 0; i < (source->is_array() ? source->size() : 1); ++i) {
            const JsonPath& place = rule_paths.emplace_back(
                source->is_array() ? joined(scatter_path, {std::to_string(i)}) : scatter_path);
            ScatterRule& rule = rules.emplace_back();
            readScatter(reader, source->is_array() ? (*source)[i] : *source, place, rule);
            count(scatterMost(rule.params, rule.surface), place);
            domain.extend(
                withPlace(reader, place, [&] { return scatterDomain(rule.params, rule.surface); }));
        }
    }
    std::optional<GridParams> grid;
    if (group.contains("grid")) {
        grid = readGrid(reader, group["grid"], grid_path);
        count(double(grid->count_x) * double(grid->count_z), grid_path);
        domain.extend(withPlace(reader, grid_path, [&] { return gridDomain(*grid); }));
    }
    if (domain.isEmpty()) domain = DBox3{DVec3(-1), DVec3(1)};

    InstanceStore store(domain);
    if (std::all_of(rules.begin(), rules.end(),
                    [](const ScatterRule& rule) { return rule.params.spacing == 0.0; })) {
        store.reserve(size_t(total));
    }
    addInstances(reader, instances, store, path);
    if (buffer) buffer->addTo(store);
    reader.context.throwIfCancelled();
    for (size_t i = 0; i < rules.size(); ++i) {
        const size_t before = store.size();
        withPlace(reader, rule_paths[i],
                  [&] { scatter(rules[i].params, rules[i].surface, reader.pool, store); });
        if (store.size() == before && rules[i].params.count > 0)
            reader.context.warnOnce(reader.where(rule_paths[i]), "nothing found a place");
        reader.context.throwIfCancelled();
    }
    if (grid) withPlace(reader, grid_path, [&] { placeGrid(*grid, reader.pool, store); });
    reader.scene.groups[index].ruled_count = uint32_t(store.size());
    reader.scene.groups[index].instances = std::move(store);
}

}  // namespace stipple
