// SPDX-License-Identifier: Apache-2.0
// `stipple info`: what is in a scene, as text or as JSON.
#include <scenegraph/io/gltf_writer.h>
#include <scenegraph/io/load.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/json_number.h>
#include <tools/output_file.h>
#include <tools/signals.h>

#include <cstdio>
#include <iostream>

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

const HelpText kHelp = {"stipple info SCENE [--json] [--export FILE]",
                        "Prints what is in a scene: instances, unique and expanded triangles, "
                        "memory, groups with their "
                        "depth, cameras, paths and materials; of models of points (.stipple) what "
                        "they are, what they were made from, and how many points they have.",
                        {"stipple info scenes/forest.scene.json", "stipple info tree.glb --json",
                         "stipple info wood.scene.json --export wood.glb"}};

Json boxJson(const DBox3& box) {
    if (box.isEmpty()) return nullptr;
    return {{"min", {box.min.x, box.min.y, box.min.z}}, {"max", {box.max.x, box.max.y, box.max.z}}};
}

// Of a model of points; null for meshes.
Json modelJson(const Scene& scene, const Mesh& mesh) {
    std::vector<const SurfelModel*> models;
    if (mesh.surfels) models.push_back(mesh.surfels.get());
    for (const MeshPatch& patch : mesh.patches) {
        if (patch.surfels != MeshPatch::kNoMesh)
            models.push_back(scene.meshes[patch.surfels].surfels.get());
    }
    if (models.empty() && mesh.patches.empty()) return nullptr;
    size_t surfels = 0, surfels_all_levels = 0, levels = 0;
    float spacing = kInfinity;
    for (const SurfelModel* model : models) {
        surfels += model->levels[0].size();
        for (const SurfelLevel& level : model->levels) surfels_all_levels += level.size();
        levels = std::max(levels, model->levels.size());
        spacing = std::min(spacing, model->levels[0].spacing);
    }
    Json json = {{"kind", mesh.surfels ? mesh.surfels->kind : "hybrid"},
                 {"source", mesh.surfels ? mesh.surfels->source : mesh.patches_source},
                 {"surfels", surfels},
                 {"surfels_all_levels", surfels_all_levels},
                 {"levels", levels},
                 {"spacing", models.empty() ? Json() : Json(spacing)}};
    if (!mesh.surfels) json["patches"] = mesh.patches.size();
    return json;
}

Json infoJson(const Scene& scene, const std::vector<std::string>& warnings) {
    const SceneSize size = sceneSize(scene);
    Json json = {{"schema", 1},
                 {"version", STIPPLE_VERSION},
                 {"path", scene.path},
                 {"instances", jsonCount(size.instances)},
                 {"instances_stored", jsonCount(size.stored_instances)},
                 {"triangles_unique", jsonCount(size.triangles_unique)},
                 {"triangles_total", jsonCount(size.triangles_total)},
                 {"bytes", size.bytes},
                 {"instance_bytes", size.instance_bytes},
                 {"bounds", boxJson(sceneBounds(scene))}};
    json["groups"] = Json::array();
    for (const Group& group : scene.groups) {
        json["groups"].push_back({{"name", group.name},
                                  {"root", &group == &scene.groups[scene.root]},
                                  {"depth", group.depth},
                                  {"instances_stored", group.nodes[0].count},
                                  {"instances", jsonCount(group.instances_total)},
                                  {"triangles", jsonCount(group.triangles_total)}});
    }
    json["assets"] = Json::array();
    const std::vector<double> shown = meshInstances(scene);
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        const Mesh& mesh = scene.meshes[i];
        if (mesh.is_patch) continue;
        json["assets"].push_back({{"name", mesh.name},
                                  {"triangles", mesh.triangles.size()},
                                  {"instances", jsonCount(shown[i])},
                                  {"vertices", mesh.positions.size()},
                                  {"bytes", mesh.bytes()}});
        if (const Json model = modelJson(scene, mesh); !model.is_null())
            json["assets"].back()["model"] = model;
    }
    json["cameras"] = Json::array();
    for (const Camera& camera : scene.cameras) json["cameras"].push_back(camera.name);
    json["paths"] = Json::array();
    for (const CameraPath& p : scene.paths) json["paths"].push_back(p.name);
    json["materials"] = Json::array();
    for (const Material& material : scene.materials) json["materials"].push_back(material.name);
    json["textures"] = scene.textures.size();
    json["warnings"] = warnings;
    return json;
}

// 1,234,567; three digits and a power of ten from 10^15 on.
std::string groupedDigits(double count) {
    char text[64];
    if (count >= 1e15) {
        std::snprintf(text, sizeof text, "%.3g", count);
        return text;
    }
    std::snprintf(text, sizeof text, "%.0f", count);
    std::string result = text;
    for (int i = int(result.size()) - 3; i > 0; i -= 3) result.insert(size_t(i), ",");
    return result;
}

// "1 group", "1,025 groups"
std::string counted(double count, const std::string& noun, const std::string& plural = "") {
    return groupedDigits(count) + " " +
           (count == 1.0     ? noun
            : plural.empty() ? noun + "s"
                             : plural);
}

std::string byteSize(double bytes) {
    char text[64];
    std::snprintf(text, sizeof text, bytes < 1e6 ? "%.1f kB" : "%.1f MB",
                  bytes / (bytes < 1e6 ? 1e3 : 1e6));
    return text;
}

std::string joinNames(const Json& names) {
    constexpr size_t kMostNames = 20;
    std::string text = std::to_string(names.size());
    size_t n_named = 0, n_unnamed = 0;
    for (const Json& name : names) {
        if (name.get<std::string>().empty()) {
            ++n_unnamed;
        } else if (n_named++ < kMostNames) {
            text += (n_named == 1 ? ": " : ", ") + name.get<std::string>();
        }
    }
    if (n_named > kMostNames) text += ", ...";
    if (n_unnamed == 0) return text;
    return text + (n_named == 0 ? ", unnamed" : ", " + std::to_string(n_unnamed) + " unnamed");
}

// "splats of scan.ply, 2,518 at 1 level, 0.003 m apart; 10,072 triangles stand for them"
std::string modelLine(const Json& model, const std::string& triangles) {
    const std::string kind = model["kind"], source = model["source"];
    std::string text = kind + (source.empty() ? "" : " of " + source) + ", ";
    if (model.contains("patches")) text += counted(model["patches"], "patch", "patches") + ", ";
    text += counted(model["surfels"], kind == "splats" ? "splat" : "point");
    if (!model["spacing"].is_null()) {
        char spacing[32];
        std::snprintf(spacing, sizeof spacing, "%.3g", model["spacing"].get<double>());
        text += " (" + counted(model["levels"], "level") + ", the finest " + spacing + " m apart)";
    }
    return text +
           (kind == "hybrid" ? ", " + triangles : "; far away " + triangles + " stand for it");
}

void printInfo(const Json& info) {
    std::ostream& out = std::cout;
    out << "scene       " << info["path"].get<std::string>() << "\n"
        << "instances   " << groupedDigits(info["instances"]) << " ("
        << counted(info["instances_stored"], "record") << " in "
        << counted(double(info["groups"].size()), "group") << ")\n"
        << "triangles   " << groupedDigits(info["triangles_unique"]) << " unique, "
        << groupedDigits(info["triangles_total"]) << " expanded\n"
        << "memory      " << byteSize(info["bytes"]) << ", of that "
        << byteSize(info["instance_bytes"]) << " for instances\n"
        << "cameras     " << joinNames(info["cameras"]) << "\n"
        << "paths       " << joinNames(info["paths"]) << "\n"
        << "materials   " << joinNames(info["materials"]) << "\n"
        << "textures    " << info["textures"] << "\n";
    out << "groups\n";
    for (const Json& group : info["groups"]) {
        out << "  " << group["name"].get<std::string>() << ": depth " << group["depth"] << ", "
            << counted(group["instances"], "instance") << " ("
            << counted(group["instances_stored"], "record") << "), "
            << counted(group["triangles"], "triangle") << (group["root"] ? ", root" : "") << "\n";
    }
    out << "assets\n";
    for (const Json& asset : info["assets"]) {
        const std::string triangles = counted(asset["triangles"], "triangle");
        out << "  " << asset["name"].get<std::string>() << ": "
            << (asset.contains("model") ? modelLine(asset["model"], triangles) : triangles) << ", "
            << counted(asset["instances"], "instance") << ", " << byteSize(asset["bytes"]) << "\n";
    }
}

}  // namespace

ExitCode runInfo(const std::vector<std::string>& arguments) {
    CLI::App app;
    std::string path;
    LoadOptions load_options;
    bool as_json = false;
    std::string export_path;
    app.add_option("SCENE", path, kSceneFiles)->required()->group("Arguments");
    app.add_flag("--json", as_json, "print JSON");
    app.add_option("--export", export_path,
                   "write the scene as glTF too (.glb or .gltf): groups flattened, up to 10^7 "
                   "instances")
        ->type_name("FILE");
    app.add_flag("--allow-outside", load_options.allow_outside,
                 "let the scene's paths leave its folder");
    app.add_option("--memory-limit", load_options.memory_limit_mb,
                   "most memory that loading may take, in MB (default: the machine's)")
        ->type_name("MB");
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;

    if (!export_path.empty()) checkOutputFile("--export", export_path, {".glb", ".gltf"});
    const CancelFlag& cancel = cancelOnSignals();
    load_options.cancel = &cancel;
    Diagnostics diagnostics;
    ThreadPool pool;
    const Scene scene = loadScene(path, load_options, pool, diagnostics);
    throwIfCancelled(cancel);
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);
    if (!export_path.empty()) {
        for (const Mesh& mesh : scene.meshes) {
            if (mesh.surfels && !mesh.is_patch)
                printMessage("warning: " + mesh.name +
                             ": a model of points, of which the mesh that stands for it far away "
                             "is written");
        }
        saveSceneGltf(export_path, scene);
    }
    const Json info = infoJson(scene, diagnostics.warnings);
    if (as_json) {
        std::cout << info.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
    } else {
        printInfo(info);
    }
    return ExitCode::kDone;
}

}  // namespace stipple
