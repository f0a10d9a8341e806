// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/hybrid.h>

#include <core/option_text.h>
#include <core/rng.h>
#include <core/stopwatch.h>
#include <scenegraph/io/edges.h>
#include <scenegraph/io/flatten.h>
#include <scenegraph/io/hybrid_surfels.h>
#include <scenegraph/io/load_context.h>
#include <scenegraph/io/patch_triangles.h>
#include <scenegraph/io/surfel_file.h>
#include <scenegraph/morton.h>
#include <scenegraph/surfel_finish.h>

#include <algorithm>
#include <cstdio>
#include <map>

namespace stipple {

void applyOption(HybridOptions& options, const std::string& key, const std::string& value) {
    if (key == "phase_one") {
        options.clusters.phase_one = numberOption(key, value, -10, 10, "-10..10");
    } else if (key == "phase_two") {
        options.clusters.phase_two = numberOption(key, value, -10, 10, "-10..10");
    } else if (key == "clusters") {
        options.clusters.clusters = int(numberOption(key, value, 0, 1e8, "0..100000000"));
    } else if (key == "flat_share") {
        options.clusters.flat_share = numberOption(key, value, 0, 1, "0..1");
    } else if (key == "largest") {
        options.clusters.largest = uint32_t(numberOption(key, value, 2, 1e6, "2..1000000"));
    } else if (key == "sampling") {
        options.sampling = numberOption(key, value, 0.25, 32, "0.25..32");
    } else if (key == "spacing") {
        options.spacing = numberOption(key, value, 0, 10, "0..10");
    } else if (key == "keep") {
        const std::map<std::string, PatchKind> kinds = {{"both", PatchKind::kBoth},
                                                        {"triangles", PatchKind::kTriangles},
                                                        {"surfels", PatchKind::kSurfels},
                                                        {"flatness", PatchKind::kByFlatness}};
        const auto found = kinds.find(value);
        if (found == kinds.end()) refuseOption(key, value, "both|triangles|surfels|flatness");
        options.keep = found->second;
    } else if (key == "paint") {
        if (value != "clusters" && value != "source") refuseOption(key, value, "source|clusters");
        options.paint_clusters = value == "clusters";
    } else if (key == "tolerance") {
        applyOption(options.splats, key, value);
    } else {
        throw Error(ErrorCode::kInvalidArgument, "--set",
                    "unknown option '" + key +
                        "' of hybrid (phase_one, phase_two, clusters, flat_share, largest, "
                        "sampling, spacing, keep, paint, tolerance)");
    }
}

namespace {

constexpr size_t kPatchTriangles = 256;                           // smaller clusters share a patch
constexpr size_t kFewSurfels = 16;                                // levels end there
constexpr double kFinest = 1.0 / 8192.0, kCoarsest = 1.0 / 64.0;  // spacings, of the diagonal
constexpr double kMostSamples = double(1 << 27);

// What a model is made of.
struct Source {
    Mesh mesh;
    std::vector<Material> materials;
    std::vector<Texture> textures;
    std::vector<float> patch_width;  // by material
};

struct Patch {
    std::vector<uint32_t> clusters;
    bool is_flat = true;  // all of its clusters are
};

class HybridBuilder {
public:
    HybridBuilder(Source source, const HybridOptions& options, const MemoryBudget& budget,
                  ThreadPool& pool, const CancelFlag& cancel, const BuildProgress& progress)
        : source_(std::move(source)),
          options_(options),
          budget_(budget),
          pool_(pool),
          cancel_(cancel),
          progress_(progress) {
        Box3 box;
        for (const UVec3& t : source_.mesh.triangles) {
            for (int k = 0; k < 3; ++k) box.extend(source_.mesh.positions[t[k]]);
        }
        bounds_ = box;
        diagonal_ = double(glm::length(box.extent()));
    }

    HybridModel build(HybridReport& report) {
        Stopwatch watch;
        progress_("clusters", 0.0);
        clusters_ = clusterFaces(source_.mesh, options_.clusters, cancel_);
        report.cluster_seconds = watch.seconds();
        progress_("surfels", 0.0);
        listTriangles();
        makePatches();
        if (options_.paint_clusters) paint();
        HybridModel model;
        model.patches.resize(patches_.size());
        watch = Stopwatch();
        if (options_.keep != PatchKind::kTriangles) sample(model);
        report.sample_seconds = watch.seconds();
        progress_("triangles", 0.0);
        watch = Stopwatch();
        if (options_.keep != PatchKind::kSurfels) simplify(model);
        report.simplify_seconds = watch.seconds();
        finish(model);
        fillReport(model, report);
        return model;
    }

private:
    void throwIfAsked() const {
        if (cancel_.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
    }

    void listTriangles() {
        triangles_of_.resize(clusters_.is_flat.size());
        for (uint32_t t = 0; t < clusters_.cluster_of.size(); ++t)
            triangles_of_[clusters_.cluster_of[t]].push_back(t);
    }

    DVec3 middleOf(const std::vector<uint32_t>& triangles) const {
        DVec3 sum(0.0);
        for (const uint32_t t : triangles) {
            for (int k = 0; k < 3; ++k)
                sum += DVec3(source_.mesh.positions[source_.mesh.triangles[t][k]]);
        }
        return sum / (3.0 * double(triangles.size()));
    }

    // Small clusters that lie near each other share a patch; flat ones with flat ones where that
    // says what they are kept as.
    void makePatches() {
        const double side = std::max({double(bounds_.extent().x), double(bounds_.extent().y),
                                      double(bounds_.extent().z), 1e-30});
        struct Key {
            bool is_flat;
            uint64_t code;
            uint32_t cluster;
        };
        std::vector<Key> order;
        for (uint32_t c = 0; c < triangles_of_.size(); ++c) {
            const bool is_flat =
                options_.keep == PatchKind::kByFlatness && clusters_.is_flat[c] != 0;
            order.push_back(
                {is_flat, mortonCode(middleOf(triangles_of_[c]), DVec3(bounds_.min), side), c});
        }
        std::sort(order.begin(), order.end(), [](const Key& a, const Key& b) {
            return std::tie(a.is_flat, a.code, a.cluster) < std::tie(b.is_flat, b.code, b.cluster);
        });
        size_t in_patch = 0;
        for (size_t i = 0; i < order.size(); ++i) {
            const size_t n = triangles_of_[order[i].cluster].size();
            const bool is_other = i > 0 && order[i].is_flat != order[i - 1].is_flat;
            if (patches_.empty() || is_other || in_patch >= kPatchTriangles ||
                (in_patch > 0 && in_patch + n > 2 * kPatchTriangles)) {
                patches_.emplace_back();
                patches_.back().is_flat = order[i].is_flat;
                in_patch = 0;
            }
            patches_.back().clusters.push_back(order[i].cluster);
            in_patch += n;
        }
    }

    // Gives each cluster a colour and vertices of its own.
    void paint() {
        Mesh& mesh = source_.mesh;
        Mesh painted;
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> index_of;  // of cluster and vertex
        for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
            const uint32_t cluster = clusters_.cluster_of[t];
            const uint64_t h = hashCombine(1, cluster);
            const auto part = [&](int k) {
                return 0.1f + 0.8f * float(h >> (16 * k) & 255) / 255.0f;
            };
            UVec3 triangle;
            for (int k = 0; k < 3; ++k) {
                const uint32_t v = mesh.triangles[t][k];
                const auto [at, is_new] =
                    index_of.emplace(std::pair(cluster, v), uint32_t(painted.positions.size()));
                if (is_new) {
                    painted.positions.push_back(mesh.positions[v]);
                    if (!mesh.normals.empty()) painted.normals.push_back(mesh.normals[v]);
                    painted.colors.emplace_back(part(0), part(1), part(2), 1.0f);
                }
                triangle[k] = at->second;
            }
            painted.triangles.push_back(triangle);
        }
        painted.triangle_material.assign(mesh.triangles.size(), 0);
        Material white;
        white.base_color = Vec3(1.0f);
        white.double_sided = true;
        source_ = {std::move(painted), {white}, {}, {float(diagonal_)}};
    }

    // Of a patch, by its own mean edge or alike for all.
    float spacingOf(const Patch& patch) const {
        if (options_.spacing > 0.0) return float(0.01 * options_.spacing * diagonal_);
        double sum = 0.0, edges = 0.0;
        for (const uint32_t c : patch.clusters) {
            for (const uint32_t t : triangles_of_[c]) {
                const UVec3& v = source_.mesh.triangles[t];
                for (int k = 0; k < 3; ++k) {
                    sum += double(glm::length(source_.mesh.positions[v[k]] -
                                              source_.mesh.positions[v[(k + 1) % 3]]));
                }
                edges += 3.0;
            }
        }
        return float(std::clamp(sum / edges / options_.sampling, kFinest * diagonal_,
                                kCoarsest * diagonal_));
    }

    std::vector<DMat3> rayDirections() const {
        std::vector<DMat3> rays;
        for (const Vec3& normal : clusters_.first_normal) rays.push_back(raysFromObject(normal));
        return rays;
    }

    // A piece: what one of the three grids samples of a flat cluster within a patch.
    SampledPieces makePieces(const std::vector<DMat3>& rays) const {
        SampledPieces pieces;
        pieces.piece_of.resize(source_.mesh.triangles.size());
        std::map<uint64_t, uint32_t> piece_at;
        for (uint32_t p = 0; p < patches_.size(); ++p) {
            pieces.spacing.push_back(spacingOf(patches_[p]));
            for (const uint32_t c : patches_[p].clusters) {
                for (const uint32_t t : triangles_of_[c]) {
                    const uint64_t first = clusters_.first_of[t];
                    const uint64_t axis = uint64_t(rayAxis(source_.mesh, t, rays[first]));
                    const auto [at, is_new] =
                        piece_at.emplace(first * 3 + axis, uint32_t(pieces.patch_of.size()));
                    if (is_new) pieces.patch_of.push_back(p);
                    pieces.piece_of[t] = at->second;
                }
            }
        }
        return pieces;
    }

    void requireFewSamples(const SampledPieces& pieces) const {
        double samples = 0.0;
        for (size_t t = 0; t < source_.mesh.triangles.size(); ++t) {
            const UVec3& v = source_.mesh.triangles[t];
            const DVec3 p(source_.mesh.positions[v.x]);
            const double h = double(pieces.spacing[pieces.patch_of[pieces.piece_of[t]]]);
            samples += 0.5 *
                       glm::length(glm::cross(DVec3(source_.mesh.positions[v.y]) - p,
                                              DVec3(source_.mesh.positions[v.z]) - p)) /
                       (h * h);
        }
        // On borders, and one more a corner.
        for (const SharedEdge& e : sharedEdges(source_.mesh)) {
            const uint32_t a = pieces.piece_of[e.a],
                           b = e.b == kNoTriangle ? a : pieces.piece_of[e.b];
            if (a == b && e.b != kNoTriangle) continue;
            const float h =
                std::min(pieces.spacing[pieces.patch_of[a]], pieces.spacing[pieces.patch_of[b]]);
            samples +=
                1.0 +
                double(glm::length(source_.mesh.positions[e.to] - source_.mesh.positions[e.from])) /
                    double(h);
        }
        if (samples > kMostSamples)
            throw Error(ErrorCode::kInvalidArgument, "--set",
                        "more than 2^27 surfels: take a coarser spacing or sampling");
        constexpr double kBytesPerSample = 240.0;
        char text[64];
        std::snprintf(text, sizeof text, "%.4g samples of surfaces and borders", samples);
        budget_.require(samples * kBytesPerSample, "--set", text);
    }

    void sample(HybridModel& model) {
        const SampledSurface surface = {source_.mesh, source_.materials, source_.textures};
        const std::vector<DMat3> rays = rayDirections();
        const SampledPieces pieces = makePieces(rays);
        requireFewSamples(pieces);
        std::vector<std::vector<SurfelSample>> samples = sampleBorders(surface, pieces);
        pool_.forEach(patches_.size(), [&](size_t p, int) {
            throwIfAsked();
            if (options_.keep == PatchKind::kByFlatness && patches_[p].is_flat) {
                samples[p].clear();
                return;
            }
            for (const uint32_t c : patches_[p].clusters) {
                for (const uint32_t t : triangles_of_[c])
                    sampleFace(surface, t, rays[clusters_.first_of[t]], pieces.spacing[p],
                               samples[p]);
            }
            thinToLevels(samples[p], pieces.spacing[p], kFewSurfels);
        });
        std::map<uint32_t, uint8_t> index_of;
        for (const auto& list : samples) {
            for (const SurfelSample& s : list) index_of[s.finish_key] = 0;
        }
        model.finishes = makeFinishes(source_.materials, source_.patch_width, index_of);
        pool_.forEach(patches_.size(), [&](size_t p, int) {
            throwIfAsked();
            packLevels(samples[p], index_of, model.finishes, pieces.spacing[p],
                       model.patches[p].surfels);
        });
    }

    static void packLevels(const std::vector<SurfelSample>& samples,
                           const std::map<uint32_t, uint8_t>& index_of,
                           const std::vector<SurfelFinish>& finishes, float spacing,
                           std::vector<SurfelLevel>& levels) {
        for (int l = 0;; ++l) {
            std::vector<Surfel> surfels;
            for (const SurfelSample& s : samples) {
                if (int(s.levels) <= l) continue;
                surfels.push_back(s.surfel);
                surfels.back().finish = index_of.at(s.finish_key);
            }
            if (surfels.empty()) return;
            levels.push_back(packSurfels(std::move(surfels), finishes,
                                         spacing * std::exp2(0.5f * float(l)),
                                         SurfelDiscs::kAlike));
        }
    }

    void simplify(HybridModel& model) {
        pool_.forEach(patches_.size(), [&](size_t p, int) {
            throwIfAsked();
            if (options_.keep == PatchKind::kByFlatness && !patches_[p].is_flat &&
                !model.patches[p].surfels.empty())
                return;
            std::vector<uint32_t> triangles;
            for (const uint32_t c : patches_[p].clusters)
                triangles.insert(triangles.end(), triangles_of_[c].begin(), triangles_of_[c].end());
            model.patches[p].triangles = simplifyPatch(source_.mesh, source_.materials, triangles);
        });
    }

    // Triangles as a whole, vertices, and the materials and textures that they use.
    void finish(HybridModel& model) {
        model.mesh = std::move(source_.mesh);
        model.triangles = std::move(model.mesh.triangles);
        model.triangle_material = std::move(model.mesh.triangle_material);
        model.mesh.triangles.clear();
        model.mesh.triangle_material.clear();
        std::map<int, int> material_at, texture_at;
        for (const uint16_t m : model.triangle_material) material_at[m] = 0;
        for (auto& [from, to] : material_at) {
            to = int(model.materials.size());
            model.materials.push_back(source_.materials[size_t(from)]);
            for (int* texture : textureIndices(model.materials.back())) {
                if (*texture == kNoTexture) continue;
                const auto [at, is_new] = texture_at.emplace(*texture, int(model.textures.size()));
                if (is_new) {
                    model.textures.push_back(source_.textures[size_t(*texture)]);
                    model.textures.back().levels.resize(1);
                }
                *texture = at->second;
            }
        }
        const auto renumber = [&](std::vector<uint16_t>& list) {
            for (uint16_t& m : list) m = uint16_t(material_at.at(m));
        };
        renumber(model.triangle_material);
        for (HybridPatch& patch : model.patches) {
            for (TriangleLevel& level : patch.triangles) renumber(level.material);
        }
        // A patch of nothing but masked-out surface has neither.
        std::erase_if(model.patches, [](const HybridPatch& patch) {
            return patch.triangles.empty() && patch.surfels.empty();
        });
    }

    void fillReport(const HybridModel& model, HybridReport& report) const {
        report.triangles = model.triangles.size();
        report.clusters_phase_one = uint32_t(clusters_.first_normal.size());
        report.clusters = uint32_t(clusters_.is_flat.size());
        report.patches = uint32_t(model.patches.size());
        for (uint32_t c = 0; c < report.clusters; ++c) {
            if (!clusters_.is_flat[c]) continue;
            ++report.flat_clusters;
            report.flat_share += double(triangles_of_[c].size()) / double(report.triangles);
        }
        for (const HybridPatch& patch : model.patches) {
            if (!patch.surfels.empty()) report.surfels += patch.surfels[0].size();
            for (const SurfelLevel& level : patch.surfels)
                report.surfels_all_levels += level.size();
            for (const TriangleLevel& level : patch.triangles)
                report.triangles_all_levels += level.triangles.size();
        }
    }

    Source source_;
    const HybridOptions& options_;
    const MemoryBudget& budget_;
    ThreadPool& pool_;
    const CancelFlag& cancel_;
    const BuildProgress& progress_;
    Box3 bounds_;
    double diagonal_ = 0.0;
    FaceClusters clusters_;
    std::vector<std::vector<uint32_t>> triangles_of_;  // clusters
    std::vector<Patch> patches_;
};

// Whether nothing but point clouds is shown.
bool isCloud(const Scene& scene) {
    const std::vector<double> shown = meshInstances(scene);
    bool has_cloud = false;
    for (size_t m = 0; m < shown.size(); ++m) {
        if (shown[m] == 0.0 || scene.meshes[m].triangles.empty()) continue;
        if (!scene.meshes[m].is_cloud) return false;
        has_cloud = true;
    }
    return has_cloud;
}

void requireFewTriangles(const Scene& scene, const MemoryBudget& budget) {
    constexpr double kBytesEach = 600.0;  // flattened, and to find clusters
    const std::vector<double> shown = meshInstances(scene);
    double triangles = 0.0;
    for (size_t m = 0; m < shown.size(); ++m)
        triangles += shown[m] * double(scene.meshes[m].triangles.size());
    char text[64];
    std::snprintf(text, sizeof text, "%.4g triangles of all instances", triangles);
    budget.require(triangles * kBytesEach, scene.path, text);
}

Source sourceOf(const Scene& scene, const HybridOptions& options, const MemoryBudget& budget,
                ThreadPool& pool, const CancelFlag& cancel, const BuildProgress& progress) {
    Source source;
    if (!isCloud(scene)) {
        requireFewTriangles(scene, budget);
        source.mesh = flattenScene(scene, cancel);
        source.materials = scene.materials;
        source.textures = scene.textures;
        source.patch_width = materialPatchWidths(scene);
        return source;
    }
    SplatReport report;
    SplatOptions splat_options = options.splats;
    splat_options.memory_limit_mb = options.memory_limit_mb;
    const SurfelModel splats = buildSplats(scene, splat_options, pool, cancel, progress, report);
    source.mesh = discPolygons(splats, splats.levels[0], kDiscSide);
    for (const SurfelFinish& finish : splats.finishes) {
        source.materials.push_back(finish.material);
        source.materials.back().base_color = Vec3(1.0f);
        source.patch_width.push_back(finish.patch_width);
    }
    return source;
}

}  // namespace

HybridModel buildHybrid(const Scene& scene, const HybridOptions& options, ThreadPool& pool,
                        const CancelFlag& cancel, const BuildProgress& progress,
                        HybridReport& report) {
    const Stopwatch watch;
    const MemoryBudget budget = budgetBeside(scene, options.memory_limit_mb);
    HybridBuilder builder(sourceOf(scene, options, budget, pool, cancel, progress), options, budget,
                          pool, cancel, progress);
    HybridModel model = builder.build(report);
    report.seconds = watch.seconds();
    return model;
}

}  // namespace stipple
