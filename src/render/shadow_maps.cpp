// SPDX-License-Identifier: Apache-2.0
#include <render/shadow_maps.h>

#include <core/stopwatch.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

namespace stipple {

namespace {

// What the first look has seen may reach this far beyond: texels.
constexpr double kPageMargin = 8.0;
// A level's pages lie within a rectangle of at most so many along a side; farther apart, they are
// taken from the next coarser level.
constexpr int64_t kMostPagesAlong = 1024;
// So many pages a frame (1 GB), shared by the levels of all lights; each may have a few.
constexpr size_t kMostPages = 16384, kLeastPages = 16;
// Pages are drawn in views of so many along a side, that lie still in the world as they do, and one
// more around. So a page is the same whichever others a frame needs.
constexpr int64_t kPagesOfView = 16;
// A coarser page stands by for what the first look has missed, so many levels up.
constexpr int kSpareLevels = 2;
// Below this share of its colour nothing is seen through haze.
constexpr float kHazeLeft = 1.0f / 256.0f;
// A lamp that gives a white surface less radiance than this, as exposed, casts no shadow there.
constexpr float kLeastLight = 1.0f / 1024.0f;
// What the first look has seen of a lamp's surroundings may reach this far beyond: a factor.
constexpr float kBehindSeen = 1.1f;
// Three depths in a row of the look are a plane's if what is left of their slope is less than this
// share.
constexpr float kUnevenness = 0.1f;
// And what floats may lose of a depth.
constexpr float kRounding = 1e-6f;

void sortUnique(std::vector<PageKey>& pages) {
    std::sort(pages.begin(), pages.end());
    pages.erase(std::unique(pages.begin(), pages.end()), pages.end());
}

// Unit normal, in camera space, of the plane that a place of the look and its neighbours lie on;
// null if they do not.
Vec3 normalOfPlane(const FirstLook& look, int x, int y) {
    const View& view = look.view;
    if (x == 0 || y == 0 || x + 1 == view.width || y + 1 == view.height) return Vec3(0.0f);
    // What is linear in the picture on a plane.
    const auto at = [&](int u, int v) {
        const float depth = look.depth[size_t(v) * size_t(view.width) + size_t(u)];
        return view.orthographic ? depth : 1.0f / depth;
    };
    const float here = at(x, y), left = at(x - 1, y), right = at(x + 1, y), above = at(x, y - 1),
                below = at(x, y + 1);
    const float along_x = 0.5f * (right - left), along_y = 0.5f * (below - above);
    const float most = kUnevenness * (std::abs(along_x) + std::abs(along_y)) + kRounding * here;
    // Beside the background of an orthographic view it is infinite.
    if (!(most < kInfinity && std::abs(left + right - 2.0f * here) <= most &&
          std::abs(above + below - 2.0f * here) <= most))
        return Vec3(0.0f);
    const float focal = float(view.focal), from_x = float(x) + 0.5f - float(view.center_x),
                from_y = float(y) + 0.5f - float(view.center_y);
    return glm::normalize(view.orthographic ? Vec3(focal * along_x, focal * along_y, -1.0f)
                                            : Vec3(focal * along_x, focal * along_y,
                                                   here - from_x * along_x - from_y * along_y));
}

// A place that the look has seen, camera space; normal: of the plane there, null if there is none.
struct Seen {
    Vec3 p, normal;
    float depth;
};

// Those no farther from the eye than that, in the order of the picture.
std::vector<Seen> seenPlaces(const FirstLook& look, float farthest, ThreadPool& pool) {
    std::vector<std::vector<Seen>> of_row(static_cast<size_t>(look.view.height));
    pool.forEach(of_row.size(), [&](size_t row, int) {
        const int y = int(row);
        for (int x = 0; x < look.view.width; ++x) {
            const float depth = look.depth[row * size_t(look.view.width) + size_t(x)];
            if (!(depth < kInfinity)) continue;
            Vec3 origin, direction;
            look.view.ray(float(x) + 0.5f, float(y) + 0.5f, origin, direction);
            const Vec3 p = origin + direction * depth;
            if (!(glm::length(p) > farthest))
                of_row[row].push_back({p, normalOfPlane(look, x, y), depth});
        }
    });
    std::vector<Seen> seen;
    for (const std::vector<Seen>& row : of_row) seen.insert(seen.end(), row.begin(), row.end());
    return seen;
}

// Of the angle at which light of that direction meets a plane; 1 where there is none.
float sineOf(const Vec3& normal, const Vec3& direction) {
    return normal == Vec3(0.0f) ? 1.0f : std::abs(glm::dot(normal, direction));
}

// The pages that a map needs, as they are found: places come in rows of the picture, so most are
// those of the place before.
class PageSet {
public:
    // x, y, width: in the map's texel units (metres, slopes).
    void add(double x, double y, float width) {
        // What lies a little nearer or farther may fall into the level beside.
        const int low = levelExponent(width * 0.93f), high = levelExponent(width * 1.07f);
        add(x, y, low, 0);
        if (high != low) add(x, y, high, 1);
        add(x, y, high + kSpareLevels, 2);
        if (pages_.size() < most_) return;
        sortUnique(pages_);
        most_ = 2 * pages_.size() + kFewPages;
    }
    std::vector<PageKey> take() {
        sortUnique(pages_);
        return std::move(pages_);
    }

private:
    static constexpr size_t kFewPages = 16384;

    // which: of a place's levels.
    void add(double x, double y, int exponent, size_t which) {
        const double texel = std::ldexp(1.0, exponent);
        const double per_page = 1.0 / (texel * kPageTexels), margin = kPageMargin * texel;
        for (size_t k = 0; k < 4; ++k) {
            const PageKey key{exponent,
                              int64_t(std::floor((x + (k & 1 ? margin : -margin)) * per_page)),
                              int64_t(std::floor((y + (k & 2 ? margin : -margin)) * per_page))};
            if (last_[which][k] == key) continue;
            last_[which][k] = key;
            pages_.push_back(key);
        }
    }

    static constexpr PageKey kNone{std::numeric_limits<int>::min(), 0, 0};
    std::vector<PageKey> pages_;
    std::array<std::array<PageKey, 4>, 3> last_ = {
        {{kNone, kNone, kNone, kNone}, {kNone, kNone, kNone, kNone}, {kNone, kNone, kNone, kNone}}};
    size_t most_ = kFewPages;
};

class ShadowBuilder {
public:
    ShadowBuilder(const Scene& scene, const View& view, const DepthDrawer& drawer,
                  ShadowCache& cache)
        : scene_(scene),
          view_(view),
          drawer_(drawer),
          cache_(cache),
          settings_(drawer.request.settings),
          sizes_(view, settings_.shadow_texel, {}, {}) {
        const DBox3 bounds = sceneBounds(scene);
        bounds_min_ = bounds.min;
        bounds_max_ = bounds.max;
        const float haze = scene.lighting.sky.haze_distance;
        if (haze > 0.0f) farthest_ = -haze * std::log(kHazeLeft);
    }

    std::unique_ptr<ShadowPages> build(const FirstLook& look, FrameStats& stats) {
        const std::vector<Seen> seen = seenPlaces(look, farthest_, drawer_.pool);
        const std::vector<Sun>& suns = scene_.lighting.suns;
        const std::vector<PointLight> lamps = lampsOf(scene_.lighting);
        // What is needed, all lights at once; then maps, one after the other.
        std::vector<MapRequest> of_suns(suns.size());
        std::vector<LampRequest> of_lamps(lamps.size());
        const float exposure =
            std::exp2(scene_.lighting.exposure + float(settings_.exposure)) / float(kPi);
        drawer_.pool.forEach(suns.size() + lamps.size(), [&](size_t i, int) {
            if (i < suns.size()) {
                of_suns[i] = requestSun(suns[i], seen);
            } else {
                of_lamps[i - suns.size()] = requestLamp(lamps[i - suns.size()], exposure, seen);
            }
        });
        size_t levels = 0;
        for (const MapRequest& request : of_suns) levels += request.levels();
        for (const LampRequest& request : of_lamps) {
            for (const MapRequest& face : request.faces) levels += face.levels();
        }
        most_pages_ = std::max(kMostPages / std::max(levels, size_t(1)), kLeastPages);
        std::vector<ShadowMap> sun_maps;
        for (MapRequest& request : of_suns) sun_maps.push_back(drawMap(std::move(request)));
        std::vector<LampShadow> lamp_maps;
        for (LampRequest& request : of_lamps) {
            for (size_t f = 0; f < kCubeFaces; ++f)
                request.shadow.faces[f] = drawMap(std::move(request.faces[f]));
            lamp_maps.push_back(std::move(request.shadow));
        }
        stats.shadow_points += drawn_.points_drawn;
        return std::make_unique<ShadowPages>(view_, settings_.shadow_texel, std::move(sun_maps),
                                             std::move(lamp_maps));
    }

private:
    // Pages of a map, sorted.
    struct MapRequest {
        LightSpace space;
        std::vector<PageKey> pages;

        size_t levels() const {
            size_t n = 0;
            for (size_t i = 0; i < pages.size(); ++i)
                n += i == 0 || pages[i].exponent != pages[i - 1].exponent;
            return n;
        }
    };
    struct LampRequest {
        LampShadow shadow;  // its faces are still to be drawn
        std::array<MapRequest, kCubeFaces> faces;
    };

    MapRequest requestSun(const Sun& sun, const std::vector<Seen>& seen) const {
        MapRequest request;
        request.space.world_from_light =
            lookAt(DVec3(0.0), -DVec3(sun.direction_to_light)).world_from_camera;
        const DMat3 sun_from_world = glm::transpose(request.space.world_from_light);
        const DMat3 sun_from_camera = sun_from_world * glm::transpose(view_.camera_from_world);
        const DVec3 eye = sun_from_world * view_.eye_world;
        PageSet pages;
        const Vec3 direction(glm::transpose(sun_from_camera)[2]);
        for (const Seen& s : seen) {
            const DVec3 p = eye + sun_from_camera * DVec3(s.p);
            pages.add(p.x, p.y, sizes_.wantedTexel(s.depth, sineOf(s.normal, direction)));
        }
        request.pages = pages.take();
        return request;
    }

    // Only where it gives enough light to be seen.
    LampRequest requestLamp(const PointLight& lamp, float exposure,
                            const std::vector<Seen>& seen) const {
        LampRequest request;
        LampShadow& shadow = request.shadow;
        shadow.position = lamp.position;
        if (lamp.is_spot) {
            shadow.lamp_from_world =
                glm::transpose(lookAt(DVec3(0.0), DVec3(lamp.axis)).world_from_camera);
        }
        const DMat3 lamp_from_camera =
            shadow.lamp_from_world * glm::transpose(view_.camera_from_world);
        const Mat3 world_from_lamp(glm::transpose(shadow.lamp_from_world));
        const DVec3 eye = shadow.lamp_from_world * (view_.eye_world - lamp.position);
        std::array<PageSet, kCubeFaces> pages;
        std::array<float, kCubeFaces> far_z{};
        std::array<DMat3, kCubeFaces> face_from_lamp;
        for (int f = 0; f < kCubeFaces; ++f) face_from_lamp[size_t(f)] = cubeFaceFromLamp(f);
        const Mat3 camera_from_lamp(glm::transpose(lamp_from_camera));
        for (const Seen& s : seen) {
            const DVec3 p_lamp = eye + lamp_from_camera * DVec3(s.p);
            const Vec3 light = incidentLight(lamp, world_from_lamp * Vec3(-p_lamp));
            if (std::max({light.x, light.y, light.z}) * exposure < kLeastLight) continue;
            const double distance = glm::length(p_lamp);
            if (!(distance > 0.0)) continue;
            const float sine = sineOf(s.normal, camera_from_lamp * Vec3(p_lamp / distance));
            const float texel = sizes_.wantedTexel(s.depth, sine);
            const size_t own = size_t(cubeFaceOf(Vec3(p_lamp)));
            const auto add = [&](size_t face, const DVec3& p) {
                pages[face].add(p.x / p.z, p.y / p.z, texel / float(p.z));
                far_z[face] = std::max(far_z[face], float(p.z));
            };
            const DVec3 p = face_from_lamp[own] * p_lamp;
            add(own, p);
            // Beside an edge of the cube, what is a margin farther has its pages in the next face.
            const double margin = kPageMargin * double(texel);
            if (std::max(std::abs(p.x), std::abs(p.y)) + margin < p.z) continue;
            for (size_t face = 0; face < kCubeFaces; ++face) {
                const DVec3 q = face_from_lamp[face] * p_lamp;
                if (face != own && q.z > 0.0 &&
                    std::max(std::abs(q.x), std::abs(q.y)) < q.z + margin)
                    add(face, q);
            }
        }
        for (size_t f = 0; f < kCubeFaces; ++f) {
            LightSpace& space = request.faces[f].space;
            space.is_lamp = true;
            space.lamp = lamp.position;
            space.world_from_light = glm::transpose(face_from_lamp[f] * shadow.lamp_from_world);
            // A power of two: pages are of use to other frames too.
            space.far_z = std::exp2(std::ceil(std::log2(far_z[f] * kBehindSeen)));
            request.faces[f].pages = pages[f].take();
        }
        return request;
    }

    ShadowMap drawMap(MapRequest request) {
        const LightSpace& space = request.space;
        std::vector<PageKey>& pages = request.pages;
        ShadowMap shadow;
        shadow.light_from_world = glm::transpose(space.world_from_light);
        if (pages.empty()) return shadow;
        shadow.first_exponent = pages.front().exponent;
        for (int exponent = shadow.first_exponent; !pages.empty(); ++exponent) {
            const auto end = std::find_if(pages.begin(), pages.end(), [&](const PageKey& key) {
                return key.exponent != exponent;
            });
            std::vector<PageKey> own(pages.begin(), end);
            pages.erase(pages.begin(), end);
            ShadowLevel level;
            level.texel = float(std::ldexp(1.0, exponent));
            if (space.is_lamp) level.origin = shadow.light_from_world * space.lamp;
            if (!own.empty() && !drawLevel(own, space, level)) {
                for (const PageKey& key : own)
                    pages.push_back({exponent + 1, key.x >> 1, key.y >> 1});
                sortUnique(pages);
            }
            shadow.levels.push_back(std::move(level));
        }
        return shadow;
    }

    // False if the pages lie too far apart, or are too many.
    bool drawLevel(const std::vector<PageKey>& pages, const LightSpace& space, ShadowLevel& level) {
        int64_t x0 = pages[0].x, x1 = x0, y0 = pages[0].y, y1 = y0;
        for (const PageKey& key : pages) {
            x0 = std::min(x0, key.x), x1 = std::max(x1, key.x);
            y0 = std::min(y0, key.y), y1 = std::max(y1, key.y);
        }
        if (x1 - x0 >= kMostPagesAlong || y1 - y0 >= kMostPagesAlong || pages.size() > most_pages_)
            return false;
        level.columns = int(x1 - x0) + 1;
        level.rows = int(y1 - y0) + 1;
        level.page_slot.assign(size_t(level.columns) * size_t(level.rows), -1);
        for (size_t i = 0; i < pages.size(); ++i) {
            level.page_slot[size_t(pages[i].y - y0) * size_t(level.columns) +
                            size_t(pages[i].x - x0)] = int32_t(i);
        }
        drawMissing(pages, space);
        double origin_z = std::numeric_limits<double>::infinity();
        for (const PageKey& key : pages) {
            level.pages.push_back({cache_.find(space, key)});
            origin_z = std::min(origin_z, level.pages.back().page->origin_z);
        }
        if (!(origin_z < std::numeric_limits<double>::infinity())) origin_z = 0.0;
        for (ShadowLevel::PlacedPage& placed : level.pages)  // infinite: nothing is there
            placed.behind = float(placed.page->origin_z - origin_z);
        if (space.is_lamp) {
            level.corner_x = double(x0) * kPageTexels;
            level.corner_y = double(y0) * kPageTexels;
        } else {
            const double page = double(level.texel) * kPageTexels;
            level.origin = DVec3(double(x0) * page, double(y0) * page, origin_z);
        }
        return true;
    }

    // Of one level, sorted: those that the cache lacks.
    void drawMissing(const std::vector<PageKey>& pages, const LightSpace& space) {
        std::map<PageKey, std::vector<PageKey>> views;
        for (const PageKey& key : pages) {
            if (cache_.find(space, key)) continue;
            const auto part = [](int64_t at) {
                return (at >= 0 ? at : at - (kPagesOfView - 1)) / kPagesOfView;
            };
            views[{key.exponent, part(key.x), part(key.y)}].push_back(key);
        }
        for (const auto& [part, missing] : views) drawPages(part, missing, space);
    }

    // Pages of one view.
    void drawPages(const PageKey& part, const std::vector<PageKey>& keys, const LightSpace& space) {
        constexpr int kAlong = int(kPagesOfView) + 2;
        const int64_t x0 = part.x * kPagesOfView - 1, y0 = part.y * kPagesOfView - 1;
        const double texel = std::ldexp(1.0, part.exponent), page = texel * kPageTexels;
        std::vector<std::shared_ptr<ShadowPage>> drawn(size_t(kAlong) * kAlong);
        std::vector<std::shared_ptr<ShadowPage>> own;
        for (const PageKey& key : keys) {
            own.push_back(std::make_shared<ShadowPage>());
            drawn[size_t(key.y - y0) * kAlong + size_t(key.x - x0)] = own.back();
        }
        View view;
        view.width = view.height = kAlong * kPageTexels;
        view.turnTo(glm::transpose(space.world_from_light));
        view.focal = 1.0 / texel;
        bool is_empty = false;
        if (space.is_lamp) {
            view.eye_world = space.lamp;
            view.center_x = -double(x0) * kPageTexels;
            view.center_y = -double(y0) * kPageTexels;
            view.near_z = kLampClearance;
            view.far_z = space.far_z;
        } else {
            const DVec3 corner(double(x0) * page, double(y0) * page, 0.0);
            double z_min, z_max;
            depthRange(space.world_from_light, corner, kAlong * page, z_min, z_max);
            is_empty = !(z_min <= z_max);
            const double origin_z = is_empty ? 0.0 : std::floor(z_min) - 1.0;
            for (const auto& p : own)
                p->origin_z = is_empty ? std::numeric_limits<double>::infinity() : origin_z;
            view.orthographic = true;
            view.eye_world = space.world_from_light * DVec3(corner.x, corner.y, origin_z);
            view.near_z = 0.5f;
            view.far_z = float(z_max - origin_z + 1.0);
        }
        if (!is_empty) drawDepths(view, drawn);
        for (size_t i = 0; i < keys.size(); ++i) cache_.keep(space, keys[i], own[i]);
    }

    // pages: rows of the view's; null: not wanted.
    void drawDepths(const View& view, const std::vector<std::shared_ptr<ShadowPage>>& pages) {
        const auto pageOf = [&](const SubpixelRect& inner) {
            return pages[size_t(inner.y0 / kPageTexels) * size_t(view.width / kPageTexels) +
                         size_t(inner.x0 / kPageTexels)]
                .get();
        };
        const TakeDepths take = [&](const SubpixelRect& inner, const DepthTile& tile) {
            float* out = pageOf(inner)->depth.data();
            for (int y = inner.y0; y < inner.y1; ++y) {
                for (int x = inner.x0; x < inner.x1; ++x)
                    *out++ = DepthTile::depthOf(tile.row(y)[x]);
            }
        };
        drawer_.draw(
            view, shadowSettings(settings_),
            [&](const SubpixelRect& inner) { return pageOf(inner) != nullptr; }, false, take,
            drawn_);
    }

    // Depths, from the sun, at which the column over a square of sun space meets the scene's
    // bounds: casters outside of what the camera sees are in it. Empty (z_min > z_max): it does
    // not.
    void depthRange(const DMat3& world_from_sun, const DVec3& corner, double side, double& z_min,
                    double& z_max) const {
        const DVec3 p = world_from_sun * corner, u = world_from_sun[0] * side,
                    v = world_from_sun[1] * side, along = world_from_sun[2];
        z_min = -1e30, z_max = 1e30;
        for (int i = 0; i < 3; ++i) {
            const double low = p[i] + std::min(u[i], 0.0) + std::min(v[i], 0.0),
                         high = p[i] + std::max(u[i], 0.0) + std::max(v[i], 0.0);
            const double to_first = bounds_min_[i] - high, to_last = bounds_max_[i] - low;
            if (std::abs(along[i]) < 1e-9) {
                if (to_first > 0.0 || to_last < 0.0) z_max = -1e31;
                continue;
            }
            const double a = to_first / along[i], b = to_last / along[i];
            z_min = std::max(z_min, std::min(a, b));
            z_max = std::min(z_max, std::max(a, b));
        }
    }

    const Scene& scene_;
    const View& view_;
    const DepthDrawer& drawer_;
    ShadowCache& cache_;
    const RenderSettings& settings_;
    const ShadowPages sizes_;  // empty: for the sizes it asks for
    DVec3 bounds_min_, bounds_max_;
    size_t most_pages_ = kMostPages;  // of a level
    float farthest_ = kInfinity;      // from the eye, metres: behind that haze hides everything
    FrameStats drawn_;
};

}  // namespace

std::unique_ptr<ShadowPages> makeShadowMaps(const Scene& scene, const View& view,
                                            const FirstLook& look, const DepthDrawer& drawer,
                                            ShadowCache& cache, FrameStats& stats) {
    const Stopwatch watch;
    cache.begin(drawer.request.settings);
    std::unique_ptr<ShadowPages> maps =
        ShadowBuilder(scene, view, drawer, cache).build(look, stats);
    cache.end((size_t(drawer.request.settings.cache_mb) << 20) / 4);
    stats.shadow_bytes = std::max(maps->bytes(), cache.bytes());
    stats.phases.emplace_back("shadows", watch.seconds());
    return maps;
}

}  // namespace stipple
