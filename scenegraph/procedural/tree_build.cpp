// SPDX-License-Identifier: Apache-2.0
// From a form (wood and what grows on it) to a mesh: tubes, leaves, light baked into colours.
#include <core/rng.h>
#include <scenegraph/procedural/crown_light.h>
#include <scenegraph/procedural/tree_form.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr uint16_t kBark = 0, kLeaves = 1, kTwigs = 2;  // materials

// Leaves of one season: those that are fresh and those that turned, linear colours.
struct Foliage {
    Vec3 fresh, old;
    float share = 1.0f;    // of all leaves that are there
    float turned = 0.35f;  // how far a mean leaf has turned
};

Foliage foliageIn(Season season, const TreeForm& form) {
    Foliage f{form.leaf_color, form.leaf_color * form.leaf_color_old};
    if (form.evergreen) {
        if (season == Season::kSpring) f.fresh *= Vec3(1.3f, 1.25f, 0.95f);  // new shoots
        if (season == Season::kWinter) f.fresh *= 0.88f, f.old *= 0.88f;
    } else if (season == Season::kSpring) {
        f.fresh *= Vec3(1.3f, 1.22f, 0.9f);
        f.old = form.leaf_color * Vec3(1.25f, 1.05f, 0.8f);
        f.share = 0.7f;
    } else if (season == Season::kAutumn) {
        f = {form.autumn_color, form.autumn_color_late, 0.75f, 0.45f};
    } else if (season == Season::kWinter) {
        f = {Vec3(0.24f, 0.135f, 0.06f), Vec3(0.15f, 0.085f, 0.045f), form.winter_leaves, 0.5f};
    }
    return f;
}

// Where leaves grow.
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

// What is left of a colour where little sky is seen: darker, and less saturated. height: 0 at the
// tree's foot, 1 at its top; neighbours and the ground take light from what is low.
Vec3 inLight(const Vec3& color, float openness, float height) {
    const float open =
        std::min(1.0f, openness / 0.8f) * (0.55f + 0.45f * std::min(1.0f, 1.3f * height));
    const float grey = glm::dot(color, Vec3(0.25f, 0.6f, 0.15f));
    return glm::mix(Vec3(grey) * Vec3(0.88f, 0.97f, 0.9f), color, 0.6f + 0.4f * open) *
           (0.17f + 0.83f * open);
}

class TreeBuilder {
public:
    TreeBuilder(const TreeForm& form, uint64_t seed, Season season)
        : form_(form), rng_{hashCombine(seed, 0x7ee)}, foliage_(foliageIn(season, form)) {
        // Every tree has a tone of its own.
        const float warm = uniform(rng_, -1.0, 1.0), value = uniform(rng_, 0.8, 1.15);
        const Vec3 tone = Vec3(1.0f + 0.16f * warm, 1.0f, 1.0f - 0.14f * warm) * value;
        foliage_.fresh *= tone;
        foliage_.old *= tone;
        brightest_ = 1.15f * glm::max(foliage_.fresh, foliage_.old);
        if (season == Season::kAutumn && !form.evergreen) branch_turn_ = 2.2f;
    }

    GeneratedMesh build(size_t triangles, double height);

private:
    size_t trianglesPerLeaf() const { return form_.leaf_kind == LeafKind::kBlade ? 2 : 1; }
    void appendBarkMarks(size_t count);
    void appendBlade(const LeafSite& site, const CrownLight& light, float mean_length);
    void appendNeedles(const LeafSite& site, const CrownLight& light, float mean_length,
                       float hand);
    void appendTwiglet(const LeafSite& site, const CrownLight& light);
    Vec3 leafTint(const LeafSite& site);
    void vertex(const Vec3& p, const Vec3& n, const Vec3& color) {
        mesh_.positions.push_back(p);
        mesh_.normals.push_back(n);
        mesh_.colors.push_back(Vec4(glm::clamp(color, Vec3(0.0f), Vec3(1.0f)), 1.0f));
    }
    void triangle(uint32_t a, uint32_t b, uint32_t c) { mesh_.triangles.push_back(UVec3(a, b, c)); }

    const TreeForm& form_;
    Rng rng_;
    Foliage foliage_;
    Vec3 brightest_ = Vec3(1.0f);  // base colour of the leaves' material
    float branch_turn_ = 0.0f;     // how much sooner some branches turn than others
    Mesh mesh_;
};

GeneratedMesh TreeBuilder::build(size_t triangles, double height) {
    const Skeleton& skeleton = form_.skeleton;
    const size_t marks =
        size_t(double(form_.bark_marks) * std::min(1.0, double(triangles) / 20000.0));
    const size_t bark_budget = size_t(form_.bark_share * float(triangles)) - 2 * marks;
    appendTubes(skeleton, bark_budget, form_.tubes, form_.bark, kBark, mesh_);
    appendBarkMarks(marks);
    const size_t tube_vertices = mesh_.positions.size();

    // Where leaves are missing, the finest twigs show.
    const size_t left = triangles - std::min(triangles, mesh_.triangles.size());
    const size_t leaf_count = size_t(foliage_.share * float(left)) / trianglesPerLeaf();
    const size_t twiglet_count = left - leaf_count * trianglesPerLeaf();
    const size_t cluster = size_t(std::max(form_.leaf_cluster, 1));
    const std::vector<LeafSite> sites =
        placeLeaves(skeleton, (leaf_count + cluster - 1) / cluster, rng_);
    const float area_per_leaf =
        form_.leaf_area * foliage_.share / float(std::max<size_t>(leaf_count, 1));
    std::vector<Vec3> places;
    places.reserve(sites.size());
    for (const LeafSite& site : sites) places.push_back(site.position);
    const CrownLight light(places, area_per_leaf * float(cluster));

    mesh_.triangle_material.resize(mesh_.triangles.size(), kBark);
    for (size_t i = 0; i < tube_vertices; ++i) {
        const Vec3 color = glm::clamp(Vec3(mesh_.colors[i]), Vec3(0.0f), Vec3(1.0f));
        mesh_.colors[i] = Vec4(inLight(color, light.at(mesh_.positions[i]).openness,
                                       mesh_.positions[i].y / float(form_.height)),
                               1.0f);
    }
    for (const LeafSite& site : placeLeaves(skeleton, twiglet_count, rng_))
        appendTwiglet(site, light);
    mesh_.triangle_material.resize(mesh_.triangles.size(), kTwigs);
    const float mean_length = std::sqrt(2.0f * area_per_leaf / form_.leaf_aspect);
    for (size_t i = 0; i < leaf_count; ++i) {
        const LeafSite& site = sites[i / cluster];
        if (form_.leaf_kind == LeafKind::kBlade) {
            appendBlade(site, light, mean_length);
        } else {
            appendNeedles(site, light, mean_length, i % 2 ? 1.0f : -1.0f);
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
    result.materials[kLeaves].base_color = brightest_;
    result.materials[kLeaves].double_sided = true;
    result.materials[kLeaves].translucency = form_.leaf_kind == LeafKind::kBlade ? 0.4f : 0.2f;
    if (twiglet_count > 0) {
        result.materials.push_back(result.materials[kBark]);
        result.materials[kTwigs].name = "twigs";
        result.materials[kTwigs].double_sided = true;
    }
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
    const Vec3 tint = form_.skeleton.stems[site.stem].tint;
    const float age = uniform(rng_, 0.0, 1.0);
    const float value = uniform(rng_, 0.75, 1.0);
    const float turned = std::clamp(
        2.2f * foliage_.turned * age * age + branch_turn_ * (tint.x / tint.y - 1.0f) * 2.0f, 0.0f,
        1.0f);
    return tint * glm::mix(foliage_.fresh, foliage_.old, turned) * (value / brightest_);
}

void TreeBuilder::appendBlade(const LeafSite& site, const CrownLight& light, float mean_length) {
    const CrownLightSample lit = light.at(site.position);
    const float length =
        mean_length * form_.skeleton.stems[site.stem].leaf_size * uniform(rng_, 0.65, 1.3);
    const float width = length * form_.leaf_aspect * uniform(rng_, 0.85, 1.15);
    const float stray = form_.leaf_spread * length * uniform(rng_, 0.0, 1.0);
    const Vec3 away =
        offAxis(site.direction, uniform(rng_, 0.3, 1.4), uniform(rng_, 0.0, 2.0 * kPi));
    const Vec3 base = site.position + (randomUnit(rng_) + away * 0.5f) * stray;
    const Vec3 along = glm::normalize(away * 0.8f + lit.outward * 0.45f + randomUnit(rng_) * 0.35f -
                                      Vec3(0, 1.5f * form_.leaf_droop, 0));
    const Vec3 up = Vec3(0, 0.75f, 0) + lit.outward * 0.5f + randomUnit(rng_) * 0.7f;
    const Vec3 side = glm::normalize(glm::cross(along, up) + Vec3(1e-5f, 0, 0));
    const Vec3 normal = glm::cross(side, along);
    const Vec3 shading = normal * 0.5f + lit.outward * 0.7f;
    const Vec3 fold = side * 0.2f;
    const Vec3 color = inLight(leafTint(site), lit.openness, site.position.y / float(form_.height));
    const Vec3 middle = base + along * (0.45f * length) + normal * (0.18f * width);
    const uint32_t v = uint32_t(mesh_.positions.size());
    vertex(base, glm::normalize(shading), color * 0.7f);
    vertex(middle + side * (0.5f * width), glm::normalize(shading - fold), color);
    vertex(base + along * length - Vec3(0, 0.12f * length, 0), glm::normalize(shading), color);
    vertex(middle - side * (0.5f * width), glm::normalize(shading + fold), color * 0.93f);
    triangle(v, v + 1, v + 2);
    triangle(v, v + 2, v + 3);
}

// A shoot full of needles: wide where it leaves the twig, pointed at its end.
void TreeBuilder::appendNeedles(const LeafSite& site, const CrownLight& light, float mean_length,
                                float hand) {
    const CrownLightSample lit = light.at(site.position);
    const float length =
        mean_length * form_.skeleton.stems[site.stem].leaf_size * uniform(rng_, 0.6, 1.35);
    const float width = form_.leaf_aspect * mean_length * uniform(rng_, 0.8, 1.2);
    Vec3 plane_up = Vec3(0, 1, 0);
    Vec3 along;
    if (form_.needle_flat) {
        const Vec3 across =
            glm::normalize(glm::cross(site.direction, plane_up) + Vec3(1e-4f, 0, 0));
        const float turn = hand * form_.needle_angle * uniform(rng_, 0.15, 1.3);
        along =
            site.direction * std::cos(turn) + across * std::sin(turn) + randomUnit(rng_) * 0.22f;
        plane_up += randomUnit(rng_) * 0.6f;
    } else {
        const float angle = form_.needle_angle * uniform(rng_, 0.15, 1.4);
        along = offAxis(site.direction, angle, uniform(rng_, 0.0, 2.0 * kPi));
        plane_up = randomUnit(rng_) + lit.outward * 0.5f;
    }
    along = glm::normalize(along - Vec3(0, form_.leaf_droop * uniform(rng_, 0.2, 1.4), 0));
    const Vec3 side = glm::normalize(glm::cross(along, plane_up) + Vec3(1e-5f, 0, 0));
    const Vec3 normal = glm::cross(side, along);
    const Vec3 shading = glm::normalize(normal * 0.4f + lit.outward * 0.75f);
    const Vec3 base = site.position + randomUnit(rng_) * (form_.leaf_spread * length);
    const Vec3 color = inLight(leafTint(site), lit.openness, site.position.y / float(form_.height));
    const Vec3 sag(0, -0.2f * std::max(form_.leaf_droop, 0.0f) * length, 0);
    // The lowest branches lie on the ground, their needles not below it.
    const auto aboveGround = [](const Vec3& p) { return Vec3(p.x, std::max(p.y, 0.02f), p.z); };
    const uint32_t v = uint32_t(mesh_.positions.size());
    vertex(aboveGround(base - side * (0.5f * width)), shading, color * 0.62f);
    vertex(aboveGround(base + side * (0.5f * width)), shading, color * 0.62f);
    vertex(base + along * length + sag + Vec3(0, 0.03f, 0), shading, color);
    triangle(v, v + 1, v + 2);
}

// The bare end of a twig, as seen where leaves have fallen.
void TreeBuilder::appendTwiglet(const LeafSite& site, const CrownLight& light) {
    const float length = float(form_.height) * uniform(rng_, 0.008, 0.025);
    const Vec3 along = glm::normalize(
        offAxis(site.direction, uniform(rng_, 0.1, 0.8), uniform(rng_, 0.0, 2.0 * kPi)) +
        Vec3(0, 0.3f - 0.6f * form_.leaf_droop, 0));
    Vec3 side, normal;
    completeFrame(along, side, normal);
    const float half = 0.00035f * float(form_.height);
    const Vec3 color = form_.bark(form_.skeleton.stems[site.stem], 1.0f, 0.0f, site.position) *
                       uniform(rng_, 0.6, 0.9);
    const Vec3 out = glm::normalize(normal + light.at(site.position).outward);
    const uint32_t v = uint32_t(mesh_.positions.size());
    vertex(site.position - side * half, out, color);
    vertex(site.position + side * half, out, color);
    vertex(site.position + along * length, out, color);
    triangle(v, v + 1, v + 2);
}

}  // namespace

GeneratedMesh buildTree(const TreeForm& form, uint64_t seed, size_t triangles, double height,
                        Season season) {
    return TreeBuilder(form, seed, season).build(triangles, height);
}

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

}  // namespace stipple
