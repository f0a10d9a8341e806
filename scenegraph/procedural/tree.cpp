// SPDX-License-Identifier: Apache-2.0
// The kinds of trees and bushes, by name.
#include <core/error.h>
#include <scenegraph/procedural/tree_form.h>

#include <algorithm>
#include <span>

namespace stipple {

namespace {

struct Species {
    const char* name;
    TreeForm (*grow)(uint64_t seed, float detail);
};
constexpr Species kTrees[] = {{"oak", growOak},
                              {"beech", growBeech},
                              {"birch", growBirch},
                              {"spruce", growSpruce},
                              {"pine", growPine}};
constexpr Species kBushes[] = {
    {"hazel", growHazel}, {"juniper", growJuniper}, {"bilberry", growBilberry}};

std::vector<std::string> namesOf(std::span<const Species> kinds) {
    std::vector<std::string> names;
    for (const Species& kind : kinds) names.push_back(kind.name);
    return names;
}

// what: "tree"; usual_triangles: of detail 1.
GeneratedMesh grow(std::span<const Species> kinds, const std::string& what,
                   const std::string& species, uint64_t seed, double height, int triangles,
                   int usual_triangles, const std::string& season_name) {
    const auto kind = std::find_if(kinds.begin(), kinds.end(),
                                   [&](const Species& k) { return species == k.name; });
    if (kind == kinds.end()) {
        std::string known;
        for (const Species& k : kinds)
            known += (known.empty()         ? ""
                      : &k == &kinds.back() ? " or "
                                            : ", ") +
                     std::string(k.name);
        throw Error(ErrorCode::kInvalidArgument, "",
                    "unknown " + what + " species '" + species + "' (" + known + ")");
    }
    if (triangles < 1000 || triangles > 2000000) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a " + what + "'s triangles must be in 1000..2000000");
    }
    if (!(height == 0.0 || (height >= 0.01 && height <= 1000.0))) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a " + what + "'s height must be 0 (typical) or in 0.01..1000 metres");
    }
    const Season season = seasonByName(season_name);
    const float detail = std::clamp(float(triangles) / float(usual_triangles), 0.25f, 4.0f);
    const TreeForm form = kind->grow(seed, detail);
    GeneratedMesh result =
        buildTree(form, seed, size_t(triangles), height > 0.0 ? height : form.height, season);
    result.mesh.name = species;
    return result;
}

}  // namespace

std::vector<std::string> treeSpecies() { return namesOf(kTrees); }
std::vector<std::string> bushSpecies() { return namesOf(kBushes); }

GeneratedMesh makeTree(const TreeParams& p) {
    return grow(kTrees, "tree", p.species, p.seed, p.height, p.triangles, 20000, p.season);
}

GeneratedMesh makeBush(const BushParams& p) {
    return grow(kBushes, "bush", p.species, p.seed, p.height, p.triangles, 6000, p.season);
}

}  // namespace stipple
