// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <core/rng.h>
#include <scenegraph/procedural/crown_light.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/tree_form.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr uint16_t kBark = 0, kLeaves = 1;  // materials

struct SpeciesEntry {
    const char* name;
    TreeForm (*grow)(uint64_t seed, float detail);
};
constexpr SpeciesEntry kSpecies[] = {
    {"oak", growOak}, {"birch", growBirch}, {"spruce", growSpruce}, {"pine", growPine}};

// Where a leaf grows.
struct LeafSite {
    Vec3 position;
    Vec3 direction;  // of its twig
    uint32_t stem;
    float fraction;  // along it
};

// `count` places on the leaf-bearing ends of the stems, evenly by length (times density).
std::vector<LeafSite> placeLeaves(const Skeleton& skeleton, size_t count, Rng& rng) {
    double total = 0.0;
    const auto weight = [](const Stem& stem) {
        return double(stem.length) * stem.leaf_density * std::max(0.0f, 1.0f - stem.leaf_from);
    };
    for (const Stem& stem : skeleton.stems) total += weight(stem);
    std::vector<LeafSite> sites;
    sites.reserve(count);
    double sum = 0.0;
    for (uint32_t i = 0; i < skeleton.stems.size(); ++i) {
        const Stem& stem = skeleton.stems[i];
        const double w = weight(stem) / total * double(count);
        while (sites.size() < count && double(sites.size()) + 0.5 < sum + w) {
            const double along =
                std::clamp((double(sites.size()) + rng.uniform() - sum) / w, 0.0, 1.0);
            const float fraction = stem.leaf_from + (1.0f - stem.leaf_from) * float(along);
            sites.push_back({skeleton.at(stem, fraction).position,
                             skeleton.direction(stem, fraction), i, fraction});
        }
        sum += w;
    }
    return sites;
}

class TreeBuilder {
public:
    TreeBuilder(const TreeForm& form, uint64_t seed)
        : form_(form), rng_{hashCombine(seed, 0x7ee)} {}

    GeneratedMesh build(size_t triangles, double height);

private:
    size_t trianglesPerLeaf() const { return form_.leaf_kind == LeafKind::kBlade ? 2 : 3; }
    void appendBarkMarks(size_t count);
    void appendBlade(const LeafSite& site, const CrownLight& light, float length);
    void appendNeedles(const LeafSite& site, const CrownLight& light, float length);
    Vec3 leafTint(const LeafSite& site);
    void vertex(const Vec3& p, const Vec3& n, const Vec3& color) {
        mesh_.positions.push_back(p);
        mesh_.normals.push_back(n);
        mesh_.colors.push_back(Vec4(glm::clamp(color, Vec3(0.0f), Vec3(1.0f)), 1.0f));
    }
    void triangle(uint32_t a, uint32_t b, uint32_t c) { mesh_.triangles.push_back(UVec3(a, b, c)); }

    const TreeForm& form_;
    Rng rng_;
    Mesh mesh_;
};

// Light that reaches a place, as a factor of its colour.
float bakedLight(float openness) { return 0.25f + 0.75f * std::min(1.0f, openness / 0.8f); }

GeneratedMesh TreeBuilder::build(size_t triangles, double height) {
    const Skeleton& skeleton = form_.skeleton;
    const size_t marks =
        size_t(double(form_.bark_marks) * std::min(1.0, double(triangles) / 20000.0));
    const size_t bark_budget = size_t(form_.bark_share * float(triangles)) - 2 * marks;
    appendTubes(skeleton, bark_budget, form_.root_flare, form_.bark, kBark, mesh_);
    appendBarkMarks(marks);
    mesh_.triangle_material.resize(mesh_.triangles.size(), kBark);
    const size_t bark_vertices = mesh_.positions.size();

    const size_t leaf_count =
        (triangles - std::min(triangles, mesh_.triangles.size())) / trianglesPerLeaf();
    const std::vector<LeafSite> sites = placeLeaves(skeleton, leaf_count, rng_);
    std::vector<Vec3> places;
    places.reserve(sites.size());
    for (const LeafSite& site : sites) places.push_back(site.position);
    const float area_per_leaf = form_.leaf_area / float(std::max<size_t>(sites.size(), 1));
    const CrownLight light(places, area_per_leaf);

    for (size_t i = 0; i < bark_vertices; ++i) {
        const float lit = bakedLight(light.at(mesh_.positions[i]).openness);
        mesh_.colors[i] *= Vec4(Vec3(lit), 1.0f);
    }
    for (const LeafSite& site : sites) {
        if (form_.leaf_kind == LeafKind::kBlade) {
            appendBlade(site, light, std::sqrt(2.0f * area_per_leaf / form_.leaf_aspect));
        } else {
            appendNeedles(site, light, std::sqrt(area_per_leaf / 0.1f));
        }
    }
    mesh_.triangle_material.resize(mesh_.triangles.size(), kLeaves);

    float top = 0.0f;
    for (const Vec3& p : mesh_.positions) top = std::max(top, p.y);
    const float scale = float(height) / top;
    for (Vec3& p : mesh_.positions) p *= scale;

    GeneratedMesh result;
    result.mesh = std::move(mesh_);
    result.materials.resize(2);
    result.materials[kBark].name = "bark";
    result.materials[kBark].base_color = form_.bark_color;
    result.materials[kLeaves].name = form_.leaf_kind == LeafKind::kBlade ? "leaves" : "needles";
    result.materials[kLeaves].base_color = form_.leaf_color;
    result.materials[kLeaves].double_sided = true;
    result.materials[kLeaves].translucency = 0.4f;
    return result;
}

// Dark strips (lenticels) on the lower trunk, a few millimetres above its faces.
void TreeBuilder::appendBarkMarks(size_t count) {
    const Stem& trunk = form_.skeleton.stems[0];
    for (size_t i = 0; i < count; ++i) {
        const float at = uniform(rng_, 0.03, 0.8);
        const StemNode node = form_.skeleton.at(trunk, at);
        const Vec3 axis = form_.skeleton.direction(trunk, at);
        Vec3 side, third;
        completeFrame(axis, side, third);
        const float azimuth = uniform(rng_, 0.0, 2.0 * kPi);
        const Vec3 out = side * std::cos(azimuth) + third * std::sin(azimuth);
        const Vec3 across = glm::cross(axis, out);
        const float width = node.radius * uniform(rng_, 0.35, 0.8),
                    height = uniform(rng_, 0.012, 0.05);
        const uint32_t v = uint32_t(mesh_.positions.size());
        const Vec3 color = Vec3(uniform(rng_, 0.09, 0.2));
        const Vec3 center = node.position + out * (node.radius * 1.012f + 0.004f);
        vertex(center - across * width, out, color);
        vertex(center - axis * height, out, color);
        vertex(center + across * width, out, color);
        vertex(center + axis * height, out, color);
        triangle(v, v + 1, v + 2);
        triangle(v, v + 2, v + 3);
    }
}

Vec3 TreeBuilder::leafTint(const LeafSite& site) {
    const float age = uniform(rng_, 0.0, 1.0);
    const float value = uniform(rng_, 0.75, 1.0);
    return form_.skeleton.stems[site.stem].tint *
           glm::mix(Vec3(1.0f), form_.leaf_color_old, age * age) * value;
}

void TreeBuilder::appendBlade(const LeafSite& site, const CrownLight& light, float mean_length) {
    const CrownLightSample lit = light.at(site.position);
    const float length =
        mean_length * form_.skeleton.stems[site.stem].leaf_size * uniform(rng_, 0.65, 1.3);
    const float width = length * form_.leaf_aspect * uniform(rng_, 0.85, 1.15);
    const float stray = form_.leaf_spread * length * uniform(rng_, 0.0, 1.0);
    const Vec3 base = site.position + randomUnit(rng_) * stray;
    const Vec3 along =
        glm::normalize(site.direction * 0.5f + lit.outward * 0.5f + randomUnit(rng_) * 0.8f -
                       Vec3(0, 1.5f * form_.leaf_droop, 0));
    const Vec3 up = Vec3(0, 0.7f, 0) + lit.outward * 0.5f + randomUnit(rng_) * 0.75f;
    const Vec3 side = glm::normalize(glm::cross(along, up) + Vec3(1e-5f, 0, 0));
    const Vec3 normal = glm::cross(side, along);
    const Vec3 shading = normal * 0.4f + lit.outward * 0.75f;
    const Vec3 fold = side * 0.15f;
    const Vec3 color = leafTint(site) * bakedLight(lit.openness);
    const Vec3 middle = base + along * (0.45f * length) + normal * (0.18f * width);
    const uint32_t v = uint32_t(mesh_.positions.size());
    vertex(base, glm::normalize(shading), color * 0.7f);
    vertex(middle + side * (0.5f * width), glm::normalize(shading - fold), color);
    vertex(base + along * length - Vec3(0, 0.12f * length, 0), glm::normalize(shading), color);
    vertex(middle - side * (0.5f * width), glm::normalize(shading + fold), color * 0.93f);
    triangle(v, v + 1, v + 2);
    triangle(v, v + 2, v + 3);
}

// A twig end with needles: three spikes that share the twig's lower part as an edge.
void TreeBuilder::appendNeedles(const LeafSite& site, const CrownLight& light, float mean_length) {
    const CrownLightSample lit = light.at(site.position);
    const float length =
        mean_length * form_.skeleton.stems[site.stem].leaf_size * uniform(rng_, 0.65, 1.3);
    Vec3 plane_up = Vec3(0, 1, 0);
    Vec3 along;
    if (form_.needle_flat) {
        const Vec3 across =
            glm::normalize(glm::cross(site.direction, plane_up) + Vec3(1e-4f, 0, 0));
        const float turn = form_.needle_angle * uniform(rng_, -1.0, 1.0);
        along =
            site.direction * std::cos(turn) + across * std::sin(turn) + randomUnit(rng_) * 0.15f;
        plane_up += randomUnit(rng_) * 0.5f;
    } else {
        const float angle = form_.needle_angle * uniform(rng_, 0.2, 1.5);
        along = offAxis(site.direction, angle, uniform(rng_, 0.0, 2.0 * kPi));
        plane_up = randomUnit(rng_) + lit.outward * 0.5f;
    }
    along = glm::normalize(along - Vec3(0, form_.leaf_droop * uniform(rng_, 0.3, 1.3), 0));
    const Vec3 side = glm::normalize(glm::cross(along, plane_up) + Vec3(1e-5f, 0, 0));
    const Vec3 normal = glm::cross(side, along);
    const Vec3 shading = glm::normalize(normal * 0.35f + lit.outward * 0.75f);
    const Vec3 base = site.position + randomUnit(rng_) * (form_.leaf_spread * length);
    const Vec3 color = leafTint(site) * bakedLight(lit.openness);
    const Vec3 sag = Vec3(0, -0.3f * std::max(form_.leaf_droop, 0.0f) * length, 0);
    const Vec3 fork = base + along * (0.22f * length) + side * (0.05f * length) + sag * 0.1f;
    // The lowest branches lie on the ground, their needles not below it.
    const auto aboveGround = [](const Vec3& p) { return Vec3(p.x, std::max(p.y, 0.02f), p.z); };
    const uint32_t v = uint32_t(mesh_.positions.size());
    vertex(aboveGround(base), shading, color * 0.55f);
    vertex(aboveGround(fork), shading, color * 0.75f);
    vertex(aboveGround(base + along * length + sag), shading, color);
    for (const float hand : {1.0f, -1.0f}) {
        const float reach = length * uniform(rng_, 0.55, 0.85);
        const Vec3 spike = along * 0.85f + side * (hand * 0.53f) - normal * 0.12f;
        vertex(aboveGround(base + spike * reach + sag * 0.5f),
               glm::normalize(shading + side * (hand * 0.25f)), color * 0.95f);
    }
    triangle(v, v + 1, v + 2);
    triangle(v, v + 3, v + 1);
    triangle(v, v + 1, v + 4);
}

}  // namespace

void addTwigs(Skeleton& skeleton, Rng& rng, uint32_t branch, const Twigs& twigs) {
    const Vec3 tint = skeleton.stems[branch].tint;
    for (int i = 0; i < twigs.count; ++i) {
        const float at = spreadAlong(rng, i, twigs.count, twigs.from);
        Growth growth = twigs.growth;
        growth.angle = uniform(rng, twigs.angle.lo, twigs.angle.hi);
        growth.azimuth = uniform(rng, 0.0, 2.0 * kPi);
        growth.length = uniform(rng, twigs.length.lo, twigs.length.hi);
        const uint32_t twig = branchOff(skeleton, rng, branch, at, growth);
        skeleton.stems[twig].leaf_from = twigs.leaf_from;
        skeleton.stems[twig].tint = tint;
    }
}

std::vector<std::string> treeSpecies() {
    std::vector<std::string> names;
    for (const SpeciesEntry& entry : kSpecies) names.push_back(entry.name);
    return names;
}

GeneratedMesh makeTree(const TreeParams& params) {
    const auto entry =
        std::find_if(std::begin(kSpecies), std::end(kSpecies),
                     [&](const SpeciesEntry& e) { return params.species == e.name; });
    if (entry == std::end(kSpecies)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "unknown tree species '" + params.species + "' (oak, birch, spruce or pine)");
    }
    if (params.triangles < 1000 || params.triangles > 2000000) {
        throw Error(ErrorCode::kInvalidArgument, "", "a tree's triangles must be in 1000..2000000");
    }
    if (!(params.height == 0.0 || (params.height >= 0.01 && params.height <= 1000.0))) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a tree's height must be 0 (typical) or in 0.01..1000 metres");
    }
    const float detail = std::clamp(float(params.triangles) / 20000.0f, 0.25f, 4.0f);
    const TreeForm form = entry->grow(params.seed, detail);
    GeneratedMesh result =
        TreeBuilder(form, params.seed)
            .build(size_t(params.triangles), params.height > 0.0 ? params.height : form.height);
    result.mesh.name = params.species;
    return result;
}

}  // namespace stipple
