// SPDX-License-Identifier: Apache-2.0
#include <sampling/point_blocks.h>

#include <core/option_text.h>
#include <core/stopwatch.h>
#include <sampling/cover_grid.h>
#include <scenegraph/surfel_finish.h>
#include <scenegraph/visible_area.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace stipple {

void applyOption(PointBlockOptions& options, const std::string& key, const std::string& value) {
    if (key == "resolution") {
        options.resolution = int(numberOption(key, value, 8, 2048, "8..2048"));
    } else if (key == "tolerance_angle") {
        options.tolerance_angle = numberOption(key, value, 0, 80, "0..80");
    } else if (key == "block_size") {
        options.block_size = int(numberOption(key, value, 1, 64, "1..64"));
    } else if (key == "lattice") {
        if (value != "triangles" && value != "squares")
            refuseOption(key, value, "triangles|squares");
        options.equilateral = value == "triangles";
    } else if (key == "scored") {
        options.scored = switchOption(key, value);
    } else if (key == "partial") {
        options.partial = switchOption(key, value);
    } else if (key == "complete") {
        options.complete = switchOption(key, value);
    } else if (key == "directions") {
        if (value != "6" && value != "32" && value != "128") refuseOption(key, value, "6|32|128");
        options.directions = std::stoi(value);
    } else {
        throw Error(ErrorCode::kInvalidArgument, "--set",
                    "unknown option '" + key +
                        "' of point-blocks (resolution, tolerance_angle, block_size, lattice, "
                        "scored, partial, complete, directions)");
    }
}

namespace {

constexpr float kEyeDistance = 20.0f;    // of orthographic rays, in radii: footprints hardly grow
constexpr float kDepthTolerance = 2.0f;  // pixels: what lies no deeper is the same surface
constexpr float kDiscReach = 0.55f;      // pixels: radius of what a sample makes up for
// Gaps are looked for from so many directions, by rays at every few places of each one's lattice.
constexpr int kOpenDirections = 4096, kOpenStride = 4;
constexpr int kRotations = 4, kShifts = 4, kTests = kRotations * kShifts;

struct Sample {
    Vec3 position = Vec3(0), normal = Vec3(0), albedo = Vec3(0);  // relative to the centre
    float facing = 0.0f;  // cosine of the angle to the projection's direction
    uint32_t finish_key = 0;
    bool is_double_sided = false;

    // Whether it may be seen from there. Where a part is thin, points of its far side lie where
    // those of its near side would, but cones leave them out. Shading normals may be a little off.
    bool mayFace(const Vec3& to_viewer) const {
        return is_double_sided || glm::dot(normal, to_viewer) > -0.2f;
    }
};

Vec3 projectionOf(int index, int count) {
    if (count == 6) {
        Vec3 axis(0.0f);
        axis[index / 2] = index % 2 ? -1.0f : 1.0f;
        return axis;
    }
    return count == 32 ? directionOf(index) : maskDirectionOf(index);
}

// Orthonormal, z towards the viewer, turned about it.
Mat3 viewFromObject(const Vec3& to_viewer, float angle) {
    const Vec3 other = std::abs(to_viewer.y) < 0.9f ? Vec3(0, 1, 0) : Vec3(1, 0, 0);
    const Vec3 x = glm::normalize(glm::cross(other, to_viewer)), y = glm::cross(to_viewer, x);
    const float c = std::cos(angle), s = std::sin(angle);
    return glm::transpose(Mat3(x * c + y * s, y * c - x * s, to_viewer));
}

// A picture of a model from far away: pixels of side `pixel`, heights towards the viewer.
class Picture {
public:
    Picture(const Mat3& view, float pixel, float radius, Vec2 shift)
        : view_(view / pixel),
          pixel_(pixel),
          shift_(shift + radius / pixel + 1.0f),
          side_(int(2.0f * radius / pixel) + 4) {
        height_.assign(size_t(side_) * size_t(side_), -kInfinity);
    }

    // Index of the pixel, and the height in pixels.
    size_t pixelOf(const Vec3& p, float& height) const {
        const Vec3 q = view_ * p;
        height = q.z;
        const int x = std::clamp(int(q.x + shift_.x), 0, side_ - 1),
                  y = std::clamp(int(q.y + shift_.y), 0, side_ - 1);
        return size_t(y) * size_t(side_) + size_t(x);
    }
    void draw(const Vec3& p) {
        float height;
        float& there = height_[pixelOf(p, height)];
        there = std::max(there, height);
    }
    // Whether something stands at p's pixel that is as near as p, or nearer.
    bool covers(const Vec3& p) const {
        float height;
        const size_t i = pixelOf(p, height);
        return height_[i] >= height - kDepthTolerance;
    }
    // Whether p is part of what is seen.
    bool shows(const Vec3& p, size_t& pixel) const {
        float height;
        pixel = pixelOf(p, height);
        return height >= height_[pixel] - kDepthTolerance;
    }
    size_t pixels() const { return height_.size(); }

private:
    Mat3 view_;
    float pixel_;
    Vec2 shift_;
    int side_;
    std::vector<float> height_;
};

Picture testPicture(const Vec3& to_viewer, int test, float pixel, float radius) {
    const float angle = float(test / kShifts) * float(kPi) / 8.0f;
    const Vec2 shift(test % 2 ? 0.5f : 0.0f, test % kShifts >= 2 ? 0.5f : 0.0f);
    return Picture(viewFromObject(to_viewer, angle), pixel, radius, shift);
}

// Spread evenly over the sphere: a Fibonacci lattice.
Vec3 spreadDirection(int index, int count) {
    const float y = 1.0f - (2.0f * float(index) + 1.0f) / float(count), r = std::sqrt(1.0f - y * y);
    const double turn = double(index) * 2.399963229728653;
    return Vec3(r * float(std::cos(turn)), y, r * float(std::sin(turn)));
}

// From where it is found which blocks are seen, and for which mask directions that counts: for all
// whose parts of the sphere lie near, as views do not see all that is seen from between them.
struct MaskView {
    Vec3 to_viewer;
    std::array<uint64_t, 2> directions = {0, 0};  // a bit each
};

std::vector<MaskView> makeMaskViews() {
    constexpr int kViews = 24 * kMaskDirections, kAround = 8;
    constexpr float kMargin = 0.15f;  // radians, about: twice as far as views are apart
    std::vector<MaskView> views(kViews);
    for (int i = 0; i < kViews; ++i) {
        MaskView& view = views[size_t(i)];
        view.to_viewer = spreadDirection(i, kViews);
        const auto add = [&](const Vec3& direction) {
            const int m = maskDirectionIndex(direction);
            view.directions[size_t(m / 64)] |= 1ull << (m % 64);
        };
        add(view.to_viewer);
        for (int k = 0; k < kAround; ++k) {
            const float angle = float(2.0 * kPi) * float(k) / kAround;
            add(view.to_viewer +
                glm::transpose(viewFromObject(view.to_viewer, angle))[0] * kMargin);
        }
    }
    return views;
}

class Builder {
public:
    Builder(const RayCaster& caster, const std::vector<Material>& materials, double radius,
            const PointBlockOptions& options, ThreadPool& pool, const CancelFlag& cancel)
        : caster_(caster),
          materials_(materials),
          radius_(float(radius)),
          options_(options),
          pool_(pool),
          cancel_(cancel) {}

    PointBlockReport report;
    uint64_t rays() const { return rays_cast_; }

    // Samples without holes where pixels are that large.
    std::vector<Sample> build(float pixel, const std::function<void(double)>& progress) {
        const int n = options_.directions;
        std::vector<std::vector<Sample>> seen(static_cast<size_t>(n));
        // A view's samples, block by block; blocks begin at block_begin.
        std::vector<std::vector<uint32_t>> block_begin(seen.size());
        for (int d = 0; d < n; ++d) {
            sampleView(projectionOf(d, n), pixel, seen[size_t(d)], block_begin[size_t(d)]);
            progress(0.3 * double(d + 1) / n);
        }
        std::vector<Sample> chosen;
        const float adequate = float(std::cos(radians(options_.tolerance_angle)));
        // First what a view samples well, then what no view does.
        const int rounds = options_.scored ? 2 : 1;
        for (int round = 0; round < rounds; ++round) {
            const float least = options_.scored && round == 0 ? adequate : -1.0f;
            for (int d = 0; d < n; ++d) {
                choose(projectionOf(d, n), pixel, seen[size_t(d)], block_begin[size_t(d)], least,
                       chosen);
                progress(0.3 + 0.25 * (double(d + 1) / n + round) / rounds);
            }
        }
        seen.clear();
        report.samples_chosen = std::max(report.samples_chosen, uint64_t(chosen.size()));
        if (options_.partial) removeNeedless(pixel, chosen);
        progress(0.75);
        if (options_.complete) closeGaps(pixel, progress, chosen);
        lookFromAbove(pixel, chosen);
        progress(1.0);
        return chosen;
    }

    // Which mask directions see each block.
    void findMasks(const std::vector<SurfelFinish>& finishes, float pixel, SurfelLevel& level) {
        static const std::vector<MaskView> views = makeMaskViews();
        struct Seen {
            Vec3 position, normal;
            bool is_double_sided;
        };
        std::vector<Seen> points(level.size());
        for (const SurfelBlock& b : level.blocks) {
            for (uint32_t i = b.first; i < b.first + b.count; ++i) {
                const Surfel s = unpackSurfel(level, b, i);
                points[i] = {s.position, s.normal, finishes[s.finish].material.double_sided};
            }
        }
        using Mask = std::array<uint64_t, 2>;
        std::vector<std::vector<Mask>> of_worker(static_cast<size_t>(pool_.threadCount()),
                                                 std::vector<Mask>(level.blocks.size(), {0, 0}));
        pool_.forEach(views.size(), [&](size_t v, int worker) {
            throwIfAsked();
            const Vec3& to_viewer = views[v].to_viewer;
            Picture picture(viewFromObject(to_viewer, 0.0f), pixel, radius_, Vec2(0.0f));
            // Backs are left out when a model is drawn: they hide nothing. Where a surface has an
            // opening one sees through them what lies beyond.
            for (const Seen& p : points) {
                if (p.is_double_sided || glm::dot(p.normal, to_viewer) > 0.0f)
                    picture.draw(p.position);
            }
            for (size_t k = 0; k < level.blocks.size(); ++k) {
                const SurfelBlock& b = level.blocks[k];
                bool is_seen = false;
                size_t ignored;
                for (uint32_t i = b.first; i < b.first + b.count && !is_seen; ++i)
                    is_seen = picture.shows(points[i].position, ignored);
                Mask& mask = of_worker[size_t(worker)][k];
                for (size_t w = 0; is_seen && w < mask.size(); ++w)
                    mask[w] |= views[v].directions[w];
            }
        });
        for (size_t k = 0; k < level.blocks.size(); ++k) {
            Mask bits = {0, 0};
            for (const std::vector<Mask>& masks : of_worker) {
                for (size_t w = 0; w < bits.size(); ++w) bits[w] |= masks[k][w];
            }
            level.blocks[k].visible_from = bits;
        }
    }

private:
    void throwIfAsked() const {
        if (cancel_.requested) throw Error(ErrorCode::kCancelled, "", "cancelled");
    }

    // Towards -to_viewer, from outside.
    Ray rayThrough(const Vec3& p, const Vec3& to_viewer) const {
        Ray ray;
        ray.direction = -to_viewer;
        ray.origin = p + to_viewer * (kEyeDistance * radius_ - glm::dot(p, to_viewer));
        ray.t_min = (kEyeDistance - 1.01f) * radius_;
        return ray;
    }
    void cast(const std::vector<Ray>& rays, float pixel, std::vector<RayHit>& hits) {
        hits.resize(rays.size());
        const float footprint = pixel * std::sqrt(2.0f) / (kEyeDistance * radius_);
        caster_.cast(rays.data(), rays.size(), hits.data(), footprint);
        rays_cast_ += rays.size();
    }
    Sample sampleOf(const Ray& ray, const RayHit& hit) const {
        Sample s;
        s.position = ray.origin + ray.direction * hit.t;
        s.normal = hit.normal_world;
        s.albedo = hit.albedo;
        s.facing = std::abs(glm::dot(s.normal, ray.direction));
        s.is_double_sided = materials_[hit.material].double_sided;
        s.finish_key = finishKey(materials_, hit.material, hit.finish);
        return s;
    }

    // Where rays towards -to_viewer pass: so far apart that surfaces tilted less than the tolerance
    // angle are adequately sampled.
    struct Lattice {
        Vec3 to_viewer, u, v;  // u and v: steps in object space
        int half_u, half_v;    // steps from the middle that reach to the borders

        Vec3 at(int i, int j) const { return u * float(i) + v * float(j); }
    };
    Lattice makeLattice(const Vec3& to_viewer, float pixel) const {
        const Mat3 object_from_view = glm::transpose(viewFromObject(to_viewer, 0.0f));
        const float cosine = float(std::cos(radians(options_.tolerance_angle)));
        // Sides of the lattice's triangles are `spacing` long; of squares, the diagonals.
        const float spacing = pixel * cosine * (options_.equilateral ? 1.0f : std::sqrt(0.5f));
        const Vec2 u(spacing, 0.0f), v = options_.equilateral
                                             ? Vec2(0.5f * spacing, spacing * std::sqrt(0.75f))
                                             : Vec2(0.0f, spacing);
        const int half_v = int(std::ceil(radius_ / v.y)) + 1;
        const int half_u = int(std::ceil(radius_ / u.x + 0.5f * float(half_v))) + 1;
        return {to_viewer, object_from_view * Vec3(u, 0.0f), object_from_view * Vec3(v, 0.0f),
                half_u, half_v};
    }

    // Samples of the whole lattice.
    void sampleView(const Vec3& to_viewer, float pixel, std::vector<Sample>& samples,
                    std::vector<uint32_t>& block_begin) {
        const Lattice lattice = makeLattice(to_viewer, pixel);
        const int half_u = lattice.half_u, half_v = lattice.half_v;
        const int b = options_.block_size;
        const int columns = (2 * half_u + b) / b, rows = (2 * half_v + b) / b;
        std::vector<std::vector<Sample>> of_row(static_cast<size_t>(rows));
        std::vector<std::vector<uint32_t>> begin_of_row(of_row.size());
        pool_.forEach(of_row.size(), [&](size_t row, int) {
            throwIfAsked();
            std::vector<Ray> rays;
            std::vector<RayHit> hits;
            for (int column = 0; column < columns; ++column) {
                rays.clear();
                for (int k = 0; k < b * b; ++k) {
                    const int i = column * b + k % b - half_u, j = int(row) * b + k / b - half_v;
                    const Vec3 q = lattice.at(i, j);
                    if (glm::dot(q, q) > radius_ * radius_) continue;
                    rays.push_back(rayThrough(q, to_viewer));
                }
                if (rays.empty()) continue;
                cast(rays, pixel, hits);
                const size_t before = of_row[row].size();
                for (size_t k = 0; k < rays.size(); ++k) {
                    if (!(hits[k].t < kInfinity)) continue;
                    of_row[row].push_back(sampleOf(rays[k], hits[k]));
                }
                if (of_row[row].size() > before) begin_of_row[row].push_back(uint32_t(before));
            }
        });
        for (size_t row = 0; row < of_row.size(); ++row) {
            const uint32_t offset = uint32_t(samples.size());
            for (const uint32_t begin : begin_of_row[row]) block_begin.push_back(offset + begin);
            samples.insert(samples.end(), of_row[row].begin(), of_row[row].end());
        }
        block_begin.push_back(uint32_t(samples.size()));
        report.samples_hit += samples.size();
    }

    // Adds the view's blocks that what was chosen does not make up for.
    void choose(const Vec3& to_viewer, float pixel, const std::vector<Sample>& samples,
                const std::vector<uint32_t>& block_begin, float least_facing,
                std::vector<Sample>& chosen) {
        std::vector<std::vector<uint8_t>> missing(kTests);
        pool_.forEach(kTests, [&](size_t test, int) {
            throwIfAsked();
            Picture picture = testPicture(to_viewer, int(test), pixel, radius_);
            for (const Sample& s : chosen) {
                if (s.mayFace(to_viewer)) picture.draw(s.position);
            }
            std::vector<uint8_t>& of_block = missing[test];
            of_block.assign(block_begin.size() - 1, 0);
            for (size_t b = 0; b + 1 < block_begin.size(); ++b) {
                for (uint32_t i = block_begin[b]; i < block_begin[b + 1] && !of_block[b]; ++i) {
                    if (samples[i].facing >= least_facing)
                        of_block[b] = !picture.covers(samples[i].position);
                }
            }
        });
        for (size_t b = 0; b + 1 < block_begin.size(); ++b) {
            const bool is_missing = std::any_of(missing.begin(), missing.end(),
                                                [&](const auto& of_block) { return of_block[b]; });
            if (!is_missing) continue;
            for (uint32_t i = block_begin[b]; i < block_begin[b + 1]; ++i) {
                if (samples[i].facing >= least_facing) chosen.push_back(samples[i]);
            }
        }
    }

    // Leaves out samples without which every pixel of every test still shows its surface, those at
    // the worst angles first.
    void removeNeedless(float pixel, std::vector<Sample>& chosen) {
        const int n = options_.directions;
        const size_t n_pictures = size_t(n) * kTests;
        std::vector<std::vector<uint8_t>> counts(n_pictures);  // of samples that a pixel shows
        std::vector<std::unique_ptr<Picture>> pictures(n_pictures);
        pool_.forEach(n_pictures, [&](size_t k, int) {
            throwIfAsked();
            auto picture = std::make_unique<Picture>(
                testPicture(projectionOf(int(k) / kTests, n), int(k) % kTests, pixel, radius_));
            const Vec3 to_viewer = projectionOf(int(k) / kTests, n);
            for (const Sample& s : chosen) {
                if (s.mayFace(to_viewer)) picture->draw(s.position);
            }
            counts[k].assign(picture->pixels(), 0);
            size_t i;
            for (const Sample& s : chosen) {
                if (s.mayFace(to_viewer) && picture->shows(s.position, i) && counts[k][i] < 255)
                    ++counts[k][i];
            }
            pictures[k] = std::move(picture);
        });
        std::vector<uint32_t> order(chosen.size());
        for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
        std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
            return chosen[a].facing < chosen[b].facing;
        });
        std::vector<uint8_t> is_removed(chosen.size(), 0);
        std::vector<std::pair<uint32_t, uint32_t>> shown;
        for (size_t o = 0; o < order.size(); ++o) {
            if (o % 4096 == 0) throwIfAsked();
            const Sample& s = chosen[order[o]];
            shown.clear();
            bool is_needed = false;
            for (size_t k = 0; k < n_pictures && !is_needed; ++k) {
                size_t i;
                if (!s.mayFace(projectionOf(int(k) / kTests, n)) ||
                    !pictures[k]->shows(s.position, i))
                    continue;
                is_needed = counts[k][i] <= 1 || counts[k][i] == 255;
                shown.emplace_back(uint32_t(k), uint32_t(i));
            }
            if (is_needed) continue;
            is_removed[order[o]] = 1;
            for (const auto& [k, i] : shown) --counts[k][i];
        }
        size_t kept = 0;
        for (size_t i = 0; i < chosen.size(); ++i) {
            if (!is_removed[i]) chosen[kept++] = chosen[i];
        }
        chosen.resize(kept);
    }

    // More samples beside one that its projection sees at a slant, as close along the surface as
    // others are.
    void sampleBeside(Sample s, const Vec3& to_viewer, float pixel, std::vector<Sample>& samples) {
        constexpr float kMostSteps = 8.0f;
        const int steps = int(std::min(1.0f / std::max(s.facing, 1e-3f), kMostSteps));
        const Vec3 across = s.normal - to_viewer * glm::dot(s.normal, to_viewer);
        if (steps < 2 || !(glm::dot(across, across) > 0.0f)) return;
        const Vec3 step = glm::normalize(across) * (pixel / float(steps));
        std::vector<Ray> rays;
        std::vector<RayHit> hits;
        for (int i = 1; i < steps; ++i)
            rays.push_back(rayThrough(s.position + step * float(i), to_viewer));
        cast(rays, pixel, hits);
        for (size_t k = 0; k < rays.size(); ++k) {
            if (hits[k].t < kInfinity) samples.push_back(sampleOf(rays[k], hits[k]));
        }
    }

    // A place of a lattice.
    struct Place {
        int i, j;
    };

    // Places of every few of the lattice whose rays find a surface that no disc covers.
    std::vector<Place> findOpen(const Lattice& lattice, int first, float pixel,
                                const CoverGrid& grid) {
        constexpr int kStride = kOpenStride;
        std::vector<Place> places, open;
        std::vector<Ray> rays;
        std::vector<RayHit> hits;
        for (int j = first / kStride - lattice.half_v; j <= lattice.half_v; j += kStride) {
            places.clear(), rays.clear();
            for (int i = first % kStride - lattice.half_u; i <= lattice.half_u; i += kStride) {
                const Vec3 q = lattice.at(i, j);
                if (glm::dot(q, q) > radius_ * radius_) continue;
                places.push_back({i, j});
                rays.push_back(rayThrough(q, lattice.to_viewer));
            }
            cast(rays, pixel, hits);
            for (size_t k = 0; k < rays.size(); ++k) {
                if (!(hits[k].t < kInfinity)) continue;
                const Sample s = sampleOf(rays[k], hits[k]);
                if (!grid.covers(s.position, s.normal)) open.push_back(places[k]);
            }
        }
        return open;
    }

    // Adds samples there and at the places around, as far as the surface is open.
    void fillOpen(const Lattice& lattice, std::vector<Place> places, float pixel, CoverGrid& grid,
                  std::vector<Sample>& chosen) {
        std::set<std::pair<int, int>> visited;
        for (const Place& p : places) visited.emplace(p.i, p.j);
        std::vector<Place> next;
        std::vector<Ray> rays;
        std::vector<RayHit> hits;
        std::vector<Sample> near;
        while (!places.empty()) {
            throwIfAsked();
            rays.clear(), next.clear();
            for (const Place& p : places)
                rays.push_back(rayThrough(lattice.at(p.i, p.j), lattice.to_viewer));
            cast(rays, pixel, hits);
            for (size_t k = 0; k < rays.size(); ++k) {
                if (!(hits[k].t < kInfinity)) continue;
                near.assign(1, sampleOf(rays[k], hits[k]));
                sampleBeside(near[0], lattice.to_viewer, pixel, near);
                bool was_open = false;
                for (const Sample& s : near) {
                    if (grid.covers(s.position, s.normal)) continue;
                    was_open = true;
                    grid.add(s.position, s.normal);
                    chosen.push_back(s);
                }
                if (!was_open) continue;
                constexpr Place kAround[] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
                for (const Place& step : kAround) {
                    const Place p = {places[k].i + step.i, places[k].j + step.j};
                    if (visited.emplace(p.i, p.j).second) next.push_back(p);
                }
            }
            places.swap(next);
        }
    }

    // Adds what is seen from anywhere and no disc of a sample covers: surfaces that face between
    // the projections, those that all projections see at a slant, and those that are seen through
    // narrow openings, from few directions alone. So few rays are cast from each of many
    // directions; around one that finds an open place, all are.
    void closeGaps(float pixel, const std::function<void(double)>& progress,
                   std::vector<Sample>& chosen) {
        CoverGrid grid(kDiscReach * pixel);
        for (const Sample& s : chosen) grid.add(s.position, s.normal);
        constexpr int kTogether = 64;  // directions, which do not know of what the others find
        std::vector<std::vector<Place>> open(kTogether);
        for (int first = 0; first < kOpenDirections; first += kTogether) {
            pool_.forEach(kTogether, [&](size_t k, int) {
                throwIfAsked();
                const int d = first + int(k);
                open[k] = findOpen(makeLattice(spreadDirection(d, kOpenDirections), pixel),
                                   d % (kOpenStride * kOpenStride), pixel, grid);
            });
            for (int k = 0; k < kTogether; ++k) {
                if (open[size_t(k)].empty()) continue;
                fillOpen(makeLattice(spreadDirection(first + k, kOpenDirections), pixel),
                         std::move(open[size_t(k)]), pixel, grid, chosen);
            }
            progress(0.75 + 0.25 * double(first + kTogether) / kOpenDirections);
        }
    }

    // A ray that meets a surface at a slant finds the mean of a long strip of its textures. Samples
    // are seen from anywhere: what each shows is looked up anew, of a circle around it.
    void lookFromAbove(float pixel, std::vector<Sample>& samples) {
        constexpr size_t kChunk = 4096;
        constexpr float kDiameter = 1.41421356f, kSame = 0.1f;  // pixels: of a circle; depth
        pool_.forEach((samples.size() + kChunk - 1) / kChunk, [&](size_t chunk, int) {
            throwIfAsked();
            const size_t first = chunk * kChunk, end = std::min(samples.size(), first + kChunk);
            std::vector<Ray> rays;
            for (size_t i = first; i < end; ++i) {
                const Sample& s = samples[i];
                rays.push_back({s.position + s.normal * pixel, 0.0f, -s.normal, 2.0f * pixel});
            }
            std::vector<RayHit> hits(rays.size());
            caster_.cast(rays.data(), rays.size(), hits.data(), kDiameter);  // after a pixel's way
            rays_cast_ += rays.size();
            for (size_t k = 0; k < rays.size(); ++k) {
                // Not if something stands in between, or the side above is a back.
                if (!(std::abs(hits[k].t - pixel) <= kSame * pixel)) continue;
                samples[first + k].albedo = hits[k].albedo;
                samples[first + k].finish_key =
                    finishKey(materials_, hits[k].material, hits[k].finish);
            }
        });
    }

    const RayCaster& caster_;
    const std::vector<Material>& materials_;
    const float radius_;
    const PointBlockOptions& options_;
    ThreadPool& pool_;
    const CancelFlag& cancel_;
    std::atomic<uint64_t> rays_cast_{0};
};

}  // namespace

double pointBlockBytes(const PointBlockOptions& options) {
    const double pictures = double(options.directions) * kTests,
                 pixels = double(options.resolution) * options.resolution;
    // Lattices are finer where surfaces may be tilted more.
    const double cosine = std::cos(radians(options.tolerance_angle)),
                 cell = cosine * cosine * (options.equilateral ? std::sqrt(0.75) : 0.5);
    // Heights and counts; and the samples of all directions.
    return pictures * pixels * (sizeof(float) + 1) +
           double(options.directions) * 0.25 * kPi * pixels / cell * sizeof(Sample);
}

SurfelModel buildPointBlocks(const RayCaster& caster, const std::vector<Material>& materials,
                             const std::vector<float>& patch_width, const DBox3& bounds,
                             double area, const PointBlockOptions& options, ThreadPool& pool,
                             const CancelFlag& cancel,
                             const std::function<void(double fraction)>& progress,
                             PointBlockReport& report) {
    const Stopwatch watch;
    const DVec3 center = 0.5 * (bounds.min + bounds.max);
    const double radius = 0.5 * glm::length(bounds.max - bounds.min);
    if (bounds.isEmpty() || !(radius > 0.0))
        throw Error(ErrorCode::kInvalidArgument, "", "there is nothing to build a model of");
    Builder builder(caster, materials, radius, options, pool, cancel);
    SurfelModel model;
    model.kind = "point-blocks";
    model.bounds = enclosingFloatBox(bounds);
    model.area = area;
    constexpr int kCoarsest = 8;  // pixels along the sphere
    double done = 0.0, share = 0.7;
    std::vector<std::vector<Sample>> levels;
    std::vector<float> pixels;
    for (int resolution = options.resolution; resolution >= kCoarsest; resolution /= 2) {
        const float pixel = float(2.0 * radius / resolution);
        levels.push_back(
            builder.build(pixel, [&](double fraction) { progress(done + share * fraction); }));
        done += share;
        share *= 0.3;
        pixels.push_back(pixel);
        if (levels.back().empty()) levels.pop_back(), pixels.pop_back();
    }
    if (levels.empty())
        throw Error(ErrorCode::kInvalidArgument, "", "no ray hits anything: is it too fine?");
    std::map<uint32_t, uint8_t> index_of;
    for (const std::vector<Sample>& samples : levels) {
        for (const Sample& s : samples) index_of[s.finish_key] = 0;
    }
    model.finishes = makeFinishes(materials, patch_width, index_of);
    for (size_t l = 0; l < levels.size(); ++l) {
        const float pixel = pixels[l];
        std::vector<Surfel> surfels;
        for (const Sample& s : levels[l])
            surfels.push_back({s.position, s.normal, s.albedo, index_of.at(s.finish_key), 1.0f});
        SurfelLevel level =
            packSurfels(std::move(surfels), model.finishes, pixel, SurfelDiscs::kAlike);
        builder.findMasks(model.finishes, pixel, level);
        // From about the centre to where the source is.
        for (SurfelBlock& block : level.blocks) {
            block.bounds.min += Vec3(center);
            block.bounds.max += Vec3(center);
            block.cone_apex += Vec3(center);
        }
        model.levels.push_back(std::move(level));
    }
    const double pixel = 2.0 * radius / options.resolution;
    builder.report.rays = builder.rays();
    builder.report.samples_kept = model.levels[0].size();
    if (area > 0.0)
        builder.report.per_pixel = double(model.levels[0].size()) * pixel * pixel / area;
    report = builder.report;
    report.seconds = watch.seconds();
    return model;
}

}  // namespace stipple
