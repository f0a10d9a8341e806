// SPDX-License-Identifier: Apache-2.0
// Damaged model files: cut off anywhere, or with bytes changed. They load or are refused with one
// line; nothing crashes, hangs or takes much memory.
#include <core/rng.h>
#include <gtest/gtest.h>

#include "io_gltf_samples.h"

#include <sys/resource.h>
#include <chrono>

namespace stipple {
namespace {

#if defined(__SANITIZE_ADDRESS__)
constexpr int kFlips = 300;
constexpr double kMostMegabytes = 4000.0;  // the sanitizer keeps what is freed for a while
#else
constexpr int kFlips = 1000;
constexpr double kMostMegabytes = 1000.0;
#endif
constexpr double kMostSeconds = 10.0;

double peakMegabytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return double(usage.ru_maxrss) / 1024.0;
}

class IoDamaged : public testing::Test {
protected:
    void tryDamages(const std::string& name, const std::string& whole, int n_flips) {
        ASSERT_EQ(tryLoad(folder_.write(name, whole)).error, "");
        for (size_t n = 0; n < whole.size() && !HasFailure(); ++n)
            tryOne(name, whole.substr(0, n), "prefix of " + std::to_string(n) + " bytes");
        Rng rng{7, 0};
        for (int i = 0; i < n_flips && !HasFailure(); ++i) {
            std::string damaged = whole;
            for (int k = 0; k <= i % 4; ++k)
                damaged[rng.next() % damaged.size()] = char(rng.next());
            tryOne(name, damaged, "change " + std::to_string(i));
        }
        EXPECT_LT(peakMegabytes(), kMostMegabytes);
    }

private:
    void tryOne(const std::string& name, const std::string& bytes, const std::string& what) {
        LoadOptions options;
        options.memory_limit_mb = 300;
        const auto start = std::chrono::steady_clock::now();
        const Loaded loaded = tryLoad(folder_.write(name, bytes), options);
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        EXPECT_LT(seconds, kMostSeconds) << what;
        EXPECT_EQ(loaded.error.find('\n'), std::string::npos) << what << ": " << loaded.error;
        EXPECT_TRUE(loaded.error.empty() || loaded.code != ErrorCode::kInternal)
            << what << ": " << loaded.error;
    }

    TempFolder folder_;
};

TEST_F(IoDamaged, skinnedGlb) { tryDamages("t.glb", skinnedTriangle().glb(), kFlips); }
TEST_F(IoDamaged, meshoptGlb) { tryDamages("t.glb", meshoptSquare().glb(), kFlips); }
TEST_F(IoDamaged, dracoGlb) { tryDamages("t.glb", dracoTriangle().glb(), kFlips); }

TEST_F(IoDamaged, ply) {
    const std::string head =
        "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    std::string binary = "ply\nformat binary_little_endian 1.0\n" + head;
    for (const Vec3& p : {Vec3(0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)}) {
        binary.append(reinterpret_cast<const char*>(&p), sizeof p);
        binary += "abc";
    }
    binary += '\4';
    for (const int32_t i : {0, 1, 2, 3}) binary.append(reinterpret_cast<const char*>(&i), 4);
    tryDamages("b.ply", binary, kFlips / 2);
    tryDamages("a.ply",
               "ply\nformat ascii 1.0\n" + head +
                   "0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n4 0 1 2 3\n",
               kFlips / 2);
}

TEST_F(IoDamaged, obj) {
    tryDamages("t.obj",
               "mtllib t.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
               "usemtl m\nf 1/1/1 2/1/1 3//1 4\nf -1 -2 \\\n -3\np 1\nl 1 2\n",
               kFlips / 2);
}

}  // namespace
}  // namespace stipple
