// SPDX-License-Identifier: Apache-2.0
// Face clusters: every triangle in one, connected, of one material, no larger than allowed, flat
// where they should be, and fewer for higher costs.
#include <core/error.h>
#include <gtest/gtest.h>
#include <scenegraph/io/edges.h>
#include <scenegraph/io/face_clusters.h>
#include <scenegraph/procedural/generators.h>

#include <map>
#include <numeric>
#include <set>

namespace stipple {
namespace {

FaceClusters cluster(const Mesh& mesh, const ClusterOptions& options) {
    const CancelFlag cancel;
    return clusterFaces(mesh, options, cancel);
}

Mesh torus() { return makePrimitive("torus", 4000, Vec3(0.5f)).mesh; }

ClusterOptions firstPhase(double cost) {
    ClusterOptions options;
    options.phase_one = cost;
    options.phase_two = -10.0;
    return options;
}

// Along edges that their triangles share.
void expectConnected(const Mesh& mesh, const std::vector<uint32_t>& cluster_of, size_t clusters) {
    std::vector<uint32_t> parent(mesh.triangles.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto find = [&](uint32_t t) {
        while (parent[t] != t) t = parent[t];
        return t;
    };
    for (const SharedEdge& e : sharedEdges(mesh)) {
        if (e.b != kNoTriangle && cluster_of[e.a] == cluster_of[e.b]) parent[find(e.a)] = find(e.b);
    }
    std::set<uint32_t> roots, numbers;
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        roots.insert(find(t));
        numbers.insert(cluster_of[t]);
    }
    EXPECT_EQ(roots.size(), clusters);
    EXPECT_EQ(numbers.size(), clusters);
}

TEST(FaceClusters, everyTriangleIsInOneConnectedCluster) {
    for (const char* kind : {"torus", "sphere", "box", "plane"}) {
        const Mesh mesh = makePrimitive(kind, 3000, Vec3(0.5f)).mesh;
        ClusterOptions options;
        options.largest = 200;
        const FaceClusters made = cluster(mesh, options);
        ASSERT_EQ(made.cluster_of.size(), mesh.triangles.size()) << kind;
        ASSERT_EQ(made.first_of.size(), mesh.triangles.size()) << kind;
        expectConnected(mesh, made.cluster_of, made.is_flat.size());
        expectConnected(mesh, made.first_of, made.first_normal.size());
        std::map<uint32_t, uint32_t> size;
        for (const uint32_t c : made.cluster_of) EXPECT_LE(++size[c], options.largest);
        // Those of phase two are unions of those of phase one.
        std::map<uint32_t, uint32_t> of_first;
        for (size_t t = 0; t < made.first_of.size(); ++t) {
            EXPECT_EQ(of_first.emplace(made.first_of[t], made.cluster_of[t]).first->second,
                      made.cluster_of[t]);
        }
    }
}

TEST(FaceClusters, higherCostsGiveFewerAndUnions) {
    const Mesh mesh = torus();
    FaceClusters last;
    for (const double cost : {-0.3, -0.1, 0.0, 0.1, 0.3, 1.0}) {
        const FaceClusters made = cluster(mesh, firstPhase(cost));
        if (!last.is_flat.empty()) {
            EXPECT_LE(made.is_flat.size(), last.is_flat.size()) << cost;
            std::map<uint32_t, uint32_t> union_of;
            for (size_t t = 0; t < mesh.triangles.size(); ++t) {
                EXPECT_EQ(union_of.emplace(last.cluster_of[t], made.cluster_of[t]).first->second,
                          made.cluster_of[t]);
            }
        }
        last = made;
    }
    EXPECT_LT(last.is_flat.size(), mesh.triangles.size() / 100);
}

TEST(FaceClusters, aBoxFallsIntoItsSides) {
    const Mesh mesh = makePrimitive("box", 1200, Vec3(0.5f)).mesh;
    ClusterOptions options = firstPhase(10.0);
    options.clusters = 6;
    options.largest = 10000;
    const FaceClusters made = cluster(mesh, options);
    ASSERT_EQ(made.is_flat.size(), 6u);
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
        const UVec3& v = mesh.triangles[t];
        const Vec3 n = glm::normalize(glm::cross(mesh.positions[v.y] - mesh.positions[v.x],
                                                 mesh.positions[v.z] - mesh.positions[v.x]));
        EXPECT_GT(glm::dot(n, made.first_normal[made.first_of[t]]), 0.999f);
    }
}

TEST(FaceClusters, asManyAsAskedForAndNoMoreThanTheFlatShare) {
    const Mesh mesh = torus();
    ClusterOptions options;
    options.clusters = 100;
    EXPECT_EQ(cluster(mesh, options).first_normal.size(), 100u);
    options.phase_two = 10.0;
    options.flat_share = 0.5;
    const FaceClusters made = cluster(mesh, options);
    double flat = 0.0;
    for (const uint32_t c : made.cluster_of) flat += made.is_flat[c];
    EXPECT_LE(flat, 0.5 * double(mesh.triangles.size()));
    EXPECT_GE(flat, 0.4 * double(mesh.triangles.size()));
}

//  3 --- 2      Two materials: the edge between them joins nothing. A third triangle lies on a
//  line. |  /  | 0 --- 1
TEST(FaceClusters, materialsStayApartAndDegenerateTrianglesDoNoHarm) {
    Mesh mesh;
    mesh.positions = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)};
    mesh.triangles = {UVec3(0, 1, 2), UVec3(0, 2, 3), UVec3(0, 1, 1)};
    mesh.triangle_material = {0, 1, 0};
    const FaceClusters made = cluster(mesh, firstPhase(100.0));
    EXPECT_NE(made.cluster_of[0], made.cluster_of[1]);
    EXPECT_EQ(cluster(Mesh(), firstPhase(1.0)).cluster_of.size(), 0u);
}

}  // namespace
}  // namespace stipple
