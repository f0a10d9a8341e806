// SPDX-License-Identifier: Apache-2.0
// The ray caster against every triangle of the expanded scene, intersected in double.
#include <raycast/embree_raycaster.h>

#include <core/rng.h>
#include <scenegraph/object_id.h>

#include <gtest/gtest.h>

#include <functional>
#include <set>

namespace stipple {
namespace {

Affine affine(const DMat3& linear, const DVec3& translation) { return {linear, translation}; }
Affine moved(double x, double y, double z) { return affine(DMat3(1.0), DVec3(x, y, z)); }

DMat3 rotationY(double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return DMat3(c, 0, -s, 0, 1, 0, s, 0, c);
}

// Counter-clockwise seen from +z.
Mesh triangleMesh() {
    Mesh mesh;
    mesh.positions = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
    mesh.triangles = {UVec3(0, 1, 2)};
    mesh.triangle_material = {0};
    return mesh;
}

// Random triangles in [-1.5, 1.5]^3 with random normals.
Mesh randomMesh(int n, uint64_t seed) {
    Mesh mesh;
    Rng rng{seed};
    const auto vec = [&](double r) {
        return Vec3{rng.uniform(-r, r), rng.uniform(-r, r), rng.uniform(-r, r)};
    };
    for (int i = 0; i < n; ++i) {
        const Vec3 center = vec(0.6);
        for (int k = 0; k < 3; ++k) {
            mesh.positions.push_back(center + vec(0.9));
            mesh.normals.push_back(glm::normalize(vec(1.0) + Vec3(0, 2, 0)));
        }
        mesh.triangles.push_back(UVec3(3 * i, 3 * i + 1, 3 * i + 2));
        mesh.triangle_material.push_back(uint16_t(i % 2));
    }
    return mesh;
}

// Two materials: single-sided and double-sided.
Scene emptyScene() {
    Scene scene;
    scene.materials.resize(2);
    scene.materials[1].double_sided = true;
    scene.materials[1].base_color = Vec3(0.1f, 0.2f, 0.3f);
    return scene;
}

uint32_t addGroup(Scene& scene, const std::vector<std::pair<ChildRef, Affine>>& instances) {
    Group group;
    group.name = "g" + std::to_string(scene.groups.size());
    group.instances = InstanceStore(DBox3{DVec3(-1000), DVec3(1000)});
    for (const auto& [child, transform] : instances) group.instances.add(child, transform);
    scene.groups.push_back(std::move(group));
    return scene.root = uint32_t(scene.groups.size() - 1);
}

// Ray against every triangle that a group shows.
struct BruteForce {
    const Scene& scene;
    DVec3 origin, direction;
    double best_t = std::numeric_limits<double>::infinity();
    DVec3 normal = DVec3(0);
    uint32_t material = 0, object = 0;

    void group(uint32_t index, const Affine& world_from_group, uint64_t path) {
        const Group& g = scene.groups[index];
        for (uint32_t i = 0; i < g.instances.size(); ++i) {
            const Affine world_from_child = world_from_group * g.instances.groupFromChild(i);
            const uint64_t child_path =
                extendObjectPath(path, g.listed_index.empty() ? i : g.listed_index[i]);
            const ChildRef child = g.instances.child(i);
            child.isGroup() ? group(child.index(), world_from_child, child_path)
                            : mesh(scene.meshes[child.index()], world_from_child, child_path);
        }
    }

    void mesh(const Mesh& m, const Affine& world_from_object, uint64_t path) {
        const bool mirrored = glm::determinant(world_from_object.linear) < 0.0;
        for (size_t t = 0; t < m.triangles.size(); ++t) {
            const UVec3& v = m.triangles[t];
            const DVec3 a = world_from_object.point(DVec3(m.positions[v.x])) - origin;
            const DVec3 e1 = world_from_object.point(DVec3(m.positions[v.y])) - origin - a;
            const DVec3 e2 = world_from_object.point(DVec3(m.positions[v.z])) - origin - a;
            const DVec3 n = glm::cross(e1, e2) * (mirrored ? -1.0 : 1.0);
            const double facing = glm::dot(n, direction);
            if (facing == 0.0 ||
                (facing > 0.0 && !scene.materials[m.triangle_material[t]].double_sided))
                continue;
            const double d = glm::dot(a, n) / facing;
            const DVec3 p = d * direction - a;
            const double n2 = glm::dot(n, n), side = mirrored ? -1.0 : 1.0;
            const double u = side * glm::dot(glm::cross(p, e2), n) / n2,
                         w = side * glm::dot(glm::cross(e1, p), n) / n2;
            if (d < 0.0 || d >= best_t || u < 0.0 || w < 0.0 || u + w > 1.0) continue;
            best_t = d;
            DVec3 normal_object = glm::cross(DVec3(m.positions[v.y] - m.positions[v.x]),
                                             DVec3(m.positions[v.z] - m.positions[v.x]));
            if (!m.normals.empty()) {
                normal_object = (1.0 - u - w) * DVec3(m.normals[v.x]) + u * DVec3(m.normals[v.y]) +
                                w * DVec3(m.normals[v.z]);
            }
            normal = glm::normalize(glm::transpose(glm::inverse(world_from_object.linear)) *
                                    normal_object);
            material = m.triangle_material[t];
            object = objectId(path);
        }
    }
};

std::vector<RayHit> castAll(const RayCaster& caster, const std::vector<Ray>& rays) {
    std::vector<RayHit> hits(rays.size());
    caster.cast(rays.data(), rays.size(), hits.data(), 0.0f);
    return hits;
}

RayHit castOne(const RayCaster& caster, const Vec3& origin, const Vec3& direction) {
    return castAll(caster, {Ray{origin, 0.0f, direction, kInfinity}})[0];
}

// From around the eye into all directions (coherent: nearly one), directions not normalized.
std::vector<Ray> randomRays(size_t n, double origin_radius, bool coherent) {
    Rng rng{99};
    const auto vec = [&](double r) {
        return Vec3{rng.uniform(-r, r), rng.uniform(-r, r), rng.uniform(-r, r)};
    };
    std::vector<Ray> rays(n);
    Vec3 main(1.0f);
    for (size_t i = 0; i < n; ++i) {
        if (i % 16 == 0) main = vec(1.0);
        rays[i].origin = vec(origin_radius);
        rays[i].direction = coherent ? main + 0.02f * glm::length(main) * vec(1.0) : vec(1.0);
    }
    return rays;
}

// At edges either answer is right, so a few rays in a thousand may disagree.
void expectSameAsBruteForce(const Scene& scene, const DVec3& eye, const std::vector<Ray>& rays) {
    const auto caster = makeEmbreeRayCaster(scene, eye, 2);
    const std::vector<RayHit> hits = castAll(*caster, rays);
    size_t n_hits = 0, n_different = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
        BruteForce expected{scene, eye + DVec3(rays[i].origin), DVec3(rays[i].direction)};
        expected.group(scene.root, Affine(), 0);
        const bool hit = std::isfinite(expected.best_t);
        n_hits += hit;
        if (hit != (hits[i].t < kInfinity) || (hit && expected.object != hits[i].object) ||
            (hit &&
             std::abs(expected.best_t - hits[i].t) > 1e-5 * std::max(1.0, expected.best_t))) {
            ++n_different;
            continue;
        }
        if (!hit) {
            EXPECT_EQ(hits[i].object, 0u);
            continue;
        }
        EXPECT_LT(glm::length(expected.normal - DVec3(hits[i].normal_world)), 1e-3) << i;
        EXPECT_EQ(expected.material, hits[i].material);
        EXPECT_EQ(hits[i].albedo, scene.materials[expected.material].base_color);
    }
    EXPECT_GT(n_hits, rays.size() / 20);
    EXPECT_LE(n_different, rays.size() / 500);
}

TEST(RaycastEmbree, hitsATriangleFromItsFront) {
    Scene scene = emptyScene();
    scene.meshes.push_back(triangleMesh());
    addGroup(scene, {{ChildRef::mesh(0), Affine()}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.2, 0.3, 4.0), 1);
    const RayHit hit = castOne(*caster, Vec3(0), Vec3(0, 0, -2));
    EXPECT_NEAR(hit.t, 2.0f, 1e-6f);
    EXPECT_NEAR(glm::length(hit.normal_world - Vec3(0, 0, 1)), 0.0f, 1e-6f);
    EXPECT_EQ(hit.object, objectId(extendObjectPath(0, 0)));
    EXPECT_EQ(castOne(*caster, Vec3(0), Vec3(0, 0, 1)).t, kInfinity);
    EXPECT_EQ(castOne(*caster, Vec3(0.7f, 0.3f, 0), Vec3(0, 0, -1)).t, kInfinity);
    EXPECT_EQ(castOne(*caster, Vec3(0, 0, -8), Vec3(0, 0, 1)).t, kInfinity)
        << "the back of a single-sided surface";
    EXPECT_GT(caster->bytes(), 0u);
}

TEST(RaycastEmbree, hitsLieWithinTheRay) {
    Scene scene = emptyScene();
    scene.meshes.push_back(triangleMesh());
    addGroup(scene, {{ChildRef::mesh(0), Affine()}, {ChildRef::mesh(0), moved(0, 0, 1)}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.2, 0.2, 4.0), 1);
    const auto hitBetween = [&](float t_min, float t_max) {
        return castAll(*caster, {Ray{Vec3(0), t_min, Vec3(0, 0, -1), t_max}})[0].t;
    };
    EXPECT_FLOAT_EQ(hitBetween(0.0f, kInfinity), 3.0f);
    EXPECT_FLOAT_EQ(hitBetween(3.5f, kInfinity), 4.0f);
    EXPECT_EQ(hitBetween(0.0f, 2.9f), kInfinity);
    EXPECT_EQ(hitBetween(4.5f, kInfinity), kInfinity);
}

TEST(RaycastEmbree, raysThatAreNoneHitNothing) {
    Scene scene = emptyScene();
    scene.meshes.push_back(randomMesh(50, 1));
    addGroup(scene, {{ChildRef::mesh(0), Affine()}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0), 1);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<Ray> rays = {
        {Vec3(nan), 0, Vec3(1), kInfinity},       {Vec3(0), 0, Vec3(nan, 0, 1), kInfinity},
        {Vec3(0), 0, Vec3(kInfinity), kInfinity}, {Vec3(0), nan, Vec3(1), kInfinity},
        {Vec3(0), -1, Vec3(1), kInfinity},        {Vec3(0), 2, Vec3(1), 1},
        {Vec3(0), 0, Vec3(0), kInfinity}};
    for (const RayHit& hit : castAll(*caster, rays)) EXPECT_EQ(hit.t, kInfinity);
    castAll(*caster, {});
}

TEST(RaycastEmbree, transformedMeshesAgreeWithBruteForce) {
    Scene scene = emptyScene();
    scene.meshes.push_back(randomMesh(60, 1));
    scene.meshes.push_back(randomMesh(30, 2));
    scene.meshes[1].normals.clear();
    addGroup(scene,
             {{ChildRef::mesh(0), affine(rotationY(0.7) * 1.5, DVec3(-3, 0, 1))},
              {ChildRef::mesh(1),
               affine(DMat3(-1, 0, 0, 0, 1, 0, 0, 0, 1), DVec3(0, 2, -4))},  // mirrored
              {ChildRef::mesh(0),
               affine(DMat3(1, 0.4, 0, -0.7, 1.2, 0.3, 0, 0.8, 0.5), DVec3(3, 0, 2))},  // sheared
              {ChildRef::mesh(1), affine(DMat3(2, 0, 0, 0, 0.2, 0, 0, 0, -3), DVec3(0, -3, 0))}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    expectSameAsBruteForce(scene, DVec3(0.1, 0.0, 0.2), randomRays(2000, 3.0, false));
    expectSameAsBruteForce(scene, DVec3(0.1, 0.0, 0.2), randomRays(2000, 0.0, true));
    expectSameAsBruteForce(scene, DVec3(0.1, 0.0, 0.2), randomRays(2000, 1.0, true));
}

// Three levels; every group has meshes and groups, some mirrored and sheared.
Scene nestedScene(const DVec3& center) {
    Scene scene = emptyScene();
    scene.meshes.push_back(randomMesh(20, 1));
    scene.meshes.push_back(randomMesh(12, 2));
    const uint32_t inner =
        addGroup(scene, {{ChildRef::mesh(0), affine(rotationY(1.0), DVec3(1.5, 0, 0))},
                         {ChildRef::mesh(1),
                          affine(DMat3(0.5, 0, 0, 0, -0.7, 0, 0, 0.1, 0.5), DVec3(-1.5, 0, 0))}});
    const uint32_t middle = addGroup(
        scene,
        {{ChildRef::group(inner), affine(DMat3(0.8, 0, 0.2, 0, 1, 0, 0, 0, -0.9), DVec3(0, 2, 0))},
         {ChildRef::mesh(1), moved(0, -2, 1)},
         {ChildRef::group(inner), affine(rotationY(2.0) * 0.6, DVec3(0, -2, -2))}});
    addGroup(scene, {{ChildRef::mesh(0), affine(rotationY(0.3), center + DVec3(0, 0, 5))},
                     {ChildRef::group(middle), affine(rotationY(-1.0), center + DVec3(4, 0, 0))},
                     {ChildRef::group(inner), affine(DMat3(1.1), center + DVec3(-4, 1, 0))},
                     {ChildRef::group(middle),
                      affine(DMat3(0, 1, 0, 1, 0, 0, 0, 0, 1), center + DVec3(0, 0, -6))},
                     {ChildRef::mesh(1), affine(rotationY(0.1), center + DVec3(0, -4, 0))}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    return scene;
}

TEST(RaycastEmbree, nestedGroupsAgreeWithBruteForce) {
    expectSameAsBruteForce(nestedScene(DVec3(0)), DVec3(0.3, 0.1, -0.2),
                           randomRays(4000, 2.0, false));
}

// Groups that are placed once, in chains and beside groups that are placed often: their instances
// are traced as if they lay in the group above.
TEST(RaycastEmbree, groupsPlacedOnceAgreeWithBruteForce) {
    Scene scene = nestedScene(DVec3(0));
    const uint32_t often = 0, chain_end = scene.root;
    const uint32_t chain = addGroup(
        scene, {{ChildRef::group(chain_end), affine(rotationY(0.4) * 0.9, DVec3(0.5, 0, 0))}});
    const uint32_t beside = addGroup(
        scene, {{ChildRef::mesh(1), moved(0, 6, 0)},
                {ChildRef::group(chain), affine(DMat3(1, 0, 0, 0, 1, 0.2, 0, 0, -1), DVec3(0))},
                {ChildRef::mesh(0), moved(0, -6, 0)},
                {ChildRef::group(often), moved(6, 0, 0)}});
    const uint32_t only_meshes = addGroup(
        scene, {{ChildRef::mesh(0), moved(-7, 0, 0)}, {ChildRef::mesh(1), moved(7, 3, 0)}});
    const uint32_t nothing = addGroup(scene, {});
    addGroup(scene, {{ChildRef::group(nothing), Affine()},
                     {ChildRef::group(beside), affine(rotationY(-0.3), DVec3(1, 0, 0))},
                     {ChildRef::mesh(1), moved(0, 0, 8)},
                     {ChildRef::group(only_meshes), affine(rotationY(1.3), DVec3(0, 1, 0))}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    expectSameAsBruteForce(scene, DVec3(0.3, 0.1, -0.2), randomRays(4000, 2.0, false));

    const uint32_t all_around =
        addGroup(scene, {{ChildRef::mesh(0), affine(DMat3(2.0), DVec3(-3, 0, 1))},
                         {ChildRef::mesh(0), affine(DMat3(2.0), DVec3(3, 0, 1))}});
    const uint32_t above_below = addGroup(
        scene, {{ChildRef::mesh(1), moved(0, 3, 0)}, {ChildRef::mesh(0), moved(0, -3, 0)}});
    addGroup(scene, {{ChildRef::group(all_around), affine(rotationY(0.5), DVec3(0.2, 0, 0))},
                     {ChildRef::mesh(0), moved(0, 0, -3)},
                     {ChildRef::group(above_below), affine(rotationY(-0.5), DVec3(0))}});
    buildScene(scene, pool);  // traced in packets
    expectSameAsBruteForce(scene, DVec3(0.3, 0.1, -0.2), randomRays(2000, 1.0, true));
}

TEST(RaycastEmbree, placesFarFromTheOriginAreExact) {
    const DVec3 far(2e5, 30.0, -4e5);  // floats are 3 cm apart there
    expectSameAsBruteForce(nestedScene(far), far + DVec3(0.3, 0.1, -0.2),
                           randomRays(2000, 2.0, false));
}

TEST(RaycastEmbree, packetsAndSingleRaysFindTheSame) {
    Scene scene = emptyScene();
    scene.materials[1].alpha_mode = AlphaMode::kBlend;
    scene.materials[1].alpha = 0.5f;
    scene.meshes.push_back(randomMesh(200, 5));
    addGroup(scene,
             {{ChildRef::mesh(0), moved(2, 0, 0)},
              {ChildRef::mesh(0), affine(DMat3(1, 0, 0, 0, 1, 0, 0, 0, -1), DVec3(-2, 0, 0))}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0), 1);
    const std::vector<Ray> rays = randomRays(1600, 0.0, true);
    const std::vector<RayHit> packets = castAll(*caster, rays);
    size_t n_hits = 0, n_different = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
        const RayHit single = castAll(*caster, {rays[i]})[0];
        n_hits += single.t < kInfinity;
        n_different += single.object != packets[i].object ||
                       !(single.t == packets[i].t || std::abs(single.t - packets[i].t) < 1e-5f);
    }
    EXPECT_GT(n_hits, 300u);
    EXPECT_LE(n_different, 3u);
}

TEST(RaycastEmbree, sidesFollowMirroredTransforms) {
    Scene scene = emptyScene();
    scene.meshes.push_back(triangleMesh());
    const uint32_t group =
        addGroup(scene, {{ChildRef::mesh(0), affine(DMat3(1, 0, 0, 0, 1, 0, 0, 0, -1), DVec3(0))}});
    for (const bool nested : {false, true}) {  // mirrored at z = 0: the front looks to -z
        if (nested) addGroup(scene, {{ChildRef::group(group), Affine()}});
        ThreadPool pool(1);
        buildScene(scene, pool);
        const auto caster = makeEmbreeRayCaster(scene, DVec3(0.2, 0.2, 0.0), 1);
        const RayHit hit = castOne(*caster, Vec3(0, 0, -3), Vec3(0, 0, 1));
        EXPECT_FLOAT_EQ(hit.t, 3.0f);
        EXPECT_NEAR(hit.normal_world.z, -1.0f, 1e-6f);
        EXPECT_EQ(castOne(*caster, Vec3(0, 0, 3), Vec3(0, 0, -1)).t, kInfinity);
    }
    scene.materials[0].double_sided = true;
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.2, 0.2, 0.0), 1);
    const RayHit back = castOne(*caster, Vec3(0, 0, 3), Vec3(0, 0, -1));
    EXPECT_FLOAT_EQ(back.t, 3.0f);
    EXPECT_NEAR(back.normal_world.z, -1.0f, 1e-6f) << "the author's side, not the viewer's";
}

// A masked square of 2 x 2 texels (one column transparent) before an opaque one.
Scene maskedScene(AlphaMode mode, float alpha) {
    Scene scene = emptyScene();
    Texture texture;
    texture.nearest = true;
    texture.levels.push_back({2, 1, {255, 255, 255, 0, 255, 255, 255, 255}});
    scene.textures.push_back(texture);
    scene.materials[0].alpha_mode = mode;
    scene.materials[0].alpha = alpha;
    if (mode == AlphaMode::kMask) scene.materials[0].base_texture = 0;
    Mesh square;
    square.positions = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)};
    square.uvs = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1), Vec2(0, 1)};
    square.triangles = {UVec3(0, 1, 2), UVec3(0, 2, 3)};
    square.triangle_material = {0, 0};
    scene.meshes.push_back(square);
    square.triangle_material = {1, 1};
    scene.meshes.push_back(square);
    const uint32_t masked = addGroup(scene, {{ChildRef::mesh(0), moved(0, 0, 1)}});
    addGroup(scene, {{ChildRef::group(masked), Affine()}, {ChildRef::mesh(1), Affine()}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    return scene;
}

TEST(RaycastEmbree, whatAMaskCutsAwayIsNotThere) {
    const Scene scene = maskedScene(AlphaMode::kMask, 1.0f);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0, 0.0, 3.0), 1);
    EXPECT_FLOAT_EQ(castOne(*caster, Vec3(0.25f, 0.3f, 0), Vec3(0, 0, -1)).t, 3.0f);
    EXPECT_FLOAT_EQ(castOne(*caster, Vec3(0.75f, 0.3f, 0), Vec3(0, 0, -1)).t, 2.0f);
}

TEST(RaycastEmbree, blendedSurfacesStopTheirShareOfRays) {
    const Scene scene = maskedScene(AlphaMode::kBlend, 0.3f);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0, 0.0, 3.0), 1);
    std::vector<Ray> rays;
    Rng rng{5};
    for (int i = 0; i < 20000; ++i)
        rays.push_back({Vec3(rng.uniform(0.01, 0.99), rng.uniform(0.01, 0.99), 0), 0,
                        Vec3(0, 0, -1), kInfinity});
    const std::vector<RayHit> hits = castAll(*caster, rays), again = castAll(*caster, rays);
    size_t front = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
        front += hits[i].t < 2.5f;
        EXPECT_LT(hits[i].t, 3.5f);
        EXPECT_EQ(hits[i].t, again[i].t);
    }
    EXPECT_NEAR(double(front) / rays.size(), 0.3, 5 * std::sqrt(0.21 / rays.size()));
}

// Opaque double-sided triangles go unfiltered beside masked ones: the numbering of triangles must
// survive the split.
TEST(RaycastEmbree, meshesOfSeveralKindsOfMaterialKeepTheirTriangles) {
    Scene scene = emptyScene();
    scene.materials.resize(3);
    scene.materials[2].alpha_mode = AlphaMode::kMask;
    scene.materials[2].alpha_cutoff = 0.0f;
    scene.materials[2].base_color = Vec3(0.9f);
    Mesh mesh;
    for (uint32_t i = 0; i < 90; ++i) {
        const float x = float(i);
        mesh.positions.insert(mesh.positions.end(),
                              {Vec3(x, 0, 0), Vec3(x + 0.9f, 0, 0), Vec3(x, 0.5f + 0.01f * x, 0)});
        mesh.triangles.push_back(UVec3(3 * i, 3 * i + 1, 3 * i + 2));
        mesh.triangle_material.push_back(uint16_t(i * 7 % 3));
    }
    scene.meshes.push_back(mesh);
    addGroup(scene, {{ChildRef::mesh(0), Affine()}});
    ThreadPool pool(1);
    for (const bool sorted : {false, true}) {  // as listed there are too many runs to split
        if (sorted) buildScene(scene, pool);
        const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0, 0.0, 2.0), 1);
        for (int i = 0; i < 90; ++i) {
            const RayHit hit = castOne(*caster, Vec3(float(i) + 0.2f, 0.1f, 0), Vec3(0, 0, -1));
            EXPECT_FLOAT_EQ(hit.t, 2.0f);
            EXPECT_EQ(hit.material, uint32_t(i * 7 % 3));
        }
    }
}

TEST(RaycastEmbree, objectIdsFollowTheListedOrder) {
    Scene scene = emptyScene();
    scene.meshes.push_back(triangleMesh());
    std::vector<std::pair<ChildRef, Affine>> instances;
    for (int i = 0; i < 50; ++i)
        instances.push_back({ChildRef::mesh(0), moved(double(i * 37 % 50) * 2.0, 0, 0)});
    const uint32_t inner = addGroup(scene, instances);
    addGroup(scene, {{ChildRef::group(inner), moved(0, 5, 0)}, {ChildRef::group(inner), Affine()}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0, 0.0, 2.0), 1);
    std::set<uint32_t> ids;
    for (int i = 0; i < 50; ++i) {
        for (int outer = 0; outer < 2; ++outer) {
            const RayHit hit = castOne(
                *caster, Vec3(float(i * 37 % 50) * 2.0f + 0.2f, outer == 0 ? 5.2f : 0.2f, 0),
                Vec3(0, 0, -1));
            EXPECT_EQ(hit.object, objectId(extendObjectPath(extendObjectPath(0, uint32_t(outer)),
                                                            uint32_t(i))));
            ids.insert(hit.object);
        }
    }
    EXPECT_EQ(ids.size(), 100u);
    EXPECT_EQ(ids.count(0), 0u);
}

TEST(RaycastEmbree, manyGroupInstancesStayCompact) {
    Scene scene = emptyScene();
    scene.meshes.push_back(triangleMesh());
    const uint32_t inner = addGroup(scene, {{ChildRef::mesh(0), Affine()}});
    std::vector<std::pair<ChildRef, Affine>> instances;
    constexpr int kSide = 317;  // 10^5 instances
    for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x)
            instances.push_back({ChildRef::group(inner), moved(2.0 * x, 2.0 * y, 0)});
    }
    addGroup(scene, instances);
    ThreadPool pool(2);
    buildScene(scene, pool);
    const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0, 0.0, 5.0), 2);
    EXPECT_LT(caster->bytes(), instances.size() * 400);
    for (int i = 0; i < 1000; ++i) {
        const int x = i * 7919 % kSide, y = i * 104729 % kSide;
        const RayHit hit =
            castOne(*caster, Vec3(2.0f * x + 0.2f, 2.0f * y + 0.2f, 0), Vec3(0, 0, -1));
        EXPECT_FLOAT_EQ(hit.t, 5.0f);
        EXPECT_EQ(hit.object,
                  objectId(extendObjectPath(extendObjectPath(0, uint32_t(y * kSide + x)), 0)));
        EXPECT_EQ(castOne(*caster, Vec3(2.0f * x + 1.5f, 2.0f * y + 1.5f, 0), Vec3(0, 0, -1)).t,
                  kInfinity);
    }
}

TEST(RaycastEmbree, nestingTooDeepToTraceIsAnError) {
    for (const int levels : {64, 65, 20000}) {
        Scene scene = emptyScene();
        scene.meshes.push_back(triangleMesh());
        addGroup(scene, {{ChildRef::mesh(0), Affine()}});
        // The copy beside keeps the group from being dissolved into the one above.
        for (int i = 1; i < levels; ++i) {
            const ChildRef below = ChildRef::group(uint32_t(i - 1));
            addGroup(scene, {{below, Affine()}, {below, moved(900, 0, 0)}});
        }
        if (levels <= 64) {
            ThreadPool pool(1);
            buildScene(scene, pool);
            const auto caster = makeEmbreeRayCaster(scene, DVec3(0.2, 0.2, 1.0), 1);
            EXPECT_FLOAT_EQ(castOne(*caster, Vec3(0), Vec3(0, 0, -1)).t, 1.0f);
            continue;
        }
        try {
            makeEmbreeRayCaster(scene, DVec3(0.0), 1);
            ADD_FAILURE() << "nothing was thrown";
        } catch (const Error& e) {
            EXPECT_EQ(e.code(), ErrorCode::kUnsupported);
        }
    }
}

TEST(RaycastEmbree, emptyScenesShowNothing) {
    Scene scene = emptyScene();
    scene.meshes.push_back(Mesh());
    const uint32_t empty = addGroup(scene, {});
    const uint32_t hollow = addGroup(scene, {{ChildRef::mesh(0), Affine()}});
    addGroup(scene, {{ChildRef::group(empty), Affine()},
                     {ChildRef::group(hollow), Affine()},
                     {ChildRef::mesh(0), Affine()}});
    ThreadPool pool(1);
    buildScene(scene, pool);
    for (scene.root = 0; scene.root < 3; ++scene.root) {
        const auto caster = makeEmbreeRayCaster(scene, DVec3(0.0), 1);
        for (const RayHit& hit : castAll(*caster, randomRays(32, 1.0, true)))
            EXPECT_EQ(hit.t, kInfinity);
    }
    EXPECT_THROW(makeEmbreeRayCaster(scene, DVec3(0.0), 1), Error) << "there is no group 3";
}

}  // namespace
}  // namespace stipple
