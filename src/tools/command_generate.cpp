// SPDX-License-Identifier: Apache-2.0
// `stipple generate`: procedural models as .glb, procedural scenes as scene files.
#include <core/image.h>
#include <core/nearest_name.h>
#include <scenegraph/io/gltf_writer.h>
#include <scenegraph/procedural/generators.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/generated_scene.h>
#include <tools/output_file.h>

#include <cmath>
#include <iostream>

namespace stipple {

namespace {

const HelpText kHelp = {
    "stipple generate KIND [--species NAME] [--season NAME] [--count N] [--size M] [--seed N] -o "
    "FILE",
    "Makes a model (tree, bush, deadwood, grass, fern, flowers, litter, rock, terrain), written as "
    ".glb, or a scene (forest, landscape), written as .scene.json, and prints the file's path. The "
    "same arguments give the same file; another --seed gives another one of the kind. A scene file "
    "can also generate these itself, with more parameters: see docs/generators.md.",
    {"stipple generate tree --species birch --season autumn --count 50000 -o birch.glb",
     "stipple generate deadwood --species log -o log.glb && stipple render log.glb -o log.png",
     "stipple generate terrain --species mountain --size 4000 -o mountain.glb",
     "stipple generate landscape --count 1000000000 -o landscape.scene.json"}};

struct GenerateOptions {
    std::string kind;
    std::string output;
    uint64_t count = 0;
    double size = 0.0;  // 0: the kind's own
    uint64_t seed = 1;
    std::string species;  // empty: the kind's first
    std::string season = "summer";
};

struct Kind {
    std::string name;
    bool is_scene;
    bool has_seasons;
    uint64_t default_count;
    uint64_t least_count;
    uint64_t most_count;
    std::vector<std::string> species;
};

const std::vector<Kind> kKinds = {{"tree", false, true, 20000, 1000, 2000000, treeSpecies()},
                                  {"bush", false, true, 6000, 1000, 2000000, bushSpecies()},
                                  {"deadwood", false, false, 4000, 500, 2000000, deadwoodForms()},
                                  {"grass", false, true, 120, 1, 200000, {}},
                                  {"fern", false, true, 11, 1, 10000, {}},
                                  {"flowers", false, false, 24, 1, 200000, flowerSpecies()},
                                  {"litter", false, true, 160, 1, 200000, {}},
                                  {"rock", false, false, 5120, 20, 1310720, {}},
                                  {"terrain", false, false, 524288, 2, 33554432, terrainStyles()},
                                  {"forest", true, false, 100000, 1, 100000000, {}},
                                  {"landscape", true, false, 1000000000, 1, 10000000000000, {}}};

const Kind& findKind(const std::string& name) {
    std::vector<std::string> names;
    for (const Kind& kind : kKinds) {
        if (kind.name == name) return kind;
        names.push_back(kind.name);
    }
    const std::string nearest = nearestName(name, names);
    throw Error(
        ErrorCode::kInvalidArgument, "",
        "cannot generate '" + name + "'" +
            (nearest.empty() ? "; --help lists the kinds" : "; did you mean '" + nearest + "'?"));
}

GeneratedMesh makeModel(const GenerateOptions& options) {
    const int count = int(options.count);
    if (options.kind == "tree") {
        TreeParams tree;
        tree.species = options.species;
        tree.seed = options.seed;
        tree.height = options.size;
        tree.triangles = count;
        tree.season = options.season;
        return makeTree(tree);
    }
    if (options.kind == "bush") {
        BushParams bush;
        bush.species = options.species;
        bush.seed = options.seed;
        bush.height = options.size;
        bush.triangles = count;
        bush.season = options.season;
        return makeBush(bush);
    }
    if (options.kind == "deadwood") {
        DeadwoodParams wood;
        wood.form = options.species;
        wood.seed = options.seed;
        wood.length = options.size;
        wood.triangles = count;
        return makeDeadwood(wood);
    }
    if (options.kind == "grass") {
        GrassParams grass;
        grass.seed = options.seed;
        if (options.size > 0.0) grass.height = options.size;
        grass.blades = count;
        grass.season = options.season;
        return makeGrass(grass);
    }
    if (options.kind == "fern") {
        FernParams fern;
        fern.seed = options.seed;
        if (options.size > 0.0) fern.height = options.size;
        fern.fronds = count;
        fern.season = options.season;
        return makeFern(fern);
    }
    if (options.kind == "flowers") {
        FlowersParams flowers;
        flowers.species = options.species;
        flowers.seed = options.seed;
        flowers.height = options.size;
        flowers.stems = count;
        return makeFlowers(flowers);
    }
    if (options.kind == "litter") {
        LitterParams litter;
        litter.seed = options.seed;
        if (options.size > 0.0) litter.radius = 0.5 * options.size;
        litter.leaves = count;
        litter.season = options.season;
        return makeLitter(litter);
    }
    if (options.kind == "rock") {
        RockParams rock;
        rock.seed = options.seed;
        if (options.size > 0.0) rock.radius = 0.5 * options.size;
        rock.subdivisions = int(std::lround(std::log(count / 20.0) / std::log(4.0)));
        return makeRock(rock);
    }
    TerrainParams terrain;
    terrain.seed = options.seed;
    terrain.style = options.species;
    terrain.erosion = 0.6;
    if (options.size > 0.0) terrain.size = options.size;
    terrain.feature_size = 0.4 * terrain.size;
    terrain.relief = (terrain.style == "mountain" ? 0.22 : 0.06) * terrain.size;
    terrain.resolution = int(std::lround(std::sqrt(count / 2.0))) + 1;
    return makeTerrain(terrain, makeHeightField(terrain));
}

void writeScene(const GenerateOptions& options) {
    const std::string suffix = ".scene.json";
    if (!options.output.ends_with(suffix)) {
        throw Error(ErrorCode::kInvalidArgument, "-o",
                    "'" + options.output + "' must end in " + suffix);
    }
    const GeneratedSceneParams params = {options.count, options.seed, options.size};
    saveFile(options.output,
             options.kind == "forest" ? forestSceneJson(params) : landscapeSceneJson(params));
}

}  // namespace

ExitCode runGenerate(const std::vector<std::string>& arguments) {
    CLI::App app;
    GenerateOptions options;
    app.add_option("KIND", options.kind,
                   "tree, bush, deadwood, grass, fern, flowers, litter, rock, terrain, forest or "
                   "landscape")
        ->required()
        ->group("Arguments");
    app.add_option("-o,--output", options.output, "models: .glb; scenes: .scene.json")
        ->required()
        ->type_name("FILE");
    const CLI::Option* count =
        app.add_option("--count", options.count,
                       "about how many: triangles of a tree (default 20000), a bush (6000), dead "
                       "wood (4000), a rock (5120) or a terrain (524288); blades of grass (120), "
                       "fronds of a fern (11), stems of flowers (24), leaves of litter (160); "
                       "instances in a forest (100000) or a landscape (1000000000)")
            ->type_name("N");
    const CLI::Option* size =
        app.add_option("--size", options.size,
                       "height of a tree, bush, snag, stump or flowers, length of a log (default: "
                       "its species'), height of grass (0.35) or a fern (0.7), diameter of litter "
                       "or a rock (2), side of a terrain (1000) or a forest (as the count asks "
                       "for); metres")
            ->type_name("M")
            ->check(CLI::Range(0.001, 1e6).description(""));
    app.add_option("--seed", options.seed, "another seed, another one of the kind (default 1)")
        ->type_name("N")
        ->check(CLI::Range(uint64_t(0), uint64_t(1) << 52).description(""));
    const CLI::Option* species =
        app.add_option("--species", options.species,
                       "of a tree: oak, beech, birch, spruce or pine; of a bush: hazel, juniper or "
                       "bilberry; of deadwood: snag, log or stump; of flowers: daisy, buttercup, "
                       "poppy or bluebell; of a terrain: meadow, forest_floor or mountain "
                       "(default: the first)")
            ->type_name("NAME");
    const CLI::Option* season =
        app.add_option("--season", options.season,
                       "spring, summer, autumn or winter: leaves' colour and amount, of a tree, "
                       "bush, grass, fern or litter (default summer)")
            ->type_name("NAME");
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;

    const Kind& kind = findKind(options.kind);
    if (count->count() == 0) options.count = kind.default_count;
    if (options.count < kind.least_count || options.count > kind.most_count) {
        throw Error(ErrorCode::kInvalidArgument, "--count",
                    "a " + kind.name + " takes " + std::to_string(kind.least_count) + ".." +
                        std::to_string(kind.most_count));
    }
    if (species->count() > 0 && kind.species.empty())
        throw Error(ErrorCode::kInvalidArgument, "--species", "a " + kind.name + " has none");
    if (season->count() > 0 && !kind.has_seasons)
        throw Error(ErrorCode::kInvalidArgument, "--season", "a " + kind.name + " has none");
    if (species->count() == 0 && !kind.species.empty()) options.species = kind.species.front();
    if (size->count() > 0 && kind.name == "landscape") {
        throw Error(ErrorCode::kInvalidArgument, "--size",
                    "a landscape's size follows from --count");
    }
    checkOutputFile("-o", options.output, {kind.is_scene ? ".json" : ".glb"});
    if (kind.is_scene) {
        writeScene(options);
    } else {
        const GeneratedMesh model = makeModel(options);
        saveGlb(options.output, model.mesh, model.materials);
    }
    std::cout << options.output << "\n";
    return ExitCode::kDone;
}

}  // namespace stipple
