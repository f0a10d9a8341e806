// SPDX-License-Identifier: Apache-2.0
// What edits of a growing cloud of splats cost: `bench_splat_cloud [POINTS]` builds a sphere of
// that many points (10^6), then adds and removes patches of 100, and 100 scattered over it, and
// says what each took.
#include <core/rng.h>
#include <core/stopwatch.h>
#include <scenegraph/io/splat_cloud.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

using namespace stipple;

namespace {

CloudPoint onSphere(double z, double angle) {
    const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
    const DVec3 p(r * std::cos(angle), z, r * std::sin(angle));
    // Some waves, so that curvature varies.
    return {p * (1.0 + 0.02 * std::sin(9.0 * p.x) * std::sin(8.0 * p.y)), Vec3(p), Vec3(0.8f)};
}

struct Times {
    std::vector<double> ms;
    void add(const Stopwatch& watch) { ms.push_back(watch.seconds() * 1000.0); }
    void print(const char* what) {
        std::sort(ms.begin(), ms.end());
        std::printf("%-34s median %.3f ms, 95 %% within %.3f ms, most %.3f ms\n", what,
                    ms[ms.size() / 2], ms[ms.size() * 95 / 100], ms.back());
    }
};

}  // namespace

int main(int argc, char** argv) {
    const int n = argc > 1 ? std::atoi(argv[1]) : 1000000;
    std::vector<CloudPoint> points;
    for (int i = 0; i < n; ++i) points.push_back(onSphere(1.0 - (2.0 * i + 1.0) / n, 2.399963 * i));
    ThreadPool pool(0);
    Stopwatch watch;
    SplatCloud cloud(points, SplatOptions(), pool);
    std::printf("%d points, %zu splats: built in %.1f s\n", n, cloud.splatCount(), watch.seconds());
    Rng rng{7};
    Times add_patch, remove_patch, add_scattered, remove_scattered;
    const double patch = 10.0 * std::sqrt(4.0 * kPi / n);  // side of 100 points
    for (int round = 0; round < 200; ++round) {
        const double z = rng.uniform(-0.9, 0.9), angle = rng.uniform(0.0, 2.0 * kPi);
        std::vector<CloudPoint> near, scattered;
        for (int i = 0; i < 100; ++i) {
            near.push_back(onSphere(z + rng.uniform(0.0, patch), angle + rng.uniform(0.0, patch)));
            scattered.push_back(onSphere(rng.uniform(-1.0, 1.0), rng.uniform(0.0, 2.0 * kPi)));
        }
        for (int what = 0; what < 2; ++what) {
            watch = Stopwatch();
            const uint32_t first = cloud.append(what == 0 ? near : scattered);
            (what == 0 ? add_patch : add_scattered).add(watch);
            std::vector<uint32_t> numbers;
            // Points that were there before: in one place, or anywhere.
            while (numbers.size() < 100) {
                const uint32_t k = what == 0 ? first + uint32_t(numbers.size())
                                             : uint32_t(rng.uniform(0.0, double(n)));
                if (what == 0 || points[k].color != Vec3(0.0f)) numbers.push_back(k);
                if (what == 1) points[k].color = Vec3(0.0f);  // taken
            }
            watch = Stopwatch();
            cloud.remove(numbers);
            (what == 0 ? remove_patch : remove_scattered).add(watch);
        }
    }
    add_patch.print("100 points added in a patch");
    remove_patch.print("the same removed");
    add_scattered.print("100 points added anywhere");
    remove_scattered.print("100 points removed anywhere");
    // A hole, by all points of a patch, and the patch again.
    Times open_hole, close_hole;
    for (int round = 0; round < 50; ++round) {
        const uint32_t start = uint32_t(rng.uniform(0.2, 0.8) * n);
        const DVec3 center = points[start].position;
        std::vector<uint32_t> numbers;
        std::vector<CloudPoint> taken;
        for (uint32_t i = 0; i < uint32_t(n) && numbers.size() < 100; ++i) {
            if (points[i].color == Vec3(0.0f) ||
                glm::length(points[i].position - center) > 0.6 * patch)
                continue;
            numbers.push_back(i);
            taken.push_back(points[i]);
            points[i].color = Vec3(0.0f);
        }
        for (CloudPoint& p : taken) p.color = Vec3(0.8f);
        watch = Stopwatch();
        cloud.remove(numbers);
        open_hole.add(watch);
        watch = Stopwatch();
        cloud.append(taken);
        close_hole.add(watch);
    }
    open_hole.print("a hole of 100 points opened");
    close_hole.print("and closed");
    watch = Stopwatch();
    const SurfelModel model = cloud.model();
    std::printf("%zu points, %zu splats; a model of them to draw: %.1f ms\n", cloud.pointCount(),
                model.levels[0].size(), watch.seconds() * 1000.0);
    return 0;
}
