// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "io_test_support.h"

#include <bit>

namespace stipple {
namespace {

std::string plyHeader(const std::string& format, const std::string& elements) {
    return "ply\nformat " + format + " 1.0\ncomment made by hand\n" + elements + "end_header\n";
}

const std::string kVertices =
    "property float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n";
const std::string kFaces = "property list uchar int vertex_indices\n";

// An L of six corners, concave at the fourth: area 3.
const std::vector<Vec3> kL = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}};

std::string asciiL() {
    std::string text =
        plyHeader("ascii", "element vertex 6\n" + kVertices + "element face 1\n" + kFaces);
    for (const Vec3& p : kL)
        text += std::to_string(p.x) + " " + std::to_string(p.y) + " +0.0e0 255 0 128\n";
    return text + "6 0 1 2 3 4 5\n";
}

std::string binaryL(bool is_little) {
    std::string bytes =
        plyHeader(is_little ? "binary_little_endian" : "binary_big_endian",
                  "element vertex 6\n" + kVertices +
                      "element junk 1\nproperty list int double a\n" + "element face 1\n" + kFaces);
    const auto put = [&](auto value) {
        std::string raw(reinterpret_cast<const char*>(&value), sizeof value);
        if (is_little != (std::endian::native == std::endian::little))
            std::reverse(raw.begin(), raw.end());
        bytes += raw;
    };
    for (const Vec3& p : kL) {
        for (int c = 0; c < 3; ++c) put(p[c]);
        for (const int c : {255, 0, 128}) put(uint8_t(c));
    }
    put(int32_t(2)), put(1.0), put(2.0);
    put(uint8_t(6));
    for (int32_t i = 0; i < 6; ++i) put(i);
    return bytes;
}

TEST(IoPly, readsMeshesInAllThreeEncodings) {
    for (const std::string& bytes : {asciiL(), binaryL(true), binaryL(false)}) {
        const Loaded loaded = tryLoadText("t.ply", bytes);
        ASSERT_EQ(loaded.error, "");
        const Mesh& mesh = loaded.scene.meshes.at(0);
        EXPECT_EQ(mesh.triangles.size(), 4u);
        EXPECT_NEAR(mesh.area, 3.0, 1e-6);  // a fan would cover the notch: 3.5
        ASSERT_EQ(mesh.colors.size(), 6u);
        EXPECT_EQ(mesh.colors[0].r, 1.0f);
        EXPECT_NEAR(mesh.colors[0].b, 0.2159f, 1e-3f);  // 128 in sRGB
        EXPECT_TRUE(loaded.scene.materials.at(0).double_sided);
        EXPECT_TRUE(loaded.diagnostics.warnings.empty());
    }
}

TEST(IoPly, readsLineEndsOfAllKinds) {
    for (const char* end : {"\r\n", "\r"}) {
        std::string text;
        for (const char c : asciiL()) text += c == '\n' ? end : std::string(1, c);
        EXPECT_EQ(tryLoadText("t.ply", text).error, "");
    }
}

TEST(IoPly, readsTriangleStrips) {
    const Loaded loaded = tryLoadText(
        "t.ply",
        plyHeader("ascii", "element vertex 6\n" + kVertices +
                               "element tristrips 1\nproperty list int int "
                               "vertex_indices\n") +
            "0 0 0 1 1 1\n1 0 0 1 1 1\n0 1 0 1 1 1\n1 1 0 1 1 1\n5 5 0 1 1 1\n6 5 0 1 1 1\n"
            "9 0 1 2 3 -1 4 5 3 0\n");
    ASSERT_EQ(loaded.error, "");
    const Mesh& mesh = loaded.scene.meshes.at(0);
    EXPECT_EQ(mesh.triangles.size(), 4u);
    for (const UVec3& t : mesh.triangles) {
        if (std::max({t.x, t.y, t.z}) > 3) continue;
        EXPECT_GT(glm::cross(mesh.positions[t.y] - mesh.positions[t.x],
                             mesh.positions[t.z] - mesh.positions[t.x])
                      .z,
                  0.0f);
    }
}

// A grid of points of spacing 1 on the plane z = 2 x.
std::string grid(int n, bool with_normals) {
    std::string text = plyHeader(
        "ascii",
        "element vertex " + std::to_string(n * n) +
            "\nproperty double x\nproperty double y\nproperty double z\n" +
            (with_normals ? "property float nx\nproperty float ny\nproperty float nz\n" : ""));
    for (int i = 0; i < n * n; ++i) {
        text += std::to_string(i % n) + " " + std::to_string(i / n) + " " +
                std::to_string(2 * (i % n)) + (with_normals ? " 0 0 1\n" : "\n");
    }
    return text;
}

TEST(IoPly, positionsFarFromTheOriginAreWarnedOf) {
    for (const int offset : {0, 2000, 2000000}) {
        std::string text = plyHeader("ascii",
                                     "element vertex 9\nproperty double x\nproperty double y\n"
                                     "property double z\n");
        for (int i = 0; i < 9; ++i)
            text += std::to_string(offset + i % 3) + " " + std::to_string(i / 3) + " 0\n";
        const Loaded loaded = tryLoadText("t.ply", text);
        ASSERT_EQ(loaded.error, "");
        ASSERT_EQ(loaded.diagnostics.warnings.size(), offset > 2000 ? 1u : 0u);
        if (offset <= 2000) continue;
        EXPECT_NE(loaded.diagnostics.warnings[0].find("positions are rounded to about 0.238 m"),
                  std::string::npos)
            << loaded.diagnostics.warnings[0];
    }
}

TEST(IoPly, pointsFaceTheirNormalsOrTheSurfaceTheyLieOn) {
    for (const bool with_normals : {false, true}) {
        const Loaded loaded = tryLoadText("t.ply", grid(10, with_normals));
        ASSERT_EQ(loaded.error, "");
        const Mesh& mesh = loaded.scene.meshes.at(0);
        ASSERT_EQ(mesh.triangles.size(), 200u);
        const Vec3 wanted = with_normals ? Vec3(0, 0, 1) : glm::normalize(Vec3(-2, 0, 1));
        for (const UVec3& t : mesh.triangles) {
            const Vec3 n = glm::normalize(glm::cross(mesh.positions[t.y] - mesh.positions[t.x],
                                                     mesh.positions[t.z] - mesh.positions[t.x]));
            EXPECT_GT(std::abs(glm::dot(n, wanted)), 0.999f);
        }
        // Spacings 1 and sqrt(5): the discs cover the grid.
        EXPECT_GT(mesh.area, 81.0 * std::sqrt(5.0));
        EXPECT_LT(mesh.area, 81.0 * 40.0);
    }
}

TEST(IoPly, leavesOutWhatIsNotFiniteWithAWarning) {
    const std::string head = plyHeader(
        "ascii", "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n");
    const Loaded cloud = tryLoadText("t.ply", head + "0 0 +inf\n0 1 0\n1 0 0\nnan 0 0\n");
    ASSERT_EQ(cloud.error, "");
    EXPECT_EQ(cloud.scene.meshes.at(0).triangles.size(), 4u);
    ASSERT_EQ(cloud.diagnostics.warnings.size(), 1u);
    EXPECT_NE(cloud.diagnostics.warnings[0].find("2 points are left out"), std::string::npos);
    const Loaded single = tryLoadText(
        "t.ply",
        plyHeader("ascii", "element vertex 1\nproperty int x\nproperty int y\nproperty int z\n") +
            "3 4 5\n");
    EXPECT_EQ(single.error, "");
    EXPECT_GT(single.scene.meshes.at(0).area, 0.0);
}

// Many at one place would be each other's neighbours.
TEST(IoPly, joinsPointsAtTheVerySamePlace) {
    std::string text = plyHeader("ascii", "element vertex 20004\n" + kVertices);
    text += "1 0 0 255 0 0\n0 0 0 0 255 0\n-0 0 0 0 0 255\n0 1 0 255 255 255\n";
    for (int i = 0; i < 20000; ++i) text += "0 -0 0 0 0 0\n";
    const Loaded cloud = tryLoadText("t.ply", text);
    ASSERT_EQ(cloud.error, "");
    const Mesh& mesh = cloud.scene.meshes.at(0);
    ASSERT_EQ(mesh.positions.size(), 12u);
    EXPECT_EQ(mesh.colors[4], Vec4(0, 1, 0, 1)) << "of the first";
    ASSERT_EQ(cloud.diagnostics.warnings.size(), 1u);
    EXPECT_NE(cloud.diagnostics.warnings[0].find("20001 points are left out: others lie at the"),
              std::string::npos);
}

TEST(IoPly, namesThePlaceOfWhatIsWrong) {
    EXPECT_EQ(tryLoadText("t.ply", "").error, "t.ply: does not start with a line \"ply\"");
    EXPECT_EQ(tryLoadText("t.ply", "ply\nformat ascii 1.0\nelement vertex x\n").error,
              "t.ply: line 3: \"x\" is no count");
    EXPECT_EQ(tryLoadText("t.ply", "ply\nformat ascii 1.0\nproperty float x\n").error,
              "t.ply: line 3: a property without an element");
    EXPECT_EQ(tryLoadText("t.ply", "ply\nformat ascii 1.0\n").error,
              "t.ply: line 2: the header does not end");
    std::string wrong = asciiL();
    wrong.replace(wrong.size() - 2, 1, "6");
    EXPECT_EQ(tryLoadText("t.ply", wrong).error,
              "t.ply: face 0: index 6, but there are 6 vertices");
    std::string cut = binaryL(true);
    EXPECT_EQ(tryLoadText("t.ply", cut.substr(0, cut.size() - 1)).error,
              "t.ply: face 0: a list is longer than the file");
    EXPECT_EQ(tryLoadText("t.ply", plyHeader("ascii", "element vertex 9000000000\n" + kVertices) +
                                       "0 0 0 0 0 0\n")
                  .error,
              "t.ply: vertex 9000000000: does not fit into the 12 bytes that are left");
    EXPECT_EQ(tryLoadText("t.ply", plyHeader("ascii", "element vertex 1\n" + kVertices) + "0 0 z\n")
                  .error,
              "t.ply: vertex 0: \"z\" is no number");
}

}  // namespace
}  // namespace stipple
